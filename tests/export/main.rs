//! `tickbus export`: golden files, and properties of what it makes for any signal table.
#![allow(missing_docs, reason = "tests")]

mod machine;
mod plcopen;
mod s7;
mod st;
mod tables;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tickbus::driver::Config;
use tickbus::export::{Target, export};
use tickbus::fieldbus::KINDS;

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("export")
        .args(arguments)
        .current_dir(repository())
        .output()
        .expect("the tickbus program runs")
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn files(folder: &Path) -> Vec<(String, String)> {
    let entries =
        fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<(String, String)> = entries
        .map(|entry| {
            let path = entry.expect("an entry").path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            (name, fs::read_to_string(&path).expect("UTF-8"))
        })
        .collect();
    files.sort();
    files
}

/// Each driver.cfg in `tests/export/right` has its files in `NAME-EDITOR`, for every editor; where it is refused, the
/// folder has `refused.txt` instead. With the environment variable `BLESS` set, they are written there: read the
/// difference before you commit it.
#[test]
fn exports_are_their_golden_files() {
    let right = repository().join("tests/export/right");
    let mut expected = BTreeSet::new();
    for entry in fs::read_dir(&right).expect("the golden files") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension != "cfg") {
            continue;
        }
        let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
        for target in Target::ALL {
            let golden = right.join(format!("{stem}-{}", target.name()));
            let folder = tempfile::tempdir().expect("a folder");
            let out = folder.path().join("made");
            let file = format!("tests/export/right/{stem}.cfg");
            let output = run(&[
                &file,
                "--for",
                target.name(),
                "--out",
                out.to_str().unwrap(),
            ]);
            if output.status.code() == Some(1) {
                fs::create_dir(&out).expect("a folder");
                fs::write(out.join("refused.txt"), err(&output)).expect("the file is written");
            } else {
                assert_eq!(output.status.code(), Some(0), "{}", err(&output));
            }
            if std::env::var_os("BLESS").is_some() {
                let _ = fs::remove_dir_all(&golden);
                fs::create_dir(&golden).expect("a folder");
                for (name, text) in files(&out) {
                    fs::write(golden.join(name), text).expect("the file is written");
                }
            }
            assert_eq!(files(&out), files(&golden), "{}", golden.display());
            expected.insert(golden);
        }
    }
    assert!(
        expected.len() >= 9 * Target::ALL.len(),
        "every bus has a file"
    );
    let entries = fs::read_dir(&right).expect("the golden files");
    let folders = entries.map(|entry| entry.expect("an entry").path());
    let folders: BTreeSet<PathBuf> = folders.filter(|path| path.is_dir()).collect();
    assert_eq!(folders, expected, "no folder is left over");
}

#[test]
fn every_kind_of_bus_is_among_the_golden_files() {
    let right = repository().join("tests/export/right");
    let entries = fs::read_dir(right).expect("the golden files");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let configs = paths.filter(|path| path.extension() == Some("cfg".as_ref()));
    let kinds: BTreeSet<&str> = configs
        .map(|path| {
            let config = Config::load(&path).unwrap_or_else(|mistakes| panic!("{mistakes}"));
            config.bus.kind()
        })
        .collect();
    let built = KINDS.iter().copied().filter(|kind| {
        let text = format!("[driver]\nid = 1\nname = \"a\"\n[fieldbus]\nkind = \"{kind}\"\n");
        let refused = Config::parse("driver.cfg", &text)
            .map_or_else(|mistakes| mistakes.to_string(), |_| String::new());
        !refused.contains("is not in this version")
    });
    assert_eq!(kinds, built.collect::<BTreeSet<_>>());
}

#[test]
fn every_file_says_where_it_comes_from_and_who_compiled_it() {
    let config = Config::load(&repository().join("driver.cfg")).expect("the rig");
    for target in Target::ALL {
        let made = export(&config, target).expect("the rig's half");
        for file in &made.files {
            if file.name.ends_with("_tags.csv") {
                assert!(
                    file.text
                        .starts_with("\u{feff}name;address;type;comment\r\n")
                );
                continue;
            }
            let head: Vec<&str> = file.text.lines().take(8).collect();
            let head = head.join("\n").replace("&apos;", "'");
            for phrase in [
                "Generated by tickbus",
                "from driver.cfg",
                "Directions are the PLC's: %I is a PLC input, which the simulation writes",
                "compiled",
            ] {
                assert!(head.contains(phrase), "{}: {phrase}\n{head}", file.name);
            }
            assert!(
                !file.text.contains(env!("CARGO_MANIFEST_DIR")),
                "no path of this machine"
            );
        }
    }
}

#[test]
fn a_file_that_is_there_is_never_overwritten_without_force() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().unwrap();
    let arguments = ["driver.cfg", "--for", "s7-1500", "--out", out];
    assert_eq!(run(&arguments).status.code(), Some(0));
    let tags = folder.path().join("Test_rig_tags.csv");
    fs::write(&tags, "mine").unwrap();
    fs::remove_file(folder.path().join("Test_rig_1_data.scl")).unwrap();

    let refused = run(&arguments);
    assert_eq!(refused.status.code(), Some(1));
    let told = err(&refused);
    assert!(
        told.contains(
            "Test_rig_tags.csv: this file is there already; name another --out, or add --force"
        ),
        "{told}"
    );
    assert_eq!(told.lines().last(), Some("export: failed mistakes=4"));
    assert_eq!(fs::read_to_string(&tags).unwrap(), "mine");
    assert!(
        !folder.path().join("Test_rig_1_data.scl").exists(),
        "all or nothing"
    );

    let forced = run(&[&arguments[..], &["--force"]].concat());
    assert_eq!(forced.status.code(), Some(0), "{}", err(&forced));
    assert!(fs::read_to_string(&tags).unwrap().contains("IM1 index"));
}

#[test]
fn the_files_go_beside_the_driver_cfg_unless_told_otherwise() {
    let folder = tempfile::tempdir().expect("a folder");
    let file: PathBuf = folder.path().join("cell.cfg");
    fs::copy(repository().join("driver.cfg"), &file).unwrap();
    let output = run(&[file.to_str().unwrap(), "--for", "s7-1500"]);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert!(
        folder
            .path()
            .join("cell-s7-1500/Test_rig_2_link.scl")
            .exists()
    );
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(told.lines().last(), Some("export: ok for=s7-1500 files=5"));
}

#[test]
fn the_end_of_the_plc_itself_is_refused() {
    let config = tables::parse(
        "role = \"controller\"",
        "[[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n",
    );
    let mistakes = export(&config, Target::S71500).expect_err("refused");
    assert_eq!(
        mistakes.to_string(),
        "driver.cfg: role = \"controller\": this file is the PLC's end itself; export the machine's driver.cfg, or \
         remove \"role\""
    );
    let output = run(&["no-such.cfg", "--for", "s7-1500"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(err(&output).contains("there is no such file"));
    assert_eq!(run(&["driver.cfg", "--for", "s5"]).status.code(), Some(2));
}
