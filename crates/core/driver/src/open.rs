//! Opens and closes a driver.

use std::sync::Arc;

use tickbus_axis::Reflexes;
use tickbus_base::QuickClock;
use tickbus_base::time::{Clock, Manual, Nanos};
use tickbus_fieldbus::faults::FaultBoard;
use tickbus_fieldbus::{Cause, Events, LinkState, LinkStatus, Port, Role, Steps, SwallowedSignals};
use tickbus_image::{BusEnd, EVENT_CAPACITY, TickEnd, image_counting};
use tickbus_reply::Replies;

use super::bus;
use super::bus_handle::{BusHandle, OpenBus};
use super::extras::Extras;
use super::frames::directions;
use super::heartbeat::Beat;
use super::host::OtherEnd;
use super::line::{self, Ends, FreeLine, Opened, Owner};
use super::real_time;
use super::recording::{Recorded, recorder};
use super::shape::Shape;
use super::station::Station;
use super::statistics::{BusFacts, Counters, ProgramCounters};
use super::tick_counters::TickTimes;
use super::{Driver, DriverError, Exchange, SlotMap, TickCounters};
use tickbus_driver_cfg::Config;

impl Driver {
    /// Opens the driver that `config` describes. A free bus starts on its own thread and keeps trying until it reaches
    /// its peer; opening does not wait for that.
    ///
    /// # Errors
    ///
    /// See [`DriverError`].
    pub fn open(mut config: Config, clock: Arc<dyn Clock>) -> Result<Self, DriverError> {
        real_time::check(&config, &*clock)?;
        let areas = config.role.areas();
        let swallowed = swallowed_of(&config, &config.name);
        let (tick, bus_end) = image_of(&config, &swallowed);
        let names = config.table.stations.iter();
        let names = names.map(|station| station.name.clone()).collect();
        let status = LinkStatus::of_stations(&config.name, config.timing.max_age, names);
        let (bus, program) = bus::open(&config, &clock, None, &swallowed)?;
        let slots = SlotMap::new(&config.table, config.role);
        // On a stepped bus the tick may wait for the recorder, so that none of its ticks is dropped.
        let recorder = recorder(
            &config,
            &slots,
            Some(areas.0),
            matches!(bus, OpenBus::Stepped(_)),
            &clock,
        )?;
        let simulation_time = Manual::new();
        let real = Arc::clone(&clock);
        let clock = match &bus {
            OpenBus::Free(_) => clock,
            OpenBus::Stepped(_) => Arc::clone(&simulation_time) as _,
        };
        // Before the bus starts: setting up this clock takes time, in which the bus would find no tick.
        let quick = QuickClock::new(Arc::clone(&clock));
        let board = Arc::<FaultBoard>::default();
        // A reset finds the files again though the working folder has changed. Mistakes have named the path as given.
        if let Ok(path) = std::path::absolute(&config.path) {
            config.path = path;
        }
        let config = Arc::new(config);
        let times = (&clock, &simulation_time);
        let program_counters = ProgramCounters::new(counters_of(program.as_ref()));
        let line = (&status, &board, &swallowed);
        let opened = (bus, program);
        let bus_facts = BusFacts::of(&config);
        let counters = (&program_counters, &bus_facts);
        let line = start(&config, opened, bus_end, times, line, counters)?;
        let stations = (0..config.table.stations.len())
            .map(|index| Station::new(&config.table, index, areas))
            .collect();
        let mut driver = Self {
            slots,
            recorder,
            image: tick,
            stations,
            line,
            quick,
            clock,
            max_age: status.limit(),
            real,
            status,
            counters: TickCounters::default(),
            samples: TickTimes::default(),
            first_now: Nanos::ZERO,
            first_time: Nanos::ZERO,
            given: None,
            tick: None,
            last: Exchange::NONE,
            extras: extras(&config, &board),
            shape: Shape::Extended,
            board,
            swallowed,
            program_counters,
            bus_facts,
            recorded: Recorded::default(),
            tap: None,
            config,
        };
        driver.inject_configured()?;
        driver.shape = driver.fitting_shape();
        Ok(driver)
    }

    /// Injects the faults of the configuration.
    pub(super) fn inject_configured(&mut self) -> Result<(), DriverError> {
        let config = Arc::clone(&self.config);
        let mut faults = config.faults.iter();
        faults.try_for_each(|fault| {
            let injected = self.inject_unchecked(fault);
            injected.map(drop).map_err(DriverError::Fault)
        })
    }

    /// Closes the driver: leaves the peer with the fail-safe values if `at_close` asks for that, stops the threads and
    /// waits until they have ended. Logs the last statistics. An unfinished tick is recorded only if
    /// [`end_tick`](Self::end_tick) has ended it.
    pub fn close(self) {
        self.board.tell(self.status.driver());
        self.swallowed.log();
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

/// Creates the two ends of the image.
pub(super) fn image_of(config: &Config, swallowed: &SwallowedSignals) -> (TickEnd, BusEnd) {
    let events = match config.events {
        Events::None => 0,
        _ => EVENT_CAPACITY,
    };
    let streams = directions(&config.table, config.role);
    image_counting(streams, events, swallowed.counts())
}

/// Creates the counters of swallowed changes at this end of a line, which is called `name` in the log.
pub(super) fn swallowed_of(config: &Config, name: &str) -> SwallowedSignals {
    let cycles = Steps {
        name: "bus cycles",
        span: config.timing.cycle.or(config.bus.cycle()),
    };
    let own = match config.role {
        Role::Device | Role::Observer => "ticks",
        Role::Controller => "scans",
    };
    let own = Steps {
        name: own,
        span: None,
    };
    SwallowedSignals::new(name, &config.table, config.role, [cycles, own])
}

/// Starts a bus on its own thread, or prepares it for the tick, which advances `time`; `clock` is the clock of the line,
/// and `counters` are those of a program at the other end.
pub(super) fn start(
    config: &Arc<Config>,
    (bus, program): (OpenBus, Option<OtherEnd>),
    image: BusEnd,
    (clock, time): (&Arc<dyn Clock>, &Arc<Manual>),
    (status, board, swallowed): (&LinkStatus, &Arc<FaultBoard>, &SwallowedSignals),
    (counters, bus_facts): (&ProgramCounters, &BusFacts),
) -> Result<BusHandle, DriverError> {
    let (role, watchdog) = (config.role, config.timing.watchdog);
    let port = Port::new(image, Arc::clone(clock), role, watchdog, status.clone())
        .with_faults(Arc::clone(board))
        .with_swallowed(swallowed.clone());
    let ends = Ends {
        name: config.name.clone(),
        clock: Arc::clone(clock),
        status: status.clone(),
        bus_facts: bus_facts.clone(),
        reports_events: true,
    };
    Ok(match bus {
        OpenBus::Free(bus) => {
            let other = (boxed(program), swallowed.clone());
            let owner = Box::new(Ticks(counters.clone()));
            BusHandle::Free(FreeLine::start(config, (bus, port), other, (ends, owner))?)
        }
        OpenBus::Stepped(bus) => BusHandle::Stepped {
            bus,
            port: ends.equipped(port, config),
            time: Arc::clone(time),
        },
    })
}

/// The ticks of a simulation, as the owner of a line. The counters are those of a program at the other end.
struct Ticks(ProgramCounters);

impl Owner for Ticks {
    fn open(
        &self,
        config: &Config,
        clock: &Arc<dyn Clock>,
        swallowed: &SwallowedSignals,
    ) -> Result<Opened, DriverError> {
        let (bus, program) = bus::open(config, clock, None, swallowed)?;
        let OpenBus::Free(bus) = bus else {
            return Ok(Opened {
                bus: None,
                other_end: None,
            });
        };
        self.0.replace(counters_of(program.as_ref()));
        Ok(Opened {
            bus: Some(bus),
            other_end: boxed(program),
        })
    }

    fn take(&self, config: &Config) -> Option<Nanos> {
        config.timing.watchdog
    }
}

fn boxed(program: Option<OtherEnd>) -> line::OtherEnd {
    program.map(|program| Box::new(program) as _)
}

/// Creates the extra work of a driver without faults.
pub(super) fn extras(config: &Config, board: &Arc<FaultBoard>) -> Extras {
    // Reflexes and replies belong to the machine: a PLC has its own.
    let (reflexes, replies) = match config.role {
        Role::Device => (
            Reflexes::new(&config.axes),
            Replies::new(&config.replies, &config.table, board),
        ),
        Role::Controller | Role::Observer => (None, None),
    };
    Extras::new(reflexes, replies, Beat::all(config, config.role))
}

/// Returns the counters of the program at the other end.
pub(super) fn counters_of(program: Option<&OtherEnd>) -> Option<Arc<dyn Counters>> {
    program.map(|end| Arc::clone(&end.counters))
}
