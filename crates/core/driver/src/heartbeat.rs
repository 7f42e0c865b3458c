//! The heartbeat: a signal that counts up while the simulation ticks, so that the PLC knows that it is alive.

use tickbus_base::time::{Nanos, Pace};
use tickbus_fieldbus::{Heartbeat, Role};
use tickbus_image::signal::{DataType, Signal, Slot};

use tickbus_driver_cfg::Config;

/// One heartbeat within the tick.
#[derive(Clone, Debug)]
pub(super) struct Beat {
    slot: usize,
    /// The highest count, after which the count wraps to 0.
    last: u64,
    is_integer_slot: bool,
    every: Nanos,
    /// `None` before the first tick.
    pace: Option<Pace>,
    count: u64,
}

impl Beat {
    fn new(signal: &Signal, slot: usize, every: Nanos) -> Self {
        let bits = match signal.data_type {
            DataType::Bool => 1,
            other => 8 * other.size_bytes() - usize::from(other.is_signed()),
        };
        Self {
            slot,
            last: u64::MAX >> (64 - bits),
            is_integer_slot: signal.is_integer_slot(),
            every,
            pace: None,
            count: 0,
        }
    }

    /// Returns the heartbeats that the end with `role` sends.
    pub(super) fn all(config: &Config, role: Role) -> Box<[Self]> {
        let beats = config.life_signs.beats(&config.table, role);
        beats
            .map(|Heartbeat { signal, every }| {
                Self::new(&config.table.signals[signal], signal, every)
            })
            .collect()
    }

    /// Returns the index of the signal, which is that of its slot.
    pub(super) fn signal(&self) -> usize {
        self.slot
    }

    /// Runs in a tick at `now`: counts up if due, and puts the count into its slot.
    pub(super) fn beat(&mut self, now: Nanos, slots: &mut [Slot]) {
        let every = self.every;
        if self
            .pace
            .get_or_insert_with(|| Pace::new(now, every))
            .take(now)
        {
            self.count = if self.count == self.last {
                0
            } else {
                self.count + 1
            };
        }
        slots[self.slot] = if self.is_integer_slot {
            Slot::from_unsigned(self.count)
        } else {
            #[expect(
                clippy::cast_precision_loss,
                reason = "at most 32 bits where it is a double"
            )]
            let count = self.count as f64;
            Slot::from_real(count)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beats(signals: &str, beats: &str) -> Config {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\nheartbeat = {beats}\n{signals}"
        );
        Config::parse("driver.cfg", &text, &crate::KINDS)
            .unwrap_or_else(|mistakes| panic!("{mistakes}"))
    }

    const ONE: &str =
        "[[signal]]\nname = \"other\"\naddress = \"%QX0.0\"\n[[signal]]\nname = \"life\"\n";

    #[test]
    fn an_integer_counts_once_in_each_interval_and_stands_still_without_ticks() {
        let signals = format!("{ONE}address = \"%IB3\"\ntype = \"SINT\"\n");
        let config = beats(&signals, "{ signal = \"life\", every = \"10ms\" }");
        let mut beats = Beat::all(&config, Role::Device);
        let mut slots = [Slot::default(); 2];
        let mut at = |millis| {
            beats[0].beat(Nanos::from_millis(millis), &mut slots);
            slots[1].real()
        };
        let seen: Vec<f64> = [0, 5, 10, 19, 500, 505, 510].map(&mut at).to_vec();
        assert_eq!(
            seen,
            [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0],
            "a pause is one beat"
        );
        let last = (52..200).map(|tens| at(tens * 10)).fold(0.0, f64::max);
        assert!(
            (last - 127.0).abs() < f64::EPSILON,
            "it begins anew after {last}"
        );
        assert!(Beat::all(&config, Role::Controller).is_empty());
    }

    #[test]
    fn a_bool_toggles_and_64_bits_are_counted_as_an_integer() {
        let signals =
            format!("{ONE}address = \"%IX0.3\"\n[[signal]]\nname = \"long\"\naddress = \"%IL8\"\n");
        let both =
            "[{ signal = \"life\", every = \"1ms\" }, { signal = \"long\", every = \"1ms\" }]";
        let config = beats(&signals, both);
        let mut beats = Beat::all(&config, Role::Device);
        let mut slots = [Slot::default(); 3];
        for (millis, toggles) in [(0, 1.0), (1, 0.0), (2, 1.0)] {
            let now = Nanos::from_millis(millis);
            beats.iter_mut().for_each(|beat| beat.beat(now, &mut slots));
            assert_eq!(slots[1].real().to_bits(), f64::to_bits(toggles));
        }
        assert_eq!(slots[2].unsigned(), 3);
    }

    #[test]
    fn one_file_serves_both_ends_and_the_other_end_watches_the_heartbeat() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\nmax_age = \"300ms\"\n\
                    alive = { signal = \"plc\", within = \"500ms\" }\n\
                    heartbeat = [{ signal = \"fast\", every = \"10ms\" }, { signal = \"slow\", every = \"1s\" }]\n\
                    [[signal]]\nname = \"plc\"\naddress = \"%QX0.3\"\n\
                    [[signal]]\nname = \"fast\"\naddress = \"%IW2\"\n\
                    [[signal]]\nname = \"slow\"\naddress = \"%IB0\"\n";
        let config = Config::parse("driver.cfg", text, &crate::KINDS)
            .unwrap_or_else(|wrong| panic!("{wrong}"));
        let (signs, table) = (&config.life_signs, &config.table);
        let watched = |role| -> Vec<(String, std::ops::Range<usize>, u8, Nanos)> {
            let watches = signs
                .watches(table, role, config.timing.max_age)
                .into_iter();
            watches
                .map(|w| (w.name, w.bytes, w.mask, w.within))
                .collect()
        };
        let millis = Nanos::from_millis;
        let plc = ("plc".to_owned(), 0..1, 8, millis(500));
        assert_eq!(watched(Role::Device), [plc]);
        let fast = ("fast".to_owned(), 2..4, 0xff, millis(300));
        let slow = ("slow".to_owned(), 0..1, 0xff, millis(5000));
        assert_eq!(watched(Role::Controller), [fast, slow]);
        assert_eq!(signs.beats(table, Role::Device).count(), 2);
        assert_eq!(signs.beats(table, Role::Controller).count(), 0);
    }
}
