//! The record of one direction: the images of all stations, one after another, as they lie in the PLC.

use std::collections::HashMap;

use super::names::{Names, legal};
use crate::config::short_number;
use crate::signal::{Address, Area, ByteOrder, DataType, Signal, SignalTable};

/// The bytes of one direction, with a place for each signal.
#[derive(Debug)]
pub(super) struct Record<'a> {
    pub(super) bytes: usize,
    /// In the order in which they lie.
    pub(super) places: Vec<Place<'a>>,
}

/// Where a signal lies in the PLC, and what it is called there.
#[derive(Clone, Debug)]
pub(super) struct Place<'a> {
    pub(super) signal: &'a Signal,
    /// Name of its station; empty where there is but one.
    pub(super) station: &'a str,
    /// Its first byte, counted from the start of the record.
    pub(super) byte: usize,
    /// A legal name of its own.
    pub(super) name: String,
}

impl Place<'_> {
    pub(super) fn data_type(&self) -> DataType {
        self.signal.data_type
    }

    pub(super) fn bit(&self) -> u8 {
        self.signal.bit
    }

    pub(super) fn size(&self) -> usize {
        self.signal.data_type.size_bytes()
    }

    /// The byte behind its last one.
    pub(super) fn end(&self) -> usize {
        self.byte + self.size()
    }

    /// Its address in the PLC, counted in bytes.
    pub(super) fn address(&self) -> Address {
        Address {
            byte: self.byte,
            ..self.signal.address()
        }
    }

    /// What is to be known about it beyond name and type, for a comment: address, name, station, unit, scale.
    pub(super) fn remark(&self) -> String {
        let mut text = format!("{} \"{}\"", self.address(), self.signal.name);
        if !self.station.is_empty() {
            text = format!("{text} of station \"{}\"", self.station);
        }
        for more in facts(self.signal) {
            text.push_str(", ");
            text.push_str(&more);
        }
        text
    }
}

/// Unit, scale and byte order as words.
pub(super) fn facts(signal: &Signal) -> Vec<String> {
    let mut facts = Vec::new();
    if let Some(scale) = signal.scale {
        let unit = signal.unit.as_deref().unwrap_or("value");
        let mut text = format!("{unit} = raw * {}", short_number(scale.gain));
        if scale.offset != 0.0 {
            let sign = if scale.offset < 0.0 { '-' } else { '+' };
            text = format!("{text} {sign} {}", short_number(scale.offset.abs()));
        }
        facts.push(text);
    } else if let Some(unit) = &signal.unit {
        facts.push(unit.clone());
    }
    if signal.order != ByteOrder::Abcd {
        facts.push(format!("byte order {}", signal.order));
    }
    facts
}

impl<'a> Record<'a> {
    /// The record of one direction; `names` gives the names.
    pub(super) fn of(table: &'a SignalTable, area: Area, names: &mut Names) -> Self {
        Self::aligned(table, area, 1, names)
    }

    /// The same with each station from a multiple of `aligned` bytes on.
    pub(super) fn aligned(
        table: &'a SignalTable,
        area: Area,
        aligned: usize,
        names: &mut Names,
    ) -> Self {
        let mut starts = Vec::with_capacity(table.stations.len());
        let mut bytes: usize = 0;
        for station in &table.stations {
            bytes = bytes.next_multiple_of(aligned);
            starts.push(bytes);
            bytes += station.bytes(area);
        }
        let several = table.stations.len() > 1;
        let here = table.signals.iter().filter(|signal| signal.area == area);
        let mut places: Vec<Place<'a>> = here
            .map(|signal| Place {
                signal,
                station: if several {
                    &table.stations[signal.station].name
                } else {
                    ""
                },
                byte: starts[signal.station] + signal.byte,
                name: String::new(),
            })
            .collect();
        places.sort_by_key(|place| place.address().bits().start);
        for place in &mut places {
            let full = if several {
                format!("{} {}", place.station, place.signal.name)
            } else {
                place.signal.name.clone()
            };
            place.name = names.give(&full);
        }
        Self { bytes, places }
    }

    /// Where each station's image begins, for a comment; nothing where there is but one.
    pub(super) fn stations(table: &SignalTable) -> Vec<String> {
        Self::stations_aligned(table, 1)
    }

    /// The same with each station from a multiple of `aligned` bytes on.
    pub(super) fn stations_aligned(table: &SignalTable, aligned: usize) -> Vec<String> {
        if table.stations.len() < 2 {
            return Vec::new();
        }
        let mut starts = [0_usize; 2];
        let mut lines = Vec::new();
        for station in &table.stations {
            starts = starts.map(|start| start.next_multiple_of(aligned));
            lines.push(format!(
                "station \"{}\": its %IB0 is %IB{} here, its %QB0 is %QB{}",
                station.name, starts[0], starts[1]
            ));
            starts[0] += station.input_bytes;
            starts[1] += station.output_bytes;
        }
        lines
    }
}

/// Suffix, offset, bit, type and byte order of each member of a group.
pub(super) type Shape = Vec<(String, usize, u8, DataType, ByteOrder)>;

/// Signals that belong together, told by the part of their names before the last dot.
#[derive(Debug)]
pub(super) struct Group<'r, 'a> {
    /// That part.
    pub(super) name: String,
    pub(super) byte: usize,
    pub(super) bytes: usize,
    pub(super) places: &'r [Place<'a>],
}

impl Group<'_, '_> {
    /// What tells its shape.
    pub(super) fn shape(&self) -> Shape {
        let members = self.places.iter().map(|place| {
            let suffix = suffix(&place.signal.name).to_owned();
            let order = place.signal.order;
            (
                suffix,
                place.byte - self.byte,
                place.bit(),
                place.data_type(),
                order,
            )
        });
        members.collect()
    }

    /// The names of its members, in order.
    pub(super) fn members(&self) -> Vec<String> {
        let mut names = Names::default();
        let suffixes = self.places.iter().map(|place| suffix(&place.signal.name));
        suffixes.map(|suffix| names.give(suffix)).collect()
    }
}

fn prefix(name: &str) -> Option<&str> {
    name.rsplit_once('.')
        .map(|(prefix, _)| prefix)
        .filter(|prefix| !prefix.is_empty())
}

fn suffix(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(_, suffix)| suffix)
}

impl<'a> Record<'a> {
    /// The runs of two signals and more with one prefix that can be a structure of the PLC: on an even byte, of an
    /// even size, nothing else in between. Equal ones in a row get the whole distance to the next, so that the
    /// reserve at their ends belongs to them.
    pub(super) fn groups(&self) -> Vec<Group<'_, 'a>> {
        let key = |place: &Place<'a>| {
            prefix(&place.signal.name).map(|prefix| (place.signal.station, prefix.to_owned()))
        };
        let mut groups: Vec<Group<'_, 'a>> = Vec::new();
        let mut counts = HashMap::new();
        for run in self.places.chunk_by(|one, other| key(one) == key(other)) {
            let Some((station, name)) = key(&run[0]) else {
                continue;
            };
            *counts.entry((station, name.clone())).or_insert(0) += 1;
            let byte = run[0].byte;
            let end = run.iter().map(Place::end).max().unwrap_or(byte);
            groups.push(Group {
                name,
                byte,
                bytes: end - byte,
                places: run,
            });
        }
        // A prefix in two places is not one structure; a bit of a stranger in its first or last byte neither.
        let begins = |byte: usize| self.places.partition_point(|place| place.byte < byte);
        groups.retain(|group| {
            let inside = begins(group.byte)..begins(group.byte + group.bytes);
            group.places.len() > 1
                && group.byte % 2 == 0
                && counts[&(group.places[0].signal.station, group.name.clone())] == 1
                && inside.len() == group.places.len()
        });
        self.stretch(&mut groups);
        groups.retain(|group| group.bytes % 2 == 0);
        groups
    }

    fn stretch(&self, groups: &mut [Group<'_, 'a>]) {
        let shapes: Vec<Shape> = groups.iter().map(Group::shape).collect();
        // How many there are of a shape, and the shortest way from one to the next.
        let mut alike: HashMap<&Shape, (usize, usize)> = HashMap::new();
        for (group, shape) in groups.iter().zip(&shapes) {
            let next = self
                .places
                .partition_point(|place| place.byte < group.byte + group.bytes);
            let next = self.places.get(next).map_or(self.bytes, |place| place.byte);
            let (count, reach) = alike.entry(shape).or_insert((0, usize::MAX));
            *count += 1;
            *reach = (*reach).min(next - group.byte);
        }
        for (group, shape) in groups.iter_mut().zip(&shapes) {
            let (count, reach) = alike[shape];
            // The reserve behind a single one may be anybody's: it only gets what makes its size even.
            let wanted = if count > 1 {
                reach & !1
            } else {
                group.bytes.next_multiple_of(2).min(reach)
            };
            group.bytes = group.bytes.max(wanted);
        }
    }
}

/// The prefix of all names of a driver's blocks.
pub(super) fn block_prefix(driver: &str) -> String {
    let name: String = legal(driver).chars().take(40).collect();
    legal(&name)
}
