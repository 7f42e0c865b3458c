//! The unit test of libmodbus, a client in C that expects special answers, against a server whose faults make them.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::harness::{self, Absent, Test};

pub(crate) const TESTS: &[(&str, Test)] = &[(
    "its_unit_test_passes_line_by_line",
    its_unit_test_passes_line_by_line,
)];

/// The checks of the client in version 3.1.6 over TCP.
const LINES: usize = 111;

/// A check that can fail on some platforms, by the client's own words.
const UNSURE: &str = "1us response timeout: FAILED (can fail on some platforms)";

/// How often it is tried: some of its checks have time limits that a busy computer exceeds, one of them 7 ms for bytes that
/// come 5 ms apart.
const TRIES: usize = 5;

fn path(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(file)
}

fn its_unit_test_passes_line_by_line() -> Result<(), Absent> {
    let client = path("target/peers/libmodbus/unit-test-client");
    if !client.exists() {
        return Err(Absent(
            "the unit test of libmodbus is not built; run tools/peers".to_owned(),
        ));
    }
    harness::command_with("ip", "-V", "iproute2")?;
    let mut alone = harness::command("unshare", "util-linux")?;
    let may = alone.args(["--map-root-user", "--net", "true"]).status();
    if !may.is_ok_and(|status| status.success()) {
        return Err(Absent(
            "this user can make no network of its own".to_owned(),
        ));
    }
    let mut told = String::new();
    for _ in 0..TRIES {
        let output = Command::new(path("tests/peers/libmodbus/run"))
            .arg(env!("CARGO_BIN_EXE_tickbus"))
            .arg(&client)
            .output()
            .expect("it runs");
        told = String::from_utf8_lossy(&output.stdout).into_owned();
        let lines = told.lines().filter(|line| line.ends_with("OK")).count();
        let unsure = told.contains(UNSURE);
        if output.status.success() {
            assert_eq!(lines + usize::from(unsure), LINES, "{told}");
            assert!(told.contains("ALL TESTS PASS WITH SUCCESS"), "{told}");
            return Ok(());
        }
    }
    panic!("it fails each time: {told}")
}
