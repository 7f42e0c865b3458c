//! The tests of this crate, in one program.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

mod ends;
mod socket;
mod stations;
