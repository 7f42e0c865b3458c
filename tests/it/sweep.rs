//! `tickbus test` on files with a `[sweep]`.

mod doors;

use std::fs;
use std::process::Output;

use crate::testing::{err, folder, out, repository, test};

/// The mirror shows "Start" as "Run", and "Height" as "Speed". When it stops, its machine jumps to 99, which is taken
/// for the alarm.
const SWEEP: &str = "\
config  = \"line.cfg\"
program = \"mirror\"
scan    = \"2ms\"
step    = \"2ms\"

[[machine.rule]]
when  = \"Run falls\"
after = \"4ms\"
set   = { Height = 99 }

[sweep]
signals  = [\"Start\", \"Height\"]
kinds    = [\"stuck-on\", \"stuck-off\", { kind = \"late\", by = \"6ms\" }, \"frozen\", \"line-down\",
            { kind = \"noise\", amplitude = 200, chance = 0.5 }]
moments  = { \"at rest\" = \"not Run\", runs = \"Run\", moves = \"Speed == 5\" }
told     = \"Speed == 99\"
never    = \"Speed < 0\"
within   = \"100ms\"
tolerance = \"4ms\"
scenario = [
    { tick = 5 },
    { set = { Start = true }, tick = 10, expect = \"Run\" },
    { set = { Height = 5 }, tick = 10 },
    { set = { Height = 6 }, tick = 10 },
]
";

/// The last line, which has the hash.
fn last(output: &Output) -> String {
    out(output).lines().last().unwrap_or_default().to_owned()
}

#[test]
fn each_fault_at_each_moment_has_its_verdict() {
    let folder = folder(SWEEP);
    let output = test(folder.path(), &["a.toml"]);
    assert_eq!(err(&output), "");
    assert_eq!(output.status.code(), Some(1));
    let text = out(&output);
    for line in [
        "\nstuck-on      at rest runs    moves\nStart         DIFFERS ok      ok\n",
        "\nstuck-off     at rest runs    moves\nStart         DIFFERS 8ms     8ms\n",
        "\nlate 6ms      at rest runs    moves\nStart         ok      ok      ok\nHeight        ok      ok      ok\n",
        "\nfrozen        at rest runs    moves\nHeight        STILL   STILL   STILL\n",
        "\nline-down     at rest runs    moves\nthe line      STILL   STILL   STILL\n",
        "\nnoise 0.5 200 at rest runs    moves\n",
        "\nHeight        NEVER   NEVER   NEVER\n",
        "FAIL  Start stuck-on @ at rest\n      continues differently: \"Run\" is on after 2ms already, without the fault after 12ms\n",
        "FAIL  Height frozen @ moves\n      stands still: \"Speed\" stays 5, 6 without the fault\n      \
         again: tickbus test a.toml --only \"Height frozen @ moves\"\n",
        "FAIL  Height noise 0.5 200 @ runs\n      breaks a \"never\": \"Speed < 0\" after ",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
    let is_cell = |line: &&str| !line.starts_with("      ") && !line.contains('=');
    for line in text.lines().filter(is_cell) {
        assert!(line.chars().count() <= 80, "{line}");
    }
    let one = test(
        folder.path(),
        &["a.toml", "--only", "Start late 6ms @ runs"],
    );
    let text = out(&one);
    let told = "ok    Start late 6ms @ runs\n      continues as without the fault\n";
    assert!(text.starts_with(told), "{text}");
    assert!(text.contains("sweep: runs=1 told=0 right=1 "), "{text}");
    assert_eq!(one.status.code(), Some(0));
}

#[test]
fn a_fault_that_is_told_too_late_differs() {
    let slow = SWEEP
        .replace(
            "\"Run falls\"\nafter = \"4ms\"",
            "\"not Run\"\nafter = \"24ms\"",
        )
        .replace("100ms", "20ms")
        .replace("told ", "goes_on = \"Run\"\ntold ");
    let folder = folder(&slow);
    let run = "Start stuck-off @ at rest";
    let one = test(folder.path(), &["a.toml", "--only", run]);
    let text = out(&one);
    let told = "      continues differently: the fault is told, but only after 26ms\n";
    assert!(text.contains(told), "{text}");
    assert_eq!(one.status.code(), Some(1));
}

#[test]
fn a_late_signal_is_right_and_late() {
    let folder = folder(SWEEP);
    let one = test(
        folder.path(),
        &["a.toml", "--only", "Height late 6ms @ moves"],
    );
    let text = out(&one);
    let told = "      continues as without the fault, 6ms later\n";
    assert!(text.contains(told), "{text}");
}

#[test]
fn verdicts_are_the_same_in_every_run_and_on_any_number_of_cores() {
    let folder = folder(SWEEP);
    let one = test(folder.path(), &["a.toml", "--jobs", "1"]);
    assert!(
        last(&one).contains(" ticks=") && last(&one).contains(" hash="),
        "{}",
        last(&one)
    );
    for jobs in ["1", "2", "7"] {
        let again = test(folder.path(), &["a.toml", "--jobs", jobs]);
        assert_eq!(out(&again), out(&one), "{jobs}");
    }
    let other = SWEEP.replace("100ms", "6ms");
    fs::write(folder.path().join("a.toml"), other).expect("the file");
    assert_ne!(last(&test(folder.path(), &["a.toml"])), last(&one));
}

#[test]
fn accepted_verdicts_pass_and_any_change_fails() {
    let folder = folder(SWEEP);
    let output = test(folder.path(), &["a.toml", "--accept"]);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}{}",
        out(&output),
        err(&output)
    );
    assert!(
        out(&output).contains(" accepted=11 without_why=11\n"),
        "{}",
        out(&output)
    );
    let path = folder.path().join("accepted.toml");
    let text = fs::read_to_string(&path).expect("the accepted verdicts");
    let frozen =
        "fault    = \"Height frozen\"\nverdicts = \"still   still   still\"\nwhy      = \"\"\n";
    assert!(text.contains(frozen), "{text}");
    assert!(
        text.contains("fault    = \"Start stuck-off\"\nverdicts = \"differs told    told\"\nwhy"),
        "{text}"
    );
    assert!(
        text.contains("verdicts = \"right   right   right\"\n\n"),
        "{text}"
    );

    // A reason is kept, and nothing else changes when the verdicts are written again.
    let reasoned = text.replace(
        frozen,
        &frozen.replace("\"\"\n", "\"nobody reads \\\"Speed\\\"\"\n"),
    );
    fs::write(&path, &reasoned).expect("the file");
    let output = test(folder.path(), &["."]);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}{}",
        out(&output),
        err(&output)
    );
    assert!(
        out(&output).contains("\nHeight        still   still   still\n"),
        "{}",
        out(&output)
    );
    assert!(
        out(&output).contains(" accepted=11 without_why=8\n"),
        "{}",
        out(&output)
    );
    test(folder.path(), &["a.toml", "--accept"]);
    assert_eq!(fs::read_to_string(&path).expect("the file"), reasoned);

    // A verdict that gets better is a change as well.
    let changed = reasoned.replace("\"right   right   right\"", "\"right   still   right\"");
    fs::write(&path, changed).expect("the file");
    let output = test(
        folder.path(),
        &["a.toml", "--only", "Start late 6ms @ runs"],
    );
    let text = out(&output);
    assert!(
        text.contains("continues as without the fault\n      accepted: still\n"),
        "{text}"
    );
    assert!(text.contains("\nStart            ok!\n"), "{text}");
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn what_is_wrong_with_accepted_verdicts_has_its_place() {
    let folder = folder(SWEEP);
    assert_eq!(
        test(folder.path(), &["a.toml", "--accept"]).status.code(),
        Some(0)
    );
    let path = folder.path().join("accepted.toml");
    let text = fs::read_to_string(&path).expect("the accepted verdicts");
    for (from, to, told) in [
        (
            "\"a.toml\"\n",
            "\"b.toml\"\n",
            ": these are the verdicts of the sweep in \"b.toml\"; in a.toml, name another file by accepted = \"…\"",
        ),
        (
            "\"runs\"",
            "\"walks\"",
            ": the moment \"walks\" does not come any more; write the file again by \"tickbus test --accept\"",
        ),
        (
            "Height frozen",
            "Height forzen",
            ": the sweep has no fault \"Height forzen\"; did you mean \"Height frozen\"?",
        ),
        (
            "still   still   still",
            "still",
            ": 1 verdicts for 3 moments; write one word for each of the moments, separated by blanks",
        ),
        (
            "still   still   still",
            "still stlil still",
            ": \"stlil\" is no verdict; did you mean \"still\"?",
        ),
        (
            "Height frozen",
            "Start stuck-on",
            ": this fault was accepted above; remove one of the two",
        ),
        (
            "why      =",
            "wyh      =",
            ": unknown key \"wyh\" in [[accept]]; did you mean \"why\"?",
        ),
        (
            "moments =",
            "momnets =",
            ": unknown key \"momnets\" in the file; did you mean \"moments\"?",
        ),
    ] {
        fs::write(&path, text.replacen(from, to, 1)).expect("the file");
        let output = test(folder.path(), &["a.toml"]);
        let line = err(&output);
        assert!(
            line.starts_with("accepted.toml:") && line.trim_end().ends_with(told),
            "{told}\n{line}"
        );
        assert_eq!(
            last(&output),
            "test: failed passed=0 failed=0 wrong=1 ticks=0",
            "{told}"
        );
    }
    // A reason of several lines is kept as well.
    let lines = text.replacen(
        "why      = \"\"",
        "why      = \"\"\"\nnobody\nreads it\"\"\"",
        1,
    );
    fs::write(&path, lines).expect("the file");
    let output = test(folder.path(), &["a.toml", "--accept"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let output = test(folder.path(), &["a.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(
        fs::read_to_string(&path)
            .expect("the file")
            .contains("why      = \"nobody\\u000areads it\"\n")
    );
    // Faults and moments that are no more are left out when the file is written again.
    fs::write(&path, text.replace("Height frozen", "Depth frozen")).expect("the file");
    let output = test(folder.path(), &["a.toml", "--accept"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert_eq!(fs::read_to_string(&path).expect("the file"), text);
}

#[test]
fn two_sweeps_in_a_folder_do_not_share_their_accepted_verdicts() {
    let folder = folder(SWEEP);
    fs::copy(folder.path().join("a.toml"), folder.path().join("b.toml")).expect("a copy");
    let output = test(folder.path(), &[".", "--accept"]);
    assert_eq!(output.status.code(), Some(1));
    let told = "these are the verdicts of the sweep in \"a.toml\"; in b.toml, name another file by accepted = \"…\"";
    assert!(err(&output).contains(told), "{}", err(&output));
    let own = SWEEP.replace("[sweep]", "[sweep]\naccepted = \"of b.toml\"");
    fs::write(folder.path().join("b.toml"), own).expect("the file");
    let output = test(folder.path(), &[".", "--accept"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert_eq!(test(folder.path(), &["."]).status.code(), Some(0));
}

#[test]
fn names_are_for_people() {
    let folder = folder(&SWEEP.replace("runs = \"Run\"", "\"ru\\nns\" = \"Run\""));
    let output = test(folder.path(), &["a.toml"]);
    assert!(
        err(&output).contains("is no name for people; write a name of printable characters"),
        "{}",
        err(&output)
    );
}

#[test]
fn runs_are_listed_and_reported_as_tests_and_one_is_recorded() {
    let folder = folder(SWEEP);
    let listed = out(&test(folder.path(), &["a.toml", "--list"]));
    assert!(
        listed.contains("a.toml:11:1: Start stuck-on @ at rest\n"),
        "{listed}"
    );
    assert_eq!(listed.lines().count(), 24, "{listed}");

    let output = test(folder.path(), &["a.toml", "--junit", "junit.xml", "--json"]);
    let report = fs::read_to_string(folder.path().join("junit.xml")).expect("the report");
    assert!(
        report.contains("tests=\"24\" failures=\"11\" errors=\"0\""),
        "{report}"
    );
    assert!(
        report.contains("<testcase name=\"Height frozen @ moves\" classname=\"a.toml\" time="),
        "{report}"
    );
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let sweep = &document["files"][0]["sweep"];
    assert_eq!(sweep["moments"][1], "runs");
    let run = &sweep["runs"][4];
    assert_eq!(run["name"], "Start stuck-off @ runs");
    assert_eq!(
        (&run["verdict"], &run["passed"]),
        (&"told".into(), &true.into())
    );
    assert_eq!(run["told_after"], 0.008);
    assert_eq!(document["files"][0]["tests"][4]["verdict"], "passed");

    let one = [
        "a.toml",
        "--only",
        "Start stuck-off @ runs",
        "--keep",
        "kept",
    ];
    let text = out(&test(folder.path(), &one));
    assert!(text.contains("told after 8ms\n      recording: "), "{text}");
    let kept = folder.path().join("kept/a - Start stuck-off @ runs.vcd");
    let recording = tickbus::record::Recording::open(&kept, None).expect("a recording");
    assert!(recording.columns().position("Run", false).is_some());
}

#[test]
fn a_scenario_can_be_a_test_of_the_file_and_moments_the_values_of_a_signal() {
    let folder = folder(
        "config = \"line.cfg\"\nstep = \"2ms\"\n\
         [[test]]\nname = \"up\"\nset = { Start = true }\n\
         steps = [{ tick = 3 }, { set = { Height = 1 }, await = \"Speed == 1\", within = 20 }, { set = { Height = 2 }, tick = 20 }]\n\
         [sweep]\nscenario = \"up\"\nmoments = [\"Speed\"]\nkinds = [\"frozen\", \"stuck-off\"]\n\
         signals = [\"Start\", \"Height\"]\ngoes_on = \"Speed >= 1\"\ntold = [\"Speed == 7\", [\"not Run\", \"Speed == 2\"]]\nwithin = \"50ms\"\n",
    );
    let text = out(&test(folder.path(), &["a.toml"]));
    assert!(text.starts_with("ok    up ("), "{text}");
    assert!(
        text.contains("frozen    Speed 0 Speed 1 Speed 2\nHeight    STILL   ok      ok\n"),
        "{text}"
    );
    assert!(
        text.contains("\nStart     22ms    10ms    10ms\n"),
        "{text}"
    );
    assert!(
        text.contains("stays false, true without the fault\n"),
        "{text}"
    );
}

/// The second fault hides the alarm of the first.
#[test]
fn pairs_of_faults_come_at_the_same_moment() {
    let (head, sweep) = SWEEP.split_once("kinds    =").expect("the kinds");
    let (_, rest) = sweep.split_once("moments").expect("the moments");
    let folder = folder(&format!(
        "{head}pairs = true\nkinds = [\"stuck-off\", \"frozen\", {{ kind = \"late\", by = \"20ms\" }}]\nmoments{rest}"
    ));
    let text = out(&test(folder.path(), &["a.toml"]));
    for part in [
        "\nstuck-off          at rest runs    moves\nStart              DIFFERS 8ms     8ms\n",
        "\n+ Height frozen    at rest runs    moves\nStart stuck-off    STILL   DIFFERS DIFFERS\n",
        "\nStart stuck-off    DIFFERS 28ms    28ms\nStart late 20ms    ok      ok      ok\n",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    let again = "--only \"Start stuck-off + Height frozen @ runs\"\n";
    assert!(text.contains(again), "{text}");
    assert!(text.contains("sweep: runs=24 "), "{text}");
}

#[test]
fn each_station_of_several_can_be_gone() {
    let station = |name: &str, place: u32| {
        let signal = |what: &str, address: &str| {
            format!(
                "[[signal]]\nname = \"{name} {what}\"\naddress = \"{address}{place}.0\"\nstation = \"{name}\"\n"
            )
        };
        [signal("in", "%IX"), signal("out", "%QX")].concat()
    };
    let config = "[driver]\nid = 1\nname = \"Two\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                  scan = \"2ms\"\n[[station]]\nname = \"A\"\n[[station]]\nname = \"B\"\n";
    let folder = folder(
        "config = \"two.cfg\"\nstep = \"2ms\"\n[sweep]\nsignals = [\"A in\"]\nkinds = [\"station-down\", \"stuck-off\"]\n\
         moments = \"A out\"\ntold = [\"A out\", \"B out\"]\nwithin = \"100ms\"\n\
         scenario = [{ tick = 5 }, { set = { \"A in\" = true }, tick = 5 }, { set = { \"B in\" = true }, tick = 5 }]\n",
    );
    let config = [config.to_owned(), station("A", 0), station("B", 2)].concat();
    fs::write(folder.path().join("two.cfg"), config).expect("the driver.cfg");
    let wrong = err(&test(folder.path(), &["a.toml"]));
    assert!(
        wrong.contains("\"A out\" holds without a fault, so it tells nothing"),
        "{wrong}"
    );
    let file = folder.path().join("a.toml");
    let text = fs::read_to_string(&file).expect("the file");
    let text = text.replace("[\"A out\", \"B out\"]", "[[\"not A out\", \"B out\"]]");
    fs::write(&file, text).expect("the file");
    let text = out(&test(folder.path(), &["a.toml"]));
    assert!(
        text.contains("station-down A out\nA            ok\nB            STILL\n"),
        "{text}"
    );
    assert!(text.contains("stuck-off    A out\nA in         "), "{text}");
    assert!(text.contains("--only \"B station-down @ A out\""), "{text}");
}

#[test]
fn a_sweep_before_a_recording_sees_what_the_machine_would_not_answer() {
    let folder = folder(SWEEP);
    let one = [
        "a.toml",
        "--only",
        "Start late 6ms @ moves",
        "--keep",
        "kept",
    ];
    test(folder.path(), &one);
    let file = "config = \"line.cfg\"\nprogram = \"mirror\"\nscan = \"2ms\"\nstep = \"2ms\"\n\
                [machine]\nrecording = \"kept/a - Start late 6ms @ moves.vcd\"\ncompare = [\"Run\"]\n\
                [sweep]\nscenario = [{ tick = 35 }]\nmoments = { runs = \"Run\" }\nsignals = [\"Start\"]\n\
                kinds = [\"stuck-on\", \"stuck-off\"]\ntold = \"Speed == 99\"\nwithin = \"20ms\"\n";
    fs::write(folder.path().join("a.toml"), file).expect("the file");
    let text = out(&test(folder.path(), &["a.toml"]));
    assert!(text.contains("\nStart     ok\n"), "{text}");
    assert!(text.contains("\nStart     DIFFERS\n"), "{text}");
}

#[test]
fn the_sweep_of_the_docs_is_that_of_the_rig() {
    let read = |path: &str| fs::read_to_string(repository().join(path)).expect("a text");
    let docs = read("docs/sweeps.md");
    let blocks = |first: &str| {
        let (_, block) = docs.split_once(&format!("```toml\n{first}")).expect(first);
        let (block, _) = block.split_once("```").expect("its end");
        format!("{first}{block}")
    };
    assert!(read("examples/sweep/rig.toml").ends_with(&blocks("[sweep]")));
    assert!(read("examples/sweep/accepted.toml").contains(&blocks("[[accept]]")));
    let machine = |file: &str| {
        let text = read(file);
        let (_, rest) = text.split_once("[machine.set]").expect("a machine");
        let end = rest.find("[[test]]").or_else(|| rest.find("[sweep]"));
        rest[..end.expect("its end")].trim_end().to_owned()
    };
    assert_eq!(
        machine("examples/sweep/rig.toml"),
        machine("examples/tests/rig.toml")
    );
}

/// The whole sweep takes some seconds, and `tools/test` makes it.
#[test]
fn the_sweep_of_the_rig_is_as_accepted() {
    let output = test(
        repository(),
        &["examples/sweep", "--only", "Step 2 complete stuck"],
    );
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}{}",
        out(&output),
        err(&output)
    );
    let text = out(&output);
    let told = "\nStep 2 complete 1642ms  820ms   10ms    3600ms ";
    assert!(text.contains(told), "{text}");
    assert!(text.contains(" wrong=0 accepted="), "{text}");
    assert!(text.contains(" without_why=0\n"), "{text}");
}
