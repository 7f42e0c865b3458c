//! Faults of answers: a server answers a request late, with an error, or wrongly.

use tickbus_base::time::Nanos;

/// A fault of a server's answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnswerEffect {
    /// The station that answers so; `None` for all.
    pub station: Option<usize>,
    /// The function code of the requests that are answered so; `None` for all.
    pub function: Option<u8>,
    /// The elements of the requests that are answered so.
    pub elements: Elements,
    /// How likely it is, from above 0 to 1.
    pub chance: f64,
    /// The trouble with these answers.
    pub trouble: AnswerTrouble,
}

/// The elements that a request has to name for a fault to change its answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Elements {
    /// The signal, by its index in the signal table, that must be among them; `None` for any.
    pub signal: Option<usize>,
    /// Their number; `None` for any.
    pub quantity: Option<u16>,
}

/// A request, as far as a fault of its answer can depend on it.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    /// The station that is addressed.
    pub station: usize,
    /// The function code.
    pub function: u8,
    /// Returns true if the request names these elements.
    pub names: &'a dyn Fn(Elements) -> bool,
}

impl std::fmt::Debug for Request<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = f.debug_struct("Request");
        shown
            .field("station", &self.station)
            .field("function", &self.function)
            .finish_non_exhaustive()
    }
}

/// One thing that can be wrong with an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnswerTrouble {
    /// The request is carried out, and its answer goes out `by` later, each of its bytes `pause` after the one before.
    Late {
        /// How much later the first byte goes out.
        by: Nanos,
        /// The time between two bytes; zero for an answer in one piece.
        pause: Nanos,
    },
    /// The request is not carried out, and refused with this code of the protocol.
    Error(u32),
    /// The request is carried out, and its answer is malformed.
    Wrong(WrongAnswer),
}

/// The codes with which a server can refuse a request, and the other faults that its answers can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnswerCodes {
    /// The lowest and the highest code.
    pub range: (u32, u32),
    /// Names of some codes, which a driver.cfg can have instead.
    pub names: &'static [(&'static str, u32)],
    /// The ways in which answers can be malformed.
    pub wrong: &'static [WrongAnswer],
    /// True if a fault can depend on the [elements](Elements) of a request.
    pub has_elements: bool,
    /// True if the bytes of an answer can go out one at a time.
    pub has_pauses: bool,
}

impl AnswerCodes {
    /// Any code, by number or by name: those of a bus that is not known.
    pub const ANY: Self = Self {
        range: (1, u32::MAX),
        names: &[],
        wrong: &WrongAnswer::ALL,
        has_elements: true,
        has_pauses: true,
    };

    /// One byte without names, as in Modbus over TCP.
    pub const BYTE: Self = Self {
        range: (1, 0xFF),
        ..Self::ANY
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
    /// The answer has one element less than the request asks for.
    Short,
}

impl WrongAnswer {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Truncated, Self::Transaction, Self::Unit, Self::Short];

    /// All of them, as a driver.cfg names them.
    pub const NAMES: [(&str, Self); 4] = [
        ("truncated", Self::Truncated),
        ("transaction", Self::Transaction),
        ("unit", Self::Unit),
        ("short", Self::Short),
    ];
}

/// How the answer to one request is spoilt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spoilt {
    /// How much later it goes out.
    pub late: Nanos,
    /// The time between two of its bytes.
    pub pause: Nanos,
    /// The code with which the request is refused.
    pub error: Option<u32>,
    /// How it is malformed.
    pub wrong: Option<WrongAnswer>,
}

impl Spoilt {
    /// Adds what one more fault does. Delays add up; of pauses the longest counts, of errors and of malformed answers the
    /// first.
    pub(super) fn add(&mut self, trouble: AnswerTrouble) {
        match trouble {
            AnswerTrouble::Late { by, pause } => {
                self.late += by;
                self.pause = self.pause.max(pause);
            }
            AnswerTrouble::Error(code) => self.error = self.error.or(Some(code)),
            AnswerTrouble::Wrong(wrong) => self.wrong = self.wrong.or(Some(wrong)),
        }
    }
}
