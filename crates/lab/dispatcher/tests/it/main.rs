//! The tests of this crate, in one program.
#![allow(missing_docs, reason = "tests")]

mod client;
mod common;
mod document;
mod host_names;
mod hosts;
mod key;
mod model;
mod operator;
mod paper;
mod promises;
mod rules;
mod sockets;
