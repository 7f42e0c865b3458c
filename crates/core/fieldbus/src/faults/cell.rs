//! The state of one fault, as the tick publishes it.

use std::fmt::{self, Write as _};
use std::sync::atomic::{AtomicI64, AtomicU8, AtomicU64, Ordering};

use super::TickTime;
use super::fault::MODEL;
use tickbus_base::os::{is_rarely_logged, is_told};
use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

/// The state of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The fault has not begun, or may begin again.
    Waiting,
    /// The fault is in effect.
    Active,
    /// The fault is over for good.
    Over,
}

impl Phase {
    const ALL: [Self; 3] = [Self::Waiting, Self::Active, Self::Over];

    /// The phase's name, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Active => "active",
            Self::Over => "over",
        }
    }
}

/// The published state of one fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaultStatus {
    /// The fault's number, from 1, in order of injection.
    pub id: u32,
    /// The fault's name.
    pub name: String,
    /// The fault's kind, as a driver.cfg names it.
    pub kind: &'static str,
    /// The fault's effect, as text.
    pub what: String,
    /// The fault's state.
    pub phase: Phase,
    /// How often the fault has begun.
    pub begun: u64,
    /// When the fault last began or ended, as time since the first tick.
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
    /// The value that a ramp has reached.
    value: AtomicU64,
    /// The number of beginnings and ends so far, including those of earlier faults of this name and kind; `told` is the
    /// number already logged.
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
            value: AtomicU64::new(0),
            changes: AtomicU64::new(0),
            told: AtomicU64::new(0),
        }
    }

    /// Returns true if this is another fault of the same name and kind.
    pub(super) fn is_namesake(&self, other: &Self) -> bool {
        self.name == other.name && self.kind == other.kind
    }

    /// Continues the log's count of an earlier fault of this name: a fault that is injected repeatedly does not fill
    /// the log.
    pub(super) fn follow(&self, earlier: &Self) {
        let changes = earlier.changes.load(Ordering::Acquire);
        self.changes.store(changes, Ordering::Relaxed);
        self.told.store(changes, Ordering::Relaxed);
    }

    pub(super) fn phase(&self) -> Phase {
        Phase::ALL[usize::from(self.phase.load(Ordering::Acquire)) % Phase::ALL.len()]
    }

    /// Shows the value that a ramp has reached.
    pub(super) fn show(&self, value: Slot) {
        self.value.store(value.unsigned(), Ordering::Relaxed);
    }

    /// The value that a ramp has reached.
    pub(super) fn value(&self) -> Slot {
        Slot::from_unsigned(self.value.load(Ordering::Relaxed))
    }

    /// The fault's name.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Returns true if the simulation's model has the fault.
    pub(super) fn is_of_model(&self) -> bool {
        self.kind == MODEL
    }

    /// The fault's number.
    pub(super) fn id(&self) -> u32 {
        self.id
    }

    /// How often the fault has begun.
    pub(super) fn begun(&self) -> u64 {
        self.begun.load(Ordering::Relaxed)
    }

    /// Appends name and kind, for messages.
    pub(super) fn write_title(&self, text: &mut String) {
        // Writing to a string cannot fail.
        let _ = write!(text, "\"{}\" ({})", self.name, self.kind);
    }

    /// The length of the title in bytes.
    pub(super) fn title_len(&self) -> usize {
        self.name.len() + self.kind.len() + "\"\" ()".len()
    }

    pub(super) fn enter(&self, phase: Phase, moment: TickTime) {
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

    pub(super) fn seen(&self) -> FaultStatus {
        FaultStatus {
            id: self.id,
            name: self.name.clone(),
            kind: self.kind,
            what: self.what.clone(),
            phase: self.phase(),
            begun: self.begun(),
            since: Nanos(self.since.load(Ordering::Relaxed)),
            tick: self.tick.load(Ordering::Relaxed),
        }
    }

    /// The log message about beginnings and ends since the last call.
    pub(super) fn news(&self, driver: &str) -> Option<String> {
        let changes = self.changes.load(Ordering::Acquire);
        let told = self.told.swap(changes, Ordering::Relaxed);
        // No text is made if the log would drop it: on a stepped bus this code runs within the tick.
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

/// A note that not every change is logged any more.
struct Often(u64);

impl fmt::Display for Often {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !is_rarely_logged(self.0) {
            return Ok(());
        }
        write!(
            f,
            ", begun {} times, and told more rarely from now on",
            self.0.div_ceil(2)
        )
    }
}
