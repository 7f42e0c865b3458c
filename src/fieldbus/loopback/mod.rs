//! Both ends of a bus in one process: by link name, or with a hosted PLC program at the other end.

mod options;

pub use options::{Mode, Options, Peer};
