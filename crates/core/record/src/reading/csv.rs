//! Reading CSV as written by tickbus.

use std::collections::{HashMap, HashSet};
use std::io::BufRead;
use std::str::FromStr;

use super::lines::WholeLines;
use super::{RECORD_AGAIN, ReadError};
use crate::csv::{HEAD, STATION};
use crate::{Column, Columns, Tick, ValueKind};
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Signal, SignalTable, Slot};

pub(super) struct CsvReader<R> {
    lines: WholeLines<R>,
}

impl<R: BufRead> CsvReader<R> {
    /// Reads the header; `table` provides the types of the columns.
    pub(super) fn open(
        from: R,
        table: Option<&SignalTable>,
    ) -> Result<(Self, Columns), (ReadError, u64)> {
        let mut reader = Self {
            lines: WholeLines::new(from),
        };
        let columns = reader.header(table).map_err(|fault| (fault, 1))?;
        Ok((reader, columns))
    }

    fn header(&mut self, table: Option<&SignalTable>) -> Result<Columns, ReadError> {
        if !self
            .lines
            .advance()
            .map_err(|error| ReadError::io(&error))?
        {
            let what = if self.lines.is_cut() {
                "the recording is cut within its header"
            } else {
                "the recording is empty"
            };
            return Err(ReadError::new(what, RECORD_AGAIN));
        }
        let line = std::str::from_utf8(self.lines.line())
            .map_err(|_| ReadError::new("the header is no UTF-8 text", RECORD_AGAIN))?;
        let names = cells(line.trim_end_matches(['\n', '\r'])).ok_or_else(|| {
            ReadError::new(
                "the header has a quotation mark in the wrong place",
                RECORD_AGAIN,
            )
        })?;
        if names.len() < HEAD.len() || names.iter().zip(HEAD).any(|(name, head)| name != head) {
            return Err(ReadError::new(
                format!("the header does not begin with {}", HEAD.join(",")),
                "only recordings of tickbus can be read",
            ));
        }
        let (stations, names): (Vec<String>, Vec<String>) = names
            .into_iter()
            .skip(HEAD.len())
            .partition(|name| name.starts_with(STATION));
        let stations = stations.iter().map(|name| name[STATION.len()..].to_owned());
        let mut columns = Columns {
            stations: stations.collect(),
            ..Columns::default()
        };
        let signals = table.into_iter().flat_map(|table| &table.signals);
        let signals: HashMap<&str, &Signal> = signals
            .map(|signal| (signal.name.as_str(), signal))
            .collect();
        let mut seen = HashSet::new();
        for name in names {
            let base = name.strip_suffix(".edges");
            let is_edges = base.is_some_and(|base| seen.contains(base));
            let base = base.filter(|_| is_edges).unwrap_or(&name);
            let signal = signals.get(base).copied();
            columns.columns.push(Column {
                name: base.to_owned(),
                is_edges,
                kind: match signal {
                    _ if is_edges => ValueKind::Count,
                    Some(signal) => ValueKind::of(signal.data_type, signal.scale.is_some()),
                    None => ValueKind::Real,
                },
                address: signal.map(Signal::plc_address),
                data_type: signal.map(|signal| signal.data_type),
                unit: signal.and_then(|signal| signal.unit.clone()),
                station: table
                    .zip(signal)
                    .map(|(table, signal)| table.stations[signal.station].name.clone())
                    .unwrap_or_default(),
            });
            seen.insert(name);
        }
        Ok(columns)
    }

    pub(super) fn line(&self) -> u64 {
        self.lines.number()
    }

    pub(super) fn is_cut(&self) -> bool {
        self.lines.is_cut()
    }

    pub(super) fn ending(&self) -> String {
        if self.is_cut() {
            "the recording is cut within a line".to_owned()
        } else {
            "the recording has no more ticks".to_owned()
        }
    }

    /// Reads the next line.
    pub(super) fn next(&mut self, tick: &mut Tick, columns: &Columns) -> Result<bool, ReadError> {
        if !self
            .lines
            .advance()
            .map_err(|error| ReadError::io(&error))?
        {
            return Ok(false);
        }
        let line = std::str::from_utf8(self.lines.line())
            .map_err(|_| ReadError::new("this line is no UTF-8 text", RECORD_AGAIN))?;
        let mut cells = Cells {
            rest: Some(line.trim_end_matches(['\n', '\r'])),
            taken: 0,
            wanted: HEAD.len() + columns.stations.len() + columns.columns.len(),
        };
        let (number, time) = (cells.number::<u64>()?, Nanos(cells.number()?));
        if number <= tick.number {
            let what = format!("tick {number} comes after tick {}", tick.number);
            return Err(ReadError::new(what, RECORD_AGAIN));
        }
        if tick.number > 0 && time < tick.time {
            let what = format!("the time goes back from {} to {time}", tick.time);
            return Err(ReadError::new(what, RECORD_AGAIN));
        }
        (tick.number, tick.time) = (number, time);
        tick.status = cells.number()?;
        tick.dropped = cells.number()?;
        for status in &mut tick.stations {
            *status = cells.number()?;
        }
        for (column, value) in columns.columns.iter().zip(&mut tick.values) {
            *value = match column.kind {
                ValueKind::Signed => Slot::from_signed(cells.number()?),
                ValueKind::Unsigned => Slot::from_unsigned(cells.number()?),
                kind => kind.kept(Slot::from_real(cells.number()?)),
            };
        }
        cells.end()?;
        Ok(true)
    }
}

/// The values of one line.
struct Cells<'a> {
    rest: Option<&'a str>,
    taken: usize,
    wanted: usize,
}

impl Cells<'_> {
    fn number<T: FromStr>(&mut self) -> Result<T, ReadError> {
        let Some(rest) = self.rest else {
            return Err(self.miscounted(self.taken));
        };
        let (cell, rest) = match rest.split_once(',') {
            Some((cell, rest)) => (cell, Some(rest)),
            None => (rest, None),
        };
        self.rest = rest;
        self.taken += 1;
        cell.parse().map_err(|_| {
            let shown: String = cell.chars().take(40).collect();
            let what = format!(
                "\"{shown}\" in column {} is no number of its kind",
                self.taken
            );
            ReadError::new(what, RECORD_AGAIN)
        })
    }

    fn end(&self) -> Result<(), ReadError> {
        match self.rest {
            None => Ok(()),
            Some(rest) => Err(self.miscounted(self.taken + 1 + rest.matches(',').count())),
        }
    }

    fn miscounted(&self, has: usize) -> ReadError {
        let wanted = self.wanted;
        ReadError::new(
            format!("this line has {has} values, the header names {wanted}"),
            RECORD_AGAIN,
        )
    }
}

/// The cells of a header; `None` if a quotation mark is not closed or is within a cell.
fn cells(line: &str) -> Option<Vec<String>> {
    let mut cells = Vec::new();
    let mut rest = line;
    loop {
        let (cell, behind) = if let Some(quoted) = rest.strip_prefix('"') {
            unquoted(quoted)?
        } else {
            let end = rest.find(',').unwrap_or(rest.len());
            (rest[..end].to_owned(), &rest[end..])
        };
        cells.push(cell);
        match behind.strip_prefix(',') {
            Some(more) => rest = more,
            None => return behind.is_empty().then_some(cells),
        }
    }
}

/// The cell that begins after a quotation mark, and the text after the closing one.
fn unquoted(text: &str) -> Option<(String, &str)> {
    let (mut cell, mut rest) = (String::new(), text);
    loop {
        let (part, behind) = rest.split_once('"')?;
        cell.push_str(part);
        match behind.strip_prefix('"') {
            Some(more) => {
                cell.push('"');
                rest = more;
            }
            None => return Some((cell, behind)),
        }
    }
}
