//! The tick: sends and receives the process image, at once or in two halves.
//!
//! [`Driver::exchange`] sends, then receives; the simulation computes its answer until the next exchange.
//! [`Driver::receive`] and [`Driver::send`] are the two halves in the other order, with the simulation's model between
//! them, so that the simulation answers within the same tick.
//!
//! On a free bus, nothing here allocates, locks or calls the system. Each call reads the time once: from the
//! processor's counter, and once per millisecond from the clock, which is no system call either.
#![allow(
    clippy::inline_always,
    reason = "the parts of an exchange are functions for the reader alone"
)]

use tickbus_base::time::{Clock as _, Nanos};
use tickbus_fieldbus::faults::TickTime;
use tickbus_fieldbus::{BusError, LinkState};
use tickbus_image::TickEnd;
use tickbus_image::signal::{Conversions, Slot};

use super::bus_handle::{BusHandle, SteppedBus};
use super::shape::{Extended, InStep, Plain, Shape, Work};
use super::station::Station;
use super::tap::Tap;
use super::tick::Tick;
use super::tick_counters::TickTimes;
use super::{Code, Driver, Exchange, TickCounters};

impl Driver {
    /// Exchanges the process image, as one tick: sends this end's values from `slots`, and puts the received values
    /// there.
    ///
    /// `time` is the simulation's time, and must not decrease on a stepped bus. With `None` the last given time is
    /// kept. If no time was ever given, a tick's time is the clock's time since the first tick; a stepped bus then runs
    /// to the time that it granted last.
    ///
    /// # Panics
    ///
    /// When there are fewer slots than [`SlotMap::count`](super::SlotMap::count).
    #[inline(always)]
    pub fn exchange(&mut self, time: impl Into<Option<Nanos>>, slots: &mut [Slot]) -> Exchange {
        let time = time.into();
        self.prepare(slots);
        match self.shape {
            Shape::Plain => self.exchange_as::<Plain>(time, slots),
            Shape::Extended => self.exchange_apart::<Extended>(time, slots),
            Shape::InStep => self.exchange_apart::<InStep>(time, slots),
        }
    }

    #[inline(never)]
    fn exchange_apart<W: Work>(&mut self, time: Option<Nanos>, slots: &mut [Slot]) -> Exchange {
        self.exchange_as::<W>(time, slots)
    }

    #[inline(always)]
    fn exchange_as<W: Work>(&mut self, time: Option<Nanos>, slots: &mut [Slot]) -> Exchange {
        let (mut tick, begun) = self.begin::<W>(time);
        let (found, done) = match begun {
            Ok(()) => {
                self.handed_over::<W>(Some(tick.time), slots);
                self.begin_extras::<W>(&tick, slots);
                let sent = self.put::<W>(tick.now, slots);
                let (found, done) = self.take::<W>(&tick, slots);
                tick.taken = self.lap::<W>(tick.now);
                // Without an error to carry, the result of a free tick stays in registers.
                (found, if W::IS_STEPPED { sent.and(done) } else { done })
            }
            Err(error) => (self.last, Err(error)),
        };
        let found = self.result::<W>(found, done);
        self.end::<W>(tick, found, slots);
        found
    }

    /// Begins a tick by receiving: puts the received values into `slots`. The simulation computes its answer
    /// and gives it to [`send`](Self::send) within the same tick.
    ///
    /// `time` is as in [`exchange`](Self::exchange). A stepped bus runs the peer up to that time, with the values sent
    /// in the previous tick. A tick without [`send`](Self::send) ends when the next one begins.
    ///
    /// # Panics
    ///
    /// As [`exchange`](Self::exchange).
    #[inline(always)]
    pub fn receive(&mut self, time: impl Into<Option<Nanos>>, slots: &mut [Slot]) -> Exchange {
        let time = time.into();
        self.prepare(slots);
        match self.shape {
            Shape::Plain => self.receive_as::<Plain>(time, slots),
            Shape::Extended => self.receive_apart::<Extended>(time, slots),
            Shape::InStep => self.receive_apart::<InStep>(time, slots),
        }
    }

    #[inline(never)]
    fn receive_apart<W: Work>(&mut self, time: Option<Nanos>, slots: &mut [Slot]) -> Exchange {
        self.receive_as::<W>(time, slots)
    }

    #[inline(always)]
    fn receive_as<W: Work>(&mut self, time: Option<Nanos>, slots: &mut [Slot]) -> Exchange {
        let (mut tick, begun) = self.begin::<W>(time);
        let (found, done) = match begun {
            Ok(()) => {
                self.begin_extras::<W>(&tick, slots);
                let taken = self.take::<W>(&tick, slots);
                tick.taken = self.lap::<W>(tick.now);
                taken
            }
            Err(error) => (self.last, Err(error)),
        };
        self.tick = Some(tick);
        self.result::<W>(found, done)
    }

    /// Ends the tick that [`receive`](Self::receive) began: sends this end's values from `slots`. Returns the result of
    /// `receive`, or an error. If `receive` failed, nothing is sent.
    ///
    /// Further calls in the same tick publish newer values. These calls are not ticks: they are not counted, and a
    /// recording contains the values of the first call.
    ///
    /// # Panics
    ///
    /// As [`exchange`](Self::exchange).
    #[inline(always)]
    pub fn send(&mut self, slots: &mut [Slot]) -> Exchange {
        self.check(slots);
        match self.shape {
            Shape::Plain => self.send_as::<Plain>(slots),
            Shape::Extended => self.send_apart::<Extended>(slots),
            Shape::InStep => self.send_apart::<InStep>(slots),
        }
    }

    #[inline(never)]
    fn send_apart<W: Work>(&mut self, slots: &mut [Slot]) -> Exchange {
        self.send_as::<W>(slots)
    }

    #[inline(always)]
    fn send_as<W: Work>(&mut self, slots: &mut [Slot]) -> Exchange {
        let mut found = self.last;
        if !W::IS_STEPPED || found.code != Code::BusFailed {
            let now = self.now::<W>();
            let time = self.tick.map(|tick| tick.time);
            self.handed_over::<W>(time, slots);
            let sent = self.put::<W>(now, slots);
            let taken = self.lap::<W>(now);
            if let Some(tick) = &mut self.tick {
                tick.taken += taken;
            }
            if let Err(error) = sent {
                // Not kept: only a failed `receive` forbids to send.
                found = self.failed(found, &error);
            }
        }
        if let Some(tick) = self.tick.take() {
            self.end::<W>(tick, found, slots);
        }
        found
    }

    /// Ends a tick that [`receive`](Self::receive) began and [`send`](Self::send) did not end, with the values in
    /// `slots`, so that a recording contains it. Call this before closing the driver; without such a tick the call does
    /// nothing.
    ///
    /// # Panics
    ///
    /// As [`exchange`](Self::exchange).
    pub fn end_tick(&mut self, slots: &[Slot]) {
        self.check(slots);
        self.end_open_tick(slots);
    }

    #[cold]
    #[inline(never)]
    fn end_open_tick(&mut self, slots: &[Slot]) {
        if let Some(tick) = self.tick.take() {
            if self.is_stepped() {
                self.end::<InStep>(tick, self.last, slots);
            } else {
                self.end::<Extended>(tick, self.last, slots);
            }
        }
    }

    /// Checks the slots before a tick, and ends the tick before if nothing else did.
    #[inline(always)]
    fn prepare(&mut self, slots: &[Slot]) {
        self.check(slots);
        if self.tick.is_some() {
            self.end_open_tick(slots);
        }
    }

    #[inline]
    pub(super) fn check(&self, slots: &[Slot]) {
        assert!(
            slots.len() >= self.slots.count,
            "the exchange needs all {} slots",
            self.slots.count
        );
    }

    /// Returns the time on the line: the clock's, or the simulation's on a stepped bus.
    #[inline(always)]
    fn now<W: Work>(&mut self) -> Nanos {
        match &self.line {
            // Simulation time stands still during an exchange.
            BusHandle::Stepped { time, .. } if W::IS_STEPPED => time.now(),
            _ => self.quick.now(),
        }
    }

    /// Begins a tick. On an error the bus has refused it.
    #[inline(always)]
    fn begin<W: Work>(&mut self, asked: Option<Nanos>) -> (Tick, Result<(), BusError>) {
        let now = self.now::<W>();
        self.counters.ticks += 1;
        let is_first = W::HAS_EXTRAS && self.counters.ticks == 1;
        if is_first {
            self.first_now = now;
        }
        let given = asked.or(self.given);
        let time = match given {
            Some(given) => given,
            None if W::IS_STEPPED => self.last.granted,
            None => now - self.first_now,
        };
        if is_first {
            self.first_time = time;
        }
        let mut tick = Tick {
            time,
            now,
            taken: Nanos::ZERO,
        };
        if W::IS_STEPPED {
            if let Err(error) = self.step(&tick) {
                return (tick, Err(error));
            }
            tick.now = time;
        }
        self.given = given;
        (tick, Ok(()))
    }

    /// Lets the simulation time of a stepped bus go on to that of the tick.
    fn step(&mut self, tick: &Tick) -> Result<(), BusError> {
        let BusHandle::Stepped { bus, time, .. } = &mut self.line else {
            return Ok(());
        };
        if tick.time < tick.now {
            return Err(went_back(tick.now, tick.time));
        }
        // Ask the bus first: a refused time must not become the lower limit for later times.
        bus.as_stepped().accepts(tick.time)?;
        time.set(tick.time);
        Ok(())
    }

    /// The simulation has handed its values over, in a tick at this time.
    #[inline(always)]
    fn handed_over<W: Work>(&mut self, time: Option<Nanos>, slots: &mut [Slot]) {
        if W::HAS_EXTRAS && self.extras.changes_slots() {
            let time = time.map(|time| time - self.first_time);
            self.extras.handed_over(time, slots);
        }
    }

    #[inline(always)]
    fn begin_extras<W: Work>(&mut self, tick: &Tick, slots: &mut [Slot]) {
        if W::HAS_EXTRAS && self.extras.is_busy() {
            let moment = TickTime {
                time: tick.time - self.first_time,
                tick: self.counters.ticks,
            };
            self.extras.begin_tick(moment, slots);
        }
    }

    /// Sends: the first half.
    #[inline(always)]
    fn put<W: Work>(&mut self, now: Nanos, slots: &mut [Slot]) -> Result<(), BusError> {
        let is_changing = W::HAS_EXTRAS && self.extras.changes_slots();
        if is_changing {
            self.extras.beat(now, slots);
            self.extras.sending(slots);
        }
        self.write(now, slots);
        if is_changing {
            self.extras.sent(slots);
        }
        match &mut self.line {
            BusHandle::Stepped { bus, port, .. } if W::IS_STEPPED => {
                bus.as_stepped().send(now, port)
            }
            _ => Ok(()),
        }
    }

    /// Hands the values of all stations to the bus at once.
    #[inline(always)]
    fn write(&mut self, now: Nanos, slots: &[Slot]) {
        let (image, stations) = (&mut self.image, &self.stations);
        let is_written = match &stations[..] {
            [station] => image.write_word(now, station.encode.word(slots)),
            stations => image.write_words(now, |index| stations[index].encode.word(slots)),
        };
        if !is_written {
            write(image, stations, now, slots, &mut self.counters);
        }
    }

    /// Receives: returns what was found, and whether receiving succeeded.
    #[inline(always)]
    fn take<W: Work>(
        &mut self,
        tick: &Tick,
        slots: &mut [Slot],
    ) -> (Exchange, Result<(), BusError>) {
        let now = tick.now;
        let (granted, done) = match &mut self.line {
            BusHandle::Stepped { bus, port, .. } if W::IS_STEPPED => {
                match bus.as_stepped().receive(now, port) {
                    Ok(granted) => (granted, Ok(())),
                    Err(error) => (now, Err(error)),
                }
            }
            _ => (tick.time, Ok(())),
        };
        let (mut code, mut age) = (Code::Fresh, Nanos::ZERO);
        let max_age = self.max_age.get();
        let image = &mut self.image;
        image.update();
        match &mut self.stations[..] {
            [station] => {
                age = station.receive(image, (now, max_age), slots, &self.slots);
                code = station.status;
            }
            stations => {
                for station in stations {
                    age = age.max(station.receive(image, (now, max_age), slots, &self.slots));
                    code = code.worse(station.status);
                }
            }
        }
        if W::IS_STEPPED
            && let BusHandle::Stepped {
                bus: SteppedBus::Replay(replay),
                port,
                ..
            } = &mut self.line
            && !port.is_distorted(now)
        {
            (code, age) = replay.show(age, image, &mut self.stations, slots);
        }
        if W::HAS_EXTRAS && self.extras.changes_slots() {
            self.extras.received(slots);
        }
        let found = Exchange {
            code,
            sequence: self.image.cycles(),
            age,
            granted,
        };
        (found, done)
    }

    /// Keeps the result of a call on the bus that found `found`, and returns it.
    #[inline(always)]
    fn result<W: Work>(&mut self, found: Exchange, done: Result<(), BusError>) -> Exchange {
        let found = match done {
            Err(error) if W::IS_STEPPED => self.failed(found, &error),
            _ => found,
        };
        // Field by field: loading the whole struct right after partial stores would stall.
        self.last.code = found.code;
        self.last.sequence = found.sequence;
        self.last.age = found.age;
        self.last.granted = found.granted;
        found
    }

    /// Returns the result when the bus failed and `found` was found.
    #[cold]
    fn failed(&mut self, found: Exchange, error: &BusError) -> Exchange {
        let now = self.now::<InStep>();
        let (state, cause, reason) = (LinkState::Failed, error.into(), error.to_string());
        self.status.enter(now, state, cause, &reason);
        Exchange {
            code: Code::BusFailed,
            granted: now,
            ..found
        }
    }

    /// Returns the time since `begun` if the tick is in the sample, and else zero; on a stepped bus none is.
    #[inline(always)]
    fn lap<W: Work>(&mut self, begun: Nanos) -> Nanos {
        if !W::IS_STEPPED && TickTimes::takes(self.counters.ticks) {
            self.quick.now() - begun
        } else {
            Nanos::ZERO
        }
    }

    /// Ends a tick: counts and records it.
    #[inline(always)]
    fn end<W: Work>(&mut self, tick: Tick, found: Exchange, slots: &[Slot]) {
        self.counters.count(found.code);
        if W::HAS_EXTRAS && self.recorder.is_some() {
            self.record(tick, found.code, slots);
        }
        if !W::IS_STEPPED && TickTimes::takes(self.counters.ticks) {
            self.samples.add(tick.taken, found.age);
        }
        if W::HAS_EXTRAS {
            if self.extras.is_busy() {
                self.extras.rest();
            }
            self.shape = self.fitting_shape();
        }
        if self.tap.as_ref().is_some_and(Tap::is_wanted) {
            self.serve_watch(tick, found.code, slots);
        }
    }

    /// Returns the smallest shape that has all work of the next tick.
    pub(super) fn fitting_shape(&self) -> Shape {
        let is_first = self.counters.ticks == 0;
        let has_extras = is_first || self.extras.is_busy() || self.recorder.is_some();
        match &self.line {
            BusHandle::Stepped { .. } => Shape::InStep,
            BusHandle::Free(_) if has_extras || self.stations.len() != 1 => Shape::Extended,
            BusHandle::Free(_) => Shape::Plain,
        }
    }

    #[inline(never)]
    fn record(&mut self, tick: Tick, code: Code, slots: &[Slot]) {
        if let Some(recorder) = &mut self.recorder {
            let (number, time) = self.recorded.tick(self.counters.ticks, tick.time);
            let stations = self.stations.iter().map(|station| station.status.code());
            recorder.record(number, time, code.code(), stations, slots);
        }
    }
}

/// Encodes the values of all stations and hands them to the bus at once.
#[inline(never)]
fn write(
    image: &mut TickEnd,
    stations: &[Station],
    now: Nanos,
    slots: &[Slot],
    counters: &mut TickCounters,
) {
    image.write(now, |index, frame| {
        let bent = stations[index].encode.encode(slots, frame);
        if bent != Conversions::default() {
            counters.saturated += u64::from(bent.saturated);
            counters.not_a_number += u64::from(bent.not_a_number);
        }
    });
}

#[cold]
fn went_back(before: Nanos, time: Nanos) -> BusError {
    BusError::Refused(format!(
        "simulation time went back from {before} to {time}, and what runs on it cannot; hand in the \
         nanoseconds since the simulation began, and reset the driver when it begins again"
    ))
}

#[cfg(test)]
mod tests;
