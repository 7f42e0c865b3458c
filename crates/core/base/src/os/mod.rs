//! Thin, safe wrappers around the operating system; one file per topic.

mod at_exit;
mod file_lock;
mod freed_memory;
pub mod helper;
mod library;
#[cfg_attr(not(unix), path = "no_linked_terminal.rs")]
mod linked_terminal;
mod log;
mod marked;
#[cfg(unix)]
mod named_memory;
mod open_files;
mod own_file;
mod peer_silence;
mod poll;
mod poll_set;
mod pollable;
#[cfg(unix)]
mod process_watch;
#[cfg(unix)]
mod pseudo_terminal;
mod real_time;
mod serial;
mod serial_line;
mod shared_memory;
mod time_stamp_counter;
mod timer_slack;

/// The questions to a [`PollSet`], and its answers.
pub use crate::time::{Interest, Ready};
pub use at_exit::at_exit;
pub use file_lock::{Lock, lock_file, lock_holder, unlock_file};
pub use freed_memory::return_freed_memory;
pub use library::{Library, one_line};
pub use linked_terminal::LinkedTerminal;
pub use log::{
    collect_log, dropped_log_lines, flush_log, has_log, is_rarely_logged, is_told, log_to_stderr,
    take_log,
};
pub use marked::{Characters, Marks};
#[cfg(unix)]
pub use named_memory::NamedMemory;
pub use open_files::{OUT_OF_FILES, is_out_of_files, raise_open_files};
pub use own_file::own_file;
pub use peer_silence::peer_silence;
pub use poll_set::PollSet;
pub use pollable::{Pollable, Source};
#[cfg(unix)]
pub use process_watch::ProcessWatch;
#[cfg(unix)]
pub use pseudo_terminal::{PseudoTerminal, names_pseudo_terminal};
pub(crate) use real_time::{Os, RealTimeSystem};
pub use serial::{Parity, SerialPort, SerialSettings};
pub use serial_line::{SerialEar, SerialLine};
pub use shared_memory::{MemoryFile, SharedMemory};
pub use time_stamp_counter::TimeStampCounter;
pub use timer_slack::wake_on_time;
