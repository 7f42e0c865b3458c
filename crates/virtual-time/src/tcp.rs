//! Clients over TCP: one message each way per client and step.

mod client;
mod connection;
mod server;

pub use client::{connect, join};
pub use server::Listener;
