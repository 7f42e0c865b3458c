//! The meaning of an error code for a transfer of data.

use tickbus_fieldbus::{BusError, Failing, Meaning, Verdict};

pub(crate) enum Answer {
    Moved,
    Again(&'static Meaning),
    NoPeer(&'static str),
}

impl Answer {
    /// The answer for `code` with this meaning; the error of `failing` if the card has to be opened again.
    pub(crate) fn of(
        code: i32,
        meaning: Option<&'static Meaning>,
        failing: impl FnOnce() -> Failing,
    ) -> Result<Self, BusError> {
        match meaning {
            _ if code == 0 => Ok(Self::Moved),
            Some(Meaning {
                verdict: Verdict::NoPeer,
                words,
                ..
            }) => Ok(Self::NoPeer(words)),
            Some(meaning) if meaning.verdict == Verdict::Again => Ok(Self::Again(meaning)),
            _ => Err(failing().error()),
        }
    }
}
