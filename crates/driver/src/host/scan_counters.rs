//! The counters of a hosted program.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tickbus_base::statistics::{Key, Statistics};
use tickbus_base::time::{Nanos, TimeHistogram};
use tickbus_image::signal::{Area, DataType, SignalTable};

/// What the hosted program has seen and sent, to be compared with the other end.
#[derive(Debug)]
pub(crate) struct ScanCounters {
    scans: AtomicU64,
    /// Scans with stale data.
    stale: AtomicU64,
    /// Age of the data in the scans.
    age: Mutex<TimeHistogram>,
    /// In the order of the signal table.
    bits: Box<[Bit]>,
    frames: Box<[Frame]>,
}

#[derive(Debug)]
struct Bit {
    name: String,
    rises: AtomicU64,
}

/// The BOOLs of one area of a station.
#[derive(Debug)]
struct Frame {
    station: usize,
    area: Area,
    bytes: Box<[Octet]>,
}

/// Bytes that are looked at one by one sooner than compared.
const FEW: usize = 8;

/// A byte that has BOOLs.
#[derive(Debug)]
struct Octet {
    byte: usize,
    mask: u8,
    /// Positions in [`ScanCounters::bits`] of its bits 0 to 7; those outside the mask have none.
    bits: [u32; 8],
}

impl Octet {
    fn none(byte: usize) -> Self {
        Self {
            byte,
            mask: 0,
            bits: [0; 8],
        }
    }
}

impl ScanCounters {
    pub(super) fn new(table: &SignalTable) -> Self {
        let mut bits = Vec::new();
        let mut frames: Vec<Frame> = Vec::new();
        let signals = table.signals.iter();
        for signal in signals.filter(|signal| signal.data_type == DataType::Bool) {
            let (station, area) = (signal.station, signal.area);
            let of_it = |frame: &Frame| (frame.station, frame.area) == (station, area);
            let frame = frames.iter().position(of_it).unwrap_or_else(|| {
                let bytes = (0..table.stations[station].bytes(area)).map(Octet::none);
                frames.push(Frame {
                    station,
                    area,
                    bytes: bytes.collect(),
                });
                frames.len() - 1
            });
            let octet = &mut frames[frame].bytes[signal.byte];
            octet.mask |= 1 << signal.bit;
            octet.bits[usize::from(signal.bit)] =
                u32::try_from(bits.len()).expect("tables hold fewer than 2^32 signals");
            bits.push(Bit {
                name: signal.name.clone(),
                rises: AtomicU64::new(0),
            });
        }
        for frame in &mut frames {
            let bytes = std::mem::take(&mut frame.bytes).into_iter();
            frame.bytes = bytes.filter(|octet| octet.mask != 0).collect();
        }
        Self {
            scans: AtomicU64::new(0),
            stale: AtomicU64::new(0),
            age: Mutex::new(TimeHistogram::new()),
            bits: bits.into(),
            frames: frames.into(),
        }
    }

    fn frame(&self, (station, area): (usize, Area)) -> Option<&Frame> {
        let here = |frame: &&Frame| (frame.station, frame.area) == (station, area);
        self.frames.iter().find(here)
    }

    /// Keeps in `before` what [`count`](Self::count) will compare with, where there is anything to count.
    pub(super) fn keep(&self, of: (usize, Area), before: &mut [u8], now: &[u8]) {
        if self.frame(of).is_some() {
            before.copy_from_slice(now);
        }
    }

    /// Counts the rising edges from `before` to `now` in an area of a station.
    pub(super) fn count(&self, of: (usize, Area), before: &[u8], now: &[u8]) {
        let Some(frame) = self.frame(of) else {
            return;
        };
        // Most scans change nothing.
        if frame.bytes.len() > FEW && before == now {
            return;
        }
        for octet in &frame.bytes {
            let mut rises = !before[octet.byte] & now[octet.byte] & octet.mask;
            while rises != 0 {
                let bit = octet.bits[rises.trailing_zeros() as usize];
                let count = &self.bits[bit as usize].rises;
                // One thread counts, others only look.
                count.store(count.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
                rises &= rises - 1;
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

    fn lock_age(&self) -> MutexGuard<'_, TimeHistogram> {
        // A histogram is consistent after every change, so a poisoned lock is safe to use.
        self.age.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The number of scans so far, and of those with stale data.
    pub(crate) fn scans(&self) -> (u64, u64) {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        (count(&self.scans), count(&self.stale))
    }

    /// Adds the counts.
    pub(crate) fn write(&self, statistics: &mut Statistics) {
        statistics.count("plc.scans", self.scans.load(Ordering::Relaxed));
        statistics.count("plc.stale", self.stale.load(Ordering::Relaxed));
        statistics.distribution("plc.age", &self.lock_age());
        for bit in &self.bits {
            let rises = bit.rises.load(Ordering::Relaxed);
            statistics.count(Key::of("plc.rises", &bit.name, ""), rises);
        }
    }
}
