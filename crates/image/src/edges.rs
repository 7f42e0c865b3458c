//! Edges must not be lost: they are counted where frames are written, and shown where frames are read.
//!
//! Each frame carries a cumulative, wrapping counter per latched signal. A frame that is overwritten unread
//! loses no edges, because the counters of the next frame include them. The reading side compares counters
//! and shapes the levels that it shows, so that every edge appears as an edge.

use std::ops::Range;

use crate::signal::{Area, Latch, SignalTable};
use tickbus_base::time::Nanos;

/// One latched bit of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatchedBit {
    /// Position of its signal in the signal table.
    pub signal: usize,
    /// Its byte in the frame.
    pub byte: usize,
    /// Its bit, as a mask.
    pub mask: u8,
    /// The edges that count.
    pub latch: Latch,
    /// How long a pulse is held beyond the exchange that carries it.
    pub hold: Nanos,
}

/// The latched bits of one frame, byte by byte.
pub fn latched_bits(table: &SignalTable, station: usize, area: Area) -> Box<[LatchedBit]> {
    let signals = table.signals.iter().enumerate();
    let mut bits: Box<[LatchedBit]> = signals
        .filter(|(_, signal)| signal.station == station && signal.area == area)
        .filter_map(|(index, signal)| {
            signal.latch.map(|latch| LatchedBit {
                signal: index,
                byte: signal.byte,
                mask: 1 << signal.bit,
                latch,
                hold: signal.hold,
            })
        })
        .collect();
    bits.sort_by_key(|bit| bit.byte);
    bits
}

/// The latched bits of one byte.
#[derive(Debug)]
struct Group {
    byte: usize,
    mask: u8,
    /// Their range among the latched bits.
    bits: Range<usize>,
}

/// Groups bits that are sorted by byte, so that the cost of a byte does not depend on the bits elsewhere.
fn groups(bits: &[LatchedBit]) -> Box<[Group]> {
    let mut begin = 0;
    let of_a_byte = bits.chunk_by(|one, next| one.byte == next.byte);
    of_a_byte
        .map(|side_by_side| {
            let bits = begin..begin + side_by_side.len();
            begin = bits.end;
            Group {
                byte: side_by_side[0].byte,
                mask: side_by_side.iter().fold(0, |mask, bit| mask | bit.mask),
                bits,
            }
        })
        .collect()
}

/// Counts edges on the writing side of a hand-over.
#[derive(Debug)]
pub struct EdgeCounter {
    bits: Box<[LatchedBit]>,
    groups: Box<[Group]>,
    /// The last values of the groups' bytes.
    last: Box<[u8]>,
    counts: Box<[u32]>,
}

impl EdgeCounter {
    /// A counter that regards `initial` as the levels before the first frame.
    pub fn new(bits: Box<[LatchedBit]>, initial: &[u8]) -> Self {
        let groups = groups(&bits);
        Self {
            last: groups.iter().map(|group| initial[group.byte]).collect(),
            counts: vec![0; bits.len()].into(),
            groups,
            bits,
        }
    }

    /// Counts the edges between the last levels and those in `bytes`, and writes the counters to `edges`,
    /// which belong to the same frame.
    #[inline]
    pub fn count(&mut self, bytes: &[u8], edges: &mut [u32]) {
        // Frames without latched signals are common; for them there is nothing to count or copy.
        if !self.bits.is_empty() {
            self.observe(bytes);
            edges.copy_from_slice(&self.counts);
        }
    }

    /// Counts the edges between the last levels and those in `bytes`.
    fn observe(&mut self, bytes: &[u8]) {
        for (group, last) in self.groups.iter().zip(&mut self.last) {
            let now = bytes[group.byte];
            let changed = (now ^ *last) & group.mask;
            if changed != 0 {
                let (bits, counts) = (&self.bits, &mut self.counts);
                count_byte(
                    &bits[group.bits.clone()],
                    &mut counts[group.bits.clone()],
                    changed,
                    now,
                );
                *last = now;
            }
        }
    }

    /// The counters, one per latched bit.
    #[cfg(test)]
    fn counts(&self) -> &[u32] {
        &self.counts
    }
}

/// Counts the edges of one byte, whose latched bits are `bits`.
fn count_byte(bits: &[LatchedBit], counts: &mut [u32], changed: u8, now: u8) {
    for (bit, count) in bits.iter().zip(counts) {
        if bit.mask & changed != 0 {
            let counts_here = match bit.latch {
                Latch::Rising => now & bit.mask != 0,
                Latch::Falling => now & bit.mask == 0,
                Latch::Both => true,
            };
            *count = count.wrapping_add(u32::from(counts_here));
        }
    }
}

/// What the receiver has been shown of one latched bit.
#[derive(Clone, Copy, Debug)]
struct Shown {
    /// The counter up to which edges have been shown.
    count: u32,
    /// Until when the level is held.
    hold_until: Nanos,
}

const NOTHING_SHOWN: Shown = Shown {
    count: 0,
    hold_until: Nanos(i64::MIN),
};

/// Shapes the levels on the reading side so that every edge appears as an edge.
///
/// Where the counters report edges that the levels no longer show, the level is forced for one exchange: a
/// pulse that is over is shown late, and a level that fell and rose again in between is shown low once.
/// Several edges between two exchanges merge into one. What was shaped counts as seen only when
/// [`confirm`](Self::confirm) reports that the exchange was completed.
#[derive(Debug)]
pub struct PulseShaper {
    bits: Box<[LatchedBit]>,
    groups: Box<[Group]>,
    /// The bytes of the groups as the receiver saw them last, and as it is about to see them.
    levels: Box<[u8]>,
    next_levels: Box<[u8]>,
    shown: Box<[Shown]>,
    next_shown: Box<[Shown]>,
    /// Counters of the last frame.
    counts: Box<[u32]>,
    /// Whether any level is forced or held, or any edge still waits.
    busy: bool,
}

impl PulseShaper {
    /// A shaper that assumes the receiver has seen `initial`.
    pub fn new(bits: Box<[LatchedBit]>, initial: &[u8]) -> Self {
        let groups = groups(&bits);
        let levels: Box<[u8]> = groups.iter().map(|group| initial[group.byte]).collect();
        Self {
            next_levels: levels.clone(),
            levels,
            shown: vec![NOTHING_SHOWN; bits.len()].into(),
            next_shown: vec![NOTHING_SHOWN; bits.len()].into(),
            counts: vec![0; bits.len()].into(),
            busy: false,
            groups,
            bits,
        }
    }

    /// The latched bits that it shapes.
    pub fn bits(&self) -> &[LatchedBit] {
        &self.bits
    }

    /// Whether a level is forced or held, or an edge waits, so that the same frame needs shaping again.
    #[inline]
    pub fn is_busy(&self) -> bool {
        self.busy
    }

    /// Whether the levels of a frame with the counters `edges` need shaping; if not, they
    /// [`pass`](Self::pass).
    #[inline]
    pub fn needs_shaping(&self, edges: &[u32]) -> bool {
        self.busy || *edges != *self.counts
    }

    /// For each latched bit, how many of the edges counted in `edges` are newer than the last frame.
    pub fn new_edges<'a>(&'a self, edges: &'a [u32]) -> impl Iterator<Item = u32> + 'a {
        edges
            .iter()
            .zip(&self.counts)
            .map(|(now, before)| now.wrapping_sub(*before))
    }

    /// Records that the receiver is about to see `bytes` unshaped.
    #[inline]
    pub fn pass(&mut self, bytes: &[u8]) {
        for (group, level) in self.groups.iter().zip(&mut self.next_levels) {
            *level = bytes[group.byte];
        }
    }

    /// Records that the receiver is about to see `bytes` in place of any frame: they show none of the waiting
    /// edges.
    pub fn pass_instead(&mut self, bytes: &[u8]) {
        self.next_shown.copy_from_slice(&self.shown);
        self.pass(bytes);
    }

    /// Shapes `bytes`, a copy of the frame's, whose counters are `edges`, for an exchange at `now`.
    pub fn shape(&mut self, edges: &[u32], now: Nanos, bytes: &mut [u8]) {
        self.counts.copy_from_slice(edges);
        self.busy = false;
        for (group, levels) in self.groups.iter().zip(&self.levels) {
            let byte = &mut bytes[group.byte];
            for index in group.bits.clone() {
                let bit = &self.bits[index];
                let (seen, level) = (levels & bit.mask != 0, *byte & bit.mask != 0);
                let shown = self.shown[index];
                let (next_level, next) = shape_bit(bit, shown, seen, level, edges[index], now);
                self.next_shown[index] = next;
                self.busy |= next_level != level
                    || next.count != edges[index]
                    || next.count != shown.count
                    || now < next.hold_until;
                if next_level {
                    *byte |= bit.mask;
                } else {
                    *byte &= !bit.mask;
                }
            }
        }
        self.pass(bytes);
    }

    /// Records that the receiver has seen what was shaped or passed last.
    #[inline]
    pub fn confirm(&mut self) {
        self.levels.copy_from_slice(&self.next_levels);
        if self.busy {
            self.shown.copy_from_slice(&self.next_shown);
        }
    }

    /// As [`confirm`](Self::confirm), for a receiver that has seen only these bits of the frame (bit n of
    /// byte k is 8k + n).
    pub fn confirm_bits(&mut self, bits: &Range<usize>) {
        let levels = self.levels.iter_mut().zip(&self.next_levels);
        for (group, (level, next)) in self.groups.iter().zip(levels) {
            let seen = mask_of(bits, group.byte);
            *level = *level & !seen | next & seen;
        }
        if self.busy {
            for (index, bit) in self.bits.iter().enumerate() {
                if mask_of(bits, bit.byte) & bit.mask != 0 {
                    self.shown[index] = self.next_shown[index];
                }
            }
        }
    }
}

/// The bits of a byte that are within `bits`, as a mask.
fn mask_of(bits: &Range<usize>, byte: usize) -> u8 {
    let among = (0..8).filter(|bit| bits.contains(&(byte * 8 + bit)));
    among.fold(0, |mask, bit| mask | 1 << bit)
}

/// The level to show of one bit, and what the receiver will then have seen.
fn shape_bit(
    bit: &LatchedBit,
    shown: Shown,
    seen: bool,
    level: bool,
    count: u32,
    now: Nanos,
) -> (bool, Shown) {
    if now < shown.hold_until {
        return (seen, shown);
    }
    if count == shown.count {
        return (level, shown);
    }
    // An edge waits. The next level is the inverse in either case: it is that edge, or the level that the
    // receiver must see before it can see the edge.
    let next = !seen;
    let is_edge = match bit.latch {
        Latch::Rising => next,
        Latch::Falling => !next,
        Latch::Both => true,
    };
    let shown = if is_edge {
        Shown {
            count,
            hold_until: now + bit.hold,
        }
    } else {
        shown
    };
    (next, shown)
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    fn bit(latch: Latch, hold: Nanos) -> Box<[LatchedBit]> {
        Box::new([LatchedBit {
            signal: 0,
            byte: 0,
            mask: 1,
            latch,
            hold,
        }])
    }

    /// Feeds levels to a counter; the reader looks, and confirms, where `looks` has a `^`.
    fn seen(latch: Latch, levels: &str, looks: &str) -> String {
        let mut counter = EdgeCounter::new(bit(latch, Nanos::ZERO), &[0]);
        let mut shaper = PulseShaper::new(bit(latch, Nanos::ZERO), &[0]);
        let mut seen = String::new();
        for (level, look) in levels.bytes().zip(looks.bytes()) {
            let mut bytes = [level - b'0'];
            counter.observe(&bytes);
            if look == b'^' {
                if shaper.needs_shaping(counter.counts()) {
                    shaper.shape(counter.counts(), Nanos::ZERO, &mut bytes);
                } else {
                    shaper.pass(&bytes);
                }
                shaper.confirm();
                seen.push(char::from(b'0' + bytes[0]));
            } else {
                seen.push(' ');
            }
        }
        seen
    }

    #[test]
    fn every_edge_of_interest_is_seen_as_an_edge() {
        for (latch, levels, looks, expected) in [
            // A pulse between two looks is shown late, for one look.
            (Latch::Rising, "00100000", "^  ^ ^^^", "0  1 000"),
            (Latch::Falling, "01101111", "^^ ^ ^^^", "01 0 111"),
            (Latch::Both, "00100000", "^  ^ ^^^", "0  1 000"),
            // A level that fell and rose again is shown low once.
            (Latch::Rising, "01101111", "^^  ^^^^", "01  0111"),
            // A level that rises and stays needs no help.
            (Latch::Rising, "00111000", "^^^^^^^^", "00111000"),
            // After a fall that does not count, the next rise shows at once.
            (Latch::Rising, "01100110", "^^^^^^^^", "01100110"),
            // Crowded edges merge.
            (Latch::Rising, "01010100", "^     ^^", "0     10"),
            (Latch::Both, "01010111", "^    ^^^", "0    111"),
        ] {
            assert_eq!(
                seen(latch, levels, looks),
                expected,
                "{latch:?} {levels} {looks}"
            );
        }
    }

    #[test]
    fn an_exchange_that_failed_keeps_the_pulse() {
        let mut counter = EdgeCounter::new(bit(Latch::Rising, Nanos::ZERO), &[0]);
        let mut shaper = PulseShaper::new(bit(Latch::Rising, Nanos::ZERO), &[0]);
        counter.observe(&[1]);
        counter.observe(&[0]);
        for _ in 0..3 {
            assert!(shaper.needs_shaping(counter.counts()));
            let mut bytes = [0];
            shaper.shape(counter.counts(), Nanos::ZERO, &mut bytes);
            assert_eq!(bytes, [1]);
        }
        shaper.confirm();
        let mut bytes = [0];
        assert!(shaper.needs_shaping(counter.counts()));
        shaper.shape(counter.counts(), Nanos::ZERO, &mut bytes);
        shaper.confirm();
        assert_eq!(bytes, [0]);
        assert!(!shaper.needs_shaping(counter.counts()));
    }

    #[test]
    fn a_pulse_is_held_for_as_long_as_the_signal_asks() {
        let hold = Nanos::from_millis(20);
        let mut counter = EdgeCounter::new(bit(Latch::Rising, hold), &[0]);
        let mut shaper = PulseShaper::new(bit(Latch::Rising, hold), &[0]);
        counter.observe(&[1]);
        counter.observe(&[0]);
        let shown: Vec<u8> = (0..5)
            .map(|step| {
                let mut bytes = [0];
                shaper.shape(counter.counts(), Nanos::from_millis(step * 7), &mut bytes);
                shaper.confirm();
                bytes[0]
            })
            .collect();
        assert_eq!(shown, [1, 1, 1, 0, 0]);
    }

    #[test]
    fn counters_wrap() {
        let mut counter = EdgeCounter::new(bit(Latch::Rising, Nanos::ZERO), &[0]);
        counter.counts[0] = u32::MAX;
        let mut shaper = PulseShaper::new(bit(Latch::Rising, Nanos::ZERO), &[0]);
        shaper.counts[0] = u32::MAX;
        counter.observe(&[1]);
        assert_eq!(shaper.new_edges(counter.counts()).collect::<Vec<_>>(), [1]);
    }

    /// Signals of a table: station, area, byte, bit, and whether it is latched.
    fn table(signals: &[(usize, Area, usize, u8, bool)]) -> SignalTable {
        use crate::signal::{ByteOrder, DataType, Signal, Slot, Station};

        let station = || Station {
            name: String::new(),
            input_bytes: 8,
            output_bytes: 8,
        };
        let signals = signals
            .iter()
            .map(|&(station, area, byte, bit, latched)| Signal {
                name: String::new(),
                station,
                area,
                byte,
                bit,
                data_type: DataType::Bool,
                order: ByteOrder::Abcd,
                scale: None,
                range: None,
                unit: None,
                latch: latched.then_some(Latch::Rising),
                hold: Nanos::ZERO,
                fail_safe: Slot::default(),
                dead_band: 0.0,
            });
        SignalTable {
            stations: vec![station(), station()],
            signals: signals.collect(),
        }
    }

    #[test]
    fn latched_are_the_bits_of_this_station_and_area_that_say_so() {
        let (this, other) = (Area::Output, Area::Input);
        let table = table(&[
            (0, this, 5, 7, true),
            (0, this, 2, 0, true),
            (0, this, 5, 1, false),
            (0, other, 5, 2, true),
            (1, this, 5, 3, true),
            (0, this, 5, 4, true),
            (0, this, 2, 6, true),
        ]);
        let bits = latched_bits(&table, 0, this);
        let found: Vec<_> = bits
            .iter()
            .map(|bit| (bit.signal, bit.byte, bit.mask))
            .collect();
        assert_eq!(found, [(1, 2, 1), (6, 2, 64), (0, 5, 128), (5, 5, 16)]);
        let groups = groups(&bits);
        let groups: Vec<_> = groups
            .iter()
            .map(|group| (group.byte, group.mask, group.bits.clone()))
            .collect();
        assert_eq!(groups, [(2, 65, 0..2), (5, 144, 2..4)]);
    }

    #[test]
    fn several_bits_of_one_byte_are_counted_and_shown_each_by_itself() {
        let signals: Vec<_> = [(3, 0), (1, 7), (3, 5), (1, 2)]
            .map(|(byte, bit)| (0, Area::Output, byte, bit, true))
            .into();
        let bits = latched_bits(&table(&signals), 0, Area::Output);
        let mut counter = EdgeCounter::new(bits.clone(), &[0; 8]);
        let mut shaper = PulseShaper::new(bits, &[0; 8]);
        // A pulse of %QX3.5, and two of %QX1.2.
        for (byte, level) in [(3, 0x20), (3, 0), (1, 4), (1, 0), (1, 4), (1, 0)] {
            let mut bytes = [0; 8];
            bytes[byte] = level;
            counter.observe(&bytes);
        }
        assert_eq!(counter.counts(), [0, 2, 0, 1]);
        let mut bytes = [0; 8];
        shaper.shape(counter.counts(), Nanos::ZERO, &mut bytes);
        assert_eq!(bytes, [0, 4, 0, 0x20, 0, 0, 0, 0]);
        shaper.confirm_bits(&(24..32));
        let mut bytes = [0; 8];
        shaper.shape(counter.counts(), Nanos::ZERO, &mut bytes);
        assert_eq!(bytes, [0, 4, 0, 0, 0, 0, 0, 0], "only byte 3 was seen");
    }

    #[test]
    fn bits_beside_the_latched_ones_do_not_matter() {
        let mut counter = EdgeCounter::new(bit(Latch::Both, Nanos::ZERO), &[0]);
        counter.observe(&[0b1111_1110]);
        assert_eq!(counter.counts(), [0]);
    }
}
