//! The messages between host and helper, in the frames of isolated plug-ins.

use serde::{Deserialize, Serialize};
use tickbus_net::Message;

use super::slave::{Failure, Setup, Stepped};
use super::target::Target;
use crate::value::Value;

/// The most bytes of a message: enough for a hundred thousand variables and their names.
const MOST: usize = 64 << 20;

/// A message from the host.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Request {
    /// Load the library and begin a run. Sent first.
    Open {
        setup: Box<Setup>,
        inputs: Vec<Value>,
    },
    /// Do one step.
    Step {
        inputs: Vec<Value>,
        from: f64,
        length: f64,
    },
    /// Set a variable, and answer with the value that it had.
    Change { variable: Target, value: Value },
    /// End the run.
    End,
}

/// A message from the helper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Answer {
    /// The run has begun, or the step is done; carries the outputs. Or a variable is set; carries its former value.
    Outputs {
        outputs: Vec<Value>,
        stepped: Stepped,
    },
    /// The run has ended.
    Ended,
    /// The FMU does not continue.
    Failed(Failure),
}

impl Message for Request {
    const MOST: usize = MOST;
}

impl Message for Answer {
    const MOST: usize = MOST;
}
