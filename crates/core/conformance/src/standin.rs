//! Stand-ins for vendors' libraries: shared libraries that are built from C, record their calls, and follow a script.
//! Their C part is `tests/plugins/standin.h`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex, PoisonError};

use tempfile::TempDir;
use tickbus_base::time::{Manual, Nanos};
use tickbus_fieldbus::Cause;

use crate::rig::{Bus, CYCLE, End, Liar, SIGNALS, await_that};

/// The libraries built so far, by source and switches.
static BUILT: Mutex<BTreeMap<String, Vec<u8>>> = Mutex::new(BTreeMap::new());

/// One stand-in, in a temporary folder.
pub struct StandIn {
    folder: TempDir,
    library: PathBuf,
}

impl StandIn {
    /// Builds `tests/plugins/<source>` with these switches, under the file name `name`.
    pub fn build(source: &str, switches: &[&str], name: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let library = folder.path().join(name);
        let mut built = BUILT.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes = built
            .entry(format!("{source} {switches:?}"))
            .or_insert_with(|| {
                let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../.."));
                let cc = Command::new("cc")
                    .args(["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror"])
                    .args(["-fPIC", "-shared"])
                    .args(switches)
                    .arg("-I")
                    .arg(root.join("include"))
                    .arg("-o")
                    .arg(&library)
                    .arg(root.join("tests/plugins").join(source))
                    .args(["-ldl", "-lpthread"])
                    .output()
                    .expect("a C compiler");
                let told = String::from_utf8_lossy(&cc.stderr);
                assert!(cc.status.success(), "{source}: {told}");
                fs::read(&library).expect("it is built")
            });
        fs::write(&library, bytes).expect("it is written");
        Self { folder, library }
    }

    /// The library's file.
    pub fn library(&self) -> std::path::Display<'_> {
        self.library.display()
    }

    /// The path of a file beside the library.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Makes the library follow these lines from now on.
    pub fn script(&self, lines: &str) {
        // Renaming the file keeps the library from reading half a script.
        let (new, script) = (self.file("new"), self.file("script"));
        fs::write(&new, lines).expect("the script is written");
        fs::rename(new, script).expect("the script is there");
    }

    /// The calls so far; consecutive equal calls count once.
    pub fn calls(&self) -> Vec<String> {
        let calls = fs::read_to_string(self.file("calls")).unwrap_or_default();
        calls.lines().map(str::to_owned).collect()
    }
}

/// A script that ends when this value is dropped.
struct Lie(Arc<StandIn>);

impl Drop for Lie {
    fn drop(&mut self) {
        self.0.script("");
    }
}

/// A driver with this script, which returns results that no real driver returns. The line's reason has these `words`.
pub fn liar(library: &Arc<StandIn>, script: &str, words: &'static str) -> Liar {
    library.script(script);
    Liar {
        peer: Box::new(Lie(Arc::clone(library))),
        cause: "link",
        words,
    }
}

/// Opens the end with `role`, with `extra` lines in its `[fieldbus]` table. A line that fails at first shows the
/// failure for a while.
pub fn open(bus: &impl Bus, role: &str, extra: &str, clock: &Arc<Manual>) -> End {
    let text = format!(
        "[driver]\nid = 1\nname = \"{role}\"\n[fieldbus]\n{}\nrole = \"{role}\"\ncycle = \"1ms\"\n\
         max_age = \"300ms\"\nreconnect = [\"500ms\", \"10ms\"]\n{extra}\n{SIGNALS}",
        bus.fieldbus(role),
    );
    End::open(&text, clock, bus.kinds())
}

/// Lets time pass until the line is in `state` for `cause`; returns the reason.
#[track_caller]
pub fn until(end: &mut End, clock: &Arc<Manual>, state: &str, cause: &str) -> String {
    let mut reason = String::new();
    await_that(&format!("{state}, {cause}"), || {
        clock.advance(CYCLE);
        end.tick();
        let link = end.link();
        reason = link.reason;
        (link.state.name(), link.cause.name()) == (state, cause)
    });
    reason
}

/// Lets time pass in leaps until the call `what` counts as hung. Other calls may count as hung for a moment, since they
/// take some time.
#[track_caller]
pub fn until_it_hangs(end: &End, clock: &Arc<Manual>, what: &str) {
    let right = format!("{what} has not returned for ");
    await_that(&right, || {
        clock.advance(Nanos::from_secs(1));
        let link = end.link();
        link.cause == Cause::Hung && link.reason.starts_with(&right)
    });
}
