//! The ways in which a peer can violate the protocol, in words.

use super::length::LONGEST;
use tickbus_fieldbus::BusError;

/// Why a connection cannot continue.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProtocolError {
    /// The first byte of a packet is not that of ISO on TCP.
    #[error(
        "a packet of it begins with 0x{0:02X}, where ISO on TCP has 0x03; check that it is meant to speak S7 \
         with this address"
    )]
    NoIsoOnTcp(u8),
    /// The length of a packet is impossible.
    #[error("a packet of it is said to have {0} bytes, but ISO on TCP has 7 to 4096 here")]
    PacketLength(usize),
    /// The header of a TPDU is invalid.
    #[error("the header of a transport unit of it (COTP) is malformed")]
    TransportHeader,
    /// A TPDU that class 0 does not have.
    #[error("it sent the transport unit 0x{0:02X}, which COTP of class 0 does not have")]
    TransportUnit(u8),
    /// Another transport class.
    #[error("it asks for transport class {0}, but S7 has class 0")]
    TransportClass(u8),
    /// Data before a connection was requested.
    #[error("it sent data before it asked for a transport connection")]
    NotConnected,
    /// A second request, or a confirmation without a request.
    #[error("it asked for, or confirmed, a transport connection that stands already")]
    ConnectedTwice,
    /// A message in pieces that is too long, or has empty pieces.
    #[error(
        "it sent a message in pieces that is longer than the agreed {0} bytes, or has empty pieces"
    )]
    Pieces(u16),
    /// Another protocol within ISO on TCP.
    #[error("a message of it begins with 0x{0:02X}, where S7 has 0x32")]
    NoS7(u8),
    /// `S7CommPlus`, the newer protocol of the same maker.
    #[error(
        "it speaks S7CommPlus, the protocol of TIA Portal and of symbolic access; here is PUT and GET \
         (S7 communication) with absolute addresses"
    )]
    S7CommPlus,
    /// The lengths in the header do not add up.
    #[error("the lengths in a message of it do not add up")]
    Lengths,
    /// The kind of PDU does not exist.
    #[error("it sent a message of kind {0}, which S7 does not have")]
    Kind(u8),
    /// An answer without a request.
    #[error("it sent an answer that nobody asked for")]
    NotAsked,
    /// A request where an answer is expected.
    #[error("it asks, where it has to answer")]
    Asks,
    /// The transport connection was ended or refused.
    #[error("it ended the transport connection (reason {0})")]
    Disconnected(u8),
    /// The peer rejected a transport unit.
    #[error("it rejected a transport unit (cause {0})")]
    Rejected(u8),
    /// The negotiated length leaves no room, or is more than was requested.
    #[error("it wants units of {0} bytes, but 64 to {LONGEST} were asked for")]
    Agreed(u16),
    /// An answer that does not match its request.
    #[error("its answer is not one to what was asked: {0}")]
    Answer(&'static str),
}

impl ProtocolError {
    /// The error that ends the connection.
    pub fn into_error(self) -> BusError {
        let text = self.to_string();
        match self {
            Self::Disconnected(_) => BusError::Left(text),
            _ => BusError::Protocol(text),
        }
    }
}
