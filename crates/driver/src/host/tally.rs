//! The counters of a hosted program.

use std::fmt::Write as _;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tickbus_base::time::{Nanos, Spans};
use tickbus_image::signal::{Area, DataType, SignalTable};

/// What the hosted program has seen and sent, to be compared with the other end.
#[derive(Debug)]
pub(crate) struct Tally {
    scans: AtomicU64,
    /// Scans with stale data.
    stale: AtomicU64,
    /// Age of the data in the scans.
    age: Mutex<Spans>,
    bits: Box<[Bit]>,
}

#[derive(Debug)]
struct Bit {
    name: String,
    station: usize,
    area: Area,
    byte: usize,
    mask: u8,
    rises: AtomicU64,
}

impl Tally {
    pub(super) fn new(table: &SignalTable) -> Self {
        let signals = table
            .signals
            .iter()
            .filter(|signal| signal.data_type == DataType::Bool);
        let bits = signals.map(|signal| Bit {
            name: signal.name.clone(),
            station: signal.station,
            area: signal.area,
            byte: signal.byte,
            mask: 1 << signal.bit,
            rises: AtomicU64::new(0),
        });
        Self {
            scans: AtomicU64::new(0),
            stale: AtomicU64::new(0),
            age: Mutex::new(Spans::new()),
            bits: bits.collect(),
        }
    }

    /// Counts the rising edges from `before` to `now` in an area of a station.
    pub(super) fn count(&self, (station, area): (usize, Area), before: &[u8], now: &[u8]) {
        // Most scans change nothing.
        if before == now {
            return;
        }
        let here = |bit: &&Bit| (bit.station, bit.area) == (station, area);
        for bit in self.bits.iter().filter(here) {
            if !before[bit.byte] & now[bit.byte] & bit.mask != 0 {
                bit.rises.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// Records a scan whose data were of `age`.
    pub(super) fn scanned(&self, age: Nanos, alive: bool) {
        self.scans.fetch_add(1, Ordering::Relaxed);
        if alive {
            self.lock_age().record(age);
        } else {
            self.stale.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn lock_age(&self) -> MutexGuard<'_, Spans> {
        // A histogram is consistent after every change, so a poisoned lock is safe to use.
        self.age.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The number of scans so far, and of those with stale data.
    pub(super) fn scans(&self) -> (u64, u64) {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        (count(&self.scans), count(&self.stale))
    }

    /// Appends one `plc.` line per count.
    pub(crate) fn write(&self, text: &mut String) {
        let _ = writeln!(text, "plc.scans={}", self.scans.load(Ordering::Relaxed));
        let _ = writeln!(text, "plc.stale={}", self.stale.load(Ordering::Relaxed));
        self.lock_age().write("plc.age", text);
        for bit in &self.bits {
            let _ = writeln!(
                text,
                "plc.rises.{}={}",
                bit.name,
                bit.rises.load(Ordering::Relaxed)
            );
        }
    }
}
