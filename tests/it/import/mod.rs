//! `tickbus import`: tables written by editors, messages about wrong ones, and the round trip from an export.
#![allow(missing_docs, reason = "tests")]

mod clients;
mod foreign;
mod projects;
mod workbooks;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use proptest::prelude::*;
use tickbus::driver_cfg::Config;
use tickbus::export::{Target, export};
use tickbus::import::{ImportOptions, Imported, import};

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("import")
        .args(arguments)
        .current_dir(repository().join("tests/import"))
        .output()
        .expect("the tickbus program runs")
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn read(text: &str) -> Imported {
    import(
        "tags.csv",
        text.as_bytes(),
        ImportOptions::default(),
        &tickbus::KINDS,
    )
    .unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

/// Name, address and type of each signal in the driver.cfg of `imported`.
fn signals(imported: &Imported) -> Vec<(String, String, String)> {
    let config = Config::parse("driver.cfg", &imported.text, &tickbus::KINDS)
        .unwrap_or_else(|m| panic!("{m}\n{}", imported.text));
    assert_eq!(config.table.signals.len(), imported.signals);
    let signals = config.table.signals.iter();
    signals
        .map(|s| {
            (
                s.name.clone(),
                s.address().to_string(),
                s.data_type.to_string(),
            )
        })
        .collect()
}

/// Comment and folder of each signal that has either: `Start: the button [Default tag table]`.
fn notes(imported: &Imported) -> Vec<String> {
    let config = Config::parse("driver.cfg", &imported.text, &tickbus::KINDS)
        .unwrap_or_else(|m| panic!("{m}\n{}", imported.text));
    let signals = config.table.signals.iter();
    let noted = signals.filter(|signal| signal.notes.is_some());
    noted
        .map(|it| format!("{}: {} [{}]", it.name, it.comment(), it.folder()))
        .collect()
}

fn told(text: &str) -> String {
    import(
        "tags.csv",
        text.as_bytes(),
        ImportOptions::default(),
        &tickbus::KINDS,
    )
    .expect_err("mistakes")
    .to_string()
}

#[test]
fn columns_are_found_by_their_headings_or_by_what_stands_in_them() {
    let expected = [
        ("Start", "%IX0.0", "BOOL"),
        ("Speed", "%QD4", "REAL"),
        ("Level", "%IW2", "INT"),
    ]
    .map(|(name, address, kind)| (name.to_owned(), address.to_owned(), kind.to_owned()));
    for text in [
        "name;address;type;comment\nStart;%I0.0;Bool;the button\nSpeed;%QD4;Real;\nLevel;%IW2;Int;in mm\n",
        "Start;%I0.0;Bool;the button\nSpeed;%QD4;Real;\nLevel;%IW2;Int;in mm\n",
        "Start\t%I0.0\tBOOL\nSpeed\t%QD4\tREAL\nLevel\t%IW2\tINT\n",
        "Name,Path,Data Type,Logical Address,Comment,Hmi Visible,Hmi Accessible,Hmi Writeable,Typeobject ID,Version ID\n\
         Start,Default tag table,Bool,%I0.0,the button,True,True,True,,\n\
         Speed,Default tag table,Real,%QD4,,True,True,True,,\n\
         Level,Default tag table,Int,%IW2,in mm,True,True,True,,\n",
        "\"Start\",\"%I0.0\",\"Bool\",\"True\",\"True\",\"False\",\"the button\",\"\",\"True\"\n\
         \"Speed\",\"%QD4\",\"Real\",\"True\",\"True\",\"False\",\"\",\"\",\"True\"\n\
         \"Level\",\"%IW2\",\"Int\",\"True\",\"True\",\"False\",\"in mm\",\"\",\"True\"\n",
        "\"Start\",\"I       0.0\",\"BOOL\",\"the button\"\n\"Speed\",\"QD      4\",\"REAL\",\"\"\n\"Level\",\"IW      2\",\"INT\",\"in mm\"\n",
        "Symbol;Adresse;Datentyp;Kommentar\nStart;E 0.0;BOOL;the button\nSpeed;AD 4;REAL;\nLevel;EW 2;INT;in mm\n",
    ] {
        let imported = read(text);
        assert_eq!(signals(&imported), expected, "{text}");
        let folder = if text.contains("Path") {
            "Default tag table"
        } else {
            ""
        };
        let mut expected = vec![
            format!("Start: the button [{folder}]"),
            format!("Speed:  [{folder}]"),
            format!("Level: in mm [{folder}]"),
        ];
        if folder.is_empty() {
            expected.remove(1);
        }
        if !text.contains("button") {
            expected.clear();
        }
        expected.retain(|line| !line.starts_with("Level") || text.contains("in mm"));
        assert_eq!(notes(&imported), expected, "{text}");
    }
}

#[test]
fn a_comment_is_one_printable_line_and_at_most_as_long_as_the_key() {
    let long = "x".repeat(250);
    let imported = read(&format!(
        "name;address;type;comment\nA;%I0.0;Bool;\"two\nlines \u{202e}\"\"quoted\"\" C:\\\"\nB;%I0.1;Bool;{long}\nC;%I0.2;Bool;\u{7}\n"
    ));
    assert_eq!(
        notes(&imported),
        [
            "A: two lines \"quoted\" C:\\ []".to_owned(),
            format!("B: {} []", &long[..200])
        ]
    );
}

#[test]
fn the_list_of_a_real_project_is_read_and_the_rest_of_it_is_told() {
    let imported = read(
        "name;address;type;comment\n\
         Start;%I0.0;Bool;\n\
         Flag;%M10.0;Bool;not ours\n\
         Recipe;%DB1.DBW4;Int;\n\
         Delay;T5;Timer;\n\
         \"Motor \"\"left\"\"; slow\";%Q0.0;Bool;\n",
    );
    let skipped: Vec<String> = imported
        .skipped
        .iter()
        .map(|m| format!("{:?} {}", m.place.unwrap(), m.mistake.what))
        .collect();
    assert_eq!(
        skipped,
        [
            "(3, 6) \"%M10.0\" is a marker, no part of the process image: skipped",
            "(4, 8) \"%DB1.DBW4\" is in a data block, no part of the process image: skipped",
            "(5, 7) \"T5\" is a timer, no part of the process image: skipped",
        ]
    );
    let names: Vec<String> = signals(&imported)
        .into_iter()
        .map(|(name, ..)| name)
        .collect();
    assert_eq!(names, ["Start", "Motor \"left\"; slow"]);
}

/// Each `NAME.csv` in `tests/import/wrong` has its mistakes in `NAME.txt`. If `BLESS` is set, they are
/// rewritten.
#[test]
fn every_wrong_table_has_exactly_its_mistakes() {
    let folder = repository().join("tests/import/wrong");
    let mut count = 0;
    for entry in fs::read_dir(&folder).expect("the wrong tables") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension == "txt") {
            continue;
        }
        let file = format!("wrong/{}", path.file_name().unwrap().to_string_lossy());
        let output = run(&[&file]);
        assert_eq!(output.status.code(), Some(1), "{file}: {}", err(&output));
        assert!(output.stdout.is_empty());
        let golden = path.with_extension("txt");
        if std::env::var_os("BLESS").is_some() {
            fs::write(&golden, err(&output)).unwrap();
        }
        assert_eq!(
            err(&output),
            fs::read_to_string(&golden).unwrap_or_default(),
            "{file}"
        );
        count += 1;
    }
    assert!(count >= 5);
}

#[test]
fn lines_with_mistakes_are_left_out_when_asked_for() {
    let text = "a;%I0.0;Bool\nb;%I0.0;Bool\nc;%I0.9;Bool\nd;%M0.0;Bool\ne;%IW2;Int\n";
    assert_eq!(told(text).lines().count(), 2);
    let reading = ImportOptions {
        lenient: true,
        ..ImportOptions::default()
    };
    let imported = import("tags.csv", text.as_bytes(), reading, &tickbus::KINDS).expect("the rest");
    let lines: Vec<usize> = imported
        .skipped
        .iter()
        .map(|mistake| mistake.place.unwrap().0)
        .collect();
    assert_eq!(lines, [2, 3, 4]);
    assert_eq!(signals(&imported).len(), 2);
}

#[test]
fn the_driver_cfg_goes_to_a_file_that_is_not_there_and_check_finds_it_right() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = folder.path().join("Förderer.csv");
    let out = folder.path().join("driver.cfg");
    // As saved by a German Excel.
    fs::write(
        &table,
        b"Name;Adresse;Datentyp;Kommentar\r\nF\xF6rderer l\xE4uft;%E0.0;Bool;Lichtschranke\r\n",
    )
    .unwrap();
    let arguments = [table.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let output = run(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        "import: ok signals=1 assigned=0 skipped=0\n"
    );
    let config = Config::load(&out, &tickbus::KINDS).expect("a right driver.cfg");
    assert_eq!(
        (config.name.as_str(), config.table.signals[0].name.as_str()),
        ("Förderer", "Förderer läuft")
    );
    let again = run(&arguments);
    assert_eq!(again.status.code(), Some(1));
    assert!(err(&again).contains("this file is there already; name another --out, or add --force"));
    assert_eq!(
        run(&[&arguments[..], &["--force"]].concat()).status.code(),
        Some(0)
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_stdout_is_a_failure() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = folder.path().join("tags.csv");
    fs::write(&table, "a;%I0.0;Bool\n").unwrap();
    let check = repository().join("driver.cfg");
    for arguments in [
        ["import", table.to_str().unwrap()],
        ["check", check.to_str().unwrap()],
    ] {
        let full = fs::File::options()
            .write(true)
            .open("/dev/full")
            .expect("a full disk");
        let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args(arguments)
            .stdout(full)
            .output()
            .expect("the tickbus program runs");
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        let told = err(&output);
        assert!(told.contains("standard output cannot be written"), "{told}");
    }
}

#[test]
fn what_an_export_lists_is_read_as_the_same_table() {
    let rig = Config::load(&repository().join("driver.cfg"), &tickbus::KINDS).expect("the rig");
    assert_same(&rig);
}

/// The symbols in `config`'s exports, as CSV and as SDF, give the same signals, in address order.
fn assert_same(config: &Config) {
    for target in [Target::OpenPlc, Target::S71500] {
        assert_same_of(config, target);
    }
}

fn assert_same_of(config: &Config, target: Target) {
    let made = export(config, target).expect("symbols");
    let tags = made
        .files
        .iter()
        .find(|file| file.name.contains("_tags."))
        .expect("tags");
    if config.table.signals.is_empty() {
        return;
    }
    let imported = import(
        &tags.name,
        tags.text.as_bytes(),
        ImportOptions::default(),
        &tickbus::KINDS,
    )
    .unwrap_or_else(|mistakes| panic!("{mistakes}\n{}", tags.text));
    let commented = config.table.signals.iter();
    let commented = commented.filter(|signal| !signal.comment().is_empty());
    for signal in commented {
        let line = format!("{}: {} []", signal.name, signal.comment());
        assert!(notes(&imported).contains(&line), "{line}\n{}", tags.text);
    }
    let mut read = signals(&imported);
    let mut expected: Vec<_> = config
        .table
        .signals
        .iter()
        .map(|s| {
            (
                s.name.clone(),
                s.address().to_string(),
                s.data_type.to_string(),
            )
        })
        .collect();
    read.sort();
    expected.sort();
    assert_eq!(read, expected);
}

proptest! {
    #[test]
    fn any_exported_table_comes_back(names in prop::collection::btree_set("\\PC{1,30}", 1..20)) {
        let mut sections = String::new();
        for (number, name) in names.iter().enumerate() {
            let name: String = name.split_whitespace().collect::<Vec<_>>().join(" ");
            let name = name.replace('\\', "\\\\").replace('"', "\\\"");
            let kind = ["REAL", "DINT", "DWORD"][number % 3];
            write!(sections, "[[signal]]\nname = \"{name}|{number}\"\naddress = \"%QD{}\"\ntype = \"{kind}\"\ncomment = \"{name}\"\n", 4 * number).expect("a String takes all");
        }
        let text = format!("[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"socket\"\n{sections}");
        if let Ok(config) = Config::parse("driver.cfg", &text, &tickbus::KINDS) {
            assert_same(&config);
        }
    }

    /// Arbitrary bytes cause no panic; readable ones give a driver.cfg without mistakes.
    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        assert_sound(&bytes);
    }

    #[test]
    fn any_table_is_read_or_refused(text in "((\\PC{0,8}|\"\\PC{0,5}\"?|%[IQM][XBWDL]?[0-9]{1,3}(\\.[0-9])?|Bool|Int|Real)[;,\t\r\n#]){0,60}") {
        assert_sound(text.as_bytes());
    }
}

fn assert_sound(bytes: &[u8]) {
    for lenient in [false, true] {
        let reading = ImportOptions {
            lenient,
            ..ImportOptions::default()
        };
        if let Ok(imported) = import("tags.csv", bytes, reading, &tickbus::KINDS) {
            let config = Config::parse("driver.cfg", &imported.text, &tickbus::KINDS);
            let config = config.unwrap_or_else(|mistakes| panic!("{mistakes}\n{}", imported.text));
            assert_eq!(config.table.signals.len(), imported.signals);
        }
    }
}
