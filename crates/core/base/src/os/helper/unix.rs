//! A helper of Unix has the line in place of stdin, and the memory's file in place of stdout.

use std::fs::File;
use std::io;
#[cfg(target_vendor = "apple")]
use std::io::Write as _;
use std::os::fd::{AsFd as _, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};

use rustix::process::{Signal, getpid, kill_process};

use super::MemoryFile;

pub(super) type Line = UnixStream;

pub(super) fn start(
    program: &Path,
    command: &str,
    memory: Option<&MemoryFile>,
) -> io::Result<(Child, Line)> {
    let (line, theirs) = UnixStream::pair()?;
    let stderr = || io::stderr().as_fd().try_clone_to_owned();
    let stdout = match memory {
        Some(memory) => memory.try_clone()?,
        None => stderr()?,
    };
    let child = Command::new(program)
        .arg(command)
        .stdin(OwnedFd::from(theirs))
        .stdout(Stdio::from(stdout))
        .stderr(Stdio::from(stderr()?))
        // Ctrl-C goes to the processes of the terminal's group.
        .process_group(0)
        .spawn()?;
    Ok((child, line))
}

pub(super) fn take_over(expects_memory: bool) -> io::Result<(Line, Option<MemoryFile>)> {
    let line = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    line.peer_addr()?;
    let mut memory = None;
    if expects_memory {
        memory = Some(io::stdout().as_fd().try_clone_to_owned()?);
    }
    rustix::stdio::dup2_stdin(File::open("/dev/null")?)?;
    rustix::stdio::dup2_stdout(io::stderr())?;
    Ok((line, memory))
}

pub(super) fn kill_this_process() {
    // Nothing less is certain to work against a library that hangs.
    let _ = kill_process(getpid(), Signal::KILL);
}

#[cfg(not(target_vendor = "apple"))]
pub(super) fn send_quietly(line: &Line, bytes: &[u8]) -> io::Result<usize> {
    Ok(rustix::net::send(
        line,
        bytes,
        rustix::net::SendFlags::NOSIGNAL,
    )?)
}

#[cfg(target_vendor = "apple")]
pub(super) fn send_quietly(mut line: &Line, bytes: &[u8]) -> io::Result<usize> {
    line.write(bytes)
}

/// The signals that end a process, with their usual cause.
const SIGNALS: [(Signal, &str); 8] = [
    (
        Signal::SEGV,
        "SIGSEGV (an access to memory that is not its own)",
    ),
    (Signal::ABORT, "SIGABRT"),
    (Signal::BUS, "SIGBUS"),
    (Signal::FPE, "SIGFPE (a division by zero)"),
    (Signal::ILL, "SIGILL"),
    (Signal::TRAP, "SIGTRAP"),
    (Signal::KILL, "SIGKILL"),
    (Signal::TERM, "SIGTERM"),
];

pub(super) fn ending(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("ended with exit code {code}"),
        (None, Some(number)) => {
            let known = SIGNALS.iter().find(|known| known.0.as_raw() == number);
            match known {
                Some((_, name)) => format!("was ended by {name}"),
                None => format!("was ended by signal {number}"),
            }
        }
        (None, None) => "ended".to_owned(),
    }
}

pub(super) fn was_killed(status: ExitStatus) -> bool {
    status.signal() == Some(Signal::KILL.as_raw())
}
