//! Why a run ends early.

use super::test::TextPosition;

/// The failure of a test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The position in the test file.
    pub place: TextPosition,
    /// The time, the expectation and the actual value, as one line.
    pub what: String,
    /// Further information, such as the last changes of the signal, one per line.
    pub more: Vec<String>,
}

/// Why a run ends before its last step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Halt {
    /// A step failed.
    Failed(Failure),
    /// The observer has seen enough.
    Over,
}

impl From<Failure> for Halt {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}
