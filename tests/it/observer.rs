//! `role = "observer"`: both areas are read, and no byte that could write ever leaves.
#![allow(clippy::float_cmp, reason = "small whole numbers")]

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::{Arc, Mutex};

use tickbus::driver::Code;
use tickbus::driver_cfg::Config;
use tickbus::fieldbus::Cause;
use tickbus::record::{Recording, Tick};
use tickbus::signal::{Area, Slot};
use tickbus::time::Monotonic;
use tickbus_conformance::rig::{End, logged, patiently};

const SIGNALS: &str = r#"
[[signal]]
name    = "full"
address = "%IX0.3"
latch   = "rising"

[[signal]]
name    = "level"
address = "%IW2"
type    = "INT"

[[signal]]
name    = "pump"
address = "%QX0.1"

[[signal]]
name    = "speed"
address = "%QW4"
type    = "INT"
"#;

fn text(fieldbus: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\n{fieldbus}\nreconnect = [\"20ms\"]\n{SIGNALS}"
    )
}

fn open(fieldbus: &str) -> End {
    End::open(&text(fieldbus), &Monotonic::shared(), &tickbus::KINDS)
}

/// Passes a connection on to `server`, and keeps every byte that the client sends.
struct Tap {
    address: SocketAddr,
    sent: Arc<Mutex<Vec<Vec<u8>>>>,
}

impl Tap {
    fn before(server: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        let sent = Arc::<Mutex<Vec<Vec<u8>>>>::default();
        let of_client = Arc::clone(&sent);
        std::thread::spawn(move || {
            for client in listener.incoming() {
                let client = client.expect("a client");
                let server = TcpStream::connect(server).expect("the server is there");
                let number = {
                    let mut all = of_client.lock().expect("no panic");
                    all.push(Vec::new());
                    all.len() - 1
                };
                let back = [&server, &client].map(|one| one.try_clone().expect("a handle"));
                std::thread::spawn(move || pass(back, |_| ()));
                let of_client = Arc::clone(&of_client);
                std::thread::spawn(move || {
                    pass([client, server], |bytes| {
                        of_client.lock().expect("no panic")[number].extend_from_slice(bytes);
                    });
                });
            }
        });
        Self { address, sent }
    }

    /// The bytes of each connection so far.
    fn sent(&self) -> Vec<Vec<u8>> {
        self.sent.lock().expect("no panic").clone()
    }
}

fn pass([mut from, mut to]: [TcpStream; 2], mut seen: impl FnMut(&[u8])) {
    let mut buffer = [0; 4096];
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        seen(&buffer[..count]);
        if to.write_all(&buffer[..count]).is_err() {
            break;
        }
    }
    let _ = to.shutdown(std::net::Shutdown::Both);
}

/// A polled bus.
struct Bus {
    name: &'static str,
    /// The keys of its server.
    server: &'static str,
    /// The keys of its clients: where the values are.
    places: &'static str,
    /// Counts the requests in the bytes of a client: those that read values, and those that may change something.
    count: fn(&[u8]) -> [usize; 2],
}

const S7: Bus = Bus {
    name: "s7",
    server: "db = [{ number = 1, area = \"%Q\" }, { number = 2, area = \"%I\" }]",
    places: "input = \"DB2\"\noutput = \"DB1\"",
    count: s7_requests,
};

const MODBUS: Bus = Bus {
    name: "modbus",
    server: "",
    places: "inputs = \"holding-register offset:1024\"",
    count: modbus_requests,
};

impl Bus {
    /// The PLC, which serves its memory.
    fn plc(&self, address: &str) -> End {
        let Self { name, server, .. } = self;
        open(&format!(
            "kind = \"{name}-server\"\nrole = \"controller\"\nat_close = \"hold\"\naddress = \"{address}\"\n\
             {server}"
        ))
    }

    /// The `[fieldbus]` table of a client.
    fn client(&self, address: SocketAddr, keys: &str) -> String {
        let Self { name, places, .. } = self;
        format!(
            "kind = \"{name}-client\"\naddress = \"{address}\"\ncycle = \"2ms\"\n{places}\n{keys}"
        )
    }

    fn observer(&self, address: SocketAddr) -> End {
        open(&self.client(address, "role = \"observer\""))
    }
}

/// A PLC, and the machine that writes `%I` into it.
struct Plant {
    plc: End,
    machine: End,
    /// The bytes of the machine.
    tap: Tap,
}

impl Plant {
    fn open(bus: &Bus) -> Self {
        let plc = bus.plc("127.0.0.1:0");
        logged::expect("nothing is written into the PLC");
        let mut curious = open(&bus.client(plc.address(), ""));
        let identity = patiently(|| {
            curious.tick();
            let identity = tickbus_conformance::rig::statistic(&curious.driver, "identity");
            identity.filter(|identity| !identity.is_empty())
        });
        curious.driver.close();
        let tap = Tap::before(plc.address());
        let key = format!("write_to = \"{}\"", identity.expect("it is told"));
        let machine = open(&bus.client(tap.address, &key));
        Self { plc, machine, tap }
    }

    /// Lets all ends tick until each observer sees these values.
    #[track_caller]
    fn until(&mut self, observers: &mut [End], values: [f64; 4]) {
        let [full, level, pump, speed] = values;
        let seen = patiently(|| {
            self.machine.set("full", full);
            self.machine.set("level", level);
            self.plc.set("pump", pump);
            self.plc.set("speed", speed);
            self.machine.tick();
            self.plc.tick();
            let seen = observers.iter_mut().all(|observer| {
                observer.tick();
                ["full", "level", "pump", "speed"].map(|name| observer.get(name)) == values
            });
            seen.then_some(())
        });
        seen.unwrap_or_else(|| panic!("not seen\n{}", observers[0].driver.statistics()));
    }
}

/// A slice of a message, or an empty one.
fn at(message: &[u8], from: usize) -> &[u8] {
    message.get(from..).unwrap_or_default()
}

fn s7_requests(mut bytes: &[u8]) -> [usize; 2] {
    let mut counts = [0; 2];
    while let [3, 0, high, low, ..] = *bytes {
        let length = usize::from(u16::from_be_bytes([high, low]));
        let Some(telegram) = bytes.get(..length) else {
            break;
        };
        let byte = |index| telegram.get(index).copied().unwrap_or(0);
        match [5, 8, 17, 22, 23].map(byte) {
            [0xF0, 1, 0x04, ..] => counts[0] += 1,
            // The request for the connection, the job that sets it up, and the question for a list.
            [0xE0, ..] | [0xF0, 1, 0xF0, ..] | [0xF0, 7, _, 0x44, 1] => {}
            _ => counts[1] += 1,
        }
        bytes = at(bytes, length);
    }
    counts
}

fn modbus_requests(mut bytes: &[u8]) -> [usize; 2] {
    let mut counts = [0; 2];
    while let [_, _, 0, 0, high, low, _, function, ..] = *bytes {
        match function {
            // The four tables.
            1..=4 => counts[0] += 1,
            // The question for the identity.
            0x2B => {}
            _ => counts[1] += 1,
        }
        bytes = at(bytes, 6 + usize::from(u16::from_be_bytes([high, low])));
    }
    counts
}

#[test]
fn two_observers_of_a_plc_see_both_areas_and_send_reads_alone_where_the_machine_writes() {
    for bus in [S7, MODBUS] {
        let mut plant = Plant::open(&bus);
        let tap = Tap::before(plant.plc.address());
        let mut observers = [tap.address, plant.plc.address()].map(|at| bus.observer(at));
        plant.until(&mut observers, [1.0, -7.0, 1.0, 1234.0]);
        // Values that this end has in its slots go nowhere.
        observers[0].slots.fill(Slot::from_real(1.0));
        plant.until(&mut observers, [0.0, 2.0, 0.0, -5.0]);
        assert_eq!(observers[0].statistic("writes"), "never");
        for observer in observers {
            observer.driver.close();
        }
        let sum = |tap: &Tap| {
            let each = tap.sent().into_iter().map(|sent| (bus.count)(&sent));
            each.fold([0; 2], |sum, one| [sum[0] + one[0], sum[1] + one[1]])
        };
        let ([reads, writes], [_, of_machine]) = (sum(&tap), sum(&plant.tap));
        // Two sets of values were seen.
        assert!(reads >= 2, "{}: {reads} reads", bus.name);
        assert_eq!(writes, 0, "{}", bus.name);
        assert!(of_machine > 0, "{}: the count sees no writes", bus.name);
    }
}

#[test]
fn a_place_that_the_plc_refuses_is_named_and_the_rest_is_not_made_up() {
    for (bus, own, other, words) in [
        (
            &S7,
            "input = \"DB2\"",
            "input = \"DB3\"",
            "reading DB3 bytes",
        ),
        (
            &S7,
            "input = \"DB2\"",
            "input = \"DB2.DBB100\"",
            "the block is shorter",
        ),
        (&MODBUS, "offset:1024", "offset:9000", "9000"),
    ] {
        let plc = bus.plc("127.0.0.1:0");
        let fieldbus = bus.client(plc.address(), "role = \"observer\"");
        let mut observer = open(&fieldbus.replace(own, other));
        let refused = patiently(|| {
            assert_ne!(observer.tick().code, Code::Fresh);
            let link = observer.link();
            (link.cause == Cause::Refused).then_some(link.reason)
        });
        let refused = refused.unwrap_or_else(|| panic!("{}", observer.driver.statistics()));
        assert!(refused.contains(words), "{refused}");
    }
}

#[test]
fn a_refused_place_in_a_station_of_its_own_leaves_the_other_one_fresh() {
    let mut plc = S7.plc("127.0.0.1:0");
    let fieldbus = format!(
        "kind = \"s7-client\"\nrole = \"observer\"\naddress = \"{}\"\ncycle = \"2ms\"\n\
         [[station]]\nname = \"good\"\n{}\n[[station]]\nname = \"bad\"\ninput = \"DB3\"\n",
        plc.address(),
        S7.places
    );
    let signals = SIGNALS.replace("[[signal]]", "[[signal]]\nstation = \"good\"");
    let text = format!(
        "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\n{fieldbus}{signals}\n\
         [[signal]]\nname = \"doubtful\"\nstation = \"bad\"\naddress = \"%IW0\"\n"
    );
    logged::expect("\"bad\"");
    let mut observer = End::open(&text, &Monotonic::shared(), &tickbus::KINDS);
    for speed in [5.0, 6.0] {
        let seen = patiently(|| {
            plc.set("speed", speed);
            plc.tick();
            observer.tick();
            (observer.get("speed") == speed).then_some(())
        });
        seen.unwrap_or_else(|| panic!("{}", observer.driver.statistics()));
        for (key, stale) in [
            ("station.good.stale", "false"),
            ("station.bad.stale", "true"),
        ] {
            assert_eq!(observer.statistic(key), stale, "{key}");
        }
    }
}

/// The mistakes in a driver.cfg, without the name of the file.
#[track_caller]
fn mistakes(text: &str) -> String {
    let read = Config::parse("x.cfg", text, &tickbus::KINDS);
    read.expect_err("it has mistakes").to_string()
}

#[test]
fn what_is_about_writing_is_refused_at_its_place() {
    let client = "kind = \"modbus-client\"\nrole = \"observer\"";
    for key in [
        "write_to = \"ACME\"",
        "watchdog = \"1s\"",
        "at_close = \"hold\"",
        "while_stale = \"hold\"",
        "heartbeat = { signal = \"full\", every = \"1s\" }",
    ] {
        let found = mistakes(&text(&format!("{client}\n{key}")));
        let name = key.split(' ').next().expect("a name");
        let expected = format!(
            "\"{name}\" is about values that are written, and an observer writes none; remove it here"
        );
        let first = found.lines().next().expect("a mistake");
        assert!(first.starts_with("x.cfg:7:"), "{found}");
        assert!(first.contains(&expected), "{found}");
    }
    for key in ["fail_safe = 3", "latch = \"rising\"\nhold = \"5ms\""] {
        let signal = format!("[[signal]]\nname = \"new\"\naddress = \"%IX9.0\"\n{key}\n");
        let signal = signal.replace("fail_safe = 3", "fail_safe = true");
        let found = mistakes(&format!("{}{signal}", text(client)));
        assert!(found.contains("and an observer writes none"), "{found}");
    }
    let fault = "[[fault]]\nkind = \"stuck\"\nsignal = \"full\"\n";
    let found = mistakes(&format!("{}{fault}", text(client)));
    assert!(
        found.contains("injects no faults; remove it here"),
        "{found}"
    );
    let found = mistakes(&text(client).replace("[fieldbus]", "faults = \"x.toml\"\n[fieldbus]"));
    assert!(found.starts_with("x.cfg:4:"), "{found}");
    let found = mistakes(&text("kind = \"socket\"\nrole = \"observer\""));
    assert!(
        found.contains(
            "nobody can observe on the bus \"socket\"; observe with one of modbus-client"
        ),
        "{found}"
    );
}

#[test]
fn an_observer_forces_nothing_and_injects_nothing() {
    let mut observer =
        open("kind = \"modbus-client\"\nrole = \"observer\"\naddress = \"127.0.0.1:9\"");
    let refused = observer
        .driver
        .inject_text("kind = \"stuck\"\nsignal = \"pump\"\n")
        .expect_err("refused");
    assert!(
        refused
            .to_string()
            .contains("an observer forces no signals")
    );
    let mut watch = observer.driver.watch();
    let refused = watch.force(0, Slot::from_real(1.0)).expect_err("refused");
    assert!(
        refused
            .to_string()
            .contains("an observer forces no signals")
    );
}

#[test]
fn a_recording_of_an_observer_has_the_plcs_addresses_and_all_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.vcd");
    let mut plant = Plant::open(&MODBUS);
    let record = format!("[record]\nfile = {:?}\n", file.display().to_string());
    let text = text(&MODBUS.client(plant.plc.address(), "role = \"observer\"")) + record.as_str();
    let observer = End::open(&text, &Monotonic::shared(), &tickbus::KINDS);
    let mut observers = [observer];
    plant.until(&mut observers, [0.0, 5.0, 1.0, 1234.0]);
    for observer in observers {
        observer.driver.close();
    }
    let mut recording = Recording::open(&file, None).expect("a recording");
    let columns = recording.columns().clone();
    assert_eq!(columns.role, "observer");
    let of = |name: &str| columns.position(name, false).expect(name);
    let address = |name: &str| columns.columns[of(name)].address.expect("it is told");
    assert_eq!(address("level").to_string(), "%IW2");
    assert_eq!(address("speed").to_string(), "%QW4");
    assert_eq!(address("full").area, Area::Input);
    let mut tick = Tick::new(&columns);
    let mut last = [0.0; 2];
    while recording.next(&mut tick).expect("a tick") {
        last = ["level", "speed"].map(|name| tick.values[of(name)].real());
    }
    assert_eq!(last, [5.0, 1234.0]);
}

fn tickbus(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the tickbus program runs")
}

#[test]
fn check_shows_the_plcs_addresses_and_other_commands_refuse_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let fieldbus = "kind = \"s7-client\"\nrole = \"observer\"\naddress = \"127.0.0.1:9\"";
    std::fs::write(folder.path().join("x.cfg"), text(fieldbus)).expect("written");
    let checked = tickbus(folder.path(), &["check", "x.cfg"]);
    let told = String::from_utf8_lossy(&checked.stdout).into_owned();
    for part in [
        "role      observer: reads %I and %Q, and writes nothing\n",
        "observes, and can write nothing\n",
        "request   writes nothing\n",
        "image     %I 4 bytes, %Q 6 bytes\n",
        "PLC input → observer",
        "signals=4 input_bytes=4 output_bytes=6",
    ] {
        assert!(told.contains(part), "{part:?} in {told}");
    }
    let level = told.lines().find(|line| line.ends_with(" level"));
    let level = level.expect("a row").split_whitespace().take(2);
    assert!(level.eq(["%IW2", "%IW2"]), "{told}");
    std::fs::write(folder.path().join("t.toml"), "config = \"x.cfg\"\n").expect("written");
    for (arguments, why) in [
        (
            &["mirror", "x.cfg"] as &[&str],
            "this command is the device of the line",
        ),
        (
            &["plc", "rig", "--config", "x.cfg"],
            "this command is the controller of the line",
        ),
        (
            &["play", "run.vcd", "x.cfg"],
            "this command is the device of the line",
        ),
        (
            &["export", "x.cfg", "--for", "codesys"],
            "only looks at a PLC",
        ),
        (&["test", "t.toml"], "only looks at a PLC"),
    ] {
        let output = tickbus(folder.path(), arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(told.contains(why), "{arguments:?}: {told}");
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {told}");
    }
}

#[test]
fn the_command_observes_a_file_without_a_role_and_ignores_what_is_about_writing() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut plant = Plant::open(&MODBUS);
    let keys = "write_to = \"anything\"\nwatchdog = \"1s\"";
    let fault = "[[fault]]\nkind = \"stuck\"\nsignal = \"speed\"\nvalue = 7\n";
    let text = text(&MODBUS.client(plant.plc.address(), keys)) + fault;
    std::fs::write(folder.path().join("x.cfg"), text).expect("written");
    let arguments = [
        "observe",
        "x.cfg",
        "--tick",
        "2ms",
        "--record",
        "seen.csv",
        "--duration",
        "2s",
        "--stats",
    ];
    let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(arguments)
        .current_dir(folder.path())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("it runs");
    let ended = patiently(|| {
        plant.plc.set("speed", 1234.0);
        plant.plc.tick();
        plant.machine.tick();
        child.try_wait().expect("it is ours")
    });
    assert!(ended.expect("it ends").success());
    let mut told = String::new();
    let mut out = child.stdout.take().expect("it is piped");
    out.read_to_string(&mut told).expect("text");
    assert!(told.contains("observe: ok scans="), "{told}");
    assert!(told.contains("\nwrites=never\n"), "{told}");
    let seen = std::fs::read_to_string(folder.path().join("seen.csv")).expect("a recording");
    let last = seen.lines().last().expect("a row");
    assert!(last.contains(",1234"), "{last}");
}

/// Status and speed of each recorded tick, and whether the recording is cut.
fn recorded(file: &Path) -> (Vec<(i32, f64)>, bool) {
    let mut recording = Recording::open(file, None).expect("a recording");
    let columns = recording.columns().clone();
    let speed = columns.position("speed", false).expect("speed");
    let (mut tick, mut ticks) = (Tick::new(&columns), Vec::new());
    while recording.next(&mut tick).expect("a tick") {
        ticks.push((tick.status, tick.values[speed].real()));
    }
    (ticks, recording.is_cut())
}

#[cfg(unix)]
#[test]
fn an_observer_that_is_stopped_leaves_a_recording_of_a_plc_that_was_gone_for_a_while() {
    let folder = tempfile::tempdir().expect("a folder");
    let [file, run] = ["x.cfg", "run.vcd"].map(|name| folder.path().join(name));
    let mut plc = S7.plc("127.0.0.1:0");
    let address = plc.address();
    let keys = "role = \"observer\"\nmax_age = \"250ms\"";
    let record = "[record]\nfile = \"run.vcd\"\n";
    std::fs::write(&file, text(&S7.client(address, keys)) + record).expect("written");
    let observe = || crate::commands::Running::of("observe", &[file.to_str().expect("text")]);
    // Lets the PLC have this speed until the recording has some hundred ticks more.
    let until_recorded = |plc: Option<&mut End>, speed: f64| {
        let size = || std::fs::metadata(&run).map_or(0, |run| run.len());
        let (begun, mut plc) = (size(), plc);
        let longer = patiently(|| {
            if let Some(plc) = &mut plc {
                plc.set("speed", speed);
                plc.tick();
            }
            (size() > begun + 2000).then_some(())
        });
        longer.expect("it is recorded");
    };

    let mut observer = observe();
    observer.after("observe: running: ");
    until_recorded(Some(&mut plc), 11.0);
    plc.driver.close();
    observer.after("observe: failed: ");
    until_recorded(None, 0.0);
    let mut plc = S7.plc(&address.to_string());
    observer.after("observe: running: ");
    until_recorded(Some(&mut plc), 22.0);
    let (last, code) = observer.interrupt();
    assert!(last.starts_with("observe: ok scans="), "{last}");
    assert_eq!(code, Some(0));
    let (ticks, is_cut) = recorded(&run);
    assert!(!is_cut);
    let stale = Code::Stale.code();
    let gone = ticks.iter().position(|tick| *tick == (stale, 11.0));
    let after = &ticks[gone.expect("the last value, stale")..];
    assert!(
        after.iter().any(|tick| tick.0 != stale && tick.1 == 22.0),
        "{after:?}"
    );

    let mut observer = observe();
    observer.after("observe: running: ");
    until_recorded(Some(&mut plc), 33.0);
    observer.signal(rustix::process::Signal::KILL);
    let (ticks, is_cut) = recorded(&run);
    assert!(is_cut);
    assert!(ticks.iter().any(|tick| tick.1 == 33.0), "{ticks:?}");
}

#[test]
fn several_units_are_observed_and_recorded_each_with_its_status() {
    const STATIONS: &str =
        "[[station]]\nname = \"left\"\nunit = 1\n[[station]]\nname = \"right\"\nunit = 2\n";
    let folder = tempfile::tempdir().expect("a folder");
    let signal = |station: &str, name: &str, address: &str| {
        format!("[[signal]]\nname = \"{name}\"\nstation = \"{station}\"\naddress = \"{address}\"\n")
    };
    let head = "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nreconnect = [\"20ms\"]\n";
    let signals: String = [
        signal("left", "l in", "%IB1"),
        signal("left", "l out", "%QB0"),
        signal("right", "r in", "%IB0"),
        signal("right", "r out", "%QB1"),
    ]
    .concat();
    let plc = format!(
        "{head}kind = \"modbus-server\"\nrole = \"controller\"\naddress = \"127.0.0.1:0\"\n{STATIONS}{signals}"
    );
    let mut plc = End::open(&plc, &Monotonic::shared(), &tickbus::KINDS);
    let client = MODBUS.client(plc.address(), "role = \"observer\"");
    let observer = format!("{head}{client}\n{STATIONS}{signals}");
    std::fs::write(folder.path().join("x.cfg"), observer).expect("written");
    let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args([
            "observe",
            "x.cfg",
            "--record",
            "seen.csv",
            "--duration",
            "2s",
        ])
        .current_dir(folder.path())
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("it runs");
    let ended = patiently(|| {
        plc.set("l out", 11.0);
        plc.set("r out", 22.0);
        plc.tick();
        child.try_wait().expect("it is ours")
    });
    assert!(ended.expect("it ends").success());
    let seen = std::fs::read_to_string(folder.path().join("seen.csv")).expect("a recording");
    let head = seen.lines().next().expect("a head");
    assert!(
        head.starts_with(
            "bus.tick,bus.time_ns,bus.status,bus.dropped,bus.status.left,bus.status.right,"
        ),
        "{head}"
    );
    let last = seen.lines().last().expect("a row");
    assert!(last.ends_with(",0,11,0,22"), "{last}");
}
