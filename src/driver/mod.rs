//! One device: configuration, open, exchange, statistics, close.

mod config;

pub use config::{Config, Timing};
