//! PROFIBUS DP over a serial line: DP-V0 slaves in software.
//!
//! The core knows no port and no image. [`telegram`] reads and writes what is on the line; a [`Station`] is one slave,
//! a function of its state, the time and a request, to an answer.

mod configuration;
mod event;
mod parameters;
mod station;
pub mod telegram;

pub use configuration::Configuration;
pub use event::{Event, Leaving};
pub use station::{Identity, Process, State, Station};
