//! What a driver.cfg says to the bus `modbus-client`.

use crate::config::{Collector, Table, Value};
use crate::fieldbus::Role;
use crate::fieldbus::modbus::line::Line;
use crate::fieldbus::modbus::place::SHAPE;
use crate::fieldbus::modbus::stations::{Stations, Units, read_write_to};
use crate::fieldbus::modbus::table::{ADDRESSES, Table as OfTable};
use crate::fieldbus::modbus::{CONTROLLER_INPUTS, Place};
use crate::fieldbus::tcp::Address;
use crate::signal::{Area, SignalTable};
use crate::time::Nanos;

use super::Block;

/// Where a client connects to unless a driver.cfg says otherwise: where a server of ours listens.
const ADDRESS: Address = Address::local(1502);

/// How long a server has for an answer unless a driver.cfg says otherwise.
const TIMEOUT: Nanos = Nanos::from_secs(1);

/// The unit of a single station unless a driver.cfg says otherwise.
const UNIT: u8 = 1;

/// The most parts that an area may have.
const PARTS: usize = 100;

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
    /// How long the server has for an answer.
    pub timeout: Nanos,
    /// Whether one request may write and read.
    pub combine: bool,
    /// Whether every change that the server makes is reported as an event, beside the image.
    pub events: bool,
}

/// Where an area of the image lies in the tables of a unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lie {
    /// From the first byte on, one behind the other.
    parts: Vec<Part>,
    /// Where the driver.cfg says so.
    at: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Part {
    place: Place,
    /// How many bytes; `None` for all that are left.
    bytes: Option<usize>,
}

impl ClientOptions {
    /// Reads the keys of the bus. `moved` says that another address will take the place of the one that is
    /// read.
    pub(in crate::fieldbus) fn read(role: Role, moved: bool, mut table: Table<'_>) -> Option<Self> {
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
        let timeout = timeout.map_or(Some(TIMEOUT), |value| value.duration());
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
            timeout: timeout?,
            combine: combine?,
            events: events?,
        })
    }

    /// Reports what does not go together with the sizes of the stations.
    pub(in crate::fieldbus) fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        for area in [Area::Input, Area::Output] {
            for station in &table.stations {
                if let Err((what, right)) = self.blocks(area, station.bytes(area)) {
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

    /// Where the parts of an area begin.
    pub(in crate::fieldbus::modbus) fn places(&self, area: Area) -> impl Iterator<Item = Place> {
        self.lie(area).parts.iter().map(|part| part.place)
    }

    /// The unit of a station.
    pub fn unit(&self, station: usize) -> u8 {
        self.stations.unit(station).unwrap_or(UNIT)
    }

    /// Where an area of so many bytes lies.
    ///
    /// # Errors
    ///
    /// It does not fit: what is wrong, and what would be right.
    pub fn blocks(&self, area: Area, bytes: usize) -> Result<Vec<Block>, (String, String)> {
        let parts = &self.lie(area).parts;
        let mut blocks = Vec::new();
        let mut byte = 0;
        for (number, part) in parts.iter().enumerate() {
            let left = bytes - byte;
            let is_last = number + 1 == parts.len();
            let size = part.bytes.unwrap_or(left);
            if size > left || (is_last && size < left) {
                let all: usize = parts.iter().filter_map(|part| part.bytes).sum();
                return Err((
                    format!("the parts of {area} have {all} bytes, but {area} has {bytes}"),
                    "let \"bytes\" out of the last part, which then has all that are left, or change the \
                     size of the image"
                        .to_owned(),
                ));
            }
            let block = Block {
                table: part.place.table,
                first: part.place.offset,
                byte,
                bytes: size,
            };
            if block.span().end() > ADDRESSES {
                return Err((
                    format!(
                        "{area} would lie at {} {} from {} on, and end at offset {}",
                        block.span().count,
                        block.table,
                        part.place,
                        block.span().end() - 1
                    ),
                    "begin further to the front; the last offset is 65535".to_owned(),
                ));
            }
            byte += size;
            if size > 0 {
                blocks.push(block);
            }
        }
        Ok(blocks)
    }
}

/// Where an area lies unless a driver.cfg says so.
fn default(role: Role, area: Area) -> Place {
    let (table, offset) = match (role, area) {
        (_, Area::Output) => (OfTable::HoldingRegisters, 0),
        (Role::Controller, Area::Input) => (OfTable::InputRegisters, 0),
        (Role::Device, Area::Input) => (OfTable::HoldingRegisters, CONTROLLER_INPUTS),
    };
    Place { table, offset }
}

impl Lie {
    fn read(value: Option<&Value<'_>>, at: usize, default: Place, writes: bool) -> Option<Self> {
        let Some(value) = value else {
            let parts = vec![Part {
                place: default,
                bytes: None,
            }];
            return Some(Self { parts, at });
        };
        let at = value.at();
        if value.as_text().is_some() {
            let place = read_place(value, default.table, writes)?;
            let parts = vec![Part { place, bytes: None }];
            return Some(Self { parts, at });
        }
        let right = format!(
            "{SHAPE}; or a list such as [{{ at = \"coil:1\", bytes = 2 }}, {{ at = \"offset:0\" }}]"
        );
        let list = value.list(&right)?;
        if list.is_empty() || list.len() > PARTS {
            value.wrong(
                format!("it has {} parts", list.len()),
                format!("write 1 to {PARTS}"),
            );
            return None;
        }
        let count = list.len();
        let parts: Vec<Option<Part>> = list
            .iter()
            .enumerate()
            .map(|(number, element)| {
                let mut table = element.table("a part of the image", &right)?;
                let place = table.require("at", SHAPE);
                let bytes = if number + 1 < count {
                    table.require("bytes", "write how many bytes of the image lie there")
                } else {
                    table.take("bytes")
                };
                table.finish();
                let place = place.and_then(|value| read_place(&value, default.table, writes));
                let bytes = match bytes {
                    None => None,
                    Some(value) => {
                        let bytes = value.whole(1..=0x1_0000)?;
                        Some(usize::try_from(bytes).ok()?)
                    }
                };
                Some(Part {
                    place: place?,
                    bytes,
                })
            })
            .collect();
        let parts = parts.into_iter().collect::<Option<Vec<Part>>>()?;
        Some(Self { parts, at })
    }
}

fn read_place(value: &Value<'_>, table: OfTable, writes: bool) -> Option<Place> {
    let place = Place::parse(value.text(SHAPE)?, table)
        .map_err(|error| value.wrong(error.what, error.right))
        .ok()?;
    if writes && !place.table.is_writable() {
        value.wrong(
            format!("nobody can write {}", place.table),
            "this end writes them: choose holding registers or coils, or check \"role\"",
        );
        return None;
    }
    Some(place)
}
