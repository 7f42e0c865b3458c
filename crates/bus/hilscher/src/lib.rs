//! Hilscher's cards through the vendor's own drivers: `hilscher-cif`, the boards of the older generation, and
//! `hilscher-cifx`, cifX and netX.
//!
//! A kind has three files: the table of its errors, the library behind safe functions, and the order of the calls.
//! tickbus contains no library of the vendor.

mod answer;
pub mod cif;
pub mod cifx;
mod timeout;
