//! Why a call of another language failed.

use std::panic::{AssertUnwindSafe, catch_unwind};

use tickbus_base::statistics::entries;
use tickbus_driver::{Code, DriverError, Snapshot};

use crate::panics::panic_message;

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

    /// Of a tick that failed: with the line's own reason, which the statistics have, if it is the line that failed.
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

    /// What `work` returns; a panic in it is refused as `INTERNAL`.
    ///
    /// # Errors
    ///
    /// Those of `work`.
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
