//! `tickbus logo` as a process: the lesson of docs/virtual-lab.md, edges, a dispatcher that goes and comes, mistakes.
#![cfg(unix)]
#![allow(missing_docs, reason = "tests")]

use std::io::{BufRead as _, BufReader, Lines, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Output, Stdio};

use rustix::process::{Pid, Signal, kill_process};

/// A tickbus command that runs until it is interrupted.
struct Running {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

fn tickbus(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
    command.current_dir(folder).args(arguments);
    command
}

impl Running {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut child = tickbus(folder, arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the tickbus program runs");
        let stdout = child.stdout.take().expect("it is piped");
        let lines = BufReader::new(stdout).lines();
        Self { child, lines }
    }

    /// The next line that begins like this, without that beginning.
    fn line(&mut self, beginning: &str) -> String {
        loop {
            let line = self.lines.next().expect("a further line").expect("text");
            if let Some(rest) = line.strip_prefix(beginning) {
                return rest.to_owned();
            }
        }
    }

    /// Sends a signal; returns the last line and the exit code.
    fn end(mut self, signal: Signal) -> (String, Option<i32>) {
        let pid = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        kill_process(pid.expect("it runs"), signal).expect("it runs");
        let last = self.lines.by_ref().map(|line| line.expect("text")).last();
        let status = self.child.wait().expect("it ends");
        (last.unwrap_or_default(), status.code())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // The process has already ended, if all went well.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A dispatcher, and its address.
fn dispatcher(folder: &Path, listen: &str) -> (Running, String) {
    let mut running = Running::start(folder, &["dispatch", "--listen", listen]);
    let address = running.line("dispatch: listening on ");
    (running, address)
}

/// A client controlled by a test.
struct House {
    stream: TcpStream,
    lines: Lines<BufReader<TcpStream>>,
}

impl House {
    fn join(address: &str, identification: &str) -> Self {
        let stream = TcpStream::connect(address).expect("it listens");
        let lines = BufReader::new(stream.try_clone().expect("a descriptor")).lines();
        let mut house = Self { stream, lines };
        house.say(identification);
        house.hear("VP:HOUSE:");
        house
    }

    fn say(&mut self, text: &str) {
        self.stream
            .write_all(format!("{text}\r\n").as_bytes())
            .expect("it reads");
    }

    /// Waits for a line that begins like this; returns it.
    fn hear(&mut self, beginning: &str) -> String {
        loop {
            let line = self.lines.next().expect("a further line").expect("text");
            if line.starts_with(beginning) {
                return line;
            }
        }
    }
}

/// The contents of the code blocks of docs/virtual-lab.md that begin like this, including their beginning.
fn document(beginning: &str) -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/virtual-lab.md");
    let document = std::fs::read_to_string(path).expect("the document");
    let start = document.find(beginning).expect(beginning);
    let code = document[start..].split("\n```").next().expect("an end");
    format!("{code}\n")
}

#[test]
fn the_lesson_goes_as_it_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let program = document("[blocks]\nbutton").replace("5s", "50ms");
    std::fs::write(folder.join("stairs.toml"), program).expect("it can be written");
    std::fs::write(folder.join("stairs.patch"), document("CONNECT")).expect("it can be written");
    let shown = document("$ tickbus logo");
    let mut shown = shown.lines();
    let command = shown
        .next()
        .and_then(|line| line.strip_prefix("$ tickbus "));
    let mut arguments: Vec<&str> = command.expect("a command").split(' ').collect();

    let (dispatch, address) = dispatcher(folder, "127.0.0.1:0");
    arguments.extend(["--dispatcher", &address]);
    let mut logo = Running::start(folder, &arguments);
    for line in shown {
        let line = line.replace("127.0.0.1:20070", &address);
        assert_eq!(logo.line(""), line);
    }

    let said = document("VP HOUSE");
    let mut said = said.lines();
    let mut house = House::join(&address, said.next().expect("who it is"));
    for cable in ["I1:HOUSE:Q1", "I2:HOUSE:Q2", "Q1:HOUSE:I1"] {
        logo.line(&format!("logo: {cable}: connected"));
    }
    house.say(said.next().expect("a button is pressed"));
    assert_eq!(house.hear("P I1=2"), "P I1=24");
    house.say(said.next().expect("a button is released"));
    assert_eq!(house.hear("P I1="), "P I1=0");

    let (last, code) = logo.end(Signal::INT);
    let rest = last.strip_prefix("logo: ok scans=").expect(&last);
    assert_eq!(rest.split_once(' ').expect(&last).1, "joined=1");
    assert_eq!(code, Some(0));
    assert_eq!(dispatch.end(Signal::INT).1, Some(0));
}

const COUNTER: &str = "[blocks]\n\
    pulses = { type = \"counter\", input = \"I1\", limit = 1000 }\n\
    [outputs]\nQ1 = \"pulses\"\nQ2 = \"I1\"\nAQ1 = \"pulses\"\n";

#[test]
fn no_edge_is_lost_that_comes_between_two_scans() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("counter.toml"), COUNTER).expect("it can be written");
    std::fs::write(
        folder.join("counter.patch"),
        "CONNECT I1:HOUSE:Q1 AQ1:HOUSE:AI1 Q2:HOUSE:I1\n",
    )
    .expect("it can be written");
    let (_dispatch, address) = dispatcher(folder, "127.0.0.1:0");
    let mut house = House::join(&address, "VP HOUSE Q01 I01 AI01");
    let mut logo = Running::start(
        folder,
        &[
            "logo",
            "counter.toml",
            "--name",
            "COUNTER",
            "--patch",
            "counter.patch",
            "--dispatcher",
            &address,
            "--cycle",
            "100ms",
        ],
    );
    logo.line("logo: Q2:HOUSE:I1: connected");
    // All of them in one packet, so that they arrive within one cycle.
    house.say(
        "P Q1=24\r\nP Q1=0\r\nP Q1=24 Q1=0\r\n"
            .repeat(100)
            .trim_end(),
    );
    let mut pulses = 0;
    loop {
        let line = house.hear("P ");
        pulses += usize::from(line.contains("I1=24"));
        if line.contains("AI1=200") {
            break;
        }
    }
    assert_eq!(pulses, 200, "they are passed on as well");
}

#[test]
fn a_dispatcher_that_was_killed_is_found_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // While there is no dispatcher, the input is off, and the lamp is on.
    std::fs::write(
        folder.join("not.toml"),
        "[blocks]\ndark = { type = \"NOT\", input = \"I1\" }\n[outputs]\nQ1 = \"dark\"\n",
    )
    .expect("it can be written");
    std::fs::write(
        folder.join("not.patch"),
        "CONNECT I1:HOUSE:Q1 Q1:HOUSE:I1\n",
    )
    .expect("it can be written");
    let (dispatch, address) = dispatcher(folder, "127.0.0.1:0");
    let mut house = House::join(&address, "VP HOUSE Q01 I01");
    let arguments = ["logo", "not.toml", "--name", "NOT", "--patch", "not.patch"];
    let mut logo = Running::start(
        folder,
        &[&arguments[..], &["--dispatcher", &address]].concat(),
    );
    logo.line("logo: Q1:HOUSE:I1: connected");
    house.say("P Q1=24");
    house.hear("P I1=0");

    dispatch.end(Signal::KILL);
    drop(house);
    logo.line("logo: disconnected: ");
    let (_dispatch, address) = dispatcher(folder, &address);
    let mut house = House::join(&address, "VP HOUSE Q01 I01");
    house.hear("P I1=24");
    house.say("P Q1=24");
    house.hear("P I1=0");
    let (last, code) = logo.end(Signal::TERM);
    assert!(last.starts_with("logo: ok scans="), "{last}");
    assert!(last.ends_with(" joined=2"), "{last}");
    assert_eq!(code, Some(0));
}

#[test]
fn mistakes_have_the_exit_codes_of_the_house() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let write = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).expect("it can be written");
    };
    write("right.toml", COUNTER);
    write("wrong.toml", "[outputs]\nQ1 = \"I9\"\nQ9 = \"I1\"\n");
    write("wrong.patch", "CONNECT I1:HOUSE:I1\n");
    let run = |arguments: &[&str]| -> Output {
        tickbus(folder, &[&["logo"], arguments].concat())
            .output()
            .expect("it runs")
    };
    let told = |output: &Output| String::from_utf8_lossy(&output.stderr).into_owned();

    let output = run(&["wrong.toml", "--name", "A"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        told(&output),
        "wrong.toml:2:6: there is no input I9; write I1 to I8\n\
         wrong.toml:3:6: there is no output Q9; write Q1 to Q4\n\
         logo: failed mistakes=2\n"
    );
    // With more of them the same program is correct, so that the mistake is a different one.
    let more = ["--inputs", "9", "--outputs", "9", "--patch", "wrong.patch"];
    let output = run(&[&["wrong.toml", "--name", "A"], &more[..]].concat());
    assert_eq!(output.status.code(), Some(1));
    assert!(told(&output).starts_with("wrong.patch:1:1: I1 and I1 cannot be connected; "));
    let output = run(&["right.toml", "--name", "A B"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(told(&output).starts_with("--name: \"A B\" cannot be the name"));

    for wrong in [
        &["right.toml"][..],
        &["right.toml", "--name", "A", "--inputs", "257"],
        &["right.toml", "--name", "A", "--dispatcher", "127.0.0.1:0"],
        &["right.toml", "--name", "A", "--cycle", "0s"],
    ] {
        let output = run(wrong);
        assert_eq!(output.status.code(), Some(2), "{}", told(&output));
    }

    // Nobody listens at a port that was free just now.
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = free.local_addr().expect("it is bound").to_string();
    drop(free);
    let output = run(&[
        "right.toml",
        "--name",
        "A",
        "--dispatcher",
        &address,
        "--duration",
        "300ms",
    ]);
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        said.starts_with(&format!("logo: there is no dispatcher at {address} (")),
        "{said}"
    );
    assert!(said.ends_with(" joined=0\n"), "{said}");
}
