//! The tests of this crate, in one program.

mod common;
mod direct;
mod example;
mod model_check;
mod neighbours;
mod next_update;
mod recording;
mod rejoin;
mod rules;
mod saving;
mod sequences;
mod server;
mod transports;
