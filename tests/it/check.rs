//! `tickbus check`, run as a program, on good and on wrong files.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs `tickbus check FILE` in `directory`.
fn check(directory: &Path, file: impl AsRef<std::ffi::OsStr>) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("check")
        .arg(file)
        .current_dir(directory)
        .output()
        .expect("the tickbus program runs")
}

/// Asserts exit code 1, and nothing printed except these mistakes and their count.
#[track_caller]
fn assert_mistakes(output: &Output, mistakes: &[String]) {
    let told = String::from_utf8_lossy(&output.stderr);
    let count = format!("check: failed mistakes={}", mistakes.len());
    let told: Vec<&str> = told.lines().collect();
    let expected: Vec<&str> = mistakes
        .iter()
        .chain([&count])
        .map(String::as_str)
        .collect();
    assert_eq!(told, expected);
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.is_empty());
}

fn wrong_files() -> Vec<PathBuf> {
    let wrong = files("wrong");
    assert!(wrong.len() > 40, "the wrong files are there");
    wrong
}

/// Every driver.cfg in a folder of tests.
fn files(folder: &str) -> Vec<PathBuf> {
    let directory = fs::read_dir(repository().join("tests").join(folder)).expect("the files");
    let mut files: Vec<PathBuf> = directory
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "cfg"))
        .collect();
    files.sort();
    files
}

#[test]
fn times_that_contradict_each_other_are_warnings() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\ncycle = \"10ms\"\n\
                max_age = \"15ms\"\n[[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n";
    fs::write(folder.path().join("x.cfg"), text).expect("the file is written");
    let output = check(folder.path(), "x.cfg");
    let told = String::from_utf8_lossy(&output.stdout);
    let warning = "warning   max_age is 15ms, less than two bus cycles of 10ms: one late cycle makes all data stale; \
                   set max_age to 30ms or more\n";
    assert!(told.contains(warning), "{told}");
    assert_eq!(output.status.code(), Some(0));
}

/// Each `tests/wrong/NAME.cfg` has its mistakes in `NAME.txt`. If the environment variable `BLESS` is set, the files
/// are rewritten instead: review the difference before committing it.
#[test]
fn every_wrong_file_has_exactly_its_mistakes() {
    for file in wrong_files() {
        let output = check(file.parent().unwrap(), file.file_name().unwrap());
        let expected = file.with_extension("txt");
        if std::env::var_os("BLESS").is_some() {
            let told = String::from_utf8_lossy(&output.stderr);
            let (mistakes, _) = told.rsplit_once("check: failed").expect("mistakes");
            fs::write(&expected, mistakes).expect("the file is written");
        }
        let expected = fs::read_to_string(&expected)
            .unwrap_or_else(|error| panic!("{}: {error}", expected.display()));
        let expected: Vec<String> = expected.lines().map(str::to_owned).collect();
        assert_mistakes(&output, &expected);
    }
}

#[test]
fn mistakes_have_the_shape_that_editors_know() {
    for file in wrong_files() {
        let name = file.file_name().unwrap().to_str().unwrap().to_owned();
        let text = fs::read_to_string(&file).unwrap();
        let mut before = (0, 0);
        for line in fs::read_to_string(file.with_extension("txt"))
            .unwrap()
            .lines()
        {
            let mut parts = line.splitn(4, ':');
            assert_eq!(parts.next(), Some(name.as_str()), "{line}");
            let place: Vec<usize> = parts
                .by_ref()
                .take(2)
                .map(|part| part.parse().expect(line))
                .collect();
            let &[row, column] = place.as_slice() else {
                panic!("{line}")
            };
            assert!(before <= (row, column), "in order: {line}");
            before = (row, column);
            let of_file = text.split('\n').nth(row - 1).expect(line);
            assert!(column <= of_file.chars().count() + 1, "{line}");
            assert!(
                parts.next().expect(line).contains("; "),
                "what; what would be right: {line}"
            );
        }
    }
}

#[test]
fn the_rig_is_right() {
    let output = check(repository(), "driver.cfg");
    let printed = String::from_utf8(output.stdout).expect("UTF-8");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
    assert!(
        printed.starts_with("driver    4711 \"Test rig\"\n"),
        "{printed}"
    );
    assert_eq!(
        printed.lines().last(),
        Some("check: ok signals=38 input_bytes=8 output_bytes=8")
    );
    // Bits 8 and up of the word are in its first byte: the lines that people get wrong.
    for line in [
        "%QX1.0   %QW0 bit 0   BOOL  PLC output → simulation  rising",
        "%QX0.7   %QW0 bit 15  BOOL  PLC output → simulation  rising",
        "%IX0.3   %IW0 bit 11  BOOL  simulation → PLC input   rising",
    ] {
        assert!(
            printed.lines().any(|printed| printed.starts_with(line)),
            "{line}\n{printed}"
        );
    }
}

/// Each `tests/right/NAME.cfg` prints as `NAME.txt`; `BLESS` rewrites that, as for the wrong files.
#[test]
fn every_right_file_prints_as_its_golden_file() {
    let right = files("right");
    assert!(right.len() > 5, "the right files are there");
    for file in right {
        let output = check(file.parent().unwrap(), file.file_name().unwrap());
        assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{file:?}");
        let golden = file.with_extension("txt");
        if std::env::var_os("BLESS").is_some() {
            fs::write(&golden, &output.stdout).expect("the file is written");
        }
        assert_eq!(
            String::from_utf8_lossy(&output.stdout),
            fs::read_to_string(golden).unwrap(),
            "{file:?}"
        );
    }
}

#[test]
fn what_is_no_readable_text_is_told() {
    let directory = tempfile::tempdir().expect("a directory");
    let file = |line: &str| vec![line.to_owned()];
    assert_mistakes(
        &check(directory.path(), "none.cfg"),
        &file("none.cfg: there is no such file; check the path and the name"),
    );
    fs::create_dir(directory.path().join("folder.cfg")).unwrap();
    assert_mistakes(
        &check(directory.path(), "folder.cfg"),
        &file(
            "folder.cfg: this is a directory; name the configuration file in it, such as driver.cfg",
        ),
    );
    fs::write(
        directory.path().join("latin1.cfg"),
        b"[driver]\nname = \"T\xFCr\"\n",
    )
    .unwrap();
    assert_mistakes(
        &check(directory.path(), "latin1.cfg"),
        &file("latin1.cfg:2:10: the byte 0xFC is no UTF-8 text; save the file as UTF-8"),
    );
}

#[test]
fn wrong_usage_is_exit_code_2() {
    for arguments in [
        &[][..],
        &["check"],
        &["chekc", "driver.cfg"],
        &["check", "a", "b"],
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args(arguments)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
}

/// A folder whose name is in Latin-1, as on an old disk.
#[test]
#[cfg(target_os = "linux")]
fn files_beside_a_driver_cfg_are_found_in_a_folder_whose_name_is_no_utf_8() {
    use std::os::unix::ffi::OsStrExt as _;

    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary
        .path()
        .join(std::ffi::OsStr::from_bytes(b"pr\xfcfung"));
    fs::create_dir(&folder).expect("made");
    let text = "[driver]\nid = 1\nname = \"x\"\nfaults = \"f.toml\"\n[fieldbus]\nkind = \"socket\"\n\
                [[signal]]\nname = \"a\"\naddress = \"%QX0.0\"\n";
    fs::write(folder.join("driver.cfg"), text).expect("written");
    let fault = "[[fault]]\nkind = \"stuck\"\nsignal = \"a\"\nvalue = true\nat = \"1s\"\n";
    fs::write(folder.join("f.toml"), fault).expect("written");
    let output = check(temporary.path(), folder.join("driver.cfg"));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
}

/// Every example in the documentation, on the rig that it concerns.
#[test]
fn the_faults_of_the_documentation_are_right() {
    let rig = tickbus::driver_cfg::Config::load(&repository().join("driver.cfg"), &tickbus::KINDS)
        .unwrap_or_else(|why| panic!("{why}"));
    let text = fs::read_to_string(repository().join("docs/faults.md")).expect("the documentation");
    let blocks = text.split("```toml\n").skip(1);
    let blocks = blocks.filter_map(|block| block.split("```").next());
    let blocks: Vec<&str> = blocks.collect();
    assert!(blocks.len() >= 5, "{}", blocks.len());
    let scope = tickbus::faults::Scope {
        table: &rig.table,
        has_diagnosis: true,
        has_answers: true,
        codes: tickbus::faults::AnswerCodes::BYTE,
    };
    for block in blocks {
        let faults = tickbus::faults::read_file("faults.md", block, scope);
        let faults = faults.unwrap_or_else(|why| panic!("{why}\n{block}"));
        assert!(!faults.is_empty(), "{block}");
    }
}

/// Runs `tickbus gsd` in tests/right.
fn gsd(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("gsd")
        .args(arguments)
        .current_dir(repository().join("tests/right"))
        .output()
        .expect("the tickbus program runs")
}

/// `BLESS` rewrites the golden file, too.
#[test]
fn the_gsd_file_of_a_machine_is_its_golden_file() {
    let output = gsd(&["profibus-device.cfg", "--ident", "0x80E0"]);
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    let golden = repository().join("tests/right/profibus-device.gsd");
    if std::env::var_os("BLESS").is_some() {
        fs::write(&golden, &output.stdout).expect("the file is written");
    }
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        fs::read_to_string(golden).unwrap()
    );
}

#[test]
fn a_gsd_file_that_cannot_be_made_is_refused_with_what_to_do() {
    for (arguments, words) in [
        (
            &["profibus-device.cfg"][..],
            "profibus-device.cfg: the stations have 2 idents, 0x80E0, 0x80E1; each has a GSD file of its own: add \
             --ident 0x80E0",
        ),
        (
            &["profibus-device.cfg", "--ident", "7"],
            "profibus-device.cfg: no station has the ident 0x0007; the stations without a GSD file have 0x80E0, 0x80E1",
        ),
        (
            &["modbus-server.cfg"],
            "modbus-server.cfg: the bus \"modbus-server\" has no GSD file; name a driver.cfg with kind = \
             \"profibus-device\"",
        ),
    ] {
        let output = gsd(arguments);
        let right = format!("{words}\ngsd: failed mistakes=1\n");
        assert_eq!(String::from_utf8_lossy(&output.stderr), right);
        assert_eq!(output.status.code(), Some(1));
        assert!(output.stdout.is_empty());
    }
}
