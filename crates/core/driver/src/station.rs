//! One station of an open driver, as the tick sees it.

use super::{Code, SlotMap};
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Area, Plan, SignalTable, Slot};
use tickbus_image::{Arrival, TickEnd, is_stale};

/// One station of an open driver, as the tick sees it.
#[derive(Debug)]
pub(super) struct Station {
    /// The station's place in the signal table.
    index: usize,
    pub(super) encode: Plan,
    decode: Plan,
    /// True if the slots hold fail-safe values.
    pub(super) stale: bool,
    /// The result of the last exchange for this station.
    pub(super) status: Code,
}

impl Station {
    pub(super) fn new(table: &SignalTable, index: usize, (tx, rx): (Area, Area)) -> Self {
        let (encode, decode) = (Plan::new(table, index, tx), Plan::new(table, index, rx));
        Self {
            index,
            encode,
            decode,
            stale: true,
            status: Code::Stale,
        }
    }

    /// Notes that the slots hold values from a recording instead of received ones, with this status. The next
    /// [`receive`](Self::receive) shows the received values again.
    pub(super) fn shown_instead(&mut self, image: &mut TickEnd, status: Code) {
        self.status = status;
        self.stale = status == Code::Stale;
        image.overridden(self.index);
    }

    /// Receives into the slots from the frame taken over last, and sets the status. Returns the age of the data.
    #[inline]
    pub(super) fn receive(
        &mut self,
        image: &mut TickEnd,
        (now, max_age): (Nanos, Nanos),
        slots: &mut [Slot],
        map: &SlotMap,
    ) -> Nanos {
        match image.unchanged(self.index, now) {
            Some((age, is_valid)) if !is_stale(age, max_age, is_valid) => {
                self.stale = false;
                self.status = Code::Unchanged;
                age
            }
            _ => self.receive_news(image, (now, max_age), slots, map),
        }
    }

    #[inline(never)]
    fn receive_news(
        &mut self,
        image: &mut TickEnd,
        (now, max_age): (Nanos, Nanos),
        slots: &mut [Slot],
        map: &SlotMap,
    ) -> Nanos {
        let mut receiver = Receiver {
            decode: &self.decode,
            slots,
            map,
        };
        let arrival = image.read(self.index, (now, max_age), &mut receiver);
        if arrival.stale && !self.stale {
            image.shown_instead(self.index, &mut receiver);
            self.decode.fail_safe(slots);
        }
        self.stale = arrival.stale;
        self.status = match arrival {
            Arrival { stale: true, .. } => Code::Stale,
            Arrival { fresh: true, .. } => Code::Fresh,
            Arrival { .. } => Code::Unchanged,
        };
        arrival.age
    }
}

/// Puts a station's received values into the slots.
struct Receiver<'a> {
    decode: &'a Plan,
    slots: &'a mut [Slot],
    map: &'a SlotMap,
}

impl tickbus_image::Receiver for Receiver<'_> {
    #[inline]
    fn levels(&mut self, bytes: &[u8]) {
        self.decode.decode(bytes, self.slots);
    }

    #[inline]
    fn edges(&mut self, signal: usize, count: u32) {
        if let Some(slot) = self.map.edges[signal] {
            self.slots[slot] = Slot::from_real(f64::from(count));
        }
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use crate::SlotMap;
    use crate::frames::directions;
    use tickbus_driver_cfg::Config;
    use tickbus_fieldbus::Role;
    use tickbus_image::image;

    #[test]
    fn data_that_do_not_count_are_delivered_as_fail_safe_values_without_edges() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
                    [[signal]]\nname = \"go\"\naddress = \"%QX0.0\"\nlatch = \"both\"\n\
                    [[signal]]\nname = \"speed\"\naddress = \"%QB1\"\nfail_safe = 7\n";
        let config = Config::parse("driver.cfg", text, &crate::KINDS).expect("right");
        let (table, role) = (&config.table, Role::Device);
        let (mut tick, mut bus) = image(directions(table, role));
        let mut station = Station::new(table, 0, role.areas());
        let map = SlotMap::new(table, role);
        let mut slots = vec![Slot::default(); map.count];
        let edges = map.edges[0].expect("it is latched");
        let mut shown = |(now, came): (i64, i64), valid, bytes: &[u8]| {
            bus.received(0, Nanos(came), bytes, valid);
            bus.hand_over();
            tick.update();
            station.receive(&mut tick, (Nanos(now), Nanos(10)), &mut slots, &map);
            let real = |slot: usize| slots[slot].real();
            (station.stale, real(0), real(1), real(edges))
        };
        assert_eq!(shown((2, 1), true, &[1, 9]), (false, 1.0, 9.0, 1.0));
        assert_eq!(shown((2, 1), false, &[0, 8]), (true, 0.0, 7.0, 0.0));
        assert_eq!(shown((2, 1), false, &[1, 8]), (true, 0.0, 7.0, 0.0));
        assert_eq!(shown((2, 1), true, &[1, 9]), (false, 1.0, 9.0, 0.0));
        // Too old when the tick looks at it: the edge waits.
        assert_eq!(shown((20, 9), true, &[0, 3]), (true, 0.0, 7.0, 0.0));
        assert_eq!(shown((21, 20), true, &[0, 4]), (false, 0.0, 4.0, 1.0));
    }

    /// Returns a configuration with one byte, whose fail-safe value is 7.
    fn one_byte() -> Config {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
                    [[signal]]\nname = \"speed\"\naddress = \"%QB0\"\nfail_safe = 7\n";
        Config::parse("driver.cfg", text, &crate::KINDS).expect("right")
    }

    #[test]
    fn a_station_shows_the_last_value_while_it_counts_and_else_the_fail_safe_one() {
        let mut codes = [0; 3];
        (1..=16).for_each(|seed| shown_as_the_model_says(seed, &mut codes));
        assert!(codes.iter().all(|count| *count > 500), "{codes:?}");
    }

    fn shown_as_the_model_says(seed: u64, codes: &mut [u32; 3]) {
        const MAX_AGE: i64 = 20;
        let (config, role) = (one_byte(), Role::Device);
        let table = &config.table;
        let (mut tick, mut bus) = image(directions(table, role));
        let mut station = Station::new(table, 0, role.areas());
        let map = SlotMap::new(table, role);
        let mut slots = vec![Slot::from_real(7.0); map.count];
        // The model: the last value, the time of its arrival, and whether a tick has seen it.
        let (mut value, mut heard, mut is_valid, mut is_new) = (7, None, true, false);
        let (mut now, mut random) = (0, seed);
        for step in 0..1_000 {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let draw = |shift: u32, below: u64| (random >> shift) % below;
            now += i64::try_from(draw(20, 5) * draw(24, 5)).expect("small");
            match draw(28, 8) {
                0 => {
                    value = draw(34, 256).to_le_bytes()[0];
                    (heard, is_valid, is_new) = (Some(now), draw(44, 4) != 0, true);
                    bus.received(0, Nanos(now), &[value], is_valid);
                }
                1 => {
                    heard = Some(now);
                    bus.touch(0, Nanos(now));
                }
                2 => {
                    // A PLC changes to STOP or RUN without sending a frame.
                    is_valid = draw(34, 2) == 0;
                    bus.set_valid(0, is_valid);
                }
                3 => {
                    // A recording is shown instead.
                    let code = [Code::Fresh, Code::Unchanged, Code::Stale]
                        [usize::from(step % 3 > 0) + usize::from(step % 3 > 1)];
                    let bent = if code == Code::Stale { 7.0 } else { 300.0 };
                    slots[0] = Slot::from_real(bent);
                    station.shown_instead(&mut tick, code);
                }
                _ => {
                    bus.hand_over();
                    tick.update();
                    let age =
                        station.receive(&mut tick, (Nanos(now), Nanos(MAX_AGE)), &mut slots, &map);
                    let expected_age = heard.map_or(Nanos::MAX, |heard| Nanos(now - heard));
                    let counts = is_valid && expected_age.0 <= MAX_AGE;
                    let (code, shown) = match (counts, is_new) {
                        (true, true) => (Code::Fresh, value),
                        (true, false) => (Code::Unchanged, value),
                        (false, _) => (Code::Stale, 7),
                    };
                    is_new &= !counts;
                    let found = (age, station.status, station.stale, slots[0]);
                    let expected = Slot::from_real(f64::from(shown));
                    assert_eq!(
                        found,
                        (expected_age, code, !counts, expected),
                        "step {step}"
                    );
                    codes[usize::try_from(code.code()).expect("no error")] += 1;
                }
            }
        }
    }
}
