//! Edges must not be lost: they are counted where frames are written, and shown where frames are read.
//!
//! Each frame carries a cumulative, wrapping counter per latched signal. A frame that is overwritten unread
//! loses no edges, because the counters of the next frame include them. The reading side compares counters
//! and shapes the levels that it shows, so that every edge appears as an edge.

use std::ops::Range;

use super::word::{among, word_at};
use crate::signal::{Area, Latch, SignalTable};
use tickbus_base::time::Nanos;

/// One latched bit of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatchedBit {
    /// Position of its signal in the signal table.
    pub signal: usize,
    /// The byte in the frame.
    pub byte: usize,
    /// The bit, as a mask.
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

/// Eight bytes of a frame with latched bits: 64 bits are processed at a time, as masks. Bit n of the frame's byte k is
/// bit 8 × (k modulo 8) + n here.
#[derive(Clone, Debug)]
struct Word {
    /// The first of its bytes.
    byte: usize,
    latched: u64,
    /// The bits whose rising edges count, and those whose falling edges count.
    rising: u64,
    falling: u64,
    /// The range of these bits among the latched bits.
    bits: Range<usize>,
}

impl Word {
    /// The words of latched bits, which are in the order of their bytes.
    fn all(bits: &[LatchedBit]) -> Box<[Self]> {
        let mut begin = 0;
        let of_a_word = bits.chunk_by(|one, next| one.byte / 8 == next.byte / 8);
        of_a_word
            .map(|members| {
                let bits = begin..begin + members.len();
                begin = bits.end;
                let those = |counts: fn(Latch) -> bool| {
                    let members = members.iter().filter(|bit| counts(bit.latch));
                    members.fold(0, |mask, bit| mask | 1 << bit.place())
                };
                Self {
                    byte: members[0].byte / 8 * 8,
                    latched: those(|_| true),
                    rising: those(|latch| latch != Latch::Falling),
                    falling: those(|latch| latch != Latch::Rising),
                    bits,
                }
            })
            .collect()
    }

    /// The levels of the latched bits.
    #[inline]
    fn levels(&self, bytes: &[u8]) -> u64 {
        word_at(bytes, self.byte) & self.latched
    }

    /// Toggles the latched bits in `changes`.
    #[inline]
    fn change(&self, bytes: &mut [u8], changes: u64) {
        if changes == 0 {
            return;
        }
        for (byte, changes) in bytes[self.byte..].iter_mut().zip(changes.to_le_bytes()) {
            *byte ^= changes;
        }
    }

    /// The bits among `bits` for which a change to `levels` is an edge that counts.
    #[inline]
    fn edges(&self, bits: u64, levels: u64) -> u64 {
        bits & (levels & self.rising | !levels & self.falling)
    }

    /// The latched bits that are among `bits` of the frame.
    fn among(&self, bits: &Range<usize>) -> u64 {
        among(self.byte, bits)
    }
}

impl LatchedBit {
    /// The bit's place in its [`Word`].
    fn place(&self) -> usize {
        8 * (self.byte % 8) + self.mask.trailing_zeros() as usize
    }
}

/// Per latched bit, its place in its word.
fn places(bits: &[LatchedBit]) -> Box<[u8]> {
    let places = bits.iter().map(|bit| bit.place().to_le_bytes()[0]);
    places.collect()
}

/// Counts edges on the writing side of a hand-over.
#[derive(Debug)]
pub struct EdgeCounter {
    words: Box<[Word]>,
    places: Box<[u8]>,
    /// The last levels of the words.
    last: Box<[u64]>,
    counts: Box<[u32]>,
}

impl EdgeCounter {
    /// A counter that takes `initial` for the levels before the first frame.
    pub fn new(bits: &[LatchedBit], initial: &[u8]) -> Self {
        let words = Word::all(bits);
        Self {
            last: words.iter().map(|word| word.levels(initial)).collect(),
            counts: vec![0; bits.len()].into(),
            places: places(bits),
            words,
        }
    }

    /// Counts the edges between the last levels and those in `bytes`, and writes the counters to `edges`,
    /// which belong to the same frame.
    #[inline]
    pub fn count(&mut self, bytes: &[u8], edges: &mut [u32]) {
        // Frames without latched signals are common, and have nothing to count or copy.
        if !self.words.is_empty() {
            self.observe(bytes);
            edges.copy_from_slice(&self.counts);
        }
    }

    /// Takes over the levels in `bytes` without counting edges.
    pub fn pass(&mut self, bytes: &[u8]) {
        for (word, last) in self.words.iter().zip(&mut self.last) {
            *last = word.levels(bytes);
        }
    }

    /// Counts the edges between the last levels and those in `bytes`.
    #[inline]
    pub fn observe(&mut self, bytes: &[u8]) {
        for (word, last) in self.words.iter().zip(&mut self.last) {
            let now = word.levels(bytes);
            let edges = word.edges(now ^ *last, now);
            *last = now;
            if edges != 0 {
                let counts = &mut self.counts[word.bits.clone()];
                for (count, place) in counts.iter_mut().zip(&self.places[word.bits.clone()]) {
                    *count = count.wrapping_add(u32::from(edges >> place & 1 != 0));
                }
            }
        }
    }

    /// The counters, one per latched bit.
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }
}

/// The receiver's last or next view of a word's latched bits.
#[derive(Clone, Copy, Debug, Default)]
struct Shown {
    levels: u64,
    /// The bits with an edge that waits to be shown.
    waiting: u64,
}

impl Shown {
    /// Takes over these bits from `next`.
    fn merge(&mut self, next: Self, bits: u64) {
        self.levels = self.levels & !bits | next.levels & bits;
        self.waiting = self.waiting & !bits | next.waiting & bits;
    }
}

/// A bit whose pulses are held.
#[derive(Debug)]
struct Hold {
    /// The bit's word, and the bit as a mask in that word.
    word: usize,
    mask: u64,
    span: Nanos,
    /// How long its level is held: in the receiver's last view, and in the next.
    until: Nanos,
    next_until: Nanos,
}

/// Shapes the levels on the reading side so that every edge is seen as an edge.
///
/// Where the counters report edges that the levels no longer show, the level is forced for one exchange: a pulse that
/// has ended is shown late, and a level that fell and rose again in between is shown low once. Several edges between
/// two exchanges merge into one. Shaped levels count as seen only when [`confirm`](Self::confirm) reports that the
/// exchange was completed.
#[derive(Debug)]
pub struct PulseShaper {
    bits: Box<[LatchedBit]>,
    words: Box<[Word]>,
    places: Box<[u8]>,
    /// Per word, the receiver's last view and the next one.
    shown: Box<[Shown]>,
    next: Box<[Shown]>,
    /// The bits that are held for longer than one exchange; usually none.
    holds: Box<[Hold]>,
    /// Per word, the bits whose level is held.
    held: Box<[u64]>,
    /// Counters of the frame looked at last.
    counts: Box<[u32]>,
    /// True if any level is forced or held, or any edge still waits.
    busy: bool,
}

impl PulseShaper {
    /// A shaper that assumes the receiver has seen `initial`.
    pub fn new(bits: Box<[LatchedBit]>, initial: &[u8]) -> Self {
        let words = Word::all(&bits);
        let shown = words.iter().map(|word| Shown {
            levels: word.levels(initial),
            waiting: 0,
        });
        let shown: Box<[Shown]> = shown.collect();
        let held = bits.iter().filter(|bit| bit.hold > Nanos::ZERO);
        let holds = held.filter_map(|bit| {
            let is_its = |word: &Word| word.byte == bit.byte / 8 * 8;
            Some(Hold {
                word: words.iter().position(is_its)?,
                mask: 1 << bit.place(),
                span: bit.hold,
                until: Nanos(i64::MIN),
                next_until: Nanos(i64::MIN),
            })
        });
        Self {
            held: vec![0; words.len()].into(),
            next: shown.clone(),
            shown,
            holds: holds.collect(),
            counts: vec![0; bits.len()].into(),
            places: places(&bits),
            busy: false,
            words,
            bits,
        }
    }

    /// The latched bits that this shaper shapes.
    pub fn bits(&self) -> &[LatchedBit] {
        &self.bits
    }

    /// True if the levels of a frame with the counters `edges` need shaping; otherwise, [`pass`](Self::pass) them.
    #[inline]
    pub fn needs_shaping(&self, edges: &[u32]) -> bool {
        // Without latched signals, compare nothing: comparing zero bytes reads at a dangling address, and on processors
        // with masked loads that takes longer than the rest of a tick.
        self.busy || (!self.words.is_empty() && *edges != *self.counts)
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
        for (word, next) in self.words.iter().zip(&mut self.next) {
            next.levels = word.levels(bytes);
        }
    }

    /// Records that the receiver is about to see `bytes` in place of any frame: they show none of the waiting
    /// edges.
    pub fn pass_instead(&mut self, bytes: &[u8]) {
        self.next.copy_from_slice(&self.shown);
        for hold in &mut self.holds {
            hold.next_until = hold.until;
        }
        self.pass(bytes);
    }

    /// Shapes `bytes`, a copy of the frame's, whose counters are `edges`, for an exchange at `now`.
    pub fn shape(&mut self, edges: &[u32], now: Nanos, bytes: &mut [u8]) {
        self.take_over(edges);
        for hold in &self.holds {
            let held = &mut self.held[hold.word];
            *held = if now < hold.until {
                *held | hold.mask
            } else {
                *held & !hold.mask
            };
        }
        let mut busy = 0;
        for (index, word) in self.words.iter().enumerate() {
            let (shown, held) = (self.shown[index], self.held[index]);
            let levels = word.levels(bytes);
            // An edge waits. The next level is the other one in any case: either it is the edge, or the
            // receiver must see it before it can see the edge.
            let due = shown.waiting & !held;
            let next = shown.levels & held | !shown.levels & due | levels & !(held | due);
            self.next[index] = Shown {
                levels: next,
                waiting: shown.waiting & !word.edges(due, next),
            };
            busy |= next ^ levels | shown.waiting;
            word.change(bytes, next ^ levels);
        }
        self.busy = busy != 0;
        for hold in &mut self.holds {
            let [shown, next] = [&self.shown, &self.next].map(|words| words[hold.word].waiting);
            let is_shown_now = shown & !next & hold.mask != 0;
            hold.next_until = if is_shown_now {
                now + hold.span
            } else {
                hold.until
            };
            self.busy |= now < hold.next_until;
        }
    }

    /// Takes over the counters of a frame: bits with new edges wait to show them.
    fn take_over(&mut self, edges: &[u32]) {
        if *edges == *self.counts {
            return;
        }
        for (word, shown) in self.words.iter().zip(&mut self.shown) {
            let bits = word.bits.clone();
            let counters = edges[bits.clone()].iter().zip(&self.counts[bits.clone()]);
            for ((now, before), place) in counters.zip(&self.places[bits]) {
                shown.waiting |= u64::from(now != before) << place;
            }
        }
        self.counts.copy_from_slice(edges);
    }

    /// Drops the edges that wait, up to a frame whose counters are `edges`, and the levels that are held.
    pub fn restart(&mut self, edges: &[u32]) {
        self.counts.copy_from_slice(edges);
        for shown in self.shown.iter_mut().chain(&mut self.next) {
            shown.waiting = 0;
        }
        for hold in &mut self.holds {
            (hold.until, hold.next_until) = (Nanos(i64::MIN), Nanos(i64::MIN));
        }
        self.held.fill(0);
        self.busy = false;
    }

    /// Records that the receiver has seen the levels shaped or passed last.
    #[inline]
    pub fn confirm(&mut self) {
        self.confirm_words(|_| u64::MAX);
    }

    /// As [`confirm`](Self::confirm), for a receiver that has seen only these bits of the frame (bit n of
    /// byte k is 8k + n).
    pub fn confirm_bits(&mut self, bits: &Range<usize>) {
        self.confirm_words(|word| word.among(bits));
    }

    /// Confirms the bits of each word that `seen` returns.
    #[inline]
    fn confirm_words(&mut self, seen: impl Fn(&Word) -> u64) {
        if self.words.is_empty() {
            return;
        }
        let next = self.words.iter().zip(&self.next);
        for ((word, next), shown) in next.zip(&mut self.shown) {
            shown.merge(*next, seen(word));
        }
        for hold in &mut self.holds {
            if seen(&self.words[hold.word]) & hold.mask != 0 {
                hold.until = hold.next_until;
            }
        }
    }
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
        let mut counter = EdgeCounter::new(&bit(latch, Nanos::ZERO), &[0]);
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
        let mut counter = EdgeCounter::new(&bit(Latch::Rising, Nanos::ZERO), &[0]);
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
        let mut counter = EdgeCounter::new(&bit(Latch::Rising, hold), &[0]);
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
        let mut counter = EdgeCounter::new(&bit(Latch::Rising, Nanos::ZERO), &[0]);
        counter.counts[0] = u32::MAX;
        let mut shaper = PulseShaper::new(bit(Latch::Rising, Nanos::ZERO), &[0]);
        shaper.counts[0] = u32::MAX;
        counter.observe(&[1]);
        assert_eq!(shaper.new_edges(counter.counts()).collect::<Vec<_>>(), [1]);
    }

    /// Signals of a table: station, area, byte, bit, and whether it is latched.
    fn table(signals: &[(usize, Area, usize, u8, bool)]) -> SignalTable {
        use crate::signal::{DataType, Signal, Station};

        let station = || Station {
            name: String::new(),
            input_bytes: 8,
            output_bytes: 8,
            observed_bytes: 0,
        };
        let signals = signals
            .iter()
            .map(|&(station, area, byte, bit, latched)| Signal {
                station,
                bit,
                latch: latched.then_some(Latch::Rising),
                ..Signal::new("", area, byte, DataType::Bool)
            });
        SignalTable {
            stations: vec![station(), station()],
            signals: signals.collect(),
            structures: Vec::new(),
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
        let words = Word::all(&bits);
        let words: Vec<_> = words
            .iter()
            .map(|word| (word.byte, word.latched.to_le_bytes(), word.bits.clone()))
            .collect();
        assert_eq!(words, [(0, [0, 0, 65, 0, 0, 144, 0, 0], 0..4)]);
    }

    #[test]
    fn several_bits_of_one_byte_are_counted_and_shown_each_by_itself() {
        let signals: Vec<_> = [(3, 0), (1, 7), (3, 5), (1, 2)]
            .map(|(byte, bit)| (0, Area::Output, byte, bit, true))
            .into();
        let bits = latched_bits(&table(&signals), 0, Area::Output);
        let mut counter = EdgeCounter::new(&bits, &[0; 8]);
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
        let mut counter = EdgeCounter::new(&bit(Latch::Both, Nanos::ZERO), &[0]);
        counter.observe(&[0b1111_1110]);
        assert_eq!(counter.counts(), [0]);
    }
}
