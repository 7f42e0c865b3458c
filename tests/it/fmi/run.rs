//! `tickbus run`, and `tickbus test` with an FMU as the machine.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::fmi::fixture::{CONFIG, err, misbehaving_as, out, tanks, tickbus};
use tickbus::net::Address;
use tickbus::time::{Monotonic, Nanos};
use tickbus::virtual_time::{Controls, Hosting, Logic, Outcome, Settings, StartCondition, tcp};

const RUN: [&str; 6] = [
    "--config",
    "tank.cfg",
    "--map",
    "tank.toml",
    "--duration",
    "60s",
];

fn run(fmu: &str, more: &[&str]) -> (String, String, Option<i32>) {
    let arguments: Vec<&str> = ["run", fmu]
        .iter()
        .chain(&RUN)
        .chain(more)
        .copied()
        .collect();
    let output = tickbus(tanks(), &arguments);
    (out(&output), err(&output), output.status.code())
}

#[test]
fn a_tank_of_both_versions_in_both_ways_is_the_same_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut records = Vec::new();
    for (fmu, more) in [
        ("tank2.fmu", &[][..]),
        ("tank3.fmu", &[]),
        ("tank2.fmu", &["--isolated"]),
        ("tank3.fmu", &["--isolated"]),
    ] {
        let file = folder.path().join(format!("{}.csv", records.len()));
        let file = file.to_str().expect("UTF-8");
        let (told, complaint, code) = run(fmu, &[more, &["--record", file]].concat());
        assert_eq!(code, Some(0), "{told}{complaint}");
        assert!(
            told.ends_with("run: ok ticks=6000 time=1min stale=0\n"),
            "{told}"
        );
        assert!(
            told.contains("1 input and 2 outputs joined, steps of 10ms, as fast as possible"),
            "{told}"
        );
        records.push(fs::read_to_string(file).expect("a recording"));
    }
    assert_eq!(
        records[0].lines().count(),
        6001,
        "a line for each tick, and the header"
    );
    for other in &records[1..] {
        assert!(*other == records[0], "the recordings differ");
    }
    // The area is the map's 0.25, and the mirror keeps the level at 400 mm.
    let last = records[0].lines().last().expect("a line");
    let level: f64 = last
        .rsplit(',')
        .next()
        .expect("a column")
        .parse()
        .expect("a number");
    assert!((395.0..=405.0).contains(&level), "{last}");
}

#[test]
fn what_is_not_joined_is_told_with_the_nearest_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let map = folder.path().join("map.toml");
    fs::write(&map, "[signals]\n\"Valve\" = \"valve\"\n").expect("a file");
    let arguments = [
        "run",
        "tank3.fmu",
        "--config",
        "tank.cfg",
        "--map",
        map.to_str().expect("UTF-8"),
        "--duration",
        "1s",
    ];
    let output = tickbus(tanks(), &arguments);
    let told = out(&output);
    assert_eq!(output.status.code(), Some(0), "{told}{}", err(&output));
    assert!(told.contains("run: not joined: signal \"Level\" (%IW2) keeps its fail-safe value: the FMU's nearest output is \"level\"\n"), "{told}");
    assert!(told.contains("run: not joined: signal \"Level low\" (%IX0.0) keeps its fail-safe value: the FMU has no output like it\n"), "{told}");
}

#[test]
fn a_simulation_that_is_too_slow_for_the_clock_is_told_with_the_time_that_it_lost() {
    let folder = misbehaving_as("slow");
    let arguments = [
        "run",
        "it.fmu",
        "--config",
        "it.cfg",
        "--duration",
        "200ms",
        "--stats",
    ];
    let output = tickbus(folder.path(), &[&arguments[..], &["--pace", "1"]].concat());
    let told = out(&output);
    assert_eq!(
        told.matches(" behind the clock, and does not catch up; ")
            .count(),
        1,
        "{told}"
    );
    assert!(told.contains("\nrun.lost="), "{told}");
    let last = told.lines().last().expect("a line");
    assert!(
        last.starts_with("run: ok ticks=20 time=200ms stale=0 lost="),
        "{last}"
    );
    // Without a clock to keep pace with, nothing is late.
    let output = tickbus(folder.path(), &arguments);
    let told = out(&output);
    assert!(
        !told.contains("behind the clock") && told.ends_with(" stale=0\n"),
        "{told}"
    );
}

#[test]
fn mistakes_in_a_map_have_their_places() {
    let folder = tempfile::tempdir().expect("a folder");
    let map = folder.path().join("map.toml");
    fs::write(
        &map,
        "[signals]\n\"Valv\" = \"valve\"\n\"Valve\" = \"level\"\n\"Level\" = { variable = \"levl\", scale = 0 }\n\
         \"Level low\" = { variable = \"valve\" }\n[parameters]\n\"ara\" = 1\n",
    )
    .expect("a file");
    let map = map.to_str().expect("UTF-8");
    let output = tickbus(
        tanks(),
        &["run", "tank2.fmu", "--config", "tank.cfg", "--map", map],
    );
    assert_eq!(output.status.code(), Some(1));
    let told = err(&output);
    for part in [
        ":2:10: there is no signal \"Valv\"",
        ":3:11: \"level\" is not an input of the FMU; \"Valve\" is %QX0.0, which the FMU has to read",
        ":4:40: a scale of 0 says nothing",
        ":5:28: \"valve\" is an input of the FMU",
        ":7:9: the FMU has no variable \"ara\"; did you mean \"area\"?",
    ] {
        assert!(told.contains(part), "{part}\n{told}");
    }
    assert!(told.ends_with("run: failed mistakes=5\n"), "{told}");
}

#[test]
fn without_any_name_in_common_a_map_is_asked_for() {
    let output = tickbus(tanks(), &["run", "tank2.fmu", "--config", "tank.cfg"]);
    assert_eq!(output.status.code(), Some(1));
    let told = err(&output);
    assert!(told.contains("no signal of tank.cfg has the name of a variable (inputs: \"valve\"; outputs: \"level\", \"low\", \"steps\"); write a map"), "{told}");
}

/// The FMU reads %I and writes %Q: a PLC on the loopback's socket, beside a mirror.
#[test]
fn an_fmu_is_the_plc_of_a_machine_in_another_process() {
    let folder = misbehaving_as("print");
    let text = crate::fmi::fixture::CONFIG
        .replace(
            "kind = \"loopback\"\nprogram = \"mirror\"\nmode = \"stepped\"\nscan = \"10ms\"\n",
            "kind = \"socket\"\naddress = \"127.0.0.1:0\"\ncycle = \"1ms\"\n",
        )
        // The PLC writes the level and reads the speed.
        .replace("%ID0", "%QX")
        .replace("%QD0", "%ID0")
        .replace("%QX", "%QD0");
    fs::write(folder.path().join("it.cfg"), text).expect("a file");
    let mut mirror = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["mirror", "it.cfg"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(
        mirror.stdout.take().expect("piped"),
    ));
    let address = lines
        .by_ref()
        .map(|line| line.expect("text"))
        .find_map(|line| {
            let (_, rest) = line.rsplit_once("127.0.0.1:")?;
            let port = rest.split(|c: char| !c.is_ascii_digit()).next()?;
            // The port is 0 until it listens.
            (port != "0").then(|| port.to_owned())
        })
        .expect("it says where it listens");
    let address = format!("127.0.0.1:{address}");
    let run = [
        "run",
        "it.fmu",
        "--config",
        "it.cfg",
        "--role",
        "plc",
        "--address",
        &address,
        "--duration",
        "2s",
        "--step",
        "5ms",
        "--record",
        "run.csv",
    ];
    let output = tickbus(folder.path(), &run);
    let _ = mirror.kill();
    let _ = mirror.wait();
    let told = out(&output);
    assert_eq!(output.status.code(), Some(0), "{told}{}", err(&output));
    assert!(
        told.contains("run: running:") && told.contains("run: ok ticks=400 time=2s"),
        "{told}"
    );
    let record = fs::read_to_string(folder.path().join("run.csv")).expect("a recording");
    // The FMU writes the time; the mirror, whose machine runs beside it in another process, returns that a while later,
    // and never returns other values.
    let mut lines = record.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let column = |name: &str| {
        let found = header.iter().position(|title| title.starts_with(name));
        found.unwrap_or_else(|| panic!("{name} in {header:?}"))
    };
    let (level, speed) = (column("Level"), column("Speed"));
    let ticks: Vec<(f64, f64)> = lines
        .map(|line| {
            let values: Vec<&str> = line.split(',').collect();
            let value = |at: usize| values[at].parse().expect("a number");
            (value(level), value(speed))
        })
        .collect();
    assert_eq!(ticks.len(), 400);
    let mut before = 0.0;
    for (at, (written, back)) in (1_i32..).zip(&ticks) {
        let time = f64::from(at) * 0.005;
        assert!((written - time).abs() < 1e-4, "{written} at {time}");
        assert!(
            *back >= before && *back < *written,
            "{back} at {time}, after {before}"
        );
        // With the precision of a REAL.
        let is_it = |(one, _): &(f64, f64)| (one - back).abs() < 1e-6;
        let is_written = *back == 0.0 || ticks.iter().any(is_it);
        assert!(is_written, "{back} at {time}");
        before = *back;
    }
    assert!(before > 0.5, "it came back: {before}");
}

#[test]
fn an_interrupted_run_ends_properly() {
    let arguments: Vec<&str> = ["run", "tank3.fmu", "--pace", "1"]
        .iter()
        .chain(&RUN)
        .copied()
        .collect();
    let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(&arguments)
        .current_dir(tanks())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut lines =
        std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().expect("piped")));
    let first = lines.next().expect("a line").expect("text");
    assert!(first.ends_with("pace 1"), "{first}");
    // The line is up: the machine ticks.
    let running = lines
        .by_ref()
        .map(|line| line.expect("text"))
        .find(|line| line.starts_with("run: running"));
    assert!(running.is_some());
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("it runs");
    let last = lines
        .map(|line| line.expect("text"))
        .last()
        .expect("a line");
    assert!(last.starts_with("run: ok ticks="), "{last}");
    assert!(child.wait().expect("it ends").success());
}

fn tests_in(folder: &Path, machine: &str, steps: &str) {
    for file in ["tank2.fmu", "tank3.fmu", "tank.cfg", "tank.toml"] {
        fs::copy(tanks().join(file), folder.join(file)).expect("a copy");
    }
    let text = format!(
        "config = \"tank.cfg\"\nstep = \"10ms\"\n[machine]\n{machine}\n[[test]]\nname = \"the level stays\"\nsteps = [{steps}]\n"
    );
    fs::write(folder.join("tank.toml.test.toml"), text).expect("a file");
}

#[test]
fn an_fmu_is_the_machine_of_a_test_file() {
    let folder = tempfile::tempdir().expect("a folder");
    for machine in [
        "fmu = \"tank2.fmu\"\nmap = \"tank.toml\"",
        "fmu = \"tank3.fmu\"\nmap = \"tank.toml\"\nisolated = true",
    ] {
        tests_in(
            folder.path(),
            machine,
            "{ await = \"Level low\", within = \"30s\" }, { await = \"Valve\", within = 2 }, \
             { run = \"10s\", always = \"Level > 390\", never = \"Level > 510\" }",
        );
        let output = tickbus(
            folder.path(),
            &["test", "tank.toml.test.toml", "--junit", "junit.xml"],
        );
        assert_eq!(
            output.status.code(),
            Some(0),
            "{}{}",
            out(&output),
            err(&output)
        );
        let junit = fs::read_to_string(folder.path().join("junit.xml")).expect("a report");
        assert!(
            junit.contains("tests=\"1\" failures=\"0\" errors=\"0\""),
            "{junit}"
        );
    }
    // A fault unknown to the machine's program: the test finds it.
    tests_in(
        folder.path(),
        "fmu = \"tank2.fmu\"\nmap = \"tank.toml\"",
        "{ fault = { kind = \"stuck\", signal = \"Level low\", value = false } }, { run = \"60s\", always = \"Level > 390\" }",
    );
    let output = tickbus(folder.path(), &["test", "tank.toml.test.toml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(out(&output).contains("\"Level\" is "), "{}", out(&output));
}

#[test]
fn a_sweep_before_an_fmu_is_the_same_in_one_process_and_in_several() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut sweeps = Vec::new();
    for machine in [
        "fmu = \"tank2.fmu\"\nmap = \"tank.toml\"",
        "fmu = \"tank2.fmu\"\nmap = \"tank.toml\"\nisolated = true",
    ] {
        tests_in(
            folder.path(),
            machine,
            "{ await = \"Level low\", within = \"30s\" }, { await = \"Valve\", within = 2 }, { run = \"10s\" }",
        );
        let file = folder.path().join("tank.toml.test.toml");
        let sweep = "[sweep]\nscenario = \"the level stays\"\nmoments = { drains = \"not Valve\", fills = \"Valve\" }\n\
                     kinds = [\"stuck-on\", \"stuck-off\", \"late\"]\nsignals = [\"Level low\"]\n\
                     told = \"Level > 900\"\nnever = \"Level < 350\"\nwithin = \"20s\"\n";
        let text = fs::read_to_string(&file).expect("the test");
        fs::write(&file, text + sweep).expect("a file");
        let output = tickbus(
            folder.path(),
            &["test", "tank.toml.test.toml", "--jobs", "3"],
        );
        assert_eq!(err(&output), "");
        sweeps.push(out(&output));
    }
    assert!(sweeps[0].contains("\nLevel low NEVER "), "{}", sweeps[0]);
    assert_eq!(sweeps[0], sweeps[1]);
}

#[test]
fn a_test_file_names_an_fmu_that_is_not_right() {
    let folder = tempfile::tempdir().expect("a folder");
    for (machine, told) in [
        ("fmu = \"none.fmu\"", "none.fmu: it cannot be opened: "),
        (
            "map = \"tank.toml\"",
            ":4:7: \"map\" stands without \"fmu\"; name the FMU, or remove it",
        ),
        (
            "fmu = \"tank2.fmu\"",
            ":4:7: no signal of tank.cfg has the name of a variable",
        ),
        (
            "fmu = \"tank2.fmu\"\nmap = \"tank.cfg\"",
            "tank.cfg:6:2: unknown key",
        ),
    ] {
        tests_in(folder.path(), machine, "{ tick = 1 }");
        let output = tickbus(folder.path(), &["test", "tank.toml.test.toml"]);
        assert_eq!(output.status.code(), Some(1), "{machine}");
        assert!(err(&output).contains(told), "{machine}\n{}", err(&output));
    }
}

/// A server of virtual time with one client and this many steps of 10 ms, and a driver.cfg next to the FMU that takes
/// part.
pub(crate) fn with_server<R>(folder: &Path, steps: u64, work: impl FnOnce() -> R) -> (R, Outcome) {
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let bus = format!("kind = \"sdsp\"\naddress = \"{}\"\n", listener.address());
    let config = CONFIG.replace(
        "kind = \"loopback\"\nprogram = \"mirror\"\nmode = \"stepped\"\nscan = \"10ms\"\n",
        &bus,
    );
    let (level, _) = config.rsplit_once("[[signal]]").expect("two signals");
    fs::write(folder.join("sdsp.cfg"), level).expect("a file");
    let mut settings = Settings::new(Nanos::from_millis(10), StartCondition::Count(1));
    settings.steps = Some(steps);
    std::thread::scope(|scope| {
        let server = scope.spawn(|| {
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &Controls::default(),
                news: &mut |_| {},
            };
            listener.run(settings, Logic::new(), hosting)
        });
        let done = work();
        let outcome = server.join().expect("no panic").expect("as planned");
        (done, outcome)
    })
}

#[test]
fn a_run_on_virtual_time_that_ends_ends_the_fmu_and_its_hash_is_told() {
    let folder = misbehaving_as("print");
    let (output, outcome) = with_server(folder.path(), 20, || {
        tickbus(
            folder.path(),
            &["run", "it.fmu", "--config", "sdsp.cfg", "--step", "10ms"],
        )
    });
    let told = out(&output);
    assert_eq!(output.status.code(), Some(0), "{told}{}", err(&output));
    let right = format!(
        "run: ok ticks=20 time=200ms stale=0 hash={}\n",
        outcome.hash
    );
    assert!(told.ends_with(&right), "{told}");
}

/// Our own FMU, in a separate line behind `tickbus run`.
#[test]
fn an_exported_fmu_ends_with_its_run_on_virtual_time() {
    let library = crate::fmi::fixture::library();
    let library = library.to_str().expect("UTF-8");
    for version in ["fmi2", "fmi3"] {
        let folder = misbehaving_as("print");
        let (output, _) = with_server(folder.path(), 20, || {
            let made = tickbus(
                folder.path(),
                &["export", "sdsp.cfg", "--for", version, "--library", library],
            );
            assert_eq!(made.status.code(), Some(0), "{}", err(&made));
            let line = "[driver]\nid = 2\nname = \"Outer\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                mode = \"stepped\"\nscan = \"10ms\"\n[[signal]]\nname = \"Level\"\naddress = \"%QD0\"\ntype = \"REAL\"\n";
            fs::write(folder.path().join("outer.cfg"), line).expect("a file");
            let fmu = format!("sdsp-{version}.fmu");
            tickbus(
                folder.path(),
                &["run", &fmu, "--config", "outer.cfg", "--step", "10ms"],
            )
        });
        let told = out(&output);
        assert_eq!(output.status.code(), Some(0), "{told}{}", err(&output));
        assert!(
            told.contains("run: the FMU has ended its simulation at 210ms"),
            "{told}"
        );
    }
}
