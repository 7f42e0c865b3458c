//! Userdata requests: status lists, the clock, and the list of blocks.

use super::item::{self, ReturnCode};
use super::pdu::{Draft, JOB_HEADER, Kind, Pdu, error};
use super::szl::{self, Facts};
use tickbus_base::time::Nanos;

/// Bytes of the parameters of an answer.
const PARAMETERS: usize = 12;

/// The subjects of requests.
mod group {
    pub(super) const BLOCKS: u8 = 3;
    pub(super) const LISTS: u8 = 4;
    pub(super) const CLOCK: u8 = 7;
}

const REQUEST: u8 = 0x11;
const RESPONSE: u8 = 0x12;

/// The block types that are counted, by letter: OB, FB, FC, DB, SDB, SFC, SFB.
const BLOCK_KINDS: [u8; 7] = [0x38, 0x45, 0x43, 0x41, 0x42, 0x44, 0x46];
const DATA_BLOCK: u8 = 0x41;
/// The language code of data blocks.
const LANGUAGE: u8 = 5;

/// The sources of an answer.
#[derive(Debug)]
pub(super) struct Ask<'a> {
    /// When the request arrived.
    pub now: Nanos,
    /// The contents of the lists.
    pub facts: &'a Facts,
    /// The data blocks and their lengths.
    pub blocks: &'a [(u16, usize)],
    /// The longest PDU.
    pub limit: usize,
}

/// The rest of an answer that did not fit into one PDU, for the client to read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Rest {
    sequence: u8,
    unit: u8,
    of: (u8, u8),
    bytes: Vec<u8>,
}

/// The parameters of one request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Question<'a> {
    group: u8,
    function: u8,
    sequence: u8,
    follows: bool,
    data: &'a [u8],
}

impl<'a> Question<'a> {
    fn read(pdu: &Pdu<'a>) -> Option<Self> {
        let [0, 1, 0x12, length, method, group, function, sequence, ..] = *pdu.parameters else {
            return None;
        };
        // The upper half marks a request.
        if pdu.parameters.len() != 4 + usize::from(length) || group >> 4 != 4 {
            return None;
        }
        // Some clients state more bytes than follow, such as Apache PLC4X in its first request.
        let data = match *pdu.data {
            [_, _, high, low, ref bytes @ ..] => {
                let stated = usize::from(u16::from_be_bytes([high, low]));
                &bytes[..stated.min(bytes.len())]
            }
            _ => &[],
        };
        let follows = match (method, length) {
            (REQUEST, 4) => false,
            (RESPONSE, 8) => true,
            _ => return None,
        };
        Some(Self {
            group: group & 0x0F,
            function,
            sequence,
            follows,
            data,
        })
    }
}

/// Appends the answer to a request.
pub(super) fn answer(pdu: &Pdu<'_>, ask: &Ask<'_>, rest: &mut Option<Rest>, out: &mut Vec<u8>) {
    let Some(question) = Question::read(pdu) else {
        return refuse(pdu, error::LENGTHS, out);
    };
    let of = (question.group, question.function);
    let bytes = if question.follows {
        let asked = |rest: &Rest| (rest.sequence, rest.of) == (question.sequence, of);
        match rest.take().filter(asked) {
            Some(rest) => Ok(rest),
            None => Err(error::NO_FUNCTION),
        }
    } else {
        // A new request discards the rest of an earlier answer.
        let sequence = rest.take().map_or(0, |rest| rest.sequence);
        say(&question, ask).map(|bytes| Rest {
            sequence: sequence.checked_add(1).unwrap_or(1),
            unit: 0,
            of,
            bytes,
        })
    };
    match bytes {
        Ok(whole) => *rest = write_piece(pdu.reference, whole, ask.limit, out),
        Err(error) => refuse(pdu, error, out),
    }
}

/// Appends as much of an answer as fits into a PDU; returns the rest.
fn write_piece(reference: u16, mut whole: Rest, limit: usize, out: &mut Vec<u8>) -> Option<Rest> {
    let room = limit - JOB_HEADER - PARAMETERS - item::DATA_HEADER;
    let later = whole.bytes.split_off(room.min(whole.bytes.len()));
    let more = !later.is_empty();
    // An answer in one piece has no sequence number.
    let numbered = more || whole.unit > 0;
    whole.unit = whole.unit.wrapping_add(1);
    let sequence = if numbered {
        [whole.sequence, whole.unit]
    } else {
        [0, 0]
    };
    let mut draft = begin(reference, whole.of, sequence, more, error::NONE, out);
    draft.data(out);
    item::write_header(ReturnCode::OK, item::Element::Char, whole.bytes.len(), out);
    out.extend_from_slice(&whole.bytes);
    draft.end(out);
    more.then_some(Rest {
        bytes: later,
        ..whole
    })
}

fn begin(
    reference: u16,
    (group, function): (u8, u8),
    [sequence, unit]: [u8; 2],
    more: bool,
    error: u16,
    out: &mut Vec<u8>,
) -> Draft {
    let draft = Draft::begin(Kind::UserData, reference, error::NONE, out);
    let [class, code] = error.to_be_bytes();
    out.extend_from_slice(&[
        0,
        1,
        0x12,
        8,
        RESPONSE,
        0x80 | group,
        function,
        sequence,
        unit,
        u8::from(more),
        class,
        code,
    ]);
    draft
}

/// Appends the refusal of a request.
pub(super) fn refuse(pdu: &Pdu<'_>, error: u16, out: &mut Vec<u8>) {
    let of = match *pdu.parameters {
        [_, _, _, _, _, group, function, ..] => (group & 0x0F, function),
        _ => (0, 0),
    };
    let mut draft = begin(pdu.reference, of, [0, 0], false, error, out);
    draft.data(out);
    item::write_refusal(ReturnCode::MISSING, out);
    draft.end(out);
}

fn say(question: &Question<'_>, ask: &Ask<'_>) -> Result<Vec<u8>, u16> {
    let mut out = Vec::new();
    match (question.group, question.function, question.data) {
        (group::LISTS, 1, &[i0, i1, n0, n1]) => {
            let (id, index) = (u16::from_be_bytes([i0, i1]), u16::from_be_bytes([n0, n1]));
            szl::write(id, index, ask.facts, ask.now, &mut out)?;
        }
        (group::CLOCK, 1 | 3, _) => {
            let clock = ask.facts.clock(ask.now);
            out.extend_from_slice(&[0, 0x19]);
            out.extend_from_slice(&clock);
        }
        (group::BLOCKS, 1, _) => {
            for kind in BLOCK_KINDS {
                let count = if kind == DATA_BLOCK {
                    ask.blocks.len()
                } else {
                    0
                };
                out.extend_from_slice(&[b'0', kind]);
                out.extend_from_slice(&u16::try_from(count).unwrap_or(u16::MAX).to_be_bytes());
            }
        }
        (group::BLOCKS, 2, &[b'0', DATA_BLOCK]) if !ask.blocks.is_empty() => {
            for (number, _) in ask.blocks {
                out.extend_from_slice(&number.to_be_bytes());
                out.extend_from_slice(&[0, LANGUAGE]);
            }
        }
        (group::BLOCKS, 2, &[b'0', _]) => return Err(error::NO_BLOCK),
        (group::BLOCKS, 3, &[b'0', kind, ref digits @ .., _]) => {
            let digits = digits.iter().all(u8::is_ascii_digit).then_some(digits);
            let digits = digits.and_then(|digits| std::str::from_utf8(digits).ok());
            let number = digits.and_then(|digits| digits.parse::<u16>().ok());
            let mut blocks = ask.blocks.iter();
            let found = blocks.find(|block| kind == DATA_BLOCK && Some(block.0) == number);
            block(*found.ok_or(error::NO_BLOCK)?, &mut out);
        }
        (group::LISTS | group::BLOCKS, 1..=3, _) => return Err(error::LENGTHS),
        _ => return Err(error::NO_FUNCTION),
    }
    Ok(out)
}

/// Appends the description of a data block.
fn block((number, length): (u16, usize), out: &mut Vec<u8>) {
    const LOADED: u32 = 36;
    let [n0, n1] = number.to_be_bytes();
    let length = u16::try_from(length).unwrap_or(u16::MAX);
    out.extend_from_slice(&[
        b'0', DATA_BLOCK, 0, 0x4A, 0, 0, b'p', b'p', 1, 0, LANGUAGE, 0x0A,
    ]);
    out.extend_from_slice(&[n0, n1]);
    // In load memory it also has a header.
    out.extend_from_slice(&(u32::from(length) + LOADED).to_be_bytes());
    // No protection, no dates, no interface.
    out.extend_from_slice(&[0; 22]);
    out.extend_from_slice(&length.to_be_bytes());
    out.extend_from_slice(b"tickbus\0");
    out.extend_from_slice(&[0; 16]);
    out.push(1);
    out.resize(78, 0);
}
