//! Third-party OPC UA: asyncua in a separate process, and the device that talks to it.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::sync::Arc;

use serde_json::{Value, json};
use tickbus::time::Monotonic;

use crate::harness::{self, Absent};
use tickbus_conformance::rig::{End, logged, patiently};

pub(super) const SIGNALS: &str = r#"
[[signal]]
name    = "run"
address = "%QX0.0"
latch   = "rising"

[[signal]]
name      = "speed"
address   = "%QW2"
type      = "INT"
fail_safe = -1

[[signal]]
name    = "torque"
address = "%QD4"
type    = "REAL"

[[signal]]
name    = "sensor"
address = "%IX0.0"
latch   = "rising"

[[signal]]
name    = "position"
address = "%IW2"
type    = "INT"
unit    = "mm"
scale   = { raw = [0, 27648], value = [0.0, 276.48] }

[[signal]]
name    = "temperature"
address = "%ID4"
type    = "REAL"
unit    = "°C"

[[signal]]
name    = "count"
address = "%IL8"
type    = "ULINT"
"#;

/// A Python program, controlled by lines of text.
pub(crate) struct Peer {
    pub(super) child: Child,
    pub(super) stdin: Option<ChildStdin>,
    pub(super) stdout: BufReader<ChildStdout>,
}

impl Peer {
    /// Starts it; also returns the first line of its output.
    pub(super) fn start(script: &str, asked: &Value) -> Result<(Self, String), Absent> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/peers")
            .join(script);
        let mut child = harness::python_with("main", &["asyncua"])?
            .arg(script)
            .arg(asked.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("it starts");
        let stdin = child.stdin.take();
        let mut stdout = BufReader::new(child.stdout.take().expect("a pipe"));
        let mut line = String::new();
        stdout.read_line(&mut line).expect("it speaks");
        let peer = Self {
            child,
            stdin,
            stdout,
        };
        Ok((peer, line.trim().to_owned()))
    }

    pub(super) fn ready(script: &str, asked: &Value) -> Result<Self, Absent> {
        let (peer, line) = Self::start(script, asked)?;
        assert_eq!(line, "ready", "{script} {asked}");
        Ok(peer)
    }

    #[track_caller]
    pub(crate) fn ask(&mut self, line: &Value) -> Value {
        let stdin = self.stdin.as_mut().expect("it lives");
        writeln!(stdin, "{line}").expect("it listens");
        let mut answer = String::new();
        self.stdout.read_line(&mut answer).expect("it speaks");
        serde_json::from_str(&answer).unwrap_or_else(|why| panic!("{line}: {answer}: {why}"))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The program ends with its stdin.
        drop(self.stdin.take());
        let _ = self.child.wait();
    }
}

/// A free port of this machine.
pub(crate) fn free_address() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("it is bound")
}

/// The nodes of a PLC for `SIGNALS`.
pub(super) fn nodes() -> Value {
    json!({
        "run": ["Boolean", false], "speed": ["Int16", 7], "torque": ["Float", 1.5],
        "sensor": ["Boolean", false], "position": ["Int16", 0], "temperature": ["Float", 0.0],
        "count": ["UInt64", 0],
    })
}

/// An asyncua server with those nodes.
pub(crate) fn plc(address: SocketAddr, more: &Value) -> Result<Peer, Absent> {
    let mut asked = json!({
        "url": format!("opc.tcp://{address}"), "security": ["None"], "nodes": nodes(),
    });
    for (key, value) in more.as_object().into_iter().flatten() {
        asked[key] = value.clone();
    }
    Peer::ready("opcua_server.py", &asked)
}

/// The identity of that server.
pub(crate) const IDENTITY: &str = "urn:test:plc ACME PLC";

pub(super) struct Device {
    pub(super) end: End,
    pub(super) folder: tempfile::TempDir,
}

impl Device {
    pub(super) fn open(kind: &str, keys: &str) -> Self {
        Self::open_in(tempfile::tempdir().expect("a folder"), kind, keys)
    }

    pub(super) fn open_in(folder: tempfile::TempDir, kind: &str, keys: &str) -> Self {
        Self::open_with(folder, kind, keys, SIGNALS)
    }

    pub(super) fn open_with(
        folder: tempfile::TempDir,
        kind: &str,
        keys: &str,
        signals: &str,
    ) -> Self {
        let clock: Arc<Monotonic> = Monotonic::shared();
        // A new folder has no certificate yet.
        logged::expect("made a certificate for \"tickbus Test rig\"");
        let pki = folder.path().join("pki");
        let text = format!(
            "[driver]\nid = 7\nname = \"Test rig\"\n[fieldbus]\nkind = \"{kind}\"\nmax_age = \"2s\"\n\
             reconnect = [\"50ms\"]\npki = {:?}\n{keys}\n{signals}",
            pki.display().to_string()
        );
        let end = End::open(&text, &clock, &tickbus::KINDS);
        Self { end, folder }
    }

    pub(super) fn client(address: SocketAddr, keys: &str) -> Self {
        Self::open(
            "opcua-client",
            &format!("url = \"opc.tcp://{address}\"\n{keys}"),
        )
    }

    /// A client without protection that may write.
    pub(super) fn plain(address: SocketAddr) -> Self {
        Self::client(
            address,
            &format!("security = \"None\"\nwrite_to = \"{IDENTITY}\""),
        )
    }

    pub(super) fn pki(&self) -> PathBuf {
        self.folder.path().join("pki")
    }

    /// The address on which the device listens.
    pub(super) fn address(&self) -> SocketAddr {
        self.end.address()
    }

    /// Ticks until `done` holds.
    #[track_caller]
    pub(super) fn until(&mut self, what: &str, mut done: impl FnMut(&mut End) -> bool) {
        let found = patiently(|| {
            self.end.tick();
            done(&mut self.end).then_some(())
        });
        let reason = || self.end.link().reason;
        found.unwrap_or_else(|| panic!("in vain until {what}: {}", reason()));
    }

    #[track_caller]
    pub(super) fn until_reason(&mut self, words: &str) -> String {
        let mut all = String::new();
        self.until(words, |end| {
            let reason = end.link().reason;
            let said = reason.contains(words);
            if said {
                all = reason;
            }
            said
        });
        all
    }
}
