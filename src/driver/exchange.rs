//! The tick: one exchange of the process image.
//!
//! Nothing here allocates, locks or calls the system, unless the bus is a stepped one.

use crate::fieldbus::{LinkState, Role};
use crate::image::{Arrival, TickStation};
use crate::signal::{Area, Conversions, Plan, SignalTable, Slot};
use crate::time::Nanos;

use super::open::Line;
use super::statistics::Counters;
use super::{Code, Driver, SlotMap};

/// What an exchange found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// [`Code::Fresh`], [`Code::Unchanged`], [`Code::Stale`], or an error.
    pub code: Code,
    /// Bus cycles that have arrived, over all stations.
    pub sequence: u64,
    /// Age of the oldest station's data; [`Nanos::MAX`] when nothing ever arrived.
    pub age: Nanos,
    /// Up to when the simulation may go on without the next exchange; the simulation's own time on
    /// buses that do not step it.
    pub granted: Nanos,
}

/// One station of an open driver, as the tick sees it.
#[derive(Debug)]
pub(super) struct Station {
    tick: TickStation,
    encode: Plan,
    decode: Plan,
    rx_fail_safe: Box<[u8]>,
    /// Whether the slots hold fail-safe values.
    stale: bool,
}

/// The areas that a role writes and reads.
pub(super) fn areas(role: Role) -> (Area, Area) {
    match role {
        Role::Device => (Area::Input, Area::Output),
        Role::Controller => (Area::Output, Area::Input),
    }
}

impl Station {
    pub(super) fn new(
        tick: TickStation,
        table: &SignalTable,
        index: usize,
        (tx, rx): (Area, Area),
        rx_fail_safe: Box<[u8]>,
    ) -> Self {
        let (encode, decode) = (Plan::new(table, index, tx), Plan::new(table, index, rx));
        Self {
            tick,
            encode,
            decode,
            rx_fail_safe,
            stale: true,
        }
    }

    pub(super) fn cycles(&self) -> u64 {
        self.tick.cycles()
    }

    fn send(&mut self, now: Nanos, slots: &[Slot], counters: &mut Counters) {
        let encode = &self.encode;
        let bent = self.tick.write(now, |frame| encode.encode(slots, frame));
        if bent != Conversions::default() {
            counters.saturated += u64::from(bent.saturated);
            counters.not_a_number += u64::from(bent.not_a_number);
        }
    }

    fn receive(
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
            self.tick.shown_instead(&self.rx_fail_safe);
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

impl Driver {
    /// Exchanges the process image at `simulation_time`: takes the values that this end writes from
    /// `slots`, puts those that it reads there.
    ///
    /// # Panics
    ///
    /// When there are fewer slots than [`SlotMap::count`].
    pub fn exchange(&mut self, simulation_time: Nanos, slots: &mut [Slot]) -> Exchange {
        assert!(
            slots.len() >= self.slots.count,
            "the exchange needs all {} slots",
            self.slots.count
        );
        let now = match &self.line {
            Line::Free(_) => self.time.now(),
            Line::Stepped { .. } => simulation_time,
        };
        self.counters.ticks += 1;
        for station in &mut self.stations {
            station.send(now, slots, &mut self.counters);
        }
        let granted = match &mut self.line {
            Line::Free(_) => Ok(simulation_time),
            Line::Stepped { bus, port } => bus.exchange(simulation_time, port),
        };
        let (mut code, mut sequence, mut age) = (Code::Fresh, 0, Nanos::ZERO);
        for station in &mut self.stations {
            let arrival = station.receive(now, self.max_age, slots, &self.slots);
            sequence += arrival.sequence;
            age = age.max(arrival.age);
            code = code.worse(match arrival {
                _ if station.stale => Code::Stale,
                Arrival { fresh: true, .. } => Code::Fresh,
                Arrival { .. } => Code::Unchanged,
            });
        }
        let granted = granted.unwrap_or_else(|error| {
            self.status.enter(LinkState::Failed, &error.to_string());
            code = Code::BusFailed;
            now
        });
        self.counters.count(code);
        Exchange {
            code,
            sequence,
            age,
            granted,
        }
    }
}
