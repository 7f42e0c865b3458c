//! Faults of an FMU, by the names of its variables.

use std::fs;
use std::path::Path;

use crate::fmi::fixture::{err, out, tanks, tickbus};

const RUN: [&str; 8] = [
    "--config",
    "tank.cfg",
    "--map",
    "tank.toml",
    "--duration",
    "60s",
    "--faults",
    "faults.toml",
];

/// A folder with the tanks and this file of faults.
fn folder(faults: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for file in ["tank2.fmu", "tank3.fmu", "tank.cfg", "tank.toml"] {
        fs::copy(tanks().join(file), folder.path().join(file)).expect("a copy");
    }
    fs::write(folder.path().join("faults.toml"), faults).expect("a file");
    folder
}

/// The levels at the ends of these seconds of a recorded run, in millimetres.
fn levels(folder: &Path, seconds: &[usize]) -> Vec<f64> {
    let record = fs::read_to_string(folder.join("run.csv")).expect("a recording");
    let lines: Vec<&str> = record.lines().collect();
    let level = |second: &usize| {
        let last = lines[second * 100].rsplit(',').next().expect("a column");
        last.parse().expect("a number")
    };
    seconds.iter().map(level).collect()
}

#[test]
fn a_variable_of_an_fmu_has_the_value_of_its_fault_and_then_its_own_again() {
    // A tunable parameter, and an input that a signal sets.
    for (name, value) in [("leak", "0.02"), ("valve", "false")] {
        let folder = folder(&format!(
            "[[fault]]\nkind = \"model\"\nname = \"{name}\"\nvalue = {value}\nat = \"20s\"\nfor = \"5s\"\n"
        ));
        let mut records = Vec::new();
        for (fmu, more) in [
            ("tank2.fmu", &[][..]),
            ("tank3.fmu", &[]),
            ("tank2.fmu", &["--isolated"]),
        ] {
            let arguments = [&["run", fmu][..], &RUN, &["--record", "run.csv"], more].concat();
            let output = tickbus(folder.path(), &arguments);
            let told = out(&output);
            assert_eq!(output.status.code(), Some(0), "{told}{}", err(&output));
            let began = format!("fault \"{name}\" is over (begun so far: 1)");
            assert!(told.contains(&began), "{told}");
            // The first step that has the fault comes a tick after the fault begins.
            let seen = levels(folder.path(), &[20, 25, 60]);
            let is_right = (395.0..=405.0).contains(&seen[0])
                && (180.0..=230.0).contains(&seen[1])
                && (395.0..=405.0).contains(&seen[2]);
            assert!(is_right, "{fmu} {name}: {seen:?}");
            records.push(fs::read_to_string(folder.path().join("run.csv")).expect("a recording"));
        }
        assert!(
            records[1..].iter().all(|other| *other == records[0]),
            "{name}"
        );
    }
}

#[test]
fn a_variable_that_cannot_change_while_the_fmu_runs_is_refused() {
    for (name, value, told) in [
        (
            "leek",
            "1",
            "the FMU has no variable \"leek\"; did you mean \"leak\"?\n",
        ),
        (
            "area",
            "1",
            "\"area\" is a fixed parameter of the FMU, which cannot be changed while it runs; ",
        ),
        (
            "level",
            "1",
            "\"level\" is an output of the FMU, which cannot be changed while it runs; ",
        ),
        (
            "valve",
            "0.5",
            "\"valve\" is of type Boolean, which has no value 0.5; ",
        ),
    ] {
        let faults = format!("[[fault]]\nkind = \"model\"\nname = \"{name}\"\nvalue = {value}\n");
        let folder = folder(&faults);
        let output = tickbus(folder.path(), &[&["run", "tank3.fmu"][..], &RUN].concat());
        assert_eq!(output.status.code(), Some(1), "{}", out(&output));
        let complaint = err(&output);
        assert!(complaint.contains(told), "{complaint}");
        assert!(
            complaint.ends_with("run: failed mistakes=1\n"),
            "{complaint}"
        );
    }
}

const TEST: &str =
    "config = \"tank.cfg\"\nstep = \"10ms\"\n[machine]\nfmu = \"tank3.fmu\"\nmap = \"tank.toml\"\n";

#[test]
fn a_test_and_a_sweep_have_the_faults_of_their_fmu() {
    let folder = folder("");
    let text = format!(
        "{TEST}[[test]]\nname = \"a leak empties the tank\"\nsteps = [\n\
         {{ await = \"Level low\", within = \"10s\" }},\n\
         {{ fault = {{ kind = \"model\", name = \"leak\", value = 0.02 }}, await = \"Level < 300\", within = \"4s\" }},\n\
         {{ end = \"leak\", await = \"Level > 390\", within = \"6s\" }},\n]\n\
         [sweep]\nmoments = {{ \"half empty\" = \"Level < 450\" }}\ntold = \"Level < 300\"\nwithin = \"5s\"\n\
         kinds = [{{ kind = \"model\", name = \"leak\", value = 0.02 }}]\nscenario = [{{ run = \"20s\" }}]\n"
    );
    fs::write(folder.path().join("tank-test.toml"), text).expect("a file");
    let output = tickbus(folder.path(), &["test", "tank-test.toml"]);
    let told = out(&output);
    assert_eq!(output.status.code(), Some(0), "{told}{}", err(&output));
    assert!(told.contains("a leak empties the tank"), "{told}");
    assert!(told.contains("sweep: runs=1 told=1 "), "{told}");
    assert!(told.contains("model 0.02"), "{told}");
}

#[test]
fn a_test_file_with_an_unknown_fault_has_the_mistake_at_its_place() {
    let folder = folder("");
    let steps = |fault: &str| {
        format!("[[test]]\nname = \"x\"\nsteps = [{{ fault = {{ {fault} }}, run = \"1s\" }}]\n")
    };
    let stub = "config = \"tank.cfg\"\n[machine]\n";
    let leek = "kind = \"model\", name = \"leek\"";
    let sweep = |kind: &str| {
        format!(
            "[sweep]\nmoments = \"Level < 450\"\ntold = \"Level < 300\"\nwithin = \"5s\"\nkinds = [{kind}]\n\
             scenario = [{{ run = \"20s\" }}]\n"
        )
    };
    for (text, told) in [
        (
            format!("{TEST}{}", steps(leek)),
            "test.toml:8:20: the FMU has no variable \"leek\"; did you mean \"leak\"?",
        ),
        (
            format!("{stub}{}", steps(leek)),
            "test.toml:5:20: this machine has no faults of its own; name an FMU that has them",
        ),
        (
            format!("{TEST}{}", sweep("{ kind = \"model\", name = \"leek\" }")),
            "test.toml:10:35: the FMU has no variable \"leek\"; did you mean \"leak\"?",
        ),
        (
            format!("{TEST}{}", sweep("{ kind = \"model\", value = 2 }")),
            "it is not said which fault has this value; add its name",
        ),
        // The tank has none that is on or off.
        (
            format!("{TEST}{}", sweep("\"model\"")),
            "none of the signals can have the fault \"model\"; name each: { kind = \"model\", name = \"leak\", value = 0.4 }",
        ),
        (
            format!("{stub}{}", sweep("\"model\"")),
            "none of the signals can have the fault \"model\"; the machine has no faults of its own",
        ),
    ] {
        fs::write(folder.path().join("test.toml"), &text).expect("a file");
        let output = tickbus(folder.path(), &["test", "test.toml"]);
        assert_eq!(output.status.code(), Some(1), "{}", out(&output));
        let complaint = format!("{}{}", out(&output), err(&output));
        assert!(complaint.contains(told), "{text}\n{complaint}");
    }
}
