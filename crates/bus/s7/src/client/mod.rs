//! The bus of kind `s7-client`: reads and writes the memory of a CPU.

mod connection;
mod examine;
mod frames;
mod in_flight;
mod options;
mod parameters;
mod plan;
mod refusal;
mod search;
mod session;
mod traffic;

use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::Rarely;
use tickbus_fieldbus::tcp;
use tickbus_fieldbus::{BusError, CYCLE, Free, Medium, PlcState, Port, Role, WriteGuard};
use tickbus_image::signal::SignalTable;

use connection::Connection;
pub use frames::FrameFields;
pub use options::ClientOptions;
pub(crate) use options::IDENTITY_LIMIT;
pub use parameters::{ConnectionParameters, End, SessionEvent};
pub use refusal::Refusal;
pub(crate) use search::SEARCH;
pub use session::ClientSession;

/// The shortest time-out of an answer; otherwise it is four times `max_age`.
const PATIENCE: Nanos = Nanos::from_secs(2);

/// The bus of kind `s7-client`.
#[derive(Debug)]
pub struct S7Client {
    options: ClientOptions,
    cycle: Nanos,
    frames: FrameFields,
    /// The stations' names, for messages.
    names: Vec<String>,
    guard: WriteGuard,
    /// The requests for the CPU's identity and operating state.
    identity: ListRequest,
    state: ListRequest,
    /// The last operating state that the CPU reported, and how often in a row it has not answered since.
    said: Option<PlcState>,
    untold: u8,
    /// True if the missing operating state was logged.
    told_unknown: bool,
    /// The refusals that were logged, by station.
    told_refusals: Vec<String>,
    rarely: Rarely,
}

/// A request to which some CPUs respond by closing the connection, or not at all.
#[derive(Clone, Copy, Debug, Default)]
struct ListRequest {
    /// How many times in a row it was not answered.
    unanswered: u8,
}

impl ListRequest {
    /// After this many times it is omitted for one connection.
    const LIMIT: u8 = 2;

    /// True if the request is to be sent on the connection that starts. If omitted, the next connection tries it once
    /// more.
    fn is_asked(&mut self) -> bool {
        let is_asked = self.unanswered < Self::LIMIT;
        self.unanswered = self.unanswered.min(Self::LIMIT - 1);
        is_asked
    }
}

impl S7Client {
    /// The bus that `options` describe, for the end with `role`, with a bus cycle of `cycle` if stated.
    pub fn new(
        options: &ClientOptions,
        table: &SignalTable,
        role: Role,
        cycle: Option<Nanos>,
    ) -> Self {
        let names = table.stations.iter().map(|station| station.name.clone());
        Self {
            frames: FrameFields::new(options, table, role),
            names: names.collect(),
            guard: WriteGuard::of(role, options.write_to.as_deref()),
            cycle: cycle.unwrap_or(CYCLE),
            identity: ListRequest::default(),
            state: ListRequest::default(),
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
        let patience = port.max_age().times(4).max(PATIENCE);
        let reached = tcp::dial(&self.options.address, patience, port, stop)?;
        let Some((mut call, peer)) = reached else {
            return Ok(());
        };
        port.carried_by(Medium::Tcp);
        port.opening(&format!("connected with {peer}; waiting for its answer"));
        let terms = ConnectionParameters {
            calling: self.options.calling,
            called: self.options.called,
            pdu: self.options.pdu,
            patience,
            asks_who: self.identity.is_asked(),
        };
        let mut connection = Connection::new(self, peer, terms, port);
        let ended = call.run(&mut connection, port, stop);
        if ended.is_err() {
            connection.end();
        }
        ended
    }
}
