//! One station of an open driver, as the tick sees it.

use super::{Code, SlotMap, TickCounters};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::is_stale;
use tickbus_image::signal::{Area, Conversions, Plan, SignalTable, Slot};
use tickbus_image::{Arrival, TickStation};

/// One station of an open driver, as the tick sees it.
#[derive(Debug)]
pub(super) struct Station {
    tick: TickStation,
    encode: Plan,
    decode: Plan,
    /// Whether the slots hold fail-safe values.
    pub(super) stale: bool,
    /// The result of the last exchange for this station.
    pub(super) status: Code,
}

impl Station {
    pub(super) fn new(
        tick: TickStation,
        table: &SignalTable,
        index: usize,
        (tx, rx): (Area, Area),
    ) -> Self {
        let (encode, decode) = (Plan::new(table, index, tx), Plan::new(table, index, rx));
        Self {
            tick,
            encode,
            decode,
            stale: true,
            status: Code::Stale,
        }
    }

    pub(super) fn cycles(&self) -> u64 {
        self.tick.cycles()
    }

    /// Tells how many edges of each latched signal there were.
    pub(super) fn edges(&self, tell: impl FnMut(usize, u32)) {
        self.tick.edges(tell);
    }

    pub(super) fn peer_age(&self, now: Nanos) -> Nanos {
        self.tick.peer_age(now)
    }

    /// Whether the data are valid: the PLC runs its program, and signals that should change do.
    pub(super) fn is_valid(&self) -> bool {
        self.tick.is_valid()
    }

    #[inline]
    pub(super) fn send(&mut self, now: Nanos, slots: &[Slot], counters: &mut TickCounters) {
        match self.encode.word(slots) {
            Some(word) => self.tick.write_word(now, word),
            None => self.send_any(now, slots, counters),
        }
    }

    #[inline(never)]
    fn send_any(&mut self, now: Nanos, slots: &[Slot], counters: &mut TickCounters) {
        let encode = &self.encode;
        let bent = self.tick.write(now, |frame| encode.encode(slots, frame));
        if bent != Conversions::default() {
            counters.saturated += u64::from(bent.saturated);
            counters.not_a_number += u64::from(bent.not_a_number);
        }
    }

    /// Receives into the slots, and sets the status.
    #[inline]
    pub(super) fn receive(
        &mut self,
        now: Nanos,
        max_age: Nanos,
        slots: &mut [Slot],
        map: &SlotMap,
    ) -> Arrival {
        let valid = self.tick.is_valid();
        match self.tick.unchanged(now) {
            // Nothing is read that a second look at the validity would have to vouch for.
            Some((age, sequence)) => {
                let arrival = Arrival {
                    fresh: false,
                    changed: false,
                    age,
                    sequence,
                };
                self.judge(arrival, is_stale(age, max_age, valid), slots);
                arrival
            }
            None => self.receive_as(valid, (now, max_age), slots, map),
        }
    }

    /// Receives data that were `valid` a moment ago.
    #[inline(never)]
    fn receive_as(
        &mut self,
        valid: bool,
        (now, max_age): (Nanos, Nanos),
        slots: &mut [Slot],
        map: &SlotMap,
    ) -> Arrival {
        let decode = &self.decode;
        let mut receiver = Receiver {
            decode,
            slots,
            map,
            valid,
        };
        let mut arrival = self.tick.read(now, &mut receiver);
        let still_valid = valid && self.tick.is_valid();
        if valid && !still_valid {
            // The PLC stopped in between, and this may be its first frame in STOP: read it again as invalid.
            receiver.valid = false;
            self.tick.shown_instead();
            arrival = self.tick.read(now, &mut receiver);
        }
        self.judge(arrival, is_stale(arrival.age, max_age, still_valid), slots);
        arrival
    }

    /// Sets the status after an arrival, and shows fail-safe values if the data do not count.
    #[inline]
    fn judge(&mut self, arrival: Arrival, stale: bool, slots: &mut [Slot]) {
        if stale && (arrival.changed || !self.stale) {
            self.show_fail_safe(slots);
        }
        self.stale = stale;
        self.status = match arrival {
            _ if stale => Code::Stale,
            Arrival { fresh: true, .. } => Code::Fresh,
            Arrival { .. } => Code::Unchanged,
        };
    }

    #[cold]
    fn show_fail_safe(&mut self, slots: &mut [Slot]) {
        self.decode.fail_safe(slots);
        self.tick.shown_instead();
    }
}

/// Puts a station's received values into the slots.
struct Receiver<'a> {
    decode: &'a Plan,
    slots: &'a mut [Slot],
    map: &'a SlotMap,
    /// Edges of invalid data are not counted.
    valid: bool,
}

impl tickbus_image::Receiver for Receiver<'_> {
    #[inline]
    fn levels(&mut self, bytes: &[u8]) {
        self.decode.decode(bytes, self.slots);
    }

    #[inline]
    fn edges(&mut self, signal: usize, count: u32) {
        if let Some(slot) = self.map.edges[signal] {
            let count = if self.valid { count } else { 0 };
            self.slots[slot] = Slot::from_real(f64::from(count));
        }
    }
}

#[cfg(all(test, not(loom)))]
#[expect(clippy::float_cmp, reason = "small whole numbers")]
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
        let config = Config::parse("driver.cfg", text).expect("right");
        let (table, role) = (&config.table, Role::Device);
        let (tick, mut bus) = image(directions(table, role));
        let ends = tick.stations.into_iter().next().expect("one");
        let mut station = Station::new(ends, table, 0, role.areas());
        let map = SlotMap::new(table, role);
        let mut slots = vec![Slot::default(); map.count];
        let edges = map.edges[0].expect("it is latched");
        let mut shown = |bus: &mut tickbus_image::BusStation, valid, bytes: &[u8]| {
            bus.received(Nanos(1), bytes);
            bus.set_valid(valid);
            station.receive(Nanos(2), Nanos(10), &mut slots, &map);
            let real = |slot: usize| slots[slot].real();
            (station.stale, real(0), real(1), real(edges))
        };
        let bus = &mut bus.stations[0];
        assert_eq!(shown(bus, true, &[1, 9]), (false, 1.0, 9.0, 1.0));
        assert_eq!(shown(bus, false, &[0, 8]), (true, 0.0, 7.0, 0.0));
        assert_eq!(shown(bus, false, &[1, 8]), (true, 0.0, 7.0, 0.0));
        assert_eq!(shown(bus, true, &[1, 9]), (false, 1.0, 9.0, 0.0));
        // It stops, and its first frame arrives, after the tick has asked whether it runs.
        bus.set_valid(false);
        bus.received(Nanos(3), &[0, 8]);
        station.receive_as(true, (Nanos(3), Nanos(10)), &mut slots, &map);
        let shown = [0, 1, edges].map(|slot| slots[slot].real());
        assert!(station.stale);
        assert_eq!(shown, [0.0, 7.0, 0.0]);
    }
}
