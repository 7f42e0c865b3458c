//! Stations, and the rules that involve several signals of a driver.cfg.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};

use crate::Options;
use tickbus_axis as axis;
use tickbus_axis::Axis;
use tickbus_base::toml_text::{Key, Shape, Table, Value, did_you_mean, shown};
use tickbus_image::signal::section::{self, NAME_LIMIT, STATION, Section};
use tickbus_image::signal::{AREA_LIMIT, Addressing, Area, SignalTable, Station};
use tickbus_reply::Drive;

/// The most signals of one driver.
pub(super) const SIGNAL_LIMIT: usize = 100_000;

/// The most axes of one driver; each has about fifteen signals.
pub(super) const AXIS_LIMIT: usize = 2_000;

/// The most drives of one driver; each has up to twenty signals.
pub(super) const DRIVE_LIMIT: usize = 1_000;

/// The most stations of one driver.
pub const STATION_LIMIT: usize = 256;

/// The keys of the sizes of a station's areas.
pub(crate) const SIZE_KEYS: &[Key] = &[
    Key::new(
        "input_bytes",
        Shape::Whole(0, AREA_LIMIT as i128),
        "The size of %I; as far as the signals reach if it is left out",
    ),
    Key::new(
        "output_bytes",
        Shape::Whole(0, AREA_LIMIT as i128),
        "The size of %Q; as far as the signals reach if it is left out",
    ),
];

/// The sizes of a station's areas, where stated.
#[derive(Clone, Debug, Default)]
pub(super) struct Sizes<'a> {
    input: Option<Value<'a>>,
    output: Option<Value<'a>>,
}

impl<'a> Sizes<'a> {
    /// Takes `input_bytes` and `output_bytes` out of a table.
    pub(super) fn take(table: &mut Table<'a>) -> Self {
        Self {
            input: table.take("input_bytes"),
            output: table.take("output_bytes"),
        }
    }

    fn of(&self, area: Area) -> Option<&Value<'a>> {
        match area {
            Area::Input => self.input.as_ref(),
            Area::Output => self.output.as_ref(),
        }
    }
}

/// A `[[station]]` table, as far as it could be read.
struct Declared<'a> {
    name: String,
    sizes: Sizes<'a>,
}

/// Reads the `[[signal]]`, `[[axis]]` and `[[drive]]` tables; signals are in the order of the file.
pub(super) fn read_signals<'a>(
    signals: Vec<Table<'a>>,
    axes: Vec<Table<'a>>,
    drives: Vec<Table<'a>>,
    addressing: Addressing,
) -> (Vec<Axis>, Vec<Drive<'a>>, Vec<Section<'a>>) {
    let mut all = Vec::new();
    for table in signals {
        let at = table.at();
        all.extend(section::read(table, addressing).map(|section| (at, section)));
    }
    let mut read = Vec::new();
    let mut places = axis::section::OffsetAllocator::default();
    let count = axes.len();
    for (number, table) in axes.into_iter().enumerate() {
        let at = table.at();
        if let Some(axis) = axis::section::read(table, number, addressing, &mut places) {
            read.push(axis.axis);
            all.extend(axis.sections.into_iter().map(|section| (at, section)));
        }
    }
    let mut driven = Vec::new();
    for (number, table) in drives.into_iter().enumerate() {
        let at = table.at();
        if let Some(read) = axis::section::drives::read(table, count + number, &mut places) {
            driven.push(Drive {
                name: read.name,
                setup: read.setup,
                conditions: read.conditions,
            });
            all.extend(read.sections.into_iter().map(|section| (at, section)));
        }
    }
    // A stable sort, so that the signals of one axis stay in order.
    all.sort_by_key(|(at, _)| *at);
    let sections = all.into_iter().map(|(_, section)| section).collect();
    (read, driven, sections)
}

/// Assigns the signals, those of `axes` among them, to their stations and reports conflicts.
///
/// `declared` are the `[[station]]` tables and `sizes` the sizes in `[fieldbus]`; `bus` reads its own keys from the
/// `[[station]]` tables. Returns a table even if there were mistakes, as far as that makes sense.
pub(super) fn lay_out<'a>(
    mut sections: Vec<Section<'a>>,
    axes: &[Axis],
    declared: Option<Vec<Table<'a>>>,
    sizes: Sizes<'a>,
    bus: Option<&mut Options>,
) -> Option<SignalTable> {
    let (stations, certain) = match declared {
        None => (
            vec![Declared {
                name: String::new(),
                sizes,
            }],
            true,
        ),
        Some(tables) => read_stations(tables, &sizes, bus)?,
    };
    // A signal whose station is unknown is not checked against the areas.
    let mut placed = vec![true; sections.len()];
    // A table's station is looked up and reported only once, even if the table has many signals.
    let mut of_tables = HashMap::new();
    for (section, placed) in sections.iter_mut().zip(&mut placed) {
        let look_up = || station_of(section, &stations, certain);
        let found = match section.structure {
            Some(structure) => *of_tables.entry(structure.table).or_insert_with(look_up),
            None => look_up(),
        };
        match found {
            Some(station) => section.signal.station = station,
            None => *placed = false,
        }
    }
    check_names(&sections);
    let stations: Vec<Station> = stations
        .iter()
        .enumerate()
        .map(|(index, station)| {
            let here: Vec<usize> = (0..sections.len())
                .filter(|number| placed[*number] && sections[*number].signal.station == index)
                .collect();
            let bytes = |area| size_of(area, &station.sizes, &sections, &here);
            Station {
                name: station.name.clone(),
                input_bytes: bytes(Area::Input),
                output_bytes: bytes(Area::Output),
                observed_bytes: 0,
            }
        })
        .collect();
    check_overlaps(&sections, &placed);
    let signals = sections.into_iter().map(|section| section.signal).collect();
    let structures = axes.iter().map(Axis::structure).collect();
    Some(SignalTable {
        stations,
        signals,
        structures,
    })
}

/// Reads the `[[station]]` tables. The flag is true if all their names are known.
fn read_stations<'a>(
    tables: Vec<Table<'a>>,
    of_fieldbus: &Sizes<'a>,
    mut bus: Option<&mut Options>,
) -> Option<(Vec<Declared<'a>>, bool)> {
    for (key, value) in [
        ("input_bytes", &of_fieldbus.input),
        ("output_bytes", &of_fieldbus.output),
    ] {
        if let Some(value) = value {
            value.wrong(
                format!("\"{key}\" stands in [fieldbus], but there are [[station]] tables"),
                "write the sizes into those",
            );
        }
    }
    if let Some(table) = tables.get(STATION_LIMIT) {
        table.wrong(
            format!("there are {} stations", tables.len()),
            format!("a driver has at most {STATION_LIMIT}"),
        );
        return None;
    }
    let mut certain = true;
    let mut lines = HashMap::new();
    let mut stations = Vec::new();
    let count = tables.len();
    for mut table in tables {
        let name = table.require("name", "give the station a name of its own");
        let sizes = Sizes::take(&mut table);
        if let Some(bus) = &mut bus {
            bus.read_station(count, &mut table);
            table.finish();
        } else {
            // Without the bus kind, the valid keys are unknown.
            table.finish_open();
        }
        let label = name
            .as_ref()
            .and_then(|name| name.label(NAME_LIMIT, "give the station a name"));
        certain &= label.is_some();
        if let (Some(name), Some(label)) = (name, label) {
            match lines.entry(label) {
                Entry::Vacant(free) => {
                    free.insert(name.line());
                }
                Entry::Occupied(first) => name.wrong(
                    format!(
                        "the name \"{}\" is that of the station on line {}",
                        shown(label),
                        first.get()
                    ),
                    "give each station a name of its own",
                ),
            }
        }
        stations.push(Declared {
            name: label.unwrap_or_default().to_owned(),
            sizes,
        });
    }
    if stations.is_empty() {
        stations.push(Declared {
            name: String::new(),
            sizes: Sizes::default(),
        });
    }
    Some((stations, certain))
}

/// Returns the index of a signal's station; `certain` is true if all station names are known.
fn station_of(section: &Section<'_>, stations: &[Declared<'_>], certain: bool) -> Option<usize> {
    let names = || {
        stations
            .iter()
            .map(|station| station.name.as_str())
            .collect::<Vec<_>>()
    };
    let Some(value) = &section.station else {
        if stations.len() > 1 {
            section.address.wrong(
                format!(
                    "{} names no station, and there are {}",
                    section.title(),
                    stations.len()
                ),
                format!("add station = \"{}\", or another of them", stations[0].name),
            );
            return None;
        }
        return Some(0);
    };
    let name = value.text(STATION)?;
    if name.is_empty() {
        value.wrong("\"station\" is empty", "write the name of a [[station]]");
        return None;
    }
    let found = stations.iter().position(|station| station.name == name);
    if found.is_none() && certain {
        let right = if stations.iter().all(|station| station.name.is_empty()) {
            format!("declare it with [[station]] and name = \"{}\"", shown(name))
        } else {
            did_you_mean(name, "stations", &names())
        };
        value.wrong(format!("there is no station \"{}\"", shown(name)), right);
    }
    found
}

/// Reports duplicate names, even if the tables have other mistakes; `what` is their noun, such as "signal".
pub(super) fn check_twins(tables: &[Table<'_>], what: &str) {
    let mut first: HashMap<&str, Value<'_>> = HashMap::new();
    for table in tables {
        let Some((_, value)) = table.all().find(|(key, _)| *key == "name") else {
            continue;
        };
        match value.as_text().map(|name| (name, first.entry(name))) {
            Some((name, Entry::Occupied(taken))) if !name.is_empty() => value.wrong(
                format!(
                    "the name \"{}\" is that of the {what} on line {}",
                    shown(name),
                    taken.get().line(),
                ),
                format!("give each {what} a name of its own"),
            ),
            Some((_, Entry::Vacant(free))) => {
                free.insert(value);
            }
            _ => {}
        }
    }
}

/// Reports signals that have the name of an edge count, or of a signal of an axis or a drive.
fn check_names(sections: &[Section<'_>]) {
    let mut first: HashMap<&str, &Section<'_>> = HashMap::new();
    for section in sections {
        let Some(taken) = first.insert(&section.signal.name, section) else {
            continue;
        };
        let twins = section.structure.is_none() && taken.structure.is_none();
        // If one name is derived and the other written, the written one must change.
        let (wrong, other) = if section.has_own_name() {
            (section, taken)
        } else {
            (taken, section)
        };
        if let (Some(name), true, false) = (&wrong.name, wrong.has_own_name(), twins) {
            name.wrong(
                format!(
                    "the name \"{}\" is that of a signal of the {} on line {}",
                    shown(&section.signal.name),
                    other.structure.map_or("table", |structure| structure.kind),
                    line_of(other),
                ),
                "choose another",
            );
        }
    }
    let latched: HashMap<&str, &Section<'_>> = sections
        .iter()
        .filter(|section| section.signal.latch.is_some())
        .map(|section| (section.signal.name.as_str(), section))
        .collect();
    for section in sections {
        let counted = section.signal.name.strip_suffix(".edges");
        let counted = counted.and_then(|name| latched.get(name));
        if let (Some(name), Some(counted)) = (&section.name, counted) {
            name.wrong(
                format!(
                    "the name \"{}\" is that of the edge count of the latched signal on line {}",
                    shown(&section.signal.name),
                    line_of(counted),
                ),
                "choose another",
            );
        }
    }
}

/// Returns the line that a message about another signal names.
fn line_of(section: &Section<'_>) -> usize {
    section.name.as_ref().unwrap_or(&section.address).line()
}

/// Returns the size of one area of the station that has the signals `here`: the stated size, or as far as the signals
/// reach.
fn size_of(area: Area, sizes: &Sizes<'_>, sections: &[Section<'_>], here: &[usize]) -> usize {
    let in_area = || {
        here.iter()
            .map(|number| &sections[*number])
            .filter(|section| section.signal.area == area)
    };
    let extent = in_area().map(Section::end).max().unwrap_or(0);
    let Some(value) = sizes.of(area) else {
        return extent;
    };
    let limit = i128::try_from(AREA_LIMIT).expect("a small number");
    let Some(stated) = value
        .whole(0..=limit)
        .and_then(|size| usize::try_from(size).ok())
    else {
        return extent;
    };
    // An axis that does not fit is one mistake, not one per signal.
    let mut told = HashSet::new();
    for section in in_area().filter(|section| section.end() > stated) {
        if let Some(structure) = section.structure
            && !told.insert(structure.table)
        {
            continue;
        }
        section.address.wrong(
            format!(
                "{} ends at byte {}, but {area} has {stated} {} (line {})",
                section.title(),
                section.end() - 1,
                if stated == 1 { "byte" } else { "bytes" },
                value.line(),
            ),
            format!("use an address below byte {stated}, or enlarge {area}"),
        );
    }
    stated
}

/// Checks that no bit belongs to two signals. Each signal is reported once, as the later of two in the file.
fn check_overlaps(sections: &[Section<'_>], placed: &[bool]) {
    let mut order: Vec<usize> = (0..sections.len())
        .filter(|number| placed[*number])
        .collect();
    let group = |number: usize| {
        let signal = &sections[number].signal;
        (signal.station, signal.area == Area::Output)
    };
    let bits = |number: usize| sections[number].signal.address().bits();
    order.sort_by_key(|number| (group(*number), bits(*number).start, *number));
    let mut blamed = vec![false; sections.len()];
    // An axis in the wrong place is one mistake per area, not one per signal.
    let mut told = HashSet::new();
    for one_area in order.chunk_by(|one, other| group(*one) == group(*other)) {
        let extent = one_area
            .iter()
            .map(|number| bits(*number).end.div_ceil(8))
            .max()
            .unwrap_or(0);
        let mut farthest = one_area[0];
        for &number in &one_area[1..] {
            if bits(number).start < bits(farthest).end {
                let (first, later) = (number.min(farthest), number.max(farthest));
                let told = sections[later]
                    .structure
                    .is_some_and(|structure| !told.insert((structure.table, group(later))));
                if !std::mem::replace(&mut blamed[later], true) && !told {
                    report_overlap(&sections[first], &sections[later], extent);
                }
            }
            if bits(number).end > bits(farthest).end {
                farthest = number;
            }
        }
    }
}

fn report_overlap(first: &Section<'_>, later: &Section<'_>, extent: usize) {
    let signal = &later.signal;
    // A section copied as a whole is one mistake, which its duplicate name has already reported.
    let copied = !signal.name.is_empty()
        && signal.name == first.signal.name
        && signal.address() == first.signal.address();
    if copied {
        return;
    }
    let free = if extent < AREA_LIMIT {
        format!(
            "each bit belongs to one signal; {} is free from byte {extent} on",
            signal.area
        )
    } else {
        "each bit belongs to one signal".to_owned()
    };
    later.address.wrong(
        format!(
            "{} overlaps {} on line {}",
            later.label(),
            first.label(),
            line_of(first)
        ),
        free,
    );
}
