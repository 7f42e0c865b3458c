//! Faults of answers: a server answers a request late, with an error, or wrongly.

use tickbus_base::time::Nanos;

/// A fault of a server's answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnswerEffect {
    /// The station that answers so; `None` for all.
    pub station: Option<usize>,
    /// The function code of the requests that are answered so; `None` for all.
    pub function: Option<u8>,
    /// How likely it is, from above 0 to 1.
    pub chance: f64,
    /// The trouble with these answers.
    pub trouble: AnswerTrouble,
}

/// One thing that can be wrong with an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnswerTrouble {
    /// The request is carried out, and its answer goes out this much later.
    Late(Nanos),
    /// The request is not carried out, and refused with this code of the protocol.
    Error(u32),
    /// The request is carried out, and its answer is malformed.
    Wrong(WrongAnswer),
}

/// The codes with which a server can refuse a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnswerCodes {
    /// The lowest and the highest code.
    pub range: (u32, u32),
    /// Names of some codes, which a driver.cfg can have instead.
    pub names: &'static [(&'static str, u32)],
    /// True if answers can be malformed, too.
    pub wrong: bool,
}

impl AnswerCodes {
    /// Any code, by number or by name: those of a bus that is not known.
    pub const ANY: Self = Self {
        range: (1, u32::MAX),
        names: &[],
        wrong: true,
    };

    /// One byte without names, as in Modbus.
    pub const BYTE: Self = Self {
        range: (1, 0xFF),
        names: &[],
        wrong: true,
    };
}

/// A malformed answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrongAnswer {
    /// The answer lacks its last byte.
    Truncated,
    /// The answer has the number of another request.
    Transaction,
    /// The answer comes from another unit.
    Unit,
}

impl WrongAnswer {
    /// All of them, as a driver.cfg names them.
    pub const NAMES: [(&str, Self); 3] = [
        ("truncated", Self::Truncated),
        ("transaction", Self::Transaction),
        ("unit", Self::Unit),
    ];
}

/// How the answer to one request is spoilt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spoilt {
    /// How much later it goes out.
    pub late: Nanos,
    /// The code with which the request is refused.
    pub error: Option<u32>,
    /// How it is malformed.
    pub wrong: Option<WrongAnswer>,
}

impl Spoilt {
    /// Adds what one more fault does. Delays add up; of errors and of malformed answers the first counts.
    pub(super) fn add(&mut self, trouble: AnswerTrouble) {
        match trouble {
            AnswerTrouble::Late(by) => self.late += by,
            AnswerTrouble::Error(code) => self.error = self.error.or(Some(code)),
            AnswerTrouble::Wrong(wrong) => self.wrong = self.wrong.or(Some(wrong)),
        }
    }
}
