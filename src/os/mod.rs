//! What only the operating system can do, behind safe functions; one file per thing.

mod glance;
mod library;
mod log;
#[cfg(unix)]
mod own_file;
mod poll;
mod poll_set;
mod serial;
#[cfg(unix)]
mod shared_memory;

pub use glance::Glance;
pub use library::{Library, one_line};
#[cfg(test)]
pub(crate) use log::logged;
pub use log::{dropped_log_lines, flush_log, is_told, is_told_rarely, log_to_stderr};
#[cfg(unix)]
pub use own_file::own_file;
pub use poll::{Interest, Poller, Source};
pub use poll_set::{PollSet, Ready};
#[cfg(unix)]
pub use serial::SerialPort;
pub use serial::{Parity, SerialSettings};
#[cfg(unix)]
pub use shared_memory::SharedMemory;
