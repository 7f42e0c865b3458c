//! One station of an open driver, as the tick sees it.

use super::{Code, SlotMap};
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Area, Plan, SignalTable, Slot};
use tickbus_image::{Arrival, TickEnd, is_stale};

/// One station of an open driver, as the tick sees it.
#[derive(Debug)]
pub(super) struct Station {
    /// Its place in the signal table.
    index: usize,
    pub(super) encode: Plan,
    decode: Plan,
    /// Whether the slots hold fail-safe values.
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

    /// The slots hold what a recording has instead of what was received, and this was its status. The next
    /// [`receive`](Self::receive) shows what was received again.
    pub(super) fn shown_instead(&mut self, image: &mut TickEnd, status: Code) {
        self.status = status;
        self.stale = status == Code::Stale;
        image.overridden(self.index);
    }

    /// Receives from the frame taken over last into the slots, and sets the status. Returns the age of the data.
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
        let config = Config::parse("driver.cfg", text).expect("right");
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
        // Too old when it is looked at: its edge waits.
        assert_eq!(shown((20, 9), true, &[0, 3]), (true, 0.0, 7.0, 0.0));
        assert_eq!(shown((21, 20), true, &[0, 4]), (false, 0.0, 4.0, 1.0));
    }
}
