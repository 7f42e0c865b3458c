//! What a driver.cfg says to the bus `modbus-server`.

use crate::line::Line;
use crate::stations::{Stations, Units};
use crate::{INPUTS, Map, Place, Side, table};
use tickbus_base::toml_text::{Collector, Table, Value};
use tickbus_fieldbus::Role;
use tickbus_fieldbus::read_events;
use tickbus_fieldbus::tcp::Address;
use tickbus_image::signal::SignalTable;

use super::super::place::SHAPE;

/// Where a server listens unless a driver.cfg says otherwise: on this machine alone, at a port that needs no
/// privilege.
const ADDRESS: Address = Address::local(1502);

/// The most clients of a server, unless a driver.cfg says otherwise.
const CLIENTS: usize = 1024;

/// What a driver.cfg says to the bus `modbus-server`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServerOptions {
    /// Where it serves.
    pub line: Line,
    /// The frame of `%I`.
    pub input: Side,
    /// The holding register at which `%I` begins once more, if the driver.cfg says so, and where it does.
    pub window: Option<(usize, usize)>,
    /// Which unit each station is.
    pub stations: Stations,
    /// The most clients at once.
    pub clients: usize,
    /// Whether every change that a client makes is reported as an event, beside the image.
    pub events: bool,
    /// Whether every write is, changed or not.
    pub every_write: bool,
}

impl ServerOptions {
    /// Reads the keys of the bus.
    pub fn read(role: Role, mut table: Table<'_>) -> Option<Self> {
        let line = Line::read(&mut table, ADDRESS, |_| Ok(()));
        let unit = table.take("unit");
        let inputs = table.take("inputs");
        let clients = table.take("clients");
        let events = table.take("events");
        table.finish();

        let units = match &line {
            Some(Line::Serial(_)) => Units::ServedOnSerial,
            _ => Units::Tcp,
        };
        let stations = Stations::read(units, unit.as_ref());
        let window = match &inputs {
            None => Some(None),
            Some(value) => read_window(value).map(|window| Some((window, value.at()))),
        };
        let clients = clients.as_ref().map_or(Some(CLIENTS), |value| {
            value
                .whole(1..=10_000)
                .and_then(|clients| usize::try_from(clients).ok())
        });
        let events = events.as_ref().map_or(Some((false, false)), read_events);
        let input = match role {
            Role::Device => Side::Sends,
            Role::Controller => Side::Holds,
        };
        Some(Self {
            line: line?,
            input,
            window: window?,
            stations: stations?,
            clients: clients?,
            events: events?.0,
            every_write: events?.1,
        })
    }
}

impl ServerOptions {
    /// Where the frames of a station lie in the tables, whose `%Q` has so many bytes.
    pub fn map(&self, output_bytes: usize) -> Map {
        let outputs = table::Table::HoldingRegisters.elements(output_bytes);
        // Where %Q reaches so far there is no room for it, and nobody asked for it.
        let usual = (outputs <= INPUTS).then_some(INPUTS);
        Map {
            input: self.input,
            window: self.window.map_or(usual, |(first, _)| Some(first)),
        }
    }

    /// Reports `inputs` that would lie among the registers of `%Q`.
    pub fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        let Some((first, at)) = self.window else {
            return;
        };
        let outputs = table.stations.iter().map(|station| station.output_bytes);
        let outputs = table::Table::HoldingRegisters.elements(outputs.max().unwrap_or_default());
        if first < outputs {
            collector.report(
                at,
                format!(
                    "holding registers up to offset {} are %Q, and %I would begin among them at {first}",
                    outputs - 1
                ),
                format!("begin at offset {outputs} or further on"),
            );
        }
    }
}

/// The holding register at which `%I` begins once more.
fn read_window(value: &Value<'_>) -> Option<usize> {
    let text = value.text(SHAPE)?;
    let place = Place::parse(text, table::Table::HoldingRegisters)
        .map_err(|error| value.wrong(error.what, error.right))
        .ok()?;
    if place.table != table::Table::HoldingRegisters {
        value.wrong(
            format!("\"inputs\" of a server is a {}", place.table.element()),
            "input registers and discrete inputs are %I in any case; write the holding register from \
             which on %I lies among them, too",
        );
        return None;
    }
    Some(place.offset)
}
