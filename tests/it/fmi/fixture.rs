//! FMUs for the tests, and the command that runs them.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use tempfile::TempDir;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

pub(crate) fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs `tickbus` with these arguments in `folder`.
pub(crate) fn tickbus(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the tickbus program runs")
}

pub(crate) fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub(crate) fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Makes what a test program needs many times, and returns its folder: one under `target/tmp`, which the next run uses again,
/// because a `TempDir` in a static is never dropped. `make` fills another folder, whose files then replace the old ones
/// whole, so that two programs can run at once.
pub(crate) fn made(name: &str, make: impl FnOnce(&Path)) -> PathBuf {
    let all = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let folder = all.join(format!("{}-{name}", env!("CARGO_CRATE_NAME")));
    std::fs::create_dir_all(&folder).expect("a folder");
    let fresh = tempfile::tempdir_in(all).expect("a folder");
    make(fresh.path());
    for file in std::fs::read_dir(fresh.path()).expect("its files") {
        let file = file.expect("a file");
        std::fs::rename(file.path(), folder.join(file.file_name())).expect("the same disk");
    }
    folder
}

/// The native library that cargo has built for this test, beside or above its program; without debug tables if `strip` is
/// installed.
pub(crate) fn library() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let name = libloading::library_filename("tickbus");
        let test = std::env::current_exe().expect("a test has a path");
        let mut places = test.ancestors().skip(1).take(2).map(|dir| dir.join(&name));
        let built = places
            .find(|place| place.exists())
            .expect("cargo has built it");
        let folder = made("stripped", |folder| {
            let stripped = Command::new("strip")
                .arg("-o")
                .arg(folder.join(&name))
                .arg(&built)
                .status();
            if !stripped.is_ok_and(|status| status.success()) {
                std::fs::copy(&built, folder.join(&name)).expect("a copy");
            }
        });
        folder.join(name)
    })
}

/// The example's two FMUs, built once: the folder with tank2.fmu and tank3.fmu.
pub(crate) fn tanks() -> &'static Path {
    static TANKS: OnceLock<PathBuf> = OnceLock::new();
    TANKS.get_or_init(|| {
        made("tanks", |folder| {
            let built = Command::new(repository().join("examples/fmu-tank/build"))
                .arg(folder)
                .output()
                .expect("it runs");
            assert!(built.status.success(), "{}", err(&built));
            for file in ["tank.cfg", "tank.toml"] {
                let from = repository().join("examples/fmu-tank").join(file);
                std::fs::copy(from, folder.join(file)).expect("a copy");
            }
        })
    })
}

/// Compiles a C file of tests/fmi, and returns its library.
fn compiled(name: &str) -> PathBuf {
    let library = format!("{name}.so");
    let folder = made(name, |folder| {
        let compiled = Command::new("cc")
            .args(["-std=gnu99", "-Wall", "-fPIC", "-shared", "-o"])
            .arg(folder.join(&library))
            .arg(repository().join("tests/fmi").join(format!("{name}.c")))
            .output()
            .expect("the compiler runs");
        assert!(compiled.status.success(), "{}", err(&compiled));
    });
    folder.join(library)
}

/// The library of `misbehave.c`, compiled once.
pub(crate) fn misbehaving() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| compiled("misbehave"))
}

/// The library of `sampler.c`, compiled once.
pub(crate) fn sampling() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| compiled("sampler"))
}

/// A model description of FMI 2.0 with an input and an output of type Real.
pub(crate) fn description(guid: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<fmiModelDescription fmiVersion=\"2.0\" modelName=\"It\" guid=\"{guid}\">\n\
         <CoSimulation modelIdentifier=\"it\"/>\n<ModelVariables>\n\
         <ScalarVariable name=\"Speed\" valueReference=\"0\" causality=\"input\"><Real start=\"0\"/></ScalarVariable>\n\
         <ScalarVariable name=\"Level\" valueReference=\"1\" causality=\"output\"><Real/></ScalarVariable>\n\
         </ModelVariables>\n<ModelStructure/>\n</fmiModelDescription>\n"
    )
}

/// The driver.cfg of that FMU.
pub(crate) const CONFIG: &str = "[driver]\nid = 1\nname = \"It\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
    mode = \"stepped\"\nscan = \"10ms\"\n[[signal]]\nname = \"Level\"\naddress = \"%ID0\"\ntype = \"REAL\"\n\
    [[signal]]\nname = \"Speed\"\naddress = \"%QD0\"\ntype = \"REAL\"\n";

/// An entry of an archive.
pub(crate) enum Entry<'a> {
    File(&'a str, &'a [u8]),
    Link(&'a str, &'a str),
}

/// Writes an archive.
pub(crate) fn archive(path: &Path, entries: &[Entry<'_>]) {
    let mut zip = ZipWriter::new(File::create(path).expect("a file"));
    let options = SimpleFileOptions::default();
    for entry in entries {
        match entry {
            Entry::File(name, bytes) => {
                zip.start_file(*name, options).expect("a name");
                zip.write_all(bytes).expect("room");
            }
            Entry::Link(name, target) => zip.add_symlink(*name, *target, options).expect("a link"),
        }
    }
    zip.finish().expect("room");
}

/// A folder with `it.fmu`, which misbehaves in this way, and its `it.cfg`.
pub(crate) fn misbehaving_as(how: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let library = std::fs::read(misbehaving()).expect("the library");
    archive(
        &folder.path().join("it.fmu"),
        &[
            Entry::File("modelDescription.xml", description(how).as_bytes()),
            Entry::File("binaries/linux64/it.so", &library),
        ],
    );
    std::fs::write(folder.path().join("it.cfg"), CONFIG).expect("a file");
    folder
}
