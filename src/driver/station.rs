//! One station of an open driver, as the tick sees it.

use std::fmt::Write as _;

use super::{Code, Counters, SlotMap};
use crate::image::{Arrival, TickStation};
use crate::signal::{Area, Conversions, Plan, SignalTable, Slot};
use crate::time::Nanos;

/// One station of an open driver, as the tick sees it.
#[derive(Debug)]
pub(super) struct Station {
    tick: TickStation,
    encode: Plan,
    decode: Plan,
    /// Whether the slots hold fail-safe values.
    pub(super) stale: bool,
    /// What the last exchange found here.
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

    pub(super) fn peer_age(&self, now: Nanos) -> Nanos {
        self.tick.peer_age(now)
    }

    /// Appends how old its data are and how many bus cycles it has sent, one `key=value` a line.
    pub(super) fn write(&self, name: &str, now: Nanos, max_age: Nanos, text: &mut String) {
        let age = self.peer_age(now);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "station.{name}.stale={}", age > max_age);
        if age != Nanos::MAX {
            let _ = writeln!(text, "station.{name}.age_ms={:.3}", age.as_micros() / 1e3);
        }
        let _ = writeln!(text, "station.{name}.bus_cycles={}", self.cycles());
    }

    pub(super) fn send(&mut self, now: Nanos, slots: &[Slot], counters: &mut Counters) {
        let encode = &self.encode;
        let bent = self.tick.write(now, |frame| encode.encode(slots, frame));
        if bent != Conversions::default() {
            counters.saturated += u64::from(bent.saturated);
            counters.not_a_number += u64::from(bent.not_a_number);
        }
    }

    pub(super) fn receive(
        &mut self,
        now: Nanos,
        max_age: Nanos,
        slots: &mut [Slot],
        map: &SlotMap,
    ) -> Arrival {
        let decode = &self.decode;
        let arrival = self.tick.read(now, &mut Receiver { decode, slots, map });
        let stale = arrival.age > max_age;
        if stale && (arrival.changed || !self.stale) {
            self.decode.fail_safe(slots);
            self.tick.shown_instead();
        }
        self.stale = stale;
        arrival
    }
}

/// Puts what a station received into the slots.
struct Receiver<'a> {
    decode: &'a Plan,
    slots: &'a mut [Slot],
    map: &'a SlotMap,
}

impl crate::image::Receiver for Receiver<'_> {
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
