//! The causes behind refusals of a CPU, and what to try next.

use super::super::{End, Refusal};
use super::talk::Miss;
use crate::item::{Object, ReturnCode};
use crate::pdu::error;
use tickbus_image::signal::Signal;

/// The cause if the CPU refused a whole job, the evidence and the next thing to try.
pub(super) fn whole_refusal(miss: &Miss) -> (&'static str, String, String) {
    match miss {
        Miss::Session(End::Refused(refusal)) => {
            let cause = match refusal {
                Refusal::Job(error::NO_FUNCTION) => "put-get",
                Refusal::Job(0xD241) => "protection-level",
                _ => "job-refused",
            };
            let text = refusal.to_string();
            let (told, next) = text
                .split_once("; ")
                .unwrap_or((&text, "see its diagnostic buffer"));
            (cause, format!("the CPU {told}"), next.to_owned())
        }
        Miss::Session(end) => {
            let why = end.clone().into_error("the CPU").to_string();
            ("not-s7", why, "see what the peer is".to_owned())
        }
        Miss::Wire(end) => (
            "connection-lost",
            format!("the CPU {end} when the signals are read"),
            "write a smaller \"pdu\", and see the diagnostic buffer of the CPU".to_owned(),
        ),
    }
}

/// The cause if the CPU refused single items, and the next thing to try.
pub(super) fn item_refusal(refused: &[(&Signal, Refusal)]) -> (&'static str, &'static str) {
    let first = refused.first().map(|(_, refusal)| refusal);
    let Some(Refusal::Item { item, code, .. }) = first else {
        return ("job-refused", "see the diagnostic buffer of the CPU");
    };
    match (item.object, *code) {
        (Object::Block(_), ReturnCode::MISSING) => (
            "block-missing",
            "load the block into the CPU; if it is there, it has optimized block access: clear that in its properties, \
             under Attributes, compile and load it",
        ),
        (Object::Block(_), ReturnCode::ADDRESS) => (
            "block-short",
            "the block is shorter than the file assumes: compare the offsets in its declaration, and compile and load it",
        ),
        (_, ReturnCode::ADDRESS | ReturnCode::MISSING) => (
            "address-refused",
            "the CPU has no such addresses: correct \"input\", \"output\" or [fieldbus.at]",
        ),
        (_, ReturnCode::ACCESS) => (
            "access-denied",
            "allow full access and PUT/GET communication in the properties of the CPU; a block must not be protected",
        ),
        _ => ("item-refused", "see the diagnostic buffer of the CPU"),
    }
}
