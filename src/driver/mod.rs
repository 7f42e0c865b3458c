//! One device: configuration, open, exchange, statistics, close.

mod config;
mod layout;

pub use config::{Config, Timing};
