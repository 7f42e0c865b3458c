//! Training machines with programs for `OpenPLC`, compiled by its compiler, and with a PLC of pymodbus.
#![allow(missing_docs, reason = "a test")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

#[cfg(all(unix, feature = "page"))]
use crate::commands::Running;
use crate::harness::iec2c::Compiler;
#[cfg(all(unix, feature = "page"))]
use crate::harness::{self};
use crate::harness::{Absent, Test};

pub(crate) const TESTS: &[(&str, Test)] = &[
    ("a_solution_passes_every_exercise", solutions_pass),
    (
        "an_empty_program_fails_every_exercise_with_what_it_lacks",
        empty_programs_fail,
    ),
    (
        "a_solution_with_a_mistake_fails_the_exercise_of_that",
        mistakes_are_seen,
    ),
    (
        "a_text_is_graded_and_its_mistakes_have_their_lines",
        texts_are_built,
    ),
    #[cfg(all(unix, feature = "page"))]
    ("pymodbus_sorts_a_part", pymodbus_sorts_a_part),
];

const MACHINES: [&str; 6] = [
    "two-tanks",
    "traffic-lights",
    "sorting",
    "pick-and-place",
    "lift",
    "bottle-rig",
];

const EMPTY: &str = "PROGRAM nothing\nVAR\n  lamp AT %QX0.0 : BOOL;\nEND_VAR\nVAR\n  a : BOOL;\nEND_VAR\n  a := TRUE;\nEND_PROGRAM\n\
                     CONFIGURATION Config0\n  RESOURCE Res0 ON PLC\n    TASK every(INTERVAL := T#10ms, PRIORITY := 0);\n    \
                     PROGRAM plc WITH every : nothing;\n  END_RESOURCE\nEND_CONFIGURATION\n";

/// Mistakes: the machine, the text of its solution and the mistake in its place, the exercise that fails, and words of the
/// hint.
const MISTAKES: [(&str, &str, &str, &str, &str); 15] = [
    (
        "two-tanks",
        "level_1 >= 800 THEN\n      filling",
        "level_1 >= 700 THEN\n      filling",
        "1-fill",
        "stops too early",
    ),
    (
        "two-tanks",
        "level_2 <= 450",
        "level_2 <= 520",
        "2-level",
        "hysteresis",
    ),
    ("two-tanks", "T#5s", "T#2s", "3-batch", "settle for 5 s"),
    (
        "traffic-lights",
        "side_red := phase <= 3",
        "side_red := phase <= 1",
        "1-cycle",
        "red and amber together",
    ),
    (
        "traffic-lights",
        "OR side_car OR wait_lamp",
        "OR TRUE",
        "2-demand",
        "wait for Side car",
    ),
    (
        "traffic-lights",
        "      wait_lamp := FALSE;\n",
        "",
        "3-pedestrians",
        "the wait lamp is off",
    ),
    (
        "sorting",
        "    run_lamp := FALSE;\n    alarm_lamp := FALSE;",
        "    alarm_lamp := FALSE;",
        "1-belt",
        "Stop has to",
    ),
    (
        "sorting",
        "queue[next] := seen",
        "queue[next] := TRUE",
        "2-sort",
        "A short part went down the chute",
    ),
    (
        "sorting",
        "tall_parts >= 5",
        "tall_parts >= 6",
        "3-count",
        "Five parts fill the chute",
    ),
    (
        "pick-and-place",
        "IF gripper_is_up THEN phase := 3",
        "IF TRUE THEN phase := 3",
        "1-one-part",
        "wait for Gripper is up",
    ),
    (
        "pick-and-place",
        "    running := FALSE;\n    alarm_lamp := FALSE;",
        "    alarm_lamp := FALSE;",
        "2-again",
        "After Stop",
    ),
    (
        "pick-and-place",
        " AND NOT part_on_belt",
        "",
        "3-trouble",
        "wait above it",
    ),
    ("lift", "T#3s", "T#1s", "1-call", "closes too early"),
    (
        "lift",
        "called[1] := called[1] OR call_1",
        "called[1] := call_1",
        "2-several",
        "floor 1",
    ),
    (
        "lift",
        "IF door_blocked OR called[floor]",
        "IF called[floor]",
        "3-door",
        "open it at once",
    ),
];

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn solution(machine: &str) -> String {
    // The rig's program is the demo's, too.
    let file = match machine {
        "bottle-rig" => "plc/rig/rig.st".to_owned(),
        machine => format!("plc/machines/{machine}.st"),
    };
    let path = repository().join(file);
    std::fs::read_to_string(path).expect("the solution")
}

fn grade(machine: &str, program: &Path, more: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["machine", machine, "--grade"])
        .arg(program)
        .args(more)
        .output()
        .expect("the tickbus program runs")
}

/// The exercises of a program: the name of each file's test, with its hint if the program fails.
fn graded(compiler: &Compiler, machine: &str, text: &str) -> Vec<(String, Option<String>)> {
    let folder = tempfile::tempdir().expect("a folder");
    let object = compiler.build(text, folder.path());
    let output = grade(machine, &object, &["--json"]);
    let document: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("{error}: {}", String::from_utf8_lossy(&output.stderr));
    });
    let list = |value: &Value| value.as_array().expect("a list").clone();
    let files = list(&document["files"]).into_iter();
    let cases = files.flat_map(|file| {
        let path = PathBuf::from(file["file"].as_str().expect("a path"));
        let stem = path
            .file_stem()
            .expect("a name")
            .to_string_lossy()
            .into_owned();
        let tests = list(&file["tests"]).into_iter();
        tests.map(move |test| (stem.clone(), test))
    });
    cases
        .map(|(stem, test)| {
            let verdict = test["verdict"].as_str().expect("a verdict");
            assert_ne!(verdict, "wrong", "{test}");
            let details = test["details"].as_str().unwrap_or_default();
            let hint = details
                .lines()
                .find_map(|line| line.trim().strip_prefix("hint: "));
            let hint = (verdict == "failed").then(|| hint.expect(details).to_owned());
            (format!("{stem}: {}", test["name"]), hint)
        })
        .collect()
}

fn solutions_pass() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    for machine in MACHINES {
        let graded = graded(&compiler, machine, &solution(machine));
        assert!(graded.len() >= 5, "{machine} has {} tests", graded.len());
        for (test, hint) in graded {
            assert_eq!(hint, None, "{machine}: {test}");
        }
    }
    Ok(())
}

fn empty_programs_fail() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    for machine in MACHINES {
        for (test, hint) in graded(&compiler, machine, EMPTY) {
            let hint = hint.unwrap_or_else(|| panic!("{machine}: {test} is passed by nothing"));
            assert!(hint.len() > 20, "{machine}: {test}: {hint}");
        }
    }
    Ok(())
}

fn mistakes_are_seen() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    for (machine, right, wrong, exercise, words) in MISTAKES {
        let text = solution(machine);
        assert_eq!(text.matches(right).count(), 1, "{machine}: {right}");
        let graded = graded(&compiler, machine, &text.replace(right, wrong));
        let mut hints = graded
            .iter()
            .filter_map(|(test, hint)| Some((test, hint.as_ref()?)));
        assert!(
            hints.any(|(test, hint)| test.starts_with(exercise) && hint.contains(words)),
            "{machine} with \"{wrong}\": {graded:?}"
        );
    }
    Ok(())
}

fn texts_are_built() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let folder = tempfile::tempdir().expect("a folder");
    let run = |text: &str| {
        let file = folder.path().join("my program.st");
        std::fs::write(&file, text).expect("the file is written");
        Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args(["machine", "lift", "--grade"])
            .arg(file)
            .env("IEC2C", &compiler.program)
            .env("IEC2C_LIB", &compiler.library)
            .env("XDG_CACHE_HOME", folder.path())
            .output()
            .expect("the tickbus program runs")
    };
    let right = run(&solution("lift"));
    let told = String::from_utf8_lossy(&right.stdout);
    assert_eq!(right.status.code(), Some(0), "{told}");
    assert!(told.contains("test: ok passed=8 failed=0"), "{told}");
    let wrong = run(&EMPTY.replace("a := TRUE", "b := TRUE"));
    let told = String::from_utf8_lossy(&wrong.stderr);
    assert_eq!(wrong.status.code(), Some(1), "{told}");
    assert!(told.contains("my program.st:8:"), "{told}");
    Ok(())
}

/// A PLC of pymodbus starts the belt, sees a tall part, and pushes it into the chute.
#[cfg(all(unix, feature = "page"))]
fn pymodbus_sorts_a_part() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["pymodbus"])?;
    let arguments = [
        "sorting",
        "--address",
        "127.0.0.1:0",
        "--page",
        "127.0.0.1:0",
    ];
    let mut machine = Running::of("machine", &arguments);
    let address = machine.after("machine: opening: listening on ");
    let (host, port) = address.rsplit_once(':').expect("an address");
    let script = repository().join("tests/peers/machine_sorting.py");
    let output = python.arg(script).args([host, port]).output();
    let output = output.expect("python runs");
    let told = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        told.trim(),
        "machine_sorting.py: ok tall=1 short=0",
        "{errors}"
    );
    let (last, code) = machine.interrupt();
    assert!(last.starts_with("machine: ok scans="), "{last}");
    assert_eq!(code, Some(0));
    Ok(())
}
