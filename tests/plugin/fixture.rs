//! Builds plug-in libraries, and drivers that use them.

use std::fmt::Write as _;
use std::fs;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{self, TryRecvError};
use std::sync::{Arc, OnceLock};

use tempfile::TempDir;
use tickbus::driver::Code;
use tickbus::time::{Manual, Nanos};

use crate::conformance::rig::{Bus, CYCLE, End, Liar, SIGNALS, await_that, logged};

/// The command that helper processes run.
pub(crate) const HELPER: &str = env!("CARGO_BIN_EXE_tickbus");

/// Builds `source` as a shared library, and returns its path. Other test processes may do the same
/// concurrently.
pub(crate) fn build(source: impl AsRef<Path>, switches: &[&str], name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let built = folder.join(format!("{name}.{}", std::process::id()));
    let status = Command::new("cc")
        .args([
            "-std=c99",
            "-pedantic",
            "-O1",
            "-Wall",
            "-Wextra",
            "-Werror",
        ])
        .args(["-fPIC", "-shared"])
        .args(switches)
        .arg("-I")
        .arg(root.join("include"))
        .arg("-o")
        .arg(&built)
        .arg(root.join(&source))
        .status();
    let built_well = status.expect("cc runs").success();
    assert!(built_well, "{}", source.as_ref().display());
    let path = folder.join(name);
    fs::rename(&built, &path).expect("renamed");
    path
}

pub(crate) fn udp() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        build(
            "examples/udp-fieldbus/udp_fieldbus.c",
            &[],
            "libudp_fieldbus.so",
        )
    })
}

pub(crate) fn misbehaving() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| build("tests/plugins/misbehave.c", &[], "libmisbehave.so"))
}

/// A unique address: all of 127.0.0.0/8 is this computer.
pub(crate) fn address() -> String {
    static NEXT: AtomicU32 = AtomicU32::new(1);
    let next = NEXT.fetch_add(1, Ordering::Relaxed);
    assert!(next < 256, "one address for each test");
    let process = std::process::id();
    let [top, high, low] = [process >> 16, process >> 8, process].map(|part| part & 0xFF);
    format!("127.{high}.{low}.{next}:{}", 20_040 + top)
}

/// On a busy computer helper processes are slow.
pub(crate) const PATIENT: &str = "open_timeout = \"1h\"\ncall_timeout = \"1h\"\n";

/// The UDP example, connecting two drivers.
pub(crate) struct Udp {
    address: String,
    isolated: bool,
}

impl Udp {
    pub(crate) fn new(isolated: bool) -> Self {
        Self::at(isolated, &address())
    }

    /// The example whose machine is at this address.
    pub(crate) fn at(isolated: bool, address: &str) -> Self {
        Self {
            address: address.to_owned(),
            isolated,
        }
    }
}

pub(crate) fn isolation(isolated: bool) -> String {
    if isolated {
        format!("isolated = true\nhelper = \"{HELPER}\"\n")
    } else {
        String::new()
    }
}

impl Bus for Udp {
    fn kinds(&self) -> &'static tickbus::driver_cfg::Kinds {
        &tickbus::KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        let (library, isolation) = (udp().display(), isolation(self.isolated));
        let key = if role == "device" { "local" } else { "remote" };
        format!(
            "kind = \"plugin\"\nlibrary = \"{library}\"\noptions = {{ {key} = \"{}\" }}\n\
             timeout = \"1ms\"\n{PATIENT}{isolation}",
            self.address
        )
    }

    /// A controller whose image has another size.
    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        let device = self.address.clone();
        let (running, stopped) = mpsc::channel::<()>();
        std::thread::spawn(move || {
            let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
            let words = [0x5442_5531_u32, 1, 77, 1, 0];
            let mut request: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
            request.extend_from_slice(&[1; 12]);
            while stopped.try_recv() == Err(TryRecvError::Empty) {
                // There is no listener until the device has opened.
                let _ = socket.send_to(&request, &device);
                std::thread::yield_now();
            }
        });
        Liar {
            peer: Box::new(running),
            cause: "protocol",
            words: "libudp_fieldbus.so: an image of 12 bytes came from 127.0.0.1, expected 6 bytes; give",
        }
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("kind = \"plugin\"", "has no \"library\""),
            (
                "kind = \"plugin\"\nlibrary = \"libnone.so\"",
                "libnone.so; check `library`",
            ),
            (
                "kind = \"plugin\"\nlibrary = \"x\"\ncall_timeout = 3",
                "write a duration",
            ),
            (
                "kind = \"plugin\"\nlibrary = \"x\"\noptions = [1]",
                "write them as",
            ),
            (
                "kind = \"plugin\"\nlibrary = \"x\"\nhelper = \"tickbus\"",
                "add isolated = true",
            ),
        ]
    }
}

/// A driver with the misbehaving library; its `%I` values return on `%Q`.
pub(crate) struct Misbehaving {
    pub(crate) folder: TempDir,
    pub(crate) library: PathBuf,
    pub(crate) isolated: bool,
    /// The library's own options.
    pub(crate) options: String,
    /// Further lines for `[fieldbus]`.
    pub(crate) extra: String,
}

impl Misbehaving {
    pub(crate) fn new(isolated: bool, options: &str) -> Self {
        if isolated {
            // The library misbehaves on purpose, and the machine may be busy.
            logged::expect("the helper process has not ended by itself");
        }
        Self {
            folder: tempfile::tempdir().expect("a folder"),
            library: misbehaving().to_owned(),
            isolated,
            options: options.to_owned(),
            extra: PATIENT.to_owned(),
        }
    }

    /// Misbehaves only once.
    pub(crate) fn once(isolated: bool, options: &str) -> Self {
        let mut this = Self::new(isolated, options);
        let once = this.file("once");
        let _ = write!(this.options, ", once = \"{}\"", once.display());
        this
    }

    /// A separate copy of the library, which no other test has loaded.
    pub(crate) fn with_own_library(mut self) -> Self {
        let copy = self.file("libown.so");
        fs::copy(misbehaving(), &copy).expect("copied");
        self.library = copy;
        self
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn text(&self) -> String {
        let (library, isolation) = (self.library.display(), isolation(self.isolated));
        // The pause is long enough for the test to see the failure before the next attempt.
        format!(
            "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"plugin\"\ncycle = \"1ms\"\n\
             max_age = \"300ms\"\nreconnect = [\"1s\"]\nlibrary = \"{library}\"\n\
             options = {{ {} }}\n{isolation}{}\n{SIGNALS}",
            self.options, self.extra
        )
    }

    pub(crate) fn open(&self, clock: &Arc<Manual>) -> End {
        End::open(&self.text(), clock, &tickbus::KINDS)
    }
}

/// Lets time pass until the line is in `state` for `cause`; returns the reason.
#[track_caller]
pub(crate) fn until(end: &End, clock: &Manual, state: &str, cause: &str) -> String {
    until_by(CYCLE, end, clock, state, cause)
}

#[track_caller]
pub(crate) fn until_by(step: Nanos, end: &End, clock: &Manual, state: &str, cause: &str) -> String {
    let mut reason = String::new();
    await_that(&format!("{state}, {cause}"), || {
        clock.advance(step);
        let link = end.link();
        reason = link.reason;
        (link.state.name(), link.cause.name()) == (state, cause)
    });
    reason
}

/// Lets time pass until the sent value has returned.
#[track_caller]
pub(crate) fn until_it_echoes(end: &mut End, clock: &Manual, value: f64) {
    end.set("position", value);
    await_that("the value comes back", || {
        clock.advance(CYCLE);
        end.tick().code == Code::Fresh && end.get("speed") == value
    });
}
