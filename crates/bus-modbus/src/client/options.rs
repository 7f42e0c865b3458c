//! What a driver.cfg says to the bus `modbus-client`.

use std::collections::BTreeMap;

use crate::line::Line;
use crate::stations::{Stations, Units, read_write_to};
use crate::table::Table as OfTable;
use crate::{INPUTS, Place, Spot};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Table};
use tickbus_fieldbus::Role;
use tickbus_fieldbus::tcp::Address;
use tickbus_image::signal::{Area, Signal, SignalTable};

use super::lie::Lie;
use super::plan::{Abilities, queries};
use super::{Block, Piece, Query};

/// Where a client connects to unless a driver.cfg says otherwise: where a server of ours listens.
const ADDRESS: Address = Address::local(1502);

/// How long a server has for an answer unless a driver.cfg says otherwise.
const TIMEOUT: Nanos = Nanos::from_secs(1);

/// The unit of a single station unless a driver.cfg says otherwise.
const UNIT: u8 = 1;

/// On a serial line a gap of so many bits is read rather than that two requests are made: eight registers last about as
/// long as what a request has beside its values.
const SERIAL_GAP: usize = 128;

/// What a driver.cfg says to the bus `modbus-client`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClientOptions {
    /// The line to the server.
    pub line: Line,
    /// Which unit each station is, and which device it may write to.
    pub stations: Stations,
    /// Where `%I` lies.
    pub inputs: Lie,
    /// Where `%Q` lies.
    pub outputs: Lie,
    /// The signals that lie elsewhere, by their names: `[fieldbus.at]`.
    pub at: BTreeMap<String, Spot>,
    /// How long the server has for an answer, if the driver.cfg says so.
    pub timeout: Option<Nanos>,
    /// Whether one request may write and read.
    pub combine: bool,
    /// Whether every change that the server makes is reported as an event, beside the image.
    pub events: bool,
    pub(super) role: Role,
}

impl ClientOptions {
    /// Reads the keys of the bus. `moved` says that another address will take the place of the one that is
    /// read.
    pub fn read(role: Role, moved: bool, mut table: Table<'_>) -> Option<Self> {
        let line = Line::read(&mut table, ADDRESS, |address| {
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
        let events = table.take("events");
        table.finish();

        let units = match &line {
            Some(Line::Serial(_)) => Units::Serial,
            _ => Units::Tcp,
        };
        let stations = Stations::read(units, unit.as_ref());
        let write_to = write_to.as_ref().map(read_write_to);
        let (input, output) = (default(role, Area::Input), default(role, Area::Output));
        let writes = |area| role.areas().0 == area;
        let inputs = Lie::read(inputs.as_ref(), at, input, writes(Area::Input));
        let outputs = Lie::read(outputs.as_ref(), at, output, writes(Area::Output));
        let timeout = timeout.map_or(Some(None), |value| value.duration().map(Some));
        let combine = combine.map_or(Some(true), |value| value.boolean());
        let events = events.map_or(Some(false), |value| value.boolean());
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
            combine: combine?,
            events: events?,
            role,
        })
    }

    /// Reports what does not go together with the sizes of the stations.
    pub fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        let (writes, _) = self.role.areas();
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
                    if area == writes {
                        Lie::check_apart(area, &blocks)
                    } else {
                        Ok(())
                    }
                });
                if let Err((what, right)) = fits {
                    collector.report(self.lie(area).at, what, right);
                    break;
                }
            }
        }
    }

    fn lie(&self, area: Area) -> &Lie {
        match area {
            Area::Input => &self.inputs,
            Area::Output => &self.outputs,
        }
    }

    /// Whether `inputs` or `outputs` matters: whether not every signal of the area has a place of its own.
    pub(crate) fn lies_as_a_whole(&self, area: Area, table: &SignalTable) -> bool {
        let mut signals = table.signals.iter().filter(|signal| signal.area == area);
        self.at.is_empty() || signals.any(|signal| !self.at.contains_key(&signal.name))
    }

    /// Where the parts of an area begin.
    pub(crate) fn places(&self, area: Area) -> impl Iterator<Item = Place> {
        self.lie(area).places()
    }

    /// The unit of a station.
    pub fn unit(&self, station: usize) -> u8 {
        self.stations.unit(station).unwrap_or(UNIT)
    }

    /// How long a server has for an answer where there are so many stations.
    ///
    /// Where the driver.cfg does not say, one of several that is silent must not make the data of the others older than
    /// `max_age`.
    pub fn patience(&self, stations: usize, max_age: Nanos) -> Nanos {
        self.timeout.unwrap_or(if stations > 1 {
            TIMEOUT.min(Nanos(max_age.0 / 2))
        } else {
            TIMEOUT
        })
    }

    /// Where an area of so many bytes lies as a whole.
    ///
    /// # Errors
    ///
    /// It does not fit: what is wrong, and what would be right.
    pub fn blocks(&self, area: Area, bytes: usize) -> Result<Vec<Block>, (String, String)> {
        self.lie(area).blocks(area, bytes)
    }

    /// Where the signals of a station's area lie.
    pub fn pieces(&self, table: &SignalTable, station: usize, area: Area) -> Vec<Piece> {
        // What does not fit was reported when the driver.cfg was read.
        let blocks = self.blocks(area, table.stations[station].bytes(area));
        let blocks = blocks.unwrap_or_default();
        let mut pieces = Vec::new();
        for signal in &table.signals {
            if signal.station != station || signal.area != area {
                continue;
            }
            if let Some(spot) = self.at.get(&signal.name) {
                pieces.extend(Piece::of_spot(signal, *spot));
            } else {
                let parts = blocks.iter();
                pieces.extend(parts.filter_map(|block| Piece::of_block(signal, block)));
            }
        }
        pieces
    }

    /// What is taken for granted of a device that is met anew.
    pub(super) fn abilities(&self) -> Abilities {
        let gap = match self.line {
            Line::Tcp(_) => usize::MAX,
            Line::Serial(_) => SERIAL_GAP,
        };
        Abilities::new(self.combine, gap)
    }

    /// The requests that a station is sent in each cycle, unless its device refuses some of them.
    pub fn requests(&self, table: &SignalTable, station: usize) -> Vec<Query> {
        let (writes, reads) = self.role.areas();
        let pieces = |area| self.pieces(table, station, area);
        queries(&pieces(reads), &pieces(writes), &self.abilities())
    }
}

/// Where an area lies unless a driver.cfg says so.
fn default(role: Role, area: Area) -> Place {
    let (table, offset) = match (role, area) {
        (_, Area::Output) => (OfTable::HoldingRegisters, 0),
        (Role::Controller, Area::Input) => (OfTable::InputRegisters, 0),
        (Role::Device, Area::Input) => (OfTable::HoldingRegisters, INPUTS),
    };
    Place { table, offset }
}
