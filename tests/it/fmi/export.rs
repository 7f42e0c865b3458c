//! `tickbus export --for fmi2` and `fmi3`.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::Read as _;
use std::path::Path;
use std::process::Output;

use tickbus::driver_cfg::Config;
use tickbus::fmi::{Version, foreign::Model, made};
use zip::ZipArchive;

use crate::fmi::fixture::{err, library, out, repository, tickbus};

fn export(folder: &Path, arguments: &[&str]) -> Output {
    let library = library();
    let library = library.to_str().expect("UTF-8");
    tickbus(
        folder,
        &[&["export", "driver.cfg", "--library", library], arguments].concat(),
    )
}

fn names(fmu: &Path) -> BTreeSet<String> {
    let archive = ZipArchive::new(File::open(fmu).expect("the FMU")).expect("an archive");
    archive.file_names().map(str::to_owned).collect()
}

fn text(fmu: &Path, name: &str) -> String {
    let mut archive = ZipArchive::new(File::open(fmu).expect("the FMU")).expect("an archive");
    let mut text = String::new();
    let mut entry = archive.by_name(name).expect("it is there");
    entry.read_to_string(&mut text).expect("text");
    text
}

const LOOPBACK: &str = "[driver]\nid = 7\nname = \"2 Tanks, ä\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\nmode = \"stepped\"\n\
                        [[signal]]\nname = \"Valve\"\naddress = \"%QX0.0\"\n[[signal]]\nname = \"pace\"\naddress = \"%IX0.0\"\n";

/// Every type, with `tests/fmi/types-fmi2.xml` and `types-fmi3.xml`. If the environment variable `BLESS` is set, they are
/// rewritten: review the difference before committing it.
#[test]
fn model_descriptions_are_their_golden_files() {
    let folder = repository().join("tests/fmi");
    let path = folder.join("types.cfg");
    let config =
        Config::load(&path, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    for version in Version::ALL {
        let made = made::model_description(&config, version, "{token}");
        let golden = folder.join(format!("types-{}.xml", version.name()));
        if std::env::var_os("BLESS").is_some() {
            fs::write(&golden, &made).expect("the file is written");
        }
        let expected = fs::read_to_string(&golden).unwrap_or_default();
        assert!(made == expected, "{} differs:\n{made}", golden.display());
        // Read back by the reader for foreign FMUs: names and references are complete.
        let model = Model::parse("made", &made).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        // The elements of an array have the reference of the array.
        let variables = model.variables.iter();
        let firsts = variables.filter(|one| !one.is_element() || one.name.ends_with("[1]"));
        let listed: Vec<u32> = firsts.map(|one| one.reference).collect();
        let references: BTreeSet<u32> = listed.iter().copied().collect();
        let names: BTreeSet<&str> = model.variables.iter().map(|one| &*one.name).collect();
        assert_eq!(references.len(), listed.len());
        assert_eq!(names.len(), model.variables.len());
    }
}

#[test]
fn an_fmu_has_library_driver_cfg_and_what_that_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = LOOPBACK.replace(
        "name = \"2 Tanks, ä\"",
        "name = \"2 Tanks, ä\"\nfaults = \"more/faults.toml\"",
    );
    fs::write(folder.path().join("driver.cfg"), &config).expect("a file");
    fs::create_dir(folder.path().join("more")).expect("a folder");
    let fault = "[[fault]]\nkind = \"stuck\"\nsignal = \"Valve\"\nvalue = true\nat = \"1s\"\n";
    fs::write(folder.path().join("more/faults.toml"), fault).expect("a file");
    for (version, binary) in [
        ("fmi2", "binaries/linux64/_2_Tanks___.so"),
        ("fmi3", "binaries/x86_64-linux/_2_Tanks___.so"),
    ] {
        let output = export(folder.path(), &["--for", version]);
        assert_eq!(output.status.code(), Some(0), "{}", err(&output));
        let fmu = folder.path().join(format!("driver-{version}.fmu"));
        let told = out(&output);
        assert!(
            told.starts_with(&format!(
                "driver-{version}.fmu\nexport: ok for={version} files=1 variables="
            )),
            "{told}"
        );
        assert_eq!(
            names(&fmu),
            [
                "modelDescription.xml",
                binary,
                "resources/driver.cfg",
                "resources/more/faults.toml",
                "documentation/externalDependencies.txt"
            ]
            .map(str::to_owned)
            .into()
        );
        assert_eq!(text(&fmu, "resources/driver.cfg"), config);
        // A signal has the name of a parameter.
        let description = text(&fmu, "modelDescription.xml");
        assert!(
            description.contains("name=\"bus.pace\"") && description.contains("name=\"pace\""),
            "{description}"
        );
        // Twice: the bytes are equal, and nothing is overwritten unless requested.
        let first = fs::read(&fmu).expect("the FMU");
        let again = export(folder.path(), &["--for", version]);
        assert_eq!(again.status.code(), Some(1));
        assert!(
            err(&again).contains("this file is there already; name another --out, or add --force"),
            "{}",
            err(&again)
        );
        let again = export(folder.path(), &["--for", version, "--force"]);
        assert_eq!(again.status.code(), Some(0), "{}", err(&again));
        assert!(
            fs::read(&fmu).expect("the FMU") == first,
            "two exports differ"
        );
    }
}

#[test]
fn what_cannot_be_packed_says_why() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("driver.cfg");
    let bus = |table: &str| {
        LOOPBACK.replace(
            "kind = \"loopback\"\nprogram = \"mirror\"\nmode = \"stepped\"\n",
            table,
        )
    };
    for (config, words) in [
        (
            bus("kind = \"plugin\"\nlibrary = \"../card.so\"\n"),
            "../card.so is outside of the folder of driver.cfg; copy it beside driver.cfg",
        ),
        (
            bus("kind = \"plugin\"\nlibrary = \"card.so\"\n"),
            "card.so cannot be read: ",
        ),
        (
            bus("kind = \"opcua-client\"\nurl = \"opc.tcp://127.0.0.1\"\n"),
            "pki has keys or passwords, and an FMU goes through many hands; name it by an absolute path",
        ),
        (
            bus(
                "kind = \"opcua-client\"\nurl = \"opc.tcp://127.0.0.1\"\npki = \"/etc/pki\"\nuser = \"rig\"\n\
                 password_in_clear = \"hunter2\"\n",
            ),
            "driver.cfg has a password (password_in_clear), and an FMU goes through many hands; write password_env",
        ),
        (
            bus("kind = \"sockt\"\n"),
            "driver.cfg:5:8: bus kind \"sockt\" is unknown",
        ),
    ] {
        fs::write(&file, config).expect("a file");
        let output = export(folder.path(), &["--for", "fmi3"]);
        assert_eq!(output.status.code(), Some(1), "{words}");
        assert!(err(&output).contains(words), "{words}\n{}", err(&output));
        assert!(!folder.path().join("driver-fmi3.fmu").exists());
    }
    // In real time a step waits on its own, and the user gets a note.
    fs::write(&file, bus("kind = \"socket\"\n")).expect("a file");
    let output = export(folder.path(), &["--for", "fmi3"]);
    assert!(
        err(&output).contains(
            "note: the bus \"socket\" runs in real time, so the parameter \"pace\" begins at 1"
        ),
        "{}",
        err(&output)
    );
}

#[test]
fn a_library_that_is_none_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("driver.cfg"), LOOPBACK).expect("a file");
    let with = |library: &str, more: &[&str]| {
        let output = tickbus(
            folder.path(),
            &[
                &[
                    "export",
                    "driver.cfg",
                    "--for",
                    "fmi2",
                    "--library",
                    library,
                ],
                more,
            ]
            .concat(),
        );
        assert_eq!(output.status.code(), Some(1));
        err(&output)
    };
    assert!(with("none.so", &[]).contains("none.so cannot be read: "));
    assert!(with("driver.cfg", &[]).contains("driver.cfg is no library for Linux, Windows or macOS on x86-64 or arm64; name the libtickbus.so"));
    assert!(with("/bin/sh", &[]).contains("/bin/sh has no functions of FMI"));
    let own = library();
    let own = own.to_str().expect("UTF-8");
    assert!(
        with(own, &["--library", own])
            .contains("are both for x86_64-linux; name one --library for each platform")
    );
    assert!(
        with(own, &["--out", "x.zip"]).contains(
            "x.zip: importing tools look for files ending in .fmu; write --out x.zip.fmu"
        )
    );
    let output = tickbus(
        folder.path(),
        &["export", "driver.cfg", "--for", "codesys", "--library", own],
    );
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("--library is for fmi2 and fmi3"));
}
