//! A PLC program alone at one end of a bus: the second front door, next to the one for simulations.

use std::sync::{Arc, PoisonError};

use tickbus_base::Mistake;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_fieldbus::faults::FaultStatus;
use tickbus_fieldbus::{Bus, Hosted, Lead, Link, MaxAge, SwallowedSignals};
use tickbus_plc::Program;

use super::bus_handle::{OpenBus, SteppedBus};
use super::host::{HostThread, ScanSetup, check_fit, watchdog};
use super::line::{Line, Opened, Owner};
use super::open::swallowed_of;
use super::recording::{recorder, remember};
use super::watch::Watch;
use super::{DriverError, SlotMap, bus, real_time};
use tickbus_driver_cfg::Config;

/// A PLC program at one end of a bus, scanned at a fixed interval: a PLC without its hardware.
///
/// In the role Device, the program replaces the machine: `%Q` are its inputs, `%I` its outputs.
#[derive(Debug)]
pub struct Host(HostThread);

/// The scans of a program, as the owner of its line.
struct Scans {
    interval: Nanos,
    stop: Stop,
    /// False if a late scan does not count as a broken line.
    has_watchdog: bool,
    /// How long the program can pause between two scans; [`Nanos::MAX`] for any time.
    watchdog: MaxAge,
}

impl Owner for Scans {
    fn open(
        &self,
        config: &Config,
        clock: &Arc<dyn Clock>,
        swallowed: &SwallowedSignals,
    ) -> Result<Opened, DriverError> {
        let hosted = Hosted {
            interval: self.interval,
            stop: &self.stop,
        };
        let bus = match bus::open(config, clock, Some(hosted), swallowed)?.0 {
            OpenBus::Free(bus) => Some(bus),
            OpenBus::Stepped(_) => None,
        };
        Ok(Opened {
            bus,
            other_end: None,
        })
    }

    fn take(&self, config: &Config) -> Option<Nanos> {
        let watchdog = watchdog(config, (true, config.role), self.interval);
        let watchdog = watchdog.filter(|_| self.has_watchdog);
        self.watchdog.set(watchdog.unwrap_or(Nanos::MAX));
        watchdog
    }
}

impl Host {
    /// Opens the bus that `config` describes and starts scanning `program` every `interval`. Opening does not wait for
    /// the peer: scans begin at once, and see that the peer is absent. On a bus that hands out the time, scans begin
    /// with the bus's first step, and `interval` is virtual time.
    ///
    /// # Errors
    ///
    /// The program does not fit the signal table, the bus must be stepped by a simulation, the recording cannot be
    /// created, or the system refused a thread.
    pub fn open(
        config: &Config,
        program: Box<dyn Program>,
        interval: Nanos,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, DriverError> {
        Self::open_with(config, program, (interval, true), clock)
    }

    /// As [`open`](Self::open), without the watchdog: on a busy computer a late scan changes no values on the bus.
    /// Meant for a program whose peer waits for it.
    ///
    /// # Errors
    ///
    /// As [`open`](Self::open).
    pub fn open_patient(
        config: &Config,
        program: Box<dyn Program>,
        interval: Nanos,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, DriverError> {
        Self::open_with(config, program, (interval, false), clock)
    }

    fn open_with(
        config: &Config,
        mut program: Box<dyn Program>,
        (interval, has_watchdog): (Nanos, bool),
        clock: Arc<dyn Clock>,
    ) -> Result<Self, DriverError> {
        let unfit = |what: &str, right: &str| DriverError::Fit {
            file: config.path.display().to_string(),
            mistake: Mistake::new(what, right),
        };
        check_fit(config, &mut *program, config.role)?;
        if config.table.stations.len() > 1 && !config.faults.is_empty() {
            return Err(unfit(
                "a program behind several stations can have no faults injected",
                "use one driver.cfg per station for that",
            ));
        }
        real_time::check(config, &*clock)?;
        let stop = Stop::new();
        let hosted = Hosted {
            interval,
            stop: &stop,
        };
        let swallowed = swallowed_of(config, &format!("plc {}", program.name()));
        let bus = match bus::open(config, &clock, Some(hosted), &swallowed)?.0 {
            OpenBus::Free(bus) => Bus::Free(bus),
            OpenBus::Stepped(SteppedBus::Any(bus)) if bus.lead() != Lead::Simulation => {
                Bus::Stepped(bus)
            }
            OpenBus::Stepped(_) => {
                return Err(unfit(
                    "this bus runs on the ticks of a simulation, so that no PLC program can run on it by itself",
                    "choose mode = \"free\" and a \"link\", or another kind of bus",
                ));
            }
        };
        let map = SlotMap::new(&config.table, config.role);
        let is_stepped = matches!(bus, Bus::Stepped(_));
        let mut recorder = recorder(config, &map, None, is_stepped, &clock)?;
        remember(config, &map, None, &mut recorder, (is_stepped, &clock))?;
        let watchdog = watchdog(config, (true, config.role), interval);
        let watchdog = watchdog.filter(|_| has_watchdog);
        let owner = Scans {
            interval,
            stop: stop.clone(),
            has_watchdog,
            watchdog: MaxAge::new(watchdog.unwrap_or(Nanos::MAX)),
        };
        let pause = owner.watchdog.clone();
        let hosted = ScanSetup {
            own: Some((Box::new(owner), pause)),
            program,
            interval,
            has_watchdog,
            recorder,
            swallowed,
        };
        HostThread::start(hosted, (config, config.role), (bus, stop), clock).map(Self)
    }

    /// Returns the state of the line.
    pub fn link(&self) -> Link {
        let now = self.0.observe();
        self.0.figures.status.observe_call(now);
        self.0.figures.status.link()
    }

    /// Returns the counters and the state of the line, one `key=value` per line.
    pub fn statistics(&self) -> String {
        let now = self.0.observe();
        self.0.figures.statistics(now, None).to_string()
    }

    /// Lets another thread look at the program's image and force its signals. Returns `None` if the watch has been
    /// handed out already. While the watch asks for nothing, a scan only checks one word.
    pub fn watch(&self) -> Option<Watch> {
        let mut watch = self.0.watch.lock().unwrap_or_else(PoisonError::into_inner);
        watch.take()
    }

    /// Returns the line, whose settings can be changed while the program is scanned; `None` on a bus that hands out the
    /// time.
    pub fn line(&self) -> Option<Line> {
        self.0.line()
    }

    /// Returns the injected faults of this end.
    pub fn injected_faults(&self) -> Vec<FaultStatus> {
        self.0.figures.board.list()
    }

    /// Returns the number of scans so far, and how many of them had stale data.
    pub fn scans(&self) -> (u64, u64) {
        self.0.counters.scan_counters.scans()
    }

    /// Returns why the program is no longer scanned, if so: it panicked, or a scan does not end.
    pub fn fault(&self) -> Option<String> {
        self.0.counters.fault()
    }

    /// Returns true if the program is no longer scanned: the run of its bus has ended, or there is a
    /// [`fault`](Self::fault).
    pub fn is_over(&self) -> bool {
        self.0.is_over()
    }

    /// Returns true if the line has failed and has never come up.
    pub fn has_only_failed(&self) -> bool {
        self.0.figures.status.has_only_failed()
    }

    /// Returns what the bus reported under this key of the statistics.
    pub fn fact(&self, key: &'static str) -> Option<String> {
        self.0.figures.status.fact(key)
    }

    /// Stops scanning and closes the bus. If the program did not end, returns why.
    pub fn close(mut self) -> Option<String> {
        self.0.figures.swallowed.log();
        self.0.end()
    }
}
