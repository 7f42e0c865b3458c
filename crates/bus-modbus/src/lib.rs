//! Modbus over TCP and, as RTU, over a serial line; server and client.
//!
//! The codec knows no port and no image: [`answer()`] is the server's half, which takes a request and makes
//! the answer using [`Tables`]; [`Query`] is the client's half. [`mbap`] and [`rtu`] frame their PDUs as
//! telegrams.

mod answer;
mod client;
mod function;
mod identification;
mod kind;
mod line;
pub mod mbap;
mod place;
pub mod rtu;
#[cfg(unix)]
mod serial;
mod server;
mod shown;
mod spot;
mod stations;
mod table;
mod tables;

pub use answer::{Done, answer, refuse};
pub use client::{
    Abilities, Block, ClientOptions, Fault, ModbusClient, Piece, Query, Region, queries,
};
pub use function::{Exception, Function, PDU_LIMIT};
pub use identification::Identification;
pub use line::{Line, Serial};
pub use place::{Place, PlaceError};
pub use server::{ModbusServer, ServerOptions};
pub use spot::Spot;
pub use stations::Stations;
pub use table::{Span, Table, put_bits, take_bits};
pub use tables::{Map, Side, Tables};

/// The default holding register at which `%I` begins in a server, PLC or machine: behind the outputs except
/// for very large ones, and where `OpenPLC` has its memory words.
const INPUTS: usize = 1024;

/// Serial ports are not supported on this system yet.
#[cfg(not(unix))]
fn no_serial_port() -> tickbus_fieldbus::BusError {
    tickbus_fieldbus::BusError::Link(
        "this version has serial ports on Linux and macOS alone; use Modbus TCP".to_owned(),
    )
}
