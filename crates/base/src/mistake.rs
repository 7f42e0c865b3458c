//! The one form of errors that an author can correct.

/// What is wrong, and what would be right.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; {right}")]
pub struct Mistake {
    /// What is wrong.
    pub what: String,
    /// What would be right.
    pub right: String,
}

impl Mistake {
    /// A mistake in these words.
    pub fn new(what: impl Into<String>, right: impl Into<String>) -> Self {
        let (what, right) = (what.into(), right.into());
        Self { what, right }
    }
}
