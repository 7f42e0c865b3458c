//! The tick: the process image goes out and comes in, at once or in two halves.
//!
//! [`Driver::exchange`] sends, then receives; the simulation computes its answer until the next exchange.
//! [`Driver::receive`] and [`Driver::send`] are the two halves in the other order, with the simulation's
//! model between them, so that it answers within the same tick.
//!
//! Nothing here allocates, locks or makes a system call, unless the bus is stepped. The clock is read once
//! per call, where that is not a system call.

use tickbus_base::time::{Clock, Nanos};
use tickbus_fieldbus::faults::Moment;
use tickbus_fieldbus::{BusError, LinkState};
use tickbus_image::Arrival;
use tickbus_image::signal::Slot;

use super::open::Line;
use super::statistics::Samples;
use super::{Code, Driver};

/// The result of an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// [`Code::Fresh`], [`Code::Unchanged`], [`Code::Stale`], or an error.
    pub code: Code,
    /// Bus cycles that have arrived, over all stations.
    pub sequence: u64,
    /// Age of the oldest station's data; [`Nanos::MAX`] when nothing ever arrived.
    pub age: Nanos,
    /// The time up to which the simulation may run before the next exchange; on buses that do not step it,
    /// the simulation's own time.
    pub granted: Nanos,
}

impl Exchange {
    /// The state before the first exchange.
    pub(super) const NONE: Self = Self {
        code: Code::Stale,
        sequence: 0,
        age: Nanos::MAX,
        granted: Nanos::ZERO,
    };
}

/// A tick that has begun and not ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tick {
    /// Simulation time; if the simulation gives none, the clock's time since the first tick.
    time: Nanos,
    /// The time spent in its calls so far; measured only for ticks in the sample.
    taken: Nanos,
}

impl Driver {
    /// Exchanges the process image, as one tick: sends this end's values from `slots`, and puts the received
    /// values there.
    ///
    /// `time` is the simulation's, and must not decrease on a stepped bus. With `None` the last given time is
    /// kept. If none was ever given, the time of a tick is the clock's time since the first one; a stepped
    /// bus then runs to the time that it granted last.
    ///
    /// # Panics
    ///
    /// When there are fewer slots than [`SlotMap::count`](super::SlotMap::count).
    pub fn exchange(&mut self, time: impl Into<Option<Nanos>>, slots: &mut [Slot]) -> Exchange {
        let done = self.begin(time.into(), slots).and_then(|now| {
            if let Some(reflexes) = &mut self.reflexes {
                reflexes.sending(slots);
            }
            self.begin_faults(slots);
            let sent = self.put(now, slots);
            let found = self.take(now, slots);
            self.lap(now);
            sent.and(found)
        });
        self.last = self.judged(done);
        self.end(self.last.code, slots);
        self.last
    }

    /// Begins a tick by receiving: puts the received values into `slots`. The simulation computes its answer
    /// and gives it to [`send`](Self::send) within the same tick.
    ///
    /// `time` is as in [`exchange`](Self::exchange). A stepped bus runs the peer up to that time, with what
    /// was sent in the previous tick. A tick without [`send`](Self::send) ends when the next one begins.
    ///
    /// # Panics
    ///
    /// As [`exchange`](Self::exchange).
    pub fn receive(&mut self, time: impl Into<Option<Nanos>>, slots: &mut [Slot]) -> Exchange {
        let done = self.begin(time.into(), slots).and_then(|now| {
            self.begin_faults(slots);
            let found = self.take(now, slots);
            self.lap(now);
            found
        });
        self.last = self.judged(done);
        self.last
    }

    /// Ends the tick that [`receive`](Self::receive) began: sends this end's values from `slots`. Returns
    /// what `receive` found, or an error. If `receive` failed, nothing is sent.
    ///
    /// Further calls in the same tick publish the newer values. They are not ticks: they are not counted, and
    /// a recording has the values of the first call.
    ///
    /// # Panics
    ///
    /// As [`exchange`](Self::exchange).
    pub fn send(&mut self, slots: &mut [Slot]) -> Exchange {
        self.check(slots);
        if self.last.code == Code::BusFailed {
            self.end(self.last.code, slots);
            return self.last;
        }
        let now = self.now();
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sending(slots);
        }
        let sent = self.put(now, slots);
        self.lap(now);
        let done = self.judged(sent);
        self.end(done.code, slots);
        done
    }

    /// Ends a tick that [`receive`](Self::receive) began and that was not answered, with the values in
    /// `slots`, so that a recording contains it. Call it before closing the driver; without such a tick it
    /// does nothing.
    ///
    /// # Panics
    ///
    /// As [`exchange`](Self::exchange).
    pub fn end_tick(&mut self, slots: &[Slot]) {
        self.check(slots);
        self.end(self.last.code, slots);
    }

    fn check(&self, slots: &[Slot]) {
        assert!(
            slots.len() >= self.slots.count,
            "the exchange needs all {} slots",
            self.slots.count
        );
    }

    /// The time on the line: the clock's, or the simulation's on a stepped bus.
    #[inline]
    fn now(&self) -> Nanos {
        match &self.line {
            Line::Free(_) => self.clock.now(),
            // Simulation time stands still during an exchange.
            Line::Stepped { time, .. } => time.now(),
        }
    }

    /// Begins a tick and gives the time on the line.
    fn begin(&mut self, asked: Option<Nanos>, slots: &[Slot]) -> Result<Nanos, BusError> {
        self.check(slots);
        self.end(self.last.code, slots);
        let before = self.now();
        self.given = asked.or(self.given);
        self.counters.ticks += 1;
        let is_first = self.counters.ticks == 1;
        if is_first {
            self.first_now = before;
        }
        let time = self.given.unwrap_or(match &self.line {
            Line::Free(_) => before - self.first_now,
            Line::Stepped { .. } => self.last.granted,
        });
        if is_first {
            self.first_time = time;
        }
        self.tick = Some(Tick {
            time,
            taken: Nanos::ZERO,
        });
        let Line::Stepped { time: shown, .. } = &self.line else {
            return Ok(before);
        };
        if time < before {
            return Err(BusError::Refused(format!(
                "simulation time went back from {before} to {time}, and what runs on it cannot; hand in the \
                 nanoseconds since the simulation began, and open the driver again when it begins anew"
            )));
        }
        shown.set(time);
        Ok(time)
    }

    fn begin_faults(&mut self, slots: &mut [Slot]) {
        if let (Some(faults), Some(tick)) = (&mut self.faults, &self.tick) {
            let moment = Moment {
                time: tick.time - self.first_time,
                tick: self.counters.ticks,
            };
            faults.begin_tick(moment, slots);
        }
    }

    /// The sending half.
    fn put(&mut self, now: Nanos, slots: &mut [Slot]) -> Result<(), BusError> {
        for beat in &mut self.beats {
            beat.beat(now, slots);
        }
        if let Some(faults) = &mut self.faults {
            faults.sending(slots);
        }
        for station in &mut self.stations {
            station.send(now, slots, &mut self.counters);
        }
        if let Some(faults) = &mut self.faults {
            faults.sent(slots);
        }
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sent(slots);
        }
        match &mut self.line {
            Line::Free(_) => Ok(()),
            Line::Stepped { bus, port, .. } => bus.send(now, port),
        }
    }

    /// The receiving half.
    fn take(&mut self, now: Nanos, slots: &mut [Slot]) -> Result<(), BusError> {
        let granted = match &mut self.line {
            Line::Free(_) => Ok(self.tick.map_or(now, |tick| tick.time)),
            Line::Stepped { bus, port, .. } => bus.receive(now, port),
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
        self.last = Exchange {
            code,
            sequence,
            age,
            granted: *granted.as_ref().unwrap_or(&now),
        };
        granted.map(|_| ())
    }

    /// The result of a half: what was found last, or that the bus failed.
    fn judged(&self, done: Result<(), BusError>) -> Exchange {
        let Err(error) = done else {
            return self.last;
        };
        let now = self.now();
        let (state, cause, reason) = (LinkState::Failed, (&error).into(), error.to_string());
        self.status.enter(now, state, cause, &reason);
        Exchange {
            code: Code::BusFailed,
            granted: now,
            ..self.last
        }
    }

    /// Adds the time since `begun` to the current tick, if that is in the sample.
    #[inline]
    fn lap(&mut self, begun: Nanos) {
        if let (true, Some(tick)) = (Samples::takes(self.counters.ticks), &mut self.tick) {
            tick.taken += self.clock.now() - begun;
        }
    }

    /// Ends the current tick, if there is one: counts and records it.
    fn end(&mut self, code: Code, slots: &[Slot]) {
        let Some(tick) = self.tick.take() else {
            return;
        };
        self.counters.count(code);
        if let Some(recorder) = &mut self.recorder {
            let stations = self.stations.iter().map(|station| station.status.code());
            recorder.record(self.counters.ticks, tick.time, code.code(), stations, slots);
        }
        if matches!(self.line, Line::Free(_)) && Samples::takes(self.counters.ticks) {
            self.samples.add(tick.taken, self.last.age);
        }
    }
}
