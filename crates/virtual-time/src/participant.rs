//! What every client implements.

use tickbus_base::time::Nanos;

use crate::Declaration;

/// One step of virtual time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Counts the steps of the server, from 1. A client with a multiple sees some of them only.
    pub sequence: u64,
    /// The virtual time of this step; that of the first is 0.
    pub time: Nanos,
}

/// A client: it runs in this process, over TCP or through shared memory, without knowing which.
pub trait Participant {
    /// What it writes and reads. Asked once, before the run.
    fn declare(&self) -> Declaration;

    /// The values before the first step, one slot per variable of [`Declaration::writes`]; they are 0 at first.
    fn initial(&mut self, writes: &mut [u64]);

    /// Runs one step.
    ///
    /// `reads` has a slot per variable of [`Declaration::reads`], from the snapshot that all clients of the step see:
    /// what others write in this step comes with the next one. `writes` still holds what was written last. Slots hold
    /// raw values; [`is_raw`](crate::is_raw) tells how.
    ///
    /// # Errors
    ///
    /// Why it cannot go on; this ends the run for everyone.
    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String>;
}
