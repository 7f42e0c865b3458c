//! What a driver.cfg says to the bus `modbus-server`.

use crate::config::{Table, Value};
use crate::fieldbus::Role;
use crate::fieldbus::modbus::line::Line;
use crate::fieldbus::modbus::stations::{Stations, Units};
use crate::fieldbus::modbus::{CONTROLLER_INPUTS, Map, Place, Side, table};
use crate::fieldbus::options::read_events;
use crate::fieldbus::tcp::Address;

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
    /// Where the frames lie in the tables.
    pub map: Map,
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
    pub(in crate::fieldbus) fn read(role: Role, mut table: Table<'_>) -> Option<Self> {
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
            None => Some(match role {
                Role::Device => None,
                Role::Controller => Some(CONTROLLER_INPUTS),
            }),
            Some(value) => read_window(value).map(Some),
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
            map: Map {
                input,
                window: window?,
            },
            stations: stations?,
            clients: clients?,
            events: events?.0,
            every_write: events?.1,
        })
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
