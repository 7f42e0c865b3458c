//! Plans the requests of a cycle: as few as possible that transfer all signals of a station.

use std::collections::BTreeMap;

use crate::function::{
    READ_BITS, READ_REGISTERS, READ_WRITE_REGISTERS, WRITE_BITS, WRITE_REGISTERS,
};
use crate::table::{Span, Table};

use super::request::{Region, Request};
use crate::Piece;

/// The capabilities of a device, which determine the requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "functions that a device has or not, independent of each other"
)]
pub struct Capabilities {
    /// One request can write and read holding registers: function 23.
    pub combine: bool,
    /// The widest gap in a table, in bits, that is read over to save a request.
    pub gap: usize,
    /// The device has function 15; otherwise coils are written one at a time.
    pub many_coils: bool,
    /// The device has function 16; otherwise registers are written one at a time.
    pub many_registers: bool,
    /// The device has function 22; otherwise bits of registers are not written.
    pub masks: bool,
}

impl Capabilities {
    /// The capabilities assumed of an unknown device.
    pub const fn new(combine: bool, gap: usize) -> Self {
        Self {
            combine,
            gap,
            many_coils: true,
            many_registers: true,
            masks: true,
        }
    }
}

/// The requests of one cycle, writes first.
///
/// Every piece is read or written once. A read may include gaps between pieces; a write never includes anything else. A
/// piece is split only if it shares registers with others and together they exceed the limit of a request.
pub fn queries(reads: &[Piece], writes: &[Piece], able: &Capabilities) -> Vec<Request> {
    let is_holding = |piece: &Piece| piece.table == Table::HoldingRegisters;
    let combine = able.combine
        && able.many_registers
        && reads.iter().any(is_holding)
        && writes.iter().any(is_holding);
    let able = Capabilities { combine, ..*able };
    let mut queries = Vec::new();
    let mut reads: Vec<Region> = by_table(reads)
        .flat_map(|(table, pieces)| readings(table, &pieces, able.gap))
        .collect();
    for (table, pieces) in by_table(writes) {
        for query in writings(table, &pieces, &able) {
            let beside = |read: &Region| read.table == Table::HoldingRegisters;
            queries.push(match query {
                Request::Write(write) if combine && beside(&write) => {
                    match reads.iter().position(beside) {
                        Some(read) => Request::Both {
                            write,
                            read: reads.remove(read),
                        },
                        None => Request::Write(write),
                    }
                }
                query => query,
            });
        }
    }
    queries.extend(reads.into_iter().map(Request::Read));
    queries
}

/// The pieces of each table in order of place; tables in order of first occurrence.
fn by_table(pieces: &[Piece]) -> impl Iterator<Item = (Table, Vec<Piece>)> {
    let mut tables: Vec<Table> = Vec::new();
    for piece in pieces {
        if !tables.contains(&piece.table) {
            tables.push(piece.table);
        }
    }
    tables.into_iter().map(|table| {
        let of_table = pieces.iter().filter(|piece| piece.table == table);
        let mut of_table: Vec<Piece> = of_table.copied().collect();
        of_table.sort_by_key(|piece| (piece.wire, piece.bits));
        (table, of_table)
    })
}

/// The reads from one table, whose pieces are in order.
fn readings(table: Table, pieces: &[Piece], gap: usize) -> Vec<Region> {
    let limit = if table.is_bits() {
        READ_BITS
    } else {
        READ_REGISTERS
    };
    let mut regions: Vec<Region> = Vec::new();
    for piece in pieces {
        let span = piece.span();
        if let Some(last) = regions.last_mut() {
            let end = last.span.end().max(span.end());
            let between = span.first.saturating_sub(last.span.end()) * table.width();
            if end - last.span.first <= limit && between <= gap {
                last.span.count = end - last.span.first;
                last.joined |= between > 0;
                last.take(*piece);
                continue;
            }
        }
        let mut region = Region::new(table, span);
        region.take(*piece);
        regions.push(region);
    }
    regions
}

/// The writes to one table, whose pieces are in order.
fn writings(table: Table, pieces: &[Piece], able: &Capabilities) -> Vec<Request> {
    let (most, many) = match (table.is_bits(), able.combine) {
        (true, _) => (WRITE_BITS, able.many_coils),
        (false, true) => (READ_WRITE_REGISTERS, able.many_registers),
        (false, false) => (WRITE_REGISTERS, able.many_registers),
    };
    let (whole, partial) = elements(table, pieces);
    let mut queries: Vec<Request> = partial
        .into_iter()
        .filter(|_| able.masks)
        .map(|first| Request::Mask(region(table, Span { first, count: 1 }, pieces)))
        .collect();
    let mut rest = whole.into_iter().peekable();
    while let Some(first) = rest.next() {
        let mut run = Span { first, count: 1 };
        while rest.next_if_eq(&run.end()).is_some() {
            run.count += 1;
        }
        while run.count > 0 {
            let count = if many { cut(run, most, pieces) } else { 1 };
            let part = Span {
                first: run.first,
                count,
            };
            let region = region(table, part, pieces);
            queries.push(if many {
                Request::Write(region)
            } else {
                Request::WriteOne(region)
            });
            run = Span {
                first: part.end(),
                count: run.count - count,
            };
        }
    }
    queries
}

/// The offsets of elements covered completely by pieces, and of those covered in part; both in order.
fn elements(table: Table, pieces: &[Piece]) -> (Vec<usize>, Vec<usize>) {
    const ALL: u16 = 0xFFFF;
    let mut covered: BTreeMap<usize, u16> = BTreeMap::new();
    for piece in pieces {
        let span = piece.span();
        for offset in span.first..span.end() {
            let bits = if table.is_bits() || piece.fills {
                ALL
            } else {
                let own = piece.within(offset * 16, offset * 16 + 16);
                own.map_or(0, |own| mask(own.wire - offset * 16, own.bits))
            };
            *covered.entry(offset).or_default() |= bits;
        }
    }
    let (whole, partial): (Vec<_>, Vec<_>) =
        covered.into_iter().partition(|(_, bits)| *bits == ALL);
    let offsets = |elements: Vec<(usize, u16)>| elements.into_iter().map(|(at, _)| at).collect();
    (offsets(whole), offsets(partial))
}

/// A mask of `bits` bits, starting at bit `from`.
fn mask(from: usize, bits: usize) -> u16 {
    (from..from + bits).fold(0, |mask, bit| mask | 1 << bit)
}

/// The number of elements of `run` that one request writes, at most `most`, if possible without splitting a piece.
fn cut(run: Span, most: usize, pieces: &[Piece]) -> usize {
    if run.count <= most {
        return run.count;
    }
    let mut end = run.first + most;
    while let Some(span) = near(pieces, end)
        .map(|piece| piece.span())
        .find(|span| span.first < end && end < span.end())
    {
        if span.first <= run.first {
            return most;
        }
        end = span.first;
    }
    end - run.first
}

/// The pieces, which are in order, that may touch the elements next to the one at this offset.
fn near(pieces: &[Piece], offset: usize) -> impl Iterator<Item = &Piece> {
    let width = pieces.first().map_or(1, |piece| piece.table.width());
    let bit = offset * width;
    let begin = pieces.partition_point(|piece| piece.wire + Piece::LONGEST + width < bit);
    let end = pieces.partition_point(|piece| piece.wire < bit + width);
    pieces[begin..end.max(begin)].iter()
}

/// The elements `span` of a table with the parts of pieces in them.
fn region(table: Table, span: Span, pieces: &[Piece]) -> Region {
    let (begin, end) = (span.first * table.width(), span.end() * table.width());
    let from = pieces.partition_point(|piece| piece.wire + Piece::LONGEST < begin);
    let to = pieces.partition_point(|piece| piece.wire < end);
    let mut region = Region::new(table, span);
    for piece in &pieces[from..to] {
        if let Some(own) = piece.within(begin, end) {
            region.take(own);
        }
    }
    region
}

#[cfg(test)]
mod tests;
