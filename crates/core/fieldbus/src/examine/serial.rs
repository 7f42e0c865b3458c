//! The steps that all serial lines have in common: device, access, settings, and what is on the line.

use std::io::{ErrorKind, Read as _};
use std::path::Path;

use tickbus_base::os::{SerialPort, SerialSettings};
use tickbus_base::time::Nanos;
use tickbus_net::serial_users::{group, is_no_device, is_pseudo_terminal, ports, users};

use super::Examination;

/// The most ports that a report lists.
const MOST_PORTS: usize = 8;

/// How often a line is read while it is overheard.
const TURN: Nanos = Nanos::from_millis(1);

impl Examination<'_> {
    /// Opens a serial port: the steps `device`, `access` and `settings`. `None` if one has failed.
    pub fn reach_serial(&mut self, device: &str, settings: SerialSettings) -> Option<SerialPort> {
        let path = Path::new(device);
        if is_no_device(path) {
            let next = "name a serial port, such as \"/dev/ttyUSB0\"";
            let evidence = format!("{device} is no device");
            self.fail("device", "no-serial-port", evidence, next);
            return None;
        }
        let opened = SerialPort::open(path, settings);
        let kind = opened.as_ref().err().map(std::io::Error::kind);
        if kind == Some(ErrorKind::NotFound) {
            self.missing(device);
            return None;
        }
        self.ok("device", format!("{device} is there"));
        let users = users(path);
        match opened {
            Ok(port) => {
                if let [first, ..] = &users[..]
                    && !is_pseudo_terminal(path)
                {
                    let next = "end it: two programs on one port take each other's bytes";
                    let evidence = format!("{first} has {device} open as well");
                    self.warn("access", "device-shared", evidence, next);
                } else {
                    self.ok("access", "it can be opened, and nobody else uses it");
                }
                self.ok("settings", settings.to_string());
                Some(port)
            }
            Err(error) => {
                self.closed_port(device, settings, &error, &users);
                None
            }
        }
    }

    fn missing(&mut self, device: &str) {
        let ports = ports();
        let next = if ports.is_empty() {
            "plug the adapter in: this computer lists no serial port"
        } else {
            "plug the adapter in, or write one of these ports"
        };
        let evidence = format!("{device} does not exist");
        let step = self.fail("device", "device-missing", evidence, next);
        let shown = ports.iter().take(MOST_PORTS);
        step.details = shown.map(|port| port.display().to_string()).collect();
    }

    /// Says why a port that is there does not open.
    fn closed_port(
        &mut self,
        device: &str,
        settings: SerialSettings,
        error: &std::io::Error,
        users: &[String],
    ) {
        match error.kind() {
            ErrorKind::PermissionDenied => {
                let group = group(Path::new(device)).unwrap_or_else(|| "dialout".to_owned());
                self.fail(
                    "access",
                    "device-forbidden",
                    format!("this user may not use {device}, which belongs to the group {group}"),
                    &format!("sudo usermod -aG {group} $USER, then log out and in again"),
                );
            }
            ErrorKind::ResourceBusy => {
                let who = match users {
                    [] => "another program, perhaps of another user,".to_owned(),
                    users => users.join(", "),
                };
                self.fail(
                    "access",
                    "device-taken",
                    format!("{who} has {device} open"),
                    "end it; if it is your simulation, the port is as it should be",
                );
            }
            _ => {
                self.fail(
                    "settings",
                    "settings-refused",
                    format!("{device} does not accept {settings} ({error})"),
                    "check that it is a serial port, and write a baud rate and a parity that it has",
                );
            }
        }
    }

    /// Passes on what comes on a line within `span` without a question, each piece with its time, and no bytes while nothing
    /// comes.
    pub fn overhear(
        &self,
        port: &mut SerialPort,
        span: Nanos,
        mut heard: impl FnMut(Nanos, &[u8]),
    ) {
        let clock = self.setup.clock;
        let end = clock.now() + span;
        let mut bytes = [0; 1024];
        while clock.now() < end && !self.stop.is_stopped() {
            let count = port.read(&mut bytes).unwrap_or_default();
            heard(clock.now(), &bytes[..count]);
            if count == 0 {
                clock.wait_until(end.min(clock.now() + TURN), self.stop);
            }
        }
    }
}
