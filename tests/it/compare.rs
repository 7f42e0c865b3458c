//! `tickbus compare`, run as a program.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use tickbus::testing::Suite;
use tickbus_test_log as logged;

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_owned()).expect("it is UTF-8")
}

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("there is room"),
        }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn file(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path().join(name);
        fs::write(&path, text).expect("there is room");
        path
    }

    /// Runs `tickbus compare`; returns the exit code, stdout and stderr.
    fn compare(&self, arguments: &[&str]) -> (Option<i32>, String, String) {
        let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .arg("compare")
            .args(arguments)
            .current_dir(self.path())
            .output()
            .expect("the command is there");
        (
            output.status.code(),
            text(&output.stdout),
            text(&output.stderr),
        )
    }

    fn json(&self, arguments: &[&str]) -> serde_json::Value {
        let (code, told, wrong) = self.compare(&[arguments, &["--json"]].concat());
        assert_eq!(code, Some(0), "{told}{wrong}");
        serde_json::from_str(&told).expect("a document")
    }
}

/// A recording of 20 s at 10 ms: a lamp that is on for one second of every four, a sine, and a step. All of it is
/// `late` ticks late; the lamp's pulse number `without` is left out, and pulse number `bounces` has a gap of 50 ms.
fn recording(late: i32, without: Option<i32>, bounces: Option<i32>) -> String {
    let mut text =
        "bus.tick,bus.time_ns,bus.status,bus.dropped,Lamp,Height,Step,Fixed\n".to_owned();
    for tick in 1..=2000 {
        let at = tick - late;
        let (pulse, phase) = (at.div_euclid(400), at.rem_euclid(400));
        let gap = bounces == Some(pulse) && (150..155).contains(&phase);
        let on = (100..200).contains(&phase) && !gap && without != Some(pulse);
        let height = (f64::from(at) * 0.013).sin() * 40.0;
        let step = 1 + phase / 100;
        let time = i64::from(tick) * 10_000_000;
        let _ = writeln!(
            text,
            "{tick},{time},0,0,{},{height:?},{step},7",
            u8::from(on)
        );
    }
    text
}

fn signal<'a>(document: &'a serde_json::Value, name: &str) -> &'a serde_json::Value {
    let signals = document["signals"].as_array().expect("a list");
    let found = signals.iter().find(|signal| signal["name"] == name);
    found.expect("it is compared")
}

#[test]
fn a_recording_compared_with_itself_is_1() {
    let bench = Bench::new();
    bench.file("real.csv", &recording(0, None, None));
    let (code, told, wrong) = bench.compare(&["real.csv", "--with", "real.csv", "--steps", "Step"]);
    assert_eq!((code, wrong.as_str()), (Some(0), ""));
    assert!(
        told.ends_with("compare: ok likeness=1.0000 signals=4 changed=3\n"),
        "{told}"
    );
    assert!(
        told.contains("Durations of steps: medians of \"Step\"\n"),
        "{told}"
    );
}

#[test]
fn a_delay_is_the_median_of_its_edges_and_the_shift_of_its_curves() {
    let bench = Bench::new();
    bench.file("real.csv", &recording(0, None, None));
    bench.file("late.csv", &recording(7, None, None));
    let found = bench.json(&["real.csv", "--with", "late.csv"]);
    let lamp = signal(&found, "Lamp");
    for way in ["rises", "falls"] {
        assert_eq!(lamp[way]["median_ns"], 70_000_000);
        assert_eq!(lamp[way]["worst_ns"], 70_000_000);
        assert_eq!(lamp[way]["spread_ns"], 0);
    }
    let likeness = lamp["likeness"].as_f64().expect("a number");
    assert!((likeness - 0.86).abs() < 1e-9, "{lamp}");
    let height = signal(&found, "Height");
    assert_eq!(height["shift_ns"], 70_000_000);
    assert!(height["rms"].as_f64().expect("a number") < 1e-9, "{height}");
    // Moved back, they are equal.
    for shift in [&["--shift", "-70ms"][..], &["--align", "Lamp"]] {
        let arguments = [&["real.csv", "--with", "late.csv"], shift].concat();
        let found = bench.json(&arguments);
        assert_eq!(found["shift_ns"], -70_000_000);
        let likeness = found["likeness"].as_f64().expect("a number");
        assert!(likeness > 0.9999, "{found:#}");
    }
}

#[test]
fn missing_and_extra_edges_are_named_with_their_times() {
    let bench = Bench::new();
    bench.file("real.csv", &recording(0, None, Some(3)));
    bench.file("other.csv", &recording(0, Some(1), None));
    let (code, told, _) = bench.compare(&["real.csv", "--with", "other.csv"]);
    assert_eq!(code, Some(0));
    let lines = "Missing and extra edges: edges without a partner\n\
        Signal  Edge  What     Time\n\
        Lamp    rise  missing  5s\n\
        Lamp    fall  missing  6s\n\
        Lamp    fall  missing  13500ms\n\
        Lamp    rise  missing  13550ms\n\n";
    assert!(told.contains(lines), "{told}");
    let (_, told, _) = bench.compare(&["other.csv", "--with", "real.csv"]);
    assert!(told.contains("\nLamp    rise  extra  5s\n"), "{told}");
}

#[test]
fn limits_give_the_exit_code_and_each_breach_its_place() {
    let bench = Bench::new();
    bench.file("real.csv", &recording(0, None, None));
    bench.file("late.csv", &recording(7, None, None));
    bench.file(
        "limits.toml",
        "step = \"1ms\"\n[limits]\nworst = \"50ms\"\nmissing = 0\n[[signal]]\nname = \"Height\"\nshift = \"20ms\"\n",
    );
    let with = ["real.csv", "--with", "late.csv", "--limits", "limits.toml"];
    let (code, told, wrong) = bench.compare(&with);
    assert_eq!(code, Some(1), "{told}{wrong}");
    assert_eq!(
        wrong,
        "limits.toml:3:9: \"Lamp\": the worst time difference is 70ms at 1s, and 50ms is permitted\n\
         limits.toml:7:9: \"Height\": the best shift is 70ms, and 20ms is permitted\n"
    );
    assert!(told.contains("compare: failed likeness="), "{told}");
    assert!(told.ends_with(" limits=2\n"), "{told}");
    let with = ["real.csv", "--with", "real.csv", "--limits", "limits.toml"];
    assert_eq!(bench.compare(&with).0, Some(0));
}

#[test]
fn recordings_of_other_signals_or_units_are_refused_by_name() {
    let bench = Bench::new();
    let vcd = fs::read_to_string(repository().join("examples/compare/real.vcd")).expect("there");
    bench.file("real.vcd", &vcd);
    bench.file("psi.vcd", &vcd.replace("unit=\"bar\"", "unit=\"psi\""));
    bench.file(
        "other.vcd",
        &vcd.replace("Extended\"", "Pushed out\"")
            .replace("Pressure\"", "Force\"")
            .replace("Retracted\"", "Back\""),
    );
    bench.file("lamp.csv", &recording(0, None, None));
    for (other, told) in [
        (
            "psi.vcd",
            "psi.vcd: \"Pressure\" is in psi, and in bar in real.vcd; record both with one signal table, or --ignore the signal",
        ),
        (
            "other.vcd",
            "other.vcd: no input of the PLC in real.vcd is in this recording; ",
        ),
        (
            "lamp.csv",
            "lamp.csv: no input of the PLC in real.vcd is in this recording; ",
        ),
        ("none.vcd", "none.vcd: the recording cannot be read: "),
    ] {
        let (code, _, wrong) = bench.compare(&["real.vcd", "--with", other]);
        assert_eq!(code, Some(1), "{other}");
        assert!(wrong.contains(told), "{wrong}");
        assert!(wrong.ends_with("compare: failed mistakes=1\n"), "{wrong}");
    }
    let (code, _, wrong) = bench.compare(&["real.vcd", "--with", "real.vcd", "--steps", "Extent"]);
    assert_eq!(code, Some(1));
    assert!(wrong.contains("--steps: real.vcd has no signal \"Extent\"; did you mean \"Extend\"?"));
}

/// The recording without some of its lines, or with others.
fn edited(recording: &str, edit: impl Fn(usize, &str) -> Option<String>) -> String {
    let lines = recording.lines().enumerate();
    let lines = lines.filter_map(|(number, line)| edit(number, line));
    lines.map(|line| line + "\n").collect()
}

#[test]
fn stale_data_and_dropped_ticks_are_not_compared() {
    let bench = Bench::new();
    let real = recording(0, None, None);
    bench.file("real.csv", &real);
    // From 4.5 s to 7 s the line is stale, and the lamp and the height stay as they are.
    let stale = edited(&real, |number, line| {
        let cells: Vec<&str> = line.split(',').collect();
        let is_stale = (450..700).contains(&number);
        Some(match (is_stale, &cells[..]) {
            (true, [tick, time, .., step, _]) => format!("{tick},{time},2,0,0,0.0,{step},7"),
            _ => line.to_owned(),
        })
    });
    // 250 ticks are missing, with a whole pulse.
    let dropped = edited(&real, |number, line| {
        let dropped = line.replacen(",0,0,", ",0,250,", 1);
        match number {
            450..700 => None,
            700.. => Some(dropped),
            _ => Some(line.to_owned()),
        }
    });
    for (name, text) in [("stale.csv", stale), ("dropped.csv", dropped)] {
        bench.file(name, &text);
        for (one, other) in [("real.csv", name), (name, "real.csv")] {
            let found = bench.json(&[one, "--with", other]);
            assert_eq!(found["likeness"], 1.0, "{found:#}");
            let note = found["notes"][0].as_str().expect("a note");
            let begin = format!("{name}: data were stale or dropped, at ");
            assert!(note.starts_with(&begin), "{note}");
        }
        bench.compare(&["real.csv", "--with", name, "--page", "page.html"]);
        let page = fs::read_to_string(bench.path().join("page.html")).expect("a page");
        assert!(page.contains("stale, or dropped"), "{page}");
    }
}

#[test]
fn recordings_of_other_rates_lengths_and_ends_are_compared_where_both_are() {
    let bench = Bench::new();
    let real = recording(0, None, None);
    bench.file("real.csv", &real);
    let coarse = edited(&real, |number, line| {
        (number % 5 == 0).then(|| line.to_owned())
    });
    bench.file("coarse.csv", &coarse);
    let found = bench.json(&["real.csv", "--with", "coarse.csv", "--ignore", "Height"]);
    let lamp = signal(&found, "Lamp");
    assert_eq!(
        (&lamp["rises"]["pairs"], &lamp["falls"]["worst_ns"]),
        (&5.into(), &0.into())
    );
    // Half of it, cut within a line.
    let half = edited(&real, |number, line| {
        (number < 1000).then(|| line.to_owned())
    });
    bench.file("half.csv", &half[..half.len() - 7]);
    for (one, other) in [("real.csv", "half.csv"), ("half.csv", "real.csv")] {
        let found = bench.json(&[one, "--with", other]);
        assert_eq!(found["likeness"], 1.0, "{found:#}");
        let note = found["notes"][0].as_str().expect("a note");
        assert!(
            note.starts_with("half.csv: the recording breaks off at 9980ms: "),
            "{note}"
        );
    }
    let second = edited(&half, |number, line| {
        let (_, rest) = line.split_once(',')?;
        (number > 0).then(|| format!("{},{rest}", number + 999))
    });
    for (name, text, told) in [
        (
            "empty.csv",
            real.lines().next().unwrap_or_default().to_owned() + "\n",
            "no tick is recorded",
        ),
        (
            "twice.csv",
            // A second part, whose ticks are counted on.
            [&*half, &second].concat(),
            "twice.csv:1001: the time goes back from 9990ms to 10ms",
        ),
    ] {
        bench.file(name, &text);
        let (code, _, wrong) = bench.compare(&["real.csv", "--with", name]);
        assert_eq!(code, Some(1));
        assert!(wrong.contains(told), "{wrong}");
    }
    let (code, _, wrong) = bench.compare(&["real.csv", "--with", "half.csv", "--shift", "100s"]);
    assert_eq!(code, Some(1));
    assert!(
        wrong.contains(": they have no time in common; move the simulated recording"),
        "{wrong}"
    );
}

#[test]
fn the_page_has_both_recordings_and_links_into_the_chart() {
    let bench = Bench::new();
    bench.file("real.csv", &recording(0, None, Some(3)));
    bench.file("other.csv", &recording(2, Some(1), None));
    let with = [
        "real.csv",
        "--with",
        "other.csv",
        "--steps",
        "Step",
        "--page",
        "page.html",
    ];
    let (code, told, _) = bench.compare(&with);
    assert_eq!(code, Some(0));
    assert!(told.ends_with(" page=page.html\n"), "{told}");
    let page = fs::read_to_string(bench.path().join("page.html")).expect("a page");
    for part in [
        "\"name\":\"Lamp\"",
        "\"name\":\"Lamp · simulated\"",
        "<h2>Edges</h2>",
        "<h2>Missing and extra edges</h2>",
        "<h2>Numbers</h2>",
        "<h2>Durations of steps</h2>",
        "data-from=",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

/// A driver.cfg whose PLC, the mirror, runs the lift while Start is on.
const LIFT: &str = "[driver]\nid = 1\nname = \"Lift\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
    [[signal]]\nname = \"Start\"\naddress = \"%IX0.0\"\n[[signal]]\nname = \"Top\"\naddress = \"%IX1.0\"\n\
    [[signal]]\nname = \"Bottom\"\naddress = \"%IX1.1\"\n[[signal]]\nname = \"Height\"\naddress = \"%ID4\"\n\
    type = \"REAL\"\nunit = \"mm\"\n[[signal]]\nname = \"Run\"\naddress = \"%QX0.0\"\n";

/// The lift with these times: to the top, to the bottom, and the speeds between.
fn lift(up: &str, down: &str, rises: f64, falls: f64) -> String {
    format!(
        "config = \"lift.cfg\"\nstep = \"10ms\"\n[machine.set]\nBottom = true\n\
         [[machine.rule]]\nname = \"up\"\nwhen = \"Run\"\nafter = \"{up}\"\nset = {{ Top = true }}\nelse = {{ Top = false }}\n\
         [[machine.rule]]\nname = \"down\"\nwhen = \"not Run\"\nafter = \"{down}\"\nset = {{ Bottom = true }}\n\
         else = {{ Bottom = false }}\n\
         [[machine.rule]]\nname = \"rises\"\nwhen = \"Run\"\nramp = {{ signal = \"Height\", to = 200, per_second = {rises:?} }}\n\
         [[machine.rule]]\nname = \"falls\"\nwhen = \"not Run\"\n\
         ramp = {{ signal = \"Height\", to = 0, per_second = {falls:?} }}\n\
         [[test]]\nname = \"up and down\"\nsteps = [{{ run = \"1s\" }}, {{ set = {{ Start = true }}, run = \"3s\" }}, \
         {{ set = {{ Start = false }}, run = \"4s\" }}, {{ set = {{ Start = true }}, run = \"3s\" }}, \
         {{ set = {{ Start = false }}, run = \"4s\", expect = \"Bottom\" }}]\n"
    )
}

/// Records the test of a file.
fn record(bench: &Bench, file: &str, recording: &str) {
    let suite = Suite::load(&bench.path().join(file), &tickbus::KINDS);
    let suite = suite.unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let ran = suite.run(&suite.tests[0], Some(&bench.path().join(recording)));
    let ran = ran.expect("it runs");
    assert_eq!(ran.failure, None);
}

#[test]
fn a_model_that_the_recorded_commands_drive_is_its_own_twin() {
    let bench = Bench::new();
    bench.file("lift.cfg", LIFT);
    bench.file("lift.toml", &lift("1200ms", "2300ms", 160.0, 90.0));
    record(&bench, "lift.toml", "real.vcd");
    let with = ["real.vcd", "--model", "lift.toml", "--ignore", "Start"];
    let found = bench.json(&with);
    assert_eq!(found["likeness"], 1.0, "{found:#}");
    bench.file("slow.toml", &lift("1250ms", "2300ms", 160.0, 90.0));
    let with = ["real.vcd", "--model", "slow.toml", "--ignore", "Start"];
    let found = bench.json(&with);
    let top = signal(&found, "Top");
    // It rises 50 ms late, and falls in time.
    assert_eq!(top["rises"]["worst_ns"], 50_000_000, "{found:#}");
    assert_eq!(top["falls"]["worst_ns"], 0);
    assert_eq!(signal(&found, "Bottom")["likeness"], 1.0);
}

#[test]
fn four_times_of_rules_are_fitted_within_a_percent() {
    let bench = Bench::new();
    bench.file("lift.cfg", LIFT);
    bench.file("right.toml", &lift("1200ms", "2300ms", 160.0, 90.0));
    record(&bench, "right.toml", "real.vcd");
    bench.file("guess.toml", &lift("600ms", "1s", 60.0, 300.0));
    bench.file(
        "fit.toml",
        "seed = 3\nruns = 200\n\
         [[parameter]]\nrule = \"up\"\nfrom = \"100ms\"\nto = \"2900ms\"\n\
         [[parameter]]\nrule = \"down\"\nkey = \"after\"\nfrom = \"100ms\"\nto = \"3900ms\"\n\
         [[parameter]]\nrule = \"rises\"\nkey = \"per_second\"\nfrom = 20\nto = 400\n\
         [[parameter]]\nrule = \"falls\"\nkey = \"per_second\"\nfrom = 20\nto = 400\n",
    );
    let with = [
        "real.vcd",
        "--model",
        "guess.toml",
        "--ignore",
        "Start",
        "--fit",
        "fit.toml",
    ];
    let found = bench.json(&with);
    let parameters = found["fit"]["parameters"].as_array().expect("a list");
    for (parameter, right) in parameters.iter().zip([1.2, 2.3, 160.0, 90.0]) {
        let value = parameter["value"].as_f64().expect("a number");
        assert!((value - right).abs() < 0.01 * right, "{found:#}");
    }
    assert!(found["likeness"].as_f64() > Some(0.98), "{found:#}");
    assert!(
        found["fit"]["likeness_before"].as_f64() < Some(0.6),
        "{found:#}"
    );
}

/// A clamp and a pump that replies make, with these times and speed, and what the PLC's mirror does with them.
fn replied(extend: &str, retract: &str, running: &str, full_speed: f64) -> String {
    format!(
        "config = \"lift.cfg\"\nstep = \"10ms\"\n\
         [[machine.reply]]\nkind = \"cylinder\"\nname = \"lift\"\nextend = \"Run\"\nextended = \"Top\"\n\
         retracted = \"Bottom\"\nextend_time = \"{extend}\"\nretract_time = \"{retract}\"\n\
         [[machine.reply]]\nkind = \"motor\"\nname = \"drive\"\ncontactor = \"Run\"\nspeed = \"Height\"\n\
         on_after = \"{running}\"\nfull_speed = {full_speed:?}\nstart_time = \"500ms\"\n\
         [[test]]\nname = \"up and down\"\nsteps = [{{ run = \"1s\" }}, {{ set = {{ Start = true }}, run = \"3s\" }}, \
         {{ set = {{ Start = false }}, run = \"4s\" }}, {{ set = {{ Start = true }}, run = \"3s\" }}, \
         {{ set = {{ Start = false }}, run = \"4s\", expect = \"Bottom\" }}]\n"
    )
}

#[test]
fn keys_of_replies_are_fitted_within_a_percent() {
    let bench = Bench::new();
    bench.file("lift.cfg", LIFT);
    bench.file("right.toml", &replied("1200ms", "2300ms", "300ms", 160.0));
    record(&bench, "right.toml", "real.vcd");
    bench.file("guess.toml", &replied("600ms", "1s", "50ms", 90.0));
    bench.file(
        "fit.toml",
        "seed = 3\nruns = 200\n\
         [[parameter]]\nreply = \"lift\"\nkey = \"extend_time\"\nfrom = \"100ms\"\nto = \"2900ms\"\n\
         [[parameter]]\nreply = \"lift\"\nkey = \"retract_time\"\nfrom = \"100ms\"\nto = \"3900ms\"\n\
         [[parameter]]\nreply = \"drive\"\nkey = \"on_after\"\nfrom = \"10ms\"\nto = \"900ms\"\n\
         [[parameter]]\nreply = \"drive\"\nkey = \"full_speed\"\nfrom = 20\nto = 400\n",
    );
    let with = ["real.vcd", "--model", "guess.toml", "--ignore", "Start"];
    let found = bench.json(&[&with[..], &["--fit", "fit.toml"]].concat());
    let parameters = found["fit"]["parameters"].as_array().expect("a list");
    for (parameter, right) in parameters.iter().zip([1.2, 2.3, 0.3, 160.0]) {
        let value = parameter["value"].as_f64().expect("a number");
        // A time is found no finer than a tick.
        let permitted = (0.01_f64 * right).max(0.01);
        assert!((value - right).abs() <= permitted, "{found:#}");
    }
    bench.file(
        "wrong.toml",
        "[[parameter]]\nreply = \"lfit\"\nfrom = \"1s\"\nto = \"2s\"\n\
         [[parameter]]\nreply = \"lift\"\nfrom = \"1s\"\nto = \"2s\"\n\
         [[parameter]]\nreply = \"lift\"\nkey = \"open_time\"\nfrom = \"1s\"\nto = \"2s\"\n\
         [[parameter]]\nreply = \"lift\"\nrule = \"up\"\nfrom = 1\nto = 2\n",
    );
    let wrong = [&with[..], &["--fit", "wrong.toml"]].concat();
    let (code, _, told) = bench.compare(&wrong);
    assert_eq!(code, Some(1));
    for part in [
        "wrong.toml:2:9: guess.toml has no reply \"lfit\"; did you mean \"lift\"?",
        "wrong.toml:6:9: no key of the reply \"lift\"; add key = \"…\", one of extend_time, retract_time",
        "wrong.toml:11:7: ",
        "wrong.toml:15:9: a parameter is of one thing; ",
    ] {
        assert!(told.contains(part), "{part}\n{told}");
    }
}

#[test]
fn a_way_back_that_is_not_stated_follows_the_way_forth_when_that_is_fitted() {
    let bench = Bench::new();
    bench.file("lift.cfg", LIFT);
    let one_time =
        |extend: &str| replied(extend, "1s", "300ms", 160.0).replace("retract_time = \"1s\"\n", "");
    bench.file("right.toml", &one_time("1200ms"));
    record(&bench, "right.toml", "real.vcd");
    bench.file("guess.toml", &one_time("600ms"));
    bench.file(
        "fit.toml",
        "runs = 60\n[[parameter]]\nreply = \"lift\"\nkey = \"extend_time\"\nfrom = \"100ms\"\nto = \"2900ms\"\n",
    );
    let with = ["real.vcd", "--model", "guess.toml", "--ignore", "Start"];
    let found = bench.json(&[&with[..], &["--fit", "fit.toml"]].concat());
    let fitted = &found["fit"]["parameters"][0];
    let value = fitted["value"].as_f64().expect("a number");
    assert!((value - 1.2).abs() <= 0.012, "{found:#}");
    // The way back as well: with the old time its edges would be late.
    assert_eq!(found["likeness"].as_f64(), Some(1.0), "{found:#}");
}

/// Rules, `set` and replies that write one signal: the same one wins in a model as in the driver of a test.
#[test]
fn a_model_gives_a_signal_to_the_same_writer_as_a_test_does() {
    logged::expect("the simulation writes \"Height\" itself");
    let rules = [
        // A rule wins from its first value on that is not 0, and then for good.
        "[[machine.rule]]\nwhen = \"Run\"\nafter = \"2s\"\nset = { Height = 7.0 }\nelse = { Height = 0.0 }\n",
        // A rule that only ever writes 0 does not.
        "[[machine.rule]]\nwhen = \"Run\"\nset = { Height = 0.0, Top = false }\n",
        // A ramp begins at what the reply has made.
        "[[machine.rule]]\nwhen = \"Top\"\nramp = { signal = \"Height\", to = 300, per_second = 50 }\n",
        // A value from the beginning takes the signal from the reply, even if it is 0.
        "[machine.set]\nTop = false\nHeight = 0.0\n",
        "[machine.set]\nBottom = false\n[[machine.rule]]\nwhen = \"Top\"\nset = { Bottom = true }\nelse = { Bottom = false }\n",
    ];
    let plain = replied("1200ms", "2300ms", "300ms", 160.0);
    let mut heights = Vec::new();
    for extra in rules {
        let bench = Bench::new();
        bench.file("lift.cfg", LIFT);
        let text = plain.replace("expect = \"Bottom\" ", "");
        bench.file(
            "both.toml",
            &text.replace("[[test]]", &format!("{extra}[[test]]")),
        );
        record(&bench, "both.toml", "real.vcd");
        let found = bench.json(&["real.vcd", "--model", "both.toml", "--ignore", "Start"]);
        assert_eq!(found["likeness"].as_f64(), Some(1.0), "{extra}\n{found:#}");
        // And the extra lines do something.
        bench.file("plain.toml", &text);
        let found = bench.json(&["real.vcd", "--model", "plain.toml", "--ignore", "Start"]);
        heights.push(found["likeness"].as_f64() == Some(1.0));
    }
    assert_eq!(heights, [false, true, false, false, false]);
}

#[test]
fn mistakes_in_a_file_of_parameters_have_their_places() {
    let bench = Bench::new();
    bench.file("lift.cfg", LIFT);
    bench.file("lift.toml", &lift("1200ms", "2300ms", 160.0, 90.0));
    record(&bench, "lift.toml", "real.vcd");
    bench.file(
        "fit.toml",
        "runs = 3\n[[parameter]]\nrule = \"upp\"\nfrom = \"1s\"\nto = \"2s\"\n\
         [[parameter]]\nrule = \"up\"\nkey = \"per_second\"\nfrom = 1\nto = 2\n\
         [[parameter]]\nrule = \"up\"\nfrom = \"2s\"\nto = \"1s\"\n\
         [[parameter]]\nfmu = \"area\"\nfrom = 1\nto = 2\n",
    );
    let (code, _, wrong) =
        bench.compare(&["real.vcd", "--model", "lift.toml", "--fit", "fit.toml"]);
    assert_eq!(code, Some(1));
    for part in [
        "fit.toml:1:8: ",
        "fit.toml:3:8: lift.toml has no rule \"upp\"; did you mean \"up\"?",
        "fit.toml:7:8: the rule \"up\" has no ramp; ",
        "fit.toml:14:6: \"to\" is 1, and \"from\" is 2; ",
        "fit.toml:16:7: the machine of lift.toml is no FMU; ",
    ] {
        assert!(wrong.contains(part), "{part}\n{wrong}");
    }
}

/// Each command of docs/compare.md prints what the page says. If the environment variable `BLESS` is set, the page is
/// rewritten instead: review the difference before committing it.
#[test]
fn the_example_of_the_docs_prints_what_it_says() {
    let page = repository().join("docs/compare.md");
    let text = fs::read_to_string(&page).expect("the page");
    let bench = Bench::new();
    for file in [
        "cylinder.cfg",
        "model.toml",
        "parameters.toml",
        "limits.toml",
        "real.vcd",
    ] {
        let from = repository().join("examples/compare").join(file);
        fs::copy(from, bench.path().join(file)).expect("a copy");
    }
    let mut seen = String::new();
    let mut parts = text.split("```console\n");
    seen.push_str(parts.next().expect("a beginning"));
    let mut count = 0;
    for part in parts {
        let (block, rest) = part.split_once("```").expect("a block ends");
        let command = block.lines().next().expect("a command");
        let words: Vec<&str> = command.split(' ').collect();
        assert_eq!(words[..3], ["$", "tickbus", "compare"], "{command}");
        let (_, told, wrong) = bench.compare(&words[3..]);
        let _ = write!(seen, "```console\n{command}\n{told}{wrong}```{rest}");
        count += 1;
    }
    assert!(count >= 3, "the page has examples");
    if std::env::var_os("BLESS").is_some() {
        fs::write(&page, &seen).expect("the page");
    }
    assert_eq!(seen, text);
}
