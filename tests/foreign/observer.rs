//! Foreign servers that an observer looks at, and foreign clients to which a recording is played.
#![allow(clippy::float_cmp, reason = "small whole numbers")]

use std::io::{BufRead as _, BufReader, Lines, Write as _};
use std::net::TcpListener;
use std::process::{Child, ChildStdout, Command, Stdio};

use crate::harness::machine::Machine;
use crate::harness::{self, Absent, Test};
use tickbus_conformance::rig::logged;

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("snap7_gets_no_write_of_an_observer", || observed("s7")),
    ("pymodbus_gets_no_write_of_an_observer", || {
        observed("modbus")
    }),
    #[cfg(feature = "opcua")]
    ("asyncua_gets_no_write_of_an_observer", || observed("opcua")),
    ("a_recording_is_played_to_snap7", || played("s7")),
    ("a_recording_is_played_to_pymodbus", || played("modbus")),
    #[cfg(feature = "opcua")]
    ("a_recording_is_played_to_asyncua", || played("opcua")),
];

const SIGNALS: &str = "[[signal]]\nname = \"level\"\naddress = \"%IW0\"\ntype = \"INT\"\n\
                       [[signal]]\nname = \"speed\"\naddress = \"%QW2\"\ntype = \"INT\"\n";

fn head(fieldbus: &str) -> String {
    format!("[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\n{fieldbus}\n{SIGNALS}")
}

fn python(kind: &str, script: &str) -> Result<Command, Absent> {
    let module = match kind {
        "s7" => "snap7",
        "modbus" => "pymodbus",
        _ => "asyncua",
    };
    let mut python = harness::python_with("main", &[module])?;
    python.arg(format!(
        concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/{}"),
        script
    ));
    python.arg(kind);
    Ok(python)
}

pub(crate) fn free_port() -> u16 {
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
    free.local_addr().expect("it is bound").port()
}

/// A foreign server, which answers each line.
pub(crate) struct Server {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Server {
    pub(crate) fn start(kind: &str, port: u16) -> Result<Self, Absent> {
        let mut child = python(kind, "observed.py")?
            .arg(port.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        let lines = BufReader::new(child.stdout.take().expect("a pipe")).lines();
        let mut server = Self { child, lines };
        assert_eq!(server.line(), "ready");
        Ok(server)
    }

    fn line(&mut self) -> String {
        self.lines.next().expect("a line").expect("text")
    }

    /// Lets the server obey a line; returns how often clients have written so far.
    pub(crate) fn obey(&mut self, line: &str) -> u32 {
        let mut to = self.child.stdin.as_ref().expect("a pipe");
        writeln!(to, "{line}").expect("it listens");
        let told = self.line();
        let count = told.strip_prefix("writes ").expect("a count");
        count.parse().expect("a number")
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn observed(kind: &str) -> Result<(), Absent> {
    let port = free_port();
    let mut server = Server::start(kind, port)?;
    let own = match kind {
        "opcua" => format!(
            "url = \"opc.tcp://127.0.0.1:{port}\"\nsecurity = \"None\"\nnode_pattern = \"ns=2;s={{name}}\""
        ),
        _ => format!("address = \"127.0.0.1:{port}\""),
    };
    logged::expect("does not say whether it is in RUN");
    let mut observer = Machine::open(&head(&format!(
        "kind = \"{kind}-client\"\nrole = \"observer\"\ncycle = \"2ms\"\n{own}"
    )));
    for (level, speed) in [(1234, -77), (-5, 6), (300, 1)] {
        server.obey(&format!("{level} {speed}"));
        // Values that this end has in its slots go nowhere.
        observer.set("level", 99.0);
        observer.set("speed", 98.0);
        observer.until("both areas are seen", |end| {
            (end.get("level"), end.get("speed")) == (level.into(), speed.into())
        });
    }
    assert_eq!(observer.statistic("writes"), "never");
    assert_eq!(server.obey("count"), 0);
    // The count sees a client that writes, and the observer sees what it has written.
    assert!(server.obey("write") > 0);
    observer.until("the written value is seen", |end| end.get("speed") == 7.0);
    observer.end.driver.close();
    Ok(())
}

fn played(kind: &str) -> Result<(), Absent> {
    let mut client = python(kind, "looks.py")?;
    let port = free_port();
    let folder = tempfile::tempdir().expect("a folder");
    let own = match kind {
        "opcua" => "security = \"None\"\nanonymous = true",
        _ => "",
    };
    let text = head(&format!(
        "kind = \"{kind}-server\"\naddress = \"127.0.0.1:{port}\"\n{own}"
    ));
    std::fs::write(folder.path().join("x.cfg"), text).expect("written");
    let rows = (1..=100_u64).map(|tick| format!("{tick},{},0,0,{tick},0\n", tick * 20_000_000));
    let head = "bus.tick,bus.time_ns,bus.status,bus.dropped,level,speed\n";
    let recording = [head.to_owned(), rows.collect()].concat();
    std::fs::write(folder.path().join("run.csv"), recording).expect("written");
    let mut player = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["play", "run.csv", "x.cfg", "--wait", "--hold"])
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .spawn()
        .expect("it starts");
    let told = client.args([port.to_string(), "100".to_owned()]).output();
    player.kill().expect("it runs");
    player.wait().expect("it is ours");
    let told = told.expect("it starts");
    let text = String::from_utf8_lossy(&told.stdout).into_owned();
    let errors = String::from_utf8_lossy(&told.stderr);
    let seen = text
        .trim()
        .strip_prefix("seen ")
        .unwrap_or_else(|| panic!("{text}{errors}"));
    let seen: Vec<i32> = seen
        .split(' ')
        .map(|one| one.parse().expect("a number"))
        .collect();
    assert!(seen.is_sorted(), "{seen:?}");
    assert_eq!(seen.last(), Some(&100), "{seen:?}");
    assert!(seen.len() > 3, "{seen:?}");
    Ok(())
}
