//! The counters of a hosted program.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::statistics::Counters;
use tickbus_base::statistics::{Key, Statistics};
use tickbus_base::time::{Nanos, SharedHistogram};
use tickbus_image::copy_frame;
use tickbus_image::signal::{Area, DataType, SignalTable};

/// Counts what the hosted program has seen and sent, for comparison with the other end. Only the scan thread counts;
/// other threads only read.
#[derive(Debug)]
pub(crate) struct ScanCounters {
    scans: AtomicU64,
    /// Number of scans with stale data.
    stale: AtomicU64,
    /// Age of the data at the scans.
    age: SharedHistogram,
    /// The counted bits, in the order of the signal table.
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

/// The position of a counted area among all of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct CountedArea(usize);

/// Adds one to a counter that no other thread changes.
#[inline]
fn count_one(counter: &AtomicU64) {
    counter.store(counter.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
}

/// Up to this many bytes, looking at them one by one is faster than comparing first.
const FEW: usize = 8;

/// A byte that contains BOOLs.
#[derive(Debug)]
struct Octet {
    byte: usize,
    mask: u8,
    /// Positions of bits 0 to 7 in [`ScanCounters::bits`]; bits outside the mask have none.
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
            age: SharedHistogram::new(),
            bits: bits.into(),
            frames: frames.into(),
        }
    }

    /// Returns the place of a station's area, if it has anything to count.
    pub(super) fn place(&self, station: usize, area: Area) -> Option<CountedArea> {
        let here = |frame: &Frame| (frame.station, frame.area) == (station, area);
        self.frames.iter().position(here).map(CountedArea)
    }

    /// Copies `now` into `before` for the next [`count`](Self::count), if there is anything to count.
    #[inline]
    pub(super) fn keep(of: Option<CountedArea>, before: &mut [u8], now: &[u8]) {
        if of.is_some() {
            copy_frame(before, now);
        }
    }

    /// Counts the rising edges from `before` to `now` in an area.
    #[inline]
    pub(super) fn count(&self, of: Option<CountedArea>, before: &[u8], now: &[u8]) {
        if let Some(CountedArea(place)) = of {
            self.count_in(&self.frames[place], before, now);
        }
    }

    fn count_in(&self, frame: &Frame, before: &[u8], now: &[u8]) {
        // Most scans change nothing.
        if frame.bytes.len() > FEW && before == now {
            return;
        }
        for octet in &frame.bytes {
            let mut rises = !before[octet.byte] & now[octet.byte] & octet.mask;
            while rises != 0 {
                let bit = octet.bits[rises.trailing_zeros() as usize];
                let count = &self.bits[bit as usize].rises;
                count_one(count);
                rises &= rises - 1;
            }
        }
    }

    /// Records a scan whose data were of `age`.
    #[inline]
    pub(super) fn scanned(&self, age: Nanos, alive: bool) {
        count_one(&self.scans);
        if alive {
            self.age.record(age);
        } else {
            count_one(&self.stale);
        }
    }

    /// Returns the number of scans so far, and how many of them had stale data.
    pub(crate) fn scans(&self) -> (u64, u64) {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        (count(&self.scans), count(&self.stale))
    }
}

impl Counters for ScanCounters {
    fn write(&self, statistics: &mut Statistics) {
        statistics.count("plc.scans", self.scans.load(Ordering::Relaxed));
        statistics.count("plc.stale", self.stale.load(Ordering::Relaxed));
        statistics.distribution("plc.age", &self.age.read());
        for bit in &self.bits {
            let rises = bit.rises.load(Ordering::Relaxed);
            statistics.count(Key::of("plc.rises", &bit.name, ""), rises);
        }
    }
}
