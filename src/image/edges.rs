//! Edges that must not get lost: counted where frames are written, shown where frames are read.
//!
//! Frames carry a cumulative, wrapping counter per latched signal. A frame that is overwritten unread
//! takes none of its edges along, because the next frame's counters hold them too. The reading side
//! compares counters and shapes the levels that it shows, so that every edge is seen as an edge.

use std::ops::Range;

use crate::signal::{Area, Latch, SignalTable};
use crate::time::Nanos;

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

/// The latched bits of one frame, in the order of the signal table.
pub fn latched_bits(table: &SignalTable, station: usize, area: Area) -> Box<[LatchedBit]> {
    let signals = table.signals.iter().enumerate();
    signals
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
        .collect()
}

/// Which bytes of a frame hold latched bits, and which bits of them.
fn latched_masks(bits: &[LatchedBit]) -> Box<[(usize, u8)]> {
    let mut masks: Vec<(usize, u8)> = Vec::new();
    for bit in bits {
        match masks.iter_mut().find(|(byte, _)| *byte == bit.byte) {
            Some((_, mask)) => *mask |= bit.mask,
            None => masks.push((bit.byte, bit.mask)),
        }
    }
    masks.into()
}

/// Counts edges on the writing side of a hand-over.
#[derive(Debug)]
pub struct EdgeCounter {
    bits: Box<[LatchedBit]>,
    masks: Box<[(usize, u8)]>,
    /// The bytes of `masks` as they were last.
    last: Box<[u8]>,
    counts: Box<[u32]>,
}

impl EdgeCounter {
    /// A counter that takes `initial` for the levels before the first frame.
    pub fn new(bits: Box<[LatchedBit]>, initial: &[u8]) -> Self {
        let masks = latched_masks(&bits);
        Self {
            last: masks.iter().map(|(byte, _)| initial[*byte]).collect(),
            counts: vec![0; bits.len()].into(),
            masks,
            bits,
        }
    }

    /// Counts the edges from the levels seen last to those in `bytes`, and writes the counters into
    /// `edges`, which belong to the same frame.
    #[inline]
    pub fn count(&mut self, bytes: &[u8], edges: &mut [u32]) {
        // Frames without latched signals are common, and have nothing to count or copy.
        if !self.bits.is_empty() {
            self.observe(bytes);
            edges.copy_from_slice(&self.counts);
        }
    }

    /// Counts the edges from the levels seen last to those in `bytes`.
    fn observe(&mut self, bytes: &[u8]) {
        for (&(byte, mask), last) in self.masks.iter().zip(&mut self.last) {
            let changed = (bytes[byte] ^ *last) & mask;
            if changed != 0 {
                count_byte(&self.bits, &mut self.counts, byte, changed, bytes[byte]);
                *last = bytes[byte];
            }
        }
    }

    /// The counters, one per latched bit.
    #[cfg(test)]
    fn counts(&self) -> &[u32] {
        &self.counts
    }
}

/// Counts the edges of one byte.
fn count_byte(bits: &[LatchedBit], counts: &mut [u32], byte: usize, changed: u8, now: u8) {
    for (bit, count) in bits.iter().zip(counts) {
        if bit.byte == byte && bit.mask & changed != 0 {
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
    /// Until when the level stays as it is.
    hold_until: Nanos,
}

const NOTHING_SHOWN: Shown = Shown {
    count: 0,
    hold_until: Nanos(i64::MIN),
};

/// Shapes the levels on the reading side so that every edge is seen as an edge.
///
/// Where the counters say that edges happened which the levels no longer show, the level is forced
/// for one exchange: a pulse that is over is shown late, and a level that fell and rose again in
/// between is shown low once. Edges that crowd between two exchanges merge into one. What was shaped
/// counts as seen only once [`confirm`](Self::confirm) says that the exchange was completed.
#[derive(Debug)]
pub struct PulseShaper {
    bits: Box<[LatchedBit]>,
    masks: Box<[(usize, u8)]>,
    /// The bytes of `masks` as the receiver has seen them last, and as it is about to see them.
    levels: Box<[u8]>,
    next_levels: Box<[u8]>,
    shown: Box<[Shown]>,
    next_shown: Box<[Shown]>,
    /// Counters of the frame looked at last.
    counts: Box<[u32]>,
    /// Whether any level is forced or held, or any edge still waits.
    busy: bool,
}

impl PulseShaper {
    /// A shaper whose receiver is taken to have seen `initial`.
    pub fn new(bits: Box<[LatchedBit]>, initial: &[u8]) -> Self {
        let masks = latched_masks(&bits);
        let levels: Box<[u8]> = masks.iter().map(|(byte, _)| initial[*byte]).collect();
        Self {
            next_levels: levels.clone(),
            levels,
            shown: vec![NOTHING_SHOWN; bits.len()].into(),
            next_shown: vec![NOTHING_SHOWN; bits.len()].into(),
            counts: vec![0; bits.len()].into(),
            busy: false,
            masks,
            bits,
        }
    }

    /// The latched bits that it looks after.
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

    /// For each latched bit, how many of the edges counted in `edges` are newer than the frame
    /// looked at last.
    pub fn new_edges<'a>(&'a self, edges: &'a [u32]) -> impl Iterator<Item = u32> + 'a {
        edges
            .iter()
            .zip(&self.counts)
            .map(|(now, before)| now.wrapping_sub(*before))
    }

    /// Takes note that the receiver is about to see `bytes` unshaped.
    #[inline]
    pub fn pass(&mut self, bytes: &[u8]) {
        for (&(byte, _), level) in self.masks.iter().zip(&mut self.next_levels) {
            *level = bytes[byte];
        }
    }

    /// Takes note that the receiver is about to see `bytes` instead of any frame: no edge that waits
    /// is shown by them.
    pub fn pass_instead(&mut self, bytes: &[u8]) {
        self.next_shown.copy_from_slice(&self.shown);
        self.pass(bytes);
    }

    /// Shapes `bytes`, a copy of the frame's, whose counters are `edges`, for an exchange at `now`.
    pub fn shape(&mut self, edges: &[u32], now: Nanos, bytes: &mut [u8]) {
        self.counts.copy_from_slice(edges);
        self.busy = false;
        for (index, bit) in self.bits.iter().enumerate() {
            let group = self.masks.iter().position(|(byte, _)| *byte == bit.byte);
            let seen = self.levels[group.expect("masks cover all bits")] & bit.mask != 0;
            let level = bytes[bit.byte] & bit.mask != 0;
            let shown = self.shown[index];
            let (next_level, next) = shape_bit(bit, shown, seen, level, edges[index], now);
            self.next_shown[index] = next;
            self.busy |= next_level != level
                || next.count != edges[index]
                || next.count != shown.count
                || now < next.hold_until;
            if next_level {
                bytes[bit.byte] |= bit.mask;
            } else {
                bytes[bit.byte] &= !bit.mask;
            }
        }
        self.pass(bytes);
    }

    /// Takes note that the receiver has seen what was shaped or passed last.
    #[inline]
    pub fn confirm(&mut self) {
        self.levels.copy_from_slice(&self.next_levels);
        if self.busy {
            self.shown.copy_from_slice(&self.next_shown);
        }
    }

    /// As [`confirm`](Self::confirm), for a receiver that has seen these bits of the frame alone (bit n of byte k is
    /// 8k + n).
    pub fn confirm_bits(&mut self, bits: &Range<usize>) {
        for (group, &(byte, _)) in self.masks.iter().enumerate() {
            let seen = mask_of(bits, byte);
            let level = &mut self.levels[group];
            *level = *level & !seen | self.next_levels[group] & seen;
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

/// Those bits of a byte that are among `bits`.
fn mask_of(bits: &Range<usize>, byte: usize) -> u8 {
    let among = (0..8).filter(|bit| bits.contains(&(byte * 8 + bit)));
    among.fold(0, |mask, bit| mask | 1 << bit)
}

/// The level to show of one bit, and what will have been shown then.
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
    // An edge waits. The next level is the other one in any case: either it is the edge, or the
    // receiver must see it before it can see the edge.
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

    /// Runs levels through a counter; the reader looks, and confirms, where `looks` has a `^`.
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
            // A pulse between two looks is shown late, and for one look.
            (Latch::Rising, "00100000", "^  ^ ^^^", "0  1 000"),
            (Latch::Falling, "01101111", "^^ ^ ^^^", "01 0 111"),
            (Latch::Both, "00100000", "^  ^ ^^^", "0  1 000"),
            // A level that fell and rose again is shown low once.
            (Latch::Rising, "01101111", "^^  ^^^^", "01  0111"),
            // A level that rises and stays needs no help.
            (Latch::Rising, "00111000", "^^^^^^^^", "00111000"),
            // After a fall that is not of interest, the next rise shows at once.
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

    #[test]
    fn bits_beside_the_latched_ones_do_not_matter() {
        let mut counter = EdgeCounter::new(bit(Latch::Both, Nanos::ZERO), &[0]);
        counter.observe(&[0b1111_1110]);
        assert_eq!(counter.counts(), [0]);
    }
}
