//! Commands in the format of the line: a character, parameters in ASCII, data, checksum, ETX.

use crate::hex;
use crate::{Family, Status};

/// The last octet of commands and answers. Data and checksums may equal it.
pub const ETX: u8 = 0x03;

/// The octets of a page.
pub const PAGE: usize = 32;

/// The longest command: character, head, address, length, 255 octets, checksum and ETX.
pub const COMMAND_LIMIT: usize = 1 + 1 + 4 + 2 + 255 + 2;

/// The heads that a command is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Heads {
    /// `0`: all heads are switched off.
    Off,
    /// `1` to `4`.
    One(u8),
    /// `x`: all connected heads. A reading command gets an answer from each head that has a carrier; a writing command
    /// writes to the first carrier found.
    All,
}

impl Heads {
    fn character(self) -> u8 {
        match self {
            Self::Off => b'0',
            Self::One(number) => b'0' + number,
            Self::All => b'x',
        }
    }

    fn of_character(character: u8) -> Option<Self> {
        match character {
            b'0' => Some(Self::Off),
            b'1'..=b'4' => Some(Self::One(character - b'0')),
            b'x' | b'X' => Some(Self::All),
            _ => None,
        }
    }
}

/// The task of a head.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access<'a> {
    /// `a`: reads 32 octets from address 0.
    ReadStart,
    /// `w`: reads.
    Read {
        /// The first octet.
        address: u16,
        /// The number of octets.
        length: u8,
    },
    /// `k`: writes.
    Write {
        /// The first octet.
        address: u16,
        /// The octets, at most 255.
        data: &'a [u8],
    },
    /// `i`: reads the number of a code carrier.
    ReadNumber,
    /// `h`: resets an IDC or IDC-1K.
    Reset,
    /// `l`: reads a page.
    ReadPage(u16),
    /// `m`: writes a page.
    WritePage {
        /// The page's number.
        page: u16,
        /// The whole page.
        data: &'a [u8; PAGE],
    },
}

impl Access<'_> {
    /// The character, in single mode.
    pub const fn character(&self) -> u8 {
        match self {
            Self::ReadStart => b'a',
            Self::Read { .. } => b'w',
            Self::Write { .. } => b'k',
            Self::ReadNumber => b'i',
            Self::Reset => b'h',
            Self::ReadPage(_) => b'l',
            Self::WritePage { .. } => b'm',
        }
    }

    /// True if the command changes the carrier.
    pub const fn writes(&self) -> bool {
        matches!(
            self,
            Self::Write { .. } | Self::Reset | Self::WritePage { .. }
        )
    }
}

/// A command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command<'a> {
    /// A command for heads.
    Access {
        /// The heads.
        heads: Heads,
        /// True if the command is repeated until [`EndAuto`](Self::EndAuto): its character is then a capital.
        is_auto: bool,
        /// The task.
        access: Access<'a>,
    },
    /// `d`: sets the type of carriers.
    SetCarriers(Family),
    /// `c`: the reader checks its memory.
    CheckMemory,
    /// `b`: reads and writes carriers on both sides.
    DoubleSided,
    /// `o`: restarts the reader.
    ResetReader,
    /// `q`: ends a repeated command.
    EndAuto,
    /// `v`: requests the reader's version.
    Version,
}

impl<'a> Command<'a> {
    /// A command for one head, executed once.
    pub const fn once(head: u8, access: Access<'a>) -> Self {
        Self::Access {
            heads: Heads::One(head),
            is_auto: false,
            access,
        }
    }

    /// The first character.
    pub const fn character(&self) -> u8 {
        match self {
            Self::Access {
                is_auto, access, ..
            } => {
                let single = access.character();
                if *is_auto {
                    single.to_ascii_uppercase()
                } else {
                    single
                }
            }
            Self::SetCarriers(_) => b'd',
            Self::CheckMemory => b'c',
            Self::DoubleSided => b'b',
            Self::ResetReader => b'o',
            Self::EndAuto => b'q',
            Self::Version => b'v',
        }
    }

    /// Appends the command, for a reader that is set to `family`.
    ///
    /// # Panics
    ///
    /// When more than 255 octets are to be written, or a head is not from 1 to 4.
    pub fn append(&self, family: Family, out: &mut Vec<u8>) {
        let start = out.len();
        out.push(self.character());
        match self {
            Self::Access { heads, access, .. } => {
                if let Heads::One(head) = heads {
                    assert!((1..=4).contains(head), "a reader has heads 1 to 4");
                }
                out.push(heads.character());
                let digits = family.address_digits();
                match access {
                    Access::Read { address, length } => {
                        hex::append(*address, digits, out);
                        out.extend(hex::digits(*length));
                    }
                    Access::Write { address, data } => {
                        hex::append(*address, digits, out);
                        let length = u8::try_from(data.len()).expect("at most 255 octets");
                        out.extend(hex::digits(length));
                        out.extend_from_slice(data);
                    }
                    Access::ReadPage(page) => hex::append(*page, 3, out),
                    Access::WritePage { page, data } => {
                        hex::append(*page, 3, out);
                        out.extend_from_slice(*data);
                    }
                    Access::ReadStart | Access::ReadNumber | Access::Reset => {}
                }
            }
            Self::SetCarriers(carriers) => out.push(carriers.digit()),
            _ => {}
        }
        seal(out, start);
    }

    /// Reads the command at the beginning of `bytes`, sent to a reader that is set to `family`, and its length; `None`
    /// while the command is incomplete.
    ///
    /// # Errors
    ///
    /// The status to answer with. The end of the command is known only if the length is.
    pub fn parse(bytes: &'a [u8], family: Family) -> Result<Option<(Self, usize)>, Refused> {
        let Some(&first) = bytes.first() else {
            return Ok(None);
        };
        let digits = family.address_digits();
        let data = match first.to_ascii_lowercase() {
            b'a' | b'i' | b'h' | b'd' => 2,
            b'l' => 5,
            b'm' => 5 + PAGE,
            b'w' => 4 + digits,
            b'k' => match bytes.get(2 + digits..4 + digits) {
                None => return Ok(None),
                Some(length) => {
                    let length =
                        hex::parse(length).ok_or(Refused::endless(Status::OUT_OF_RANGE))?;
                    4 + digits + usize::from(length)
                }
            },
            b'c' | b'b' | b'o' | b'q' | b'v' => 1,
            _ => return Err(Refused::endless(Status::UNKNOWN_COMMAND)),
        };
        let length = data + 2;
        let Some(whole) = bytes.get(..length) else {
            return Ok(None);
        };
        if whole[data + 1] != ETX {
            return Err(Refused::endless(Status::LINE_CHECKSUM));
        }
        if whole[data] != checksum(&whole[..data]) {
            return Err(Refused {
                status: Status::LINE_CHECKSUM,
                length: Some(length),
            });
        }
        let command = Self::of_parameters(first, &whole[1..data], digits);
        let command = command.map_err(|status| Refused {
            status,
            length: Some(length),
        })?;
        Ok(Some((command, length)))
    }

    fn of_parameters(first: u8, parameters: &'a [u8], digits: usize) -> Result<Self, Status> {
        let number = |range: std::ops::Range<usize>| {
            let digits = parameters.get(range).and_then(hex::parse);
            digits.ok_or(Status::OUT_OF_RANGE)
        };
        let access = match first.to_ascii_lowercase() {
            b'a' => Access::ReadStart,
            b'i' => Access::ReadNumber,
            b'h' => Access::Reset,
            b'w' => Access::Read {
                address: number(1..1 + digits)?,
                length: number(1 + digits..3 + digits)?.to_be_bytes()[1],
            },
            b'k' => Access::Write {
                address: number(1..1 + digits)?,
                data: &parameters[3 + digits..],
            },
            b'l' => Access::ReadPage(number(1..4)?),
            b'm' => Access::WritePage {
                page: number(1..4)?,
                data: parameters[4..].try_into().expect("a whole page"),
            },
            b'd' => {
                let family = Family::of_digit(parameters[0]);
                return family.map(Self::SetCarriers).ok_or(Status::UNSUPPORTED);
            }
            b'c' => return Ok(Self::CheckMemory),
            b'b' => return Ok(Self::DoubleSided),
            b'o' => return Ok(Self::ResetReader),
            b'q' => return Ok(Self::EndAuto),
            _ => return Ok(Self::Version),
        };
        Ok(Self::Access {
            heads: Heads::of_character(parameters[0]).ok_or(Status::NO_HEAD)?,
            is_auto: first.is_ascii_uppercase(),
            access,
        })
    }
}

/// A command that gets an error as its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{status}")]
pub struct Refused {
    /// The error.
    pub status: Status,
    /// The length of the command; `None` if it is unknown, and silence ends the command.
    pub length: Option<usize>,
}

impl Refused {
    const fn endless(status: Status) -> Self {
        Self {
            status,
            length: None,
        }
    }
}

/// The sum of these octets, without carry.
pub fn checksum(octets: &[u8]) -> u8 {
    octets.iter().fold(0, |sum, octet| sum.wrapping_add(*octet))
}

/// Seals the bytes from `start` on with their checksum and ETX.
pub(crate) fn seal(out: &mut Vec<u8>, start: usize) {
    let sum = checksum(&out[start..]);
    out.extend([sum, ETX]);
}

#[cfg(test)]
mod tests;
