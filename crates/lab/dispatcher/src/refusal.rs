//! The dispatcher's answers to lines that it does not carry out.

use std::fmt;

/// Why a line was refused, as the answer `ERR <code> <text>` reports it. A refused line has changed nothing, except
/// with [`Code::Internal`]: then its change holds, but was not saved.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("ERR {} {text}", code.number())]
pub struct Refusal {
    /// The kind of mistake.
    pub code: Code,
    /// The cause and the remedy, in one line.
    pub text: String,
}

/// The codes of refusals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Code {
    /// 400: the line is not in the grammar.
    Syntax,
    /// 401: the client has not stated the laboratory's key, or has not identified itself.
    IdentifyFirst,
    /// 403: the key of the laboratory is wrong; the connection is closed.
    WrongKey,
    /// 404: there is no such client, channel or connection.
    NotFound,
    /// 408: no line came for too long; the connection is closed.
    TimeOut,
    /// 409: the name or the input is taken.
    Conflict,
    /// 413: the line is too long.
    TooLong,
    /// 422: the channels do not fit together.
    Mismatch,
    /// 429: more than the dispatcher serves.
    Limit,
    /// 500: the dispatcher failed.
    Internal,
}

impl Code {
    /// The number on the wire.
    pub const fn number(self) -> u16 {
        match self {
            Self::Syntax => 400,
            Self::IdentifyFirst => 401,
            Self::WrongKey => 403,
            Self::NotFound => 404,
            Self::TimeOut => 408,
            Self::Conflict => 409,
            Self::TooLong => 413,
            Self::Mismatch => 422,
            Self::Limit => 429,
            Self::Internal => 500,
        }
    }

    /// The code with this number on the wire; an unknown number is an internal mistake of its sender.
    pub(crate) fn of(number: u16) -> Self {
        const ALL: [Code; 8] = [
            Code::Syntax,
            Code::IdentifyFirst,
            Code::NotFound,
            Code::TimeOut,
            Code::Conflict,
            Code::TooLong,
            Code::Mismatch,
            Code::Limit,
        ];

        let found = ALL.into_iter().find(|code| code.number() == number);
        found.unwrap_or(Self::Internal)
    }

    /// A refusal with this code.
    pub(crate) fn because(self, text: impl fmt::Display) -> Refusal {
        Refusal {
            code: self,
            text: text.to_string(),
        }
    }
}
