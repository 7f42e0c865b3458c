//! Why a call of another language failed.

use tickbus_driver::{Code, DriverError};

/// A status code, and what happened. Shows as one text: the code's name and number, what happened, and in a second line what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The code that the caller gets.
    pub code: Code,
    what: String,
}

impl Refusal {
    /// With the status table's own description.
    pub fn plain(code: Code) -> Self {
        Self::new(code, code.text())
    }

    /// With a description of its own; the remedy is the status table's.
    pub fn new(code: Code, what: impl std::fmt::Display) -> Self {
        let what = what.to_string();
        Self { code, what }
    }
}

impl From<DriverError> for Refusal {
    fn from(error: DriverError) -> Self {
        Self::new(error.code(), error)
    }
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (name, code) = (self.code.name(), self.code.code());
        write!(
            f,
            "{name} ({code}): {}\n  {}",
            self.what,
            self.code.remedy()
        )
    }
}

impl std::error::Error for Refusal {}
