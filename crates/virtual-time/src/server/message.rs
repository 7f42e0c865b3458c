//! What goes into the server and out of it, apart from what clients declare and write.

use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;

use crate::{Ended, Outcome, Step};

/// What a server may be asked to do while it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Begins no more steps.
    Pause,
    /// Runs this many steps, and then pauses.
    Step(u64),
    /// Runs on.
    Run,
    /// Ends the run after the step that is under way; a client that does not finish it within a second is not waited for.
    Stop,
}

/// A message of the server to one client.
#[derive(Clone, Debug, PartialEq)]
pub enum ToClient<'a> {
    /// Everyone has joined. The client answers with its initial values, as those of step 0.
    Start {
        /// The virtual time of one step of the server.
        step: Nanos,
        /// The types of the variables that it reads, in the order of its declaration.
        reads: &'a [DataType],
    },
    /// The client runs, and answers with what it writes.
    Step {
        /// The step.
        step: Step,
        /// What it reads, in the order of its declaration.
        reads: &'a [u64],
    },
    /// The run goes on without this client for now: others have to join or to answer, or it is paused. For a client that has
    /// nothing to do, once a second, so that it can tell a server that waits from one that hangs.
    Waiting,
    /// The run has ended, or the client does not take part in it. Nothing follows.
    End(&'a Result<Outcome, Ended>),
}
