//! The replies that have work in a tick: those whose signals have changed, and those whose time has come. The others would
//! make what they have made, and a machine has hundreds of them.

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

/// The number of slots that are compared at once.
const BLOCK: usize = 16;

/// The replies that are awake, by their place in the order of a tick.
#[derive(Debug)]
pub(crate) struct Awake {
    /// By index of the signal: the replies that read or make it.
    watchers: Box<[Box<[usize]>]>,
    /// By index of the signal: the last of these. Most signals are read by no later reply, and need no look at the list.
    last: Box<[usize]>,
    /// The values at the end of the last tick.
    seen: Box<[Slot]>,
    /// One bit for each reply: in this tick, and in the next one.
    now: Box<[u64]>,
    next: Box<[u64]>,
    /// When each reply has work although no signal changes, and the earliest of these times of each 64 replies.
    due: Box<[Nanos]>,
    earliest: Box<[Nanos]>,
    /// The reply at work.
    current: usize,
    count: usize,
}

fn set(bits: &mut [u64], place: usize) {
    bits[place / 64] |= 1 << (place % 64);
}

impl Awake {
    /// `count` replies, of which all are awake in the first tick; for each signal, those that read or make it.
    pub(crate) fn new(count: usize, watchers: Vec<Vec<usize>>) -> Self {
        let signals = watchers.len();
        let bits = || vec![0; count.div_ceil(64)].into();
        let last = watchers.iter().map(|all| all.iter().copied().max());
        let mut awake = Self {
            last: last.map(Option::unwrap_or_default).collect(),
            watchers: watchers.into_iter().map(Vec::into_boxed_slice).collect(),
            seen: vec![Slot::default(); signals].into(),
            now: bits(),
            next: bits(),
            due: vec![Nanos::MAX; count].into(),
            earliest: vec![Nanos::MAX; count.div_ceil(64)].into(),
            current: 0,
            count,
        };
        awake.wake_all();
        awake
    }

    /// Wakes all replies for the next tick.
    pub(crate) fn wake_all(&mut self) {
        for place in 0..self.count {
            set(&mut self.next, place);
        }
    }

    /// Begins a tick that ends at `now`: wakes the replies whose time has come, and those whose signals have changed.
    pub(crate) fn begin(&mut self, now: Nanos, slots: &[Slot]) {
        std::mem::swap(&mut self.now, &mut self.next);
        self.next.fill(0);
        self.current = 0;
        for (word, due) in self.due.chunks_mut(64).enumerate() {
            if self.earliest[word] > now {
                continue;
            }
            let mut earliest = Nanos::MAX;
            for (place, due) in due.iter_mut().enumerate() {
                if *due <= now {
                    *due = Nanos::MAX;
                    self.now[word] |= 1 << place;
                }
                earliest = earliest.min(*due);
            }
            self.earliest[word] = earliest;
        }
        let blocks = slots.chunks(BLOCK).zip(self.seen.chunks(BLOCK));
        for (block, (slots, seen)) in blocks.enumerate() {
            let pairs = || slots.iter().zip(seen);
            if pairs().fold(0, |changes, (slot, seen)| changes | (slot.0 ^ seen.0)) == 0 {
                continue;
            }
            for (signal, (slot, seen)) in (block * BLOCK..).zip(pairs()) {
                if slot != seen {
                    for place in &self.watchers[signal] {
                        set(&mut self.now, *place);
                    }
                }
            }
        }
    }

    /// Takes the bits of the replies that are awake in this tick, among those from `64 * word` on.
    pub(crate) fn take(&mut self, word: usize) -> u64 {
        let bits = self.now[word];
        if bits != 0 {
            self.now[word] = 0;
        }
        bits
    }

    /// Says which reply is at work.
    pub(crate) fn begin_reply(&mut self, place: usize) {
        self.current = place;
    }

    /// Keeps replies awake for the next tick.
    pub(crate) fn stay(&mut self, word: usize, bits: u64) {
        self.next[word] |= bits;
    }

    /// Wakes a reply at this time, if no signal wakes it before.
    pub(crate) fn rest_until(&mut self, place: usize, due: Nanos) {
        self.due[place] = due;
        let earliest = &mut self.earliest[place / 64];
        *earliest = due.min(*earliest);
    }

    /// The reply at work has changed a signal: wakes those behind it that read the signal.
    #[inline]
    pub(crate) fn changed(&mut self, signal: usize) {
        if self.last[signal] <= self.current {
            return;
        }
        for place in &self.watchers[signal] {
            if *place > self.current {
                set(&mut self.now, *place);
            }
        }
    }

    /// Ends a tick.
    pub(crate) fn end(&mut self, slots: &[Slot]) {
        let count = self.seen.len();
        self.seen.copy_from_slice(&slots[..count]);
    }
}
