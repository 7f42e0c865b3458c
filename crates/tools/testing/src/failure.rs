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
    /// The `hint` of the step whose condition failed: what is missing in the program, in the words of the test file.
    pub hint: Option<String>,
}

impl Failure {
    /// The same with the hint of a step, unless it has one.
    pub(super) fn hinted(mut self, hint: Option<&str>) -> Self {
        self.hint = self.hint.or_else(|| hint.map(str::to_owned));
        self
    }
}

/// Why a run ends before its last step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Halt {
    /// A step failed.
    Failed(Failure),
    /// The observer has seen enough.
    Over,
}

impl Halt {
    /// The same with the hint of a step; see [`Failure::hinted`].
    pub(super) fn hinted(self, hint: Option<&str>) -> Self {
        match self {
            Self::Failed(failure) => Self::Failed(failure.hinted(hint)),
            Self::Over => Self::Over,
        }
    }
}

impl From<Failure> for Halt {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}
