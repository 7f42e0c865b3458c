//! The tests of this crate, in one program.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    clippy::format_push_string,
    reason = "tests; the values are small whole numbers"
)]

#[cfg(unix)]
mod ends;
mod identification;
mod trouble;
