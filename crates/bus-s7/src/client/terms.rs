//! What a dialog begins with, what it tells, and how it ends.

use std::fmt;

use super::Refusal;
use crate::szl::Identity;
use crate::{Fault, Tsap};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusError, PlcState};

/// What both ends of a connection, or this one, have agreed upon.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Terms {
    /// This end.
    pub calling: Tsap,
    /// The CPU.
    pub called: Tsap,
    /// The longest unit that is asked for.
    pub pdu: u16,
    /// How long an answer may take.
    pub patience: Nanos,
    /// Whether the CPU is asked who it is.
    pub asks_who: bool,
}

/// Why a connection ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// The peer does not keep to the protocol.
    Broken(Fault),
    /// It does, and declined.
    Refused(Refusal),
    /// It does not answer.
    Silent(Nanos),
}

impl End {
    /// The error that ends the connection with `peer`.
    pub fn into_error(self, peer: impl fmt::Display) -> BusError {
        match self {
            Self::Broken(fault @ Fault::Disconnected(_)) => {
                BusError::Left(format!("{peer}: {fault}"))
            }
            Self::Broken(fault) => BusError::Protocol(format!("{peer}: {fault}")),
            Self::Refused(refusal) => refusal.into_error(peer),
            Self::Silent(patience) => BusError::Link(format!(
                "{peer} has not answered for {patience}; see whether it still runs"
            )),
        }
    }
}

impl From<Fault> for End {
    fn from(fault: Fault) -> Self {
        Self::Broken(fault)
    }
}

/// What the owner of a dialog has to look at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum News {
    /// The connection stands, with units of this length at most; the CPU says who it is, or nothing.
    Met(u16, Option<Identity>),
    /// What is to be written has been, and what is to be read.
    Done,
    /// The CPU says whether it runs; nothing where it does not say.
    State(Option<PlcState>),
}
