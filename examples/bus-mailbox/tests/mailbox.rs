//! The example of a bus passes what every bus passes, and stands in the list of kinds by one line.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::{env, fs};

use tickbus_base::time::Manual;
use tickbus_conformance::conformance;
use tickbus_conformance::rig::{Bus, Liar};
use tickbus_driver_cfg::Config;

/// A folder used by one test only.
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
    fn fieldbus(&self, _role: &str) -> String {
        format!(
            "kind = \"mailbox\"\nfolder = \"{}\"",
            self.0.path().display()
        )
    }

    /// A file of another image.
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
    let config = Config::parse("driver.cfg", text).expect("it is right");
    let told = config.bus.summary(config.role, &config.table);
    assert_eq!(told, ["files in box"]);
    assert_eq!(config.bus.kind(), "mailbox");
}

/// Every file of the product that names the example, which is how many are touched to add a bus.
#[test]
fn a_bus_is_added_by_its_folder_and_one_line_of_the_list() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut found = Vec::new();
    let mut open = vec![root.join("crates"), root.join("src")];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).expect("readable") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                open.push(path);
            } else if let Ok(text) = fs::read_to_string(&path) {
                let lines = text
                    .lines()
                    .filter(|line| line.contains("tickbus_bus_mailbox"));
                let file = path
                    .strip_prefix(&root)
                    .expect("below")
                    .display()
                    .to_string();
                found.extend(lines.map(|line| (file.replace('\\', "/"), line.trim().to_owned())));
            }
        }
    }
    let file = "crates/driver-cfg/src/kinds.rs".to_owned();
    let line = "Mailbox(tickbus_bus_mailbox::Options),".to_owned();
    assert_eq!(found, [(file, line)]);
}
