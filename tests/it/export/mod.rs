//! `tickbus export`: golden files, and properties of the exports of arbitrary signal tables.
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

use tickbus::driver_cfg::Config;
use tickbus::export::{Target, export};

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

/// The kinds for whose other end no PLC editor has a program: users write that by hand.
const BY_HAND: [&str; 9] = [
    "profibus-device",
    "hilscher-cif",
    "hilscher-cifx",
    "interbus-ddi",
    "ivi-client",
    "ivi-reader",
    "sdsp",
    "dispatcher",
    "plugin",
];

/// Each driver.cfg in `tests/export/right` has its exports in `NAME-EDITOR`, for every editor; if it is
/// refused, that folder has `refused.txt` instead. If the environment variable `BLESS` is set, they are
/// rewritten: review the difference before committing it.
#[test]
fn exports_are_their_golden_files() {
    let right = repository().join("tests/export/right");
    let (mut expected, mut kinds) = (BTreeSet::new(), BTreeSet::new());
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
        kinds.insert(
            Config::load(&path, &tickbus::KINDS)
                .expect("a driver.cfg")
                .bus
                .kind(),
        );
    }
    assert_eq!(kinds.len(), 9, "each bus that this version has: {kinds:?}");
    // A new kind needs golden files, or its name here.
    for kind in tickbus::KINDS.names() {
        let is_by_hand = BY_HAND.contains(&kind);
        assert!(kinds.contains(kind) || is_by_hand, "{kind} has no export");
    }
    let entries = fs::read_dir(&right).expect("the golden files");
    let folders = entries.map(|entry| entry.expect("an entry").path());
    let folders: BTreeSet<PathBuf> = folders.filter(|path| path.is_dir()).collect();
    assert_eq!(folders, expected, "no folder is left over");
}

#[test]
fn every_file_says_where_it_comes_from_and_who_compiled_it() {
    let config = Config::load(&repository().join("driver.cfg"), &tickbus::KINDS).expect("the rig");
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
            // TIA Portal takes every line for a tag.
            if file.name.ends_with("_tags.sdf") {
                assert!(file.text.lines().all(|line| line.starts_with('"')));
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
    let tags = folder.path().join("Test_rig_tags.sdf");
    fs::write(&tags, "mine").unwrap();
    fs::remove_file(folder.path().join("Test_rig_1_data.scl")).unwrap();

    let refused = run(&arguments);
    assert_eq!(refused.status.code(), Some(1));
    let told = err(&refused);
    assert!(
        told.contains(
            "Test_rig_tags.sdf: this file is there already; name another --out, or add --force"
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

/// A driver.cfg with these lines in `[fieldbus]` and these sections.
fn config(fieldbus: &str, sections: &str) -> Config {
    let text = format!("[driver]\nid = 7\nname = \"Cell\"\n[fieldbus]\n{fieldbus}\n{sections}");
    Config::parse("driver.cfg", &text, &tickbus::KINDS)
        .unwrap_or_else(|mistakes| panic!("{mistakes}\n{text}"))
}

const LIFE: &str = "alive = { signal = \"PLC life\", within = \"500ms\" }\nheartbeat = { signal = \"Beat\", every = \"100ms\" }\n";

#[test]
fn over_opc_ua_the_programs_leave_the_variables_alone_and_watch_the_signs_of_life() {
    for bus in [
        "kind = \"opcua-client\"\nurl = \"opc.tcp://192.168.0.1:4840\"",
        "kind = \"opcua-server\"\nanonymous = true",
    ] {
        let config = config(
            &format!("{bus}\n{LIFE}"),
            "[[signal]]\nname = \"PLC life\"\naddress = \"%QD0\"\ntype = \"REAL\"\n\
             [[signal]]\nname = \"Beat\"\naddress = \"%IW0\"\ntype = \"UINT\"\n\
             [[signal]]\nname = \"Torque\"\naddress = \"%ID4\"\ntype = \"REAL\"\n",
        );
        for target in [Target::Codesys, Target::TwinCat] {
            let xml = export(&config, target)
                .expect("sources")
                .files
                .remove(0)
                .text;
            for copied in [
                "In[",
                "Out[",
                "name=\"In\"",
                "name=\"Out\"",
                "tickbus_",
                "Cell_io.Torque",
            ] {
                assert!(!xml.contains(copied), "{copied}\n{xml}");
            }
            for watched in [
                "Beat_1 := Cell_io.Beat;",
                "Cell_io.PLC_life := 1.0 - Cell_io.PLC_life;",
            ] {
                assert!(xml.contains(watched), "{watched}\n{xml}");
            }
        }
    }
}

#[test]
fn the_tags_for_tia_portal_leave_out_signals_that_lie_elsewhere_in_the_plc() {
    let sections = "[[signal]]\nname = \"Run\"\naddress = \"%QX0.0\"\n[[signal]]\nname = \"Count\"\naddress = \"%QW2\"\n";
    for (bus, at) in [
        ("s7-client\"\naddress = \"192.168.0.1", "DB20,W8"),
        ("modbus-client", "400021"),
    ] {
        let config = config(
            &format!("kind = \"{bus}\"\n[fieldbus.at]\n\"Count\" = \"{at}\""),
            sections,
        );
        let made = export(&config, Target::S71500).expect("sources");
        let text = |ending: &str| {
            let mut files = made.files.iter();
            &files
                .find(|file| file.name.ends_with(ending))
                .expect(ending)
                .text
        };
        assert!(
            text(".sdf").contains("\"Run\",\"%Q0.0\""),
            "{}",
            text(".sdf")
        );
        assert!(!text(".sdf").contains("Count"), "{}", text(".sdf"));
        assert!(text("README.txt").contains("all signals but those of [fieldbus.at]"));
    }
}

/// `OpenPLC` keeps the registers of all its slave devices in one array per direction.
#[test]
fn more_registers_than_openplc_has_room_for_are_refused() {
    let made = |inputs: usize, outputs: usize| {
        let sizes = [inputs, outputs].map(|registers| 2 * registers);
        let bus = "kind = \"modbus-server\"\naddress = \"192.168.0.20:502\"\nmax_age = \"1s\"\n";
        let sections = format!(
            "input_bytes = {}\noutput_bytes = {}\n[[signal]]\nname = \"a\"\naddress = \"%QX0.0\"\n",
            sizes[0], sizes[1]
        );
        export(&config(bus, &sections), Target::OpenPlc).map(drop)
    };
    made(100, 100).expect("there is room");
    for (inputs, outputs, told) in [
        (401, 100, "OpenPLC would read 401 registers"),
        (100, 402, "OpenPLC would write 402 registers"),
    ] {
        let why = made(inputs, outputs).expect_err("refused").to_string();
        assert!(
            why.contains(told) && why.contains("it has room for 400"),
            "{why}"
        );
    }
}

#[test]
fn an_address_that_no_other_computer_reaches_is_noted() {
    const NOTE: &str = "is reached from the simulation's computer alone";
    for kind in ["socket", "modbus-server"] {
        for (host, noted) in [
            ("127.0.0.1", true),
            ("localhost", true),
            ("192.168.0.20", false),
            ("0.0.0.0", false),
        ] {
            let bus = format!("kind = \"{kind}\"\naddress = \"{host}:1502\"");
            let sections = "[[signal]]\nname = \"a\"\naddress = \"%QX0.0\"\n";
            let config = config(&bus, sections);
            for target in [Target::Codesys, Target::TwinCat] {
                let notes = export(&config, target).expect("sources").notes;
                let found = notes.iter().any(|note| note.contains(NOTE));
                assert_eq!(found, noted, "{bus} {notes:?}");
            }
        }
    }
}

#[test]
fn a_program_to_host_is_refused_where_it_would_not_compile_or_not_run() {
    let of = |fieldbus: &str, sections: &str| {
        let made = export(
            &config(
                &format!("kind = \"loopback\"\nlink = \"cell\"\n{fieldbus}"),
                sections,
            ),
            Target::OpenPlc,
        );
        made.expect_err("refused").to_string()
    };
    for (life, beat) in [(1, 2), (2, 1)] {
        let told = of(
            LIFE,
            &format!(
                "[[signal]]\nname = \"PLC life\"\naddress = \"%QW{life}\"\n[[signal]]\nname = \"Beat\"\naddress = \"%IW{beat}\"\n"
            ),
        );
        assert!(
            told.ends_with("give it an address whose byte is a multiple of 2"),
            "{told}"
        );
    }
    let told = of(
        "",
        "[[station]]\nname = \"a\"\n[[station]]\nname = \"b\"\n\
         [[signal]]\nname = \"x\"\naddress = \"%IX0.0\"\nstation = \"a\"\n\
         [[signal]]\nname = \"y\"\naddress = \"%IX0.0\"\nstation = \"b\"\n",
    );
    assert!(told.contains("this file has several stations"), "{told}");
}

#[test]
fn a_server_with_the_places_of_a_real_device_is_refused_with_the_cure() {
    let sections = "[[signal]]\nname = \"Run\"\naddress = \"%QX0.0\"\n";
    for (bus, at) in [
        ("modbus-server", "coil:5"),
        ("s7-server", "DB20.DBX0.0"),
        (
            "opcua-server\"\nanonymous = true\nhost = \"localhost",
            "ns=2;i=1",
        ),
    ] {
        let places = format!("kind = \"{bus}\"\n[fieldbus.at]\n\"Run\" = \"{at}\"");
        let config = config(&places, sections);
        for target in Target::ALL {
            let told = export(&config, target).expect_err(bus).to_string();
            assert!(told.contains("use that project as it is"), "{told}");
        }
    }
}
