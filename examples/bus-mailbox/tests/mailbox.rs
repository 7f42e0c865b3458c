//! The example of a bus passes the tests that every bus passes, and its command offers the bus although nothing in
//! tickbus knows it.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::{env, fs};

use tickbus_base::time::Manual;
use tickbus_conformance::conformance;
use tickbus_conformance::rig::{Bus, Liar};
use tickbus_driver_cfg::{Config, Kind, Kinds};

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_mailbox::Options>()]);

/// A folder that only one test uses.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let prefix = format!("mailbox-{}-", NEXT.fetch_add(1, Ordering::Relaxed));
        let folder = tempfile::Builder::new().prefix(&prefix).tempdir();
        Self(folder.expect("a folder"))
    }
}

impl Bus for Folder {
    fn kinds(&self) -> &'static Kinds {
        &KINDS
    }

    fn fieldbus(&self, _role: &str) -> String {
        format!("kind = \"mailbox\"\nfolder = '{}'", self.0.path().display())
    }

    /// Writes a file with another image.
    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        fs::write(self.0.path().join("outputs"), [1; 30]).expect("written");
        Liar {
            peer: Box::new(()),
            cause: "protocol",
            words: "the peer's file has 30 bytes, expected 16 and an image of 6",
        }
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("kind = \"mailbox\"", "name the folder"),
            ("kind = \"mailbox\"\nfolder = \"\"", "name the folder"),
            ("kind = \"mailbox\"\nfolder = \"x\"\nfloder = 1", "folder"),
        ]
    }
}

conformance!(mailbox, crate::Folder::new());

#[test]
fn check_says_what_the_bus_says_of_itself() {
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"mailbox\"\nfolder = \"box\"\n\
                [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n";
    let config = Config::parse("driver.cfg", text, &KINDS).expect("it is right");
    let told = config.bus.summary(config.role, &config.table);
    assert_eq!(told, ["files in box"]);
    assert_eq!(config.bus.kind(), "mailbox");
}

#[test]
fn the_command_has_the_bus_beside_its_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("driver.cfg");
    for (table, told) in [
        (
            "kind = \"mailbox\"\nfolder = \"box\"",
            "mailbox, files in box",
        ),
        ("kind = \"s7-server\"", "s7-server, "),
    ] {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\n{table}\n\
             [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n"
        );
        fs::write(&file, text).expect("written");
        let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus-with-mailbox"));
        let output = command.arg("check").arg(&file).output().expect("it runs");
        let report = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && report.contains(told), "{report}");
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus-with-mailbox"));
    let schema = command.arg("schema").output().expect("it runs").stdout;
    let schema = String::from_utf8_lossy(&schema);
    for word in ["\"mailbox\"", "The folder of the two files"] {
        assert!(schema.contains(word), "{word}");
    }
}

/// Checks that the bus can be added without forking any of these crates.
#[test]
fn nothing_of_tickbus_names_the_bus() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut open = vec![
        root.join("crates"),
        root.join("src"),
        root.join("Cargo.toml"),
    ];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            let entries = fs::read_dir(path).expect("readable");
            open.extend(entries.map(|entry| entry.expect("readable").path()));
        } else if let Ok(text) = fs::read_to_string(&path) {
            let names = ["tickbus_bus_mailbox", "tickbus-bus-mailbox"];
            let named = names.iter().any(|name| text.contains(name));
            assert!(!named, "{}", path.display());
        }
    }
}
