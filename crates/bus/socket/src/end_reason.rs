//! Why a connection ends, in words.

use std::fmt;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::BusError;
use tickbus_net::IS_BROWSER;

use super::Partial;

/// Why a connection ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndReason {
    /// The peer closed the connection, between two records.
    Left,
    /// The peer closed the connection before it had sent a single byte.
    LeftAtOnce,
    /// The peer closed the connection in the middle of a record.
    LeftWithin(Partial),
    /// A record was not completed within the given time.
    Incomplete(Partial, Nanos),
    /// The peer did not accept a whole record within the given time.
    NotReading(Partial, Nanos),
    /// No whole record has arrived for the given time.
    Silent(Nanos),
    /// Bytes arrived, although nothing is to be received.
    Unasked,
    /// The peer is a web browser, or sends what one would.
    Browser,
}

impl EndReason {
    /// The error that ends the connection with `peer`.
    pub fn of(self, peer: impl fmt::Display) -> BusError {
        match self {
            Self::Left => BusError::Left(format!("{peer} closed the connection")),
            Self::LeftAtOnce => BusError::Left(format!(
                "{peer} closed the connection before it had sent anything; if it serves another \
                 client, end that one"
            )),
            Self::LeftWithin(partial) => BusError::Protocol(format!(
                "{peer} left in the middle of a record: {partial} had come; {}",
                same_size(partial)
            )),
            Self::Incomplete(partial, limit) => BusError::Protocol(format!(
                "{peer} began a record and did not complete it within {limit}: {partial} have come; {}",
                same_size(partial)
            )),
            Self::NotReading(partial, limit) => BusError::Link(format!(
                "{peer} does not read: of the last record it took {partial} within {limit}; it has to \
                 read all that this end sends"
            )),
            Self::Silent(limit) => BusError::Link(format!(
                "{peer} has been silent for {limit}; it has to send a record within every \"max_age\", \
                 changed or not"
            )),
            Self::Unasked => BusError::Protocol(format!(
                "{peer} sends, but this end has nothing to receive; give both ends the same signals"
            )),
            Self::Browser => BusError::Protocol(format!("refused {peer}: {IS_BROWSER}")),
        }
    }
}

fn same_size(Partial { of, .. }: Partial) -> String {
    format!(
        "this end's signals make records of {of} bytes, so check that the peer sends as many, and \
         nothing else"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_say_what_happened_what_was_expected_and_what_to_do() {
        let partial = Partial { have: 100, of: 360 };
        let limit = Nanos::from_millis(300);
        for (fault, parts) in [
            (
                EndReason::Left,
                &["the peer left", "10.0.0.7:4000 closed"][..],
            ),
            (
                EndReason::LeftAtOnce,
                &["before it had sent anything", "end that one"],
            ),
            (
                EndReason::LeftWithin(partial),
                &[
                    "the protocol was broken",
                    "left in the middle of a record",
                    "100 of 360 bytes",
                    "check",
                ],
            ),
            (
                EndReason::Incomplete(partial, limit),
                &["100 of 360 bytes", "within 300ms", "check"],
            ),
            (
                EndReason::NotReading(partial, limit),
                &["link failed", "does not read", "100 of 360 bytes"],
            ),
            (EndReason::Silent(limit), &["silent for 300ms", "max_age"]),
            (EndReason::Unasked, &["nothing to receive", "same signals"]),
            (EndReason::Browser, &["HTTP request", "web page"]),
        ] {
            let text = fault.of("10.0.0.7:4000").to_string();
            for part in parts {
                assert!(text.contains(part), "\"{part}\" in {text}");
            }
        }
    }
}
