//! All faults of one end, tick by tick.

use std::sync::Arc;

use super::cell::Cell;
use super::models::Models;
use super::random::Random;
use super::schedule::{Schedule, Step};
use super::signal_fault::SignalFault;
use super::{Effect, Fault, FaultBoard, LIMIT, LineFault, Phase, TickTime};
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Area, SignalTable, Slot};

/// The arrangement of the values of one end: slots in the order of the signal table, then the slots that count edges.
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
    /// True if at least one fault of a value is active since the tick began.
    change_values: bool,
    /// The declared faults of the simulation's model.
    models: Models,
    board: Arc<FaultBoard>,
    /// How long the simulation has run, and its time at the last tick.
    time: Nanos,
    given: Nanos,
}

/// A fault that is on the board but that no tick knows yet. Any thread can make one, so that the tick that
/// [adopts](Faults::adopt) it need not allocate memory.
#[derive(Debug)]
pub struct Prepared {
    entry: Entry,
    /// The number of the fault that this one replaces.
    forgotten: Option<u32>,
    board: Arc<FaultBoard>,
}

/// A fault that a tick no longer needs; dropping it frees memory.
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
        let (cell, forgotten) = board.enlist(|id, place| {
            let random = Random::new(fault.seed, place);
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
                Effect::Model(value) => {
                    kind = Kind::Model(None, value);
                    None
                }
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

    /// The fault's number.
    pub fn id(&self) -> u32 {
        self.entry.id
    }

    /// Marks the fault as over on the board; no tick will adopt it.
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
    /// Changes a value that this end writes.
    Written(SignalFault),
    /// Changes a value that this end reads.
    Read(SignalFault),
    /// Takes effect in the bus, which reads the board.
    Line,
    /// Takes effect in the simulation's model: the place among the declared faults, if it is one of them, and the value.
    Model(Option<usize>, f64),
}

impl Entry {
    fn changes_values(&self) -> bool {
        self.schedule.is_active() && matches!(self.kind, Kind::Written(_) | Kind::Read(_))
    }

    /// Finds the fault among those that the model has declared.
    fn join(&mut self, models: &Models) {
        if let Kind::Model(place, _) = &mut self.kind {
            *place = models.position(self.cell.name());
        }
    }
}

impl Faults {
    /// An empty list, which publishes its state on `board`.
    pub fn new(board: Arc<FaultBoard>) -> Self {
        Self {
            // Forgotten faults may leave the list a little later than new ones join it.
            entries: Vec::with_capacity(2 * LIMIT),
            change_values: false,
            models: Models::default(),
            board,
            given: Nanos::ZERO,
            time: Nanos::ZERO,
        }
    }

    /// Adds a fault and returns its number; the fault can begin at the next tick.
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

    /// Adds a prepared fault, which can begin at the next tick. Returns the fault that this one replaces, if any.
    /// Neither allocates nor frees memory.
    pub fn adopt(&mut self, mut prepared: Prepared) -> Option<Retired> {
        let forgotten = prepared.forgotten;
        prepared.entry.join(&self.models);
        let place = self
            .entries
            .iter()
            .position(|entry| Some(entry.id) == forgotten);
        let retired = place.map(|place| Retired(self.entries.remove(place)));
        self.entries.push(prepared.entry);
        retired
    }

    /// Takes the names of the faults that the simulation's model can have, in place of earlier ones.
    /// [`next_model_change`](Self::next_model_change) then returns those that are on.
    ///
    /// # Errors
    ///
    /// A name is not usable or there twice, or a fault that is not over has another name. Then the names are not taken.
    pub fn declare(&mut self, names: Vec<String>) -> Result<(), Mistake> {
        let models = Models::new(self.board.declare(names)?);
        let earlier = std::mem::replace(&mut self.models, models);
        for entry in &mut self.entries {
            entry.join(&self.models);
        }
        self.note_models();
        self.models.keep_ends(&earlier);
        Ok(())
    }

    /// Returns whether [`next_model_change`](Self::next_model_change) may have one.
    #[inline]
    pub fn has_model_change(&self) -> bool {
        self.models.has_change()
    }

    /// The next fault of the model that has begun, ended or changed its value since the model was last told: its place
    /// among the declared names, and its value; `None` for a fault that is off.
    #[inline]
    pub fn next_model_change(&mut self) -> Option<(usize, Option<f64>)> {
        self.models.next_change()
    }

    /// Notes which faults of the model are on.
    fn note_models(&mut self) {
        let active = self.entries.iter().filter_map(|entry| match entry.kind {
            Kind::Model(Some(place), value) if entry.schedule.is_active() => Some((place, value)),
            _ => None,
        });
        self.models.set(active);
    }

    /// Returns true if all faults are over.
    pub fn is_idle(&self) -> bool {
        let mut entries = self.entries.iter();
        entries.all(|entry| entry.cell.phase() == Phase::Over)
    }

    /// Returns true if a fault changes values in this tick. Otherwise [`sending`](Self::sending), [`sent`](Self::sent)
    /// and [`received`](Self::received) have nothing to do.
    #[inline]
    pub const fn change_values(&self) -> bool {
        self.change_values
    }

    /// Ends a fault at the next tick; false if no fault has this number.
    pub fn end(&mut self, id: u32) -> bool {
        let found = self.entries.iter_mut().find(|entry| entry.id == id);
        found.map(|entry| entry.schedule.end()).is_some()
    }

    /// Ends all faults at once, and counts time from zero again: the simulation restarts. Further faults draw what the
    /// first ones did. Changed values are not restored.
    pub fn restart(&mut self) {
        for entry in self.entries.drain(..) {
            if entry.cell.phase() != Phase::Over {
                let moment = TickTime {
                    time: self.time,
                    ..TickTime::default()
                };
                self.board.enter(&entry.cell, Phase::Over, moment);
            }
        }
        self.change_values = false;
        self.note_models();
        self.board.restart();
        (self.time, self.given) = (Nanos::ZERO, Nanos::ZERO);
    }

    /// Begins a tick: restores changed values, then lets faults begin and end.
    ///
    /// Conditions are evaluated on true values: written ones as of this tick (or the previous one, if the tick receives
    /// first), read ones as of the previous tick.
    pub fn begin_tick(&mut self, moment: TickTime, slots: &mut [Slot]) {
        // If time jumps back, faults continue where they were: one that was to last for a second lasts for a second.
        let passed = moment.time - std::mem::replace(&mut self.given, moment.time);
        self.time += passed.max(Nanos::ZERO);
        let moment = TickTime {
            time: self.time,
            ..moment
        };
        // Only a fault that was active in the previous tick has changed anything.
        if std::mem::take(&mut self.change_values) {
            for entry in self.entries.iter_mut().rev() {
                if let Kind::Read(fault) = &mut entry.kind {
                    fault.restore(slots);
                }
            }
        }
        let mut is_model_news = false;
        for entry in &mut self.entries {
            let step = entry.schedule.step(moment, slots);
            self.change_values |= entry.changes_values();
            let phase = match step {
                Step::Nothing => continue,
                Step::Begins => Phase::Active,
                Step::Pauses => Phase::Waiting,
                Step::Ends => Phase::Over,
            };
            if let (Phase::Active, Kind::Written(fault) | Kind::Read(fault)) =
                (phase, &mut entry.kind)
            {
                fault.begin(slots, moment.time);
            }
            is_model_news |= matches!(entry.kind, Kind::Model(..));
            self.board.enter(&entry.cell, phase, moment);
        }
        if is_model_news {
            self.note_models();
        }
        if self.change_values {
            self.climb(moment.time);
        }
    }

    /// Lets the ramps take their values of this tick.
    fn climb(&mut self, time: Nanos) {
        let active = self.entries.iter_mut();
        for entry in active.filter(|entry| entry.schedule.is_active()) {
            if let Kind::Written(fault) | Kind::Read(fault) = &mut entry.kind
                && let Some(value) = fault.climb(time)
            {
                entry.cell.show(value);
            }
        }
    }

    /// Changes the slots before they are sent.
    pub fn sending(&mut self, slots: &mut [Slot]) {
        for entry in &mut self.entries {
            if let (true, Kind::Written(fault)) = (entry.schedule.is_active(), &mut entry.kind) {
                fault.apply_to(slots);
            }
        }
    }

    /// The signals that faults change at this moment, by index: those that this end writes, or those that it reads.
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

    /// Restores the simulation's own values after everything was sent.
    pub fn sent(&mut self, slots: &mut [Slot]) {
        for entry in self.entries.iter_mut().rev() {
            if let Kind::Written(fault) = &mut entry.kind {
                fault.restore(slots);
            }
        }
    }

    /// Changes the received values in the slots.
    pub fn received(&mut self, slots: &mut [Slot]) {
        for entry in &mut self.entries {
            if let (true, Kind::Read(fault)) = (entry.schedule.is_active(), &mut entry.kind) {
                fault.apply_to(slots);
            }
        }
    }
}
