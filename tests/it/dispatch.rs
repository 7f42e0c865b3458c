//! `tickbus dispatch` as a process: served, interrupted, restarted, misused.
#![cfg(unix)]
#![allow(missing_docs, reason = "tests")]

use std::io::{BufRead as _, BufReader, Lines, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Output, Stdio};

use rustix::process::{Pid, Signal, kill_process};

struct Dispatch {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

fn command(patch: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
    command
        .arg("dispatch")
        .arg("--patch")
        .arg(patch)
        .args(arguments);
    command
}

impl Dispatch {
    fn start(patch: &Path, arguments: &[&str]) -> Self {
        let mut child = command(patch, &["--listen", "127.0.0.1:0"])
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the tickbus program runs");
        let stdout = child.stdout.take().expect("it is piped");
        let lines = BufReader::new(stdout).lines();
        Self { child, lines }
    }

    fn line(&mut self) -> String {
        self.lines.next().expect("a further line").expect("text")
    }

    /// Interrupts it; returns the last line and the exit code.
    fn interrupt(mut self) -> (String, Option<i32>) {
        let pid = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        kill_process(pid.expect("it runs"), Signal::INT).expect("it runs");
        let last = self.lines.by_ref().map(|line| line.expect("text")).last();
        let status = self.child.wait().expect("it ends");
        (last.unwrap_or_default(), status.code())
    }
}

/// A client: sends a line, and returns its received lines up to the one that begins with `until`.
fn ask(stream: &TcpStream, line: &str, until: &str) -> Vec<String> {
    let mut writer = stream;
    writer
        .write_all(format!("{line}\r\n").as_bytes())
        .expect("it reads");
    let mut heard = Vec::new();
    // Nothing is sent after the awaited line, so no line is lost with the reader.
    let mut lines = BufReader::new(stream).lines();
    while !heard
        .last()
        .is_some_and(|line: &String| line.starts_with(until))
    {
        heard.push(lines.next().expect("a line").expect("text"));
    }
    heard
}

#[test]
fn a_laboratory_is_served_interrupted_and_found_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let patch = folder.path().join("lab.toml");
    for (round, connections) in [0, 1].into_iter().enumerate() {
        let mut dispatch = Dispatch::start(&patch, &["--hold"]);
        let expected = format!(
            "dispatch: {connections} connections from {}",
            patch.display()
        );
        assert_eq!(dispatch.line(), expected);
        let line = dispatch.line();
        let address = line
            .strip_prefix("dispatch: listening on 127.0.0.1:")
            .expect(&line);
        let port: u16 = address.parse().expect("a port");
        let connect = || TcpStream::connect(("127.0.0.1", port)).expect("it listens");
        let (pump, logo) = (connect(), connect());
        ask(&pump, "VP PUMP Q01 V=2", "END");
        ask(&logo, "VR LOGO I01 V=2", "END");
        if round == 0 {
            ask(&logo, "CONNECT I1:PUMP:Q1", "OK CONNECT");
        }
        ask(&pump, "P Q1=24\r\nPING", "OK PING");
        assert_eq!(ask(&logo, "", "P "), ["P I1=24"]);
        // The value may have been on its way before that empty line was read.
        ask(&logo, "PING", "OK PING");
        let (last, code) = dispatch.interrupt();
        let lines = [7, 6][round];
        assert_eq!(
            last,
            format!("dispatch: ok lines={lines} values=1 overtaken=0 refused=0 connections=1")
        );
        assert_eq!(code, Some(0));
    }
}

#[test]
fn it_stops_after_its_duration() {
    let folder = tempfile::tempdir().expect("a folder");
    let patch = folder.path().join("lab.toml");
    let mut dispatch = Dispatch::start(&patch, &["--duration", "50ms"]);
    let last = dispatch
        .lines
        .by_ref()
        .map(|line| line.expect("text"))
        .last();
    assert!(last.is_some_and(|line| line.starts_with("dispatch: ok lines=0 ")));
    assert_eq!(dispatch.child.wait().expect("it ends").code(), Some(0));
}

#[test]
fn mistakes_have_the_exit_codes_of_the_house() {
    let folder = tempfile::tempdir().expect("a folder");
    let patch = folder.path().join("lab.toml");
    let run =
        |arguments: &[&str]| -> Output { command(&patch, arguments).output().expect("it runs") };
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();

    let output = run(&["--idle", "0s"]);
    assert_eq!(output.status.code(), Some(2));
    let output = run(&["--listen", "nowhere"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("has no port"));

    let output = run(&["--lab", "hall"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("--zenoh"));
    let output = run(&[
        "--listen",
        "127.0.0.1:0",
        "--zenoh",
        "--zenoh-connect",
        "there",
    ]);
    assert_eq!(output.status.code(), Some(2));
    let said = text(&output.stderr);
    let expected = if cfg!(feature = "zenoh") {
        "dispatch: \"there\" is no endpoint of Zenoh ("
    } else {
        "dispatch: this tickbus was built without Zenoh; build it with "
    };
    assert!(said.starts_with(expected), "{said}");

    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = taken.local_addr().expect("it is bound").to_string();
    let output = run(&["--listen", &address]);
    assert_eq!(output.status.code(), Some(3));
    let said = text(&output.stdout);
    assert!(
        said.starts_with(&format!(
            "dispatch: failed reason=\"cannot listen on {address} ("
        )),
        "{said}"
    );

    #[cfg(feature = "page")]
    {
        let output = run(&["--listen", "127.0.0.1:0", "--page", &address]);
        assert_eq!(output.status.code(), Some(3));
        let said = text(&output.stdout);
        let expected = format!("failed reason=\"the page cannot be served on {address} (");
        assert!(said.contains(&expected), "{said}");
    }

    std::fs::write(&patch, "[patch]\n\"A:Q1\" = \"B:Q1\"\n").expect("it can be written");
    let output = run(&["--listen", "127.0.0.1:0"]);
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    assert!(
        said.contains("lab.toml:2:10: \"A:Q1\" is no input"),
        "{said}"
    );
    assert_eq!(said.lines().last(), Some("dispatch: failed mistakes=1"));
}
