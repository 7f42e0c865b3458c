//! Modbus: over TCP and, as RTU, over a serial line; as server and as client.

mod answer;
mod function;
mod identification;
pub mod mbap;
pub mod rtu;
mod table;
mod tables;

pub use answer::{Done, answer, refuse};
pub use function::{Exception, Function, PDU_LIMIT};
pub use identification::Identification;
pub use table::{Span, Table, put_bits, take_bits};
pub use tables::{Map, Side, Tables};
