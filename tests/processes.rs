//! The two commands as separate processes, over a real socket: started, killed, interrupted, misused.
#![cfg(unix)]
#![allow(missing_docs, reason = "tests")]

use std::io::{BufRead as _, BufReader, Lines, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::time::Duration;

use rustix::process::{Pid, WaitOptions, waitpid};
use tickbus::driver::{Code, Driver};
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Monotonic, Nanos};
use tickbus_conformance::rig::{await_that, patiently};
use tickbus_test_log as logged;

const SIGNALS: &str = r#"
[[signal]]
name    = "out"
address = "%QX0.0"
latch   = "rising"

[[signal]]
name    = "in"
address = "%IX0.0"
latch   = "rising"

[[signal]]
name      = "level"
address   = "%QB1"
fail_safe = 255

[[signal]]
name    = "echo"
address = "%IB1"
"#;

/// A driver.cfg that serves both ends.
fn config(fieldbus: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"socket\"\ncycle = \"1ms\"\n\
         reconnect = [\"10ms\"]\n{fieldbus}\n{SIGNALS}"
    )
}

fn save(text: &str) -> tempfile::NamedTempFile {
    let file = tempfile::Builder::new().suffix(".cfg").tempfile();
    let file = file.expect("a temporary file");
    std::fs::write(file.path(), text).expect("it can be written");
    file
}

/// A running `tickbus`; ends with the test.
struct Process {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Process {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("tickbus runs");
        let out = child.stdout.take().expect("its stdout is ours");
        Self {
            child,
            lines: BufReader::new(out).lines(),
        }
    }

    /// The next line that contains `text`.
    fn until(&mut self, text: &str) -> String {
        let mut before = Vec::new();
        for line in &mut self.lines {
            let line = line.expect("text");
            if line.contains(text) {
                return line;
            }
            before.push(line);
        }
        panic!("no line with {text:?}, but {before:#?}");
    }

    /// The rest of its output, and its exit status.
    fn end(mut self) -> (Vec<String>, ExitStatus) {
        let lines = (&mut self.lines).map(|line| line.expect("text")).collect();
        let status = self.child.wait().expect("it was started");
        (lines, status)
    }

    fn signal(&self, name: &str) {
        let status = Command::new("kill")
            .args([&format!("-{name}"), &self.child.id().to_string()])
            .status();
        assert!(status.expect("kill runs").success());
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Both fail if it has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn statistic(driver: &Driver, key: &str) -> Option<String> {
    let text = driver.statistics();
    let found = text
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{key}=")));
    found.map(str::to_owned)
}

fn device() -> (logged::Watch, Driver, Vec<Slot>, String) {
    let logged = logged::Watch::new();
    let text = config("address = \"127.0.0.1:0\"\nmax_age = \"100ms\"");
    let config =
        Config::parse("driver.cfg", &text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    let clock = Monotonic::shared();
    let driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
    let mut address = None;
    await_that("the device listens", || {
        address = statistic(&driver, "address");
        address.is_some()
    });
    let slots = driver.initial_slots();
    (logged, driver, slots, address.expect("found"))
}

/// A PLC is killed at arbitrary times, and restarted.
#[test]
fn a_killed_plc_is_stale_and_its_successor_is_served() {
    const KILLS: u8 = 200;
    let (_logged, mut driver, mut slots, address) = device();
    let file = save(&config(""));
    let path = file.path().to_str().expect("a plain name");
    for kill in 1..=KILLS {
        let plc = Process::start(&[
            "plc",
            "mirror",
            "--config",
            path,
            "--address",
            &address,
            "--scan",
            "1ms",
        ]);
        let value = Slot::from_real(f64::from(kill));
        let mirrored = patiently(|| {
            slots[3] = value;
            driver.exchange(Nanos::ZERO, &mut slots);
            (slots[2] == value).then_some(())
        });
        assert!(
            mirrored.is_some(),
            "PLC {kill} mirrors the value:\n{}",
            driver.statistics()
        );
        plc.signal("KILL");
        await_that("the data are stale", || {
            driver.exchange(Nanos::ZERO, &mut slots).code == Code::Stale
        });
        assert_eq!(slots[2], Slot::from_real(255.0), "fail-safe when stale");
        drop(plc);
    }
    // At least: on a busy machine a running PLC may be silent for longer than max_age.
    let running = statistic(&driver, "link.running").map(|count| count.parse::<u64>());
    let is_served = matches!(running, Some(Ok(count)) if count >= u64::from(KILLS));
    assert!(is_served, "each PLC is served: {running:?}");
    assert_eq!(statistic(&driver, "link.failed"), Some("0".to_owned()));
    driver.close();
}

/// A simulation is suspended, as by a virtual machine that pauses, and its PLC sends one more value meanwhile and then
/// hangs. When the simulation continues, that value is older than `max_age` and never counts.
#[test]
fn what_waited_while_the_simulation_was_suspended_is_old() {
    const MAX_AGE: Duration = Duration::from_millis(250);
    let file = save(&config("address = \"127.0.0.1:0\"\nmax_age = \"250ms\""));
    let path = file.path().to_str().expect("a plain name");
    let mut mirror = Process::start(&["mirror", path, "--tick", "200us"]);
    let listening = mirror.until("listening on");
    let address = listening.rsplit(' ').next().expect("an address");
    let mut plc = TcpStream::connect(address).expect("it listens");
    let mut hears = plc_hears(&plc);
    let mut say = |level: u8| plc.write_all(&[0, level]).expect("it takes a record");
    await_that("the simulation answers", || {
        say(1);
        hears() == 1
    });
    mirror.signal("STOP");
    let pid = Pid::from_child(&mirror.child);
    waitpid(Some(pid), WaitOptions::UNTRACED).expect("it is our child");
    say(77);
    // The suspended simulation's time passes.
    std::thread::sleep(2 * MAX_AGE);
    mirror.signal("CONT");
    // Values sent before the suspension come first.
    await_that("its data are stale", || hears() == 255);
    // Few enough: a peer that is silent for four times `max_age` is disconnected.
    let heard: Vec<u8> = (0..50).map(|_| hears()).collect();
    assert!(!heard.contains(&77), "{heard:?}");
    await_that("the simulation answers again", || {
        say(78);
        hears() == 78
    });
}

/// The next level that the simulation sends to `plc`.
fn plc_hears(plc: &TcpStream) -> impl FnMut() -> u8 + use<> {
    let mut plc = plc.try_clone().expect("a second handle");
    move || {
        let mut record = [0; 2];
        plc.read_exact(&mut record).expect("records go on");
        record[1]
    }
}

/// The two commands against each other: `mirror` as the machine, `plc reaction` as the PLC.
#[test]
fn reaction_measures_a_mirror() {
    let file = save(&config("address = \"127.0.0.1:0\""));
    let path = file.path().to_str().expect("a plain name");
    let mut mirror = Process::start(&["mirror", path, "--tick", "200us", "--stats"]);
    let listening = mirror.until("listening on");
    let address = listening.rsplit(' ').next().expect("an address");
    let plc = Process::start(&[
        "plc",
        "reaction",
        "--config",
        path,
        "--address",
        address,
        "--option",
        "count=50",
        "--option",
        "tick=200us",
        "--option",
        "pause=1ms",
        "--stats",
    ]);
    let (lines, status) = plc.end();
    let text = lines.join("\n");
    assert!(status.success(), "{text}");
    for expected in [
        "plc: running: connected with 127.0.0.1:",
        "reaction.count=50",
        "reaction.lost=0",
        "reaction.ticks.p50=",
        "reaction of the other end: 50 edges answered, 0 lost",
    ] {
        assert!(text.contains(expected), "no {expected:?} in {text}");
    }
    assert!(
        lines
            .last()
            .expect("a last line")
            .starts_with("plc: ok scans=")
    );

    mirror.signal("INT");
    let (lines, status) = mirror.end();
    let text = lines.join("\n");
    assert!(status.success(), "{text}");
    assert!(
        text.contains("cause.left=1") && text.contains("bus_cycle.p50_us="),
        "{text}"
    );
    assert!(
        lines
            .last()
            .expect("a last line")
            .starts_with("mirror: ok scans=")
    );
}

#[test]
fn a_machine_that_does_not_answer_ends_the_measurement_with_code_3() {
    let (_logged, mut driver, mut slots, address) = device();
    let file = save(&config(""));
    let path = file.path().to_str().expect("a plain name");
    let over = std::sync::atomic::AtomicBool::new(false);
    let (lines, status) = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !over.load(std::sync::atomic::Ordering::Relaxed) {
                driver.exchange(Nanos::ZERO, &mut slots);
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        let ended = Process::start(&[
            "plc",
            "reaction",
            "--config",
            path,
            "--address",
            &address,
            "--option",
            "timeout=20ms",
            "--option",
            "pause=1ms",
        ])
        .end();
        over.store(true, std::sync::atomic::Ordering::Relaxed);
        ended
    });
    let last = lines.last().expect("a last line");
    assert!(
        last.starts_with("plc: failed reason=")
            && last.contains(" edges in a row were not answered"),
        "{last}"
    );
    assert_eq!(status.code(), Some(3));
}

#[test]
fn sigterm_and_a_duration_end_a_command_in_good_order() {
    let file = save(&config("address = \"127.0.0.1:0\""));
    let path = file.path().to_str().expect("a plain name");
    let mut mirror = Process::start(&["mirror", path]);
    mirror.until("listening on");
    mirror.signal("TERM");
    let (lines, status) = mirror.end();
    assert!(status.success() && lines.last().expect("a line").starts_with("mirror: ok "));

    let (lines, status) = Process::start(&["mirror", path, "--duration", "20ms"]).end();
    assert!(status.success() && lines.last().expect("a line").starts_with("mirror: ok "));
}

#[test]
fn a_command_whose_line_never_ran_fails() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = taken.local_addr().expect("it is bound").to_string();
    let file = save(&config(&format!("address = \"{address}\"")));
    let path = file.path().to_str().expect("a plain name");
    let fails = |mut process: Process, title: &str| {
        process.until(&format!("{title}: failed: "));
        process.signal("TERM");
        let (lines, status) = process.end();
        let last = lines.last().expect("a line");
        let right = format!("{title}: failed reason=the line never ran: ");
        assert!(last.starts_with(&right), "{last}");
        assert_eq!(status.code(), Some(3));
    };
    fails(Process::start(&["mirror", path]), "mirror");
    drop(taken);
    fails(Process::start(&["plc", "mirror", "--config", path]), "plc");
}

fn refused(arguments: &[&str]) -> (String, Option<i32>) {
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(arguments)
        .output()
        .expect("tickbus runs");
    let text = String::from_utf8(output.stderr).expect("text");
    (text, output.status.code())
}

#[test]
fn what_is_wrong_is_told_before_anything_starts() {
    let device = save(&config("role = \"device\""));
    let device = device.path().to_str().expect("a plain name");
    let (text, code) = refused(&["plc", "mirror", "--config", device]);
    assert!(
        text.contains(":8:8: this command is the controller of the line"),
        "{text}"
    );
    assert_eq!(code, Some(1));

    let loopback = save(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"a\"\n\
         [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n",
    );
    let loopback = loopback.path().to_str().expect("a plain name");
    let (text, code) = refused(&["mirror", loopback]);
    assert!(
        text.contains(":5:8: both ends of the bus \"loopback\" live in one process"),
        "{text}"
    );
    assert_eq!(code, Some(1));
    // The file has no "role" that could be removed.
    let hosting = save(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
         [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n",
    );
    let hosting = hosting.path().to_str().expect("a plain name");
    let (text, code) = refused(&["plc", "mirror", "--config", hosting]);
    assert!(
        text.contains(":5:8: both ends of the bus \"loopback\" live in one process")
            && text.contains("plc: failed mistakes=1"),
        "{text}"
    );
    assert_eq!(code, Some(1));

    let both = save(&config(""));
    let both = both.path().to_str().expect("a plain name");
    let (text, code) = refused(&["plc", "mirror", "--config", both, "--address", "here"]);
    assert!(
        text.contains("--address: ") && text.contains("127.0.0.1:"),
        "{text}"
    );
    assert_eq!(code, Some(1));

    let (text, code) = refused(&["plc", "rig", "--config", both]);
    assert!(text.contains("works on 8 bytes of %I"), "{text}");
    assert_eq!(code, Some(1));

    let (text, code) = refused(&["plc", "mirror", "--config", "nowhere.cfg"]);
    assert!(
        text.contains("nowhere.cfg: there is no such file"),
        "{text}"
    );
    assert_eq!(code, Some(1));

    let (text, code) = refused(&["plc", "rigg", "--config", both]);
    assert!(text.contains("no PLC program is called \"rigg\""), "{text}");
    assert_eq!(code, Some(2));
}

/// One server with two stations, like two remote I/O units at one address.
#[test]
fn a_mirror_serves_several_stations() {
    let stations = "[[station]]\nname = \"A\"\n[[station]]\nname = \"B\"\n".to_owned()
        + ["A", "B"]
            .map(|station| {
                format!(
                    "[[signal]]\nname = \"{station} to\"\naddress = \"%QB1\"\nstation = \"{station}\"\n\
                     [[signal]]\nname = \"{station} from\"\naddress = \"%IB1\"\nstation = \"{station}\"\n"
                )
            })
            .concat()
            .as_str();
    let text = |fieldbus: &str| {
        let head =
            "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"socket\"\ncycle = \"1ms\"\n";
        format!("{head}{fieldbus}\n{stations}")
    };
    let file = save(&text("address = \"127.0.0.1:0\""));
    let path = file.path().to_str().expect("a plain name");
    let mut mirror = Process::start(&["mirror", path, "--tick", "1ms"]);
    let listening = mirror.until("listening on");
    let address = listening
        .split_whitespace()
        .find(|word| word.starts_with("127.0.0.1:"));
    let address = address.expect("an address").trim_end_matches([';', ',']);
    let plc = format!("role = \"controller\"\naddress = \"{address}\"");
    let config = Config::parse("driver.cfg", &text(&plc), &tickbus::KINDS)
        .unwrap_or_else(|why| panic!("{why}"));
    let clock = Monotonic::shared();
    let _logged = logged::Watch::new();
    let mut driver = Driver::open(config, clock).expect("opens");
    let mut slots = driver.initial_slots();
    (slots[0], slots[2]) = (Slot::from_real(5.0), Slot::from_real(7.0));
    await_that("both stations come back", || {
        driver.exchange(Nanos::ZERO, &mut slots);
        (slots[1].real(), slots[3].real()) == (5.0, 7.0)
    });
}

/// Server, machine and PLC are three processes that know each other only by one address.
#[test]
fn a_run_in_lock_step_of_three_processes_has_one_trace_hash() {
    let mut hashes = Vec::new();
    for _ in 0..2 {
        let file =
            save("[sync]\nstep = \"2ms\"\nclients = 2\nlisten = \"127.0.0.1:0\"\nuntil = \"2s\"\n");
        let mut server = Process::start(&["sync", file.path().to_str().expect("UTF-8")]);
        let line = server.until("listening on ");
        let (_, address) = line.rsplit_once(' ').expect("an address");
        let file = save(&format!(
            "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"sdsp\"\n{SIGNALS}"
        ));
        let cfg = file.path().to_str().expect("UTF-8");
        let machine = Process::start(&["mirror", cfg, "--address", address, "--tick", "2ms"]);
        let plc = [
            "plc",
            "mirror",
            "--config",
            cfg,
            "--address",
            address,
            "--scan",
            "10ms",
        ];
        let plc = Process::start(&plc);
        let last = |process: Process, begin: &str| {
            let (lines, status) = process.end();
            let last = lines.last().expect("a result").clone();
            assert!(status.success() && last.starts_with(begin), "{lines:#?}");
            last.rsplit_once("hash=").expect("a hash").1.to_owned()
        };
        let hash = last(server, "sync: ok steps=1000 time=1998ms hash=");
        assert_eq!(last(machine, "mirror: ok scans=1000 stale=0 hash="), hash);
        assert_eq!(last(plc, "plc: ok scans=200 stale=0 hash="), hash);
        hashes.push(hash);
    }
    assert_eq!(hashes[0], hashes[1]);
}

#[test]
fn a_gateway_says_what_its_driver_cfg_lacks_and_which_plc_does_not_come() {
    let gateway = |signals: &str| {
        let file = save(&config("address = \"127.0.0.1:0\"").replace(SIGNALS, signals));
        let cfg = file.path().to_str().expect("UTF-8");
        let server = ["--server", "127.0.0.1:1", "--timeout", "50ms"];
        let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args([&["sync", "gateway", cfg], &server[..]].concat())
            .output()
            .expect("tickbus runs");
        let told = [output.stdout, output.stderr].concat();
        (String::from_utf8(told).expect("text"), output.status.code())
    };
    let (told, code) = gateway(SIGNALS);
    assert_eq!(code, Some(1), "{told}");
    assert!(
        told.contains("there is no signal \"sync.go\"; add it as a UDINT in %I"),
        "{told}"
    );
    let signal = |name: &str, address: &str| {
        format!("[[signal]]\nname = \"sync.{name}\"\naddress = \"{address}\"\ntype = \"UDINT\"\n")
    };
    let right = [("go", "%ID0"), ("time", "%ID4"), ("done", "%QD0")];
    let (told, code) = gateway(&right.map(|(name, address)| signal(name, address)).concat());
    assert_eq!(code, Some(3), "{told}");
    let part = "sync: failed reason=\"the PLC did not appear within 50ms: ";
    assert!(
        told.contains(part) && told.contains("the line of the PLC: "),
        "{told}"
    );
}
