//! The inside of the FMU: a driver, and the values of its variables.
//!
//! The calls follow each other as in the state machine of the standard: instantiated, initialization mode, step mode,
//! and event mode if the importing tool has asked for it (FMI 3.0, section 4.2.1).

mod steps;
mod values;

pub use steps::{StepEnd, Updated};

use std::ffi::CString;
use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::{Monotonic, Nanos, Stop};
use tickbus_driver::{Driver, Exchange};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_image::signal::Slot;
use tickbus_record as record;

use super::exposed::{Exposed, initial_slots};
use super::own::{cycle, default_pace};
use super::resources::token;
use crate::real_time::RealTime;
use crate::value::Version;

/// The state of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Created or reset: everything can be set.
    Before,
    /// In the initialization mode: everything can still be set.
    Initializing,
    /// The driver is open; a step can follow.
    Stepping,
    /// The driver is open, in the event mode.
    Events,
    /// Ended or failed.
    Over,
}

/// How the importing tool uses the event mode of FMI 3.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventMode {
    /// The tool does not use the event mode.
    Unused,
    /// The tool asks for events after a step.
    Used {
        /// True if a step can end at an event.
        early_return: bool,
    },
}

/// One instance of an FMU.
#[derive(Debug)]
pub struct Instance {
    version: Version,
    config: Config,
    exposed: Exposed,
    slots: Vec<Slot>,
    found: Exchange,
    phase: Phase,
    driver: Option<Driver>,
    /// The end of the last step, in seconds.
    time: f64,
    /// The simulation time at which the driver's time is 0, in seconds: the driver's time is never negative.
    origin: f64,
    /// The time between two bus cycles.
    cycle: Nanos,
    /// The time in seconds beyond which no step can go.
    stop_time: Option<f64>,
    event_mode: EventMode,
    /// True if the clock of bus cycles ticks.
    ticks: bool,
    real_time: RealTime,
    address: CString,
    record: CString,
    /// The last reason of the line's state that the importing tool has got.
    reason: CString,
    clock: Arc<Monotonic>,
    stop: Stop,
}

impl Instance {
    /// Creates an instance of the FMU whose resources are in `folder`; its model description has the token `given`. Its
    /// driver.cfg can name these `kinds` of bus. No bus is open yet.
    ///
    /// # Errors
    ///
    /// There is no driver.cfg, it is not the exported one, or it is wrong: returns every mistake in it.
    pub fn new(
        version: Version,
        folder: &Path,
        given: &str,
        kinds: &'static Kinds,
    ) -> Result<Self, String> {
        let path = folder.join("driver.cfg");
        let bytes = std::fs::read(&path).map_err(|error| {
            format!(
                "{}: {error}; an FMU of tickbus has its driver.cfg among its resources: unpack all of it, or export it again",
                path.display()
            )
        })?;
        let own = token(&bytes);
        if own != given {
            return Err(format!(
                "{} and the modelDescription.xml beside its folder do not belong together: of this driver.cfg an FMU has the token \
                 {own}, and the importing tool hands in \"{given}\"; do not edit either within an FMU, but edit your own driver.cfg \
                 and export it again",
                path.display()
            ));
        }
        let config = Config::load(&path, kinds).map_err(|mistakes| mistakes.to_string())?;
        let exposed = Exposed::of(&config, version);
        let mut new = Self {
            version,
            exposed,
            slots: Vec::new(),
            found: Exchange::NONE,
            phase: Phase::Before,
            driver: None,
            time: 0.0,
            origin: 0.0,
            cycle: cycle(&config),
            stop_time: None,
            event_mode: EventMode::Unused,
            ticks: false,
            real_time: RealTime::new(0.0),
            address: CString::default(),
            record: CString::default(),
            reason: CString::default(),
            clock: Monotonic::shared(),
            stop: Stop::new(),
            config,
        };
        new.reset();
        Ok(new)
    }

    /// Returns the driver's name.
    pub fn name(&self) -> &str {
        &self.config.name
    }

    /// Takes the importing tool's choice of the event mode, which a reset does not change.
    pub const fn set_event_mode(&mut self, event_mode: EventMode) {
        self.event_mode = event_mode;
    }

    /// Ends the run and resets every variable to its start value.
    pub fn reset(&mut self) {
        self.end();
        self.slots = initial_slots(&self.config);
        self.found = Exchange::NONE;
        self.phase = Phase::Before;
        self.time = 0.0;
        self.origin = 0.0;
        self.stop_time = None;
        self.ticks = false;
        self.real_time = RealTime::new(default_pace(&self.config));
        let file = self.config.record.as_ref().map(|record| &record.file);
        let file = file.map(|file| file.to_string_lossy().into_owned());
        self.address = CString::default();
        self.reason = CString::default();
        self.record = CString::new(file.unwrap_or_default()).unwrap_or_default();
    }

    /// Sets the times at which the simulation will begin and end, in seconds. A step beyond `stop` is refused.
    ///
    /// # Errors
    ///
    /// The run has begun already, or a time is not valid.
    pub fn setup(&mut self, start: f64, stop: Option<f64>) -> Result<(), String> {
        if self.phase != Phase::Before {
            return Err(self.unfit("setting the times of the run"));
        }
        if !start.is_finite() {
            return Err(format!("the start time is {start}; hand in seconds"));
        }
        if let Some(stop) = stop
            && (stop.is_nan() || stop < start)
        {
            return Err(format!(
                "the stop time is {stop} s, and the start time {start} s; hand in a stop time that follows the start time"
            ));
        }
        self.time = start;
        self.origin = start.min(0.0);
        self.stop_time = stop;
        Ok(())
    }

    /// Enters the initialization mode.
    ///
    /// # Errors
    ///
    /// The instance has entered it already.
    pub fn enter_initialization(&mut self) -> Result<(), String> {
        if self.phase != Phase::Before {
            return Err(self.unfit("entering the initialisation mode"));
        }
        self.phase = Phase::Initializing;
        Ok(())
    }

    /// Leaves the initialization mode and opens the bus. A free bus connects in the background; opening does not wait
    /// for that.
    ///
    /// # Errors
    ///
    /// The instance is not in the initialization mode, or the bus cannot be opened; returns why.
    pub fn open(&mut self) -> Result<(), String> {
        if self.phase != Phase::Initializing {
            return Err(self.unfit("leaving the initialisation mode"));
        }
        // Parameters are read-only from here on.
        self.phase = Phase::Over;
        let mut config = self.config.clone();
        if let Ok(address) = self.address.to_str()
            && !address.is_empty()
        {
            let set = config.bus.set_address(address);
            set.map_err(|mistake| format!("address: {mistake}"))?;
        }
        let file = self.record.to_str().unwrap_or_default();
        if file.is_empty() {
            config.record = None;
        } else {
            // Not next to driver.cfg: the FMU is unpacked to a temporary folder.
            let file = std::path::absolute(file).map_err(|why| format!("record: {why}"))?;
            let to = record::Options::to(&file);
            let to = to.map_err(|mistake| format!("record: {mistake}"))?;
            config.record = Some(match config.record.take() {
                Some(own) if file.ends_with(&own.file) => record::Options { file, ..own },
                _ => to,
            });
        }
        if config.page.is_some() {
            log::warn!(
                "driver \"{}\": its driver.cfg asks for a live page, and an FMU has none, because the importing tool unpacks it into \
                 a folder that has no picture and is removed; remove [page], or open the driver from C, Java or Python",
                config.name
            );
        }
        let driver = Driver::open(config, Monotonic::shared()).map_err(|why| why.to_string())?;
        self.driver = Some(driver);
        self.phase = match self.event_mode {
            EventMode::Unused => Phase::Stepping,
            EventMode::Used { .. } => Phase::Events,
        };
        Ok(())
    }

    /// Returns true if the bus has ended on its own, for example because a run on virtual time is over: the last step
    /// was not done, and no further one will be.
    pub fn is_over(&self) -> bool {
        self.driver.as_ref().is_some_and(Driver::is_over)
    }

    /// Returns the end of the last completed step, in seconds.
    pub const fn time(&self) -> f64 {
        self.time
    }

    /// Ends the run: closes the bus, which leaves the fail-safe values behind. The variables keep their values.
    ///
    /// # Errors
    ///
    /// No run has begun, or it has ended already.
    pub fn terminate(&mut self) -> Result<(), String> {
        if !matches!(self.phase, Phase::Stepping | Phase::Events) {
            return Err(self.unfit("terminating"));
        }
        self.end();
        Ok(())
    }

    /// Returns true until the bus is opened: everything can be set.
    const fn is_settable(&self) -> bool {
        matches!(self.phase, Phase::Before | Phase::Initializing)
    }

    /// Refuses a call that the standard does not allow here.
    #[cold]
    fn unfit(&self, call: &str) -> String {
        let fmi = self.version.name();
        let (state, remedy) = match self.phase {
            Phase::Before => (
                "before the initialisation",
                format!("call {fmi}EnterInitializationMode first"),
            ),
            Phase::Initializing => (
                "before the initialisation has ended",
                format!("call {fmi}ExitInitializationMode first"),
            ),
            Phase::Stepping => (
                "in the step mode",
                "only a step, the event mode or the end can follow".to_owned(),
            ),
            Phase::Events => (
                "in the event mode",
                "call fmi3EnterStepMode first".to_owned(),
            ),
            Phase::Over => (
                "after the end of the run",
                "reset the instance, or make another one".to_owned(),
            ),
        };
        format!("{call} {state}; {remedy}")
    }

    /// Closes the bus, if it is open. The variables keep their values.
    pub fn end(&mut self) {
        self.phase = Phase::Over;
        if let Some(mut driver) = self.driver.take() {
            driver.end_tick(&self.slots);
            driver.close();
        }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        self.end();
    }
}

#[cfg(test)]
mod tests;
