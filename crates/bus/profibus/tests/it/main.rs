//! The tests of this crate, in one program.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

mod damaged_characters;
mod foreign_diagnosis;
mod foreign_line;
mod foreign_observer;
mod foreign_profibus;
#[cfg(unix)]
mod peer;
#[cfg(unix)]
#[path = "../../../../../tests/peers/pty.rs"]
mod pty;
#[cfg(unix)]
mod rig;
