//! Resets a driver: the simulation begins its next episode, and the driver stays open.

use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_driver_cfg::loopback::{Options, Peer};
use tickbus_fieldbus::{Cause, LinkState};
use tickbus_image::signal::Slot;

use super::bus;
use super::bus_handle::BusHandle;
use super::open::{counters_of, extras, image_of, start};
use super::tick_counters::TickTimes;
use super::{Driver, DriverError, Exchange, TickCounters};

impl Driver {
    /// Begins the next episode of the simulation, and sets `slots` to their initial values.
    ///
    /// All that belongs to the ticks begins again: their counters and samples, the counts of edges, heartbeats, axes,
    /// the faults of the configuration (injected ones end), and pending events. Time begins at zero again.
    ///
    /// If the other end is in this driver (a hosted program or a replayed recording), or on a stepped loopback, the
    /// line begins again, too: a program is at its first scan. On any other line that has its own thread, the
    /// connection and its counters stay, and the peer sees the initial values with the next tick. A recording continues,
    /// and its time goes on from the last tick.
    ///
    /// # Errors
    ///
    /// [`DriverError::Unsupported`] on a stepped bus whose time belongs to others as well; or an error of opening the
    /// line. The driver is then as before.
    ///
    /// # Panics
    ///
    /// As [`exchange`](Self::exchange).
    pub fn reset(&mut self, slots: &mut [Slot]) -> Result<(), DriverError> {
        self.check(slots);
        if self.has_own_line() {
            self.reopen_line(slots)?;
        } else if self.is_stepped() {
            return Err(DriverError::Unsupported(format!(
                "driver \"{}\" cannot be reset: the time on its line belongs to the other participants as well, and \
                 cannot begin again for one of them; end the run, and open the driver again",
                self.config.name
            )));
        } else {
            self.end_tick(slots);
            self.image.restart();
        }
        self.counters = TickCounters::default();
        self.samples = TickTimes::default();
        (self.first_now, self.first_time) = (Nanos::ZERO, Nanos::ZERO);
        (self.given, self.last) = (None, Exchange::NONE);
        self.recorded.restart();
        self.extras.restart(extras(&self.config, &self.board));
        self.inject_configured()?;
        self.shape = self.fitting_shape();
        let initial = self.initial_slots();
        slots[..initial.len()].copy_from_slice(&initial);
        Ok(())
    }

    /// Returns true if nothing outside this driver depends on the line, or on its time.
    fn has_own_line(&self) -> bool {
        let config = self.line_config();
        let options = config.bus.downcast_ref::<Options>();
        options.is_some_and(|options| match options.peer {
            Peer::Program { .. } | Peer::Replay(_) => true,
            Peer::Link(_) => self.is_stepped(),
        })
    }

    /// Returns the present settings of the line, which may be others than those that the driver was opened with.
    fn line_config(&self) -> Arc<Config> {
        let present = match &self.line {
            BusHandle::Free(line) => line.config(),
            BusHandle::Stepped { .. } => None,
        };
        present.unwrap_or_else(|| Arc::clone(&self.config))
    }

    /// Opens the line and the other end again, in place of the present ones, whose tick ends with these `slots`.
    fn reopen_line(&mut self, slots: &[Slot]) -> Result<(), DriverError> {
        // The present line counts until it ends, which takes longer than the next one needs to begin.
        let swallowed = self.swallowed.of_next_line();
        let config = self.line_config();
        let (bus, program) = bus::open(&config, &self.clock, None, &swallowed)?;
        let (image, bus_end) = image_of(&config, &swallowed);
        let counters = counters_of(program.as_ref());
        let time = match &self.line {
            BusHandle::Stepped { time, .. } => Arc::clone(time),
            BusHandle::Free(_) => Arc::default(),
        };
        let (status, times) = (&self.status, (&self.clock, &time));
        let line = (status, &self.board, &swallowed);
        let opened = (bus, program);
        let line = start(
            &config,
            opened,
            bus_end,
            times,
            line,
            (&self.program_counters, &self.bus_facts),
        )?;
        // The present tick and line end only now, so that a failure leaves them as they are.
        self.end_tick(slots);
        match (&self.line, line) {
            (BusHandle::Free(before), BusHandle::Free(next)) => before.go_on_with(&next),
            (_, line) => self.line = line,
        }
        self.image = image;
        self.program_counters.replace(counters);
        swallowed.begin();
        self.swallowed = swallowed;
        if self.is_stepped() {
            time.restart();
        }
        // The end of the former line has closed it. A new line that runs already says so again.
        let (now, status) = (self.clock.now(), &self.status);
        status.injected("");
        status.doubt(now, None, std::iter::empty());
        let why = "the simulation was reset";
        status.enter(now, LinkState::Opening, Cause::Waiting, why);
        Ok(())
    }
}

#[cfg(all(test, not(loom)))]
mod tests;
