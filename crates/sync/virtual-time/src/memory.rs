//! All commits of a run, from which a member that runs its steps again gets what it had read.

use std::ops::Range;

use crate::bytes::Reader;

/// The most bytes that are kept for members that come back; in a longer run none can.
pub(crate) const MOST: usize = if cfg!(test) { 2000 } else { 64 << 20 };

/// The most bytes that are kept for a run that is to be saved.
pub(crate) const MOST_SAVED: usize = if cfg!(test) { 4000 } else { 256 << 20 };

/// The bits of a word.
const BITS: usize = u64::BITS as usize;

/// The commits of a run, as changes. Commits without a due client or a change are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Memory {
    /// The number of each commit, and the number of changes up to its end.
    commits: Vec<(u64, usize)>,
    /// The variables that changed, and their new values.
    changed: Vec<u32>,
    values: Vec<u64>,
    /// Per commit, a bit for each client that was due.
    due: Vec<u64>,
    /// The number of words per commit in `due`.
    words: usize,
    last: Vec<u64>,
}

/// A place in the memory, from which a member is asked again.
#[derive(Debug)]
pub(crate) struct Place {
    commit: usize,
    /// The committed values before this commit.
    values: Vec<u64>,
}

impl Memory {
    /// Adds the commit of the step in which these of `clients` clients were due; its values come by
    /// [`commit`](Self::commit).
    pub(crate) fn note_due(&mut self, clients: usize, due: impl Iterator<Item = usize>) {
        self.words = clients.div_ceil(BITS);
        let from = self.due.len();
        self.due.resize(from + self.words, 0);
        for client in due {
            self.due[from + client / BITS] |= 1 << (client % BITS);
        }
    }

    /// Completes the commit.
    pub(crate) fn commit(&mut self, sequence: u64, values: &[u64]) {
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
            return;
        }
        self.commits.push((sequence, self.changed.len()));
    }

    /// The size in bytes.
    pub(crate) fn bytes(&self) -> usize {
        16 * self.commits.len() + 4 * self.changed.len() + 8 * (self.values.len() + self.due.len())
    }

    /// The place before the first commit.
    pub(crate) fn start(&self) -> Place {
        Place {
            commit: 0,
            values: vec![0; self.last.len()],
        }
    }

    /// The number of the commit at `place`; `None` behind the last one.
    pub(crate) fn number(&self, place: &Place) -> Option<u64> {
        self.commits
            .get(place.commit)
            .map(|(sequence, _)| *sequence)
    }

    /// Moves on to the next commit for which this client was due, and returns its number; `None` if none is left.
    pub(crate) fn next(&self, place: &mut Place, client: usize) -> Option<u64> {
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
    pub(crate) fn pass(&self, place: &mut Place) {
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

    /// Appends the memory to a file: 8 bytes number of commits, and for each 8 bytes its step and 8 bytes the number of
    /// changes up to its end; the bits of the clients that were due; per change 8 bytes value, then per change 4 bytes
    /// variable.
    pub(crate) fn write(&self, out: &mut Vec<u8>) {
        let word = |out: &mut Vec<u8>, word: u64| out.extend_from_slice(&word.to_le_bytes());
        word(out, self.commits.len() as u64);
        for (sequence, changes) in &self.commits {
            word(out, *sequence);
            word(out, *changes as u64);
        }
        crate::bytes::slots(out, &self.due);
        crate::bytes::slots(out, &self.values);
        for at in &self.changed {
            out.extend_from_slice(&at.to_le_bytes());
        }
    }

    /// Reads a memory of this many clients and variables that ends with the step `last`.
    ///
    /// # Errors
    ///
    /// It contradicts itself.
    pub(crate) fn read(
        reader: &mut Reader<'_>,
        (clients, variables): (usize, usize),
        last: u64,
    ) -> Result<Self, String> {
        let count = reader.word()?;
        let mut commits: Vec<(u64, usize)> = Vec::new();
        let mut pairs = reader.words(count.saturating_mul(2))?.iter();
        while let (Some(sequence), Some(changes)) = (pairs.next(), pairs.next()) {
            let changes = usize::try_from(changes).unwrap_or(usize::MAX);
            let is_next = match commits.last() {
                Some(before) => sequence > before.0 && changes >= before.1,
                None => true,
            };
            if !is_next || sequence > last {
                return Err(format!("its commit of step {sequence} is out of order"));
            }
            commits.push((sequence, changes));
        }
        if commits.first().is_none_or(|(sequence, _)| *sequence != 0) {
            return Err("it has no initial values".to_owned());
        }
        let words = clients.div_ceil(BITS);
        let due = reader.words(count.saturating_mul(words as u64))?;
        let changes = commits.last().map_or(0, |(_, changes)| *changes) as u64;
        let values: Vec<u64> = reader.words(changes)?.iter().collect();
        let mut memory = Self {
            commits,
            changed: Vec::new(),
            values,
            due: due.iter().collect(),
            words,
            last: vec![0; variables],
        };
        for value in &memory.values {
            let at = reader.half()?;
            let Some(last) = memory.last.get_mut(at as usize) else {
                return Err(format!("it changes variable {at} of {variables}"));
            };
            *last = *value;
            memory.changed.push(at);
        }
        let sent = |client: usize| memory.due[client / BITS] >> (client % BITS) & 1 == 1;
        if !(0..clients).all(sent) {
            return Err("a client has sent no initial values".to_owned());
        }
        Ok(memory)
    }
}

impl Place {
    /// The values that a client with these reads had before the commit.
    pub(crate) fn read(&self, reads: &[u32], into: &mut Vec<u64>) {
        into.clear();
        into.extend(reads.iter().map(|at| self.values[*at as usize]));
    }

    /// The values of these variables.
    pub(crate) fn of(&self, range: Range<usize>) -> &[u64] {
        &self.values[range]
    }

    /// The values of all variables.
    pub(crate) fn values(&self) -> &[u64] {
        &self.values
    }
}
