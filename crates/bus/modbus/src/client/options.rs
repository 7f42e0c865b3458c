//! The options of the bus `modbus-client` in a driver.cfg.

use std::collections::BTreeMap;

use crate::line::Line;
use crate::stations::{Stations, UnitRange, read_write_to};
use crate::table::Table as OfTable;
use crate::tls_options::Tls;
use crate::{ElementAddress, INPUTS, TagAddress};
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Table};
use tickbus_fieldbus::Role;
use tickbus_image::signal::{Area, Signal, SignalTable};
use tickbus_net::Address;

use super::area_mapping::AreaMapping;
use super::plan::{Capabilities, queries};
use super::{Block, Request};
use crate::Piece;

/// The default address: the one at which our own server listens.
const ADDRESS: Address = Address::local(1502);

/// The default time-out for an answer.
const TIMEOUT: Nanos = Nanos::from_secs(1);

/// The default unit of a single station.
const UNIT: u8 = 1;

/// On a serial line, a gap of up to this many bits is read over to save a request: eight registers take about
/// as long as the overhead of a request.
const SERIAL_GAP: usize = 128;

/// The options of the bus `modbus-client`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClientOptions {
    /// The line to the server.
    pub line: Line,
    /// The unit of each station, and the device that it may write to.
    pub stations: Stations,
    /// The place of `%I`.
    pub inputs: AreaMapping,
    /// The place of `%Q`.
    pub outputs: AreaMapping,
    /// Signals with their own place, by name: `[fieldbus.at]`.
    pub at: BTreeMap<String, TagAddress>,
    /// The time-out for an answer, if stated.
    pub timeout: Option<Nanos>,
    /// The certificates of an encrypted line.
    pub tls: Option<Tls>,
    /// True if a single request may write and read.
    pub combine: bool,
    pub(super) role: Role,
}

impl ClientOptions {
    /// Reads the keys of the bus. `moved` says that the address will be replaced.
    pub fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let line = Line::read(table, ADDRESS, |address| {
            if moved {
                Ok(())
            } else {
                address.check_dialled()
            }
        });
        let at = table.at();
        let unit = table.take("unit");
        let [inputs, outputs] = ["inputs", "outputs"].map(|key| table.take(key));
        let timeout = table.take("timeout");
        let combine = table.take("read_write");
        let write_to = table.take("write_to");
        let tls = table.take("tls");

        let tls = tls.as_ref().map_or(Some(None), |value| {
            Tls::read(value, line.as_ref(), false).map(Some)
        });
        let units = match &line {
            Some(Line::Serial(_) | Line::RtuOverTcp(_)) => UnitRange::Serial,
            _ => UnitRange::Tcp,
        };
        let stations = Stations::read(units, unit.as_ref());
        let write_to = write_to.as_ref().map(read_write_to);
        let (input, output) = (default(role, Area::Input), default(role, Area::Output));
        let writes = |area| role.writes(area);
        let inputs = AreaMapping::read(inputs.as_ref(), at, input, writes(Area::Input));
        let outputs = AreaMapping::read(outputs.as_ref(), at, output, writes(Area::Output));
        let timeout = timeout.map_or(Some(None), |value| value.duration().map(Some));
        let combine = combine.map_or(Some(true), |value| value.boolean());
        let mut stations = stations?;
        if let Some(write_to) = write_to {
            stations.allow(Some(write_to?));
        }
        Some(Self {
            line: line?,
            stations,
            inputs: inputs?,
            outputs: outputs?,
            at: BTreeMap::new(),
            timeout: timeout?,
            tls: tls?,
            combine: combine?,
            role,
        })
    }

    /// Reports conflicts with the sizes of the stations.
    pub fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        for area in [Area::Input, Area::Output] {
            for (index, station) in table.stations.iter().enumerate() {
                let mut signals = table.signals.iter();
                let lies_there = |signal: &Signal| {
                    signal.station == index
                        && signal.area == area
                        && !self.at.contains_key(&signal.name)
                };
                if !signals.any(lies_there) {
                    continue;
                }
                let fits = self.blocks(area, station.bytes(area));
                let fits = fits.and_then(|blocks| {
                    if self.role.writes(area) {
                        AreaMapping::check_apart(area, &blocks)
                    } else {
                        Ok(())
                    }
                });
                if let Err(mistake) = fits {
                    collector.collect(self.mapping(area).at, mistake);
                    break;
                }
            }
        }
    }

    fn mapping(&self, area: Area) -> &AreaMapping {
        match area {
            Area::Input => &self.inputs,
            Area::Output => &self.outputs,
        }
    }

    /// True if `inputs` or `outputs` has an effect: if any signal of the area lacks a separate place.
    pub(crate) fn lies_as_a_whole(&self, area: Area, table: &SignalTable) -> bool {
        let signals = table.signals.iter();
        let mut signals = signals.filter(|signal| signal.plc_address().area == area);
        self.at.is_empty() || signals.any(|signal| !self.at.contains_key(&signal.name))
    }

    /// The first elements of the parts of an area.
    pub(crate) fn places(&self, area: Area) -> impl Iterator<Item = ElementAddress> {
        self.mapping(area).places()
    }

    /// The unit of a station.
    pub fn unit(&self, station: usize) -> u8 {
        self.stations.unit(station).unwrap_or(UNIT)
    }

    /// The time-out for an answer, given the number of stations.
    ///
    /// If the driver.cfg does not state it, a silent station among several must not make the data of the
    /// others older than `max_age`.
    pub fn patience(&self, stations: usize, max_age: Nanos) -> Nanos {
        self.timeout.unwrap_or(if stations > 1 {
            TIMEOUT.min(Nanos(max_age.0 / 2))
        } else {
            TIMEOUT
        })
    }

    /// The blocks of an area of `bytes` bytes.
    ///
    /// # Errors
    ///
    /// The area does not fit; the message has the remedy.
    pub fn blocks(&self, area: Area, bytes: usize) -> Result<Vec<Block>, Mistake> {
        self.mapping(area).blocks(area, bytes)
    }

    /// The pieces of the signals in a station's area.
    pub fn pieces(&self, table: &SignalTable, station: usize, area: Area) -> Vec<Piece> {
        // Errors were reported when the driver.cfg was read.
        let blocks = [Area::Input, Area::Output].map(|area| {
            let blocks = self.blocks(area, table.stations[station].plc_bytes(area));
            blocks.unwrap_or_default()
        });
        let mut pieces = Vec::new();
        for signal in &table.signals {
            if signal.station != station || signal.area != area {
                continue;
            }
            if let Some(spot) = self.at.get(&signal.name) {
                pieces.extend(Piece::of_tag(signal, *spot));
            } else {
                // Placed as the PLC has it; an observer's image may have it elsewhere.
                let placed = signal.as_in_plc();
                let parts = blocks[usize::from(placed.area == Area::Output)].iter();
                let parts = parts.filter_map(|block| Piece::of_block(&placed, block));
                pieces.extend(parts.map(|piece| Piece {
                    bit: piece.bit + (signal.byte - placed.byte) * 8,
                    ..piece
                }));
            }
        }
        pieces
    }

    /// The capabilities assumed of a device at the start of a connection.
    pub(super) fn capabilities(&self) -> Capabilities {
        let gap = match self.line {
            Line::Tcp(_) | Line::Udp(_) => usize::MAX,
            Line::Serial(_) | Line::RtuOverTcp(_) => SERIAL_GAP,
        };
        Capabilities::new(self.combine, gap)
    }

    /// The requests sent to a station in each cycle, unless its device refuses some of them.
    pub fn requests(&self, table: &SignalTable, station: usize) -> Vec<Request> {
        let (writes, reads) = self.role.areas();
        let pieces = |area| self.pieces(table, station, area);
        queries(&pieces(reads), &pieces(writes), &self.capabilities())
    }
}

/// The default place of an area.
fn default(role: Role, area: Area) -> ElementAddress {
    let (table, offset) = match (role, area) {
        (_, Area::Output) => (OfTable::HoldingRegisters, 0),
        (Role::Controller | Role::Observer, Area::Input) => (OfTable::InputRegisters, 0),
        (Role::Device, Area::Input) => (OfTable::HoldingRegisters, INPUTS),
    };
    ElementAddress { table, offset }
}
