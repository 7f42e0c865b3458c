//! The schema of driver.cfg in taplo, which is what editors use for TOML.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::harness::{Absent, Test};

pub(crate) const TESTS: &[(&str, Test)] = &[(
    "taplo_passes_every_right_file_and_refuses_each_with_an_unknown_or_a_missing_key",
    taplo_agrees,
)];

const CONFIG: &str = "include = [\"**/*.cfg\"]\n[schema]\npath = \"driver.schema.json\"\n";

fn taplo_agrees() -> Result<(), Absent> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    let taplo = repository.join("target/peers/main/bin/taplo");
    if !taplo.exists() {
        return Err(Absent("there is no taplo; run tools/peers".to_owned()));
    }
    let folder = tempfile::tempdir().expect("a folder");
    let schema = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("schema")
        .output()
        .expect("it starts");
    fs::write(folder.path().join("driver.schema.json"), schema.stdout).expect("the schema");
    fs::write(folder.path().join(".taplo.toml"), CONFIG).expect("the configuration");
    let lint = |file: &Path| {
        let copy = folder.path().join(file.file_name().expect("a name"));
        fs::copy(file, &copy).expect("a copy");
        let output = Command::new(&taplo)
            .arg("lint")
            .arg(&copy)
            .current_dir(folder.path())
            .output()
            .expect("it starts");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(told.contains("found files total=1 excluded=0"), "{told}");
        (output.status.success(), told)
    };
    for file in configs(&repository.join("tests/right")) {
        let (is_right, told) = lint(&file);
        assert!(is_right, "{}: {told}", file.display());
    }
    let mut refused = 0;
    for file in configs(&repository.join("tests/wrong")) {
        let mistakes = fs::read_to_string(file.with_extension("txt")).expect("the mistakes");
        let is_structural = |line: &str| {
            line.contains(": unknown key \"")
                || line.contains(": [fieldbus] has no \"")
                || line.contains(": [driver] has no \"")
        };
        if mistakes.lines().any(is_structural) {
            assert!(!lint(&file).0, "{}", file.display());
            refused += 1;
        }
    }
    assert!(refused > 20, "{refused}");
    Ok(())
}

fn configs(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder");
    let files = entries.map(|entry| entry.expect("an entry").path());
    files
        .filter(|file| file.extension().is_some_and(|ending| ending == "cfg"))
        .collect()
}
