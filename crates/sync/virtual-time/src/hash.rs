//! The trace hash, which shows if two runs were the same.

use std::fmt;
use std::hash::Hasher as _;

use serde::{Deserialize, Serialize};
use siphasher::sip::SipHasher24;

use crate::{Declaration, Step, Variable};

/// The hash over all commits of a run: equal for runs that are equal to the last bit.
///
/// The algorithm is SipHash-2-4 with a key of zeros, over the stream that docs/sdsp.md describes. Other programs can
/// compute the hash from their own trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TraceHash(pub u64);

impl fmt::Display for TraceHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// Hashes a run in progress; allocates nothing.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trace(SipHasher24);

impl Trace {
    /// The hash of a run without commits: of the server's step, of the clients in their order, and of the variables
    /// that the server's logic writes.
    pub fn new(step: i64, clients: &[Declaration], logic: &[Variable]) -> Self {
        let mut trace = Self(SipHasher24::new());
        trace.word(step.cast_unsigned());
        trace.word(clients.len() as u64);
        for client in clients {
            trace.text(&client.name);
            // A multiple is never 0.
            match client.interval {
                None => trace.word(client.multiple.get().into()),
                Some(interval) => {
                    trace.word(0);
                    trace.word(interval.0.cast_unsigned());
                }
            }
            trace.variables(&client.writes);
        }
        trace.variables(logic);
        trace
    }

    /// Reads a trace that was saved; `None` if these bytes are no state of the hash.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        // Key, length, state, and the bytes of the last word that is not complete.
        type Fields = (u64, u64, u64, [u64; 4], u64, u64);
        let (k0, k1, length, _, tail, count): Fields = postcard::from_bytes(bytes).ok()?;
        let is_state = (k0, k1, count) == (0, 0, length % 8) && tail >> (8 * count) == 0;
        let trace: Self = postcard::from_bytes(bytes).ok()?;
        is_state.then_some(trace)
    }

    /// Adds a commit: all variables with their new values, changed or not.
    pub fn commit(&mut self, step: Step, values: &[u64]) {
        self.word(step.sequence);
        self.word(step.time.0.cast_unsigned());
        for value in values {
            self.word(*value);
        }
    }

    /// The hash so far.
    pub fn hash(&self) -> TraceHash {
        TraceHash(self.0.finish())
    }

    fn variables(&mut self, variables: &[Variable]) {
        self.word(variables.len() as u64);
        for variable in variables {
            self.text(&variable.name);
            self.text(variable.data_type.name());
        }
    }

    fn text(&mut self, text: &str) {
        self.word(text.len() as u64);
        self.0.write(text.as_bytes());
    }

    fn word(&mut self, word: u64) {
        self.0.write(&word.to_le_bytes());
    }
}
