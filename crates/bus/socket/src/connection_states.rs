//! Several connections of one driver, combined into the driver's line.

use std::fmt::Write as _;
use std::ops::Range;

use tickbus_fieldbus::{BusError, Port};

/// The state of each connection; the line is running when all of them are.
#[derive(Debug)]
pub(super) struct ConnectionStates(Vec<ConnectionState>);

#[derive(Debug)]
struct ConnectionState {
    /// The name of the station; empty for a single connection.
    name: String,
    stations: Range<usize>,
    running: bool,
    reason: String,
}

impl ConnectionStates {
    /// The connections, each with its name and the stations that it carries.
    pub(super) fn new(lines: impl Iterator<Item = (String, Range<usize>)>) -> Self {
        let line = |(name, stations)| ConnectionState {
            name,
            stations,
            running: false,
            reason: String::new(),
        };
        Self(lines.map(line).collect())
    }

    /// Prefixes a text about a line with its station's name.
    fn labelled(&self, line: usize, text: &str) -> String {
        let ConnectionState { name, .. } = &self.0[line];
        if name.is_empty() {
            text.to_owned()
        } else {
            format!("\"{name}\": {text}")
        }
    }

    /// All reasons, one after another.
    fn reason(&self) -> String {
        let mut text = String::new();
        for (line, ConnectionState { reason, .. }) in self.0.iter().enumerate() {
            if line > 0 {
                text.push_str("; ");
            }
            // Writing to a string cannot fail.
            let _ = write!(text, "{}", self.labelled(line, reason));
        }
        text
    }

    /// Notes the state of a connection, and returns its stations.
    fn note(&mut self, line: usize, running: bool, reason: &str) -> Range<usize> {
        let line = &mut self.0[line];
        line.running = running;
        reason.clone_into(&mut line.reason);
        line.stations.clone()
    }

    pub(super) fn opening(&mut self, line: usize, reason: &str, port: &mut Port) {
        let stations = self.note(line, false, reason);
        port.opening_of(stations, &self.reason());
    }

    pub(super) fn lost(&mut self, line: usize, error: &BusError, next: &str, port: &mut Port) {
        let stations = self.note(line, false, next);
        port.lost_of(stations, error, &self.reason());
    }

    pub(super) fn running(&mut self, line: usize, reason: &str, port: &mut Port) {
        self.note(line, true, reason);
        if self.0.iter().all(|line| line.running) {
            port.running(&self.reason());
        } else {
            // No peer has left: those of other stations are missing still.
            port.opening_of(0..0, &self.reason());
        }
    }
}
