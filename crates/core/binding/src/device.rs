//! An open driver with the buffer that it shares with the simulator.
#![allow(
    clippy::inline_always,
    reason = "a tick is part of the function that the simulator calls, and pays for no further call"
)]

use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_driver::{Code, Driver, Exchange, Snapshot};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::{Fault, FaultBoard};
use tickbus_image::Event;
use tickbus_image::signal::Slot;

use crate::description::SignalDescription;
use crate::fault::{declare_model_faults, inject};
use crate::refusal::Refusal;
use crate::reload::Reload;
use crate::shared::{NO_TIME, Shared, Word};
use crate::swallowed::swallowed;

/// The most events handed over in one call.
pub const EVENTS: usize = 64;

/// Words per event: signal, value, time.
pub const EVENT_WORDS: usize = 3;

/// An open driver and its shared buffer; `K` keeps the buffer's memory alive.
pub struct Device<K> {
    driver: Driver,
    shared: Shared<K>,
    ticks: u64,
    events: [Event; EVENTS],
}

impl<K> Device<K> {
    /// Joins a driver and its buffer, and sets the slots to their initial values.
    pub fn new(driver: Driver, mut shared: Shared<K>) -> Self {
        shared.slots().copy_from_slice(&driver.initial_slots());
        Self {
            driver,
            shared,
            ticks: 0,
            events: [Event::default(); EVENTS],
        }
    }

    /// One tick: sends the slots that the simulation wrote, fills those that it reads, and the header.
    #[inline(always)]
    pub fn exchange(&mut self) -> Code {
        self.ticks += 1;
        let done = self.driver.exchange(self.time(), self.shared.slots());
        self.tell(done)
    }

    /// The first half of a tick: fills the slots that the simulation reads, and the header.
    #[inline(always)]
    pub fn receive(&mut self) -> Code {
        self.ticks += 1;
        let done = self.driver.receive(self.time(), self.shared.slots());
        self.tell(done)
    }

    /// The second half of a tick: sends the slots that the simulation wrote.
    #[inline(always)]
    pub fn send(&mut self) -> Code {
        let done = self.driver.send(self.shared.slots());
        self.tell(done)
    }

    /// Calls `work` with the driver and the slots, between two ticks.
    pub fn between_ticks<R>(&mut self, work: impl FnOnce(&mut Driver, &mut [Slot]) -> R) -> R {
        work(&mut self.driver, self.shared.slots())
    }

    /// Sets the time of the next tick, as if the simulator had written it.
    pub fn set_time(&mut self, nanos: i64) {
        self.shared
            .write(Word::SimulationTime, nanos.cast_unsigned());
    }

    /// Begins the next episode of the simulation: see [`Driver::reset`].
    ///
    /// # Errors
    ///
    /// `UNSUPPORTED` if the line cannot begin again, or the reason why it could not be opened. The driver is then as
    /// before.
    pub fn reset(&mut self) -> Result<(), Refusal> {
        self.driver.reset(self.shared.slots())?;
        self.shared.restart();
        self.ticks = 0;
        Ok(())
    }

    /// The time that the simulator wrote, if any.
    #[inline]
    fn time(&self) -> Option<Nanos> {
        let time = self.shared.read(Word::SimulationTime);
        (time != NO_TIME).then_some(Nanos(time.cast_signed()))
    }

    #[inline]
    fn tell(&mut self, done: Exchange) -> Code {
        self.shared
            .write(Word::Status, i64::from(done.code.code()).cast_unsigned());
        self.shared.write(Word::Sequence, done.sequence);
        self.shared.write(Word::Age, done.age.0.cast_unsigned());
        self.shared
            .write(Word::Granted, done.granted.0.cast_unsigned());
        self.shared.write(Word::Ticks, self.ticks);
        done.code
    }

    /// The data of the statistics; the caller formats them after releasing the driver.
    pub fn snapshot(&self) -> Snapshot {
        let mut snapshot = self.driver.snapshot();
        let counted = [Word::Saturated, Word::NotANumber].map(|word| self.shared.read(word));
        snapshot.add_conversions(counted);
        snapshot
    }

    /// Calls `tell` with the description of the signal with this index.
    pub fn describe<R>(&self, signal: usize, tell: impl FnOnce(&SignalDescription<'_>) -> R) -> R {
        tell(&SignalDescription::of(&self.driver, signal))
    }

    /// A line for each signal whose changes were swallowed: its index, a tab, and how often, where, and what to do.
    pub fn swallowed(&self) -> String {
        swallowed(&self.driver)
    }

    /// How many changes were swallowed, of all signals.
    #[inline]
    pub fn swallowed_changes(&self) -> u64 {
        self.driver.swallowed().counts().of_all()
    }

    /// True if the bus has ended the run on its own, as virtual time does: further ticks bring nothing.
    pub fn is_over(&self) -> bool {
        self.driver.is_over()
    }

    /// The parts of the driver that a reload of the driver.cfg needs; the reload runs without a claim on the driver.
    pub fn reload(&self) -> Reload {
        Reload::of(&self.driver)
    }

    /// The configuration that the driver was opened with.
    pub fn config(&self) -> Arc<Config> {
        Arc::clone(self.driver.config())
    }

    /// Injects a fault and returns its number.
    ///
    /// # Errors
    ///
    /// `BAD_ARGUMENT` if too many faults wait or are active, or the simulation's model has no fault of this name.
    pub fn inject(&mut self, fault: &Fault) -> Result<u32, Refusal> {
        inject(&mut self.driver, fault)
    }

    /// Ends a fault; false if no fault has this number.
    pub fn end_fault(&mut self, id: u32) -> bool {
        self.driver.end_fault(id)
    }

    /// Takes the names of the faults that the simulation's model can have: see [`Driver::declare_model_faults`].
    ///
    /// # Errors
    ///
    /// `BAD_ARGUMENT` if a name is not usable, or a fault of the model has none of the names.
    pub fn declare_model_faults(&mut self, names: Vec<String>) -> Result<(), Refusal> {
        declare_model_faults(&mut self.driver, names)
    }

    /// Returns whether there may be a change of a fault of the model: see [`Driver::has_model_change`].
    #[inline]
    pub fn has_model_change(&self) -> bool {
        self.driver.has_model_change()
    }

    /// The next change of a fault of the model: see [`Driver::next_model_change`].
    #[inline]
    pub fn next_model_change(&mut self) -> Option<(usize, Option<f64>)> {
        self.driver.next_model_change()
    }

    /// The board on which the injected faults publish their state.
    pub fn board(&self) -> Arc<FaultBoard> {
        Arc::clone(self.driver.board())
    }

    /// Moves pending events to `into`, three words each; returns their number.
    pub fn events(&mut self, into: &mut [i64]) -> usize {
        let room = (into.len() / EVENT_WORDS).min(EVENTS);
        let count = self.driver.poll_events(&mut self.events[..room]);
        for (event, words) in self.events[..count]
            .iter()
            .zip(into.chunks_exact_mut(EVENT_WORDS))
        {
            words.copy_from_slice(&[
                i64::from(event.signal),
                event.value.0.cast_signed(),
                event.time.0,
            ]);
        }
        count
    }

    /// Closes the driver. A tick that was begun and not answered is recorded with the values written last. Returns the
    /// shared buffer, which is no longer in use.
    pub fn close(mut self) -> Shared<K> {
        self.driver.end_tick(self.shared.slots());
        self.driver.close();
        self.shared
    }
}
