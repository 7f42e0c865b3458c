//! `tickbus test`, run as a program, on test files that pass, fail, or are wrong.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tickbus::testing::Suite;

pub(crate) fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs `tickbus test` in `directory`.
pub(crate) fn test(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("test")
        .args(arguments)
        .current_dir(directory)
        .output()
        .expect("the tickbus program runs")
}

pub(crate) fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub(crate) fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A folder with the mirror program's line and one test file.
pub(crate) fn folder(file: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let line = repository().join("tests/wrong-tests/line.cfg");
    fs::copy(line, folder.path().join("line.cfg")).expect("the driver.cfg");
    fs::write(folder.path().join("a.toml"), file).expect("the test file");
    folder
}

const HEAD: &str = "config = \"line.cfg\"\nstep = \"2ms\"\n";

#[test]
fn the_examples_are_green() {
    let output = test(repository(), &["examples/tests"]);
    assert_eq!(output.status.code(), Some(0), "{}", out(&output));
    let last = out(&output);
    let last = last.lines().last().expect("a verdict").to_owned();
    assert!(last.starts_with("test: ok passed="), "{last}");
    assert!(last.contains(" failed=0 wrong=0 ticks="), "{last}");
    assert_eq!(err(&output), "");
}

#[test]
fn the_example_of_the_docs_is_green() {
    let docs = fs::read_to_string(repository().join("docs/testing.md")).expect("the docs");
    let (_, block) = docs.split_once("```toml\n").expect("an example");
    let (block, _) = block.split_once("```").expect("its end");
    let folder = tempfile::tempdir().expect("a folder");
    let tests = folder.path().join("tests");
    fs::create_dir(&tests).expect("a folder");
    fs::copy(
        repository().join("driver.cfg"),
        folder.path().join("driver.cfg"),
    )
    .expect("a copy");
    fs::write(tests.join("a.toml"), block).expect("the file");
    let output = test(&tests, &["."]);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}{}",
        out(&output),
        err(&output)
    );
    assert!(out(&output).contains("passed=1 "));
}

#[test]
fn other_toml_files_in_a_folder_are_no_tests_and_a_closed_stderr_is_no_crash() {
    let folder = folder(&format!(
        "{HEAD}[[test]]\nname = \"green\"\nsteps = [{{ set = {{ Start = true }}, await = \"Run\", within = 10 }}]\n"
    ));
    fs::write(
        folder.path().join("Cargo.toml"),
        "[package]\nname = \"x\"\n",
    )
    .expect("a file");
    let output = test(folder.path(), &["."]);
    assert_eq!(err(&output), "");
    assert!(
        out(&output).contains("passed=1 failed=0 wrong=0"),
        "{}",
        out(&output)
    );
    let broken = folder.path().join("broken.toml");
    fs::write(&broken, "config = 1\n").expect("a file");
    // The reader of this pipe is gone.
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let status = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["test", "."])
        .current_dir(folder.path())
        .stdout(std::process::Stdio::null())
        .stderr(writer)
        .status()
        .expect("the tickbus program runs");
    assert_eq!(status.code(), Some(1));
}

/// Each `tests/wrong-tests/NAME.toml` has its mistakes in `NAME.txt`. If the environment variable `BLESS` is set, the
/// files are rewritten instead: review the difference before committing it.
#[test]
fn every_wrong_file_has_exactly_its_mistakes() {
    let directory = repository().join("tests/wrong-tests");
    let mut files: Vec<PathBuf> = fs::read_dir(&directory)
        .expect("the wrong files")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .collect();
    files.sort();
    assert!(files.len() >= 12, "the wrong files are there");
    for file in files {
        let name = file.file_name().unwrap().to_str().unwrap();
        let output = test(&directory, &[name]);
        let told = err(&output);
        let expected = file.with_extension("txt");
        if std::env::var_os("BLESS").is_some() {
            fs::write(&expected, &told).expect("the file is written");
        }
        let expected = fs::read_to_string(&expected).unwrap_or_default();
        assert_eq!(told, expected, "{name}");
        assert_eq!(output.status.code(), Some(1), "{name}");
        let count = told.lines().count();
        let verdict = format!("test: failed passed=0 failed=0 wrong={count} ticks=0\n");
        assert_eq!(out(&output), verdict, "{name}");
    }
}

#[test]
fn a_failure_names_place_tick_time_signal_expected_seen_and_the_last_changes() {
    let folder = folder(&format!(
        "{HEAD}[[test]]\nname = \"red\"\nsteps = [\n  {{ set = {{ Start = true }}, tick = 10 }},\n  \
         {{ set = {{ Start = false }}, await = \"Speed > 3\", within = \"40ms\" }},\n]\n\
         [[test]]\nname = \"green\"\nsteps = [{{ set = {{ Start = true }}, await = \"Run\", within = 10 }}]\n"
    ));
    let output = test(folder.path(), &[".", "--junit", "reports/junit.xml"]);
    assert_eq!(
        out(&output).replace(".\\a", "./a"),
        "FAIL  red\n      \
         ./a.toml:7:38: tick 30 (60ms): \"Speed\" is 0, expected > 3 within 20 ticks (40ms) of tick 10\n      \
         last changes of \"Speed\" (%QW2): none, it is 0 since the test began\n\
         ok    green (1 ticks)\n\
         test: failed passed=1 failed=1 wrong=0 ticks=31\n"
    );
    assert_eq!(output.status.code(), Some(1));
    let report = fs::read_to_string(folder.path().join("reports/junit.xml")).expect("the report");
    assert!(report.contains("tests=\"2\" failures=\"1\" errors=\"0\""));
    assert!(
        report.contains("<failure type=\"expectation\" message=\"tick 30 (60ms): &quot;Speed&quot; is 0, expected &gt; 3"),
        "{report}"
    );
}

/// Steps, and the messages when they fail.
#[test]
fn every_kind_of_step_can_fail() {
    for (steps, told) in [
        (
            "{ expect = \"Run\" }",
            "tick 0 (0s): \"Run\" is off, expected on",
        ),
        (
            "{ expect = { Run = true } }",
            "tick 0 (0s): \"Run\" is off, expected on",
        ),
        (
            "{ set = { Start = true }, tick = 20, expect = \"not Run\" }",
            "tick 20 (40ms): \"Run\" is on, expected off",
        ),
        (
            "{ set = { Start = true } }, { expect = \"not Run\", during = \"1s\" }",
            "tick 1 (2ms): \"Run\" is on, expected off for 500 ticks (1s) from tick 0",
        ),
        (
            "{ never = \"Run\" }, { tick = 3 }, { press = \"Start\" }",
            "tick 6 (12ms): \"Run\" is on, expected never on since tick 0",
        ),
        (
            "{ force = { Height = 7 }, always = \"Speed == 0 ± 0.5\", run = \"1s\" }",
            "tick 1 (2ms): \"Speed\" is 7, expected 0 ± 0.5 at every tick since tick 0",
        ),
        (
            "{ set = { Start = true }, await = \"Run\", within = 5 }, \
             { await = \"Run rises\", within = 5 }",
            "tick 6 (12ms): \"Run\" is on, expected a rising edge within 5 ticks (10ms) of tick 1",
        ),
    ] {
        let folder = folder(&format!(
            "{HEAD}[[test]]\nname = \"red\"\nsteps = [{steps}]\n"
        ));
        let output = out(&test(folder.path(), &["a.toml"]));
        let line = output.lines().nth(1).unwrap_or_default();
        assert!(line.contains("a.toml:5:"), "{steps}\n{output}");
        assert!(line.ends_with(told), "{steps}\n{output}");
    }
}

#[test]
fn what_is_swallowed_is_named_with_its_first_tick_and_nothing_else_is() {
    const PULSE: &str =
        "{ tick = 3 }, { set = { Start = true }, tick = 1 }, { set = { Start = false }, tick = 2";
    const SENTENCE: &str = "\"Start\" changed and changed back once between two scans of 10ms; the PLC saw none of it: set \
        latch = \"rising\" for it, or tick slower (count_swallowed = false turns this message off); the first at tick 5 (10ms)";
    for (steps, tick) in [
        (
            format!("{PULSE}, expect = \"nothing swallowed\" }}"),
            "6 (12ms)",
        ),
        (
            format!("{PULSE}, expect = [\"not Run\", \"nothing swallowed of Start\"] }}"),
            "6 (12ms)",
        ),
        (
            format!("{{ always = \"nothing swallowed\" }}, {PULSE} }}"),
            "5 (10ms)",
        ),
        (
            format!("{PULSE} }}, {{ tick = 9, always = \"nothing swallowed\" }}"),
            "6 (12ms)",
        ),
    ] {
        let folder = folder(&format!(
            "{HEAD}[[test]]\nname = \"red\"\nsteps = [{steps}]\n"
        ));
        let output = out(&test(folder.path(), &["a.toml"]));
        let told = format!("tick {tick}: expected nothing swallowed: {SENTENCE}");
        let line = output.lines().nth(1).unwrap_or_default();
        assert!(line.ends_with(&told), "{steps}\n{output}");
        assert!(output.contains("last changes of \"Start\" (%IX0.0): off → on at tick 4"));
    }
    let folder = folder(&format!(
        "{HEAD}[[test]]\nname = \"green\"\nsteps = [\n\
         {{ always = \"nothing swallowed\", set = {{ Start = true }}, run = \"10ms\" }},\n\
         {{ set = {{ Start = false }}, run = \"20ms\", expect = \"nothing swallowed\" }}]\n\
         [[test]]\nname = \"of another signal\"\nsteps = [{PULSE}, expect = \"nothing swallowed of Run\" }}]\n"
    ));
    let output = test(folder.path(), &["a.toml", "--junit", "junit.xml"]);
    assert_eq!(output.status.code(), Some(0), "{}", out(&output));
    let report = fs::read_to_string(folder.path().join("junit.xml")).expect("the report");
    for line in [
        "machine to PLC, from bus to scan: delay 0 ns to 0 ns, median 0 ns, jitter 0 ns",
        "machine to PLC: 1 change swallowed",
        "PLC to machine: 0 changes swallowed",
        "Races: none",
    ] {
        assert!(report.contains(line), "{line}\n{report}");
    }
}

#[test]
fn rules_answer_the_program_as_a_machine_would() {
    let folder = folder(
        "config = \"line.cfg\"\nprogram = \"mirror\"\nscan = \"2ms\"\nstep = \"2ms\"\n\
         [[machine.rule]]\nwhen = \"Run\"\nafter = \"20ms\"\nramp = { signal = \"Height\", to = 50, per_second = 500 }\n\
         [[machine.rule]]\nwhen = \"Run falls\"\nafter = \"10ms\"\nset = { Count = 18446744073709551615 }\n\
         [[machine.rule]]\nwhen = \"Speed >= 50\"\nset = { Start = false }\n\
         [[test]]\nname = \"up, and off\"\nsteps = [\n\
           { set = { Start = true }, await = \"Run\", within = 3 },\n\
           { expect = \"Speed == 0\", during = \"18ms\" },\n\
           { await = \"Speed == 50\", within = \"110ms\" },\n\
           { await = \"Run falls\", within = 4, expect = { Count = 0 } },\n\
           { run = \"12ms\", expect = { Count = 18446744073709551615, Height = 50 } },\n\
         ]\n",
    );
    let output = test(folder.path(), &["a.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", out(&output));
}

#[test]
fn the_same_tests_take_the_same_ticks() {
    let ticks = || {
        let text = out(&test(repository(), &["examples/tests"]));
        text.rsplit_once("ticks=").expect("a count").1.to_owned()
    };
    assert_eq!(ticks(), ticks());
}

#[test]
fn tests_can_be_listed_and_chosen() {
    let listed = out(&test(repository(), &["examples/tests", "--list"]));
    assert!(listed.contains("rig.toml:"), "{listed}");
    assert!(!listed.contains("ok "), "{listed}");
    let one = test(repository(), &["examples/tests", "--only", "Start begins"]);
    assert!(out(&one).contains("passed=1 "), "{}", out(&one));
    let none = test(repository(), &["examples/tests", "--only", "Strat"]);
    assert_eq!(none.status.code(), Some(1));
    assert!(err(&none).contains("--list lists them"), "{}", err(&none));
}

#[test]
fn a_folder_without_tests_is_no_success() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = test(folder.path(), &["."]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        err(&output).contains("there is no *.toml"),
        "{}",
        err(&output)
    );
    let output = test(folder.path(), &["nowhere"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(err(&output).contains("no such file"), "{}", err(&output));
    assert_eq!(test(folder.path(), &[]).status.code(), Some(2));
}

#[test]
fn faults_begin_and_end_with_their_steps() {
    let folder = folder(&format!(
        "{HEAD}[[test]]\nname = \"faults\"\nsteps = [\n\
         {{ set = {{ Start = true }}, await = \"Run\", within = 3 }},\n\
         {{ fault = {{ name = \"broken wire\", kind = \"stuck\", signal = \"Start\", value = false }}, run = \"20ms\", expect = \"not Run\" }},\n\
         {{ end = \"broken wire\", await = \"Run\", within = 10 }},\n\
         {{ fault = [{{ kind = \"invert\", signal = \"Start\", ticks = 5 }}], await = \"Run falls\", within = 10 }},\n\
         {{ await = \"Run rises\", within = 10 }},\n\
         {{ end = \"broken wrie\" }},\n]\n"
    ));
    let output = out(&test(folder.path(), &["a.toml"]));
    let line = output.lines().nth(1).unwrap_or_default();
    assert!(line.contains("a.toml:11:9: tick "), "{output}");
    assert!(
        line.ends_with("no fault \"broken wrie\" was injected"),
        "{output}"
    );
}

/// A folder with the rig's driver.cfg, and a recording of the rig's program through the first cycle.
fn recorded() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::copy(
        repository().join("driver.cfg"),
        folder.path().join("driver.cfg"),
    )
    .expect("the driver.cfg");
    let example = Suite::load(
        &repository().join("examples/tests/rig.toml"),
        &tickbus::KINDS,
    )
    .expect("the example");
    let cycle = example
        .tests
        .iter()
        .find(|test| test.name.contains("six steps"));
    let run = example
        .run(
            cycle.expect("it is there"),
            Some(&folder.path().join("run.vcd")),
        )
        .expect("it runs");
    assert_eq!(run.failure, None);
    folder
}

fn replayed(folder: &Path, options: &str) -> Output {
    let file = format!(
        "config = \"driver.cfg\"\nprogram = \"rig\"\n{options}step = \"2ms\"\n[machine]\n\
         recording = \"run.vcd\"\ncompare = [\"Step\", \"LA1 run\", \"LA1 code low\"]\n\
         [[test]]\nname = \"as recorded\"\nsteps = [{{ await = \"Cycles == 1\", within = \"10s\" }}]\n"
    );
    fs::write(folder.join("a.toml"), file).expect("the test file");
    test(folder, &["a.toml"])
}

#[test]
fn a_recording_takes_the_place_of_the_machine() {
    let folder = recorded();
    let output = replayed(folder.path(), "");
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}{}",
        out(&output),
        err(&output)
    );
    let output = replayed(
        folder.path(),
        "program_options = { la1_code = \"lsb-first\" }\n",
    );
    let text = out(&output);
    let line = text.lines().nth(1).expect("a failure");
    assert!(line.contains("a.toml:6:13: tick "), "{text}");
    assert!(
        line.contains("\"LA1 code low\" is off, expected on as in tick "),
        "{text}"
    );
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn a_recording_that_does_not_fit_is_refused() {
    let folder = recorded();
    let line = repository().join("tests/wrong-tests/line.cfg");
    fs::copy(line, folder.path().join("driver.cfg")).expect("the driver.cfg");
    for (machine, told) in [
        (
            "recording = \"none.vcd\"",
            "none.vcd: the recording cannot be read",
        ),
        (
            "recording = \"run.txt\"",
            "ends neither in .vcd nor in .csv",
        ),
        (
            "recording = \"run.vcd\"",
            "has no signal that the PLC reads; use a recording of",
        ),
        (
            "compare = [\"Run\"]",
            "\"compare\" stands without \"recording\"; name the",
        ),
    ] {
        let file = format!(
            "{HEAD}[machine]\n{machine}\n[[test]]\nname = \"a\"\nsteps = [{{ tick = 1 }}]\n"
        );
        fs::write(
            folder.path().join("a.toml"),
            file.replace("line.cfg", "driver.cfg"),
        )
        .expect("the file");
        let output = test(folder.path(), &["a.toml"]);
        assert_eq!(output.status.code(), Some(1), "{machine}");
        assert!(err(&output).starts_with("a.toml:4:"), "{}", err(&output));
        assert!(err(&output).contains(told), "{}", err(&output));
    }
}

#[test]
fn a_failed_test_leaves_its_recording() {
    let folder = folder(&format!(
        "{HEAD}[[test]]\nname = \"what is red?\"\nsteps = [{{ set = {{ Start = true }}, tick = 5 }}, \
         {{ await = \"not Run\", within = 9 }}]\n"
    ));
    let output = out(&test(folder.path(), &["a.toml", "--keep", "kept"]));
    assert!(output.contains("\n      recording: "), "{output}");
    let page =
        fs::read_to_string(folder.path().join("kept/a - what is red_.html")).expect("a page");
    assert!(page.contains("what is red?"), "{page}");
    assert!(page.contains("machine to PLC, from bus to scan"), "{page}");
    let kept = folder.path().join("kept/a - what is red_.vcd");
    let recording = tickbus::record::Recording::open(&kept, None).expect("a recording");
    let columns = recording.columns();
    assert!(columns.position("Run", false).is_some());
    let green = out(&test(
        repository(),
        &[
            "examples/tests",
            "--keep",
            folder.path().join("green").to_str().unwrap(),
        ],
    ));
    assert!(green.contains(" failed=0 "), "{green}");
    assert!(!folder.path().join("green").exists());
}
