//! Exports in Structured Text, checked by a third-party parser: blark.
#![allow(missing_docs, unreachable_pub, reason = "a test")]

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::harness::{self, Absent, Test};
use crate::plcopen;
use tickbus::driver_cfg::Config;
use tickbus::export::{Target, export};
use tickbus::prepare::{SOURCES, Settings, Source, plcopen_xml, prepare};

pub(crate) const TESTS: &[(&str, Test)] = &[
    (
        "blark_reads_every_source_in_structured_text",
        blark_reads_every_source_in_structured_text,
    ),
    (
        "blark_refuses_a_source_that_is_broken",
        blark_refuses_a_source_that_is_broken,
    ),
    (
        "plcopen_xml_is_valid_under_its_schema",
        plcopen_xml_is_valid_under_its_schema,
    ),
];

/// Writes the sources for `target` to `folder`; returns their paths.
fn write(file: &str, target: Target, folder: &Path) -> Vec<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let config =
        Config::load(&path, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let made = export(&config, target).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let mut sources = Vec::new();
    for file in made.files {
        match Path::new(&file.name).extension().and_then(OsStr::to_str) {
            Some("st") => sources.push(file.text),
            Some("xml") => {
                let (globals, units) = plcopen::structured_text(&file.text);
                sources.push(globals);
                sources.extend(units.into_iter().map(|(_, text)| text));
            }
            _ => {}
        }
    }
    let numbered = sources.iter().enumerate();
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let written = numbered.map(|(number, source)| {
        let path = folder.join(format!("{stem}-{}-{number}.st", target.name()));
        std::fs::write(&path, source).expect("the file is written");
        path
    });
    written.collect()
}

fn reader(files: &[PathBuf]) -> Result<Command, Absent> {
    let mut python = harness::python_with("main", &["blark"])?;
    python
        .arg(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/tests/peers/read_st.py"
        ))
        .args(files);
    Ok(python)
}

fn blark_reads_every_source_in_structured_text() -> Result<(), Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = Vec::new();
    let (codesys, twincat, openplc) = (Target::Codesys, Target::TwinCat, Target::OpenPlc);
    for (file, targets) in [
        // TwinCAT's file differs from the one for CODESYS only in the transfer of records.
        ("driver.cfg", &[codesys, twincat, openplc][..]),
        // A hosted program serves a single station, and OpenPLC has no OPC UA.
        ("tests/export/right/everything.cfg", &[codesys]),
        ("tests/export/right/opcua-client.cfg", &[codesys]),
        ("tests/export/right/loopback-life.cfg", &[codesys, openplc]),
        ("tests/export/right/modbus-server.cfg", &[codesys, openplc]),
        ("plc/peeler/lathe.cfg", &[codesys, openplc]),
    ] {
        for target in targets {
            files.extend(write(file, *target, folder.path()));
        }
    }
    // Programs to put on virtual time, and the blocks for that.
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["timers", "action_control", "scheduler", "example"] {
        files.push(root.join(format!("plc/iec61131/{name}.st")));
    }
    let original = Source {
        name: "rig.st".to_owned(),
        bytes: std::fs::read(root.join("plc/rig/rig.st")).expect("it is there"),
    };
    let made = prepare(&[original], &Settings::default()).expect("it can be prepared");
    files.push(folder.path().join("prepared-rig.st"));
    std::fs::write(files.last().expect("one"), &made.files[0]).expect("the file is written");
    let output = reader(&files)?.output().expect("python runs");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        told.trim(),
        format!("read_st: ok files={} wrong=0", files.len()),
        "{complaint}"
    );
    Ok(())
}

fn blark_refuses_a_source_that_is_broken() -> Result<(), Absent> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = write("driver.cfg", Target::Codesys, folder.path());
    // One correct program next to it is enough.
    files.drain(..files.len() - 2);
    let end = files.last().expect("a program");
    let text = std::fs::read_to_string(end).expect("its text");
    std::fs::write(end, text.replacen(":=", "=:", 1)).expect("the file is written");
    let output = reader(&files)?.output().expect("python runs");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(
        told.trim(),
        format!("read_st: failed files={} wrong=1", files.len())
    );
    Ok(())
}

/// The schema is PLCopen's and may not be redistributed: it is read from the path in `PLCOPEN_XSD`.
fn plcopen_xml_is_valid_under_its_schema() -> Result<(), Absent> {
    let schema = std::env::var_os("PLCOPEN_XSD");
    let why =
        "PLCOPEN_XSD names no tc6_xml_v201.xsd (PLCopen gives it to everybody: plcopen.org, TC6)";
    let schema = schema.ok_or_else(|| Absent(why.to_owned()))?;
    let mut python = harness::python_with("main", &["xmlschema"])?;
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = Vec::new();
    for file in [
        "driver.cfg",
        "tests/export/right/everything.cfg",
        "tests/export/right/modbus-server.cfg",
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        let config =
            Config::load(&path, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        for target in [Target::Codesys, Target::TwinCat] {
            let made = export(&config, target).unwrap_or_else(|mistakes| panic!("{mistakes}"));
            let xml = made
                .files
                .iter()
                .find(|file| {
                    Path::new(&file.name)
                        .extension()
                        .is_some_and(|one| one == "xml")
                })
                .expect("XML");
            // The editors use the namespace of 2.00; the published schema is that of 2.01.
            let text = xml.text.replace("tc6_0200", "tc6_0201");
            let path = folder.path().join(format!("{}-{}", files.len(), xml.name));
            std::fs::write(&path, text).expect("the file is written");
            files.push(path);
        }
    }
    for (name, text) in SOURCES {
        let xml = plcopen_xml(name, text).replace("tc6_0200", "tc6_0201");
        let path = folder.path().join(format!("{name}.xml"));
        std::fs::write(&path, xml).expect("the file is written");
        files.push(path);
    }
    let output = python
        .args(["-c", "import sys, xmlschema\nschema = xmlschema.XMLSchema(sys.argv[1])\nfor file in sys.argv[2:]: schema.validate(file)"])
        .arg(schema)
        .args(&files)
        .output()
        .expect("python runs");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(())
}
