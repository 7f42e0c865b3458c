//! The board by which the tick, the bus and other threads share the state of faults.

use std::collections::HashSet;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::cell::Cell;
use super::models::undeclared;
use super::notes::{Note, Notes};
use super::{FaultStatus, LIMIT, LineFault, Phase, TickTime};
use tickbus_base::Mistake;
use tickbus_base::statistics::Statistics;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::Slot;

/// The state of a driver's faults, shared by the tick, the bus and other threads.
#[derive(Debug, Default)]
pub struct FaultBoard {
    /// Incremented by every change; zero until the first fault or note.
    news: AtomicU64,
    cells: Mutex<Vec<Arc<Cell>>>,
    /// The number of the fault that was injected last.
    last: AtomicU32,
    /// That number when the simulation last restarted.
    base: AtomicU32,
    /// Line faults on their way to the bus.
    mailbox: Mutex<Vec<LineFault>>,
    /// The faults that the simulation's model has declared.
    declared: Mutex<Arc<[String]>>,
    /// The notes of the tick about the replies of the machine.
    notes: Notes,
    /// The number of beginnings of faults that are no longer on the list.
    forgotten: AtomicU64,
    pub(super) dropped: AtomicU64,
    pub(super) duplicated: AtomicU64,
    pub(super) hurried: AtomicU64,
    pub(super) spoilt: AtomicU64,
}

impl FaultBoard {
    /// A number that every change increments; zero until the first fault or note.
    #[inline]
    pub fn news(&self) -> u64 {
        self.news.load(Ordering::Acquire)
    }

    /// Calls `make` with the number of a new fault, and with that number counted from the last restart, which says
    /// what the fault draws; adds the resulting cell. Returns the cell and, if the list was full, the number of the
    /// oldest fault that is over, which is no longer on the list.
    ///
    /// # Errors
    ///
    /// Too many faults wait or are active.
    pub(super) fn enlist(
        &self,
        make: impl FnOnce(u32, u32) -> (Arc<Cell>, Option<LineFault>),
    ) -> Result<(Arc<Cell>, Option<u32>), Mistake> {
        let mut cells = self.cells();
        let over = if cells.len() < LIMIT {
            None
        } else {
            let over = cells.iter().position(|cell| cell.phase() == Phase::Over);
            let over = over.ok_or_else(|| {
                Mistake::new(
                    format!("{LIMIT} faults wait or are active, and that is the most"),
                    "end some of them",
                )
            })?;
            let over = cells.remove(over);
            self.forgotten.fetch_add(over.begun(), Ordering::Relaxed);
            Some(over)
        };
        let id = self.last.fetch_add(1, Ordering::Relaxed) + 1;
        let (cell, line) = make(id, id - self.base.load(Ordering::Relaxed));
        let mut earlier = over.iter().chain(&*cells).rev();
        if let Some(earlier) = earlier.find(|earlier| cell.is_namesake(earlier)) {
            cell.follow(earlier);
        }
        cells.push(Arc::clone(&cell));
        drop(cells);
        self.mailbox().extend(line);
        self.news.fetch_add(1, Ordering::Release);
        Ok((cell, over.map(|over| over.id())))
    }

    /// The number of faults that can be added now.
    pub fn room(&self) -> usize {
        let cells = self.cells();
        let taken = cells.iter().filter(|cell| cell.phase() != Phase::Over);
        LIMIT.saturating_sub(taken.count())
    }

    /// The simulation restarts: its next fault draws what its first one did.
    pub(super) fn restart(&self) {
        // No fault may get its number meanwhile.
        let _cells = self.cells();
        let last = self.last.load(Ordering::Relaxed);
        self.base.store(last, Ordering::Relaxed);
    }

    pub(super) fn enter(&self, cell: &Cell, phase: Phase, moment: TickTime) {
        cell.enter(phase, moment);
        self.news.fetch_add(1, Ordering::Release);
    }

    /// The value that the ramp with this number has reached; `None` if it has not begun, or is no longer on the list.
    pub fn ramp_value(&self, id: u32) -> Option<Slot> {
        let cells = self.cells();
        let cell = cells.iter().find(|cell| cell.id() == id)?;
        (cell.begun() > 0).then(|| cell.value())
    }

    /// Takes the line faults that the bus has not adopted yet.
    pub fn take_line_faults(&self) -> Vec<LineFault> {
        std::mem::take(&mut *self.mailbox())
    }

    /// Logs the faults that have begun or ended since the last call, and the notes that were marked.
    pub fn tell(&self, driver: &str) {
        // The messages are logged after the lock is released, so that no thread waits for a slow reader of the log.
        let cells = self.cells();
        let news = cells.iter().filter_map(|cell| {
            let news = cell.news(driver)?;
            let unknown = cell
                .is_of_model()
                .then(|| self.check_model_fault(cell.name()));
            Some(match unknown {
                Some(Err(unknown)) => format!("{news}, which changes nothing: {unknown}"),
                _ => news,
            })
        });
        let mut news: Vec<String> = news.collect();
        drop(cells);
        news.extend(self.notes.news(driver));
        for line in news {
            log::warn!("{line}");
        }
    }

    /// Takes the number of replies, and the notes about them that a tick can mark.
    pub fn prepare_notes(&self, replies: usize, notes: Vec<Note>) {
        self.notes.prepare(replies, notes);
    }

    /// Marks the note at `place`, which is logged once.
    pub fn mark(&self, place: usize) {
        if self.notes.mark(place) {
            self.news.fetch_add(1, Ordering::Release);
        }
    }

    /// The faults that the simulation's model has declared, in its order.
    pub fn model_faults(&self) -> Arc<[String]> {
        Arc::clone(&self.declared())
    }

    /// Checks the name of a fault of the simulation's model.
    ///
    /// # Errors
    ///
    /// The model has not declared it; with the nearest name.
    pub fn check_model_fault(&self, name: &str) -> Result<(), Mistake> {
        let declared = self.model_faults();
        if declared.iter().any(|known| known == name) {
            return Ok(());
        }
        Err(undeclared(name, &declared))
    }

    /// Takes the names of the faults that the simulation's model can have.
    ///
    /// # Errors
    ///
    /// A name is not usable or there twice, or a fault that is not over has another name. Then the names are not taken.
    pub(super) fn declare(&self, names: Vec<String>) -> Result<Arc<[String]>, Mistake> {
        let mut seen = HashSet::new();
        for name in &names {
            let is_usable = !name.is_empty() && !name.chars().any(char::is_control);
            if !is_usable || !seen.insert(name) {
                return Err(Mistake::new(
                    format!("a fault of the model cannot be called \"{}\"", shown(name)),
                    "give each a name of its own, without control characters",
                ));
            }
        }
        let is_unknown = |cell: &&Arc<Cell>| {
            cell.is_of_model()
                && cell.phase() != Phase::Over
                && !names.iter().any(|name| name == cell.name())
        };
        if let Some(unknown) = self.cells().iter().find(is_unknown) {
            return Err(undeclared(unknown.name(), &names));
        }
        let names: Arc<[String]> = names.into();
        *self.declared() = Arc::clone(&names);
        Ok(names)
    }

    /// All faults in order of injection; faults that ended long ago may be missing.
    pub fn list(&self) -> Vec<FaultStatus> {
        self.cells().iter().map(|cell| cell.seen()).collect()
    }

    /// Adds the state of all faults; adds nothing if there was never a fault.
    pub fn write(&self, statistics: &mut Statistics) {
        self.notes.write(statistics);
        let faults = self.list();
        if faults.is_empty() {
            return;
        }
        let active = faults.iter().filter(|fault| fault.phase == Phase::Active);
        let active: Vec<&str> = active.map(|fault| fault.name.as_str()).collect();
        let begun: u64 = faults.iter().map(|fault| fault.begun).sum();
        let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
        statistics.text("fault.active", &active.join(", "));
        statistics.count("fault.begun", begun + count(&self.forgotten));
        statistics.count("fault.dropped", count(&self.dropped));
        statistics.count("fault.duplicated", count(&self.duplicated));
        statistics.count("fault.hurried", count(&self.hurried));
        statistics.count("fault.answers", count(&self.spoilt));
        for fault in &faults {
            let key = |what: &str| format!("fault.{}.{what}", fault.id);
            statistics.text(key("name"), &fault.name);
            statistics.text(key("kind"), fault.kind);
            statistics.text(key("what"), &fault.what);
            statistics.text(key("state"), fault.phase.name());
            statistics.count(key("begun"), fault.begun);
            if fault.tick > 0 {
                statistics.time(key("since"), fault.since);
                statistics.count(key("tick"), fault.tick);
            }
        }
    }

    fn cells(&self) -> MutexGuard<'_, Vec<Arc<Cell>>> {
        // The list is consistent after every single change, so a poisoned lock is safe to use.
        self.cells.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn declared(&self) -> MutexGuard<'_, Arc<[String]>> {
        self.declared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn mailbox(&self) -> MutexGuard<'_, Vec<LineFault>> {
        self.mailbox.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Nanos;
    use tickbus_test_log as logged;

    #[test]
    fn a_fault_that_is_injected_again_and_again_does_not_fill_the_log() {
        let _logged = logged::Watch::over("tickbus_fieldbus");
        logged::expect("injected fault \"again\"");
        let board = FaultBoard::default();
        for round in 1..=5_000 {
            let make = |id, _| {
                let (name, what) = ("again".to_owned(), String::new());
                (Arc::new(Cell::new(id, name, "stuck", what)), None)
            };
            let (cell, _) = board.enlist(make).expect("the others are over");
            for phase in [Phase::Active, Phase::Over] {
                let moment = TickTime {
                    time: Nanos(round),
                    tick: 1,
                };
                board.enter(&cell, phase, moment);
                board.tell("d");
            }
            assert_eq!(cell.begun(), 1, "each counts for itself");
        }
        let told = logged::times("injected fault \"again\"");
        assert_eq!(told, 20 + 9, "twenty, and the powers of two up to 8192");
    }

    #[test]
    fn a_fault_that_no_model_has_declared_is_logged_as_one_that_changes_nothing() {
        let _logged = logged::Watch::over("tickbus_fieldbus");
        let told = "it leaks, which changes nothing: the model has no fault \"unknown leak\"; let the simulation declare";
        let ends = "injected fault \"unknown leak\" (model) ends";
        logged::expect(told);
        logged::expect(ends);
        let board = FaultBoard::default();
        let make = |id, _| {
            let (name, what) = ("unknown leak".to_owned(), "it leaks".to_owned());
            (Arc::new(Cell::new(id, name, "model", what)), None)
        };
        let (cell, _) = board.enlist(make).expect("room");
        board.enter(&cell, Phase::Active, TickTime::default());
        board.tell("d");
        assert_eq!(logged::times(told), 1);
        let refused = board.declare(vec!["known leak".to_owned()]);
        assert_eq!(
            refused.expect_err("another one waits").to_string(),
            "the model has no fault \"unknown leak\"; did you mean \"known leak\"?"
        );
        let declared = board.declare(vec!["unknown leak".to_owned()]);
        declared.expect("the name that waits");
        board.enter(&cell, Phase::Over, TickTime::default());
        board.tell("d");
        assert_eq!((logged::times(told), logged::times(ends)), (1, 1));
    }
}
