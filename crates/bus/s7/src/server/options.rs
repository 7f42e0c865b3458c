//! The options of the bus `s7-server` in a driver.cfg.

use crate::length::{LONGEST, read_length};
use crate::tsap::{RACK, SLOT};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Table, Value, did_you_mean, shown};
use tickbus_fieldbus::tcp::Writers;
use tickbus_image::signal::{AREA_LIMIT, Area, SignalTable};
use tickbus_net::Address;

/// The default address: reachable only from this machine, at a port that needs no privilege.
const ADDRESS: Address = Address::local(1102);

/// The default number of bytes of flags.
const FLAGS: usize = 256;

/// The default number of clients.
const CLIENTS: usize = 64;

/// The options of the bus `s7-server`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServerOptions {
    /// Where to listen.
    pub address: Address,
    /// The data blocks.
    pub blocks: Vec<Block>,
    /// The number of bytes of flags.
    pub flags: usize,
    /// The longest PDU that is agreed to.
    pub pdu: u16,
    /// The most clients at the same time.
    pub clients: usize,
    /// True if a client may not write data that another client has written recently.
    pub is_single_writer: bool,
    /// Rack and slot of each station; empty if there are no `[[station]]` tables.
    pub slots: Vec<Option<(u8, u8)>>,
}

/// A data block: a range of an area of a station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// The number.
    pub number: u16,
    /// The area that contains the block.
    pub area: Area,
    /// The station's name; `None` if there is a single station.
    pub station: Option<String>,
    /// The first byte in the area.
    pub offset: usize,
    /// The number of bytes; `None` to the end of the area.
    pub length: Option<usize>,
    /// The offset in the text, for mistakes.
    at: usize,
}

impl Block {
    /// The index of the block's station.
    pub(super) fn station_in(&self, table: &SignalTable) -> Option<usize> {
        match &self.station {
            None if table.stations.len() > 1 => None,
            None => Some(0),
            Some(name) => table
                .stations
                .iter()
                .position(|station| station.name == *name),
        }
    }
}

impl ServerOptions {
    /// Replaces the address of the driver.cfg.
    ///
    /// # Errors
    ///
    /// The text is not an address.
    pub fn set_address(&mut self, address: &str) -> Result<(), Mistake> {
        self.address = address.parse()?;
        Ok(())
    }

    /// Reads `address`, `db`, `m_bytes`, `pdu`, `clients` and `writers`.
    pub fn read(table: &mut Table<'_>) -> Option<Self> {
        let address = table.take("address");
        let blocks = table.take("db");
        let flags = table.take("m_bytes");
        let unit = table.take("pdu");
        let clients = table.take("clients");
        let is_single_writer = Writers::read(table);

        let address = address.as_ref().map_or(Some(ADDRESS), Address::read);
        let blocks = blocks.as_ref().map_or(Some(Vec::new()), read_blocks);
        let flags = flags
            .as_ref()
            .map_or(Some(FLAGS), |value| size(value, 0..=65_536));
        let unit = unit.as_ref().map_or(Some(LONGEST), read_length);
        let clients = clients
            .as_ref()
            .map_or(Some(CLIENTS), |value| size(value, 1..=1_000));
        Some(Self {
            address: address?,
            blocks: blocks?,
            flags: flags?,
            pdu: unit?,
            clients: clients?,
            is_single_writer: is_single_writer?,
            slots: Vec::new(),
        })
    }

    /// Reads `slot` and `rack` of the next of `count` `[[station]]` tables.
    pub fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        let (rack, slot) = (table.take("rack"), table.take("slot"));
        if let (Some(rack), None) = (&rack, &slot) {
            rack.wrong(
                "\"rack\" stands without \"slot\"",
                "add the slot of the CPU",
            );
        }
        let small = |value: &Value<'_>, range| {
            let number = value.whole(range)?;
            u8::try_from(number).ok()
        };
        let rack_of = rack.as_ref().map_or(Some(0), |value| small(value, RACK));
        let place = slot
            .as_ref()
            .and_then(|value| Some((rack_of?, small(value, SLOT)?)));
        if let (Some(value), Some(_)) = (&slot, place)
            && count > 1
            && self.slots.contains(&place)
        {
            value.wrong(
                "\"slot\" is that of another station",
                "give each station a slot of its own, or leave it out and reach it by data blocks",
            );
        }
        self.slots.push(place);
    }

    /// Reports conflicts with the stations of the file.
    pub fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        for block in &self.blocks {
            let wrong = |what: String, right: String| collector.report(block.at, what, right);
            let number = block.number;
            let Some(station) = block.station_in(table) else {
                match &block.station {
                    None => wrong(
                        format!(
                            "data block {number} names no station, and there are {}",
                            table.stations.len()
                        ),
                        format!(
                            "add station = \"{}\", or another of them",
                            table.stations[0].name
                        ),
                    ),
                    Some(name) => {
                        let names: Vec<&str> = table
                            .stations
                            .iter()
                            .map(|station| &*station.name)
                            .collect();
                        wrong(
                            format!("there is no station \"{}\"", shown(name)),
                            did_you_mean(name, "stations", &names),
                        );
                    }
                }
                continue;
            };
            let size = table.stations[station].bytes(block.area);
            let end = block.offset + block.length.unwrap_or(1);
            if end > size {
                wrong(
                    format!("data block {number} goes up to byte {end} of an area that has {size}"),
                    "correct \"offset\" and \"length\", or add the signals that lie there"
                        .to_owned(),
                );
            }
        }
    }
}

fn read_blocks(value: &Value<'_>) -> Option<Vec<Block>> {
    const SHAPE: &str = "write a list of tables, such as db = [{ number = 1, area = \"%Q\" }]";
    let list = value.list(SHAPE)?;
    let mut blocks: Vec<Block> = Vec::new();
    let mut right = true;
    for element in &list {
        let Some(block) = element
            .table("a data block of \"db\"", SHAPE)
            .and_then(read_block)
        else {
            right = false;
            continue;
        };
        if blocks.iter().any(|other| other.number == block.number) {
            element.wrong(
                format!("data block {} is there twice", block.number),
                "give each data block a number of its own",
            );
            right = false;
        }
        blocks.push(block);
    }
    right.then_some(blocks)
}

fn read_block(mut table: Table<'_>) -> Option<Block> {
    let at = table.at();
    let number = table.require(
        "number",
        "write the number of the data block, such as number = 1",
    );
    let area = table.require(
        "area",
        "write the area whose bytes it has: area = \"%Q\" or \"%I\"",
    );
    let station = table.take("station");
    let offset = table.take("offset");
    let length = table.take("length");
    table.finish();

    let number = number.and_then(|value| value.whole(1..=65_535));
    let area =
        area.and_then(|value| value.choice("areas", &[("%I", Area::Input), ("%Q", Area::Output)]));
    let most = i128::try_from(AREA_LIMIT).unwrap_or(i128::MAX);
    let station = station.map(|value| {
        let name = value.text("write the name of a [[station]]");
        name.map(str::to_owned)
    });
    let offset = offset.map_or(Some(0), |value| size(&value, 0..=most));
    let length = length.map(|value| size(&value, 1..=most));
    Some(Block {
        number: u16::try_from(number?).ok()?,
        area: area?,
        station: match station {
            None => None,
            Some(station) => Some(station?),
        },
        offset: offset?,
        length: match length {
            None => None,
            Some(length) => Some(length?),
        },
        at,
    })
}

fn size(value: &Value<'_>, range: std::ops::RangeInclusive<i128>) -> Option<usize> {
    value
        .whole(range)
        .and_then(|size| usize::try_from(size).ok())
}
