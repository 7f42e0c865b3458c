//! An open driver, and the calls on it between ticks.

use std::sync::Arc;

use tickbus_base::QuickClock;
use tickbus_base::time::{Clock, Nanos};
use tickbus_fieldbus::faults::FaultBoard;
use tickbus_fieldbus::{Lead, Link, LinkStatus, MaxAge, SwallowedSignals};
use tickbus_image::signal::Slot;
use tickbus_image::{Event, TickEnd};
use tickbus_record::Recorder;

use super::bus_handle::BusHandle;
use super::extras::Extras;
use super::line::Line;
use super::recording::Recorded;
use super::shape::Shape;
use super::station::Station;
use super::statistics::{BusFacts, Figures, ProgramCounters, TickFigures};
use super::tap::Tap;
use super::tick::Tick;
use super::tick_counters::TickTimes;
use super::{Exchange, SlotMap, Snapshot, TickCounters};
use tickbus_driver_cfg::Config;

/// An open driver: one device, or one controller, on its bus.
#[derive(Debug)]
pub struct Driver {
    pub(super) config: Arc<Config>,
    pub(super) slots: SlotMap,
    pub(super) image: TickEnd,
    pub(super) stations: Vec<Station>,
    pub(super) line: BusHandle,
    pub(super) clock: Arc<dyn Clock>,
    /// The clock that the driver was opened with, which other threads wait on.
    pub(super) real: Arc<dyn Clock>,
    /// The same clock, read quickly for the tick.
    pub(super) quick: QuickClock,
    pub(super) max_age: MaxAge,
    pub(super) status: LinkStatus,
    pub(super) counters: TickCounters,
    pub(super) samples: TickTimes,
    /// The clock's time and the tick's time at the first tick.
    pub(super) first_now: Nanos,
    pub(super) first_time: Nanos,
    /// The last simulation time that the simulation gave.
    pub(super) given: Option<Nanos>,
    /// The current tick, between its halves.
    pub(super) tick: Option<Tick>,
    /// The result of the last tick.
    pub(super) last: Exchange,
    /// The extra work around every exchange; most drivers have none.
    pub(super) extras: Extras,
    /// The work of the next tick besides carrying values.
    pub(super) shape: Shape,
    pub(super) board: Arc<FaultBoard>,
    pub(super) swallowed: SwallowedSignals,
    pub(super) program_counters: ProgramCounters,
    pub(super) bus_facts: BusFacts,
    pub(super) recorder: Option<Recorder>,
    /// The ticks that the recording has so far.
    pub(super) recorded: Recorded,
    /// Lets another thread look at the driver.
    pub(super) tap: Option<Tap>,
}

impl Driver {
    /// Returns the configuration that the driver was opened with.
    pub fn config(&self) -> &Arc<Config> {
        &self.config
    }

    /// Returns the arrangement of values in the slots.
    pub fn slots(&self) -> &SlotMap {
        &self.slots
    }

    /// Returns the line, whose settings can be changed while the driver runs; `None` on a stepped bus.
    pub fn line(&self) -> Option<Line> {
        match &self.line {
            BusHandle::Free(line) => Some(line.handle()),
            BusHandle::Stepped { .. } => None,
        }
    }

    /// Returns true if the bus is stepped: a tick may then wait for the bus.
    pub fn is_stepped(&self) -> bool {
        matches!(self.line, BusHandle::Stepped { .. })
    }

    /// Returns true if the bus has ended on its own because a run on virtual time is over. Ticks then bring nothing.
    pub fn is_over(&self) -> bool {
        matches!(&self.line, BusHandle::Stepped { bus, .. } if bus.lead() == Lead::Ended)
    }

    /// Returns what the bus reported under this key of the statistics.
    pub fn fact(&self, key: &'static str) -> Option<String> {
        self.status.fact(key)
    }

    /// Returns the slots before the first exchange: every signal has its fail-safe value.
    pub fn initial_slots(&self) -> Vec<Slot> {
        self.slots.initial(&self.config.table)
    }

    /// Returns the state of the line.
    pub fn link(&self) -> Link {
        // In case the bus itself cannot check its line.
        let now = self.clock.now();
        self.status.observe(now, self.image.peers.ages(now));
        self.status.observe_call(now);
        self.status.link()
    }

    /// Returns true if the line has failed and has never come up.
    pub fn has_only_failed(&self) -> bool {
        self.status.has_only_failed()
    }

    /// Returns the counters and the state of the line, one `key=value` per line.
    pub fn statistics(&self) -> String {
        self.snapshot().to_string()
    }

    /// Copies the data for the statistics, so that the caller can format them after releasing its lock on the driver.
    pub fn snapshot(&self) -> Snapshot {
        let (now, peers) = (self.clock.now(), &self.image.peers);
        let stations = peers.ages(now).enumerate();
        let stations = stations.map(|(at, age)| (age, peers.is_valid(at), peers.received(at)));
        Snapshot {
            figures: self.figures(),
            ticks: TickFigures {
                config: Arc::clone(&self.config),
                counters: self.counters,
                stations: stations.collect(),
                events_lost: self.image.events.lost(),
                samples: self.samples.clone(),
            },
            now,
        }
    }

    /// Returns the sources of the statistics that are not in the ticks.
    pub(super) fn figures(&self) -> Figures {
        let recorder = self.recorder.as_ref();
        Figures {
            status: self.status.clone(),
            board: Arc::clone(&self.board),
            swallowed: self.swallowed.clone(),
            program: self.program_counters.clone(),
            record: recorder.map(|recorder| Arc::clone(recorder.counters())),
            bus: self.bus_facts.clone(),
        }
    }

    /// Returns the signals whose changes were swallowed between the simulation and the PLC.
    pub fn swallowed(&self) -> &SwallowedSignals {
        &self.swallowed
    }

    /// Moves the oldest events into `into`, as many as fit, and returns their number.
    pub fn poll_events(&mut self, into: &mut [Event]) -> usize {
        let mut taken = 0;
        while let Some(place) = into.get_mut(taken) {
            match self.image.events.pop() {
                Some(event) => *place = event,
                None => break,
            }
            taken += 1;
        }
        taken
    }
}
