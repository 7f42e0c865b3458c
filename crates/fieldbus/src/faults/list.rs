//! All faults of one end, tick by tick.

use std::sync::Arc;

use super::cell::Cell;
use super::random::Random;
use super::schedule::{Schedule, Step};
use super::signal_fault::SignalFault;
use super::{Effect, Fault, FaultBoard, LIMIT, LineFault, Phase, TickTime};
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Area, SignalTable, Slot};

/// How the values of one end are arranged: slots in the order of the signal table, then those that count
/// edges.
#[derive(Clone, Copy, Debug)]
pub struct Slots<'a> {
    /// The signals.
    pub table: &'a SignalTable,
    /// The area that this end writes.
    pub writes: Area,
    /// Per signal, the slot that counts its edges, if any. May be shorter than the table.
    pub edges: &'a [Option<usize>],
}

/// The faults of one end. Its tick calls [`begin_tick`](Self::begin_tick), [`sending`](Self::sending), sends,
/// calls [`sent`](Self::sent), receives, and calls [`received`](Self::received). If the simulation answers
/// within its tick, receiving comes first.
#[derive(Debug)]
pub struct Faults {
    entries: Vec<Entry>,
    board: Arc<FaultBoard>,
    /// How long the simulation has run, and its time at the last tick.
    time: Nanos,
    given: Nanos,
}

/// A fault that is on the board and that no tick knows yet: made by any thread, so that the tick which
/// [adopts](Faults::adopt) it need not allocate memory.
#[derive(Debug)]
pub struct Prepared {
    entry: Entry,
    /// The number of the fault whose place it takes.
    forgotten: Option<u32>,
    board: Arc<FaultBoard>,
}

/// A fault that a tick has no more use for; dropping it frees memory.
#[derive(Debug)]
pub struct Retired(#[expect(dead_code, reason = "kept for its drop")] Entry);

impl Prepared {
    /// Prepares a fault for the tick of the end that has this `board`.
    ///
    /// # Errors
    ///
    /// Too many faults wait or are active.
    pub fn new(fault: &Fault, slots: Slots<'_>, board: &Arc<FaultBoard>) -> Result<Self, Mistake> {
        let mut kind = Kind::Line;
        let (cell, forgotten) = board.enlist(|id| {
            let random = Random::new(fault.seed, id);
            let what = fault.what(slots.table);
            let cell = Arc::new(Cell::new(id, fault.name.clone(), fault.kind(), what));
            let line = match fault.effect {
                Effect::Signal(index, change) => {
                    let signal = &slots.table.signals[index];
                    let edges = slots.edges.get(index).copied().flatten();
                    let fault = SignalFault::new(signal, (index, edges), change, random);
                    kind = if signal.area == slots.writes {
                        Kind::Written(fault)
                    } else {
                        Kind::Read(fault)
                    };
                    None
                }
                Effect::Line(trouble) => Some(LineFault::new(trouble, Arc::clone(&cell), random)),
            };
            (cell, line)
        })?;
        Ok(Self {
            entry: Entry {
                id: cell.id(),
                schedule: Schedule::new(fault),
                cell,
                kind,
            },
            forgotten,
            board: Arc::clone(board),
        })
    }

    /// Its number.
    pub fn id(&self) -> u32 {
        self.entry.id
    }

    /// No tick will adopt it: the board has it as over.
    pub fn cancel(self) {
        self.board
            .enter(&self.entry.cell, Phase::Over, TickTime::default());
    }
}

#[derive(Debug)]
struct Entry {
    id: u32,
    schedule: Schedule,
    cell: Arc<Cell>,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// Bends a value that this end writes.
    Written(SignalFault),
    /// Bends a value that this end reads.
    Read(SignalFault),
    /// Has its effect in the bus, by way of the board.
    Line,
}

impl Faults {
    /// An empty list, which publishes its state on `board`.
    pub fn new(board: Arc<FaultBoard>) -> Self {
        Self {
            // Those that are forgotten may leave a little later than others come.
            entries: Vec::with_capacity(2 * LIMIT),
            board,
            given: Nanos::ZERO,
            time: Nanos::ZERO,
        }
    }

    /// Adds a fault and gives its number; it can begin at the next tick.
    ///
    /// # Errors
    ///
    /// Too many faults wait or are active.
    pub fn add(&mut self, fault: &Fault, slots: Slots<'_>) -> Result<u32, Mistake> {
        let prepared = Prepared::new(fault, slots, &self.board)?;
        let id = prepared.id();
        self.adopt(prepared);
        Ok(id)
    }

    /// Adds a prepared fault, which can begin at the next tick; gives the one whose place it takes, if any. Neither
    /// allocates nor frees memory.
    pub fn adopt(&mut self, prepared: Prepared) -> Option<Retired> {
        let forgotten = prepared.forgotten;
        let place = self
            .entries
            .iter()
            .position(|entry| Some(entry.id) == forgotten);
        let retired = place.map(|place| Retired(self.entries.remove(place)));
        self.entries.push(prepared.entry);
        retired
    }

    /// Whether all of its faults are over.
    pub fn is_idle(&self) -> bool {
        let mut entries = self.entries.iter();
        entries.all(|entry| entry.cell.phase() == Phase::Over)
    }

    /// Ends a fault at the next tick; false if no fault has this number.
    pub fn end(&mut self, id: u32) -> bool {
        let found = self.entries.iter_mut().find(|entry| entry.id == id);
        found.map(|entry| entry.schedule.end()).is_some()
    }

    /// Begins a tick: restores bent values, then faults begin and end.
    ///
    /// Conditions are judged on true values: what this end writes as of this tick (or the previous one, if
    /// the tick receives first), what it reads as of the previous tick.
    pub fn begin_tick(&mut self, moment: TickTime, slots: &mut [Slot]) {
        // If time jumps back, faults go on from where they were: what was to last for a second lasts for a second.
        let passed = moment.time - std::mem::replace(&mut self.given, moment.time);
        self.time += passed.max(Nanos::ZERO);
        let moment = TickTime {
            time: self.time,
            ..moment
        };
        for entry in self.entries.iter_mut().rev() {
            if let Kind::Read(fault) = &mut entry.kind {
                fault.restore(slots);
            }
        }
        for entry in &mut self.entries {
            let phase = match entry.schedule.step(moment, slots) {
                Step::Nothing => continue,
                Step::Begins => Phase::Active,
                Step::Pauses => Phase::Waiting,
                Step::Ends => Phase::Over,
            };
            if let (Phase::Active, Kind::Written(fault) | Kind::Read(fault)) =
                (phase, &mut entry.kind)
            {
                fault.begin(slots);
            }
            self.board.enter(&entry.cell, phase, moment);
        }
    }

    /// The slots are about to be sent: bends them.
    pub fn sending(&mut self, slots: &mut [Slot]) {
        for entry in &mut self.entries {
            if let (true, Kind::Written(fault)) = (entry.schedule.is_active(), &mut entry.kind) {
                fault.apply_to(slots);
            }
        }
    }

    /// The signals that are bent at this moment, by index; those that this end writes, or those that it
    /// reads.
    pub fn active(&self, written: bool) -> impl Iterator<Item = usize> {
        let active = self
            .entries
            .iter()
            .filter(|entry| entry.schedule.is_active());
        active.filter_map(move |entry| match &entry.kind {
            Kind::Written(fault) if written => Some(fault.signal()),
            Kind::Read(fault) if !written => Some(fault.signal()),
            _ => None,
        })
    }

    /// Everything is sent: restores the simulation's own values.
    pub fn sent(&mut self, slots: &mut [Slot]) {
        for entry in self.entries.iter_mut().rev() {
            if let Kind::Written(fault) = &mut entry.kind {
                fault.restore(slots);
            }
        }
    }

    /// The slots hold what was received: bends them.
    pub fn received(&mut self, slots: &mut [Slot]) {
        for entry in &mut self.entries {
            if let (true, Kind::Read(fault)) = (entry.schedule.is_active(), &mut entry.kind) {
                fault.apply_to(slots);
            }
        }
    }
}
