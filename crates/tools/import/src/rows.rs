//! The tags of a table. Each is checked alone and against the preceding ones.

use std::collections::HashMap;

use super::address::{ParsedAddress, place, without_place};
use super::cells::{Cell, Record};
use super::columns::Columns;
use super::device::{self, Client, kepserver_type};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, did_you_mean, shown};
use tickbus_image::signal::section::NAME_LIMIT;
use tickbus_image::signal::{AREA_LIMIT, Address, Addressing, Area, ByteOrder, DataType, Width};

/// The most signals of one driver.cfg.
pub(super) const MOST: usize = 100_000;

/// The sizes of values: a bit, and 1, 2, 4 and 8 bytes.
const SIZES: usize = 5;

/// The longest unit, in characters.
const LONGEST_UNIT: usize = 40;

/// The longest address in a device, in characters.
const LONGEST_ADDRESS: usize = 200;

/// The kind of addresses in a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum World {
    /// Addresses in the process image.
    Image(Image),
    /// Addresses in a device, for a client.
    Device(Client),
    /// Names of module inputs and outputs.
    Modules,
}

/// How the addresses of a process image are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Image {
    /// The unit of the numbers in addresses.
    pub(super) addressing: Addressing,
    /// The list is a PLC project, whose author did not write it for tickbus: variables that cannot be signals are left
    /// out instead of refused.
    pub(super) is_project: bool,
    /// Values of each size have their own memory, as in OpenPLC: `%IX0.0` is no part of `%IW0`.
    pub(super) is_apart: bool,
}

/// A tag that becomes a signal.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tag {
    pub(super) name: String,
    pub(super) area: Area,
    /// The address in the process image, once assigned.
    pub(super) address: Option<Address>,
    /// The place in the device or in the PLC; empty if that is the address.
    pub(super) at: String,
    pub(super) data_type: DataType,
    pub(super) order: ByteOrder,
    pub(super) unit: Option<String>,
    /// Two raw values, and the corresponding scaled values.
    pub(super) scale: Option<[f64; 4]>,
    pub(super) comment: String,
    pub(super) folder: String,
}

/// The names and bits of the preceding tags.
#[derive(Default)]
pub(super) struct Taken {
    /// Line of each name.
    names: HashMap<String, usize>,
    /// For each bit of %I and %Q, the line of the tag that occupies it; 0 if free. Where each size has its own memory,
    /// one such list per size.
    bits: [[Vec<u32>; 2]; SIZES],
}

/// The client that the addresses belong to, or `None` for a process image. An address that fits both decides nothing.
/// If any address is certainly in the image, all are.
pub(super) fn client<'a>(addresses: impl Iterator<Item = &'a str>) -> Option<Client> {
    let (mut counts, mut of_image, mut typed) = ([0_usize; 2], false, false);
    for address in addresses {
        match device::only(address) {
            Some(client) => {
                counts[usize::from(client == Client::S7)] += 1;
                typed |= client == Client::Modbus || address.contains([':', ',']);
            }
            None => {
                of_image |= matches!(place(address, Addressing::Bytes), ParsedAddress::Image(_));
            }
        }
    }
    let [modbus, s7] = counts;
    if modbus + s7 == 0 || (of_image && !typed) {
        return None;
    }
    Some(if modbus >= s7 {
        Client::Modbus
    } else {
        Client::S7
    })
}

/// Reads the records after the headings.
pub(super) fn read(
    records: &[Record],
    columns: &Columns,
    world: World,
    taken: &mut Taken,
    tags: &mut Vec<Tag>,
    wrong: &Collector<'_>,
    skipped: &Collector<'_>,
) {
    for record in &records[columns.first..] {
        if tags.len() == MOST {
            wrong.report(
                record[0].at,
                format!("there are more than {MOST} tags"),
                "split the table over several drivers",
            );
            break;
        }
        let row = Row {
            record,
            columns,
            wrong,
            skipped,
        };
        tags.extend(row.tag(world, taken));
    }
}

/// One line of a table.
struct Row<'r> {
    record: &'r Record,
    columns: &'r Columns,
    wrong: &'r Collector<'r>,
    skipped: &'r Collector<'r>,
}

/// A tag's place and its implications.
struct Found {
    area: Area,
    address: Option<Address>,
    at: String,
    data_type: DataType,
}

impl Row<'_> {
    fn cell(&self, column: Option<usize>) -> Option<&Cell> {
        column.and_then(|column| self.record.get(column))
    }

    fn text(&self, column: Option<usize>) -> &str {
        self.cell(column).map_or("", |cell| cell.text.as_str())
    }

    fn tag(&self, world: World, taken: &mut Taken) -> Option<Tag> {
        let (columns, wrong) = (self.columns, self.wrong);
        let cell = self.cell(Some(columns.address));
        let Some(at_address) = cell.filter(|cell| !cell.text.is_empty()) else {
            wrong.report(
                self.record[0].at,
                format!(
                    "this line has no address: {}",
                    quoted(self.text(Some(columns.name)))
                ),
                "write one such as %I0.0 or %QW4",
            );
            return None;
        };
        if at_address.text == "<No Value>" {
            self.skipped.report(
                at_address.at,
                format!(
                    "{} has no address, as a tag with symbolic access: skipped",
                    quoted(self.text(Some(columns.name)))
                ),
                "export the tags of the PLC, not those of the panel",
            );
            return None;
        }
        let found = match world {
            World::Image(image) => self.in_image(at_address, image)?,
            World::Device(client) => self.in_device(at_address, client)?,
            World::Modules => self.in_module(at_address)?,
        };
        let at_name = self.cell(Some(columns.name));
        let name = name(at_name, at_address, wrong)?;
        let order = order(self.cell(columns.order), found.data_type, wrong)?;
        let scale = self.scale(found.data_type)?;
        let line = wrong.line(self.record[0].at);
        if let Some(first) = taken.names.get(name) {
            wrong.report(
                at_name.unwrap_or(at_address).at,
                format!(
                    "the name {} is that of the tag on line {first}",
                    quoted(name)
                ),
                "give each tag a name of its own",
            );
            return None;
        }
        if let Some(address) = found.address {
            let image = match world {
                World::Image(image) => image,
                World::Device(_) | World::Modules => Image::default(),
            };
            self.take(taken, address, line, image, name)?;
        }
        taken.names.insert(name.to_owned(), line);
        let unit: String = self
            .text(columns.unit)
            .chars()
            .filter(|c| !c.is_control())
            .take(LONGEST_UNIT)
            .collect();
        let unit = unit.trim();
        Some(Tag {
            name: name.to_owned(),
            area: found.area,
            address: found.address,
            at: found.at,
            data_type: found.data_type,
            order,
            unit: (!unit.is_empty()).then(|| unit.to_owned()),
            scale,
            comment: self.text(columns.comment).to_owned(),
            folder: self.text(columns.folder).to_owned(),
        })
    }

    fn in_image(&self, cell: &Cell, image: Image) -> Option<Found> {
        let mistake = match place(&cell.text, image.addressing) {
            ParsedAddress::Image(address) => {
                let wrong = if image.is_project {
                    self.skipped
                } else {
                    self.wrong
                };
                let stated = self.cell(self.columns.kind);
                let (data_type, address) = kind(stated, address, image.addressing, wrong)?;
                return Some(Found {
                    area: address.area,
                    address: Some(address),
                    at: String::new(),
                    data_type,
                });
            }
            ParsedAddress::Elsewhere(what) => {
                self.skipped.report(
                    cell.at,
                    format!(
                        "{} is {what}, no part of the process image: skipped",
                        quoted(&cell.text)
                    ),
                    "let the PLC program copy it from %I or to %Q if the simulation needs it",
                );
                return None;
            }
            ParsedAddress::Wrong(_) | ParsedAddress::Nothing
                if image.is_project && without_place(&cell.text).is_some() =>
            {
                return self.unplaced(cell);
            }
            ParsedAddress::Nothing if cell.text.ends_with('*') => return self.unplaced(cell),
            ParsedAddress::Wrong(mistake) => mistake,
            ParsedAddress::Nothing => Mistake::new(
                format!("{} is no address", quoted(&cell.text)),
                "addresses look like %I0.0, %IB4, %QW2, %ID8",
            ),
        };
        self.wrong.collect(cell.at, mistake);
        None
    }

    /// An input or output with a place that another part of the PLC's project determines.
    fn unplaced(&self, cell: &Cell) -> Option<Found> {
        let Some((area, width)) = without_place(&cell.text) else {
            self.skipped.report(
                cell.at,
                format!("{} is no input or output: skipped", quoted(&cell.text)),
                "let the PLC program copy it from %I or to %Q if the simulation needs it",
            );
            return None;
        };
        let stated = self
            .cell(self.columns.kind)
            .filter(|cell| !cell.text.is_empty());
        let data_type = match (stated, width) {
            (Some(stated), _) => {
                let known = stated.text.parse().ok();
                if known.is_none() {
                    unknown_type(stated, self.skipped);
                }
                known?
            }
            (None, Some(width)) => width.data_type(),
            (None, None) => {
                let what = format!(
                    "{} has neither a place nor a type: skipped",
                    quoted(&cell.text)
                );
                self.skipped.report(cell.at, what, "state one of the two");
                return None;
            }
        };
        Some(Found {
            area,
            address: None,
            at: cell.text.clone(),
            data_type,
        })
    }

    fn in_device(&self, cell: &Cell, client: Client) -> Option<Found> {
        if cell.text.chars().nth(LONGEST_ADDRESS).is_some() {
            let what = format!(
                "the address {} is longer than {LONGEST_ADDRESS} characters",
                quoted(&cell.text)
            );
            self.wrong.report(cell.at, what, "shorten it");
            return None;
        }
        if client == Client::S7
            && let ParsedAddress::Elsewhere(
                what @ ("a timer" | "a counter" | "a block" | "local data of a block"),
            ) = place(&cell.text, Addressing::Bytes)
        {
            self.skipped.report(
                cell.at,
                format!(
                    "{} is {what}, which the bus s7-client does not read: skipped",
                    quoted(&cell.text)
                ),
                "let the PLC program copy it into a marker or a data block if the simulation needs it",
            );
            return None;
        }
        let spots = match device::spots(&cell.text, client) {
            Ok(spots) => spots,
            Err(mistake) => {
                self.wrong.collect(cell.at, mistake);
                return None;
            }
        };
        let data_type = match spots.data_type {
            Some(stated) => self.agreed(stated, cell, client)?,
            None => self.client_type()?.unwrap_or(spots.width.data_type()),
        };
        // Several registers form a wider value; nothing else is combined.
        let is_of_registers = client == Client::Modbus && spots.width == Width::Word;
        let is_half = data_type.width() == Width::Byte;
        let fits = data_type.width() == spots.width
            || (is_of_registers && !is_half && data_type.width() != Width::Bit)
            || (spots.is_half && is_half);
        if !fits {
            self.wrong.report(
                self.cell(self.columns.kind).unwrap_or(cell).at,
                format!(
                    "{data_type} does not fit {}: the one has {} bits, the other {}",
                    quoted(&cell.text),
                    data_type.width().bits(),
                    spots.width.bits()
                ),
                if is_of_registers && is_half {
                    "write \"400021.0\" for the low byte of the register and \"400021.8\" for the high one, or another type"
                } else if is_of_registers {
                    "name a bit of the register, such as 400021.0, or another type"
                } else {
                    "correct the one or the other"
                },
            );
            return None;
        }
        let stated = self.direction()?;
        if (stated, spots.area) == (Some(Area::Input), Some(Area::Output)) {
            self.wrong.report(
                self.cell(self.columns.direction).unwrap_or(cell).at,
                format!("the simulation cannot write {}", quoted(&cell.text)),
                "write \"output\" or RO for what it reads, or name a place that it can write",
            );
            return None;
        }
        // Clients only read a PLC's inputs, but the simulation writes them. Without a known direction, a tag
        // is read.
        let area = spots.area.or(stated).unwrap_or(Area::Output);
        Some(Found {
            area,
            address: None,
            at: cell.text.clone(),
            data_type,
        })
    }

    /// Claims the bits of `address`, or reports which tag has them.
    fn take(
        &self,
        taken: &mut Taken,
        address: Address,
        line: usize,
        image: Image,
        name: &str,
    ) -> Option<()> {
        let memory = if image.is_apart {
            address.width as usize
        } else {
            0
        };
        let bits = &mut taken.bits[memory][usize::from(address.area == Area::Output)];
        let range = address.bits();
        if bits.len() < range.end {
            bits.resize(range.end, 0);
        }
        let (first, others) = (bits[range.start], &bits[range.clone()]);
        if let Some(other) = others.iter().find(|line| **line > 0) {
            let at = self
                .cell(Some(self.columns.address))
                .map_or(0, |cell| cell.at);
            if image.is_project && others.iter().all(|line| *line == first) {
                self.skipped.report(
                    at,
                    format!(
                        "{} ({address}) is where the tag on line {other} is: skipped",
                        quoted(name)
                    ),
                    "nothing, if both mean the same",
                );
                return None;
            }
            let right = match image.addressing {
                Addressing::Bytes if address.width.bytes() > 1 => {
                    "each bit belongs to one signal: keep one of the two; if the numbers count elements, as in CODESYS, \
                     add --iec"
                }
                _ => "each bit belongs to one signal: keep one of the two",
            };
            self.wrong.report(
                at,
                format!(
                    "{} ({address}) overlaps the tag on line {other}",
                    quoted(name)
                ),
                right,
            );
            return None;
        }
        bits[range].fill(u32::try_from(line).unwrap_or(u32::MAX));
        Some(())
    }

    /// The type stated by an address, unless the type column states another one.
    fn agreed(&self, stated: DataType, address: &Cell, client: Client) -> Option<DataType> {
        // Text that is no type is a comment.
        let column = self.cell(self.columns.kind);
        let known = column.and_then(|cell| Some((cell, self.known_type(&cell.text)?)));
        let Some((cell, other)) = known.filter(|(_, other)| *other != stated) else {
            return Some(stated);
        };
        // In KEPServer's addresses the type hardly states more than a size.
        let is_float = |kind| matches!(kind, DataType::Real | DataType::Lreal);
        let is_size = client == Client::S7 && self.columns.scale.is_some();
        if is_size && other.width() == stated.width() && is_float(other) == is_float(stated) {
            return Some(other);
        }
        self.wrong.report(
            cell.at,
            format!(
                "{other} is not the type {stated} that {} states",
                quoted(&address.text)
            ),
            "correct the one or the other",
        );
        None
    }

    /// The type of a text in the terms of IEC 61131-3 or of KEPServer.
    fn known_type(&self, text: &str) -> Option<DataType> {
        // Both have BYTE and WORD; under KEPServer's headings the KEPServer types apply.
        let (iec, kepserver) = (text.parse().ok(), kepserver_type(text));
        if self.columns.scale.is_some() {
            kepserver.or(iec)
        } else {
            iec.or(kepserver)
        }
    }

    /// An input or output of a module: `Local:1:I.Data.0`.
    fn in_module(&self, cell: &Cell) -> Option<Found> {
        let data_type = self.client_type()?.unwrap_or(DataType::Bool);
        let area = device::module_side(&cell.text).unwrap_or(Area::Output);
        Some(Found {
            area,
            address: None,
            at: cell.text.clone(),
            data_type,
        })
    }

    /// The type stated in the column.
    #[expect(clippy::option_option, reason = "wrong, not stated, stated")]
    fn client_type(&self) -> Option<Option<DataType>> {
        let Some(cell) = self
            .cell(self.columns.kind)
            .filter(|cell| !cell.text.is_empty())
        else {
            return Some(None);
        };
        let known = self.known_type(&cell.text);
        if known.is_none() {
            unknown_type(cell, self.wrong);
        }
        known.map(Some)
    }

    /// The direction stated in a column: the simulation writes inputs of the PLC, the PLC writes its outputs.
    #[expect(clippy::option_option, reason = "wrong, not stated, stated")]
    fn direction(&self) -> Option<Option<Area>> {
        let Some(cell) = self.cell(self.columns.direction) else {
            return Some(None);
        };
        match cell.text.to_lowercase().as_str() {
            "" | "r/w" | "rw" | "read/write" => Some(None),
            "ro" | "read only" | "out" | "output" | "%q" | "q" => Some(Some(Area::Output)),
            "wo" | "write only" | "in" | "input" | "%i" | "i" => Some(Some(Area::Input)),
            _ => {
                self.wrong.report(
                    cell.at,
                    format!("{} is no direction", quoted(&cell.text)),
                    "write \"input\" for what the simulation writes into the PLC, \"output\" for what it reads, or RO, WO, R/W",
                );
                None
            }
        }
    }

    /// KEPServer's linear scale.
    #[expect(clippy::option_option, reason = "wrong, not stated, stated")]
    fn scale(&self, data_type: DataType) -> Option<Option<[f64; 4]>> {
        let Some([kind, values @ ..]) = self.columns.scale else {
            return Some(None);
        };
        let Some(cell) = self.cell(Some(kind)) else {
            return Some(None);
        };
        let right =
            "a linear scale has two raw values that differ, and two scaled ones that differ";
        match cell.text.to_lowercase().as_str() {
            "" | "none" => return Some(None),
            "linear" if data_type != DataType::Bool => {}
            _ => {
                let what = format!(
                    "{} is no scale that a {data_type} can have: left out",
                    quoted(&cell.text)
                );
                self.skipped.report(cell.at, what, right);
                return Some(None);
            }
        }
        let numbers = values.map(|column| {
            self.text(Some(column))
                .parse::<f64>()
                .ok()
                .filter(|n| n.is_finite())
        });
        let differ = |one: f64, two: f64| (one - two).abs() > 0.0;
        if let [Some(one), Some(two), Some(three), Some(four)] = numbers
            && differ(one, two)
            && differ(three, four)
        {
            return Some(Some([one, two, three, four]));
        }
        self.wrong
            .report(cell.at, "the linear scale has wrong values", right);
        None
    }
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", shown(text))
}

/// The type, and the address with that type's size.
fn kind(
    cell: Option<&Cell>,
    address: Address,
    addressing: Addressing,
    wrong: &Collector<'_>,
) -> Option<(DataType, Address)> {
    let Some(cell) = cell.filter(|cell| !cell.text.is_empty()) else {
        return Some((address.width.data_type(), address));
    };
    let Ok(data_type) = cell.text.trim_matches('"').parse::<DataType>() else {
        unknown_type(cell, wrong);
        return None;
    };
    if data_type.width() == address.width {
        return Some((data_type, address));
    }
    // TIA Portal has no size letter for 64-bit types and writes them like a bit.
    let is_plain = address.width == Width::Bit && address.bit == 0;
    if data_type.width() == Width::Long && is_plain && addressing == Addressing::Bytes {
        let long = Address {
            width: Width::Long,
            ..address
        };
        if long.byte + Width::Long.bytes() <= AREA_LIMIT {
            return Some((data_type, long));
        }
    }
    let fitting: Vec<&str> = DataType::ALL
        .into_iter()
        .filter(|candidate| candidate.width() == address.width)
        .map(DataType::name)
        .collect();
    wrong.report(
        cell.at,
        format!(
            "{data_type} does not fit {address}: the one has {} bits, the other {}",
            data_type.width().bits(),
            address.width.bits()
        ),
        format!("{address} takes {}", fitting.join(", ")),
    );
    None
}

fn name<'c>(cell: Option<&'c Cell>, at_address: &Cell, wrong: &Collector<'_>) -> Option<&'c str> {
    let Some(cell) = cell.filter(|cell| !cell.text.is_empty()) else {
        wrong.report(
            at_address.at,
            format!("the tag at {} has no name", quoted(&at_address.text)),
            "give it one",
        );
        return None;
    };
    let name = cell.text.as_str();
    if name.chars().any(char::is_control) {
        wrong.report(
            cell.at,
            format!("the name {} has a control character in it", quoted(name)),
            "write it with printable characters only",
        );
    } else if name.starts_with("bus.") {
        wrong.report(
            cell.at,
            format!("the name {} begins with \"bus.\"", quoted(name)),
            "choose another; that beginning is kept for bus.age, bus.sequence, bus.status",
        );
    } else if name.chars().nth(NAME_LIMIT).is_some() {
        wrong.report(
            cell.at,
            format!(
                "the name {} is longer than {NAME_LIMIT} characters",
                quoted(name)
            ),
            "shorten it",
        );
    } else {
        return Some(name);
    }
    None
}

fn order(cell: Option<&Cell>, data_type: DataType, wrong: &Collector<'_>) -> Option<ByteOrder> {
    let Some(cell) = cell.filter(|cell| !cell.text.is_empty()) else {
        return Some(ByteOrder::default());
    };
    let known = ByteOrder::ALL
        .into_iter()
        .find(|order| order.name().eq_ignore_ascii_case(&cell.text));
    match known {
        Some(order) if data_type.size_bytes() > 1 || order == ByteOrder::default() => Some(order),
        _ => {
            wrong.report(
                cell.at,
                format!(
                    "{} is no byte order that a signal of type {data_type} can have",
                    quoted(&cell.text)
                ),
                "byte orders are ABCD, CDAB, BADC, DCBA, of values with two bytes and more",
            );
            None
        }
    }
}

fn unknown_type(cell: &Cell, wrong: &Collector<'_>) {
    let right = match cell.text.to_ascii_uppercase().as_str() {
        "TIME" => "a TIME is a DINT of milliseconds: write DINT".to_owned(),
        "CHAR" => "write BYTE or USINT".to_owned(),
        "TIME_OF_DAY" | "TOD" => "write UDINT".to_owned(),
        "DATE" => "write UINT".to_owned(),
        _ => did_you_mean(&cell.text, "types", &DataType::ALL.map(DataType::name)),
    };
    wrong.report(
        cell.at,
        format!("{} is no type that a signal can have", quoted(&cell.text)),
        right,
    );
}
