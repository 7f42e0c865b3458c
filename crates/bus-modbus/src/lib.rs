//! Modbus: over TCP and, as RTU, over a serial line; as server and as client.
//!
//! The codec knows no port and no image: [`answer()`] is a server's half, a request in and an answer out against
//! [`Tables`]; [`Query`] is a client's half. [`mbap`] and [`rtu`] put telegrams around it.

mod answer;
mod client;
mod function;
mod identification;
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

/// The holding register at which `%I` begins among those of a PLC or of a machine that is a server, unless a driver.cfg
/// says otherwise: behind the outputs of all but the largest, and where `OpenPLC` has its memory words.
const INPUTS: usize = 1024;

/// This system's serial ports are not used yet.
#[cfg(not(unix))]
fn no_serial_port() -> tickbus_fieldbus::BusError {
    tickbus_fieldbus::BusError::Link(
        "this version has serial ports on Linux and macOS alone; use Modbus TCP".to_owned(),
    )
}
