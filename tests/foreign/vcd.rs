//! Recordings, read by third-party software.
#![allow(missing_docs, reason = "a test")]

use std::path::Path;

use crate::harness::{self, Absent, Test};
use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::{Area, Slot};
use tickbus::time::{Manual, Nanos};
use tickbus_test_log as logged;

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/read_vcd.py");

/// In addition to the rig's signals: one of each other kind, with names that VCD does not allow.
const MORE: &str = r#"
[[signal]]
name    = "2 Förderband, \"links\""
address = "%ID8"
type    = "REAL"

[[signal]]
name    = "signed"
address = "%IL16"
type    = "LINT"

[[signal]]
name    = "unsigned"
address = "%IL24"
"#;

pub(crate) const TESTS: &[(&str, Test)] = &[(
    "readers_that_others_wrote_read_the_same_from_vcd_and_csv",
    readers_agree,
)];

fn readers_agree() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["vcd", "vcdvcd"])?;
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path(), "run.vcd");
    record(folder.path(), "run.csv");
    let output = python
        .arg(SCRIPT)
        .args([folder.path().join("run.vcd"), folder.path().join("run.csv")])
        .output()
        .expect("it starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    let (told, complaint) = (text(&output.stdout), text(&output.stderr));
    assert!(
        output.status.success() && told.contains("read_vcd: ok ticks=500 variables="),
        "{told}\n{complaint}"
    );
    Ok(())
}

fn record(folder: &Path, file: &str) {
    let rig = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/driver.cfg"))
        .expect("the rig's driver.cfg");
    let signals = &rig[rig.find("[[signal]]").expect("signals")..];
    let text = format!(
        "[driver]\nid = 1\nname = \"Test rig\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"rig\"\n\
         mode = \"stepped\"\n[record]\nfile = \"{file}\"\n{signals}{MORE}"
    );
    let path = folder.join("driver.cfg");
    let config = Config::parse(path.to_str().expect("UTF-8"), &text, &tickbus::KINDS)
        .unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let _logged = logged::Watch::new();
    let mut driver = Driver::open(config, Manual::new()).expect("opens");
    let mut slots = driver.initial_slots();
    let table = driver.config().table.clone();
    let mut random = 1_u64;
    for tick in 1..=500 {
        for (slot, signal) in slots.iter_mut().zip(&table.signals) {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            if signal.area == Area::Input && random >> 61 == 0 {
                *slot = match signal.name.as_str() {
                    "signed" | "unsigned" => Slot(random),
                    "2 Förderband, \"links\"" => Slot::from_real(1.0 / f64::from(tick - 250)),
                    _ if random.is_multiple_of(50) => Slot::from_real(f64::NAN),
                    _ => Slot::from_real(f64::from(u8::from(random & 1024 != 0))),
                };
            }
        }
        driver.exchange(Nanos::from_millis(i64::from(2 * tick)), &mut slots);
    }
    driver.close();
}
