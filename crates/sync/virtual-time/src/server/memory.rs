//! All commits of a run, from which a member that comes back gets what it had read.

use std::ops::Range;

use crate::barrier::Barrier;

/// The most bytes that are kept; a longer run goes on, and no member of it can come back.
const MOST: usize = if cfg!(test) { 2000 } else { 64 << 20 };

/// The bits of a word.
const BITS: usize = u64::BITS as usize;

/// The commits of a run, as changes. Commits without a due client or a change are left out.
#[derive(Debug, Default)]
pub(super) struct Memory {
    /// The number of each commit, and the number of changes up to its end.
    commits: Vec<(u64, usize)>,
    /// The variables that changed, and their new values.
    changed: Vec<u32>,
    values: Vec<u64>,
    /// Per commit, a bit for each client that was due.
    due: Vec<u64>,
    words: usize,
    last: Vec<u64>,
}

/// A place in the memory, from which a member is asked again.
#[derive(Debug)]
pub(super) struct Place {
    commit: usize,
    /// The committed values before this commit.
    values: Vec<u64>,
}

impl Memory {
    /// Adds the commit of the step whose due clients the barrier still has; its values come by
    /// [`commit`](Self::commit).
    pub(super) fn note_due(&mut self, barrier: &Barrier<'_>) {
        self.words = barrier.members().clients.len().div_ceil(BITS);
        let from = self.due.len();
        self.due.resize(from + self.words, 0);
        for client in barrier.due() {
            self.due[from + client / BITS] |= 1 << (client % BITS);
        }
    }

    /// Completes the commit; false if there is no room for it.
    pub(super) fn commit(&mut self, sequence: u64, values: &[u64]) -> bool {
        self.last.resize(values.len(), 0);
        let before = self.changed.len();
        for (at, (value, last)) in values.iter().zip(&mut self.last).enumerate() {
            if value != last {
                *last = *value;
                self.changed
                    .push(u32::try_from(at).expect("fewer variables than that"));
                self.values.push(*value);
            }
        }
        let from = self.due.len() - self.words;
        if before == self.changed.len() && self.due[from..].iter().all(|word| *word == 0) {
            self.due.truncate(from);
            return true;
        }
        self.commits.push((sequence, self.changed.len()));
        self.bytes() <= MOST
    }

    fn bytes(&self) -> usize {
        16 * self.commits.len() + 4 * self.changed.len() + 8 * (self.values.len() + self.due.len())
    }

    /// The place before the first commit.
    pub(super) fn start(&self) -> Place {
        Place {
            commit: 0,
            values: vec![0; self.last.len()],
        }
    }

    /// Moves on to the next commit for which this client was due, and returns its number; `None` if none is left.
    pub(super) fn next(&self, place: &mut Place, client: usize) -> Option<u64> {
        while let Some((sequence, _)) = self.commits.get(place.commit) {
            let word = self.due[place.commit * self.words + client / BITS];
            if word >> (client % BITS) & 1 == 1 {
                return Some(*sequence);
            }
            self.pass(place);
        }
        None
    }

    /// Passes the commit at `place`.
    pub(super) fn pass(&self, place: &mut Place) {
        let begin = place
            .commit
            .checked_sub(1)
            .map_or(0, |before| self.commits[before].1);
        let changes = begin..self.commits[place.commit].1;
        let values = &self.values[changes.clone()];
        for (at, value) in self.changed[changes].iter().zip(values) {
            place.values[*at as usize] = *value;
        }
        place.commit += 1;
    }
}

impl Place {
    /// The values that a client with these reads had before the commit.
    pub(super) fn read(&self, reads: &[u32], into: &mut Vec<u64>) {
        into.clear();
        into.extend(reads.iter().map(|at| self.values[*at as usize]));
    }

    /// The values of these variables.
    pub(super) fn of(&self, range: Range<usize>) -> &[u64] {
        &self.values[range]
    }
}
