//! `tickbus` commands as processes, with their lines read as they come.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::io::{BufRead as _, BufReader, Lines};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

use rustix::process::{Pid, Signal, kill_process};

/// A running command. It is killed when a test fails before its end.
pub struct Running {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

/// `tickbus dispatch`.
pub fn dispatch(patch: &Path, listen: &str) -> Running {
    let patch = patch.to_str().expect("text");
    Running::of("dispatch", &["--patch", patch, "--listen", listen])
}

/// `tickbus bridge`.
pub fn bridge(arguments: &[&str]) -> Running {
    Running::of("bridge", arguments)
}

impl Running {
    /// A command with these arguments.
    pub fn of(name: &str, arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .arg(name)
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the tickbus program runs");
        let stdout = child.stdout.take().expect("it is piped");
        let lines = BufReader::new(stdout).lines();
        Self { child, lines }
    }

    /// Reads lines until one begins with `begin`; returns the rest of that line.
    pub fn after(&mut self, begin: &str) -> String {
        let mut read = Vec::new();
        for line in &mut self.lines {
            let line = line.expect("text");
            if let Some(rest) = line.strip_prefix(begin) {
                return rest.to_owned();
            }
            read.push(line);
        }
        panic!("no \"{begin}\" in {read:?}");
    }

    /// Interrupts the command; returns the last line and the exit code.
    pub fn interrupt(self) -> (String, Option<i32>) {
        self.signal(Signal::INT)
    }

    /// Sends the command this signal; returns the last line and the exit code.
    pub fn signal(self, signal: Signal) -> (String, Option<i32>) {
        let pid = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        kill_process(pid.expect("it runs"), signal).expect("it runs");
        self.end()
    }

    /// Waits for the end; returns the last line and the exit code.
    pub fn end(mut self) -> (String, Option<i32>) {
        let last = self.lines.by_ref().map(|line| line.expect("text")).last();
        let status = self.child.wait().expect("it ends");
        (last.unwrap_or_default(), status.code())
    }

    /// Kills the command.
    pub fn kill(&mut self) {
        // The command may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
    }
}
