//! The errors of all buses.

use std::net::SocketAddr;

/// The reason why a bus cannot continue; the variant shows who is at fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BusError {
    /// The line is broken, or was never up; a retry may help.
    #[error("the link failed: {0}")]
    Link(String),
    /// The peer closed the connection properly.
    #[error("the peer left: {0}")]
    Left(String),
    /// The peer violates the protocol.
    #[error("the protocol was broken: {0}")]
    Protocol(String),
    /// The peer understood the request, and refused it.
    #[error("refused: {0}")]
    Refused(String),
}

impl BusError {
    /// The same error with the address of the peer in front of its text.
    pub(crate) fn of_peer(&self, peer: SocketAddr) -> Self {
        let named = |text: &str| format!("{peer}: {text}");
        match self {
            Self::Link(text) => Self::Link(named(text)),
            Self::Left(text) => Self::Left(named(text)),
            Self::Protocol(text) => Self::Protocol(named(text)),
            Self::Refused(text) => Self::Refused(named(text)),
        }
    }
}

impl From<tickbus_net::Error> for BusError {
    fn from(error: tickbus_net::Error) -> Self {
        Self::Link(error.to_string())
    }
}
