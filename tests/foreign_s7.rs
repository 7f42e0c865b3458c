//! S7 with the programs of others at the other end: python-snap7, rust7, and tshark looking on.
#![allow(missing_docs, unreachable_pub, reason = "a test")]

mod foreign;

use std::io::Write as _;
use std::process::{Command, ExitCode, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use foreign::Absent;
use tickbus::driver::{Config, Driver};
use tickbus::signal::Slot;
use tickbus::time::{Monotonic, Nanos};

fn main() -> ExitCode {
    foreign::main(&[(
        "python_snap7_reads_writes_and_asks_the_server",
        python_snap7_reads_writes_and_asks_the_server,
    )])
}

const SIGNALS: &str = r#"
[[signal]]
name    = "run"
address = "%QX0.0"
latch   = "rising"

[[signal]]
name      = "speed"
address   = "%QW2"
type      = "INT"
fail_safe = -1

[[signal]]
name    = "setpoint"
address = "%QD4"
type    = "REAL"

[[signal]]
name    = "sensor"
address = "%IX0.0"

[[signal]]
name    = "position"
address = "%IW2"
type    = "INT"

[[signal]]
name    = "pressure"
address = "%ID4"
type    = "REAL"
"#;

/// An open driver in real time.
struct End {
    driver: Driver,
    slots: Vec<Slot>,
}

impl End {
    fn open(fieldbus: &str) -> Self {
        let text =
            format!("[driver]\nid = 1\nname = \"Test rig\"\n[fieldbus]\n{fieldbus}\n{SIGNALS}");
        let config = Config::parse("driver.cfg", &text).unwrap_or_else(|why| panic!("{why}"));
        let clock = Monotonic::shared().expect("a thread");
        let driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
        let slots = driver.initial_slots();
        Self { driver, slots }
    }

    fn index(&self, name: &str) -> usize {
        let signals = &self.driver.config().table.signals;
        let found = signals.iter().position(|signal| signal.name == name);
        found.unwrap_or_else(|| panic!("no signal {name}"))
    }

    fn set(&mut self, name: &str, value: f64) {
        let index = self.index(name);
        self.slots[index] = Slot::from_real(value);
    }

    fn get(&self, name: &str) -> f64 {
        self.slots[self.index(name)].real()
    }

    fn tick(&mut self) {
        self.driver.exchange(Nanos::ZERO, &mut self.slots);
    }

    fn statistic(&self, key: &str) -> Option<String> {
        let text = self.driver.statistics();
        let mut lines = text.lines();
        lines.find_map(|line| line.strip_prefix(&format!("{key}=")).map(str::to_owned))
    }

    /// Ticks until `done` holds.
    #[track_caller]
    fn until(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> bool) {
        let limit = Instant::now() + Duration::from_secs(20);
        loop {
            self.tick();
            if done(self) {
                return;
            }
            assert!(
                Instant::now() < limit,
                "waited 20 s in vain until {what}\n{}",
                self.driver.statistics()
            );
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn port(&mut self) -> u16 {
        let mut port = 0;
        self.until("it listens", |end| {
            let address = end.statistic("address");
            port = address.map_or(0, |address| {
                let (_, port) = address.rsplit_once(':').expect("a port");
                port.parse().expect("a number")
            });
            port != 0
        });
        port
    }
}

/// Runs a Python script with these arguments while `end` ticks; gives what it printed.
#[track_caller]
fn run(end: &mut End, mut python: Command, script: &str, arguments: &[String]) -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/");
    let mut child = python
        .arg(format!("{path}{script}"))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("python starts");
    end.until("the script ends", |_| {
        child.try_wait().expect("a child").is_some()
    });
    let output = child.wait_with_output().expect("a child");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, errors) = (text(&output.stdout), text(&output.stderr));
    let _ = std::io::stdout().flush();
    assert!(output.status.success(), "{script}: {out}\n{errors}");
    out
}

const SERVER: &str = "kind = \"s7-server\"\naddress = \"127.0.0.1:0\"\nevents = true\n\
    db = [{ number = 1, area = \"%Q\" }, { number = 2, area = \"%I\", offset = 2, length = 6 }]";

fn python_snap7_reads_writes_and_asks_the_server() -> Result<(), Absent> {
    let python = foreign::python_with("main", &["snap7"])?;
    let mut end = End::open(SERVER);
    end.set("sensor", 1.0);
    end.set("position", -2.0);
    end.set("pressure", 1.5);
    let port = end.port().to_string();
    let told = run(&mut end, python, "snap7_client.py", &[port]);
    assert!(told.ends_with("snap7_client: ok\n"), "{told}");
    end.tick();
    assert_eq!(
        (end.get("run"), end.get("speed"), end.get("setpoint")),
        (1.0, 1234.0, 2.5)
    );
    Ok(())
}
