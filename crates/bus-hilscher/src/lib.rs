//! Hilscher's cards through the vendor's own drivers: `hilscher-cif`, the boards of the older generation, and
//! `hilscher-cifx`, cifX and netX.
//!
//! A kind has three files: the table of its errors, the library behind safe functions, and the order of the calls.
//! No library of the vendor's belongs to tickbus.

mod answer;
pub mod cif;
pub mod cifx;
mod timeout;
