//! `tickbus` commands as processes, with their lines read as they come.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::io::{BufRead as _, BufReader, Lines, Write as _};
use std::net::TcpStream;
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

/// A client that is connected directly with the dispatcher.
pub struct LabClient(BufReader<TcpStream>);

impl LabClient {
    /// A client with this first line, which asks for answers (`V=2` or `V=3`).
    pub fn connect(address: &str, identification: &str) -> Self {
        let mut client = Self::open(address);
        client.say(identification);
        client.until("END");
        client
    }

    /// A client that has said nothing.
    pub fn open(address: &str) -> Self {
        let stream = TcpStream::connect(address).expect("it listens");
        let patience = std::time::Duration::from_secs(60);
        stream
            .set_read_timeout(Some(patience))
            .expect("it is a time");
        Self(BufReader::new(stream))
    }

    /// Sends a line.
    pub fn say(&mut self, line: &str) {
        let line = format!("{line}\n");
        let stream = self.0.get_mut();
        stream.write_all(line.as_bytes()).expect("it reads");
    }

    /// Reads lines until one begins with `begin`.
    pub fn until(&mut self, begin: &str) -> String {
        self.find(begin, |line| line.starts_with(begin))
    }

    /// Reads lines of values until one has `value`, such as `AI1=5`.
    pub fn until_values(&mut self, value: &str) {
        self.find(value, |line| {
            line.strip_prefix("P ")
                .is_some_and(|values| values.split(' ').any(|one| one == value))
        });
    }

    fn find(&mut self, what: &str, is_it: impl Fn(&str) -> bool) -> String {
        let mut read = Vec::new();
        loop {
            let mut line = String::new();
            let count = self.0.read_line(&mut line).unwrap_or(0);
            assert!(count > 0, "no {what} in {read:?}");
            let line = line.trim_end();
            if is_it(line) {
                return line.to_owned();
            }
            read.push(line.to_owned());
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
    }
}
