//! The common form of errors that an author can correct.

/// A mistake and its remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; {right}")]
pub struct Mistake {
    /// The mistake.
    pub what: String,
    /// The remedy.
    pub right: String,
}

impl Mistake {
    /// A mistake in these words.
    pub fn new(what: impl Into<String>, right: impl Into<String>) -> Self {
        let (what, right) = (what.into(), right.into());
        Self { what, right }
    }
}
