//! The tests of this crate, in one program.
#![allow(missing_docs, reason = "tests")]

mod ascii;
mod mqtt;
