//! C programs compiled by the tests, and a program with its image.

use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;
use tickbus::plc::{HostedProgram, Program, Scan};
use tickbus::time::Nanos;

/// Compiles C files in tests/plc, with the named ones of plc/glue, to a shared object in `folder`.
pub(crate) fn compile(folder: &Path, sources: &[&str], switches: &[&str]) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = folder.join("program.so");
    let status = Command::new("cc")
        .args([
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Werror",
            "-shared",
            "-fPIC",
        ])
        .args(switches)
        .arg("-I")
        .arg(root.join("tests/plc"))
        .arg("-I")
        .arg(root.join("plc/glue"))
        .args(sources.iter().map(|source| root.join(source)))
        .arg("-o")
        .arg(&path)
        .status();
    assert!(status.expect("cc runs").success(), "{sources:?}");
    path
}

/// The hand-written program, with the glue.
pub(crate) fn by_hand(folder: &Path, switches: &[&str]) -> PathBuf {
    compile(
        folder,
        &["tests/plc/by_hand.c", "plc/glue/tickbus_plc.c"],
        switches,
    )
}

pub(crate) fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

pub(crate) fn options(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
    let pairs = pairs.iter();
    pairs
        .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
        .collect()
}

pub(crate) const IEC: (&str, &str) = ("addressing", "iec");

/// A program with its image.
pub(crate) struct Cpu {
    pub(crate) program: HostedProgram,
    pub(crate) inputs: [u8; 10],
    pub(crate) outputs: [u8; 16],
    pub(crate) now: Nanos,
    pub(crate) alive: bool,
}

impl Cpu {
    pub(crate) fn load(path: &Path, pairs: &[(&str, &str)]) -> Self {
        let program = HostedProgram::load(path, &options(pairs));
        Self {
            program: program.unwrap_or_else(|error| panic!("{error}")),
            inputs: [0; 10],
            outputs: [0; 16],
            now: Nanos(7_999_999_999),
            alive: true,
        }
    }

    pub(crate) fn scan(&mut self) {
        self.program.scan(&mut Scan {
            now: self.now,
            alive: self.alive,
            cycle: 0,
            inputs: &self.inputs,
            outputs: &mut self.outputs,
        });
        self.now += Nanos::from_millis(10);
    }

    /// `%QL1`.
    pub(crate) fn long(&self) -> i64 {
        i64::from_be_bytes(self.outputs[8..].try_into().expect("8 bytes"))
    }
}
