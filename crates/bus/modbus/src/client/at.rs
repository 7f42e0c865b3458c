//! The lines of `[fieldbus.at]`: signals with their own place in the device.

use crate::TagAddress;
use tickbus_fieldbus::At;
use tickbus_fieldbus::{Role, both_ways};
use tickbus_image::signal::{Signal, SignalTable};

use super::ClientOptions;
use super::area_mapping::nobody_writes;
use crate::Piece;

impl ClientOptions {
    /// Takes the lines, and reports those that are invalid, do not fit their signals, or would make two signals write
    /// to the same place.
    pub fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        let mut placed = Vec::new();
        for line in lines {
            let signal = &table.signals[line.signal];
            let spot: TagAddress = match line.text.parse() {
                Ok(spot) => spot,
                Err(mistake) => {
                    line.refuse(mistake);
                    continue;
                }
            };
            if let Err(mistake) = Piece::of_tag(signal, spot) {
                line.refuse(mistake);
                continue;
            }
            let of_table = spot.place.table;
            if self.role.writes(signal.area) && !of_table.is_writable() {
                line.refuse(nobody_writes(of_table));
                continue;
            }
            self.at.insert(signal.name.clone(), spot);
            placed.push(line);
        }
        let stations = match self.role {
            Role::Observer => 0,
            _ => table.stations.len(),
        };
        for station in 0..stations {
            self.check_claims(&placed, table, station);
        }
    }

    /// The signals that are written to a place where another one is read, each with the other one.
    pub fn both_ways(&self, table: &SignalTable) -> Vec<(usize, usize)> {
        let (writes, _) = self.role.areas();
        let is_placed = |signal: &Signal| self.at.contains_key(&signal.name);
        both_ways(table, writes, is_placed, |signal| {
            let pieces = if let Some(spot) = self.at.get(&signal.name) {
                Piece::of_tag(signal, *spot).into_iter().collect()
            } else {
                let bytes = table.stations[signal.station].bytes(signal.area);
                let blocks = self.blocks(signal.area, bytes).unwrap_or_default();
                let parts = blocks.iter();
                let parts = parts.filter_map(|block| Piece::of_block(signal, block));
                parts.collect::<Vec<_>>()
            };
            let place = |piece: Piece| {
                let bits = if signal.area == writes {
                    piece.claim()
                } else {
                    piece.wire..piece.wire + piece.bits
                };
                ((signal.station, piece.table), bits)
            };
            pieces.into_iter().map(place).collect()
        })
    }

    /// Reports lines of signals that would be written into bits of another signal.
    fn check_claims(&self, lines: &[&At<'_>], table: &SignalTable, station: usize) {
        let (writes, _) = self.role.areas();
        let blocks = self.blocks(writes, table.stations[station].bytes(writes));
        let blocks = blocks.unwrap_or_default();
        // All writes: the bits, and their signal.
        let mut claims: Vec<(Piece, usize)> = Vec::new();
        for (index, signal) in table.signals.iter().enumerate() {
            if signal.station != station || signal.area != writes {
                continue;
            }
            if let Some(spot) = self.at.get(&signal.name) {
                let piece = Piece::of_tag(signal, *spot).ok();
                claims.extend(piece.map(|piece| (piece, index)));
            } else {
                let parts = blocks.iter();
                let parts = parts.filter_map(|block| Piece::of_block(signal, block));
                claims.extend(parts.map(|piece| (piece, index)));
            }
        }
        claims.sort_by_key(|(piece, _)| (piece.table.digit(), piece.claim().start));
        // The claim that reaches furthest so far.
        let mut furthest: Option<(Piece, usize)> = None;
        for (piece, index) in claims {
            if let Some((other, of)) = furthest
                && other.table == piece.table
                && piece.claim().start < other.claim().end
            {
                // Signals placed by their image address may share a register: it is written once.
                let line = |index| lines.iter().find(move |line| line.signal == index);
                let (line, name) = match (line(index), line(of)) {
                    (Some(line), _) => (Some(line), &table.signals[of].name),
                    (None, line) => (line, &table.signals[index].name),
                };
                if let Some(line) = line {
                    line.wrong(
                        format!("\"{name}\" is written there, too"),
                        "give each signal that this end writes a place of its own; a signal without a line has the \
                         whole of its registers",
                    );
                }
                if piece.claim().end <= other.claim().end {
                    continue;
                }
            }
            furthest = Some((piece, index));
        }
    }
}
