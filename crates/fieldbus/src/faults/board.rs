//! What the tick and the bus tell each other about faults, and tell any other thread that asks.

use std::fmt::{self, Write as _};
use std::sync::atomic::{AtomicI64, AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::LineFault;
use super::list::Moment;
use tickbus_base::os::{is_told, is_told_rarely};
use tickbus_base::time::Nanos;

/// The state of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// It has not begun, or may begin again.
    Waiting,
    /// It has its effect.
    Active,
    /// It is over for good.
    Over,
}

impl Phase {
    const ALL: [Self; 3] = [Self::Waiting, Self::Active, Self::Over];

    /// Its name, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Active => "active",
            Self::Over => "over",
        }
    }
}

/// One fault as others see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Injected {
    /// Its number, from 1, in order of injection.
    pub id: u32,
    /// Its name.
    pub name: String,
    /// Its kind, as a driver.cfg names it.
    pub kind: &'static str,
    /// What it does, as text.
    pub what: String,
    /// Its state.
    pub phase: Phase,
    /// How often it has begun.
    pub begun: u64,
    /// When it last began or ended, as time since the first tick.
    pub since: Nanos,
    /// The number of that tick.
    pub tick: u64,
}

/// The state of one fault; the tick writes it, any thread reads it.
#[derive(Debug)]
pub(super) struct Cell {
    id: u32,
    name: String,
    kind: &'static str,
    what: String,
    phase: AtomicU8,
    begun: AtomicU64,
    since: AtomicI64,
    tick: AtomicU64,
    /// Beginnings and ends so far, and how many of them were logged.
    changes: AtomicU64,
    told: AtomicU64,
}

impl Cell {
    pub(super) fn new(id: u32, name: String, kind: &'static str, what: String) -> Self {
        Self {
            id,
            name,
            kind,
            what,
            phase: AtomicU8::new(Phase::Waiting as u8),
            begun: AtomicU64::new(0),
            since: AtomicI64::new(0),
            tick: AtomicU64::new(0),
            changes: AtomicU64::new(0),
            told: AtomicU64::new(0),
        }
    }

    pub(super) fn phase(&self) -> Phase {
        Phase::ALL[usize::from(self.phase.load(Ordering::Acquire)) % Phase::ALL.len()]
    }

    /// Appends name and kind, for messages.
    pub(super) fn write_title(&self, text: &mut String) {
        // Writing to a string cannot fail.
        let _ = write!(text, "\"{}\" ({})", self.name, self.kind);
    }

    /// The length of that text in bytes.
    pub(super) fn title_len(&self) -> usize {
        self.name.len() + self.kind.len() + "\"\" ()".len()
    }

    fn enter(&self, phase: Phase, moment: Moment) {
        let before = self.phase();
        self.since.store(moment.time.0, Ordering::Relaxed);
        self.tick.store(moment.tick, Ordering::Relaxed);
        self.phase.store(phase as u8, Ordering::Release);
        if (before == Phase::Active) != (phase == Phase::Active) {
            self.changes.fetch_add(1, Ordering::Release);
        }
        if phase == Phase::Active {
            self.begun.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn seen(&self) -> Injected {
        Injected {
            id: self.id,
            name: self.name.clone(),
            kind: self.kind,
            what: self.what.clone(),
            phase: self.phase(),
            begun: self.begun.load(Ordering::Relaxed),
            since: Nanos(self.since.load(Ordering::Relaxed)),
            tick: self.tick.load(Ordering::Relaxed),
        }
    }

    /// The log message about what has begun or ended since the last call.
    fn news(&self, driver: &str) -> Option<String> {
        let changes = self.changes.load(Ordering::Acquire);
        let told = self.told.swap(changes, Ordering::Relaxed);
        // No text is made if the log drops it: on a stepped bus this runs within the tick.
        if told >= changes || !is_told(changes) || !log::log_enabled!(log::Level::Warn) {
            return None;
        }
        let happens = match (self.phase(), changes - told) {
            (Phase::Active, _) => "begins",
            (_, 1) => "ends",
            _ => "has begun and ended",
        };
        Some(format!(
            "driver \"{driver}\": injected fault \"{}\" ({}) {happens} at {}, tick {}{}: {}",
            self.name,
            self.kind,
            Nanos(self.since.load(Ordering::Relaxed)).rounded(),
            self.tick.load(Ordering::Relaxed),
            Often(changes),
            self.what
        ))
    }
}

/// Says that not every change is logged any more.
struct Often(u64);

impl fmt::Display for Often {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !is_told_rarely(self.0) {
            return Ok(());
        }
        write!(
            f,
            ", begun {} times, and told more rarely from now on",
            self.0.div_ceil(2)
        )
    }
}

/// What the tick, the bus and other threads share about a driver's faults.
#[derive(Debug, Default)]
pub struct Board {
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

impl Board {
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
        let begun = cell.begun.load(Ordering::Relaxed);
        self.forgotten.fetch_add(begun, Ordering::Relaxed);
        Some(cell.id)
    }

    pub(super) fn enter(&self, cell: &Cell, phase: Phase, moment: Moment) {
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
    pub fn list(&self) -> Vec<Injected> {
        self.cells().iter().map(|cell| cell.seen()).collect()
    }

    /// Appends the state of all faults, one `key=value` per line; nothing if there was never a fault.
    pub fn write(&self, text: &mut String) {
        if self.news() == 0 {
            return;
        }
        let faults = self.list();
        let active = faults.iter().filter(|fault| fault.phase == Phase::Active);
        let active: Vec<&str> = active.map(|fault| fault.name.as_str()).collect();
        let begun: u64 = faults.iter().map(|fault| fault.begun).sum();
        let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "fault.active={}", active.join(", "));
        let _ = writeln!(text, "fault.begun={}", begun + count(&self.forgotten));
        let _ = writeln!(text, "fault.dropped={}", count(&self.dropped));
        let _ = writeln!(text, "fault.duplicated={}", count(&self.duplicated));
        let _ = writeln!(text, "fault.hurried={}", count(&self.hurried));
        for fault in &faults {
            let id = fault.id;
            let _ = writeln!(text, "fault.{id}.name={}", fault.name);
            let _ = writeln!(text, "fault.{id}.kind={}", fault.kind);
            let _ = writeln!(text, "fault.{id}.what={}", fault.what);
            let _ = writeln!(text, "fault.{id}.state={}", fault.phase.name());
            let _ = writeln!(text, "fault.{id}.begun={}", fault.begun);
            if fault.tick > 0 {
                let _ = writeln!(text, "fault.{id}.since={}", fault.since);
                let _ = writeln!(text, "fault.{id}.tick={}", fault.tick);
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
