//! `tickbus sync join helics`, with a federate of the HELICS package for Python at the other end.
#![allow(missing_docs, reason = "tests")]

use std::io::{BufRead as _, BufReader, Read as _};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;

use crate::harness::{self, Absent, Test};
use tickbus::net::Address;
use tickbus::signal::DataType;
use tickbus::time::{Monotonic, Nanos};
use tickbus::virtual_time::{
    Cause, Controls, Declaration, Ended, Hosting, Logic, Outcome, Participant, Settings,
    StartCondition, Step, Variable, in_process, tcp,
};

pub(crate) const TESTS: &[(&str, Test)] = &[
    (
        "a_run_with_a_federation_is_that_of_one_process_to_the_last_bit",
        as_in_one_process,
    ),
    ("a_federate_that_leaves_ends_the_run", leaves),
    ("a_publication_of_another_type_is_told", other_type),
    ("a_missing_broker_or_library_is_told", missing),
];

/// Steps of the run, and their length.
const STEPS: u64 = 400;
const STEP: Nanos = Nanos::from_millis(10);

const MAPPING: &str = r#"
[helics]
client   = "grid"
federate = "tickbus"
core     = "tcpss"
broker   = "127.0.0.1:{port}"

[[helics.publish]]
variable = "valve"
key      = "plc/valve"
type     = "BOOL"

[[helics.publish]]
variable = "speed"
key      = "plc/speed"
type     = "INT"

[[helics.subscribe]]
variable = "level"
key      = "tank/level"
type     = "LREAL"
initial  = 0.5

[[helics.subscribe]]
variable = "sum"
key      = "tank/sum"
type     = "DINT"

[[helics.subscribe]]
variable = "full"
key      = "tank/full"
type     = "BOOL"
"#;

/// The member of the run beside the federation.
struct Plc;

impl Participant for Plc {
    fn declare(&self) -> Declaration {
        Declaration {
            writes: vec![
                Variable::new("valve", DataType::Bool),
                Variable::new("speed", DataType::Int),
            ],
            reads: ["level", "sum", "full"].map(str::to_owned).to_vec(),
            ..Declaration::new("plc")
        }
    }

    fn initial(&mut self, writes: &mut [u64]) {
        writes[1] = 7;
    }

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        let level = f64::from_bits(reads[0]);
        writes[0] = (level < 0.55 || (writes[0] == 1 && reads[2] == 0)).into();
        let speed = step.sequence.cast_signed() % 13 - (reads[1].cast_signed() & 7);
        writes[1] = speed.cast_unsigned();
        Ok(())
    }
}

/// The federation and its tank, in this process: the writes of a step are what was published before.
struct Grid {
    level: f64,
    sum: i64,
    full: bool,
}

impl Participant for Grid {
    fn declare(&self) -> Declaration {
        Declaration {
            writes: vec![
                Variable::new("level", DataType::Lreal),
                Variable::new("sum", DataType::Dint),
                Variable::new("full", DataType::Bool),
            ],
            reads: ["valve", "speed"].map(str::to_owned).to_vec(),
            ..Declaration::new("grid")
        }
    }

    fn initial(&mut self, writes: &mut [u64]) {
        writes[0] = self.level.to_bits();
    }

    fn run(&mut self, _: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        writes[0] = self.level.to_bits();
        writes[1] = self.sum.cast_unsigned();
        writes[2] = self.full.into();
        self.level += if reads[0] == 1 { 0.002 } else { -0.001 };
        self.sum += reads[1].cast_signed();
        self.full = self.level > 0.6;
        Ok(())
    }
}

fn settings() -> Settings {
    Settings {
        steps: Some(STEPS),
        ..Settings::new(STEP, StartCondition::Count(2))
    }
}

/// The tank in Python, and the port of its broker.
fn tank(steps: u64, kind: &str) -> Result<(Child, String), Absent> {
    let mut python = harness::python_with("helics", &["helics"])?;
    let script = format!("{}/tests/peers/helics_tank.py", env!("CARGO_MANIFEST_DIR"));
    let mut tank = python
        .args([&script, &steps.to_string(), "0.01", kind])
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut port = String::new();
    let stdout = tank.stdout.as_mut().expect("it is piped");
    // One byte at a time: the rest is for `end_of`.
    let mut byte = [0];
    while stdout.read_exact(&mut byte).is_ok() && byte[0] != b'\n' {
        port.push(byte[0].into());
    }
    Ok((tank, port))
}

/// The text that the tank printed last.
fn end_of(tank: Child) -> String {
    let output = tank.wait_with_output().expect("it ends");
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

/// `tickbus sync join ENGINE` with a mapping.
pub(crate) fn join(
    engine: &str,
    mapping: &str,
    server: &Address,
    arguments: &[&str],
) -> (Child, tempfile::NamedTempFile) {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    std::fs::write(file.path(), mapping).expect("it can be written");
    let child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["sync", "join", engine])
        .arg(file.path())
        .args(["--server", &server.to_string()])
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the tickbus program runs");
    (child, file)
}

/// The library in the environment of the peers.
fn library() -> Result<PathBuf, Absent> {
    let mut python = harness::python_with("helics", &["helics"])?;
    let script =
        "import importlib.util as u; print(u.find_spec('helics').submodule_search_locations[0])";
    let printed = python.args(["-c", script]).output().expect("it runs");
    let folder = String::from_utf8(printed.stdout).expect("a path");
    let install = PathBuf::from(folder.trim()).join("install");
    let found = ["lib64", "lib"].map(|folder| install.join(folder).join("libhelics.so"));
    let found = found.into_iter().find(|library| library.exists());
    found.ok_or_else(|| Absent("the Python package of HELICS has no library".to_owned()))
}

/// A run with a tank: its outcome, the last line of the command, and that of the tank.
fn run(steps: u64, kind: &str) -> Result<(Result<Outcome, Ended>, String, String), Absent> {
    let library = library()?;
    let (tank, port) = tank(steps, kind)?;
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = Address::local(listener.address().port());
    let library = library.to_str().expect("text");
    let mapping = MAPPING.replace("{port}", &port);
    let (child, _file) = join(
        "helics",
        &mapping,
        &address,
        &["--library", library, "--timeout", "20s"],
    );
    let controls = Controls::default();
    let mut last = String::new();
    let outcome = thread::scope(|scope| {
        let server = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &controls,
                news: &mut |_| {},
            };
            listener.run(settings(), Logic::new(), hosting)
        });
        scope.spawn(|| tcp::join(&address, &mut Plc));
        let output = child.wait_with_output().expect("it ends");
        let printed = BufReader::new(&*output.stdout)
            .lines()
            .map_while(Result::ok);
        last = printed.last().unwrap_or_default();
        // A command that has not joined leaves the server waiting.
        controls.send(tickbus::virtual_time::server::Control::Stop);
        server.join().expect("no panic")
    });
    Ok((outcome, last, end_of(tank)))
}

fn as_in_one_process() -> Result<(), Absent> {
    let mut grid = Grid {
        level: 0.5,
        sum: 0,
        full: false,
    };
    let alone = in_process::run(settings(), vec![&mut Plc, &mut grid], Logic::new());
    let alone = alone.expect("it runs");
    assert!(
        grid.level > 0.55 && grid.sum != 0,
        "{} {}",
        grid.level,
        grid.sum
    );
    for _ in 0..2 {
        // The tank would take one step more than the run has.
        let (outcome, last, end) = run(STEPS + 1, "int")?;
        assert_eq!(outcome, Ok(alone), "{last}; {end}");
        let Outcome { steps, time, hash } = alone;
        assert_eq!(
            last,
            format!("sync: ok steps={steps} time={time} hash={hash}")
        );
        assert!(end.starts_with("left level="), "{end}");
    }
    Ok(())
}

fn leaves() -> Result<(), Absent> {
    let (outcome, last, end) = run(100, "int")?;
    assert!(end.starts_with("left level="), "{end}");
    let ended = outcome.expect_err(&last);
    assert_eq!(ended.cause, Cause::Failed);
    assert_eq!(ended.client.as_deref(), Some("grid"));
    // The broker leaves with the tank, and its end may come first.
    let told = [
        "the federate \"tank\", whose values are read, has left the federation before ",
        " was requested: it has ended",
    ];
    let is_told = told.iter().any(|told| ended.reason.contains(told));
    assert!(is_told, "{}", ended.reason);
    assert!(
        last.starts_with("sync: failed cause=failed client=\"grid\" steps="),
        "{last}"
    );
    Ok(())
}

fn other_type() -> Result<(), Absent> {
    let (outcome, last, end) = run(100, "string")?;
    outcome.expect_err("it never began");
    let told = "the publication \\\"tank/sum\\\" is of the type string, but the variable \\\"sum\\\" is DINT, which takes int64";
    assert!(last.contains(told), "{last}");
    assert!(end.contains("ended: "), "{end}");
    Ok(())
}

fn missing() -> Result<(), Absent> {
    let library = library()?;
    let library = library.to_str().expect("text");
    let nowhere = Address::local(1);
    let mapping = MAPPING.replace("{port}", "1");
    let (child, _file) = join(
        "helics",
        &mapping,
        &nowhere,
        &["--library", library, "--timeout", "1s"],
    );
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(3));
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    for told in [
        "sync: failed cause=failed client=\"grid\" steps=0 reason=\"",
        "cannot join a federation through a broker at 127.0.0.1:1: ",
        "start helics_broker first",
    ] {
        assert!(printed.contains(told), "{told} in {printed}");
    }
    for (other, told) in [
        ("libnowhere.so", "it cannot be loaded"),
        ("libc.so.6", "it does not export helics"),
    ] {
        let (child, _file) = join("helics", &mapping, &nowhere, &["--library", other]);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(1));
        let printed = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(printed.contains(told), "{told} in {printed}");
        assert!(printed.contains("pip install helics"), "{printed}");
    }
    Ok(())
}
