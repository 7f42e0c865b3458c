//! Recording and replaying, from driver.cfg to the file and back.
#![allow(
    missing_docs,
    clippy::cast_precision_loss,
    reason = "tests; small whole numbers"
)]

mod file;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tickbus::driver::{Code, Driver, Exchange};
use tickbus::driver_cfg::Config;
use tickbus::record::{Recording, Tick};
use tickbus::signal::{Area, Slot};
use tickbus::time::{Manual, Nanos};
use tickbus_conformance::rig::Looks;
use tickbus_test_log as logged;

/// A folder with driver.cfg files and recordings; deleted with the test.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    fn text(&self, name: &str) -> String {
        String::from_utf8(self.bytes(name)).expect("text")
    }

    fn config(&self, text: &str) -> Config {
        let path = self.path("driver.cfg");
        Config::parse(path.to_str().expect("UTF-8"), text, &tickbus::KINDS)
            .unwrap_or_else(|why| panic!("{why}"))
    }

    /// The error on opening.
    fn refusal(&self, text: &str) -> String {
        let config = self.config(text);
        let _logged = logged::Watch::new();
        let error = Driver::open(config, Manual::new()).expect_err("refused");
        assert!(error.is_wrong_input(), "{error}");
        error.to_string()
    }
}

/// An open driver with its slots.
struct Run {
    driver: Driver,
    slots: Vec<Slot>,
    random: u64,
    _logged: logged::Watch,
}

impl Run {
    fn open(folder: &Folder, text: &str) -> Self {
        Self::on(folder, text, &Manual::new())
    }

    fn on(folder: &Folder, text: &str, clock: &Arc<Manual>) -> Self {
        let logged = logged::Watch::new();
        let driver = Driver::open(folder.config(text), Arc::clone(clock) as _)
            .unwrap_or_else(|error| panic!("{error}"));
        let slots = driver.initial_slots();
        Self {
            driver,
            slots,
            random: 1,
            _logged: logged,
        }
    }

    fn exchange(&mut self, millis: u64) -> Exchange {
        let time = Nanos::from_millis(i64::try_from(millis).expect("small"));
        self.driver.exchange(time, &mut self.slots)
    }

    fn random(&mut self) -> u64 {
        // Knuth's generator: the same numbers on every machine.
        self.random = self
            .random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.random >> 33
    }

    fn index(&self, name: &str) -> usize {
        self.driver.config().table.position(name).expect(name)
    }

    fn set(&mut self, name: &str, value: f64) {
        let index = self.index(name);
        self.slots[index] = Slot::from_real(value);
    }

    /// A machine that acts at random: some of this end's values change, some depending on values that it reads.
    fn machine(&mut self) {
        for index in 0..self.driver.config().table.signals.len() {
            let signal = &self.driver.config().table.signals[index];
            if signal.area == Area::Input && self.random().is_multiple_of(8) {
                let echo = self.slots[index / 2].real();
                let value = (self.random() % 3) as f64 + echo;
                self.slots[index] = Slot::from_real(value);
            }
        }
    }

    fn ticks(&mut self, ticks: std::ops::RangeInclusive<u64>) {
        for tick in ticks {
            self.machine();
            self.exchange(2 * tick);
        }
    }

    fn statistic(&self, key: &str) -> String {
        let text = self.driver.statistics();
        let found = text
            .lines()
            .find_map(|line| line.strip_prefix(&format!("{key}=")));
        found
            .unwrap_or_else(|| panic!("no {key} in {text}"))
            .to_owned()
    }
}

/// The rig's driver.cfg on another bus, recording to `file`.
fn rig(fieldbus: &str, file: &str) -> String {
    let text = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/driver.cfg"))
        .expect("the rig's driver.cfg");
    let signals = &text[text.find("[[signal]]").expect("signals")..];
    let record = if file.is_empty() {
        String::new()
    } else {
        format!("[record]\nfile = \"{file}\"\n")
    };
    format!(
        "[driver]\nid = 1\nname = \"Test rig\"\n[fieldbus]\nkind = \"loopback\"\n{fieldbus}\n{record}{signals}"
    )
}

const RIG: &str = "program = \"rig\"\nscan = \"10ms\"\nmode = \"stepped\"";

/// All ticks of a recording.
fn read(path: &Path, config: &Config) -> Vec<Tick> {
    let mut recording = Recording::open(path, Some(&config.table)).expect("a recording");
    let mut tick = Tick::new(recording.columns());
    let mut ticks = Vec::new();
    while recording.next(&mut tick).expect("a tick") {
        ticks.push(tick.clone());
    }
    ticks
}

#[test]
fn two_runs_of_the_stepped_rig_give_the_same_bytes() {
    let folder = Folder::new();
    for file in ["quiet.vcd", "quiet.csv"] {
        let mut run = Run::open(&folder, &rig(RIG, file));
        run.ticks(1..=3_000);
        run.driver.close();
    }
    // More busy threads than there are processors, and a ring that is always full.
    let stop = Arc::new(AtomicBool::new(false));
    let busy: Vec<_> = (0..4)
        .map(|_| {
            let stop = Arc::clone(&stop);
            std::thread::spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            })
        })
        .collect();
    for file in ["busy.vcd", "busy.csv"] {
        let text = rig(RIG, file).replace("[record]", "[record]\nring = 2");
        let mut run = Run::open(&folder, &text);
        run.ticks(1..=3_000);
        assert_eq!(run.statistic("record.dropped"), "0");
        run.driver.close();
    }
    stop.store(true, Ordering::Relaxed);
    for thread in busy {
        thread.join().expect("no panic");
    }
    for format in ["vcd", "csv"] {
        let [quiet, busy] = ["quiet", "busy"].map(|run| folder.bytes(&format!("{run}.{format}")));
        assert!(quiet.len() > 50_000, "{} bytes", quiet.len());
        assert!(quiet == busy, "the recordings differ");
    }
    assert!(
        folder
            .text("quiet.vcd")
            .ends_with("$comment end \"ticks=3000 dropped=0\" $end\n")
    );
    assert_eq!(folder.text("quiet.csv").lines().count(), 3_001);
}

#[test]
fn a_replay_of_a_replay_is_the_recording() {
    let folder = Folder::new();
    let mut run = Run::open(&folder, &rig(RIG, "run.vcd"));
    run.ticks(1..=3_000);
    run.driver.close();
    let mut run = Run::open(&folder, &rig(RIG, "run.csv"));
    run.ticks(1..=3_000);
    run.driver.close();
    for file in ["run.vcd", "run.csv"] {
        let mut run = Run::open(&folder, &rig(&format!("replay = \"{file}\""), "again.vcd"));
        run.ticks(1..=3_000);
        assert_eq!(run.statistic("replay.ticks"), "3000");
        assert_eq!(run.statistic("replay.compared"), "3000");
        assert_eq!(run.statistic("replay.differences"), "0");
        run.driver.close();
        assert!(
            folder.bytes("again.vcd") == folder.bytes("run.vcd"),
            "{file}"
        );
        let list = folder.text(&format!("{file}.diff"));
        assert_eq!(
            list,
            "tick,time_ns,signal,expected,seen\n# ticks=3000 differences=0\n"
        );
    }
}

/// Ticks in two halves: in each, the model answers the values that it received in the same tick.
fn answers(run: &mut Run, ticks: u64, step: u64) {
    for tick in 1..=ticks {
        let time = Nanos::from_millis(i64::try_from(step * tick).expect("small"));
        run.driver.receive(time, &mut run.slots);
        run.machine();
        run.driver.send(&mut run.slots);
    }
}

#[test]
fn ticks_of_two_halves_are_rows_that_replay_without_a_difference() {
    let folder = Folder::new();
    for file in ["run.vcd", "run.csv"] {
        let mut run = Run::open(&folder, &rig(RIG, file));
        answers(&mut run, 3_000, 2);
        assert_eq!(run.statistic("ticks"), "3000");
        let config = run.driver.config().clone();
        run.driver.close();
        let rows = read(&folder.path(file), &config);
        assert_eq!(rows.len(), 3_000, "one row a tick");
        let mut run = Run::open(&folder, &rig(&format!("replay = \"{file}\""), "again.vcd"));
        answers(&mut run, 3_000, 2);
        assert_eq!(run.statistic("replay.ticks"), "3000");
        assert_eq!(run.statistic("replay.compared"), "3000");
        assert_eq!(run.statistic("replay.differences"), "0");
        run.driver.close();
        let again = read(&folder.path("again.vcd"), &config);
        for (was, is) in rows.iter().zip(&again) {
            assert_eq!((was.number, was.time), (is.number, is.time));
            assert_eq!(was.values, is.values, "tick {}", was.number);
        }
    }
}

#[test]
fn a_row_has_the_answer_beside_the_question() {
    let folder = Folder::new();
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                scan = \"1ms\"\nmode = \"stepped\"\n[record]\nfile = \"row.csv\"\n\
                [[signal]]\nname = \"in\"\naddress = \"%IW0\"\n[[signal]]\nname = \"out\"\naddress = \"%QW0\"\n";
    let mut run = Run::open(&folder, text);
    for tick in 0..4 {
        run.driver.receive(Nanos::from_millis(tick), &mut run.slots);
        let out = run.index("out");
        run.set("in", run.slots[out].real() + 1.0);
        run.driver.send(&mut run.slots);
    }
    // The answer is never sent, but counts as a tick.
    run.driver.receive(Nanos::from_millis(4), &mut run.slots);
    run.driver.receive(Nanos::from_millis(5), &mut run.slots);
    run.driver.close();
    let rows = folder.text("row.csv");
    let rows: Vec<&str> = rows.lines().skip(1).collect();
    assert_eq!(
        rows,
        [
            "1,0,0,0,1,0",
            "2,1000000,0,0,2,1",
            "3,2000000,0,0,3,2",
            "4,3000000,0,0,4,3",
            "5,4000000,0,0,4,4",
        ]
    );
}

#[test]
fn without_simulation_time_a_recording_on_a_free_bus_has_the_clocks() {
    let folder = Folder::new();
    let clock = Manual::new();
    clock.advance(Nanos::from_secs(7));
    let text = free(
        "link = \"record-untimed\"",
        "[record]\nfile = \"untimed.csv\"",
    );
    let mut run = Run::on(&folder, &text, &clock);
    for _ in 0..4 {
        run.driver.exchange(None, &mut run.slots);
        clock.advance(Nanos::from_millis(3));
    }
    let config = run.driver.config().clone();
    run.driver.close();
    let rows = read(&folder.path("untimed.csv"), &config);
    let times: Vec<i64> = rows.iter().map(|row| row.time.0).collect();
    assert_eq!(times, [0, 3_000_000, 6_000_000, 9_000_000]);
}

#[test]
fn differences_are_listed_with_tick_signal_expected_and_seen() {
    logged::expect("tick 7 at 7ms: \"LA1 position\" was 125, and is 250");
    logged::expect("tick 9 at 9ms: \"Start button\" was 0, and is 1");
    logged::expect("20 ticks compared, 2 differences");
    let folder = Folder::new();
    let mut run = Run::open(&folder, &rig(RIG, "run.vcd"));
    for tick in 1..=20 {
        run.set("LA1 position", 125.0);
        run.exchange(tick);
    }
    run.driver.close();
    let mut run = Run::open(&folder, &rig("replay = \"run.vcd\"", ""));
    for tick in 1..=20 {
        run.set("LA1 position", if tick == 7 { 250.0 } else { 125.0 });
        run.set("Start button", f64::from(u8::from(tick == 9)));
        run.exchange(tick);
    }
    assert_eq!(run.statistic("replay.differences"), "2");
    run.driver.close();
    assert_eq!(
        folder.text("run.vcd.diff"),
        "tick,time_ns,signal,expected,seen\n7,7000000,LA1 position,125,250\n\
         9,9000000,Start button,0,1\n# ticks=20 differences=2\n"
    );
}

#[test]
fn when_the_recording_ends_the_data_become_stale() {
    let folder = Folder::new();
    let mut run = Run::open(&folder, &rig(RIG, "run.vcd"));
    for tick in 1..=10 {
        run.exchange(tick);
    }
    run.driver.close();
    let mut run = Run::open(&folder, &rig("replay = \"run.vcd\"", ""));
    // A different step size, and a different start.
    for tick in 0..5 {
        assert_eq!(run.exchange(1_000 + 2 * tick).code, Code::Fresh);
    }
    assert_eq!(run.statistic("replay.ticks"), "9");
    assert_eq!(run.exchange(1_009).code, Code::Fresh);
    assert_eq!(run.statistic("replay.ended"), "1");
    assert_eq!(run.statistic("cause"), "left");
    assert!(
        run.statistic("reason")
            .contains("tick 10 was its last, ticks=10 dropped=0")
    );
    assert_eq!(run.exchange(1_010).code, Code::Unchanged);
    assert_eq!(run.exchange(2_000).code, Code::Stale);
}

/// Two stations on a free bus, with pulses between the ticks.
fn free(fieldbus: &str, record: &str) -> String {
    let mut text = format!(
        "[driver]\nid = 1\nname = \"free\"\n[fieldbus]\nkind = \"loopback\"\ncycle = \"1ms\"\n\
         max_age = \"50ms\"\n{fieldbus}\n{record}\n[[station]]\nname = \"A\"\n[[station]]\nname = \"B\"\n"
    );
    for station in ["A", "B"] {
        for (name, address, more) in [
            ("rise", "%QX0.0", "latch = \"rising\"\nfail_safe = true"),
            ("fall", "%QX0.1", "latch = \"falling\""),
            ("both", "%QX0.2", "latch = \"both\""),
            ("plain", "%QX0.3", ""),
            ("wide", "%QL8", "type = \"LINT\"\nfail_safe = -7"),
            ("in", "%IX0.0", "latch = \"rising\"\nhold = \"20ms\""),
            ("level", "%ID4", "type = \"REAL\""),
        ] {
            let _ = write!(
                text,
                "[[signal]]\nname = \"{station} {name}\"\naddress = \"{address}\"\nstation = \"{station}\"\n{more}\n"
            );
        }
    }
    text
}

/// A recording made on a free bus, with pulses and stale data, is reproduced by a replay.
#[test]
fn a_recording_of_a_free_bus_replays_value_by_value() {
    let folder = Folder::new();
    let clock = Manual::new();
    let link = "link = \"record-free\"";
    let mut device = Run::on(
        &folder,
        &free(link, "[record]\nfile = \"free.vcd\""),
        &clock,
    );
    let plc = free(&format!("{link}\nrole = \"controller\""), "");
    let mut plc = Run::on(&folder, &plc, &clock);
    for tick in 1..=600 {
        // Up to four changes by the PLC between two ticks of the machine; sometimes it is silent.
        for _ in 0..plc.random() % 5 {
            for index in 0..plc.slots.len().min(14) {
                if plc.random().is_multiple_of(3) {
                    plc.slots[index] = Slot::from_real((plc.random() % 2) as f64);
                }
            }
            plc.exchange(0);
            clock.advance(Nanos::from_millis(1));
            let mut looks = Looks::default();
            while !clock.is_settled(2) {
                looks.pause();
            }
        }
        device.machine();
        device.exchange(tick * 5);
    }
    assert_eq!(device.statistic("record.dropped"), "0");
    let config = device.driver.config().clone();
    device.driver.close();
    let recorded = read(&folder.path("free.vcd"), &config);
    let replay = free("replay = \"free.vcd\"", "[record]\nfile = \"again.csv\"");
    let mut again = Run::open(&folder, &replay);
    for tick in 1..=600 {
        again.machine();
        again.exchange(tick * 5);
    }
    again.driver.close();
    let replayed = read(&folder.path("again.csv"), &config);
    assert_eq!(recorded.len(), 600);
    let edges = recorded.iter().map(|tick| tick.values[14..].iter());
    let edges: f64 = edges.flat_map(|slots| slots.map(|slot| slot.real())).sum();
    assert!(edges > 500.0, "{edges}");
    for (was, is) in recorded.iter().zip(&replayed) {
        assert_eq!((was.number, was.time), (is.number, is.time));
        assert_eq!(was.values, is.values, "tick {}", was.number);
        // A pulse that has ended may take a frame to fall.
        let same = was.stations.iter().zip(&is.stations);
        assert!(
            same.clone()
                .all(|(was, is)| was == is || (*was, *is) == (1, 0))
        );
    }
    assert!(
        folder
            .text("free.vcd.diff")
            .ends_with("# ticks=600 differences=0\n")
    );
}

#[test]
fn stale_data_are_stale_again_in_a_replay() {
    let folder = Folder::new();
    let clock = Manual::new();
    let link = "link = \"record-stale\"";
    let mut device = Run::on(
        &folder,
        &free(link, "[record]\nfile = \"stale.csv\""),
        &clock,
    );
    let mut codes = vec![device.exchange(1).code];
    let plc = free(&format!("{link}\nrole = \"controller\""), "");
    let mut plc = Run::on(&folder, &plc, &clock);
    plc.set("A plain", 1.0);
    plc.exchange(0);
    for tick in 2..300 {
        clock.advance(Nanos::from_millis(1));
        let mut looks = Looks::default();
        while !clock.is_settled(if tick < 100 { 2 } else { 1 }) {
            looks.pause();
        }
        codes.push(device.exchange(tick).code);
        if tick == 99 {
            let gone = std::mem::replace(&mut plc, Run::open(&folder, &rig(RIG, "")));
            gone.driver.close();
        }
    }
    device.driver.close();
    assert!(codes.contains(&Code::Fresh) && codes.ends_with(&[Code::Stale; 100]));
    let mut again = Run::open(&folder, &free("replay = \"stale.csv\"", ""));
    let replayed: Vec<Code> = (1..300).map(|tick| again.exchange(tick).code).collect();
    assert_eq!(replayed, codes);
}

#[test]
fn another_signal_table_is_refused_by_name() {
    logged::expect("1 signals are not in this recording and are not compared: new");
    let folder = Folder::new();
    let mut run = Run::open(&folder, &rig(RIG, "run.vcd"));
    run.exchange(1);
    run.driver.close();
    let replay = rig("replay = \"run.vcd\"", "");
    let file = folder.path("run.vcd");
    for (from, to, told) in [
        (
            "name    = \"IM1 jog\"",
            "name = \"IM1 jgo\"",
            "it has no \"IM1 jgo\" (%QX1.1) (it has \"IM1 jog\")",
        ),
        (
            "address = \"%QX1.1\"\nlatch   = \"rising\"",
            "address = \"%QD8\"",
            "\"IM1 jog\" (%QD8) DWORD was %QX1.1 BOOL",
        ),
        (
            "address = \"%QX1.1\"",
            "address = \"%IX9.0\"",
            "\"IM1 jog\" (%IX9.0) BOOL was %QX1.1 BOOL",
        ),
    ] {
        assert!(replay.contains(from), "{from}");
        let error = folder.refusal(&replay.replacen(from, to, 1));
        let begin = format!(
            "{}: this recording is of another signal table: {told}; record again",
            file.display()
        );
        assert!(error.starts_with(&begin), "{error}\n{begin}");
    }
    // A sensor that is not in the recording is permitted, and reported.
    let more = "[[signal]]\nname = \"new\"\naddress = \"%IX9.0\"\n";
    let mut run = Run::open(&folder, &(replay + more));
    run.exchange(1);
    assert_eq!(run.statistic("replay.not_compared_signals"), "1");
    assert_eq!(run.statistic("replay.differences"), "0");
}

#[test]
fn what_is_no_recording_is_refused_with_its_place() {
    let folder = Folder::new();
    let replay = rig("replay = \"run.csv\"", "");
    assert!(
        folder
            .refusal(&replay)
            .contains("run.csv: the recording cannot be read: ")
    );
    fs::write(folder.path("run.csv"), "a,b\n").expect("written");
    assert!(
        folder
            .refusal(&replay)
            .contains("run.csv:1: the header does not begin with bus.tick,")
    );
    let replay = replay.replace(".csv", ".vcd");
    fs::write(
        folder.path("run.vcd"),
        "$version x $end\n$enddefinitions $end\n",
    )
    .expect("written");
    assert!(
        folder
            .refusal(&replay)
            .contains("run.vcd: this VCD file was not made by tickbus; ")
    );
    fs::write(
        folder.path("run.vcd"),
        "$comment tickbus recording 1 $end\n",
    )
    .expect("written");
    let cut = folder.refusal(&replay);
    assert!(
        cut.contains("run.vcd:") && cut.contains(": the recording is cut within its header; "),
        "{cut}"
    );
}

#[test]
fn a_cut_recording_replays_up_to_its_last_whole_tick() {
    let folder = Folder::new();
    let mut run = Run::open(&folder, &rig(RIG, "run.vcd"));
    run.ticks(1..=50);
    run.driver.close();
    let whole = folder.text("run.vcd");
    let at = whole.find("#80000000\n").expect("tick 40");
    fs::write(folder.path("run.vcd"), &whole[..at + 14]).expect("written");
    let mut run = Run::open(&folder, &rig("replay = \"run.vcd\"", ""));
    run.ticks(1..=50);
    assert_eq!(run.statistic("replay.ticks"), "39");
    let reason = run.statistic("reason");
    assert!(
        reason.contains("tick 39 was its last, the recording is cut"),
        "{reason}"
    );
    run.driver.close();
    // Damage in the middle is an error, reported with its line.
    let broken = whole.replacen("#80000000\n", "#8000\n", 1);
    fs::write(folder.path("run.vcd"), broken).expect("written");
    let mut run = Run::open(&folder, &rig("replay = \"run.vcd\"", ""));
    run.ticks(1..=38);
    assert_eq!(run.statistic("state"), "running");
    run.ticks(39..=41);
    let reason = run.statistic("reason");
    assert!(
        reason.contains("the time goes back from 78ms to 8us; record again"),
        "{reason}"
    );
    assert_eq!(run.exchange(100).code, Code::BusFailed);
}
