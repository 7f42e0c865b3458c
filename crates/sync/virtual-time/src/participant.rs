//! The interface that every client implements.

use tickbus_base::time::Nanos;

use crate::Declaration;

/// One step of virtual time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// The number of the server's step, from 1. A client with a multiple sees only some of them.
    pub sequence: u64,
    /// The virtual time of this step; that of the first is 0.
    pub time: Nanos,
}

/// A client, which runs in this process, over TCP or through shared memory without knowing which.
pub trait Participant {
    /// The variables that the client writes and reads. Called once, before the run.
    fn declare(&self) -> Declaration;

    /// Fills in the values before the first step, one slot per variable of [`Declaration::writes`]; all are 0 at first.
    fn initial(&mut self, writes: &mut [u64]);

    /// Runs one step.
    ///
    /// `reads` has a slot per variable of [`Declaration::reads`], from the snapshot that all clients of the step see:
    /// values that others write in this step appear in the next one. `writes` still holds the last written values.
    /// Slots hold raw values; see [`is_raw`](crate::is_raw).
    ///
    /// # Errors
    ///
    /// The reason why the client cannot continue; this ends the run for everyone.
    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String>;
}
