//! The tick's part in letting another thread look at a driver.

use std::sync::Arc;

use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::LinkStatus;
use tickbus_fieldbus::faults::{FaultBoard, Faults};
use tickbus_image::signal::Slot;
use tickbus_record::RecorderCounters;

use super::bus_handle::{BusHandle, SteppedBus};
use super::extras::Extras;
use super::host::{Program, ProgramCounters};
use super::statistics::Snapshot;
use super::tap::tap;
use super::tick::Tick;
use super::tick_counters::TickTimes;
use super::view::{StationView, View};
use super::watch::{Figures, Watch};
use super::watched::Watched;
use super::{Code, Driver};

/// The sources of a driver's statistics that are not in the ticks' copies.
#[derive(Debug)]
struct DriverFigures {
    config: Arc<Config>,
    status: LinkStatus,
    board: Arc<FaultBoard>,
    /// The counters of the program at the other end, and those of the recording.
    program: Option<ProgramCounters>,
    record: Option<Arc<RecorderCounters>>,
}

impl Figures for DriverFigures {
    fn statistics(&self, now: Nanos, view: &View, times: &TickTimes) -> Statistics {
        let stations = view.stations.iter();
        let snapshot = Snapshot {
            config: Arc::clone(&self.config),
            counters: view.counters,
            stations: stations
                .map(|station| (station.age, station.is_valid, station.cycles))
                .collect(),
            events_lost: view.events_lost,
            now,
            samples: times.clone(),
            status: self.status.clone(),
            board: Arc::clone(&self.board),
            program: self.program.clone(),
            record: self.record.clone(),
        };
        snapshot.gather()
    }

    fn is_driver(&self) -> bool {
        true
    }
}

impl Driver {
    /// Lets another thread look at this driver and force its signals. While the watch asks for nothing, a tick only
    /// checks one word. An earlier handle receives nothing new from now on.
    pub fn watch(&mut self) -> Watch {
        let signals = self.config.table.signals.len();
        let mut slots = self.initial_slots();
        slots.truncate(signals);
        let (tap, handle) = tap(&View::new(slots, self.stations.len()));
        let spare = Extras {
            faults: Some(Faults::new(Arc::clone(&self.board))),
            ..Extras::default()
        };
        self.watched = Some(Box::new(Watched {
            tap,
            spare: Some(Box::new(spare)),
        }));
        let recorder = self.recorder.as_ref();
        Watch {
            config: Arc::clone(&self.config),
            role: self.config.role,
            slots: self.slots.clone(),
            handle,
            status: self.status.clone(),
            board: Arc::clone(&self.board),
            clock: Arc::clone(&self.clock),
            figures: Box::new(DriverFigures {
                config: Arc::clone(&self.config),
                status: self.status.clone(),
                board: Arc::clone(&self.board),
                program: self.program.as_ref().map(Program::counters),
                record: recorder.map(|recorder| Arc::clone(recorder.counters())),
            }),
            times: TickTimes::default(),
            asked: None,
        }
    }

    /// Serves the requests at the end of a tick.
    #[cold]
    #[inline(never)]
    pub(super) fn serve_watch(&mut self, tick: Tick, code: Code, slots: &[Slot]) {
        let Some(mut watched) = self.watched.take() else {
            return;
        };
        let wanted = watched.tap.take_wanted();
        if wanted.orders() {
            self.obey(&mut watched);
        } else {
            self.put_away(&mut watched);
        }
        self.simplify();
        if wanted.values() {
            // The simulation's clock stands still during a tick, and other clocks can be read.
            let now = self.clock.now();
            watched
                .tap
                .show(|view| self.fill(view, wanted.times(), (now, tick.time), code, slots));
        }
        self.watched = Some(watched);
    }

    /// Takes over the ordered faults.
    fn obey(&mut self, watched: &mut Watched) {
        match &mut self.extras {
            None => self.extras = watched.spare.take(),
            Some(extras) if extras.faults.is_none() => {
                let spare = watched.spare.as_mut();
                extras.faults = spare.and_then(|spare| spare.faults.take());
            }
            Some(_) => {}
        }
        let extras = self.extras.as_mut();
        if let Some(faults) = extras.and_then(|extras| extras.faults.as_mut()) {
            watched.tap.obey(faults);
        }
    }

    /// Puts the extras away when all faults are over, so that the tick no longer pays for them.
    fn put_away(&mut self, watched: &mut Watched) {
        let is_idle = |extras: &Extras| {
            let faults = extras.faults.as_ref();
            faults.is_some_and(Faults::is_idle)
        };
        // Extras that were the spare ones contain only faults.
        if watched.spare.is_none() && self.extras.as_deref().is_some_and(is_idle) {
            watched.spare = self.extras.take();
        }
    }

    fn fill(
        &self,
        view: &mut View,
        with_times: bool,
        (now, time): (Nanos, Nanos),
        code: Code,
        slots: &[Slot],
    ) {
        let signals = view.slots.len();
        view.slots.copy_from_slice(&slots[..signals]);
        let stations = view.stations.iter_mut().zip(&self.stations);
        for (index, (seen, station)) in stations.enumerate() {
            *seen = StationView {
                status: station.status,
                age: self.image.peer_age(index, now),
                is_valid: self.image.is_valid(index),
                is_fail_safe: station.stale,
                cycles: self.image.received(index),
            };
            self.image
                .edges(index, |signal, count| view.edges[signal] = count);
        }
        if let BusHandle::Stepped {
            bus: SteppedBus::Replay(replay),
            ..
        } = &self.line
        {
            replay.edges(|signal, count| view.edges[signal] = count);
        }
        view.now = now;
        view.tick = self.counters.ticks;
        view.time = time;
        view.code = code;
        view.counters = self.counters;
        view.events_lost = self.image.events.lost();
        view.has_times = with_times;
        if with_times {
            view.times.copy_from(&self.samples);
        }
    }
}
