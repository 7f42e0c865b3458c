//! Helper processes: the tickbus command calls foreign code for its host, where that can crash or hang without harm.
//!
//! A helper has a [`Line`] to its host, and may share [memory](super::SharedMemory) with it. It finds nothing on its stdin,
//! its prints go to stderr, and Ctrl-C at the terminal reaches only the host.

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

use std::io;
use std::path::Path;
use std::process::{Child, ExitStatus};

use super::MemoryFile;
#[cfg(unix)]
use unix as system;
#[cfg(windows)]
use windows as system;

/// The line between a host and its helper. It is at its end once the other process has ended.
pub type Line = system::Line;

/// Starts `program` with the argument `command`, as a helper with a line and memory.
///
/// # Errors
///
/// The system cannot start the program, or has no line.
pub fn start(
    program: &Path,
    command: &str,
    memory: Option<&MemoryFile>,
) -> io::Result<(Child, Line)> {
    system::start(program, command, memory)
}

/// Gives a helper its end of the line, and the memory that its host has passed, if it expects some. It is called once, before
/// anything else reads or prints.
///
/// # Errors
///
/// The process was not started as a helper: `purpose` is the text.
pub fn take_over(expects_memory: bool, purpose: &str) -> io::Result<(Line, Option<MemoryFile>)> {
    system::take_over(expects_memory).map_err(|_| io::Error::other(purpose.to_owned()))
}

/// Waits until the process at the other end of the line has ended or has shut down the line.
pub fn wait_for_end(line: &Line) {
    use rustix::event::PollFd;

    // Without events of interest, only the end of the line ends the wait.
    let mut watched = [PollFd::new(line, rustix::event::PollFlags::empty())];
    while super::poll::poll_once(&mut watched, None).is_err() || watched[0].revents().is_empty() {}
}

/// Ends this process at once, without any further code of it or its libraries.
pub fn kill_this_process() {
    system::kill_this_process();
}

/// Sends without SIGPIPE, which would end a host that does not ignore that signal if the helper is gone.
///
/// # Errors
///
/// As of [`Write::write`](io::Write::write).
pub fn send_quietly(line: &Line, bytes: &[u8]) -> io::Result<usize> {
    system::send_quietly(line, bytes)
}

/// How a process ended, as the end of a sentence about it.
pub fn ending(status: ExitStatus) -> String {
    system::ending(status)
}

/// True if a process was killed from outside, as a system without memory does.
pub fn was_killed(status: ExitStatus) -> bool {
    system::was_killed(status)
}
