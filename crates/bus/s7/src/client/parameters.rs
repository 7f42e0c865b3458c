//! The parameters of a session, its news, and how it ends.

use std::fmt;

use super::Refusal;
use crate::szl::Identity;
use crate::{ProtocolError, Tsap};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusError, PlcState};

/// The parameters of a connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConnectionParameters {
    /// The local TSAP.
    pub calling: Tsap,
    /// The CPU's TSAP.
    pub called: Tsap,
    /// The longest PDU that is requested.
    pub pdu: u16,
    /// The time-out of an answer.
    pub patience: Nanos,
    /// True if the CPU is asked for its identity.
    pub asks_who: bool,
}

/// Why a connection ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// The peer violates the protocol.
    Broken(ProtocolError),
    /// The peer refused.
    Refused(Refusal),
    /// The peer does not answer.
    Silent(Nanos),
}

impl End {
    /// The error that ends the connection with `peer`.
    pub fn into_error(self, peer: impl fmt::Display) -> BusError {
        match self {
            Self::Broken(fault @ ProtocolError::Disconnected(_)) => {
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

impl From<ProtocolError> for End {
    fn from(fault: ProtocolError) -> Self {
        Self::Broken(fault)
    }
}

/// An event that the owner of a session must handle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SessionEvent {
    /// The connection is up, with PDUs of at most this length, and with the CPU's identity if it was asked
    /// for.
    Met(u16, Option<Identity>),
    /// The cycle is complete.
    Done,
    /// The CPU's operating state; `None` if it does not report it.
    State(Option<PlcState>),
}
