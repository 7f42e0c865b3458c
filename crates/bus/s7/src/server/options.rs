//! The options of the bus `s7-server` in a driver.cfg.

use std::collections::BTreeMap;

use crate::Variable;
use crate::identity::{StatedIdentity, read_identity};
use crate::length::{LONGEST, read_length};
use crate::szl::Identity;
use crate::tsap::{RACK, SLOT};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Table, Value, did_you_mean, shown};
use tickbus_fieldbus::Role;
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
    /// The data blocks that are parts of images.
    pub blocks: Vec<Block>,
    /// The stated lengths of data blocks that have the signals of `[fieldbus.at]`.
    pub(super) lengths: Vec<BlockLength>,
    /// The places of single signals, by name: the lines of `[fieldbus.at]`.
    pub variables: BTreeMap<String, Variable>,
    /// The number of bytes of flags.
    pub flags: usize,
    /// True if the driver.cfg states that number.
    pub(super) are_flags_stated: bool,
    /// The longest PDU that is agreed to.
    pub pdu: u16,
    /// The most clients at the same time.
    pub clients: usize,
    /// True if a client may not write data that another client has written recently.
    pub is_single_writer: bool,
    /// Rack and slot of each station; empty if there are no `[[station]]` tables.
    pub slots: Vec<Option<(u8, u8)>>,
    /// The identity in `[fieldbus]`, and those of the `[[station]]` tables.
    pub(super) identity: StatedIdentity,
    pub(super) identities: Vec<Option<StatedIdentity>>,
    pub(super) role: Role,
    /// The offset of the `[fieldbus]` table in the text, for mistakes.
    pub(super) at: usize,
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
    pub(super) at: usize,
}

/// The stated length of a data block that has signals of `[fieldbus.at]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BlockLength {
    pub(super) number: u16,
    /// The name of the station that is the CPU with the block.
    pub(super) station: Option<String>,
    /// The number of bytes.
    pub(super) length: usize,
    /// The offset in the text, for mistakes.
    pub(super) at: usize,
}

/// An entry of `db`.
enum Entry {
    Block(Block),
    Length(BlockLength),
}

impl Entry {
    fn number(&self) -> u16 {
        match self {
            Self::Block(block) => block.number,
            Self::Length(length) => length.number,
        }
    }

    fn station(&self) -> Option<&str> {
        match self {
            Self::Block(block) => block.station.as_deref(),
            Self::Length(length) => length.station.as_deref(),
        }
    }
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

    /// Reads `address`, `db`, `m_bytes`, `pdu`, `clients`, `identity` and `writers`.
    pub fn read(role: Role, table: &mut Table<'_>) -> Option<Self> {
        let at = table.at();
        let address = table.take("address");
        let blocks = table.take("db");
        let flags = table.take("m_bytes");
        let unit = table.take("pdu");
        let clients = table.take("clients");
        let identity = table.take("identity");
        let is_single_writer = Writers::read(table);

        let address = address.as_ref().map_or(Some(ADDRESS), Address::read);
        let entries = blocks.as_ref().map_or(Some(Vec::new()), read_blocks);
        let are_flags_stated = flags.is_some();
        let flags = flags
            .as_ref()
            .map_or(Some(FLAGS), |value| size(value, 0..=65_536));
        let unit = unit.as_ref().map_or(Some(LONGEST), read_length);
        let clients = clients
            .as_ref()
            .map_or(Some(CLIENTS), |value| size(value, 1..=1_000));
        let identity = identity.as_ref();
        let identity = identity.map_or(Some(StatedIdentity::default()), read_identity);
        let (mut blocks, mut lengths) = (Vec::new(), Vec::new());
        for entry in entries? {
            match entry {
                Entry::Block(block) => blocks.push(block),
                Entry::Length(length) => lengths.push(length),
            }
        }
        Some(Self {
            address: address?,
            blocks,
            lengths,
            variables: BTreeMap::new(),
            flags: flags?,
            are_flags_stated,
            pdu: unit?,
            clients: clients?,
            is_single_writer: is_single_writer?,
            slots: Vec::new(),
            identity: identity?,
            identities: Vec::new(),
            role,
            at,
        })
    }

    /// Reads `slot`, `rack` and `identity` of the next of `count` `[[station]]` tables.
    pub fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        let (rack, slot) = (table.take("rack"), table.take("slot"));
        let identity = table.take("identity");
        self.identities
            .push(identity.as_ref().and_then(read_identity));
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
        self.fit_places(table, collector);
    }

    /// The identity of a station in a driver with this name.
    pub(super) fn identity(&self, station: usize, driver: &str) -> Identity {
        let own = self.identities.get(station).and_then(Option::as_ref);
        own.unwrap_or(&self.identity).complete(driver)
    }
}

fn read_blocks(value: &Value<'_>) -> Option<Vec<Entry>> {
    const SHAPE: &str = "write a list of tables, such as db = [{ number = 1, area = \"%Q\" }]";
    let list = value.list(SHAPE)?;
    let mut blocks: Vec<Entry> = Vec::new();
    let mut right = true;
    for element in &list {
        let Some(block) = element
            .table("a data block of \"db\"", SHAPE)
            .and_then(read_block)
        else {
            right = false;
            continue;
        };
        // Two CPUs can have a block of the same number each.
        let is_same = |other: &Entry| {
            let both = [other, &block].map(|entry| matches!(entry, Entry::Length(_)));
            other.number() == block.number()
                && (both != [true; 2] || other.station() == block.station())
        };
        if blocks.iter().any(is_same) {
            element.wrong(
                format!("data block {} is there twice", block.number()),
                "give each data block a number of its own",
            );
            right = false;
        }
        blocks.push(block);
    }
    right.then_some(blocks)
}

fn read_block(mut table: Table<'_>) -> Option<Entry> {
    let at = table.at();
    let number = table.require(
        "number",
        "write the number of the data block, such as number = 1",
    );
    let length = table.take("length");
    // A length alone is that of a block with the signals of [fieldbus.at].
    let area = match &length {
        Some(_) => table.take("area"),
        None => table.require(
            "area",
            "write the area whose bytes it has: area = \"%Q\" or \"%I\"",
        ),
    };
    let station = table.take("station");
    let offset = table.take("offset");
    table.finish();

    let number = number.and_then(|value| value.whole(1..=65_535));
    let is_length = area.is_none() && length.is_some();
    let area =
        area.and_then(|value| value.choice("areas", &[("%I", Area::Input), ("%Q", Area::Output)]));
    if let (true, Some(offset)) = (is_length, &offset) {
        offset.wrong(
            "\"offset\" stands without \"area\"",
            "add the area whose bytes the block has, or remove \"offset\"",
        );
    }
    let most = i128::try_from(AREA_LIMIT).unwrap_or(i128::MAX);
    let station = station.map(|value| {
        let name = value.text("write the name of a [[station]]");
        name.map(str::to_owned)
    });
    let offset = offset.map_or(Some(0), |value| size(&value, 0..=most));
    let length = length.map(|value| size(&value, 1..=most));
    let number = u16::try_from(number?).ok()?;
    let station = match station {
        None => None,
        Some(station) => Some(station?),
    };
    let length = match length {
        None => None,
        Some(length) => Some(length?),
    };
    if let (true, Some(length)) = (is_length, length) {
        return Some(Entry::Length(BlockLength {
            number,
            station,
            length,
            at,
        }));
    }
    Some(Entry::Block(Block {
        number,
        area: area?,
        station,
        offset: offset?,
        length,
        at,
    }))
}

fn size(value: &Value<'_>, range: std::ops::RangeInclusive<i128>) -> Option<usize> {
    value
        .whole(range)
        .and_then(|size| usize::try_from(size).ok())
}
