//! The raw values of signals: their bits in the frame, without scale.

use super::{Area, DataType, Plan, Signal, SignalTable, Slot, Width};

/// The raw values of the signals of one area of all stations, for buses that carry value by value.
#[derive(Debug)]
pub struct RawValues {
    /// One plan per station.
    plans: Vec<Plan>,
    /// The bits of each signal of the table, as a slot of an unsigned number.
    slots: Vec<Slot>,
    /// Per signal of the table, whether its slot holds an integer.
    is_long: Vec<bool>,
    /// The indices of the area's signals in the table, by station.
    signals: Vec<Vec<usize>>,
}

impl RawValues {
    /// The values of `area`, all of them 0.
    pub fn new(table: &SignalTable, area: Area) -> Self {
        let table = bits_of(table);
        let stations = 0..table.stations.len();
        let here = |station| {
            let signals = table.signals.iter().enumerate();
            let here =
                signals.filter(move |(_, signal)| signal.station == station && signal.area == area);
            here.map(|(index, _)| index).collect()
        };
        Self {
            plans: stations
                .clone()
                .map(|station| Plan::new(&table, station, area))
                .collect(),
            slots: vec![Slot::default(); table.signals.len()],
            is_long: table.signals.iter().map(Signal::is_integer_slot).collect(),
            signals: stations.map(here).collect(),
        }
    }

    /// The area's signals of a station, as indices in the table.
    pub fn signals(&self, station: usize) -> &[usize] {
        &self.signals[station]
    }

    /// Reads the values of a frame.
    ///
    /// # Panics
    ///
    /// When the frame is shorter than the station's area.
    pub fn take(&mut self, station: usize, frame: &[u8]) {
        self.plans[station].decode(frame, &mut self.slots);
    }

    /// Writes the values to a frame; bits that no signal covers become zero.
    ///
    /// # Panics
    ///
    /// The same as for [`take`](Self::take).
    pub fn give(&self, station: usize, frame: &mut [u8]) {
        self.plans[station].encode(&self.slots, frame);
    }

    /// The bits of a signal, extended by zeros.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an unsigned number of 32 bits at most"
    )]
    pub fn bits(&self, signal: usize) -> u64 {
        let slot = self.slots[signal];
        if self.is_long[signal] {
            slot.unsigned()
        } else {
            slot.real() as u64
        }
    }

    /// Sets the bits of a signal, which must fit its type.
    #[expect(clippy::cast_precision_loss, reason = "at most 32 bits")]
    pub fn set(&mut self, signal: usize, bits: u64) {
        self.slots[signal] = if self.is_long[signal] {
            Slot::from_unsigned(bits)
        } else {
            Slot::from_real(bits as f64)
        };
    }
}

/// The table with every signal as an unsigned integer of the same size: so a plan preserves the bits of all
/// types, NaN included.
fn bits_of(table: &SignalTable) -> SignalTable {
    let signals = table.signals.iter().map(|signal| Signal {
        data_type: match signal.data_type.width() {
            Width::Bit => DataType::Bool,
            Width::Byte => DataType::Usint,
            Width::Word => DataType::Uint,
            Width::Double => DataType::Udint,
            Width::Long => DataType::Ulint,
        },
        scale: None,
        fail_safe: Slot::default(),
        states_fail_safe: false,
        ..signal.clone()
    });
    SignalTable {
        stations: table.stations.clone(),
        signals: signals.collect(),
        structures: table.structures.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{ByteOrder, Scale};

    #[test]
    fn every_bit_of_every_type_goes_both_ways() {
        for data_type in DataType::ALL {
            let all = u64::MAX >> (64 - data_type.width().bits());
            for order in [ByteOrder::Abcd, ByteOrder::Dcba] {
                let signal = Signal {
                    order,
                    scale: Scale::through([0.0, 1.0], [5.0, 7.0]),
                    ..Signal::new("a", Area::Output, 0, data_type)
                };
                let table = SignalTable::of_one_station(0, 8, vec![signal]);
                let mut values = RawValues::new(&table, Area::Output);
                for bits in [0, 1, all, all - all / 3] {
                    values.set(0, bits);
                    let mut frame = [0; 8];
                    values.give(0, &mut frame);
                    values.set(0, 0);
                    values.take(0, &frame);
                    assert_eq!(values.bits(0), bits, "{data_type} {order:?}");
                }
            }
        }
    }

    #[test]
    fn nan_stays_the_nan_that_it_is() {
        let signal = Signal::new("a", Area::Output, 0, DataType::Real);
        let table = SignalTable::of_one_station(0, 4, vec![signal]);
        let mut values = RawValues::new(&table, Area::Output);
        values.set(0, 0x7FC0_1234);
        let mut frame = [0; 4];
        values.give(0, &mut frame);
        assert_eq!(frame, [0x7F, 0xC0, 0x12, 0x34]);
    }
}
