//! The options of the bus `modbus-server` in a driver.cfg.

use std::collections::BTreeMap;

use crate::line::Line;
use crate::stations::{Stations, UnitRange};
use crate::table::Span;
use crate::tls_options::Tls;
use crate::{ElementAddress, INPUTS, Side, TagAddress, table};
use tickbus_base::toml_text::{Collector, Table, Value};
use tickbus_fieldbus::Role;
use tickbus_fieldbus::tcp::Writers;
use tickbus_image::signal::SignalTable;
use tickbus_net::Address;

use super::super::element_address::SHAPE;
use super::files::read_files;
use super::reserved::read_reserved;
use crate::identity::read_identity;

/// The default address: reachable only from this machine, at a port that needs no privilege.
const ADDRESS: Address = Address::local(1502);

/// The most queues of a device.
pub(crate) const QUEUES: usize = 64;

/// The default number of clients.
const CLIENTS: usize = 1024;

/// The options of the bus `modbus-server`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServerOptions {
    /// The line on which it serves.
    pub line: Line,
    /// The frame of `%I`.
    pub input: Side,
    /// The holding register at which `%I` is repeated, if stated, and the offset of that key.
    pub window: Option<(usize, usize)>,
    /// Signals with their own place, by name: `[fieldbus.at]`. A station with such signals has no other elements.
    pub at: BTreeMap<String, TagAddress>,
    /// Elements of those stations that exist and carry nothing.
    pub reserved: Vec<(table::Table, Span)>,
    /// The offset of the key `reserved`, if stated.
    reserved_at: Option<usize>,
    /// The unit of each station.
    pub stations: Stations,
    /// The most clients at the same time.
    pub clients: usize,
    /// The first of the eight coils or discrete inputs that function 7 reads, and the offset of that key.
    pub exception_status: Option<(ElementAddress, usize)>,
    /// The holding registers with which the queues of function 24 begin, and the offsets in the file.
    pub queues: Vec<(usize, usize)>,
    /// The numbers of the files of functions 20 and 21.
    pub files: Vec<u16>,
    /// If stated, whether the device has functions 8, 11 and 12.
    diagnostics: Option<bool>,
    /// The certificates of an encrypted line.
    pub tls: Option<Tls>,
    /// True if a client may not write data that another client has written recently.
    pub is_single_writer: bool,
}

impl ServerOptions {
    /// Reads the keys of the bus.
    pub fn read(role: Role, table: &mut Table<'_>) -> Option<Self> {
        let line = Line::read(table, ADDRESS, |_| Ok(()));
        let unit = table.take("unit");
        let inputs = table.take("inputs");
        let clients = table.take("clients");
        let reserved = table.take("reserved");
        let identity = table.take("identity");
        let status = table.take("exception_status");
        let queues = table.take("queues");
        let files = table.take("files");
        let diagnostics = table.take("diagnostics");
        let tls = table.take("tls");
        let is_single_writer = Writers::read(table);

        let tls = tls.as_ref().map_or(Some(None), |value| {
            Tls::read(value, line.as_ref(), true).map(Some)
        });
        let units = match &line {
            Some(Line::Serial(_) | Line::RtuOverTcp(_)) => UnitRange::ServedOnSerial,
            _ => UnitRange::Tcp,
        };
        let stations = Stations::read(units, unit.as_ref());
        let identity = identity.as_ref().map(read_identity);
        let window = match &inputs {
            None => Some(None),
            Some(value) => read_window(value).map(|window| Some((window, value.at()))),
        };
        let reserved_at = reserved.as_ref().map(Value::at);
        let reserved = reserved.as_ref().map_or(Some(Vec::new()), read_reserved);
        let clients = clients.as_ref().map_or(Some(CLIENTS), |value| {
            value
                .whole(1..=10_000)
                .and_then(|clients| usize::try_from(clients).ok())
        });
        let status = match &status {
            None => Some(None),
            Some(value) => read_status(value).map(|place| Some((place, value.at()))),
        };
        let queues = queues.as_ref().map_or(Some(Vec::new()), read_queues);
        let files = files.as_ref().map_or(Some(Vec::new()), read_files);
        let diagnostics = diagnostics
            .as_ref()
            .map_or(Some(None), |value| value.boolean().map(Some));
        let input = match role {
            Role::Device | Role::Observer => Side::Sends,
            Role::Controller => Side::Holds,
        };
        let mut stations = stations?;
        if let Some(identity) = identity {
            stations.name(Some(identity?));
        }
        Some(Self {
            line: line?,
            input,
            window: window?,
            at: BTreeMap::new(),
            reserved: reserved?,
            reserved_at,
            stations,
            clients: clients?,
            exception_status: status?,
            queues: queues?,
            files: files?,
            diagnostics: diagnostics?,
            tls: tls?,
            is_single_writer: is_single_writer?,
        })
    }
}

impl ServerOptions {
    /// Returns true if the device has functions 8, 11 and 12, which the standard has for serial lines alone.
    pub(super) fn has_diagnostics(&self) -> bool {
        let usual = !matches!(self.line, Line::Tcp(_) | Line::Udp(_));
        self.diagnostics.unwrap_or(usual)
    }

    /// The holding register at which `%I` is repeated in a station whose `%Q` has this many bytes.
    pub(crate) fn window(&self, output_bytes: usize) -> Option<usize> {
        let outputs = table::Table::HoldingRegisters.elements(output_bytes);
        // If %Q reaches that far, the default window has no room and is omitted.
        let usual = (outputs <= INPUTS).then_some(INPUTS);
        self.window.map_or(usual, |(first, _)| Some(first))
    }

    /// Reports an `inputs` that lies among the registers of `%Q`, and keys without effect.
    pub fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        let mut stations = 0..table.stations.len();
        let placed = stations
            .clone()
            .any(|station| self.is_placed(table, station));
        if let (false, Some(at)) = (placed, self.reserved_at) {
            collector.report(
                at,
                "\"reserved\" stands without [fieldbus.at]",
                "remove it: all elements of the image exist",
            );
        }
        self.fit_extras(table, collector);
        let Some((first, at)) = self.window else {
            return;
        };
        if stations.all(|station| self.is_placed(table, station)) {
            collector.report(
                at,
                "\"inputs\" stands beside [fieldbus.at], which places every signal",
                "remove it",
            );
            return;
        }
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

/// Reads the first of the bits that function 7 reads.
fn read_status(value: &Value<'_>) -> Option<ElementAddress> {
    const RIGHT: &str =
        "write the first of eight coils or discrete inputs, such as \"discrete-input:1\"";
    let place = ElementAddress::parse(value.text(RIGHT)?, table::Table::DiscreteInputs);
    let place = place.map_err(|mistake| value.refuse(mistake)).ok()?;
    if !place.table.is_bits() {
        let element = place.table.element();
        value.wrong(format!("\"exception_status\" is a {element}"), RIGHT);
        return None;
    }
    Some(place)
}

/// Reads the holding registers with which queues begin.
fn read_queues(value: &Value<'_>) -> Option<Vec<(usize, usize)>> {
    const RIGHT: &str = "write a list of holding registers, such as [\"400101\"]";
    let list = value.list(RIGHT)?;
    if list.len() > QUEUES {
        value.wrong(
            format!("it has {} queues", list.len()),
            format!("write at most {QUEUES}"),
        );
        return None;
    }
    let read = list.iter().map(|value| {
        let place = ElementAddress::parse(value.text(RIGHT)?, table::Table::HoldingRegisters);
        let place = place.map_err(|mistake| value.refuse(mistake)).ok()?;
        if place.table != table::Table::HoldingRegisters {
            let element = place.table.element();
            value.wrong(format!("a queue begins with a {element}"), RIGHT);
            return None;
        }
        Some((place.offset, value.at()))
    });
    // All mistakes are reported, not only the first.
    read.collect::<Vec<_>>().into_iter().collect()
}

/// Reads the holding register at which `%I` is repeated.
fn read_window(value: &Value<'_>) -> Option<usize> {
    let text = value.text(SHAPE)?;
    let place = ElementAddress::parse(text, table::Table::HoldingRegisters)
        .map_err(|mistake| value.refuse(mistake))
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
