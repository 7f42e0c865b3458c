//! Opening a driver, and closing it.

use std::sync::Arc;

use tickbus_axis::Reflexes;
use tickbus_base::time::{Clock, Manual, Nanos};
use tickbus_fieldbus::faults::Board;
use tickbus_fieldbus::{
    Bus, Cause, ChangeEvents, Link, LinkState, LinkStatus, Port, Role, Stepped,
};
use tickbus_image::signal::Slot;
use tickbus_image::{Consumer, Event, image};
use tickbus_plc as plc;
use tickbus_record::{Columns, Recorder, RecorderError, When};

use super::bus::{self, Program};
use super::exchange::{Exchange, Tick};
use super::extras::Extras;
use super::frames::directions;
use super::heartbeat::Beat;
use super::station::Station;
use super::statistics::{Samples, Snapshot};
use super::supervise::BusThread;
use super::{Code, Counters, SlotMap};
use tickbus_driver_cfg::Config;

/// An open driver: one device, or one controller, on its bus.
#[derive(Debug)]
pub struct Driver {
    pub(super) config: Arc<Config>,
    pub(super) slots: SlotMap,
    pub(super) stations: Vec<Station>,
    pub(super) line: Line,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) max_age: Nanos,
    pub(super) status: LinkStatus,
    pub(super) counters: Counters,
    pub(super) samples: Samples,
    /// The clock's time and the tick's time at the first tick.
    pub(super) first_now: Nanos,
    pub(super) first_time: Nanos,
    /// The last simulation time given.
    pub(super) given: Option<Nanos>,
    /// The current tick, between its halves.
    pub(super) tick: Option<Tick>,
    /// The result of the last tick.
    pub(super) last: Exchange,
    /// What is done around every exchange; nothing in most drivers.
    pub(super) extras: Option<Box<Extras>>,
    pub(super) board: Arc<Board>,
    events: Consumer,
    program: Option<Program>,
    pub(super) recorder: Option<Recorder>,
}

/// How the bus runs.
pub(super) enum Line {
    /// On its own thread; dropping this ends it.
    #[expect(dead_code, reason = "kept for its drop")]
    Free(BusThread),
    /// On the tick, in simulation time.
    Stepped {
        bus: Box<dyn Stepped>,
        port: Port,
        time: Arc<Manual>,
    },
}

impl std::fmt::Debug for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Free(_) => "Free",
            Self::Stepped { .. } => "Stepped",
        })
    }
}

/// Why a driver cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum DriverError {
    /// The system refused a thread.
    #[error(
        "the system refused a thread for the bus: {0}; close other programs or raise the limit"
    )]
    Thread(#[from] std::io::Error),
    /// The hosted program does not exist, or rejects its options.
    #[error("{file}: {source}")]
    Program {
        /// The driver.cfg.
        file: String,
        /// The program's error.
        source: plc::ProgramError,
    },
    /// The recording cannot be started.
    #[error("{0}")]
    Recording(#[from] RecorderError),
    /// The program and the signal table do not fit.
    #[error("{0}")]
    Config(String),
    /// The driver.cfg is correct, but asks for something that this build or platform does not have.
    #[error("{0}")]
    Unsupported(String),
}

impl DriverError {
    /// Whether the driver.cfg must be changed, rather than the system.
    pub fn is_wrong_input(&self) -> bool {
        matches!(self.code(), Code::BadConfig | Code::Unsupported)
    }

    /// The status code for it.
    pub fn code(&self) -> Code {
        match self {
            Self::Thread(_) | Self::Recording(RecorderError::Thread(_)) => Code::BusFailed,
            Self::Program { .. } | Self::Config(_) | Self::Recording(RecorderError::File(_)) => {
                Code::BadConfig
            }
            Self::Unsupported(_) => Code::Unsupported,
        }
    }
}

impl Driver {
    /// Opens the driver that `config` describes. A free bus starts on its own thread and keeps trying until
    /// its peer is there; opening does not wait for that.
    ///
    /// # Errors
    ///
    /// The hosted program and the signal table do not fit, or the system refused a thread.
    pub fn open(config: Config, clock: Arc<dyn Clock>) -> Result<Self, DriverError> {
        let (tx, rx) = config.role.areas();
        let directions = directions(&config.table, config.role);
        let (tick, bus_end) = image(directions);
        let names = config.table.stations.iter();
        let names = names.map(|station| station.name.clone()).collect();
        let status = LinkStatus::of_stations(&config.name, config.timing.max_age, names);
        let (bus, program) = bus::open(&config, &clock)?;
        let slots = SlotMap::new(&config.table, config.role);
        // On a stepped bus the tick may wait for the recorder, so that none of its ticks is dropped.
        let recorder = recorder(&config, &slots, matches!(bus, Bus::Stepped(_)))?;
        let simulation_time = Manual::new();
        let clock = match &bus {
            Bus::Free(_) => clock,
            Bus::Stepped(_) => Arc::clone(&simulation_time) as _,
        };
        let watchdog = config.timing.watchdog;
        let mut port = Port::new(
            bus_end,
            Arc::clone(&clock),
            config.role,
            watchdog,
            status.clone(),
        );
        let board = Arc::<Board>::default();
        port.suffer_from(Arc::clone(&board));
        let (signs, max_age) = (&config.life_signs, config.timing.max_age);
        port.watch_life(signs.watches(&config.table, config.role, max_age));
        port.name_stations(config.table.stations.iter().map(|s| s.name.as_str()));
        if config.bus.events() {
            let stations = 0..config.table.stations.len();
            port.watch_changes(
                stations
                    .map(|station| ChangeEvents::new(&config.table, station, rx))
                    .collect(),
            );
        }
        let line = match bus {
            Bus::Free(bus) => {
                let reconnect = config.timing.reconnect.clone();
                Line::Free(BusThread::start(
                    bus,
                    port,
                    reconnect,
                    status.clone(),
                    &config.name,
                )?)
            }
            Bus::Stepped(bus) => Line::Stepped {
                bus,
                port,
                time: simulation_time,
            },
        };
        let stations = tick.stations.into_iter().enumerate();
        let stations = stations
            .map(|(index, tick)| Station::new(tick, &config.table, index, (tx, rx)))
            .collect();
        // They are the machine's: a PLC has its own.
        let reflexes = match config.role {
            Role::Device => Reflexes::new(&config.axes),
            Role::Controller => None,
        };
        let list = config.faults.clone();
        let mut driver = Self {
            slots,
            recorder,
            stations,
            line,
            clock,
            max_age: config.timing.max_age,
            status,
            counters: Counters::default(),
            samples: Samples::default(),
            first_now: Nanos::ZERO,
            first_time: Nanos::ZERO,
            given: None,
            tick: None,
            last: Exchange::NONE,
            extras: Extras::new(reflexes, Beat::all(&config, config.role)),
            board,
            events: tick.events,
            program,
            config: Arc::new(config),
        };
        for fault in &list {
            driver.inject(fault).map_err(DriverError::Config)?;
        }
        Ok(driver)
    }

    /// What the driver was opened with.
    pub fn config(&self) -> &Arc<Config> {
        &self.config
    }

    /// The arrangement of values in the slots.
    pub fn slots(&self) -> &SlotMap {
        &self.slots
    }

    /// The slots before the first exchange: every signal at its fail-safe value.
    pub fn initial_slots(&self) -> Vec<Slot> {
        let mut slots = vec![Slot::default(); self.slots.count];
        for (slot, signal) in slots.iter_mut().zip(&self.config.table.signals) {
            *slot = signal.fail_safe;
        }
        slots
    }

    /// The state of the line.
    pub fn link(&self) -> Link {
        self.observe();
        self.status.link()
    }

    /// The counters and the state of the line, one `key=value` per line.
    pub fn statistics(&self) -> String {
        self.snapshot().to_string()
    }

    /// A copy of the data for the statistics, to be formatted when the driver is no longer locked.
    pub fn snapshot(&self) -> Snapshot {
        let now = self.clock.now();
        let stations = self.stations.iter();
        Snapshot {
            config: Arc::clone(&self.config),
            counters: self.counters,
            stations: stations
                .map(|station| (station.peer_age(now), station.is_valid(), station.cycles()))
                .collect(),
            events_lost: self.events.lost(),
            now,
            samples: self.samples.clone(),
            status: self.status.clone(),
            board: Arc::clone(&self.board),
            program: self.program.as_ref().map(Program::tally),
            record: self
                .recorder
                .as_ref()
                .map(|recorder| Arc::clone(recorder.tally())),
        }
    }

    /// Checks the line from outside, in case the bus cannot.
    fn observe(&self) {
        let now = self.clock.now();
        let ages = self.stations.iter().map(|station| station.peer_age(now));
        self.status.observe(now, ages);
        self.status.observe_call(now);
    }

    /// Takes the oldest events, as many as fit into `into`; returns their number.
    pub fn poll_events(&mut self, into: &mut [Event]) -> usize {
        let mut taken = 0;
        while let Some(place) = into.get_mut(taken) {
            match self.events.pop() {
                Some(event) => *place = event,
                None => break,
            }
            taken += 1;
        }
        taken
    }

    /// Closes the driver: stops its threads and waits for them to end. Logs its last statistics. A tick that
    /// has begun is recorded only if [`end_tick`](Self::end_tick) has ended it.
    pub fn close(self) {
        self.board.tell(self.status.driver());
        if log::log_enabled!(log::Level::Info) {
            let statistics = self.statistics().replace('\n', " ");
            log::info!("driver \"{}\" closes: {statistics}", self.config.name);
        }
        let (status, clock) = (self.status.clone(), Arc::clone(&self.clock));
        drop(self);
        let now = clock.now();
        status.enter(now, LinkState::Closed, Cause::Closed, "closed");
    }
}

/// Starts the recording that `config` asks for.
pub(super) fn recorder(
    config: &Config,
    slots: &SlotMap,
    lossless: bool,
) -> Result<Option<Recorder>, DriverError> {
    let wanted = config.record.as_ref();
    let Some(options) = wanted.filter(|options| options.when == When::Always) else {
        return Ok(None);
    };
    let columns = Columns::new(
        &config.name,
        config.role.name(),
        &config.table,
        &slots.edges,
    );
    let recorder = Recorder::start(options, config.folder(), columns, lossless)?;
    Ok(Some(recorder))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_refuses_is_not_told_as_wrong_input() {
        let refused = || std::io::Error::from(std::io::ErrorKind::WouldBlock);
        let error = DriverError::from(RecorderError::Thread(refused()));
        assert!(!error.is_wrong_input(), "{error}");
        assert_eq!(error.code(), Code::BusFailed);
        let error = DriverError::from(RecorderError::File("run.csv: no".to_owned()));
        assert_eq!(error.code(), Code::BadConfig);
    }
}
