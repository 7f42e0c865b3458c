//! The lines of `[fieldbus.at]` at a server: the CPU has its variables where its program put them.

use std::collections::BTreeSet;

use crate::Variable;
use crate::item::Object;
use tickbus_base::toml_text::{Collector, shown};
use tickbus_fieldbus::At;
use tickbus_image::signal::{SignalTable, Station};

use super::ServerOptions;
use super::options::BlockLength;

/// The most bytes of all objects together.
const MEMORY: usize = 16 << 20;

/// A signal of `[fieldbus.at]`: its CPU, its place, and its line.
struct Placed<'l, 'a> {
    cpu: Option<usize>,
    object: Object,
    first: usize,
    end: usize,
    line: &'l At<'a>,
}

impl ServerOptions {
    /// Takes the lines, and reports those that are invalid, do not fit their signals, or would put two values in one
    /// place.
    pub fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        let mut placed = Vec::new();
        for line in lines {
            let signal = &table.signals[line.signal];
            let variable: Variable = match line.text.parse() {
                Ok(variable) => variable,
                Err(what) => {
                    line.wrong(what, Variable::RIGHT);
                    continue;
                }
            };
            if let Err(mistake) = variable.check(signal) {
                line.refuse(mistake);
                continue;
            }
            self.variables.insert(signal.name.clone(), variable);
            let (first, bits) = variable.bits();
            placed.push(Placed {
                cpu: self.cpu(table, signal.station),
                object: variable.object,
                first,
                end: first + bits,
                line,
            });
        }
        placed.sort_by_key(|placed| (placed.cpu, placed.object, placed.first));
        self.report_overlaps(&placed, table);
        self.report_beside_blocks(&placed, table);
        report_unplaced(lines, table);
    }

    /// Reports two signals in one place, unless this end only reads both.
    fn report_overlaps(&self, placed: &[Placed<'_, '_>], table: &SignalTable) {
        // The places that reach furthest so far: of all signals, and of those that this end writes.
        let mut furthest: [Option<&Placed<'_, '_>>; 2] = [None, None];
        for next in placed {
            let sends = self.sends(table, next);
            // A written signal must not overlap with any other; read signals may overlap with each other.
            let others = if sends { &furthest[..] } else { &furthest[1..] };
            let meets = |other: &&Placed<'_, '_>| {
                (other.cpu, other.object) == (next.cpu, next.object) && next.first < other.end
            };
            if let Some(other) = others.iter().flatten().copied().find(meets) {
                const RIGHT: &str = "give each value that this end writes a place of its own; only those that it reads \
                    can share one, such as a WORD and its bits";
                for (one, two) in [(next, other), (other, next)] {
                    let name = shown(&table.signals[two.line.signal].name);
                    one.line.wrong(format!("\"{name}\" is there, too"), RIGHT);
                }
            }
            for (reaches, furthest) in [true, sends].into_iter().zip(&mut furthest) {
                let is_further = furthest.is_none_or(|other| {
                    (other.cpu, other.object) != (next.cpu, next.object) || next.end > other.end
                });
                if reaches && is_further {
                    *furthest = Some(next);
                }
            }
        }
    }

    fn sends(&self, table: &SignalTable, placed: &Placed<'_, '_>) -> bool {
        self.role.writes(table.signals[placed.line.signal].area)
    }

    /// Reports signals in data blocks that are a part of an image.
    fn report_beside_blocks(&self, placed: &[Placed<'_, '_>], table: &SignalTable) {
        for placed in placed {
            let number = match placed.object {
                Object::Block(number) => number,
                Object::Flags if placed.end > self.flags * 8 && self.are_flags_stated => {
                    placed.line.wrong(
                        format!("the flags have {} bytes", self.flags),
                        format!("write m_bytes = {}, or more", placed.end.div_ceil(8)),
                    );
                    continue;
                }
                _ => continue,
            };
            if self.blocks.iter().any(|block| block.number == number) {
                placed.line.wrong(
                    format!("DB{number} is the image of a station, by \"db\""),
                    "take another data block, or leave out \"area\" in \"db\"",
                );
                continue;
            }
            let station = table.signals[placed.line.signal].station;
            let mut lengths = self.lengths_of(table, station);
            let stated = lengths.find(|length| length.number == number);
            if let Some(length) = stated
                && placed.end > length.length * 8
            {
                placed.line.wrong(
                    format!("DB{number} has {} bytes, by \"db\"", length.length),
                    format!("write length = {}, or more", placed.end.div_ceil(8)),
                );
            }
        }
    }

    /// Returns true if lines place the signals of a station.
    pub(crate) fn is_placed(&self, table: &SignalTable, station: usize) -> bool {
        let mut signals = table.signals.iter();
        signals.any(|signal| signal.station == station && self.variables.contains_key(&signal.name))
    }

    /// The station itself if only clients that connect to its slot find its objects; `None` if all clients do.
    pub(super) fn cpu(&self, table: &SignalTable, station: usize) -> Option<usize> {
        let is_alone = table.stations.len() == 1;
        let slot = self.slots.get(station).copied().flatten();
        (!is_alone && slot.is_some()).then_some(station)
    }

    /// The stated lengths of data blocks of a station.
    pub(super) fn lengths_of<'o>(
        &'o self,
        table: &'o SignalTable,
        station: usize,
    ) -> impl Iterator<Item = &'o BlockLength> {
        let name = &table.stations[station].name;
        let is_common = self.cpu(table, station).is_none();
        let lengths = self.lengths.iter();
        lengths.filter(move |length| match &length.station {
            Some(of) => of == name,
            None => is_common,
        })
    }

    /// Reports lengths of data blocks, and blocks of the image, that do not fit what is placed.
    pub(super) fn fit_places(&self, table: &SignalTable, collector: &Collector<'_>) {
        let placed: Vec<bool> = (0..table.stations.len())
            .map(|station| self.is_placed(table, station))
            .collect();
        for length in &self.lengths {
            let wrong = |what: String, right: &str| collector.report(length.at, what, right);
            let number = length.number;
            let named = |station: &Station| Some(&station.name) == length.station.as_ref();
            let station = table.stations.iter().position(named);
            match (&length.station, station) {
                (Some(name), None) => wrong(
                    format!("there is no station \"{}\"", shown(name)),
                    "name the [[station]] that is the CPU with the block",
                ),
                (_, Some(station)) if !placed[station] => wrong(
                    format!(
                        "data block {number} has no \"area\", and [fieldbus.at] places nothing of its station"
                    ),
                    "add the area whose bytes it has: area = \"%Q\" or \"%I\"",
                ),
                (None, _) if !placed.contains(&true) => wrong(
                    format!("data block {number} has no \"area\", and there is no [fieldbus.at]"),
                    "add the area whose bytes it has: area = \"%Q\" or \"%I\"",
                ),
                (None, _) => {
                    let cpus = (0..placed.len()).filter(|station| placed[*station]);
                    let mut cpus = cpus.map(|station| self.cpu(table, station));
                    if cpus.all(|cpu| cpu.is_some()) {
                        wrong(
                            format!(
                                "data block {number} names no station, and each CPU has blocks of its own"
                            ),
                            "add \"station\"",
                        );
                    }
                }
                _ => {}
            }
        }
        for block in &self.blocks {
            if let Some(station) = block.station_in(table)
                && placed[station]
            {
                collector.report(
                    block.at,
                    format!(
                        "data block {} is a part of an image, and [fieldbus.at] places the signals of that station",
                        block.number
                    ),
                    "leave out \"area\" and \"offset\": \"length\" alone is the length of a block that [fieldbus.at] has",
                );
            }
        }
        if placed.contains(&true) {
            let objects = super::layout::objects(self, table);
            let bytes: usize = objects.iter().map(|object| object.bytes.len()).sum();
            if bytes > MEMORY {
                collector.report(
                    self.at,
                    format!("the data blocks of [fieldbus.at] have {bytes} bytes in all"),
                    format!("place the signals within {MEMORY} bytes: a block begins at byte 0"),
                );
            }
        }
    }
}

/// Reports the signals without a line of stations that have lines.
fn report_unplaced(lines: &[At<'_>], table: &SignalTable) {
    for station in 0..table.stations.len() {
        let of_station = |line: &&At<'_>| table.signals[line.signal].station == station;
        let Some(line) = lines.iter().find(of_station) else {
            continue;
        };
        let lined: BTreeSet<usize> = lines.iter().map(|line| line.signal).collect();
        let signals = table.signals.iter().enumerate();
        let missing =
            signals.filter(|(at, signal)| signal.station == station && !lined.contains(at));
        let missing = missing.map(|(_, signal)| signal.name.as_str());
        let missing: Vec<&str> = missing.collect();
        if let [first, rest @ ..] = &missing[..] {
            let others = match rest.len() {
                0 => String::new(),
                count => format!(" (and {count} more)"),
            };
            line.wrong(
                format!(
                    "no line places \"{}\"{others}, and a server with [fieldbus.at] has nothing else",
                    shown(first)
                ),
                "write a line for each signal of the station, or none at all",
            );
        }
    }
}
