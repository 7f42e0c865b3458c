//! The reasons why calls from another language failed.

use std::panic::{AssertUnwindSafe, catch_unwind};

use tickbus_base::statistics::entries;
use tickbus_driver::{Code, DriverError, Snapshot};

use crate::panics::panic_message;

/// A status code, and what happened. Displayed as one text: the code's name and number, what happened, and in a second
/// line what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The code that the caller gets.
    pub code: Code,
    what: String,
}

impl Refusal {
    /// A refusal with the status table's description.
    pub fn plain(code: Code) -> Self {
        Self::new(code, code.text())
    }

    /// A refusal with a separate description; the remedy is the status table's.
    pub fn new(code: Code, what: impl std::fmt::Display) -> Self {
        let what = what.to_string();
        Self { code, what }
    }

    /// The refusal of a tick that failed. If the line failed, the description is the line's reason from the statistics.
    pub fn of_tick(code: Code, snapshot: &Snapshot) -> Self {
        if code != Code::BusFailed {
            return Self::plain(code);
        }
        let statistics = snapshot.to_string();
        let reason = entries(&statistics).find_map(|(key, text)| (key == "reason").then_some(text));
        match reason.filter(|reason| !reason.is_empty()) {
            Some(reason) => Self::new(code, format!("{}: {reason}", code.text())),
            None => Self::plain(code),
        }
    }

    /// Returns the result of `work`; a panic in `work` becomes the refusal `INTERNAL`.
    ///
    /// # Errors
    ///
    /// The errors of `work`.
    pub fn instead_of_panic<R>(work: impl FnOnce() -> Result<R, Self>) -> Result<R, Self> {
        catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
            let text = format!("panic: {}", panic_message(payload));
            Err(Self::new(Code::Internal, text))
        })
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
