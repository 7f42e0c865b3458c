//! The errors of this crate.

/// Why a connection or a serial port is not there: a text that says what failed and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Error(pub(crate) String);
