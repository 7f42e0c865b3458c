//! The refusals of a CPU, and their remedies.

use std::fmt;

use super::plan::JobDirection;
use crate::item::{Item, Object, ReturnCode};
use crate::pdu::error;
use tickbus_fieldbus::BusError;

/// The subject of a CPU's refusal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// One item of a job.
    Item {
        /// True if the item was to be written.
        written: bool,
        /// The item.
        item: Item,
        /// Why.
        code: ReturnCode,
    },
    /// A whole job, with error class and code.
    Job(u16),
    /// The transport connection, with the reason.
    Connection(u8),
}

impl Refusal {
    pub(super) fn item(way: JobDirection, item: Item, code: ReturnCode) -> Self {
        let written = way == JobDirection::Write;
        Self::Item {
            written,
            item,
            code,
        }
    }

    /// The error that ends the connection with `peer`.
    pub fn into_error(self, peer: impl fmt::Display) -> BusError {
        BusError::Refused(format!("{peer} {self}"))
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Item {
                written,
                item,
                code,
            } => {
                let way = if *written { "writing" } else { "reading" };
                let range = item.range();
                write!(
                    f,
                    "refuses {way} {} bytes {} to {}: {code}; {}",
                    item.object,
                    range.start,
                    range.end - 1,
                    right(item.object, *code)
                )
            }
            Self::Job(error::NO_FUNCTION) => f.write_str(
                "refuses to read or write (error 0x8104); in TIA Portal, in the properties of the CPU under \
                 Protection & Security, allow full access and permit access with PUT/GET communication from \
                 remote partner, and load the hardware configuration",
            ),
            Self::Job(error::LENGTHS) => f.write_str(
                "finds a job too long (error 0x8500), though it keeps to the agreed length; write a smaller \
                 \"pdu\"",
            ),
            Self::Job(0xD241) => f.write_str(
                "refuses at its protection level (error 0xD241); allow full access in the properties of the CPU",
            ),
            Self::Job(code) => write!(
                f,
                "refuses a job (error 0x{code:04X}); see its diagnostic buffer"
            ),
            Self::Connection(reason) => write!(
                f,
                "refuses the connection (reason {reason}); check \"rack\" and \"slot\" (a S7-1200 or S7-1500 is \
                 in rack 0, slot 1, a S7-300 in slot 2), and whether all its connections are taken"
            ),
        }
    }
}

/// The remedy for a refused item.
const fn right(object: Object, code: ReturnCode) -> &'static str {
    match (object, code) {
        (Object::Block(_), ReturnCode::ADDRESS) => {
            "the block is shorter than the image, or has optimized block access: in its properties, under \
             Attributes, clear that, compile and load the block"
        }
        (Object::Block(_), ReturnCode::MISSING) => {
            "there is no such block in the CPU, or it has optimized block access: in its properties, under \
             Attributes, clear that, compile and load the block"
        }
        (_, ReturnCode::ADDRESS | ReturnCode::MISSING) => {
            "the CPU has no such addresses; correct \"input\" and \"output\", or use a data block"
        }
        (_, ReturnCode::ACCESS) => {
            "in the properties of the CPU, under Protection & Security, allow full access and permit access \
             with PUT/GET communication; a block must not be write-protected"
        }
        (_, ReturnCode::TYPE | ReturnCode::INCONSISTENT) => {
            "bytes are all that is asked for, so see what the peer is: it may be no CPU of the S7 family"
        }
        _ => "see the diagnostic buffer of the CPU",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_says_what_to_do() {
        let item = |object| Item::bytes(object, 4..12);
        for (refusal, parts) in [
            (
                Refusal::item(
                    JobDirection::Read,
                    item(Object::Block(10)),
                    ReturnCode::ADDRESS,
                ),
                &[
                    "reading DB10 bytes 4 to 11",
                    "out of range (code 0x05)",
                    "optimized block access",
                ][..],
            ),
            (
                Refusal::item(
                    JobDirection::Write,
                    item(Object::Block(10)),
                    ReturnCode::MISSING,
                ),
                &["writing DB10", "does not exist (code 0x0A)", "optimized"],
            ),
            (
                Refusal::item(
                    JobDirection::Write,
                    item(Object::Inputs),
                    ReturnCode::ACCESS,
                ),
                &["writing %I bytes 4 to 11", "PUT/GET"],
            ),
            (Refusal::Job(error::NO_FUNCTION), &["0x8104", "PUT/GET"]),
            (Refusal::Job(0xD2FF), &["0xD2FF"]),
            (Refusal::Connection(2), &["reason 2", "\"slot\""]),
        ] {
            let told = refusal.into_error("10.0.0.7:102").to_string();
            assert!(told.starts_with("refused: 10.0.0.7:102 refuses ") || told.contains("finds"));
            for part in parts {
                assert!(told.contains(part), "\"{part}\" in {told}");
            }
        }
    }
}
