//! S7 communication over ISO on TCP, as spoken by CPUs of the S7 family (PUT and GET), panels and libraries.
//!
//! The core has no I/O: [`transport`] has the packets, [`pdu`] the PDUs within them, [`item`] the variables,
//! [`szl`] the system status lists. [`Conversation`] is a server's side of one connection, [`Dialog`] a
//! client's. The buses [`S7Server`] and [`S7Client`] use them.

mod client;
mod conversation;
mod fault;
pub mod item;
mod kind;
mod length;
pub mod pdu;
mod place;
mod server;
pub mod szl;
pub mod transport;
mod tsap;
mod userdata;
mod variable;

pub use client::{ClientOptions, Dialog, End, Frames, News, Refusal, S7Client, Terms};
pub use conversation::{Conversation, Memory};
pub use fault::Fault;
pub use place::Start;
pub use server::{Block, S7Server, ServerOptions};
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
