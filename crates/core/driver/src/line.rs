//! The line of a free bus, whose settings can be changed while the ticks go on.
//!
//! The bus of the old settings ends as at the end of the driver, and hands its port on to the bus of the new ones. Ticks
//! notice nothing but stale data: the image, the counters and the injected faults stay. All of this happens on the
//! thread that asks for it.

use std::any::Any;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::time::{Clock, Nanos};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{
    Cause, ChangeEvents, Events, Free, LinkState, LinkStatus, Port, Role, SwallowedSignals,
};

use super::DriverError;
use super::statistics::BusFacts;
use super::supervise::BusThread;

/// A handle on the line of an open driver, for any thread. A handle that outlives its driver keeps nothing open.
#[derive(Clone)]
pub struct Line(Arc<Shared>);

/// Why a line did not take other settings.
#[derive(Debug, thiserror::Error)]
pub enum Untaken {
    /// More than the line differs. The list says what, each as half a sentence.
    #[error("{}; restart the simulation for that", .0.join("; "))]
    NeedsRestart(Vec<String>),
    /// The settings are wrong, or this build cannot have them.
    #[error(transparent)]
    Wrong(#[from] DriverError),
    /// The driver is closed.
    #[error("the simulation has closed this driver; start it again")]
    Closed,
    /// The line is lost: its old bus is stuck, or the system has no thread for the new one.
    #[error("{0}; restart the simulation")]
    Lost(String),
}

/// The end of a line that ticks: what a new bus is built for.
pub(super) struct Ends {
    /// The name of the bus thread.
    pub(super) name: String,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) status: LinkStatus,
    pub(super) bus_facts: BusFacts,
    /// True if changes and writes of the peer can be reported one by one.
    pub(super) reports_events: bool,
}

/// The party that ticks: a simulation, or a program at this end.
pub(super) trait Owner: Send + Sync {
    /// Opens the bus that `config` describes, and starts the other end if that is in this process.
    fn open(
        &self,
        config: &Config,
        clock: &Arc<dyn Clock>,
        swallowed: &SwallowedSignals,
    ) -> Result<Opened, DriverError>;

    /// The line takes the settings of `config`. Returns how long the ticks may pause before the peer gets fail-safe
    /// values.
    fn take(&self, config: &Config) -> Option<Nanos>;
}

/// A bus that an [`Owner`] has opened.
pub(super) struct Opened {
    /// `None` for a bus that the ticks run.
    pub(super) bus: Option<Box<dyn Free>>,
    pub(super) other_end: OtherEnd,
}

/// The other end of a bus, kept for its drop, if it is in this process.
pub(super) type OtherEnd = Option<Box<dyn Any + Send>>;

/// The line as the driver has it; dropping it closes the line.
pub(super) struct FreeLine(Arc<Shared>);

struct Shared {
    ends: Ends,
    owner: Box<dyn Owner>,
    state: Mutex<Option<Open>>,
}

struct Open {
    config: Arc<Config>,
    /// `None` if the line is lost.
    thread: Option<BusThread>,
    /// Dropped after the bus.
    other_end: OtherEnd,
    swallowed: SwallowedSignals,
}

impl FreeLine {
    /// Starts `bus`, which `config` describes, on the line of `ends`.
    pub(super) fn start(
        config: &Arc<Config>,
        (bus, port): (Box<dyn Free>, Port),
        (other_end, swallowed): (OtherEnd, SwallowedSignals),
        (ends, owner): (Ends, Box<dyn Owner>),
    ) -> Result<Self, DriverError> {
        let port = ends.equipped(port, config);
        let thread = ends.start(config, bus, port)?;
        let open = Open {
            config: Arc::clone(config),
            thread: Some(thread),
            other_end,
            swallowed,
        };
        Ok(Self(Arc::new(Shared {
            ends,
            owner,
            state: Mutex::new(Some(open)),
        })))
    }

    pub(super) fn handle(&self) -> Line {
        Line(Arc::clone(&self.0))
    }

    /// Ends the present bus and goes on with that of `next`. Handles stay valid.
    pub(super) fn go_on_with(&self, next: &Self) {
        let next = next.0.lock().take();
        let before = std::mem::replace(&mut *self.0.lock(), next);
        drop(before);
    }

    /// Returns the settings of the line at present.
    pub(super) fn config(&self) -> Option<Arc<Config>> {
        self.handle().config()
    }
}

impl Drop for FreeLine {
    fn drop(&mut self) {
        // Whoever changes the settings just now has the line until that is done.
        let open = self.0.lock().take();
        drop(open);
    }
}

impl Ends {
    /// Starts the thread of `bus`.
    pub(super) fn start(
        &self,
        config: &Config,
        bus: Box<dyn Free>,
        port: Port,
    ) -> Result<BusThread, DriverError> {
        let (table, timing) = (&config.table, &config.timing);
        let own = (&*self.name, config.real_time);
        let thread = BusThread::start(bus, port, table, timing, self.status.clone(), own);
        thread.map_err(|source| DriverError::no_thread("the bus", source))
    }

    /// Returns the port with what `config` wants it to watch.
    pub(super) fn equipped(&self, port: Port, config: &Config) -> Port {
        self.equipped_as(config.role, port, config)
    }

    /// As [`equipped`](Self::equipped), for the end with `role` of the line.
    pub(super) fn equipped_as(&self, role: Role, port: Port, config: &Config) -> Port {
        let (table, max_age) = (&config.table, config.timing.max_age);
        let port = port
            .with_life_signs(config.life_signs.watches(table, role, max_age))
            .with_names(table.stations.iter().map(|s| s.name.as_str()));
        if config.events == Events::None || !self.reports_events {
            return port;
        }
        let (_, rx) = role.areas();
        let stations = 0..table.stations.len();
        port.with_changes(
            stations
                .map(|station| ChangeEvents::new(table, station, rx))
                .collect(),
        )
    }
}

impl Line {
    /// Returns the settings of the line at present; `None` once the driver is closed.
    pub fn config(&self) -> Option<Arc<Config>> {
        let state = self.0.lock();
        state.as_ref().map(|open| Arc::clone(&open.config))
    }

    /// Returns what of `config` the line cannot take, each as half a sentence: more than its own settings. Empty if the
    /// line can take them.
    pub fn needs_restart(&self, config: &Config) -> Vec<String> {
        let present = self.config();
        present.map_or_else(Vec::new, |present| present.needs_restart(config))
    }

    /// Gives the line the settings of `config`: ends its bus, which leaves the peer with the values that `at_close`
    /// asks for, and opens the bus that `config` describes. Meanwhile the data are stale. Does not wait for the new
    /// peer, as [`Driver::open`](super::Driver::open) does not. Returns false if the line has these settings already.
    ///
    /// # Errors
    ///
    /// See [`Untaken`]; the line goes on as before, unless it is [lost](Untaken::Lost).
    pub fn take(&self, config: Config) -> Result<bool, Untaken> {
        let shared = &*self.0;
        let mut state = shared.lock();
        let open = state.as_mut().ok_or(Untaken::Closed)?;
        let mut config = config;
        if let Ok(path) = std::path::absolute(&config.path) {
            config.path = path;
        }
        let needs_restart = open.config.needs_restart(&config);
        if !needs_restart.is_empty() {
            return Err(Untaken::NeedsRestart(needs_restart));
        }
        if open.config.has_line_of(&config) && open.thread.is_some() {
            return Ok(false);
        }
        shared.switch(open, config)?;
        Ok(true)
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Option<Open>> {
        // What panicked has the old line or none.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn switch(&self, open: &mut Open, config: Config) -> Result<(), Untaken> {
        let ends = &self.ends;
        // Before the old bus ends: what cannot be opened must not cost the line.
        let Opened { bus, other_end } = self.owner.open(&config, &ends.clock, &open.swallowed)?;
        let Some(bus) = bus else {
            let kind = config.bus.kind();
            let what = format!("a bus \"{kind}\" runs in step with the simulation");
            return Err(Untaken::NeedsRestart(vec![what]));
        };
        let old = open.thread.take().ok_or_else(|| {
            Untaken::Lost("the bus of this line is stuck since the last change".to_owned())
        })?;
        let name = &ends.name;
        log::info!("driver \"{name}\": its line takes other settings");
        let Some(port) = old.end_for_next() else {
            let why = "the old bus does not end, and its thread is left behind";
            let (now, state) = (ends.clock.now(), LinkState::Failed);
            ends.status.enter(now, state, Cause::Hung, why);
            return Err(Untaken::Lost(why.to_owned()));
        };
        ends.status.limit().set(config.timing.max_age);
        let watchdog = self.owner.take(&config);
        ends.bus_facts.set(&config);
        open.other_end = other_end;
        let mut port = ends.equipped(port.for_next_bus(watchdog), &config);
        ends.status.note_other_settings(ends.clock.now());
        port.opening("the line has other settings");
        match ends.start(&config, bus, port) {
            Ok(thread) => {
                open.thread = Some(thread);
                open.config = Arc::new(config);
                Ok(())
            }
            Err(error) => {
                let why = error.to_string();
                let (now, state) = (ends.clock.now(), LinkState::Failed);
                ends.status.enter(now, state, Cause::Link, &why);
                Err(Untaken::Lost(why))
            }
        }
    }
}

impl fmt::Debug for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Line").finish_non_exhaustive()
    }
}

impl fmt::Debug for FreeLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FreeLine").finish_non_exhaustive()
    }
}

#[cfg(all(test, not(loom)))]
mod tests;
