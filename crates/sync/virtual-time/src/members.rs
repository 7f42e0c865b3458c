//! The participants of a run.

use std::num::NonZeroU32;
use std::ops::Range;

use tickbus_base::time::Nanos;

use crate::Variable;

/// The participants of a run, and the variables that they write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Members {
    /// The clients in the order of their names.
    pub clients: Vec<Client>,
    /// All variables, grouped by client, those of the server's logic last. Empty before everyone has joined.
    pub variables: Vec<Variable>,
}

impl Members {
    /// The index of the client that writes a variable; the number of clients if the server's logic writes it.
    pub fn writer(&self, variable: usize) -> usize {
        // The variables of each client are adjacent, in the order of the clients.
        self.clients
            .partition_point(|client| client.writes.end <= variable)
    }
}

/// A client of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Client {
    /// The name.
    pub name: String,
    /// The number of server steps per step of this client.
    pub multiple: NonZeroU32,
    /// The virtual time of one step of this client, in place of the multiple; `None` if it is a whole number of steps.
    pub interval: Option<Nanos>,
    /// The range of its variables.
    pub writes: Range<usize>,
}
