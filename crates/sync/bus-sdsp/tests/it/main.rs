//! The tests of this crate, in one program.
#![allow(missing_docs, reason = "tests")]

mod rig;
mod sdsp;
mod server;
mod ticks;
