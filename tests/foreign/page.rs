//! The live page with a foreign program: mbpoll reads forced values over Modbus.
#![allow(missing_docs, reason = "a test")]

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use crate::commands::Running;
use crate::harness::{self, Absent, Test};

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("mbpoll_reads_what_is_forced", mbpoll_reads_what_is_forced),
    (
        "what_is_forced_for_nobody_is_released_after_the_grace_time",
        forced_for_nobody,
    ),
    ("a_killed_plc_is_told_with_its_reason", killed_plc),
];

const SIGNALS: &str = r#"
[[signal]]
name = "Valve"
address = "%QX0.0"
latch = "rising"
[[signal]]
name = "Valve back"
address = "%IX0.0"
[[signal]]
name = "Level \"left\""
address = "%IW2"
type = "INT"
unit = "mm"
scale = { raw = [0, 27648], value = [0.0, 250.0] }
"#;

/// A machine that mirrors every %Q byte, with a page.
pub(super) struct Machine {
    pub(super) command: Running,
    pub(super) page: String,
    token: String,
    /// The port of its bus.
    pub(super) port: String,
    _folder: tempfile::TempDir,
}

impl Machine {
    pub(super) fn start(fieldbus: &str, page: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("driver.cfg");
        let text = format!(
            "[driver]\nid = 4711\nname = \"Tank\"\n[fieldbus]\n{fieldbus}\naddress = \"127.0.0.1:0\"\n\
             [page]\nlisten = \"127.0.0.1:0\"\n{page}\n{SIGNALS}"
        );
        std::fs::write(&file, text).expect("a file");
        let mut command = Running::of("mirror", &[file.to_str().expect("text")]);
        let url = command.after("mirror: page at http://");
        let port = command.after("mirror: opening: listening on 127.0.0.1:");
        let (page, token) = url.split_once("/#token=").expect("a token");
        Self {
            page: page.to_owned(),
            token: token.to_owned(),
            command,
            port,
            _folder: folder,
        }
    }

    /// Sends a request with the token; returns the body of the answer.
    pub(super) fn ask(&self, line: &str, body: &str) -> String {
        let mut stream = TcpStream::connect(&self.page).expect("it listens");
        let (page, token, length) = (&self.page, &self.token, body.len());
        write!(
            stream,
            "{line} HTTP/1.1\r\nHost: {page}\r\nConnection: close\r\nAuthorization: Bearer {token}\r\n\
             Content-Length: {length}\r\n\r\n{body}"
        )
        .expect("it reads");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("UTF-8");
        let (_, body) = answer.split_once("\r\n\r\n").expect("a head");
        body.to_owned()
    }

    fn get(&self, path: &str) -> serde_json::Value {
        serde_json::from_str(&self.ask(&format!("GET {path}"), "")).expect("JSON")
    }

    /// The entry of one signal in `/signals`.
    pub(super) fn signal(&self, index: usize) -> serde_json::Value {
        self.get("/signals")["drivers"][0]["signals"][index].take()
    }

    fn line(&self) -> serde_json::Value {
        self.get("/line")["drivers"][0].take()
    }

    /// Reads a table of its Modbus server until the output is `expected`.
    fn await_register(&self, kind: &str, reference: &str, expected: &str) -> Result<(), Absent> {
        let wanted = format!("[{reference}]: \t{expected}");
        let mut told = String::new();
        let limit = Instant::now() + Duration::from_secs(20);
        while Instant::now() < limit {
            let mut mbpoll = harness::command("mbpoll", "mbpoll")?;
            mbpoll.args(["-1", "-q", "-m", "tcp", "-p", &self.port]);
            mbpoll.args(["-t", kind, "-r", reference, "127.0.0.1"]);
            let output = mbpoll.output().expect("mbpoll runs");
            told = String::from_utf8_lossy(&output.stdout).into_owned();
            if told.lines().any(|line| line.trim_end() == wanted) {
                return Ok(());
            }
        }
        panic!("no {wanted:?} in {told}");
    }
}

/// Waits until the condition holds.
#[track_caller]
pub(super) fn eventually(what: &str, mut is_so: impl FnMut() -> bool) {
    let limit = Instant::now() + Duration::from_secs(20);
    while !is_so() {
        assert!(Instant::now() < limit, "{what}");
        thread::sleep(Duration::from_millis(20));
    }
}

/// Half of 250 mm is 13824 raw.
pub(super) const LEVEL: &str = "/force/4711/Level%20%22left%22";

fn mbpoll_reads_what_is_forced() -> Result<(), Absent> {
    harness::command("mbpoll", "mbpoll")?;
    let machine = Machine::start("kind = \"modbus-server\"", "keep_forced = true");
    machine.await_register("3", "2", "0")?;
    let done = machine.ask(&format!("PUT {LEVEL}"), "125.0");
    assert!(done.contains("\"done\""), "{done}");
    // A value that the machine writes, as the PLC reads it; the page shows the same.
    machine.await_register("3", "2", "13824")?;
    let level = machine.signal(2);
    assert_eq!(
        (&level["value"], &level["raw"]),
        (&125.into(), &"16#3600".into())
    );
    assert_eq!(level["forced"], 125);
    let mut faults = serde_json::Value::Null;
    eventually("its fault is active", || {
        faults = machine.line()["faults"].take();
        faults[0]["phase"] == "active"
    });
    assert_eq!(faults[0]["name"], "forced: Level \"left\"", "{faults}");
    assert_eq!(faults[0]["kind"], "stuck");
    // A value that the machine reads: the PLC never wrote it, and the machine returns it.
    machine.ask("PUT /force/4711/Valve", "TRUE");
    machine.await_register("1", "1", "1")?;
    machine.await_register("0", "1", "0")?;
    // Another value, without a gap; then neither of them.
    machine.ask(&format!("PUT {LEVEL}"), "-1");
    machine.await_register("3", "2", "65425 (-111)")?;
    machine.ask("DELETE /force/4711/Valve", "");
    machine.await_register("1", "1", "0")?;
    machine.ask("DELETE /force", "");
    machine.await_register("3", "2", "0")?;
    eventually("the faults are over", || {
        let faults = machine.line()["faults"].take();
        let faults = faults.as_array().expect("a list");
        faults.len() == 3 && faults.iter().all(|fault| fault["phase"] == "over")
    });
    assert!(machine.signal(2)["forced"].is_null());
    // A value out of range is refused with a message, and changes nothing.
    let refused = machine.ask(&format!("PUT {LEVEL}"), "300");
    assert!(
        refused.contains("goes from -296.2963 to 296.2873"),
        "{refused}"
    );
    let refused = machine.ask("PUT /force/4711/Valv", "1");
    assert!(refused.contains("did you mean"), "{refused}");
    Ok(())
}

fn forced_for_nobody() -> Result<(), Absent> {
    harness::command("mbpoll", "mbpoll")?;
    let machine = Machine::start("kind = \"modbus-server\"", "grace = \"2s\"");
    // A viewer with the token, who then leaves.
    let mut viewer = TcpStream::connect(&machine.page).expect("it listens");
    write!(
        viewer,
        "GET /events HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {}\r\n\r\n",
        machine.page, machine.token
    )
    .expect("it reads");
    machine.ask(&format!("PUT {LEVEL}"), "125.0");
    machine.await_register("3", "2", "13824")?;
    // For longer than the grace time, the viewer's events are the only activity with the token.
    let begun = Instant::now();
    let mut events = vec![0; 65536];
    while begun.elapsed() < Duration::from_secs(4) {
        assert!(viewer.read(&mut events).expect("events") > 0);
    }
    machine.await_register("3", "2", "13824")?;
    drop(viewer);
    machine.await_register("3", "2", "0")
}

#[expect(clippy::unnecessary_wraps, reason = "as all tests here")]
fn killed_plc() -> Result<(), Absent> {
    let mut machine = Machine::start("kind = \"socket\"\nmax_age = \"10s\"", "");
    // A PLC that sends its byte of outputs, and vanishes.
    let mut plc = TcpStream::connect(format!("127.0.0.1:{}", machine.port)).expect("it listens");
    plc.write_all(&[1]).expect("it reads");
    machine.command.after("mirror: running: ");
    assert_eq!(machine.line()["state"], "running");
    eventually("its valve is on", || machine.signal(0)["value"] == 1);
    assert_eq!(machine.signal(0)["edges"], 1);
    drop(plc);
    let begun = Instant::now();
    eventually("its end is told", || machine.line()["state"] != "running");
    assert!(
        begun.elapsed() < Duration::from_secs(5),
        "{:?}",
        begun.elapsed()
    );
    let (line, said) = (machine.line(), machine.command.after("mirror: opening: "));
    // The same sentence as in the command's output.
    assert_eq!(line["reason"], said, "{line}");
    // Unread data make its system reset the connection.
    let cause = &line["cause"];
    assert!(cause == "left" || cause == "link", "{line}");
    Ok(())
}
