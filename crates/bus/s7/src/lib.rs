//! S7 communication over ISO on TCP, as spoken by CPUs of the S7 family (PUT and GET), panels and libraries.
//!
//! The core has no I/O: [`transport`] has the packets, [`pdu`] the PDUs within them, [`item`] the variables,
//! [`szl`] the system status lists. [`ServerSession`] is a server's side of one connection, [`ClientSession`] a
//! client's. The buses [`S7Server`] and [`S7Client`] use them.
//!
//! The core can be used without the rest. A server takes bytes, in pieces of any size, and gives bytes:
//!
//! ```
//! use std::ops::Range;
//!
//! use tickbus_base::time::Nanos;
//! use tickbus_bus_s7::item::{ReturnCode, Object};
//! use tickbus_bus_s7::szl::{Facts, Identity};
//! use tickbus_bus_s7::{ServerSession, Memory};
//!
//! /// A CPU with eight bytes of inputs.
//! struct Cpu([u8; 8]);
//!
//! impl Memory for Cpu {
//!     fn read(&mut self, object: Object, range: Range<usize>) -> Result<&[u8], ReturnCode> {
//!         match object {
//!             Object::Inputs => self.0.get(range).ok_or(ReturnCode::ADDRESS),
//!             _ => Err(ReturnCode::MISSING),
//!         }
//!     }
//!
//!     fn write(&mut self, _: Object, _: usize, _: &[u8]) -> Result<(), ReturnCode> {
//!         Err(ReturnCode::ACCESS)
//!     }
//!
//!     fn write_bit(&mut self, _: Object, _: usize, _: u8, _: bool) -> Result<(), ReturnCode> {
//!         Err(ReturnCode::ACCESS)
//!     }
//!
//!     fn done(&mut self) {}
//!
//!     fn blocks(&self) -> &[(u16, usize)] {
//!         &[]
//!     }
//! }
//!
//! let facts = Facts {
//!     identity: Identity::of_driver("press"),
//!     pdu: 480,
//!     clients: 1,
//!     epoch: Facts::NEVER_SET,
//! };
//! let (mut conversation, mut cpu) = (ServerSession::default(), Cpu([0; 8]));
//! // A client asks for a connection to rack 0, slot 1.
//! let came = [
//!     3, 0, 0, 22, 17, 0xe0, 0, 0, 0, 1, 0, 0xc1, 2, 1, 0, 0xc2, 2, 1, 1, 0xc0, 1, 10,
//! ];
//! let mut reply = Vec::new();
//! let taken = conversation.packet(Nanos::ZERO, &came, &facts, &mut cpu, &mut reply)?;
//! assert_eq!(taken, came.len());
//! assert_eq!(reply[5], 0xd0, "it is confirmed");
//! # Ok::<(), tickbus_bus_s7::ProtocolError>(())
//! ```

mod client;
mod identity;
pub mod item;
mod keys;
mod kind;
mod length;
pub mod pdu;
mod place;
mod protocol_error;
mod server;
mod server_session;
pub mod szl;
pub mod transport;
mod tsap;
mod userdata;
mod variable;

pub use client::{
    ClientOptions, ClientSession, ConnectionParameters, End, FrameFields, Refusal, S7Client,
    SessionEvent,
};
pub use place::Start;
pub use protocol_error::ProtocolError;
pub use server::{Block, S7Server, ServerOptions};
pub use server_session::{Memory, ServerSession};
pub use tsap::Tsap;
pub use variable::Variable;

/// The bytes written as hexadecimal digits; blanks are ignored.
#[cfg(test)]
pub(crate) fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u8> = text
        .chars()
        .filter(|c| !c.is_whitespace())
        .map(|c| u8::try_from(c.to_digit(16).expect("a digit")).expect("below 16"))
        .collect();
    digits
        .chunks_exact(2)
        .map(|pair| pair[0] * 16 + pair[1])
        .collect()
}
