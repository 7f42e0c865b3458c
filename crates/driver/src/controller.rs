//! A PLC program at one end of a bus, by itself: the other front door, beside that of a simulation.

use std::sync::{Arc, PoisonError};

use tickbus_base::Mistake;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_fieldbus::faults::FaultStatus;
use tickbus_fieldbus::{Bus, Hosted, Lead, Link};
use tickbus_plc::Program;

use super::bus_handle::{OpenBus, SteppedBus};
use super::host::{HostThread, ScanSetup, check_fit};
use super::recording::ScanRecorder;
use super::watch::Watch;
use super::{DriverError, bus};
use tickbus_driver_cfg::Config;

/// A PLC program at one end of a bus, scanned at a fixed interval: a PLC without its hardware.
///
/// In the role Device, a program replaces the machine: `%Q` are its inputs, `%I` its outputs.
#[derive(Debug)]
pub struct Host(HostThread);

impl Host {
    /// Opens the bus that `config` describes and starts scanning `program` every `interval`. It does not wait
    /// for the peer: scans begin at once, and are told that the peer is not there. On a bus that hands out the time they
    /// begin with its first step, and `interval` is one of virtual time.
    ///
    /// # Errors
    ///
    /// Program and signal table do not fit, the bus must be stepped by a simulation, the recording cannot be
    /// created, or the system refused a thread.
    pub fn open(
        config: &Config,
        program: Box<dyn Program>,
        interval: Nanos,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, DriverError> {
        Self::open_with(config, program, (interval, true), clock)
    }

    /// As [`open`](Self::open), without the watchdog: on a busy computer a late scan changes no values on the bus. For
    /// a program whose peer waits for it.
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
        if config.table.stations.len() > 1 && !(config.faults.is_empty() && config.record.is_none())
        {
            return Err(unfit(
                "a program behind several stations can neither be recorded nor have faults injected",
                "use one driver.cfg per station for that",
            ));
        }
        let stop = Stop::new();
        let hosted = Hosted {
            interval,
            stop: &stop,
        };
        let bus = match bus::open(config, &clock, Some(hosted))?.0 {
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
        let title = format!("plc {}", program.name());
        let role = config.role;
        let is_stepped = matches!(bus, Bus::Stepped(_));
        let hosted = ScanSetup {
            program,
            interval,
            has_watchdog,
            tape: ScanRecorder::start(config, role, is_stepped, &clock)?,
        };
        let thread = match bus {
            Bus::Free(bus) => HostThread::start(hosted, &title, config, role, bus, clock),
            Bus::Stepped(bus) => {
                HostThread::start_in_steps(hosted, &title, (config, role), (bus, stop), clock)
            }
        };
        thread.map(Self)
    }

    /// The state of the line.
    pub fn link(&self) -> Link {
        self.0.status.observe_call(self.0.counters.clock.now());
        self.0.status.link()
    }

    /// The counters and the state of the line, one `key=value` per line.
    pub fn statistics(&self) -> String {
        let now = self.0.counters.clock.now();
        self.0.figures().statistics(now).to_string()
    }

    /// Lets another thread look at the program's image, and force its signals; `None` if one has been given out already. As
    /// long as it asks for nothing, a scan pays for a look at one word.
    pub fn watch(&self) -> Option<Watch> {
        let mut watch = self.0.watch.lock().unwrap_or_else(PoisonError::into_inner);
        watch.take()
    }

    /// The injected faults of this end.
    pub fn injected_faults(&self) -> Vec<FaultStatus> {
        self.0.board.list()
    }

    /// The number of scans so far, and of those with stale data.
    pub fn scans(&self) -> (u64, u64) {
        self.0.counters.scan_counters.scans()
    }

    /// Why the program is no longer scanned, if so: it panicked, or a scan does not end.
    pub fn fault(&self) -> Option<String> {
        self.0.counters.fault()
    }

    /// Whether the program is scanned no more: the run of its bus has come to its end, or there is a
    /// [`fault`](Self::fault).
    pub fn is_over(&self) -> bool {
        self.0.is_over()
    }

    /// Whether the line has failed, and has never come up.
    pub fn has_only_failed(&self) -> bool {
        self.0.status.has_only_failed()
    }

    /// What the bus has told about itself under this key of the statistics.
    pub fn fact(&self, key: &'static str) -> Option<String> {
        self.0.status.fact(key)
    }

    /// Stops scanning and closes the bus. Returns why the program did not end, if so.
    pub fn close(mut self) -> Option<String> {
        self.0.end()
    }
}
