//! Modbus over TCP and UDP, and as RTU or ASCII over a serial line or, as RTU, over TCP; server and client.
//!
//! The codec knows no port and no image: [`answer()`] is the server's half, which takes a request and makes
//! the answer using [`Tables`]; [`Request`] is the client's half. [`mbap`], [`rtu`] and [`ascii`] frame their PDUs as
//! telegrams.
//!
//! The codec can be used without the rest. A server answers from bytes of its own:
//!
//! ```
//! use tickbus_bus_modbus::mbap::{self, Telegram};
//! use tickbus_bus_modbus::{Identification, Map, Side, Tables, answer};
//!
//! let inputs = [0x12, 0x34];
//! let mut outputs = [0, 0];
//! let mut tables = Tables {
//!     map: &Map::of_areas(Side::Sends, None, 2, 2),
//!     sends: &inputs,
//!     holds: &mut outputs,
//! };
//! let who = Identification::of_driver("press");
//! // Read one input register: what came over TCP, in pieces of any size.
//! let came = [0, 7, 0, 0, 0, 6, 1, 4, 0, 0, 0, 1];
//! let (telegram, length) = Telegram::parse(&came)?.expect("it is complete");
//! assert_eq!(length, came.len());
//! let mut reply = Vec::new();
//! mbap::append(telegram.transaction, telegram.unit, &mut reply, |pdu| {
//!     answer(telegram.pdu, &mut tables, &who, pdu)
//! });
//! assert_eq!(reply, [0, 7, 0, 0, 0, 5, 1, 4, 2, 0x12, 0x34]);
//! # Ok::<(), mbap::TelegramError>(())
//! ```

mod answer;
pub mod ascii;
mod client;
mod coding;
mod element_address;
mod function;
mod identification;
mod identity;
mod keys;
mod kind;
mod line;
pub mod mbap;
mod piece;
mod restricts;
pub mod rtu;
mod serial_settings;
mod server;
mod shown;
mod stations;
mod table;
mod tables;
mod tag_address;
#[cfg(feature = "tls")]
mod tls;
#[cfg(not(feature = "tls"))]
#[path = "no_tls.rs"]
mod tls;
mod tls_options;

pub use answer::{Done, answer, refuse};
pub use client::{
    AnswerError, Block, Capabilities, ClientOptions, ModbusClient, Region, Request, queries,
};
pub use coding::Coding;
pub use element_address::ElementAddress;
pub use function::{Exception, Function, PDU_LIMIT};
pub use identification::Identification;
pub use line::{Line, Serial};
pub use piece::Piece;
pub use server::{ModbusServer, ServerOptions};
pub use stations::Stations;
pub use table::{Span, Table};
pub use tables::{Map, Side, Tables};
pub use tag_address::TagAddress;
pub use tls_options::Tls;

/// The default holding register at which `%I` begins in a server, PLC or machine: after the outputs except for very
/// large ones, and where `OpenPLC` has its memory words.
const INPUTS: usize = 1024;
