//! One device: configuration, open, exchange, statistics, close.

mod status;

pub use status::Code;
