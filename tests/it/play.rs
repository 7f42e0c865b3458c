//! `tickbus play`: a recording is the machine, for a PLC on a real line.
#![allow(
    clippy::float_cmp,
    clippy::cast_precision_loss,
    reason = "small whole numbers"
)]

use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use tickbus::driver::{Code, Driver};
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Manual, Monotonic, Nanos};
use tickbus_conformance::rig::{End, patiently};

const SIGNALS: &str = "[[signal]]\nname = \"level\"\naddress = \"%IW2\"\ntype = \"INT\"\nunit = \"mm\"\n\
                       [[signal]]\nname = \"full\"\naddress = \"%IX0.0\"\n\
                       [[signal]]\nname = \"speed\"\naddress = \"%QW0\"\ntype = \"INT\"\n";

/// A driver.cfg for both ends of a line.
fn text(keys: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nkind = \"socket\"\ncycle = \"1ms\"\n\
         reconnect = [\"10ms\"]\n{keys}\n{SIGNALS}"
    )
}

/// A recording of so many ticks, 10 ms from one to the next, in which `level` counts them.
fn counted(ticks: u32) -> String {
    let mut text = String::from("bus.tick,bus.time_ns,bus.status,bus.dropped,level,full,speed\n");
    for tick in 1..=ticks {
        let time = u64::from(tick) * 10_000_000;
        let _ = writeln!(text, "{tick},{time},0,0,{tick},{},0", tick % 2);
    }
    text
}

/// A folder with a recording and the driver.cfg, and the address of their line.
struct Stage {
    folder: tempfile::TempDir,
    address: String,
}

impl Stage {
    fn new(name: &str, recording: &[u8]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = free.local_addr().expect("it is bound").to_string();
        std::fs::write(folder.path().join(name), recording).expect("written");
        let keys = format!("address = \"{address}\"");
        std::fs::write(folder.path().join("x.cfg"), text(&keys)).expect("written");
        Self { folder, address }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
        command.arg("play").args(arguments).current_dir(self.path());
        command
    }

    /// Runs the command, which ends without a PLC.
    fn play(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("tickbus runs")
    }

    /// Starts the command, and the PLC in front of it.
    fn with_plc(&self, arguments: &[&str]) -> (Child, End) {
        let child = self.command(arguments).stdout(Stdio::piped()).spawn();
        let keys = format!("address = \"{}\"\nrole = \"controller\"", self.address);
        let plc = End::open(&text(&keys), &Monotonic::shared(), &tickbus::KINDS);
        (child.expect("tickbus runs"), plc)
    }
}

/// Ticks until the command ends; returns the values of `level` while they were fresh, one for each change.
#[track_caller]
fn seen(child: &mut Child, plc: &mut End) -> Vec<f64> {
    let mut seen = Vec::new();
    let status = patiently(|| {
        plc.set("speed", 77.0);
        if plc.tick().code != Code::Stale && seen.last() != Some(&plc.get("level")) {
            seen.push(plc.get("level"));
        }
        child.try_wait().expect("it is ours")
    });
    assert!(status.expect("it ends").success());
    seen
}

fn output_of(child: Child) -> String {
    let output = child.wait_with_output().expect("it has ended");
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn a_plc_sees_the_recorded_machine_and_its_answer_is_recorded() {
    let stage = Stage::new("run.csv", counted(60).as_bytes());
    let arguments = ["run.csv", "x.cfg", "--wait", "--record", "answer.csv"];
    let (mut child, mut plc) = stage.with_plc(&arguments);
    let seen = seen(&mut child, &mut plc);
    // A busy computer may look at some of the values only.
    assert!(seen.len() > 5, "{seen:?}");
    assert!(seen.is_sorted(), "{seen:?}");
    assert!(seen.last().is_some_and(|last| *last > 50.0), "{seen:?}");
    let told = output_of(child);
    assert!(told.contains("\nplayed 60 ticks"), "{told}");
    assert!(told.contains("\nplay: ok scans="), "{told}");
    let answer = std::fs::read_to_string(stage.path().join("answer.csv")).expect("a recording");
    assert!(
        answer
            .lines()
            .last()
            .is_some_and(|row| row.ends_with(",77"))
    );
}

#[test]
fn a_looped_recording_begins_again() {
    let stage = Stage::new("run.csv", counted(5).as_bytes());
    let arguments = ["run.csv", "x.cfg", "--loop", "--duration", "2s", "--stats"];
    let (mut child, mut plc) = stage.with_plc(&arguments);
    let seen = seen(&mut child, &mut plc);
    let again = seen.windows(2).filter(|pair| pair[1] < pair[0]).count();
    assert!(again > 1, "{seen:?}");
    let told = output_of(child);
    let passes = told
        .lines()
        .find_map(|line| line.strip_prefix("play.passes="));
    let passes: usize = passes.expect("it is counted").parse().expect("a number");
    assert!(passes >= again, "{told}");
}

#[test]
fn a_held_recording_keeps_its_last_values() {
    let stage = Stage::new("run.csv", counted(5).as_bytes());
    let arguments = ["run.csv", "x.cfg", "--hold", "--duration", "1s"];
    let (mut child, mut plc) = stage.with_plc(&arguments);
    let seen = seen(&mut child, &mut plc);
    assert_eq!(seen.last(), Some(&5.0));
    assert!(output_of(child).contains("\nplayed 5 ticks"));
}

/// A recording in VCD, of a simulation on a stepped loopback.
fn vcd(signals: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.vcd");
    let text = format!(
        "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\n\
         program = \"mirror\"\n[record]\nfile = {:?}\n{signals}",
        file.display().to_string()
    );
    let config = Config::parse("x.cfg", &text, &tickbus::KINDS);
    let config = config.unwrap_or_else(|why| panic!("{why}"));
    let mut driver = Driver::open(config, Manual::new()).expect("opens");
    let mut slots = driver.initial_slots();
    for tick in 1..=20 {
        slots[0] = Slot::from_real(f64::from(tick));
        driver.exchange(Nanos::from_millis(tick.into()), &mut slots);
    }
    driver.close();
    std::fs::read(&file).expect("a recording")
}

#[test]
fn a_recording_that_is_cut_is_played_to_its_last_whole_tick() {
    let whole = vcd(SIGNALS);
    for (part, begin, note) in [
        (whole.len(), "played 20 ticks", ""),
        (
            whole.len() * 9 / 10,
            "played 1",
            "; the recording is cut: it was never ended",
        ),
    ] {
        let stage = Stage::new("run.vcd", &whole[..part]);
        let output = stage.play(&["run.vcd", "x.cfg"]);
        let told = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(0), "{told}");
        let line = told.lines().find(|line| line.starts_with("played "));
        let line = line.unwrap_or_else(|| panic!("{told}"));
        assert!(line.ends_with(note), "{told}");
        assert!(line.starts_with(begin), "{told}");
    }
}

#[test]
fn what_cannot_be_played_is_told() {
    let other = SIGNALS.replace("level", "angle").replace("full", "open");
    let bits = SIGNALS.replace(
        "address = \"%IX0.0\"",
        "address = \"%IB0\"\ntype = \"USINT\"",
    );
    let of_units = SIGNALS.replace("\"mm\"", "\"cm\"");
    let head = counted(0);
    for (name, recording, why) in [
        ("run.csv", Vec::new(), "run.csv"),
        ("run.vcd", Vec::new(), "run.vcd"),
        (
            "run.csv",
            head.clone().into_bytes(),
            "this recording has no tick",
        ),
        ("run.txt", Vec::new(), ".vcd"),
        (
            "run.vcd",
            vcd(&other),
            "this recording has no %I of this driver.cfg",
        ),
        (
            "run.vcd",
            vcd(&bits),
            "\"full\" (%IX0.0 BOOL) is another signal in this recording",
        ),
        (
            "run.vcd",
            vcd(&of_units),
            "\"level\" is in cm in this recording, and in mm in the driver.cfg",
        ),
        (
            "run.csv",
            (head + "1,x,0,0,1,1,0\n").into_bytes(),
            "run.csv:2: ",
        ),
        (
            "run.csv",
            (counted(2) + "3,x,0,0,1,1,0\n").into_bytes(),
            "run.csv:4: ",
        ),
    ] {
        let stage = Stage::new(name, &recording);
        let output = stage.play(&[name, "x.cfg"]);
        let told = [&output.stderr[..], &output.stdout[..]]
            .map(String::from_utf8_lossy)
            .concat();
        assert!(told.contains(why), "{name}: {why:?} in {told}");
        assert_eq!(output.status.code(), Some(1), "{told}");
    }
    let stage = Stage::new("run.csv", &[]);
    let told = stage.play(&["none.csv", "x.cfg"]);
    assert!(
        String::from_utf8_lossy(&told.stderr).contains("none.csv: the recording cannot be read")
    );
    assert_eq!(told.status.code(), Some(1));
    let both = stage.play(&["run.csv", "x.cfg", "--loop", "--hold"]);
    assert_eq!(both.status.code(), Some(2));
}

#[test]
fn signals_that_only_one_side_has_are_named() {
    let recording = counted(3).replace("full", "empty");
    let stage = Stage::new("run.csv", recording.as_bytes());
    let output = stage.play(&["run.csv", "x.cfg"]);
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    for line in [
        "play: run.csv does not have, and the fail-safe value is played: \"full\"\n",
        "play: run.csv has, and the driver.cfg does not: \"empty\"\n",
    ] {
        assert!(told.contains(line), "{told}");
    }
}

#[test]
fn the_recording_that_is_played_is_not_recorded_over() {
    let stage = Stage::new("run.csv", counted(3).as_bytes());
    let output = stage.play(&["run.csv", "x.cfg", "--record", "run.csv"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("this file is being replayed"), "{told}");
    assert_ne!(output.status.code(), Some(0));
    let kept = std::fs::read_to_string(stage.path().join("run.csv")).expect("text");
    assert_eq!(kept, counted(3));
}

/// One run on virtual time with the PLC program "mirror": the last line of the player, and the recording of the PLC.
fn on_virtual_time() -> (String, String) {
    let stage = Stage::new("run.csv", counted(20).as_bytes());
    let run = "[sync]\nlisten = \"127.0.0.1:0\"\nuntil = \"300ms\"\nstep = \"1ms\"\n\
               clients = [\"Cell\", \"Cell PLC\"]\n";
    std::fs::write(stage.path().join("run.toml"), run).expect("written");
    let tickbus = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
        command.args(arguments).current_dir(stage.path());
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        child.expect("tickbus runs")
    };
    let mut sync = tickbus(&["sync", "run.toml"]);
    let mut lines = BufReader::new(sync.stdout.take().expect("it is piped")).lines();
    let line = lines.next().expect("a line").expect("text");
    let address = line
        .strip_prefix("sync: listening on ")
        .expect("an address");
    let signals = SIGNALS.replace("%IW2", "%IW0").replace("%IX0.0", "%IX2.0");
    let text = format!(
        "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nkind = \"sdsp\"\naddress = \"{address}\"\n{signals}"
    );
    std::fs::write(stage.path().join("x.cfg"), text).expect("written");
    let player = tickbus(&["play", "run.csv", "x.cfg", "--hold"]);
    let plc = tickbus(&[
        "plc", "mirror", "--config", "x.cfg", "--scan", "5ms", "--record", "plc.csv",
    ]);
    let [player, _] = [player, plc].map(output_of);
    assert!(lines.map(|line| line.expect("text")).last().is_some());
    sync.wait().expect("it is ours");
    let last = player.lines().last().expect("a line").to_owned();
    let seen = std::fs::read_to_string(stage.path().join("plc.csv")).expect("a recording");
    (last, seen)
}

#[test]
fn on_virtual_time_two_runs_are_equal() {
    let (last, seen) = on_virtual_time();
    assert!(
        last.starts_with("play: ok scans=") && last.contains(" hash="),
        "{last}"
    );
    let row = seen.lines().last().expect("a row");
    assert!(row.ends_with(",20,0,20"), "{row}");
    assert_eq!(on_virtual_time(), (last, seen));
}
