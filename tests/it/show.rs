//! `tickbus show` as users run it: the page of a recording, and what it says about wrong input.

use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use serde_json::{Value, json};

const CSV: &str = "bus.tick,bus.time_ns,bus.status,bus.dropped,Lamp,Height,Lamp.edges\n\
    5,1000000,0,0,0,1.5,0\n6,2000000,1,0,1,1.5,1\n7,3000000,2,0,1,2.5,0\n9,6000000,0,1,0,2.5,1\n";

fn show(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
    command.arg("show").args(arguments).current_dir(folder);
    command
}

/// A running command, which ends with the test, even with one that fails.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs a command that has to fail; returns what it says.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let Output { status, stderr, .. } = show(folder, arguments).output().expect("the command runs");
    assert_eq!(status.code(), Some(1), "{arguments:?}");
    let said = String::from_utf8(stderr).expect("text");
    assert!(said.ends_with("show: failed\n"), "{said}");
    said
}

/// Sends a request without the token; returns the whole answer.
fn ask(url: &str, line: &str, body: &str) -> String {
    let host = url.trim_start_matches("http://").trim_end_matches('/');
    let mut peer = std::net::TcpStream::connect(host).expect("the page is served");
    let length = body.len();
    write!(
        peer,
        "{line} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}"
    )
    .expect("sent");
    let mut answer = String::new();
    peer.read_to_string(&mut answer).expect("text");
    answer
}

/// The document at a path.
fn get(url: &str, path: &str) -> Value {
    let answer = ask(url, &format!("GET {path}"), "");
    let (_, body) = answer.split_once("\r\n\r\n").expect("a body");
    serde_json::from_str(body).unwrap_or_else(|error| panic!("{path}: {error}: {answer}"))
}

#[test]
fn a_recording_is_a_page_with_every_moment_until_it_is_interrupted() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("run.csv"), CSV).expect("there is room");
    let child = show(folder.path(), &["run.csv", "--fault", "Lamp"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the command runs");
    let mut child = Running(child);
    let mut lines = BufReader::new(child.0.stdout.take().expect("it is piped")).lines();
    let mut line = || lines.next().expect("a line").expect("text");
    assert_eq!(
        line(),
        "show: run.csv: 2 signals, 4 ticks from 1ms to 6ms, in 1 MB of memory"
    );
    let url = line();
    let url = url.strip_prefix("show: page at ").expect("the address");
    assert!(url.starts_with("http://127.0.0.1:"), "{url}");
    let signals = get(url, "/signals");
    let driver = &signals["drivers"][0];
    assert_eq!(driver["kind"], json!("recording"));
    assert_eq!(driver["signals"][1]["name"], json!("Height"));
    assert_eq!(driver["signals"][1]["value"], json!(2.5));
    assert_eq!(driver["signals"][1]["writable"], json!(false));
    let reason = get(url, "/line")["drivers"][0]["reason"].to_string();
    assert!(
        reason.contains("a recording, run.csv: 4 ticks in 5ms, from 1ms to 6ms"),
        "{reason}"
    );
    let id = driver["id"].to_string();
    let at = get(url, &format!("/history/{id}/at/2.5"));
    assert_eq!((&at["tick"], &at["status"]), (&json!(6), &json!(1)));
    assert_eq!(at["values"][0], json!([0, 1, null, 1]));
    assert_eq!(at["faults"], json!(["Lamp"]));
    let next =
        |what: &str, tick| get(url, &format!("/history/{id}/next/{what}/{tick}"))["tick"].clone();
    assert_eq!(next("outage", 5), json!(7));
    assert_eq!(next("fault", 5), json!(6));
    assert_eq!(next("1", 5), json!(7));
    assert_eq!(next("1", 7), Value::Null);
    let forced = ask(url, &format!("PUT /force/{id}/Lamp"), "1");
    assert!(forced.starts_with("HTTP/1.1 401 "), "{forced}");
    #[cfg(unix)]
    {
        let interrupted = Command::new("kill")
            .args(["-INT", &child.0.id().to_string()])
            .status();
        assert!(interrupted.is_ok_and(|status| status.success()));
        assert_eq!(line(), "show: ok");
        assert_eq!(child.0.wait().expect("it ends").code(), Some(0));
    }
}

#[test]
fn wrong_input_is_told_with_what_to_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let file = |name: &str, text: &str| fs::write(folder.join(name), text).expect("there is room");
    file("run.csv", CSV);
    file("empty.vcd", "");
    file("words.vcd", "hello\n");
    file(
        "other.vcd",
        "$timescale 1 ns $end\n$var wire 1 a A $end\n$enddefinitions $end\n#0\n1a\n",
    );
    file(
        "cut.vcd",
        "$comment tickbus recording 1 $end\n$comment tick",
    );
    file(
        "none.csv",
        CSV.lines()
            .next()
            .map(|line| format!("{line}\n"))
            .expect("a head")
            .as_str(),
    );
    file(
        "box.svg",
        "<svg xmlns=\"http://www.w3.org/2000/svg\"><rect data-tb-x=\"Hight\" width=\"9\" height=\"9\"/></svg>",
    );
    for (arguments, words) in [
        (
            &["missing.vcd"][..],
            "missing.vcd: the recording cannot be read",
        ),
        (&["run.txt"], "run.txt: "),
        (&["empty.vcd"], "the recording is cut within its header"),
        (&["words.vcd"], "this is no VCD"),
        (&["other.vcd"], "only recordings of tickbus can be read"),
        (
            &["cut.vcd"],
            "the recording is cut within its header; record again",
        ),
        (
            &["none.csv"],
            "none.csv: the recording has no whole tick; record again",
        ),
        (
            &["run.csv", "--fault", "Lamb"],
            "no signal \"Lamb\"; did you mean \"Lamp\"?",
        ),
        (&["run.csv", "--config", "missing.cfg"], "missing.cfg"),
        (&["run.csv", "--picture", "no.svg"], "cannot be read"),
        (
            &["run.csv", "--picture", "box.svg"],
            "fits no signal of run.csv (line 1: data-tb-x: there is no signal \"Hight\"; did you mean \"Height\"?)",
        ),
    ] {
        let said = refused(folder, arguments);
        assert!(said.contains(words), "{arguments:?}: {said}");
    }
}

#[test]
fn a_recording_that_needs_more_memory_says_how_much() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = String::from("bus.tick,bus.time_ns,bus.status,bus.dropped");
    for column in 0..100 {
        write!(text, ",S{column}").expect("there is room");
    }
    for tick in 1..=5_000_u32 {
        write!(text, "\n{tick},{tick}000000,0,0").expect("there is room");
        for column in 0..100 {
            write!(text, ",{}.37", tick.wrapping_mul(7919 + column) % 9973).expect("there is room");
        }
    }
    text += "\n";
    fs::write(folder.path().join("run.csv"), text).expect("there is room");
    let said = refused(folder.path(), &["run.csv", "--memory", "1"]);
    assert!(said.contains("the recording needs about "), "{said}");
    assert!(
        said.contains(" MB of memory, and 1 MB are allowed"),
        "{said}"
    );
    assert!(said.contains("allow more with --memory "), "{said}");
}
