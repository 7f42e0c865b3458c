//! INTERBUS controller boards through the vendor's device driver interface (DDI): the bus `interbus-ddi`.
//!
//! `state` is a board's report about its bus, `card` the order of the calls, `library` the calls themselves.

mod card;
mod errors;
mod kind;
mod library;
mod options;
mod state;

pub use errors::ERRORS;
pub use options::Options;
