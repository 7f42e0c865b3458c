//! Exports in Structured Text under the eyes of a parser that somebody else wrote: blark.
#![allow(missing_docs, unreachable_pub, reason = "a test")]

mod foreign;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use foreign::Absent;
use tickbus::driver::Config;
use tickbus::export::{Target, export};

fn main() -> ExitCode {
    foreign::main(&[
        (
            "blark_reads_every_source_in_structured_text",
            blark_reads_every_source_in_structured_text,
        ),
        (
            "blark_refuses_a_source_that_is_broken",
            blark_refuses_a_source_that_is_broken,
        ),
    ])
}

/// Writes the sources for `target` into `folder`; where they are.
fn write(file: &str, target: Target, folder: &Path) -> Vec<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let config = Config::load(&path).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let made = export(&config, target).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let sources = made
        .files
        .iter()
        .filter(|file| Path::new(&file.name).extension() == Some("st".as_ref()));
    let written = sources.map(|source| {
        let path = folder.join(format!("{}-{}", target.name(), source.name));
        std::fs::write(&path, &source.text).expect("the file is written");
        path
    });
    written.collect()
}

fn reader(files: &[PathBuf]) -> Result<Command, Absent> {
    let mut python = foreign::python_with("main", &["blark"])?;
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
    for file in [
        "driver.cfg",
        "tests/export/right/everything.cfg",
        "tests/export/right/modbus-server.cfg",
        "plc/peeler/lathe.cfg",
    ] {
        for target in [Target::Codesys, Target::OpenPlc] {
            files.extend(write(file, target, folder.path()));
        }
    }
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
    let files = write("driver.cfg", Target::Codesys, folder.path());
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
