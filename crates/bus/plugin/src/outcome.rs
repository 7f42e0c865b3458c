//! The meaning of the numbers that a library returns.

use serde::{Deserialize, Serialize};

use super::abi::{error, flag};
use tickbus_fieldbus::{BusError, Exchanged};

/// The result of an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u8")]
pub struct Outcome(u8);

impl Outcome {
    /// Nothing was heard from the peer.
    pub const NOTHING: Self = Self(0);

    /// The outcome with this combination of flags, if valid.
    pub fn from_code(code: i32) -> Option<Self> {
        let known = 0..=flag::TAKEN + flag::FRESH + flag::ALIVE;
        known
            .contains(&code)
            .then(|| Self(u8::try_from(code).expect("below 8")))
    }

    /// The peer has the bytes of this exchange.
    pub fn is_taken(self) -> bool {
        i32::from(self.0) & flag::TAKEN != 0
    }

    /// A new whole image has arrived.
    pub fn is_fresh(self) -> bool {
        i32::from(self.0) & flag::FRESH != 0
    }

    /// The peer gave any sign of life.
    pub fn is_alive(self) -> bool {
        self != Self::NOTHING
    }

    /// The result for the port.
    pub(super) fn exchanged(self) -> Exchanged {
        Exchanged::Data {
            is_taken: self.is_taken(),
            is_fresh: self.is_fresh(),
            is_alive: self.is_alive(),
        }
    }
}

impl TryFrom<u8> for Outcome {
    type Error = &'static str;

    fn try_from(code: u8) -> Result<Self, Self::Error> {
        Self::from_code(code.into()).ok_or("unknown flags")
    }
}

/// The function that failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Open,
    Exchange,
}

impl Function {
    const fn name(self) -> &'static str {
        match self {
            Self::Open => "tickbus_open",
            Self::Exchange => "tickbus_exchange",
        }
    }
}

/// The error for `code` of the library called `name`, with the library's own `text`.
pub(super) fn failure(name: &str, function: Function, code: i32, text: Option<&str>) -> BusError {
    let (kind, symbol, silent): (fn(String) -> BusError, _, _) = match code {
        error::LINK => (BusError::Link, "LINK", "check card, cable and peer"),
        error::PROTOCOL => (
            BusError::Protocol,
            "PROTOCOL",
            "check that the peer is of the right kind",
        ),
        error::REFUSED => (
            BusError::Refused,
            "REFUSED",
            "check how the peer is configured",
        ),
        error::CONFIG => (
            BusError::Refused,
            "CONFIG",
            "check `options` in the driver.cfg",
        ),
        error::UNSUPPORTED => (
            BusError::Refused,
            "UNSUPPORTED",
            "check role, sizes and number of stations",
        ),
        error::LEFT => (BusError::Left, "LEFT", "check why it ended"),
        _ => {
            let text = text.map(|text| format!(" ({text})")).unwrap_or_default();
            return BusError::Protocol(format!(
                "{name}: {} returned {code}{text}, which include/tickbus_fieldbus.h does not know; this is a \
                 mistake of the library, or it needs a newer tickbus",
                function.name(),
            ));
        }
    };
    kind(match text {
        Some(text) => format!("{name}: {text}"),
        None => format!(
            "{name}: {} returned TICKBUS_E_{symbol} ({code}) and gave no reason; {silent}",
            function.name()
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sum_of_flags_is_an_outcome_and_nothing_else_is() {
        for code in 0..8 {
            let outcome = Outcome::from_code(code).expect("a sum of flags");
            assert_eq!(i32::from(outcome.0), code);
            assert_eq!(outcome.is_alive(), code != 0);
        }
        for code in [i32::MIN, -7, -1, 8, 64, i32::MAX] {
            assert_eq!(Outcome::from_code(code), None, "{code}");
        }
    }

    #[test]
    fn each_error_says_whose_fault_it_is_and_keeps_the_librarys_words() {
        let fail = |code, text| failure("libx.so", Function::Exchange, code, text);
        let with_words = |kind: fn(String) -> BusError| kind("libx.so: no cable".to_owned());
        for (code, kind) in [
            (error::LINK, BusError::Link as fn(String) -> BusError),
            (error::PROTOCOL, BusError::Protocol),
            (error::REFUSED, BusError::Refused),
            (error::CONFIG, BusError::Refused),
            (error::UNSUPPORTED, BusError::Refused),
            (error::LEFT, BusError::Left),
        ] {
            assert_eq!(fail(code, Some("no cable")), with_words(kind), "{code}");
            let silent = fail(code, None).to_string();
            assert!(
                silent.contains(&format!("({code}) and gave no reason; check")),
                "{silent}"
            );
        }
        let unknown = fail(64, None);
        assert!(matches!(&unknown, BusError::Protocol(text) if text.contains("returned 64,")));
    }
}
