//! The messages to and from the server, except for declarations and written values.

use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;

use crate::{Ended, MemberList, Outcome, Step};

/// A request to a running server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Begins no more steps.
    Pause,
    /// Runs this many steps, then pauses.
    Step(u64),
    /// Continues the run.
    Run,
    /// Saves the run after the current step to the file of [`Settings::save`](crate::Settings::save), and continues.
    Save,
    /// Ends the run after the current step; the server waits at most a second for clients to finish it.
    Stop,
}

/// A message of the server to one client.
#[derive(Clone, Debug, PartialEq)]
pub enum ToClient<'a> {
    /// Everyone has joined. The client answers with its initial values, as those of step 0.
    Start {
        /// The virtual time of one step of the server.
        step: Nanos,
        /// The types of the variables that the client reads, in the order of its declaration.
        reads: &'a [DataType],
    },
    /// The client runs, and answers with the values that it writes.
    Step {
        /// The step.
        step: Step,
        /// The values that the client reads, in the order of its declaration.
        reads: &'a [u64],
    },
    /// The server waits: for others to join or to answer, or it is paused; the text for people says for what, such as
    /// `"plc" to finish step 42`. Idle clients get this once a second, so that they can tell a waiting server from one
    /// that hangs.
    Waiting(&'a str),
    /// The clients are to exchange their values without the server: the client answers with the address where the others
    /// can connect, and with this token.
    Meet(u64),
    /// All clients, and the place of this one in their order: the client connects with the others, and answers if it
    /// could.
    Members(usize, &'a MemberList),
    /// The clients exchange their values without the server up to this step, inclusive. Sent before the start for the
    /// first time, with step 0. Without it, the server passes the values on.
    Until(u64),
    /// The client answers with its state after this step, or why it has none to give.
    Save(u64),
    /// The client takes over the state that it had after the step `sequence`, and answers with the values that it had
    /// written, as those of this step. Sent in place of a step.
    Restore {
        /// The step.
        sequence: u64,
        /// The values, in the order of its declaration.
        writes: &'a [u64],
        /// The state.
        state: &'a [u8],
    },
    /// The run has ended, or the client does not take part in it. No message follows.
    End(&'a Result<Outcome, Ended>),
}
