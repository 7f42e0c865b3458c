//! Who takes part in a run.

use std::num::NonZeroU32;
use std::ops::Range;

use crate::Variable;

/// Who takes part in a run, and what they write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Members {
    /// In the order of their names.
    pub clients: Vec<Client>,
    /// All variables, each client's together, those of the server's logic last. None before everyone has joined.
    pub variables: Vec<Variable>,
}

impl Members {
    /// The place of the client that writes a variable; the number of clients, if the server's logic does.
    pub fn writer(&self, variable: usize) -> usize {
        // Each client's stand together, in the order of the clients.
        self.clients
            .partition_point(|client| client.writes.end <= variable)
    }
}

/// A client of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Client {
    /// Its name.
    pub name: String,
    /// How many steps of the server one step of it takes.
    pub multiple: NonZeroU32,
    /// Which of the variables it writes.
    pub writes: Range<usize>,
}
