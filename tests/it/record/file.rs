//! The file of a recording: its choice and its fate.

use super::*;

#[cfg(target_os = "linux")]
#[test]
fn a_full_disc_ends_the_recording_and_not_the_run() {
    logged::expect("the recording ended with tick ");
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
    // When disabled, recording does not touch any file.
    let off = rig(RIG, "off.vcd").replace("[record]", "[record]\nwhen = \"never\"");
    Run::open(&folder, &off).driver.close();
    assert!(!folder.path("off.vcd").exists());
}

#[test]
fn only_a_tick_overwrites_a_recording() {
    let folder = Folder::new();
    let open = || Run::open(&folder, &rig(RIG, "run.vcd"));
    open().driver.close();
    let empty = folder.text("run.vcd");
    assert!(
        empty.contains("$comment end \"ticks=0 dropped=0\" $end"),
        "{empty}"
    );
    let mut run = open();
    run.ticks(1..=50);
    run.driver.close();
    let recorded = folder.bytes("run.vcd");
    open().driver.close();
    assert!(folder.bytes("run.vcd") == recorded);
    let replay = rig("replay = \"run.vcd\"", "");
    let mut run = Run::open(&folder, &replay);
    run.ticks(1..=50);
    run.driver.close();
    let list = folder.bytes("run.vcd.diff");
    assert!(!list.is_empty());
    Run::open(&folder, &replay).driver.close();
    assert!(folder.bytes("run.vcd.diff") == list);
    let mut run = open();
    run.ticks(1..=1);
    run.driver.close();
    assert!(folder.bytes("run.vcd").len() < recorded.len());
}

/// A file under a lock of another process' kind.
#[cfg(unix)]
#[test]
fn a_file_that_another_process_uses_is_neither_recorded_to_nor_replayed() {
    use tickbus::os::{Lock, lock_file};

    let folder = Folder::new();
    let mut run = Run::open(&folder, &rig(RIG, "run.vcd"));
    run.ticks(1..=50);
    let other = fs::File::open(folder.path("run.vcd")).expect("opens");
    assert!(!lock_file(&other, Lock::Shared).expect("there are locks"));
    run.driver.close();
    let recorded = folder.bytes("run.vcd");
    let replay = rig("replay = \"run.vcd\"", "");
    assert!(lock_file(&other, Lock::Exclusive).expect("there are locks"));
    let error = folder.refusal(&replay);
    assert!(
        error.contains("process ") && error.contains(" records to this file; "),
        "{error}"
    );
    assert!(lock_file(&other, Lock::Shared).expect("there are locks"));
    let error = folder.refusal(&rig(RIG, "run.vcd"));
    assert!(
        error.contains(" records to this file, or replays it; "),
        "{error}"
    );
    assert!(folder.bytes("run.vcd") == recorded);
    let run = Run::open(&folder, &replay);
    assert!(!lock_file(&other, Lock::Exclusive).expect("there are locks"));
    run.driver.close();
    assert!(lock_file(&other, Lock::Exclusive).expect("there are locks"));
}

#[test]
fn a_recording_has_what_was_on_the_line() {
    let folder = Folder::new();
    let mut text =
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                scan = \"1ms\"\nmode = \"stepped\"\n[record]\nfile = \"line.csv\"\n"
            .to_owned();
    let kinds = [
        "INT\"\nscale = { raw = [-32768, 32767], value = [-592.6, 592.6] }",
        "SINT\"\nfail_safe = 7",
        "REAL\"",
    ];
    for (number, kind) in kinds.iter().enumerate() {
        for area in ["I", "Q"] {
            let letter = ["W", "B", "D"][number];
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area}{number}\"\naddress = \"%{area}{letter}{}\"\ntype = \"{kind}\n",
                4 * number
            );
        }
    }
    let mut run = Run::open(&folder, &text);
    for (tick, value) in (1..).zip([600.0, 1e300, -1e9, 25.000_1, f64::NAN, 0.1]) {
        for name in ["I0", "I1", "I2"] {
            run.set(name, value);
        }
        run.exchange(tick);
    }
    let config = run.driver.config().clone();
    run.driver.close();
    let rows = read(&folder.path("line.csv"), &config);
    assert_eq!(rows.len(), 6);
    for row in &rows {
        for pair in row.values.chunks(2) {
            // The peer has the same codec, and returns its received values.
            assert_eq!(pair[0], pair[1], "{row:?}");
        }
    }
    assert_eq!(rows[0].values[2].real().to_bits(), 127_f64.to_bits());
    assert_eq!(rows[4].values[2].real().to_bits(), 7_f64.to_bits());
}

#[test]
fn commands_that_only_look_open_no_recording_and_no_port() {
    let folder = Folder::new();
    // A server at this address fails.
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = taken.local_addr().expect("bound");
    let text = format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"socket\"\naddress = \"{address}\"\n\
         [page]\nlisten = \"{address}\"\n[record]\nfile = \"run.csv\"\n\
         [[signal]]\nname = \"go\"\naddress = \"%QX0.0\"\n"
    );
    let recorded = "bus.tick,bus.time_ns,bus.status,bus.dropped,go\n1,0,0,0,1\n";
    fs::write(folder.path("driver.cfg"), text).expect("written");
    fs::write(folder.path("run.csv"), recorded).expect("written");
    for arguments in [
        &["check", "driver.cfg"][..],
        &["export", "driver.cfg", "--for", "codesys", "--out", "out"],
        &["report", "run.csv"],
    ] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args(arguments)
            .current_dir(folder.0.path())
            .output()
            .expect("tickbus runs");
        assert!(output.status.success(), "{arguments:?} {output:?}");
        assert_eq!(folder.text("run.csv"), recorded, "{arguments:?}");
    }
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

/// `tickbus mirror` on a line without a peer, recording to `file`.
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
        // Some ticks are in the file, and more are pending.
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
        let config =
            Config::load(&folder.path("driver.cfg"), &tickbus::KINDS).expect("a driver.cfg");
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

/// A file being replayed is recognised under another name, by a link, and by another driver.
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

/// Recorded in the plant and replayed in a test, with the same driver.cfg.
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
        _logged: logged::Watch::new(),
    };
    test.ticks(1..=200);
    assert_eq!(test.statistic("replay.ticks"), "200");
    test.driver.close();
    assert!(folder.bytes("run.csv") == recorded, "it is as it was");
}
