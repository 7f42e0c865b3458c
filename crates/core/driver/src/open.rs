//! Opens and closes a driver.

use std::sync::Arc;

use tickbus_axis::Reflexes;
use tickbus_base::QuickClock;
use tickbus_base::time::{Clock, Manual, Nanos};
use tickbus_fieldbus::faults::FaultBoard;
use tickbus_fieldbus::{Cause, ChangeEvents, Events, LinkState, LinkStatus, Port, Role};
use tickbus_image::image;

use super::bus;
use super::bus_handle::{BusHandle, OpenBus};
use super::extras::Extras;
use super::frames::directions;
use super::heartbeat::Beat;
use super::recording::recorder;
use super::shape::Shape;
use super::station::Station;
use super::supervise::BusThread;
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
    pub fn open(config: Config, clock: Arc<dyn Clock>) -> Result<Self, DriverError> {
        let (tx, rx) = config.role.areas();
        let directions = directions(&config.table, config.role);
        let (tick, bus_end) = image(directions);
        let names = config.table.stations.iter();
        let names = names.map(|station| station.name.clone()).collect();
        let status = LinkStatus::of_stations(&config.name, config.timing.max_age, names);
        let (bus, program) = bus::open(&config, &clock, None)?;
        let slots = SlotMap::new(&config.table, config.role);
        // On a stepped bus the tick may wait for the recorder, so that none of its ticks is dropped.
        let recorder = recorder(
            &config,
            &slots,
            Some(tx),
            matches!(bus, OpenBus::Stepped(_)),
            &clock,
        )?;
        let simulation_time = Manual::new();
        let clock = match &bus {
            OpenBus::Free(_) => clock,
            OpenBus::Stepped(_) => Arc::clone(&simulation_time) as _,
        };
        // Before the bus starts: setting up this clock takes time, in which the bus would find no tick.
        let quick = QuickClock::new(Arc::clone(&clock));
        let watchdog = config.timing.watchdog;
        let board = Arc::<FaultBoard>::default();
        let (signs, max_age) = (&config.life_signs, config.timing.max_age);
        let mut port = Port::new(
            bus_end,
            Arc::clone(&clock),
            config.role,
            watchdog,
            status.clone(),
        )
        .with_faults(Arc::clone(&board))
        .with_life_signs(signs.watches(&config.table, config.role, max_age))
        .with_names(config.table.stations.iter().map(|s| s.name.as_str()));
        if config.events != Events::None {
            let stations = 0..config.table.stations.len();
            port = port.with_changes(
                stations
                    .map(|station| ChangeEvents::new(&config.table, station, rx))
                    .collect(),
            );
        }
        let line = match bus {
            OpenBus::Free(bus) => {
                let timing = &config.timing;
                let thread = BusThread::start(bus, port, timing, status.clone(), &config.name);
                BusHandle::Free(thread.map_err(|source| DriverError::no_thread("the bus", source))?)
            }
            OpenBus::Stepped(bus) => BusHandle::Stepped {
                bus,
                port,
                time: simulation_time,
            },
        };
        let stations = (0..config.table.stations.len())
            .map(|index| Station::new(&config.table, index, (tx, rx)))
            .collect();
        // Reflexes belong to the machine: a PLC has its own.
        let reflexes = match config.role {
            Role::Device => Reflexes::new(&config.axes),
            Role::Controller => None,
        };
        let list = config.faults.clone();
        let mut driver = Self {
            slots,
            recorder,
            image: tick,
            stations,
            line,
            quick,
            clock,
            max_age: config.timing.max_age,
            status,
            counters: TickCounters::default(),
            samples: TickTimes::default(),
            first_now: Nanos::ZERO,
            first_time: Nanos::ZERO,
            given: None,
            tick: None,
            last: Exchange::NONE,
            extras: Extras::new(reflexes, Beat::all(&config, config.role)),
            shape: Shape::Extended,
            board,
            program,
            tap: None,
            config: Arc::new(config),
        };
        for fault in &list {
            driver.inject(fault).map_err(DriverError::Fault)?;
        }
        driver.shape = driver.fitting_shape();
        Ok(driver)
    }

    /// Closes the driver: leaves the peer with the fail-safe values if `at_close` asks for that, stops the threads and
    /// waits until they have ended. Logs the last statistics. An unfinished tick is recorded only if
    /// [`end_tick`](Self::end_tick) has ended it.
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
