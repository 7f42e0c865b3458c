//! The machine in front of a foreign program: a driver in real time, with its signals by name.

use std::io::Read;
use std::net::SocketAddr;
use std::ops::{Deref, DerefMut};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use tickbus::time::{Clock, Monotonic};
use tickbus_conformance::rig::{End, PATIENCE, patiently};

use super::recorder::Recorder;

/// The signals at both ends of most tests.
pub const SIGNALS: &str = r#"
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

[[signal]]
name    = "position"
address = "%IW2"
type    = "INT"

[[signal]]
name    = "pressure"
address = "%ID4"
type    = "REAL"
"#;

/// A driver, and the recorder of its sessions.
pub struct Machine {
    pub end: End,
    text: String,
    recorder: Option<Recorder>,
}

impl Deref for Machine {
    type Target = End;

    fn deref(&self) -> &End {
        &self.end
    }
}

impl DerefMut for Machine {
    fn deref_mut(&mut self) -> &mut End {
        &mut self.end
    }
}

impl Machine {
    /// Opens the driver of a driver.cfg, in real time.
    #[track_caller]
    pub fn open(text: &str) -> Self {
        Self::open_on(&Monotonic::shared(), text)
    }

    #[track_caller]
    pub fn open_on<C: Clock + 'static>(clock: &Arc<C>, text: &str) -> Self {
        Self {
            end: End::open(text, clock, &tickbus::KINDS),
            text: text.to_owned(),
            recorder: None,
        }
    }

    pub fn tick(&mut self) {
        self.end.tick();
        if let Some(recorder) = &self.recorder {
            recorder.ticked(&self.end.slots);
        }
    }

    /// Ticks until `done` returns something.
    #[track_caller]
    pub fn until_some<T>(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> Option<T>) -> T {
        let found = patiently(|| {
            self.tick();
            done(self)
        });
        found.unwrap_or_else(|| panic!("in vain until {what}\n{}", self.driver.statistics()))
    }

    /// Ticks until `done` holds.
    #[track_caller]
    pub fn until(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> bool) {
        self.until_some(what, |machine| done(machine).then_some(()));
    }

    /// The address for a foreign client: that of the driver, or, if sessions are recorded, that of a tap in front of
    /// it, which records the session `name` with `client`.
    #[track_caller]
    pub fn address_for(&mut self, name: &str, client: &str) -> SocketAddr {
        let server = self.address();
        let Some(folder) = Recorder::folder() else {
            return server;
        };
        let (recorder, address) = Recorder::before(server, &folder, name, client, self);
        self.recorder = Some(recorder);
        address
    }

    /// The driver.cfg with which the machine was opened.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Runs a program to its end, which must be a success, repeating `step` meanwhile; returns its output.
    #[track_caller]
    pub fn until_the_end_of(&mut self, mut command: Command, step: impl Fn(&mut Self)) -> String {
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it starts");
        let out: Box<dyn Read + Send> = Box::new(child.stdout.take().expect("a pipe"));
        let errors: Box<dyn Read + Send> = Box::new(child.stderr.take().expect("a pipe"));
        let (sender, output) = channel();
        for mut pipe in [out, errors] {
            let sender = sender.clone();
            std::thread::spawn(move || {
                let mut text = String::new();
                let _ = pipe.read_to_string(&mut text);
                let _ = sender.send(text);
            });
        }
        drop(sender);
        let (mut told, limit) = (String::new(), Instant::now() + PATIENCE);
        // Both pipes are closed when it ends.
        loop {
            match output.recv_timeout(Duration::from_millis(1)) {
                Ok(text) => told += &text,
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) if Instant::now() > limit => drop(child.kill()),
                Err(RecvTimeoutError::Timeout) => step(self),
            }
        }
        let status = child.wait().expect("it is ours");
        let statistics = self.driver.statistics();
        assert!(status.success(), "{status}: {told}\n{statistics}");
        told
    }
}
