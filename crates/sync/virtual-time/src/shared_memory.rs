//! Clients in other processes of the same computer, through shared memory: the same messages as over TCP, but without a
//! system call for each.
//!
//! The memory has a seat for each client, with a mailbox each way that holds one frame. A waiting thread spins for a
//! moment, then yields, and then sleeps until it is woken.

mod client;
mod layout;
mod mailbox;
mod patience;
mod server;

pub use client::{connect, join};
pub use server::Listener;
