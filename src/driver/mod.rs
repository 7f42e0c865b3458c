//! One device: configuration, open, exchange, statistics, close.
