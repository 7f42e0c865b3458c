//! What the tick and the bus tell each other about faults, and tell any other thread that asks.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::cell::Cell;
use super::{FaultStatus, LineFault, Phase, TickTime};
use tickbus_base::statistics::Statistics;

/// What the tick, the bus and other threads share about a driver's faults.
#[derive(Debug, Default)]
pub struct FaultBoard {
    /// Incremented by every change; zero as long as there has never been a fault.
    news: AtomicU64,
    cells: Mutex<Vec<Arc<Cell>>>,
    /// Line faults on their way to the bus.
    mailbox: Mutex<Vec<LineFault>>,
    /// Beginnings of faults that are no longer on the list.
    forgotten: AtomicU64,
    pub(super) dropped: AtomicU64,
    pub(super) duplicated: AtomicU64,
    pub(super) hurried: AtomicU64,
}

impl FaultBoard {
    /// A number that every change increments; zero as long as there has never been a fault.
    #[inline]
    pub fn news(&self) -> u64 {
        self.news.load(Ordering::Acquire)
    }

    pub(super) fn add(&self, cell: Arc<Cell>, line: Option<LineFault>) {
        self.cells().push(cell);
        self.mailbox().extend(line);
        self.news.fetch_add(1, Ordering::Release);
    }

    /// Removes the oldest fault that is over from the list; tells whether there was one.
    pub(super) fn forget_one(&self) -> Option<u32> {
        let mut cells = self.cells();
        let found = cells.iter().position(|cell| cell.phase() == Phase::Over)?;
        let cell = cells.remove(found);
        let begun = cell.begun();
        self.forgotten.fetch_add(begun, Ordering::Relaxed);
        Some(cell.id())
    }

    pub(super) fn enter(&self, cell: &Cell, phase: Phase, moment: TickTime) {
        cell.enter(phase, moment);
        self.news.fetch_add(1, Ordering::Release);
    }

    /// Takes the line faults that the bus has not adopted yet.
    pub fn take_line_faults(&self) -> Vec<LineFault> {
        std::mem::take(&mut *self.mailbox())
    }

    /// Writes to the log what has begun and ended since the last time.
    pub fn tell(&self, driver: &str) {
        // Logged after the lock is released: no thread may wait for a slow reader of the log.
        let news: Vec<String> = self
            .cells()
            .iter()
            .filter_map(|cell| cell.news(driver))
            .collect();
        for line in news {
            log::warn!("{line}");
        }
    }

    /// All faults in order of injection; those that ended long ago may be missing.
    pub fn list(&self) -> Vec<FaultStatus> {
        self.cells().iter().map(|cell| cell.seen()).collect()
    }

    /// Adds the state of all faults; nothing if there was never a fault.
    pub fn write(&self, statistics: &mut Statistics) {
        if self.news() == 0 {
            return;
        }
        let faults = self.list();
        let active = faults.iter().filter(|fault| fault.phase == Phase::Active);
        let active: Vec<&str> = active.map(|fault| fault.name.as_str()).collect();
        let begun: u64 = faults.iter().map(|fault| fault.begun).sum();
        let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
        statistics.text("fault.active", &active.join(", "));
        statistics.count("fault.begun", begun + count(&self.forgotten));
        statistics.count("fault.dropped", count(&self.dropped));
        statistics.count("fault.duplicated", count(&self.duplicated));
        statistics.count("fault.hurried", count(&self.hurried));
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

    fn mailbox(&self) -> MutexGuard<'_, Vec<LineFault>> {
        self.mailbox.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
