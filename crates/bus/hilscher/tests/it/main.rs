//! The tests of this crate, in one program.
#![allow(missing_docs, clippy::float_cmp, reason = "tests; small whole numbers")]

mod cif;
mod cifx;
