//! The tick: one exchange of the process image.
//!
//! Nothing here allocates, locks or calls the system, unless the bus is a stepped one.

use crate::fieldbus::LinkState;
use crate::image::Arrival;
use crate::signal::Slot;
use crate::time::Nanos;

use super::faults::moment;
use super::open::Line;
use super::statistics::Samples;
use super::{Code, Driver};

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

impl Driver {
    /// Exchanges the process image at `simulation_time`: takes the values that this end writes from
    /// `slots`, puts those that it reads there.
    ///
    /// # Panics
    ///
    /// When there are fewer slots than [`SlotMap::count`](super::SlotMap::count).
    pub fn exchange(&mut self, simulation_time: Nanos, slots: &mut [Slot]) -> Exchange {
        assert!(
            slots.len() >= self.slots.count,
            "the exchange needs all {} slots",
            self.slots.count
        );
        let (now, begun) = match &self.line {
            Line::Free(_) => (
                self.time.now(),
                Samples::begin(self.counters.ticks, &*self.clock),
            ),
            // Simulation time stands still during an exchange.
            Line::Stepped { time, .. } => {
                time.set(simulation_time);
                (simulation_time, None)
            }
        };
        self.counters.ticks += 1;
        if self.counters.ticks == 1 {
            self.first = (simulation_time, now);
        }
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sending(slots);
        }
        for beat in &mut self.beats {
            beat.beat(now, slots);
        }
        if let Some(faults) = &mut self.faults {
            let tick = self.counters.ticks;
            faults.begin_tick(moment(self.first, simulation_time, now, tick), slots);
            faults.sending(slots);
        }
        for station in &mut self.stations {
            station.send(now, slots, &mut self.counters);
        }
        if let Some(faults) = &mut self.faults {
            faults.sent(slots);
        }
        let granted = match &mut self.line {
            Line::Free(_) => Ok(simulation_time),
            Line::Stepped { bus, port, .. } => bus.exchange(simulation_time, port),
        };
        let (mut code, mut sequence, mut age) = (Code::Fresh, 0, Nanos::ZERO);
        for station in &mut self.stations {
            let arrival = station.receive(now, self.max_age, slots, &self.slots);
            sequence += arrival.sequence;
            age = age.max(arrival.age);
            station.status = match arrival {
                _ if station.stale => Code::Stale,
                Arrival { fresh: true, .. } => Code::Fresh,
                Arrival { .. } => Code::Unchanged,
            };
            code = code.worse(station.status);
        }
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.received(slots);
        }
        if let Some(faults) = &mut self.faults {
            faults.received(slots);
        }
        let granted = granted.unwrap_or_else(|error| {
            let (state, cause, reason) = (LinkState::Failed, (&error).into(), error.to_string());
            self.status.enter(now, state, cause, &reason);
            code = Code::BusFailed;
            now
        });
        self.counters.count(code);
        if let Some(recorder) = &mut self.recorder {
            let stations = self.stations.iter().map(|station| station.status.code());
            let (tick, status) = (self.counters.ticks, code.code());
            recorder.record(tick, simulation_time, status, stations, slots);
        }
        if let Some(begun) = begun {
            self.samples.end(begun, age, &*self.clock);
        }
        Exchange {
            code,
            sequence,
            age,
            granted,
        }
    }
}
