//! Answers. Command and status determine the length of an answer, since its data may contain ETX.

use crate::command::{ETX, checksum, seal};
use crate::hex;
use crate::{Access, Command, Heads, Status};

/// An answer of a reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The first character, that of the command.
    pub command: u8,
    /// The outcome; [`DONE`](Status::DONE) for an answer without a status.
    pub status: Status,
    /// The head, of an answer to a command for all heads.
    pub head: Option<u8>,
    /// The number of octets of data.
    pub length: usize,
}

/// The data of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Data {
    /// This many.
    Exactly(usize),
    /// The manual does not state the number: silence ends the data.
    UntilSilence,
}

/// The shape of the answers to one command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    character: u8,
    data: Data,
    /// Answers contain the number of their head.
    is_of_all: bool,
    /// Answers may lack a status: those to `d` have none, and those to other system commands are not in the manual.
    may_be_bare: bool,
}

/// How well some bytes match.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fit {
    /// No answer of this shape.
    No,
    /// The bytes may become an answer.
    Begins,
    /// An answer of this length, whose data begin at this place.
    Whole {
        answer: Answer,
        length: usize,
        data: usize,
    },
}

impl Shape {
    pub(crate) fn of(command: &Command<'_>) -> Self {
        let (heads, access) = match command {
            Command::Access { heads, access, .. } => (Some(heads), Some(access)),
            _ => (None, None),
        };
        let octets = match access {
            _ if heads == Some(&Heads::Off) => Data::Exactly(0),
            Some(Access::ReadStart | Access::ReadPage(_)) => Data::Exactly(32),
            Some(Access::Read { length, .. }) => Data::Exactly(usize::from(*length)),
            Some(Access::ReadNumber) => Data::UntilSilence,
            None if *command == Command::Version => Data::UntilSilence,
            _ => Data::Exactly(0),
        };
        Self {
            character: command.character(),
            data: octets,
            is_of_all: heads == Some(&Heads::All),
            may_be_bare: access.is_none(),
        }
    }

    /// True if each head sends a separate answer, once, so that silence ends them.
    pub(crate) const fn has_many(&self) -> bool {
        self.is_of_all && self.character.is_ascii_lowercase()
    }

    /// True if answers begin with this character.
    pub(crate) const fn is_of(&self, character: u8) -> bool {
        self.character == character
    }

    /// Octets of the longest known answer.
    pub(crate) const fn longest(&self) -> usize {
        match self.data {
            Data::Exactly(count) => count + 6,
            Data::UntilSilence => 64,
        }
    }

    /// True if only silence ends an answer.
    pub(crate) const fn ends_by_silence(&self) -> bool {
        matches!(self.data, Data::UntilSilence)
    }

    /// Matches the beginning of `bytes` with an answer; `is_silent` if the line is silent after them.
    pub(crate) fn fit(&self, bytes: &[u8], is_silent: bool) -> Fit {
        match self.fit_so_far(bytes, is_silent) {
            Fit::Begins if is_silent && self.ends_by_silence() => Fit::No,
            found => found,
        }
    }

    fn fit_so_far(&self, bytes: &[u8], is_silent: bool) -> Fit {
        if bytes.first() != Some(&self.character) {
            return Fit::No;
        }
        let whole = |length: usize, status, head, data: usize| match bytes.get(..length) {
            None => Fit::Begins,
            Some(all) if is_sealed(all) => Fit::Whole {
                answer: Answer {
                    command: self.character,
                    status,
                    head,
                    length: length - 2 - data,
                },
                length,
                data,
            },
            Some(_) => Fit::No,
        };
        if self.may_be_bare && bytes.get(1).is_none_or(|sum| *sum == self.character) {
            return whole(3, Status::DONE, None, 1);
        }
        let Some(status) = bytes.get(1..3) else {
            let is_digit = |digit: &u8| hex::parse(&[*digit]).is_some();
            return if bytes.get(1).is_none_or(is_digit) {
                Fit::Begins
            } else {
                Fit::No
            };
        };
        let Some(status) = hex::parse(status) else {
            return Fit::No;
        };
        let status = Status(status.to_be_bytes()[1]);
        let mut data = 3;
        let mut head = None;
        if self.is_of_all {
            // An error that concerns no particular head may lack a number.
            let bare = whole(5, status, None, 3);
            if !status.is_done() && !matches!(bare, Fit::No) {
                return bare;
            }
            match bytes.get(3) {
                None => return Fit::Begins,
                Some(number @ b'1'..=b'4') => head = Some(number - b'0'),
                Some(_) => return Fit::No,
            }
            data = 4;
        }
        match self.data {
            _ if !status.is_done() => whole(data + 2, status, head, data),
            Data::Exactly(count) => whole(data + count + 2, status, head, data),
            Data::UntilSilence if !is_silent || bytes.len() < data + 2 => Fit::Begins,
            Data::UntilSilence => whole(bytes.len(), status, head, data),
        }
    }
}

fn is_sealed(all: &[u8]) -> bool {
    let (text, end) = all.split_at(all.len() - 2);
    end == [checksum(text), ETX]
}

/// Appends an answer with a status.
pub(crate) fn append(
    character: u8,
    status: Status,
    head: Option<u8>,
    data: &[u8],
    out: &mut Vec<u8>,
) {
    let start = out.len();
    out.push(character);
    out.extend(status.digits());
    out.extend(head.map(|head| b'0' + head));
    out.extend_from_slice(data);
    seal(out, start);
}

/// Appends an answer without a status.
pub(crate) fn append_bare(character: u8, out: &mut Vec<u8>) {
    let start = out.len();
    out.push(character);
    seal(out, start);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(command: &Command<'_>, bytes: &[u8], is_silent: bool) -> Fit {
        Shape::of(command).fit(bytes, is_silent)
    }

    fn sealed(text: &[u8]) -> Vec<u8> {
        let mut bytes = text.to_vec();
        seal(&mut bytes, 0);
        bytes
    }

    #[track_caller]
    fn is(command: &Command<'_>, text: &[u8], status: u8, head: Option<u8>, data: &[u8]) {
        let mut bytes = sealed(text);
        let length = bytes.len();
        for end in 0..length {
            let part = fit(command, &bytes[..end], false);
            assert!(matches!(part, Fit::Begins | Fit::No if end == 0 || part == Fit::Begins));
        }
        // Silence ends answers of unknown length; others have a known end.
        let is_silent = Shape::of(command).data == Data::UntilSilence;
        if !is_silent {
            bytes.extend(b"w00");
        }
        let Fit::Whole {
            answer,
            length: found,
            data: at,
        } = fit(command, &bytes, is_silent)
        else {
            panic!("{text:?}");
        };
        assert_eq!(found, length);
        assert_eq!((answer.status, answer.head), (Status(status), head));
        assert_eq!(&bytes[at..at + answer.length], data);
    }

    #[test]
    fn an_answer_ends_where_its_command_says_though_its_data_are_etx() {
        let read = |length| Access::Read { address: 0, length };
        let etx = Command::once(1, read(4));
        is(&etx, b"w00\x03\x03\x03\x03", 0, None, &[3; 4]);
        is(&etx, b"w10abcd", 0x10, None, b"abcd");
        is(&etx, b"w03", 3, None, b"");
        is(
            &Command::once(2, Access::ReadStart),
            &[b"a00", [9; 32].as_slice()].concat(),
            0,
            None,
            &[9; 32],
        );
        is(&Command::once(2, Access::Reset), b"h00", 0, None, b"");
        is(
            &Command::once(2, Access::ReadNumber),
            b"i00\x03\x03",
            0,
            None,
            &[3, 3],
        );
        let all = Command::Access {
            heads: Heads::All,
            is_auto: true,
            access: read(2),
        };
        is(&all, b"W004ab", 0, Some(4), b"ab");
        is(&all, b"W03", 3, None, b"");
        is(&all, b"W083", 8, Some(3), b"");
        is(
            &Command::SetCarriers(crate::Family::Idc),
            b"d",
            0,
            None,
            b"",
        );
        is(
            &Command::SetCarriers(crate::Family::Idc),
            b"d0D",
            0x0D,
            None,
            b"",
        );
        is(&Command::Version, b"v001.0", 0, None, b"1.0");
    }

    #[test]
    fn what_is_damaged_is_no_answer() {
        let read = Command::once(
            1,
            Access::Read {
                address: 0,
                length: 1,
            },
        );
        let right = sealed(b"w00a");
        for index in 0..right.len() {
            let mut bytes = right.clone();
            bytes[index] ^= 1;
            let found = fit(&read, &bytes, true);
            assert!(!matches!(found, Fit::Whole { .. }), "{bytes:?}");
        }
    }
}
