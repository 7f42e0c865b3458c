//! The bus `ivi-client`: the heads of a reader as stations, each with a command that a toggle bit triggers.

mod session;

use tickbus_base::time::{Nanos, Stop};
use tickbus_base::toml_text::{Key, Shape, Table};
use tickbus_fieldbus::tcp::Call;
use tickbus_fieldbus::{BusError, Free, Port};
use tickbus_image::signal::SignalTable;
use tickbus_net::serial;

use crate::LineOptions;
use crate::heads::HeadNumbers;
use session::Station;

/// The controller's inputs from a head, before the data of the answer.
pub(crate) const INPUTS: [&str; 4] = ["echo", "status", "flags", "length"];

/// The controller's outputs to a head, before the data of the command.
pub(crate) const OUTPUTS: [&str; 4] = ["command", "length", "address", "address"];

/// The lengths of these.
pub(crate) const BEFORE_DATA: [usize; 2] = [INPUTS.len(), OUTPUTS.len()];

/// The status of a command without an answer, which no reader sends: the reader may have executed it.
pub const NO_ANSWER: u8 = 0xFF;

/// The default time-out for an answer, in addition to the time of its characters.
const TIMEOUT: Nanos = Nanos::from_secs(1);

/// The client's own key.
pub(crate) const KEYS: &[Key] = &[Key::new(
    "timeout",
    Shape::Duration,
    "How long the reader may take for an answer, beside the time of its characters",
)
.or("\"1s\"")];

/// The options of the bus `ivi-client`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClientOptions {
    /// The line.
    pub line: LineOptions,
    /// The reader's time for an answer, in addition to the time of its characters.
    pub timeout: Nanos,
    pub(crate) heads: HeadNumbers,
}

impl ClientOptions {
    /// Reads the keys of the bus.
    pub(crate) fn read(table: &mut Table<'_>) -> Option<Self> {
        let line = LineOptions::read(table, false);
        let heads = HeadNumbers::read(table);
        let timeout = table.take("timeout");
        let timeout = timeout.map_or(Some(TIMEOUT), |value| value.duration());
        Some(Self {
            line: line?,
            heads: heads?,
            timeout: timeout?,
        })
    }
}

/// The bus of kind `ivi-client`.
#[derive(Debug)]
pub(crate) struct IviClient {
    options: ClientOptions,
    cycle: Nanos,
    /// Kept when the line breaks: no command is sent twice.
    stations: Vec<Station>,
}

impl IviClient {
    pub(crate) fn new(options: &ClientOptions, table: &SignalTable, cycle: Nanos) -> Self {
        let stations = table.stations.iter().enumerate();
        let stations = stations
            .map(|(index, station)| Station::new(options.heads.of(index), station.input_bytes));
        Self {
            options: options.clone(),
            cycle,
            stations: stations.collect(),
        }
    }
}

impl Free for IviClient {
    fn last_cycles(&self) -> u32 {
        // A reader gets commands, and keeps no outputs.
        0
    }

    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let line = &self.options.line;
        let mut call = Call::new(serial::open(&line.device, line.settings())?);
        port.tell("device", &line.device);
        port.opening(&format!("asking the reader on {}", line.device));
        let now = port.clock().now();
        let mut session = session::Session::new(&self.options, &mut self.stations, self.cycle, now);
        call.run(&mut session, port, stop)
    }
}
