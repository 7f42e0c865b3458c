//! `tickbus new`: every folder that it makes is right, and the machine in C runs.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

#[cfg(target_os = "linux")]
use crate::c_api::library;

const PLCS: [&str; 9] = [
    "s7-1500", "s7-1200", "s7", "codesys", "twincat", "openplc", "modbus", "opcua", "none",
];
const SIMULATORS: [&str; 4] = ["java", "python", "c", "replies"];

fn tickbus(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .current_dir(folder)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .expect("the tickbus program runs")
}

#[track_caller]
fn assert_done(output: &Output) {
    assert!(output.status.success(), "{output:?}");
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn every_combination_passes_the_check_and_its_own_test() {
    let folder = tempfile::tempdir().expect("there is room");
    for plc in PLCS {
        for simulator in SIMULATORS {
            let name = format!("{plc} {simulator}");
            assert_done(&tickbus(
                folder.path(),
                &["new", &name, "--plc", plc, "--simulator", simulator],
            ));
            let new = folder.path().join(&name);
            assert_done(&tickbus(&new, &["check", "driver.cfg"]));
            let tested = tickbus(&new, &["test", "tests"]);
            assert_done(&tested);
            let said = String::from_utf8_lossy(&tested.stdout).into_owned();
            assert!(said.contains("passed=1 failed=0"), "{said}");
        }
    }
}

#[test]
#[cfg(target_os = "linux")]
fn the_machine_in_c_compiles_without_a_warning_and_meets_its_plc() {
    let folder = tempfile::tempdir().expect("there is room");
    assert_done(&tickbus(
        folder.path(),
        &["new", "m", "--plc", "none", "--simulator", "c"],
    ));
    let new = folder.path().join("m");
    let library = library();
    let compiled = Command::new("cc")
        .current_dir(&new)
        .args([
            "-std=c99",
            "-D_POSIX_C_SOURCE=200809L",
            "-Wall",
            "-Wextra",
            "-Werror",
            "machine.c",
            "-I",
        ])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/include"))
        .args(["-ltickbus", "-o", "machine", "-L"])
        .arg(&library)
        .arg(format!("-Wl,-rpath,{}", library.display()))
        .output();
    assert_done(&compiled.expect("there is a compiler"));
    let mut machine = Command::new("./machine")
        .current_dir(&new)
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
    let out = machine.stdout.take().expect("it is piped");
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(out));
    // It begins at 100 mm, which is low: the PLC opens the valve.
    let opened = lines.find(|line| line.as_deref().is_ok_and(|line| line.contains("valve 1")));
    assert!(opened.is_some(), "the machine ended");
    machine.kill().expect("it runs");
    machine.wait().expect("it ends");
}

#[test]
fn the_signals_of_a_list_become_the_machine() {
    let folder = tempfile::tempdir().expect("there is room");
    let list = "Name;Path;Data Type;Logical Address\nPump on;T;Bool;%Q0.0\nDoor shut;T;Bool;%I0.0\nLevel;T;Int;%IW2\n";
    fs::write(folder.path().join("tags.csv"), list).expect("there is room");
    let made = tickbus(
        folder.path(),
        &[
            "new",
            "m",
            "--plc",
            "codesys",
            "--simulator",
            "python",
            "--tags",
            "tags.csv",
        ],
    );
    assert_done(&made);
    let new = folder.path().join("m");
    let python = fs::read_to_string(new.join("machine.py")).expect("it is there");
    for line in [
        "pump_on = plc[\"Pump on\"]",
        "door_shut = plc[\"Door shut\"]",
        "level = plc[\"Level\"]",
    ] {
        assert!(python.contains(line), "{python}");
    }
    let half = fs::read_dir(new.join("plc")).expect("there is the PLC's half");
    assert!(half.count() > 0);
    assert_done(&tickbus(&new, &["test", "tests"]));
}

#[test]
fn nothing_is_overwritten_and_mistakes_are_told() {
    let folder = tempfile::tempdir().expect("there is room");
    let here = folder.path();
    fs::create_dir(here.join("full")).expect("there is room");
    fs::write(here.join("full/mine"), "mine").expect("there is room");
    let refused = tickbus(here, &["new", "full", "--plc", "none", "--simulator", "c"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        stderr(&refused).contains("full: this folder has files"),
        "{refused:?}"
    );
    let asked = tickbus(here, &["new", "m", "--plc", "none"]);
    assert_eq!(asked.status.code(), Some(2));
    assert!(
        stderr(&asked).contains("--simulator is missing"),
        "{asked:?}"
    );
    let list = tickbus(
        here,
        &[
            "new",
            "m",
            "--plc",
            "none",
            "--simulator",
            "c",
            "--tags",
            "no.csv",
        ],
    );
    assert_eq!(list.status.code(), Some(1));
    assert!(
        stderr(&list).contains("no.csv: this file cannot be read"),
        "{list:?}"
    );
    let named = ["new", "m", "--plc", "none", "--simulator", "c", "--name"];
    let named = tickbus(here, &[&named[..], &["a\u{7}b"]].concat());
    assert_eq!(named.status.code(), Some(1));
    let why = stderr(&named);
    assert!(
        why.contains("control character") && !why.contains("signals"),
        "{why}"
    );
    assert!(!here.join("m").exists(), "nothing is half made");
}

/// CODESYS counts elements in its addresses, and the machine must not read them as bytes.
#[test]
fn the_addresses_of_a_list_keep_their_meaning_and_the_folder_here_its_name() {
    let folder = tempfile::tempdir().expect("there is room");
    let list = "<project xmlns=\"http://www.plcopen.org/xml/tc6_0200\"><fileHeader productName=\"CODESYS\"/><types><pous>\
                <pou name=\"P\"><interface><localVars><variable name=\"Speed\" address=\"%QW1\"><type><INT/></type></variable>\
                </localVars></interface></pou></pous></types></project>";
    fs::write(folder.path().join("plc.xml"), list).expect("there is room");
    let here = folder.path().join("Press 7");
    fs::create_dir(&here).expect("there is room");
    let arguments = ["new", ".", "--plc", "codesys", "--simulator", "c"];
    let made = tickbus(&here, &[&arguments[..], &["--tags", "../plc.xml"]].concat());
    assert_done(&made);
    let cfg = fs::read_to_string(here.join("driver.cfg")).expect("it is there");
    assert!(cfg.contains("name = \"Press 7\""), "{cfg}");
    assert!(cfg.contains("addressing = \"iec\""), "{cfg}");
    let checked = tickbus(&here, &["check", "driver.cfg"]);
    let said = String::from_utf8_lossy(&checked.stdout).into_owned();
    assert!(said.contains("output_bytes=4"), "{said}");
}

/// A wrong answer is asked again, also the last one.
#[test]
#[cfg(target_os = "linux")]
fn wrong_answers_on_a_terminal_are_asked_again() {
    let folder = tempfile::tempdir().expect("there is room");
    let command = format!("{} new m", env!("CARGO_BIN_EXE_tickbus"));
    let mut script = Command::new("script")
        .current_dir(folder.path())
        .args(["-qec", &command, "/dev/null"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("script is a part of every Linux");
    let mut keys = script.stdin.take().expect("it is piped");
    let answers = b"Press 7\nsiemens\n9\nJava\nreplies\nno such.csv\n\n";
    std::io::Write::write_all(&mut keys, answers).expect("it listens");
    let output = script.wait_with_output().expect("it ends");
    drop(keys);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("did you mean java?"), "{said}");
    assert!(
        said.contains("no such.csv: this file cannot be read"),
        "{said}"
    );
    assert!(said.contains("new: ok folder=m"), "{said}");
    let cfg = fs::read_to_string(folder.path().join("m/driver.cfg")).expect("it is there");
    assert!(cfg.contains("name = \"Press 7\""), "{cfg}");
}

/// Without a bit among the inputs, or with one behind a number, the folder's own test is right as well.
#[test]
fn a_list_of_numbers_passes_its_own_test() {
    let folder = tempfile::tempdir().expect("there is room");
    let numbers = "Name;Path;Data Type;Logical Address\nLevel;T;Int;%IW2\nFlow;T;Real;%ID4\n";
    let both = format!("{numbers}Door shut;T;Bool;%I0.0\n");
    for (name, list) in [("numbers", numbers), ("both", &both)] {
        let file = format!("{name}.csv");
        fs::write(folder.path().join(&file), list).expect("there is room");
        let arguments = [
            "new",
            name,
            "--plc",
            "none",
            "--simulator",
            "c",
            "--tags",
            &file,
        ];
        assert_done(&tickbus(folder.path(), &arguments));
        let new = folder.path().join(name);
        assert_done(&tickbus(&new, &["test", "tests"]));
        let test = fs::read_to_string(new.join("tests/first.toml")).expect("it is there");
        assert_eq!(test.contains("Door shut"), name == "both", "{test}");
    }
}
