//! The lines of `[fieldbus.at]` at a server: the device has its elements where its maker put them.

use crate::{Map, Piece, Side, TagAddress};
use tickbus_base::Mistake;
use tickbus_base::toml_text::Collector;
use tickbus_fieldbus::At;
use tickbus_image::signal::{Area, SignalTable};

use super::ServerOptions;

impl ServerOptions {
    /// Takes the lines, and reports those that are invalid, do not fit their signals, or would put two values in one
    /// place.
    pub fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        let mut pieces = Vec::new();
        for line in lines {
            let signal = &table.signals[line.signal];
            let spot: TagAddress = match line.text.parse() {
                Ok(spot) => spot,
                Err(mistake) => {
                    line.refuse(mistake);
                    continue;
                }
            };
            self.at.insert(signal.name.clone(), spot);
            match self.piece(signal.area, spot, Piece::of_tag(signal, spot)) {
                Ok((side, piece)) => pieces.push((side, piece, line)),
                Err(mistake) => line.refuse(mistake),
            }
        }
        pieces.sort_by_key(|(_, piece, line)| {
            let station = table.signals[line.signal].station;
            (station, piece.table.digit(), piece.wire)
        });
        // The piece that reaches furthest so far.
        let mut furthest: Option<&(Side, Piece, &At<'_>)> = None;
        for next in &pieces {
            let (side, piece, line) = next;
            if let Some((other_side, other, of)) = furthest {
                let [station, other_station] =
                    [line, of].map(|line| table.signals[line.signal].station);
                let end = other.wire + other.bits;
                let meets = (station, piece.table) == (other_station, other.table);
                let shares = piece.span().first < other.span().end();
                if meets && piece.wire >= end && shares && side != other_side {
                    let name = &table.signals[of.signal].name;
                    line.wrong(
                        format!(
                            "\"{name}\" is in the same register, and one of the two is written by this end: clients \
                             write whole registers, so they could never write the other"
                        ),
                        "put what this end writes and what it reads into different registers",
                    );
                }
                if meets && piece.wire < end {
                    if (*side, *other_side) != (Side::Holds, Side::Holds) {
                        let name = &table.signals[of.signal].name;
                        line.wrong(
                            format!("\"{name}\" is there, too"),
                            "give each value that this end writes a place of its own; only those that it reads can \
                             share one, such as a WORD and its bits",
                        );
                    }
                    if piece.wire + piece.bits <= end {
                        continue;
                    }
                }
            }
            furthest = Some(next);
        }
        self.report_unplaced(lines, table);
    }

    /// Reports the signals without a line of stations that have lines.
    fn report_unplaced(&self, lines: &[At<'_>], table: &SignalTable) {
        for station in 0..table.stations.len() {
            let of_station = |line: &&At<'_>| table.signals[line.signal].station == station;
            let Some(line) = lines.iter().find(of_station) else {
                continue;
            };
            let signals = table.signals.iter();
            let missing = signals
                .filter(|signal| signal.station == station && !self.at.contains_key(&signal.name));
            let missing: Vec<&str> = missing.map(|signal| signal.name.as_str()).collect();
            if let [first, rest @ ..] = &missing[..] {
                let others = match rest.len() {
                    0 => String::new(),
                    count => format!(" (and {count} more)"),
                };
                line.wrong(
                    format!("no line places \"{first}\"{others}, and a server with [fieldbus.at] has nothing else"),
                    "write a line for each signal of the station, or none at all",
                );
            }
        }
    }

    /// The side and the place of a signal.
    fn piece(
        &self,
        area: Area,
        spot: TagAddress,
        piece: Result<Piece, Mistake>,
    ) -> Result<(Side, Piece), Mistake> {
        let side = self.side(area);
        let of_table = spot.place.table;
        if side == Side::Holds && !of_table.is_writable() {
            return Err(Mistake::new(
                format!("clients cannot write {of_table}"),
                "this end reads the signal, so put it in holding registers or coils, or check \"role\"",
            ));
        }
        Ok((side, piece?))
    }

    /// The side of an area.
    pub(super) fn side(&self, area: Area) -> Side {
        match (area, self.input) {
            (Area::Input, input) => input,
            (Area::Output, Side::Sends) => Side::Holds,
            (Area::Output, Side::Holds) => Side::Sends,
        }
    }

    /// Returns true if lines place the signals of a station.
    pub(crate) fn is_placed(&self, table: &SignalTable, station: usize) -> bool {
        let mut signals = table.signals.iter();
        signals.any(|signal| signal.station == station && self.at.contains_key(&signal.name))
    }

    /// The tables of a station, and what function 7 and 24 read of them.
    pub(super) fn map(&self, table: &SignalTable, station: usize) -> Map {
        let status = self.exception_status;
        let status = status.map(|(place, _)| (place.table, place.offset));
        let queues: Vec<usize> = self.queues.iter().map(|(first, _)| *first).collect();
        self.elements(table, station).with_extras(status, &queues)
    }

    /// Reports bits of function 7 and queues of function 24 that no station has.
    pub(super) fn fit_extras(&self, table: &SignalTable, collector: &Collector<'_>) {
        const RIGHT: &str = "name elements that `tickbus check` shows, or add them to [fieldbus.at] or \"reserved\"";
        if self.exception_status.is_none() && self.queues.is_empty() {
            return;
        }
        let stations = 0..table.stations.len();
        let maps: Vec<Map> = stations.map(|station| self.map(table, station)).collect();
        if let Some((_, at)) = self.exception_status
            && maps.iter().all(|map| map.exception_status().is_none())
        {
            collector.report(at, "there are no eight elements from here on", RIGHT);
        }
        for (first, at) in &self.queues {
            if maps.iter().all(|map| !map.queues().contains(first)) {
                collector.report(*at, "there is no such register", RIGHT);
            }
        }
    }

    /// The elements of a station.
    fn elements(&self, table: &SignalTable, station: usize) -> Map {
        if self.is_placed(table, station) {
            // Mistakes were reported when the driver.cfg was read.
            let signals = table.signals.iter();
            let signals = signals.filter(|signal| signal.station == station);
            let pieces = signals.filter_map(|signal| {
                let piece = Piece::of_tag(signal, *self.at.get(&signal.name)?).ok()?;
                Some((self.side(signal.area), piece))
            });
            return Map::of_places(&pieces.collect::<Vec<_>>(), &self.reserved);
        }
        let bytes = |side| {
            let input = &table.stations[station];
            if side == self.input {
                input.input_bytes
            } else {
                input.output_bytes
            }
        };
        let window = self.window(table.stations[station].output_bytes);
        Map::of_areas(self.input, window, bytes(Side::Sends), bytes(Side::Holds))
    }
}
