//! Changes that are swallowed: a signal changes and changes back before the other side takes a frame.
//!
//! A frame passes several stages on its way: the simulation's tick, the bus, the peer. At each of them a newer frame can
//! replace an older one, and the next stage never sees the older one. Each stage counts the changes with which a signal
//! *returns* to the value that the next stage took last. If a BOOL changes n times between two frames that the other side
//! takes, n / 2 (rounded down) of its pulses are swallowed. The stages together count exactly that: an even number of
//! changes at one stage is invisible to the next one, and an odd number looks like a single change.
//!
//! 64 BOOLs are compared at a time, and only where a frame is handed over because something has changed.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::word::{among, word_at};
use crate::signal::{Area, SignalTable};

/// A signal whose swallowed changes are counted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Counted {
    /// Position of the signal in the signal table.
    pub signal: usize,
    /// The signal's bits in the frame: bit n of byte k is 8k + n.
    pub bits: Range<usize>,
}

/// The signals of one frame whose swallowed changes are counted: every BOOL without a latch, and what says
/// `count_swallowed = true`.
pub fn counted_signals(table: &SignalTable, station: usize, area: Area) -> Box<[Counted]> {
    let signals = table.signals.iter().enumerate();
    let counted = signals.filter(|(_, signal)| {
        signal.station == station && signal.area == area && signal.counts_swallowed()
    });
    let counted = counted.map(|(index, signal)| Counted {
        signal: index,
        bits: signal.address().bits(),
    });
    counted.collect()
}

/// Per signal of a table, how many of its changes were swallowed; readable at any time and from any thread.
#[derive(Clone, Debug)]
pub struct Swallowed(Arc<Counts>);

#[derive(Debug)]
struct Counts {
    signals: Box<[AtomicU64]>,
    all: AtomicU64,
}

impl Swallowed {
    /// Counts from zero, for a table of this many signals.
    pub fn new(signals: usize) -> Self {
        Self(Arc::new(Counts {
            signals: (0..signals).map(|_| AtomicU64::new(0)).collect(),
            all: AtomicU64::new(0),
        }))
    }

    /// Returns how often the signal with this index in the signal table changed and changed back unseen.
    ///
    /// # Panics
    ///
    /// If the table has no such signal.
    pub fn of(&self, signal: usize) -> u64 {
        self.0.signals[signal].load(Ordering::Relaxed)
    }

    /// Returns how often that happened, over all signals.
    pub fn of_all(&self) -> u64 {
        self.0.all.load(Ordering::Relaxed)
    }

    /// Returns the signals with swallowed changes, and their numbers.
    pub fn iter(&self) -> impl Iterator<Item = (usize, u64)> {
        let signals = self.0.signals.iter();
        let counts = signals.map(|count| count.load(Ordering::Relaxed));
        counts.enumerate().filter(|(_, count)| *count > 0)
    }

    /// Counts the signals of these bits.
    #[inline(never)]
    fn add_all(&self, signals: &[usize; 64], mut bits: u64) {
        while bits != 0 {
            self.add(signals[bits.trailing_zeros() as usize % 64]);
            bits &= bits - 1;
        }
    }

    #[inline]
    fn add(&self, signal: usize) {
        self.0.signals[signal].fetch_add(1, Ordering::Relaxed);
        self.0.all.fetch_add(1, Ordering::Relaxed);
    }
}

/// Eight bytes of a frame with counted signals.
#[derive(Clone, Debug)]
struct Word {
    /// The first of its bytes.
    byte: usize,
    /// The counted BOOLs.
    bools: u64,
    /// The levels seen last, and those that the next stage took last.
    last: u64,
    taken: u64,
}

/// A counted signal of several bits: the words that it is in, and its bits there.
#[derive(Clone, Debug)]
struct Number {
    signal: usize,
    parts: Box<[(usize, u64)]>,
}

/// Counts the swallowed changes of one frame at one stage of its way.
#[derive(Debug)]
pub(crate) struct Returns {
    words: Box<[Word]>,
    /// Per word and bit, the BOOL's signal.
    signals: Box<[[usize; 64]]>,
    numbers: Box<[Number]>,
    /// The next stage has taken the levels seen last.
    is_taken: bool,
    counts: Swallowed,
}

impl Returns {
    /// A stage that has seen `initial`, as the next stage has.
    pub(crate) fn new(counted: &[Counted], initial: &[u8], counts: &Swallowed) -> Self {
        let touched = |bits: &Range<usize>| bits.start / 64..=(bits.end - 1) / 64;
        let mut bytes: Vec<usize> = counted.iter().flat_map(|one| touched(&one.bits)).collect();
        bytes.sort_unstable();
        bytes.dedup();
        let words = bytes.iter().map(|word| {
            let levels = word_at(initial, word * 8);
            Word {
                byte: word * 8,
                bools: 0,
                last: levels,
                taken: levels,
            }
        });
        let mut words: Box<[Word]> = words.collect();
        let mut signals: Box<[[usize; 64]]> = words.iter().map(|_| [0; 64]).collect();
        let mut numbers = Vec::new();
        for Counted { signal, bits } in counted {
            let of_it = words.iter_mut().enumerate();
            let parts = of_it.filter_map(|(index, word)| {
                let mask = among(word.byte, bits);
                (mask != 0).then_some((index, mask))
            });
            let parts: Box<[(usize, u64)]> = parts.collect();
            if let ([(index, mask)], 1) = (&*parts, bits.len()) {
                words[*index].bools |= mask;
                signals[*index][bits.start % 64] = *signal;
            } else {
                let signal = *signal;
                numbers.push(Number { signal, parts });
            }
        }
        Self {
            words,
            signals,
            numbers: numbers.into(),
            is_taken: true,
            counts: counts.clone(),
        }
    }

    /// Returns true if no signal is counted.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Sees the next frame. Signals that return to what the next stage took last are counted if `counts` says so.
    #[inline]
    pub(crate) fn observe(&mut self, bytes: &[u8], counts: impl Fn() -> bool) {
        self.observe_words(|byte| word_at(bytes, byte), counts);
    }

    /// As [`observe`](Self::observe), for a frame of up to eight bytes as a number, the least significant byte first.
    #[inline]
    pub(crate) fn observe_word(&mut self, word: u64, counts: impl Fn() -> bool) {
        self.observe_words(|_| word, counts);
    }

    #[inline]
    fn observe_words(&mut self, word_at: impl Fn(usize) -> u64, counts: impl Fn() -> bool) {
        if std::mem::take(&mut self.is_taken) {
            // The first change after that returns to nothing.
            for word in &mut self.words {
                word.taken = word.last;
                word.last = word_at(word.byte);
            }
            return;
        }
        if !self.numbers.is_empty() && counts() {
            self.count_numbers(&word_at, |word| word.last, |word| word.taken);
        }
        for (word, signals) in self.words.iter_mut().zip(&self.signals) {
            let now = word_at(word.byte);
            let returned = (now ^ word.last) & !(now ^ word.taken) & word.bools;
            word.last = now;
            if returned != 0 && counts() {
                self.counts.add_all(signals, returned);
            }
        }
    }

    /// Counts the signals that return from `old` to the frame seen last with `new`, a frame that never came here: the
    /// stage before has replaced `old`.
    #[cold]
    pub(crate) fn replaced(&self, old: &[u8], new: &[u8]) {
        for (word, signals) in self.words.iter().zip(&self.signals) {
            let [before, now] = [old, new].map(|bytes| word_at(bytes, word.byte));
            let returned = (now ^ before) & !(now ^ word.last) & word.bools;
            self.counts.add_all(signals, returned);
        }
        let before = |word: &Word| word_at(old, word.byte);
        self.count_numbers(|byte| word_at(new, byte), before, |word| word.last);
    }

    /// Counts the numbers that changed from `last` and now are as in `taken`.
    #[inline(never)]
    fn count_numbers(
        &self,
        word_at: impl Fn(usize) -> u64,
        last: impl Fn(&Word) -> u64,
        taken: impl Fn(&Word) -> u64,
    ) {
        for Number { signal, parts } in &self.numbers {
            let (mut changed, mut differs) = (0, 0);
            for (index, mask) in parts {
                let word = &self.words[*index];
                let now = word_at(word.byte);
                changed |= (now ^ last(word)) & mask;
                differs |= (now ^ taken(word)) & mask;
            }
            if changed != 0 && differs == 0 {
                self.counts.add(*signal);
            }
        }
    }

    /// Sees a frame whose changes do not count.
    pub(crate) fn pass(&mut self, bytes: &[u8]) {
        for word in &mut self.words {
            word.last = word_at(bytes, word.byte);
        }
        self.is_taken = true;
    }

    /// The next stage has taken the frame seen last.
    #[inline]
    pub(crate) fn taken(&mut self) {
        self.is_taken = true;
    }

    /// As [`taken`](Self::taken), for a stage that has taken only these bits of the frame.
    pub(crate) fn taken_bits(&mut self, bits: &Range<usize>) {
        for word in &mut self.words {
            let seen = among(word.byte, bits);
            word.taken = word.taken & !seen | word.last & seen;
        }
    }
}
