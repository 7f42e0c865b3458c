//! The bus of kind `s7-client`: the peer is a CPU, whose memory this end reads and writes.

mod connection;
mod dialog;
mod frames;
mod options;
mod plan;
mod refusal;
mod terms;
mod traffic;

use tickbus_base::os::Poller;
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::Rarely;
use tickbus_fieldbus::tcp::{self, no_wait};
use tickbus_fieldbus::{BusError, CYCLE, Free, Guard, PlcState, Port, Role};
use tickbus_image::signal::SignalTable;

use connection::Connection;
pub use dialog::Dialog;
pub use frames::Frames;
pub use options::ClientOptions;
pub use refusal::Refusal;
pub use terms::{End, News, Terms};

/// How long an answer may take at least; in other cases four times `max_age`.
const PATIENCE: Nanos = Nanos::from_secs(2);

/// The bus of kind `s7-client`.
#[derive(Debug)]
pub struct S7Client {
    options: ClientOptions,
    cycle: Nanos,
    frames: Frames,
    /// The stations' names, for messages.
    names: Vec<String>,
    guard: Guard,
    /// Asking who the CPU is, and whether it runs.
    identity: Question,
    state: Question,
    /// What the CPU said last of whether it runs, and how often in a row it has not answered that since.
    said: Option<PlcState>,
    untold: u8,
    /// Whether the log knows that it does not say.
    told_unknown: bool,
    /// What the log knows of that the CPU refuses, by station.
    told_refusals: Vec<String>,
    rarely: Rarely,
}

/// A question about the system that some CPUs answer by hanging up, or not at all.
#[derive(Clone, Copy, Debug, Default)]
struct Question {
    /// How many times in a row.
    unanswered: u8,
}

impl Question {
    /// After so many of them it is not asked, for one connection.
    const LIMIT: u8 = 2;

    /// Whether it is asked in the connection that begins. The one after that asks once more.
    fn is_asked(&mut self) -> bool {
        let is_asked = self.unanswered < Self::LIMIT;
        self.unanswered = self.unanswered.min(Self::LIMIT - 1);
        is_asked
    }
}

impl S7Client {
    /// The bus that `options` describe, for the end with `role`, with a bus cycle of `cycle` if one is stated.
    pub fn new(
        options: &ClientOptions,
        table: &SignalTable,
        role: Role,
        cycle: Option<Nanos>,
    ) -> Self {
        let names = table.stations.iter().map(|station| station.name.clone());
        Self {
            frames: Frames::new(options, table, role),
            names: names.collect(),
            guard: Guard::new(options.write_to.as_deref()),
            cycle: cycle.unwrap_or(CYCLE),
            identity: Question::default(),
            state: Question::default(),
            said: None,
            untold: 0,
            told_unknown: false,
            told_refusals: vec![String::new(); table.stations.len()],
            rarely: Rarely::default(),
            options: options.clone(),
        }
    }
}

impl Free for S7Client {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        self.guard.part();
        let mut poller = Poller::new(stop).map_err(|error| no_wait(&error))?;
        let reached = tcp::connect(&self.options.address, &mut poller, port, stop)?;
        let Some((stream, peer)) = reached else {
            return Ok(());
        };
        let patience = port.max_age().times(4).max(PATIENCE);
        tcp::prepare(&stream, patience).map_err(|error| {
            BusError::Link(format!("the connection with {peer} broke at once: {error}"))
        })?;
        port.opening(&format!("connected with {peer}; waiting for its answer"));
        let terms = Terms {
            calling: self.options.calling,
            called: self.options.called,
            pdu: self.options.pdu,
            patience,
            asks_who: self.identity.is_asked(),
        };
        let mut connection = Connection::new(self, stream, peer, terms, port);
        let mut is_ready = (false, false);
        while !stop.is_stopped() {
            if let Err(error) = connection.turn(is_ready, port) {
                connection.end();
                return Err(error);
            }
            let mut sources = [connection.source()];
            let deadline = connection.deadline(port);
            poller
                .wait(&**port.clock(), deadline, &mut sources)
                .map_err(|error| no_wait(&error))?;
            is_ready = (sources[0].is_readable(), sources[0].is_writable());
        }
        Ok(())
    }
}
