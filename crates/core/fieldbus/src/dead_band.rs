//! Decides if a frame differs enough from another one to be worth sending.

use tickbus_image::signal::{Area, Plan, Signal, SignalTable, Slot};

/// Compares the frames that one station sends, using the dead bands of its signals.
///
/// A signal with a dead band has changed if its value differs by more than that band from the compared value. A signal
/// without one has changed if any of its bits has.
#[derive(Debug)]
pub struct DeadBands {
    /// A mask of the bits that are compared exactly: all that no dead band covers.
    exact: Box<[u8]>,
    /// Decodes only the signals with a dead band.
    plan: Plan,
    bands: Box<[Band]>,
    before: Box<[Slot]>,
    now: Box<[Slot]>,
}

#[derive(Clone, Copy, Debug)]
struct Band {
    width: f64,
    kind: Kind,
}

/// The type of value in the signal's slot.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Real,
    Signed,
    Unsigned,
}

impl DeadBands {
    /// Compares the frames sent in `area` of the station with index `station`.
    pub fn new(table: &SignalTable, station: usize, area: Area) -> Self {
        let of_frame = |signal: &&Signal| {
            signal.station == station && signal.area == area && signal.dead_band > 0.0
        };
        let signals: Vec<Signal> = table.signals.iter().filter(of_frame).cloned().collect();
        let mut exact = vec![0xFF; table.stations[station].bytes(area)];
        for signal in &signals {
            exact[signal.byte..][..signal.data_type.size_bytes()].fill(0);
        }
        let bands = signals.iter().map(|signal| Band {
            width: signal.dead_band,
            kind: match (signal.is_integer_slot(), signal.data_type.is_signed()) {
                (false, _) => Kind::Real,
                (true, true) => Kind::Signed,
                (true, false) => Kind::Unsigned,
            },
        });
        let slots = vec![Slot::default(); signals.len()];
        Self {
            exact: exact.into(),
            bands: bands.collect(),
            before: slots.clone().into(),
            now: slots.into(),
            plan: Plan::new(
                &SignalTable {
                    stations: table.stations.clone(),
                    signals,
                    structures: Vec::new(),
                },
                station,
                area,
            ),
        }
    }

    /// Returns true if any signal has changed from frame `before` to frame `now`.
    ///
    /// # Panics
    ///
    /// If a frame does not have the station's size.
    pub fn differ(&mut self, before: &[u8], now: &[u8]) -> bool {
        if before == now {
            return false;
        }
        let pairs = before.iter().zip(now).zip(&self.exact);
        if pairs.fold(0, |all, ((before, now), mask)| {
            all | ((before ^ now) & mask)
        }) != 0
        {
            return true;
        }
        self.plan.decode(before, &mut self.before);
        self.plan.decode(now, &mut self.now);
        let values = self.before.iter().zip(&self.now).zip(&self.bands);
        values.fold(false, |any, ((before, now), band)| {
            any | band.is_left(*before, *now)
        })
    }
}

impl Band {
    fn is_left(self, before: Slot, now: Slot) -> bool {
        match self.kind {
            Kind::Real => {
                let (before, now) = (before.real(), now.real());
                // Equal infinities count as the same value, though their difference is NaN.
                #[expect(clippy::float_cmp, reason = "equal to the last bit is no change")]
                let same = before == now || (before.is_nan() && now.is_nan());
                let moved = (now - before).abs();
                !same && (moved.is_nan() || moved > self.width)
            }
            Kind::Signed => self.is_beyond(before.signed().abs_diff(now.signed())),
            Kind::Unsigned => self.is_beyond(before.unsigned().abs_diff(now.unsigned())),
        }
    }

    #[expect(
        clippy::cast_precision_loss,
        reason = "a difference that large is beyond any dead band that was meant"
    )]
    fn is_beyond(self, difference: u64) -> bool {
        difference as f64 > self.width
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::{DataType, Scale};

    fn signal(byte: usize, data_type: DataType, dead_band: f64) -> Signal {
        Signal {
            dead_band,
            ..Signal::new(format!("at {byte}"), Area::Input, byte, data_type)
        }
    }

    fn dead_bands(signals: Vec<Signal>) -> DeadBands {
        let table = SignalTable::of_one_station(16, 0, signals);
        DeadBands::new(&table, 0, Area::Input)
    }

    fn frame(byte: usize, value: &[u8]) -> [u8; 16] {
        let mut frame = [0; 16];
        frame[byte..][..value.len()].copy_from_slice(value);
        frame
    }

    #[test]
    fn without_a_dead_band_every_bit_counts() {
        let mut bands = dead_bands(vec![
            signal(0, DataType::Bool, 0.0),
            signal(2, DataType::Int, 0.0),
        ]);
        assert!(!bands.differ(&frame(0, &[1]), &frame(0, &[1])));
        assert!(bands.differ(&frame(0, &[0]), &frame(0, &[1])));
        assert!(bands.differ(&frame(2, &[0, 0]), &frame(2, &[0, 1])));
    }

    #[test]
    fn a_value_has_changed_when_it_leaves_its_dead_band_either_way() {
        let scale = Scale::through([0.0, 1000.0], [0.0, 10.0]);
        let scaled = Signal {
            scale,
            ..signal(2, DataType::Int, 0.05)
        };
        let mut bands = dead_bands(vec![signal(0, DataType::Bool, 0.0), scaled]);
        let at = |raw: i16| frame(2, &raw.to_be_bytes());
        assert!(!bands.differ(&at(500), &at(505)));
        assert!(!bands.differ(&at(500), &at(495)));
        assert!(bands.differ(&at(500), &at(506)));
        assert!(bands.differ(&at(500), &at(494)));
        let mut with_bit = at(500);
        with_bit[0] = 1;
        assert!(bands.differ(&at(500), &with_bit), "a BOOL has none");
    }

    #[test]
    fn at_the_edge_of_its_dead_band_a_value_has_not_changed() {
        let mut bands = dead_bands(vec![
            signal(0, DataType::Real, 0.5),
            signal(4, DataType::Real, 0.0),
        ]);
        let at = |value: f32| frame(0, &value.to_be_bytes());
        assert!(!bands.differ(&at(1.0), &at(1.5)));
        assert!(!bands.differ(&at(1.0), &at(0.5)));
        assert!(bands.differ(&at(1.0), &at(1.5 + f32::EPSILON)));
        // A dead band of zero means no dead band: the bits are compared, and minus zero has different bits.
        let bare = |value: f32| frame(4, &value.to_be_bytes());
        assert!(bands.differ(&bare(0.0), &bare(-0.0)));
    }

    #[test]
    fn what_is_no_number_differs_from_every_number_and_not_from_itself() {
        let mut bands = dead_bands(vec![signal(4, DataType::Real, 1e9)]);
        let at = |value: f32| frame(4, &value.to_be_bytes());
        assert!(bands.differ(&at(1.0), &at(f32::NAN)));
        assert!(bands.differ(&at(f32::NAN), &at(1.0)));
        assert!(!bands.differ(&at(f32::NAN), &at(-f32::NAN)));
        assert!(bands.differ(&at(1.0), &at(f32::INFINITY)));
        assert!(bands.differ(&at(f32::NEG_INFINITY), &at(f32::INFINITY)));
        assert!(!bands.differ(&at(-0.0), &at(0.0)));
    }

    #[test]
    fn integers_of_64_bits_are_compared_as_integers() {
        for (data_type, low, high) in [
            (DataType::Lint, (-1_i64).to_be_bytes(), 1_i64.to_be_bytes()),
            (
                DataType::Ulint,
                (u64::MAX - 2).to_be_bytes(),
                u64::MAX.to_be_bytes(),
            ),
        ] {
            let (low, high) = (frame(8, &low), frame(8, &high));
            let mut narrow = dead_bands(vec![signal(8, data_type, 1.0)]);
            assert!(narrow.differ(&low, &high));
            let mut wide = dead_bands(vec![signal(8, data_type, 2.0)]);
            assert!(!wide.differ(&low, &high));
        }
    }

    #[test]
    fn bytes_that_no_signal_covers_count() {
        let mut bands = dead_bands(vec![signal(2, DataType::Int, 5.0)]);
        assert!(bands.differ(&frame(9, &[0]), &frame(9, &[1])));
    }
}
