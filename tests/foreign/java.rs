//! The servers with clients of Apache PLC4X and Eclipse Milo, and `opcua-client` with a server of Milo:
//! third-party software in Java.
#![allow(
    missing_docs,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use crate::harness::machine::{Machine, SIGNALS};
use crate::harness::{self, Absent, Test};
use tickbus_conformance::rig::{PATIENCE, patiently};

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("plc4x_drives_the_modbus_server", plc4x_over_modbus),
    (
        "plc4x_with_its_defaults_drives_the_s7_server",
        plc4x_over_s7,
    ),
    ("plc4x_drives_the_opcua_server", plc4x_over_opcua),
    (
        "plc4x_drives_devices_at_their_own_places",
        plc4x_at_own_places,
    ),
    ("milo_drives_the_opcua_server", milo_as_client),
    ("milo_drives_a_device_at_its_own_nodes", milo_at_own_nodes),
    ("opcua_client_drives_a_server_of_milo", milo_as_server),
];

/// A JVM that has just started pauses longer than the 250 ms after which data are stale.
fn open(fieldbus: &str) -> Machine {
    Machine::open(&format!(
        "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\n{fieldbus}\nmax_age = \"3s\"\nreconnect = [\"50ms\"]\n{SIGNALS}"
    ))
}

#[track_caller]
fn until_value(machine: &mut Machine, name: &str, value: f64) {
    machine.until(&format!("{name} is {value}"), |machine| {
        machine.get(name) == value
    });
}

/// A program from tests/peers/java, controlled by lines of text.
struct Peer {
    child: Child,
    stdin: Option<ChildStdin>,
    lines: Receiver<String>,
}

impl Peer {
    /// Starts it; the machine ticks until it is ready. A JVM that missed a time limit of its own library while the machine
    /// was busy is started a second time.
    #[track_caller]
    fn start(machine: &mut Machine, class: &str, arguments: &[&str]) -> Result<Self, Absent> {
        for attempt in 1..=2 {
            let peer = Self::spawn(class, arguments)?;
            let said = patiently(|| {
                machine.tick();
                peer.lines.try_recv().ok()
            });
            if let Some(said) = said {
                assert_eq!(said, "ready", "{class} {arguments:?}");
                return Ok(peer);
            }
            eprintln!("{class} is not ready within {PATIENCE:?}, attempt {attempt}");
        }
        panic!(
            "in vain until the peer is ready\n{}",
            machine.driver.statistics()
        );
    }

    fn spawn(class: &str, arguments: &[&str]) -> Result<Self, Absent> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/peers/java");
        if !folder.join("java-peers-0.jar").exists() {
            return Err(Absent(
                "PLC4X and Milo are not there; run tools/peers".to_owned(),
            ));
        }
        let separator = if cfg!(windows) { ";" } else { ":" };
        let jars = format!("java-peers-0.jar{separator}lib/*");
        let mut child = Command::new("java")
            // The program ends before a thorough compilation would pay off.
            // Without a file of measurements: if two JVMs have the same number, the later one warns on stdout.
            .args([
                "-XX:TieredStopAtLevel=1",
                "-XX:+UseSerialGC",
                "-XX:-UsePerfData",
            ])
            .args(["-cp", &jars, &format!("peers.{class}")])
            .args(arguments)
            .current_dir(&folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|why| Absent(format!("there is no java: {why}")))?;
        let stdin = child.stdin.take();
        let stdout: ChildStdout = child.stdout.take().expect("a pipe");
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Ok(Self {
            child,
            stdin,
            lines,
        })
    }

    /// Sends a request, and lets the machine tick until the answer arrives.
    #[track_caller]
    fn ask(&mut self, machine: &mut Machine, words: &[&str]) -> String {
        let stdin = self.stdin.as_mut().expect("it lives");
        writeln!(stdin, "{}", words.join("\t")).expect("it listens");
        machine.until_some(&format!("{words:?} is answered"), |_| {
            self.lines.try_recv().ok()
        })
    }

    /// Asks until the answer is `right`.
    #[track_caller]
    fn ask_until(&mut self, machine: &mut Machine, words: &[&str], right: &str) {
        let mut last = String::new();
        let limit = Instant::now() + Duration::from_secs(20);
        while last != right {
            assert!(Instant::now() < limit, "{words:?}: {last}, not {right}");
            last = self.ask(machine, words);
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The program ends with its stdin; if it hangs, the test must not hang as well.
        drop(self.stdin.take());
        let end = loop {
            if let Err(end) = self.lines.recv_timeout(Duration::from_secs(10)) {
                break end;
            }
        };
        if end == RecvTimeoutError::Timeout {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }
}

/// The names of the signals for a PLC4X client, and its notation of booleans.
struct Tags<'a> {
    run: &'a str,
    speed: &'a str,
    torque: &'a str,
    sensor: &'a str,
    position: &'a str,
    pressure: &'a str,
}

/// Values in both directions, with a PLC4X client.
fn plc4x(machine: &mut Machine, url: &str, tags: &Tags<'_>) -> Result<(), Absent> {
    let mut plc = Peer::start(machine, "Plc4xClient", &[url])?;
    for (tag, name, text, value) in [
        (tags.run, "run", "true", 1.0),
        (tags.speed, "speed", "-1234", -1234.0),
        (tags.torque, "torque", "0.25", 0.25),
    ] {
        assert_eq!(plc.ask(machine, &["write", tag, text]), "OK", "{tag}");
        until_value(machine, name, value);
    }
    machine.set("sensor", 1.0);
    machine.set("position", -7.0);
    machine.set("pressure", 1.5);
    let asked = ["read", tags.sensor, tags.position, tags.pressure];
    plc.ask_until(machine, &asked, "true\t-7\t1.5");
    Ok(())
}

fn plc4x_version() -> String {
    let pinned = harness::stated("tests/peers/java/pom.xml", "<plc4x.version>");
    format!("Apache PLC4X {pinned}")
}

fn plc4x_over_modbus() -> Result<(), Absent> {
    let mut machine = open("kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"");
    let address = machine.address_for("plc4x-modbus", &plc4x_version());
    // PLC4X counts from 1: register 2 is bytes 2 and 3.
    let tags = Tags {
        run: "coil:1",
        speed: "holding-register:2:INT",
        torque: "holding-register:3:REAL",
        sensor: "discrete-input:1",
        position: "input-register:2:INT",
        pressure: "input-register:3:REAL",
    };
    plc4x(&mut machine, &format!("modbus-tcp:tcp://{address}"), &tags)
}

fn plc4x_over_s7() -> Result<(), Absent> {
    let mut machine = open("kind = \"s7-server\"\naddress = \"127.0.0.1:0\"");
    let address = machine.address_for("plc4x-s7", &plc4x_version());
    let tags = Tags {
        run: "%Q0.0:BOOL",
        speed: "%QW2:INT",
        torque: "%QD4:REAL",
        sensor: "%I0.0:BOOL",
        position: "%IW2:INT",
        pressure: "%ID4:REAL",
    };
    let url = format!("s7://{}:{}", address.ip(), address.port());
    plc4x(&mut machine, &url, &tags)
}

const OPCUA_SERVER: &str = "kind = \"opcua-server\"\naddress = \"127.0.0.1:0\"\nsecurity = \"None\"\n\
                            anonymous = true\ncycle = \"5ms\"";

fn plc4x_over_opcua() -> Result<(), Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut machine = open(&format!(
        "{OPCUA_SERVER}\npki = {:?}",
        folder.path().display().to_string()
    ));
    let address = machine.address();
    let tags = Tags {
        run: "ns=2;s=run;BOOL",
        speed: "ns=2;s=speed;INT",
        torque: "ns=2;s=torque;REAL",
        sensor: "ns=2;s=sensor;BOOL",
        position: "ns=2;s=position;INT",
        pressure: "ns=2;s=pressure;REAL",
    };
    let url = format!("opcua:tcp://{address}?discovery=true");
    plc4x(&mut machine, &url, &tags)
}

/// Nodes in the namespaces of a maker, which are numbers 2 and 3.
const OWN_NODES: &str = "namespaces = [\"http://opcfoundation.org/UA/DI/\", \"http://acme.example/press/\"]\n\
    at = { run = \"ns=3;s=Press.Run\", speed = \"ns=3;i=6001\", torque = \"ns=3;i=6002\", sensor = \"ns=2;i=7\", \
    position = \"nsu=http://acme.example/press/;i=6003\", pressure = \"ns=3;s=Press.Pressure\" }";

fn plc4x_at_own_places() -> Result<(), Absent> {
    let mut machine = open(
        "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nat = { run = \"coil:65000\", speed = \"408502\", \
         torque = \"408503\", sensor = \"100008\", position = \"303202\", pressure = \"408510\" }",
    );
    let url = format!("modbus-tcp:tcp://{}", machine.address());
    let tags = Tags {
        run: "coil:65000",
        speed: "holding-register:8502:INT",
        torque: "holding-register:8503:REAL",
        sensor: "discrete-input:8",
        position: "input-register:3202:INT",
        pressure: "holding-register:8510:REAL",
    };
    plc4x(&mut machine, &url, &tags)?;

    let folder = tempfile::tempdir().expect("a folder");
    let mut machine = open(&format!(
        "{OPCUA_SERVER}\npki = {:?}\n{OWN_NODES}",
        folder.path().display().to_string()
    ));
    let tags = Tags {
        run: "ns=3;s=Press.Run;BOOL",
        speed: "ns=3;i=6001;INT",
        torque: "ns=3;i=6002;REAL",
        sensor: "ns=2;i=7;BOOL",
        position: "ns=3;i=6003;INT",
        pressure: "ns=3;s=Press.Pressure;REAL",
    };
    let url = format!("opcua:tcp://{}?discovery=true", machine.address());
    plc4x(&mut machine, &url, &tags)
}

fn milo_at_own_nodes() -> Result<(), Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut machine = open(&format!(
        "{OPCUA_SERVER}\npki = {:?}\n{OWN_NODES}",
        folder.path().display().to_string()
    ));
    let url = format!("opc.tcp://{}", machine.address());
    let mut milo = Peer::start(&mut machine, "MiloClient", &[&url])?;
    let speed = "ns=3;i=6001";
    let written = milo.ask(&mut machine, &["write", speed, "Int16", "-1234"]);
    assert_eq!(written, "good");
    until_value(&mut machine, "speed", -1234.0);
    assert_eq!(milo.ask(&mut machine, &["read", speed]), "-1234");
    machine.set("position", 42.0);
    milo.ask_until(&mut machine, &["read", "ns=3;i=6003"], "42");
    Ok(())
}

fn milo_as_client() -> Result<(), Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut machine = open(&format!(
        "{OPCUA_SERVER}\npki = {:?}",
        folder.path().display().to_string()
    ));
    let url = format!("opc.tcp://{}", machine.address());
    let mut milo = Peer::start(&mut machine, "MiloClient", &[&url])?;
    let speed = "ns=2;s=speed";
    for (value, text) in [(-1234.0, "-1234"), (77.0, "77")] {
        let written = milo.ask(&mut machine, &["write", speed, "Int16", text]);
        assert_eq!(written, "good");
        until_value(&mut machine, "speed", value);
        // Write and verify: a value that was just accepted is good at once.
        assert_eq!(milo.ask(&mut machine, &["read", speed]), text);
    }
    let subscribed = milo.ask(&mut machine, &["subscribe", "ns=2;s=position"]);
    assert_eq!(subscribed, "subscribed");
    for position in 1..=5 {
        machine.set("position", f64::from(position));
        let mut seen = String::new();
        machine.until("the subscriber hears", |machine| {
            seen = milo.ask(machine, &["changes"]);
            seen.split('\t').any(|one| one == position.to_string())
        });
    }
    // The whole structure ServerStatus is read, and its clock runs.
    let lag: i64 = milo.ask(&mut machine, &["status"]).parse().expect("a lag");
    assert!(lag.abs() < 5_000, "its clock is {lag} ms behind");
    Ok(())
}

fn milo_as_server() -> Result<(), Absent> {
    let port = {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        listener.local_addr().expect("it is bound").port()
    };
    let folder = tempfile::tempdir().expect("a folder");
    let mut machine = open(&format!(
        "kind = \"opcua-client\"\nurl = \"opc.tcp://127.0.0.1:{port}\"\nsecurity = \"None\"\npki = {:?}\n\
         write_to = \"urn:test:milo\"",
        folder.path().display().to_string()
    ));
    let nodes = [
        "run:Boolean:false",
        "speed:Int16:7",
        "torque:Float:1.5",
        "sensor:Boolean:false",
        "position:Int16:0",
        "pressure:Float:0",
        "nobody:Int16:5",
    ];
    let port = port.to_string();
    let mut arguments = vec![port.as_str()];
    arguments.extend(nodes);
    let mut plc = Peer::start(&mut machine, "MiloServer", &arguments)?;
    until_value(&mut machine, "speed", 7.0);
    assert_eq!(machine.get("torque"), 1.5);
    plc.ask(&mut machine, &["set", "speed", "-8"]);
    plc.ask(&mut machine, &["set", "run", "true"]);
    until_value(&mut machine, "speed", -8.0);
    until_value(&mut machine, "run", 1.0);
    machine.set("position", 42.0);
    machine.set("pressure", 0.75);
    plc.ask_until(&mut machine, &["get", "position"], "42");
    plc.ask_until(&mut machine, &["get", "pressure"], "0.75");
    // The PLC was killed and is restarted.
    drop(plc);
    until_value(&mut machine, "speed", -1.0);
    let mut plc = Peer::start(&mut machine, "MiloServer", &arguments)?;
    until_value(&mut machine, "speed", 7.0);
    plc.ask_until(&mut machine, &["get", "position"], "42");
    let written = plc.ask(&mut machine, &["written"]);
    for node in ["speed", "run", "torque", "nobody"] {
        assert!(!written.contains(node), "{written}");
    }
    Ok(())
}
