//! Training machines: the command as a process, and the folders that it has.

use std::collections::BTreeMap;
use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

#[cfg(all(unix, feature = "page"))]
use super::commands::Running;
use super::testing::{err, out, repository, test};
use tickbus::driver_cfg::Config;
use tickbus::reply::REPLY_KINDS;

const MACHINES: [&str; 6] = [
    "two-tanks",
    "traffic-lights",
    "sorting",
    "pick-and-place",
    "lift",
    "bottle-rig",
];

fn machine(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("machine")
        .args(arguments)
        .output()
        .expect("the tickbus program runs")
}

/// Arguments for ports that the system chooses.
#[cfg(feature = "page")]
const FREE_PORTS: [&str; 4] = ["--address", "127.0.0.1:0", "--page", "127.0.0.1:0"];

fn folder_of(name: &str) -> PathBuf {
    repository().join("examples/machines").join(name)
}

/// The files in a folder and below: the path within it, and the text.
fn files(folder: &Path) -> BTreeMap<PathBuf, String> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let within = path.strip_prefix(folder).expect("it is within").to_owned();
                found.insert(within, fs::read_to_string(path).expect("a text"));
            }
        }
    }
    found
}

#[test]
fn the_list_is_a_document_for_programs_as_well() {
    let listed = out(&machine(&["list", "--json"]));
    let document: serde_json::Value = serde_json::from_str(&listed).expect("a document");
    let machines = document["machines"].as_array().expect("a list");
    let names: Vec<&str> = machines
        .iter()
        .filter_map(|one| one["name"].as_str())
        .collect();
    assert_eq!(names, MACHINES);
    assert!(machines.iter().all(|one| one["title"] != ""));
    assert_eq!(document["ok"], true);
}

#[test]
fn the_list_has_each_machine_with_its_title() {
    let listed = out(&machine(&["list"]));
    let names: Vec<&str> = listed
        .lines()
        .filter_map(|line| line.split(' ').next())
        .collect();
    assert_eq!(names, MACHINES);
    for (line, name) in listed.lines().zip(MACHINES) {
        let config = fs::read_to_string(folder_of(name).join("driver.cfg")).expect("a text");
        let title = config
            .lines()
            .next()
            .and_then(|line| line.strip_prefix("# "));
        assert!(line.ends_with(title.expect("a title")), "{line}");
    }
    let folders = fs::read_dir(repository().join("examples/machines")).expect("the machines");
    assert_eq!(folders.count(), MACHINES.len(), "each machine is built in");
}

#[test]
fn a_machine_is_copied_whole_and_nothing_is_overwritten() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in MACHINES {
        let to = folder.path().join("copies").join(name);
        let shown = to.to_str().expect("a path");
        let copied = machine(&[name, "--to", shown]);
        assert!(copied.status.success(), "{}", err(&copied));
        let told = out(&copied);
        assert!(told.contains(&format!("tickbus machine {shown}")), "{told}");
        assert_eq!(files(&to), files(&folder_of(name)), "{name}");
        fs::write(to.join("driver.cfg"), "mine").expect("it is written");
        let again = machine(&[name, "--to", shown]);
        assert_eq!(again.status.code(), Some(1));
        assert!(err(&again).contains("has files already"), "{}", err(&again));
        let kept = fs::read_to_string(to.join("driver.cfg")).expect("a text");
        assert_eq!(kept, "mine");
    }
}

#[test]
fn a_copy_with_the_name_of_a_machine_is_run_by_its_path() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .arg("machine")
            .args(arguments)
            .current_dir(folder.path())
            .output()
            .expect("the tickbus program runs")
    };
    let copied = out(&run(&["lift", "--to", "lift"]));
    assert!(
        copied.ends_with("run it by: tickbus machine ./lift\n"),
        "{copied}"
    );
    fs::remove_dir_all(folder.path().join("lift/exercises")).expect("it is there");
    let built_in = run(&["lift", "--grade", "mirror"]);
    let note = "note: this is the machine that is built in; the one in your folder is ./lift\n";
    assert!(err(&built_in).starts_with(note), "{}", err(&built_in));
    let own = run(&["./lift", "--grade", "mirror"]);
    assert!(
        err(&own).contains("has no folder \"exercises\""),
        "{}",
        err(&own)
    );
}

#[test]
fn each_machine_is_whole_and_its_picture_shows_only_what_it_has() {
    for name in MACHINES {
        let folder = folder_of(name);
        let config = Config::load(&folder.join("driver.cfg"), &tickbus::KINDS);
        let config = config.unwrap_or_else(|mistakes| panic!("{mistakes}"));
        assert!(!config.replies.is_empty(), "{name}");
        let page = config.page.expect("a page");
        let picture = folder.join(page.picture.expect("a picture"));
        let text = fs::read_to_string(&picture).expect("a text");
        assert!(
            text.contains("light-dark("),
            "{name} is drawn for light and dark"
        );
        let readme = fs::read_to_string(folder.join("README.md")).expect("a text");
        assert!(
            readme.contains(&format!("    tickbus machine {name}\n")),
            "{name}"
        );
        assert!(readme.contains("## Exercises"), "{name}");
        let exercises = fs::read_dir(folder.join("exercises"))
            .expect("exercises")
            .count();
        assert!(
            (2..=4).contains(&exercises),
            "{name} has {exercises} exercises"
        );
        #[cfg(feature = "page")]
        {
            let signals = config.table.signals.iter();
            let signals: Vec<&str> = signals.map(|signal| signal.name.as_str()).collect();
            let read = tickbus_live_page::picture::read(&text, &signals).expect("a picture");
            let mistakes: Vec<String> = read.mistakes.iter().map(ToString::to_string).collect();
            assert_eq!(mistakes, [""; 0], "{name}");
            assert!(read.left_out.is_empty(), "{name}: {:?}", read.left_out);
        }
    }
    let used: Vec<String> = MACHINES
        .map(|name| fs::read_to_string(folder_of(name).join("driver.cfg")).expect("a text"))
        .into();
    for kind in ["integrator", "track"] {
        assert!(REPLY_KINDS.iter().any(|known| known.name == kind));
        assert!(
            used.iter()
                .any(|text| text.contains(&format!("\"{kind}\""))),
            "{kind}"
        );
    }
}

#[cfg(all(unix, feature = "page"))]
#[test]
fn a_machine_runs_on_any_bus_that_serves_and_its_folder_does_as_well() {
    let folder = folder_of("traffic-lights");
    let folder = folder.to_str().expect("a path");
    for arguments in [
        &["two-tanks"][..],
        &["lift", "--bus", "s7-server"],
        &["sorting", "--bus", "socket"],
        #[cfg(feature = "opcua")]
        &["pick-and-place", "--bus", "opcua-server"],
        &[folder],
    ] {
        let mut ran = Running::of("machine", &[arguments, &FREE_PORTS].concat());
        let url = ran.after("machine: page at http://");
        assert!(url.contains("#token="), "{url}");
        // OPC UA opens its line first.
        while !ran
            .after("machine: opening: ")
            .starts_with("listening on 127.0.0.1:")
        {}
        let (last, code) = ran.interrupt();
        assert!(
            last.starts_with("machine: ok scans="),
            "{arguments:?}: {last}"
        );
        assert_eq!(code, Some(0), "{arguments:?}");
    }
}

#[test]
fn nothing_is_left_among_the_temporary_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let ran = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["machine", "lift", "--grade", "mirror"])
        .env("TMPDIR", folder.path())
        .output()
        .expect("the tickbus program runs");
    assert_eq!(ran.status.code(), Some(1), "{}", err(&ran));
    let left = fs::read_dir(folder.path()).expect("the folder").count();
    assert_eq!(left, 0, "{}", out(&ran));
}

#[cfg(unix)]
#[test]
fn nor_when_grading_is_interrupted() {
    use std::io::{BufRead as _, BufReader};

    use rustix::process::{Pid, Signal, kill_process};

    for signal in [Signal::INT, Signal::TERM] {
        let folder = tempfile::tempdir().expect("a folder");
        let mut ran = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args(["machine", "traffic-lights", "--grade", "mirror"])
            .env("TMPDIR", folder.path())
            .stdout(std::process::Stdio::piped())
            .spawn()
            .expect("the tickbus program runs");
        let mut output = BufReader::new(ran.stdout.take().expect("it is piped"));
        let mut first = String::new();
        output.read_line(&mut first).expect("text");
        assert!(first.starts_with("FAIL"), "{first}");
        let pid = i32::try_from(ran.id()).ok().and_then(Pid::from_raw);
        kill_process(pid.expect("it runs"), signal).expect("it is not waited for yet");
        ran.wait().expect("it ends");
        let left = fs::read_dir(folder.path()).expect("the folder").count();
        assert_eq!(left, 0, "{signal:?}");
    }
}

#[test]
fn wrong_calls_are_refused_with_what_would_be_right() {
    let empty = tempfile::tempdir().expect("a folder");
    let empty = empty.path().to_str().expect("a path");
    let mut calls = vec![
        (vec!["two-tnaks"], 2, "did you mean \"two-tanks\"?"),
        (
            vec!["lift", "--bus", "modbus-servre"],
            1,
            "did you mean \"modbus-server\"?",
        ),
        (vec!["lift", "--bus", "profibus-device"], 1, "--bus:1:1: "),
        (
            vec![empty],
            1,
            "has no driver.cfg; name the folder of a machine",
        ),
        (
            vec!["lift", "--grade", "mirorr"],
            2,
            "no PLC program is called \"mirorr\"",
        ),
        (vec!["lift", "--grade", "none.st"], 1, "none.st"),
        (
            vec!["lift", "--grade", "mirror", "--bus", "socket"],
            2,
            "cannot be used with",
        ),
    ];
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let taken = listener.local_addr().expect("an address").to_string();
    if cfg!(feature = "page") {
        calls.push((
            vec!["lift", "--address", "127.0.0.1:0", "--page", &taken],
            3,
            "has this port",
        ));
    }
    for (arguments, code, words) in calls {
        let refused = machine(&arguments);
        let told = err(&refused);
        assert_eq!(refused.status.code(), Some(code), "{arguments:?}: {told}");
        assert!(told.contains(words), "{arguments:?}: {told}");
    }
    let copied = tempfile::tempdir().expect("a folder");
    let to = copied.path().join("lift");
    let shown = to.to_str().expect("a path");
    assert!(machine(&["lift", "--to", shown]).status.success());
    fs::remove_dir_all(to.join("exercises")).expect("it is there");
    let refused = machine(&[shown, "--grade", "mirror"]);
    assert!(
        err(&refused).contains("has no folder \"exercises\""),
        "{}",
        err(&refused)
    );
    let refused = machine(&[shown, "--to", "elsewhere"]);
    assert_eq!(refused.status.code(), Some(2));
    #[cfg(feature = "page")]
    {
        fs::remove_file(to.join("picture.svg")).expect("it is there");
        let refused = machine(&[&[shown], &FREE_PORTS[..]].concat());
        assert_eq!(refused.status.code(), Some(1));
        assert!(
            err(&refused).contains("picture.svg\" cannot be read"),
            "{}",
            err(&refused)
        );
    }
}

/// A program that keeps every output off.
#[test]
fn a_failed_exercise_says_what_the_program_lacks() {
    let graded = machine(&["two-tanks", "--grade", "mirror"]);
    let told = out(&graded);
    assert_eq!(graded.status.code(), Some(1), "{told}");
    assert!(told.contains("\n      hint: "), "{told}");
}

#[test]
fn the_program_of_the_command_line_takes_the_place_of_that_of_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"socket\"\n[[signal]]\nname = \"a\"\n\
                  address = \"%IX0.0\"\n";
    fs::write(folder.path().join("line.cfg"), config).expect("the driver.cfg");
    let text = "config = \"line.cfg\"\nstep = \"2ms\"\n[[test]]\nname = \"a\"\nhint = \"Of the test.\"\nsteps = [\n\
                { expect = \"nothing swallowed\", run = \"20ms\" },\n]\n";
    fs::write(folder.path().join("a.toml"), text).expect("the test file");
    let without = test(folder.path(), &["a.toml"]);
    assert!(
        err(&without).contains("or --program on the command line"),
        "{}",
        err(&without)
    );
    let with = test(folder.path(), &["a.toml", "--program", "mirror"]);
    assert_eq!(with.status.code(), Some(0), "{}{}", out(&with), err(&with));
    let unknown = test(folder.path(), &["a.toml", "--program", "mirorr"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(
        err(&unknown).contains("no PLC program is called"),
        "{}",
        err(&unknown)
    );
}
