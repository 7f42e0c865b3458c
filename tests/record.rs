//! Recording and replaying, from driver.cfg to the file and back.
#![allow(
    missing_docs,
    clippy::cast_precision_loss,
    reason = "tests; small whole numbers"
)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tickbus::driver::{Code, Config, Driver, Exchange};
use tickbus::record::{Recording, Tick};
use tickbus::signal::{Area, Slot};
use tickbus::time::{Manual, Nanos};

/// A folder with driver.cfg files and recordings, which goes with the test.
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
        Config::parse(path.to_str().expect("UTF-8"), text).unwrap_or_else(|why| panic!("{why}"))
    }

    /// What opening fails with.
    fn refusal(&self, text: &str) -> String {
        let config = self.config(text);
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
}

impl Run {
    fn open(folder: &Folder, text: &str) -> Self {
        Self::on(folder, text, &Manual::new())
    }

    fn on(folder: &Folder, text: &str, clock: &Arc<Manual>) -> Self {
        let driver = Driver::open(folder.config(text), Arc::clone(clock) as _)
            .unwrap_or_else(|error| panic!("{error}"));
        let slots = driver.initial_slots();
        Self {
            driver,
            slots,
            random: 1,
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

    /// A machine that does as it likes: some of what this end writes changes, some of it after what it reads.
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

/// The rig's driver.cfg on another bus, recorded to `file`.
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
    // Busy threads beside, more than there are processors, and a ring that is always full.
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

/// Ticks of two halves: the model answers in each to what it received in the same.
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
    // Its answer is never sent, and it is a tick all the same.
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
    // Another step size, and another beginning.
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

/// What was recorded on a free bus, pulses, stale data and all, is shown again by a replay.
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
        // Up to four changes of the PLC between two ticks of the machine; sometimes it is silent.
        for _ in 0..plc.random() % 5 {
            for index in 0..plc.slots.len().min(14) {
                if plc.random().is_multiple_of(3) {
                    plc.slots[index] = Slot::from_real((plc.random() % 2) as f64);
                }
            }
            plc.exchange(0);
            clock.advance(Nanos::from_millis(1));
            while !clock.is_settled(2) {
                std::thread::yield_now();
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
        // A pulse that is over may take a frame to fall.
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
        while !clock.is_settled(if tick < 100 { 2 } else { 1 }) {
            std::thread::yield_now();
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
    // A sensor that is new is no hindrance, and said.
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
            .contains("run.csv: the recording cannot be read: No such file")
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
    // Damage in the midst of it is an error, with its line.
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

#[cfg(target_os = "linux")]
#[test]
fn a_full_disc_ends_the_recording_and_not_the_run() {
    let folder = Folder::new();
    std::os::unix::fs::symlink("/dev/full", folder.path("run.vcd")).expect("a link");
    let mut run = Run::open(&folder, &rig(RIG, "run.vcd"));
    let limit = std::time::Instant::now() + std::time::Duration::from_secs(20);
    let mut tick = 0;
    while !run.driver.statistics().contains("record.error=") {
        tick += 1;
        assert_eq!(run.exchange(tick).code, Code::Fresh);
        assert!(std::time::Instant::now() < limit, "nobody noticed");
    }
    let error = run.statistic("record.error");
    assert!(
        error.contains("ended with tick 0 of the file: No space left"),
        "{error}"
    );
    assert_eq!(run.statistic("record.ticks"), "0");
    assert_eq!(run.exchange(tick + 1).code, Code::Fresh);
}

#[cfg(unix)]
#[test]
fn a_pipe_is_refused_at_once_though_nobody_reads_it() {
    let folder = Folder::new();
    let made = std::process::Command::new("mkfifo")
        .arg(folder.path("run.vcd"))
        .status();
    assert!(made.expect("mkfifo runs").success());
    let error = folder.refusal(&rig(RIG, "run.vcd"));
    assert!(
        error.contains("this is a pipe, and a recording is a file; name a file"),
        "{error}"
    );
}

#[test]
fn a_tick_that_nobody_answered_is_recorded_with_what_was_there_at_its_end() {
    let folder = Folder::new();
    let text = rig(RIG, "run.vcd");
    let mut run = Run::open(&folder, &text);
    run.ticks(1..=5);
    let time = Nanos::from_millis(12);
    run.driver.receive(time, &mut run.slots);
    run.driver.end_tick(&run.slots);
    run.driver.end_tick(&run.slots);
    run.driver.close();
    let ticks = read(&folder.path("run.vcd"), &folder.config(&text));
    assert_eq!(ticks.len(), 6);
    assert_eq!((ticks[5].number, ticks[5].time), (6, time));
}

#[test]
fn a_file_is_recorded_to_by_one_driver_and_must_be_possible() {
    let folder = Folder::new();
    let run = Run::open(&folder, &rig(RIG, "run.vcd"));
    let error = folder.refusal(&rig(RIG, "./run.vcd"));
    assert!(
        error.contains("another driver of this process records to this file; "),
        "{error}"
    );
    run.driver.close();
    Run::open(&folder, &rig(RIG, "run.vcd")).driver.close();
    let error = folder.refusal(&rig(RIG, "nowhere/run.vcd"));
    assert!(error.contains("the recording cannot be made: "), "{error}");
    // Switched off, it takes no file at all.
    let off = rig(RIG, "off.vcd").replace("[record]", "[record]\nwhen = \"never\"");
    Run::open(&folder, &off).driver.close();
    assert!(!folder.path("off.vcd").exists());
}

#[test]
fn the_statistics_tell_what_is_recorded() {
    let folder = Folder::new();
    let mut run = Run::open(&folder, &rig(RIG, "run.csv"));
    run.ticks(1..=10);
    assert_eq!(
        run.statistic("record.file"),
        folder.path("run.csv").display().to_string()
    );
    assert_eq!(run.statistic("record.dropped"), "0");
    let limit = std::time::Instant::now() + std::time::Duration::from_secs(20);
    while run.statistic("record.ticks") != "10" {
        assert!(std::time::Instant::now() < limit, "never written");
        std::thread::yield_now();
    }
}

/// `tickbus mirror` on a line where nobody is, recording to `file`.
#[cfg(unix)]
fn mirror(folder: &Folder, file: &str) -> std::process::Child {
    let text = rig("", "")
        .replace("\"loopback\"", "\"socket\"\naddress = \"127.0.0.1:0\"")
        .replacen(
            "[[signal]]",
            "[record]\nfile = \"not-this.vcd\"\n[[signal]]",
            1,
        );
    fs::write(folder.path("driver.cfg"), text).expect("written");
    std::process::Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args([
            "mirror",
            "driver.cfg",
            "--tick",
            "1ms",
            "--stats",
            "--record",
            file,
        ])
        .current_dir(folder.0.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("tickbus runs")
}

#[cfg(unix)]
#[test]
fn the_commands_record_and_a_file_is_whole_however_they_end() {
    for signal in ["INT", "TERM", "KILL"] {
        let folder = Folder::new();
        let mut child = mirror(&folder, "run.vcd");
        let limit = std::time::Instant::now() + std::time::Duration::from_secs(20);
        // Some ticks are in the file, and more on their way.
        while !fs::read_to_string(folder.path("run.vcd")).is_ok_and(|text| text.contains("#20")) {
            assert!(std::time::Instant::now() < limit, "{:?}", child.try_wait());
            std::thread::yield_now();
        }
        let kill = std::process::Command::new("kill")
            .args([&format!("-{signal}"), &child.id().to_string()])
            .status();
        assert!(kill.expect("kill runs").success());
        let output = child.wait_with_output().expect("it ran");
        let told = String::from_utf8_lossy(&output.stdout).into_owned();
        let config = Config::load(&folder.path("driver.cfg")).expect("a driver.cfg");
        let path = folder.path("run.vcd");
        let ticks = read(&path, &config);
        assert!(ticks.len() > 20);
        assert!(
            ticks
                .iter()
                .zip(1..)
                .all(|(tick, number)| tick.number == number)
        );
        let ended = folder.text("run.vcd").contains("$comment end ");
        assert_eq!(ended, signal != "KILL");
        if ended {
            assert_eq!(output.status.code(), Some(0));
            assert!(told.contains("record.dropped=0"), "{told}");
        }
        assert!(
            !folder.path("not-this.vcd").exists(),
            "the flag alone records here"
        );
    }
}

#[cfg(unix)]
#[test]
fn a_recording_that_cannot_be_made_is_wrong_input() {
    let folder = Folder::new();
    for (file, told) in [
        ("run.txt", "--record: "),
        ("nowhere/run.vcd", "the recording cannot be made: "),
    ] {
        let output = mirror(&folder, file).wait_with_output().expect("it ran");
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(error.contains(told) && error.contains("; "), "{error}");
        assert_eq!(output.status.code(), Some(1));
    }
}

/// A file that is replayed, by another name, by a link, and by another driver.
#[test]
fn nothing_is_recorded_over_what_is_replayed() {
    let folder = Folder::new();
    let mut run = Run::open(&folder, &rig(RIG, "run.csv"));
    run.ticks(1..=200);
    run.driver.close();
    let recorded = folder.bytes("run.csv");
    fs::create_dir(folder.path("beside")).expect("made");
    fs::hard_link(folder.path("run.csv"), folder.path("link.csv")).expect("linked");
    let destroys =
        "run.csv: this file is being replayed, and recording would destroy it; name another file";
    let replay = "replay = \"run.csv\"";
    let refused = folder.refusal(&rig(replay, "beside/../run.csv"));
    assert!(refused.contains(destroys), "{refused}");
    let linked = folder.refusal(&rig(replay, "link.csv"));
    assert!(
        linked.contains("link.csv: this file is being replayed"),
        "{linked}"
    );
    let mut replaying = Run::open(&folder, &rig(replay, ""));
    let other = folder.refusal(&rig(RIG, "run.csv"));
    assert!(other.contains(destroys), "{other}");
    let again = Run::open(&folder, &rig(replay, ""));
    again.driver.close();
    let still = folder.refusal(&rig(RIG, "run.csv"));
    assert!(
        still.contains(destroys),
        "one of two replays goes on: {still}"
    );
    replaying.ticks(1..=200);
    assert_eq!(replaying.statistic("replay.ticks"), "200");
    replaying.driver.close();
    assert!(folder.bytes("run.csv") == recorded, "it is as it was");
    let recording = Run::open(&folder, &rig(RIG, "run.csv"));
    let early = folder.refusal(&rig("replay = \"link.csv\"", ""));
    assert!(
        early.contains("link.csv: a driver of this process records to this file"),
        "{early}"
    );
    recording.driver.close();
}

/// Recorded in the plant, replayed in a test: the same driver.cfg.
#[test]
fn a_test_that_replays_the_plant_s_recording_leaves_it_as_it_is() {
    let folder = Folder::new();
    let plant = rig(RIG, "run.csv");
    let mut run = Run::open(&folder, &plant);
    run.ticks(1..=200);
    run.driver.close();
    let recorded = folder.bytes("run.csv");
    let replay = "[fieldbus]\nkind = \"loopback\"\nreplay = \"run.csv\"\n";
    let config = folder.config(&plant).overlaid("a test", replay);
    let config = config.unwrap_or_else(|wrong| panic!("{wrong}"));
    let driver = Driver::open(config, Manual::new()).expect("opens");
    let slots = driver.initial_slots();
    let mut test = Run {
        driver,
        slots,
        random: 1,
    };
    test.ticks(1..=200);
    assert_eq!(test.statistic("replay.ticks"), "200");
    test.driver.close();
    assert!(folder.bytes("run.csv") == recorded, "it is as it was");
}
