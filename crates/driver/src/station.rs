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

    /// The slots hold what a recording has instead of what was received, and this was its status. The next
    /// [`receive`](Self::receive) shows what was received again.
    pub(super) fn shown_instead(&mut self, status: Code) {
        self.status = status;
        self.stale = status == Code::Stale;
        self.tick.shown_instead();
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
    use std::fmt::Write as _;

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

    #[test]
    fn the_quick_way_through_a_station_finds_and_sends_what_the_slow_one_does() {
        let mut text =
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n"
                .to_owned();
        for (area, bit) in ["I", "Q"]
            .into_iter()
            .flat_map(|area| (0..8).map(move |bit| (area, bit)))
        {
            let latch = match (bit % 3, area) {
                (0, _) => "",
                (1, "I") => "latch = \"rising\"\nhold = \"7ns\"\n",
                _ => "latch = \"both\"\n",
            };
            write!(
                text,
                "[[signal]]\nname = \"{area}{bit}\"\naddress = \"%{area}X0.{bit}\"\n{latch}"
            )
            .expect("a text takes it");
        }
        let config = Config::parse("driver.cfg", &text).expect("right");
        let (table, role, map) = (
            &config.table,
            Role::Device,
            SlotMap::new(&config.table, Role::Device),
        );
        let mut ends = [(); 2].map(|()| {
            let (tick, bus) = image(directions(table, role));
            let tick = tick.stations.into_iter().next().expect("one");
            let bus = bus.stations.into_iter().next().expect("one");
            (
                Station::new(tick, table, 0, role.areas()),
                bus,
                vec![Slot::default(); map.count],
            )
        });
        let (mut now, mut random) = (Nanos(1), 1_u64);
        for step in 0..20_000 {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let draw = |shift: u32, below: u64| (random >> shift) % below;
            now += Nanos(i64::try_from(draw(20, 4) * draw(24, 4)).expect("small"));
            let bit = usize::try_from(draw(28, 8)).expect("a bit");
            let level = [0.0, 1.0, 1.0, f64::NAN][usize::try_from(draw(32, 4)).expect("one")];
            let found = [true, false].map(|is_quick| {
                let (station, bus, slots) = &mut ends[usize::from(is_quick)];
                match draw(40, 8) {
                    0 | 1 => bus.received(now, &[draw(44, 256).to_le_bytes()[0]]),
                    2 => bus.touch(now),
                    3 => bus.set_valid(draw(44, 4) != 0),
                    _ => {}
                }
                slots[bit] = Slot::from_real(level);
                let mut counters = TickCounters::default();
                let (age, sequence) = if is_quick {
                    station.send(now, slots, &mut counters);
                    let arrival = station.receive(now, Nanos(20), slots, &map);
                    (arrival.age, arrival.sequence)
                } else {
                    station.send_any(now, slots, &mut counters);
                    let valid = station.is_valid();
                    let arrival = station.receive_as(valid, (now, Nanos(20)), slots, &map);
                    (arrival.age, arrival.sequence)
                };
                let sent = bus.outgoing(now, Some(Nanos(30))).to_vec();
                if draw(52, 3) == 0 {
                    bus.sent();
                }
                let slots: Vec<u64> = slots.iter().map(|slot| slot.0).collect();
                let mut edges = Vec::new();
                station.edges(|signal, count| edges.push((signal, count)));
                (
                    sent,
                    slots,
                    edges,
                    (age, sequence),
                    (station.status, station.stale),
                    counters,
                )
            });
            assert_eq!(found[0], found[1], "step {step}");
        }
    }
}
