//! An open driver, and what can be asked of it between ticks.

use std::sync::Arc;

use tickbus_base::QuickClock;
use tickbus_base::time::{Clock, Nanos};
use tickbus_fieldbus::faults::FaultBoard;
use tickbus_fieldbus::{Lead, Link, LinkStatus};
use tickbus_image::signal::Slot;
use tickbus_image::{Event, TickEnd};
use tickbus_record::Recorder;

use super::bus_handle::BusHandle;
use super::extras::Extras;
use super::host::Program;
use super::station::Station;
use super::tick::Tick;
use super::tick_counters::TickTimes;
use super::watched::Watched;
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
    /// The same clock, for the tick.
    pub(super) quick: QuickClock,
    pub(super) max_age: Nanos,
    pub(super) status: LinkStatus,
    pub(super) counters: TickCounters,
    pub(super) samples: TickTimes,
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
    /// A free bus, one station, no extras and no recorder.
    pub(super) is_simple: bool,
    pub(super) board: Arc<FaultBoard>,
    pub(super) program: Option<Program>,
    pub(super) recorder: Option<Recorder>,
    /// Where another thread looks at it.
    pub(super) watched: Option<Box<Watched>>,
}

impl Driver {
    /// What the driver was opened with.
    pub fn config(&self) -> &Arc<Config> {
        &self.config
    }

    /// The arrangement of values in the slots.
    pub fn slots(&self) -> &SlotMap {
        &self.slots
    }

    /// Whether the bus is stepped: a tick may wait for it.
    pub fn is_stepped(&self) -> bool {
        matches!(self.line, BusHandle::Stepped { .. })
    }

    /// Whether the bus has come to an end of its own: a run on virtual time is over. Ticks then bring nothing.
    pub fn is_over(&self) -> bool {
        matches!(&self.line, BusHandle::Stepped { bus, .. } if bus.lead() == Lead::Ended)
    }

    /// What the bus has told about itself under this key of the statistics.
    pub fn fact(&self, key: &'static str) -> Option<String> {
        self.status.fact(key)
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

    /// Whether the line has failed, and has never come up.
    pub fn has_only_failed(&self) -> bool {
        self.status.has_only_failed()
    }

    /// The counters and the state of the line, one `key=value` per line.
    pub fn statistics(&self) -> String {
        self.snapshot().to_string()
    }

    /// A copy of the data for the statistics, to be formatted when the driver is no longer locked.
    pub fn snapshot(&self) -> Snapshot {
        let now = self.clock.now();
        Snapshot {
            config: Arc::clone(&self.config),
            counters: self.counters,
            stations: self.told(now).collect(),
            events_lost: self.image.events.lost(),
            now,
            samples: self.samples.clone(),
            status: self.status.clone(),
            board: Arc::clone(&self.board),
            program: self.program.as_ref().map(Program::counters),
            record: self
                .recorder
                .as_ref()
                .map(|recorder| Arc::clone(recorder.counters())),
        }
    }

    /// Per station, what the bus says of it: the time since its peer was heard from, whether its data are valid, and how
    /// many frames were received.
    fn told(&self, now: Nanos) -> impl Iterator<Item = (Nanos, bool, u64)> + Clone {
        let image = &self.image;
        (0..image.stations()).map(move |station| {
            (
                image.peer_age(station, now),
                image.is_valid(station),
                image.received(station),
            )
        })
    }

    /// Checks the line from outside, in case the bus cannot.
    fn observe(&self) {
        let now = self.clock.now();
        let ages = self.told(now).map(|(age, ..)| age);
        self.status.observe(now, ages);
        self.status.observe_call(now);
    }

    /// Takes the oldest events, as many as fit into `into`; returns their number.
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
