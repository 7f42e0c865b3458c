//! `tickbus show` as users run it: the page of a recording, and what it says about wrong input.

use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead as _, BufReader, Lines, Read as _, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Output, Stdio};

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

/// Starts a command, and checks what it says of the recording; returns its further lines and the address of the page.
fn started(
    folder: &Path,
    arguments: &[&str],
    told: &str,
) -> (Running, Lines<BufReader<ChildStdout>>, String) {
    let child = show(folder, arguments).stdout(Stdio::piped()).spawn();
    let mut child = Running(child.expect("the command runs"));
    let mut lines = BufReader::new(child.0.stdout.take().expect("it is piped")).lines();
    let mut line = || lines.next().expect("a line").expect("text");
    assert_eq!(line(), format!("show: {told}"));
    let url = line();
    let url = url.strip_prefix("show: page at ").expect("the address");
    assert!(url.starts_with("http://127.0.0.1:"), "{url}");
    let url = url.to_owned();
    (child, lines, url)
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
    let (mut child, mut lines, url) = started(
        folder.path(),
        &["run.csv", "--fault", "Lamp"],
        "run.csv: 2 signals, 4 ticks from 1ms to 6ms, in 1 MB of memory",
    );
    let url = &url;
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
        assert_eq!(lines.next().expect("a line").expect("text"), "show: ok");
        assert_eq!(child.0.wait().expect("it ends").code(), Some(0));
    }
}

/// Files as Icarus Verilog 11.0 and `PyVCD` 0.5 have written them.
#[test]
fn vcd_of_other_programs_is_a_page_as_well() {
    let folder = super::testing::repository().join("tests/it/vcd");
    let told = "icarus.vcd: 10 signals, 24 ticks from 0s to 82ns, in 1 MB of memory";
    let (_icarus, _, url) = started(&folder, &["icarus.vcd"], told);
    let driver = &get(&url, "/signals")["drivers"][0];
    let signals = driver["signals"].as_array().expect("a list").iter();
    let known: Vec<_> = signals
        .map(|it| format!("{} {} {}", it["name"], it["type"], it["value"]).replace('"', ""))
        .collect();
    let expected = [
        "top.value USINT 7",
        "top.maybe BOOL 1",
        "top.clk BOOL 0",
        "top.reset BOOL 0",
        "top.tiny USINT 9",
        "top.i DINT 5",
        "top.level LREAL 2500",
        "top.cpu.clk BOOL 0",
        "top.cpu.reset BOOL 0",
        "top.cpu.value USINT 7",
    ];
    assert_eq!(known, expected);
    // At 10 ns the value is not known yet, and the integer is negative.
    let at = get(&url, &format!("/history/{}/at/0.000004", driver["id"]));
    assert_eq!(at["values"][0], json!([0, null]));
    assert_eq!(at["values"][5], json!([5, -3]));

    let told = "pyvcd.vcd: 5 signals, 7 ticks from 0s to 6ms, in 1 MB of memory";
    let (_pyvcd, _, url) = started(&folder, &["pyvcd.vcd"], told);
    let driver = &get(&url, "/signals")["drivers"][0];
    let trend = get(&url, &format!("/trend/{}/3/0/9", driver["id"]));
    assert_eq!(driver["signals"][3]["name"], json!("plant.tank.level"));
    let values = json!([1.5, 0.25, 0.5, 0.75, 1.0, 1.25]);
    assert_eq!(trend["signals"]["3"]["values"], values);
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
        "$timescale 1 ns $end\n$var wire 1 a A $end\n$enddefinitions $end\n#0\n1b\n",
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
        (&["empty.vcd"], "the file ends within its header"),
        (
            &["words.vcd"],
            "words.vcd:1: \"hello\" is no command of a header",
        ),
        (
            &["other.vcd"],
            "other.vcd: line 5: the value of \"b\", which the header does not have",
        ),
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
