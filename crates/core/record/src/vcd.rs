//! Writing VCD, the value change dump of IEEE 1364, for waveform viewers.
//!
//! Each changed value gets a line; the last line of every tick is that of the variable `tick`. So a tick is complete
//! when this line is, and ticks without other changes are in the file as well. Comments in the header describe the
//! variables, because VCD has no types, no units, and no arbitrary names.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Write as _;

use vcd::{IdCode, TimescaleUnit, VarType, Writer};

use super::VERSION;
use super::columns::{Column, Columns, Tick, ValueKind};
use super::sink::{Sink, count, real};
use tickbus_image::signal::Area;

/// The width of the status in bits: VCD has no signed values, so negative ones are in two's complement.
const STATUS_BITS: u32 = 32;

/// A station's name, and one of its areas.
type Scope<'a> = (&'a str, Option<Area>);

/// Writes VCD.
pub(super) struct VcdSink {
    columns: Columns,
    /// The identifier of each column, which follows its value.
    ids: Vec<String>,
    tick: String,
    dropped: String,
    /// The identifiers of the overall status, and of each station's.
    status: Vec<String>,
    /// The previous tick.
    last: Option<Tick>,
}

impl VcdSink {
    pub(super) fn new(columns: Columns) -> Self {
        let mut next = IdCode::FIRST;
        // Without quotation marks, which the comments use around names.
        let mut id = || loop {
            let id = next.to_string();
            next = next.next();
            if !id.contains('"') {
                break id;
            }
        };
        Self {
            tick: id(),
            dropped: id(),
            status: (0..=columns.stations.len()).map(|_| id()).collect(),
            ids: columns.columns.iter().map(|_| id()).collect(),
            columns,
            last: None,
        }
    }

    /// The comments before the scopes, for the reader of recordings.
    fn comments(&self) -> Vec<String> {
        let Self { columns, ids, .. } = self;
        let mut lines = vec![
            format!("tickbus recording {VERSION}"),
            format!("driver {} {}", quoted(&columns.driver), columns.role),
            format!("tick {}", self.tick),
            format!("dropped {}", self.dropped),
            format!("status {}", self.status[0]),
        ];
        for (id, station) in self.status[1..].iter().zip(&columns.stations) {
            lines.push(format!("status {id} station={}", quoted(station)));
        }
        for (id, column) in ids.iter().zip(&columns.columns) {
            let what = if column.is_edges { "edges" } else { "signal" };
            let mut line = format!("{what} {id}");
            let data_type = column.data_type.unwrap_or(column.kind.data_type());
            let address = column.address.map(|address| address.to_string());
            // Writing to a string cannot fail.
            let _ = write!(line, " {} {data_type}", address.as_deref().unwrap_or("-"));
            let _ = write!(line, " {}", quoted(&column.name));
            if column.is_scaled_integer() {
                line.push_str(" scaled");
            }
            if let Some(unit) = &column.unit {
                let _ = write!(line, " unit={}", quoted(unit));
            }
            if !column.station.is_empty() {
                let _ = write!(line, " station={}", quoted(&column.station));
            }
            lines.push(line);
        }
        lines
    }

    /// The scopes and their variables: the driver, within it the bus and each station's areas.
    fn scopes(&self, out: &mut Vec<u8>) -> std::io::Result<()> {
        let mut writer = Writer::new(out);
        let var = |writer: &mut Writer<_>, kind, width, id: &str, name: &str| {
            let id: IdCode = id.parse().expect("made by the same crate");
            writer.var_def(kind, width, id, name, None)
        };
        let mut modules = Names::default();
        writer.add_module(&modules.unique(&self.columns.driver))?;
        let mut inner = Names::default();
        writer.add_module(&inner.unique("bus"))?;
        let mut names = Names::default();
        let integer = VarType::Integer;
        var(&mut writer, integer, 64, &self.tick, &names.unique("tick"))?;
        let name = names.unique("dropped");
        var(&mut writer, integer, 64, &self.dropped, &name)?;
        let stations = self.columns.stations.iter();
        let titles = stations.map(|station| format!("status {station}"));
        for (id, title) in self
            .status
            .iter()
            .zip(std::iter::once("status".to_owned()).chain(titles))
        {
            let name = names.unique(&title);
            var(&mut writer, integer, STATUS_BITS, id, &name)?;
        }
        writer.upscope()?;
        for (place, members) in self.places() {
            let (station, area) = place;
            let name = match (station.is_empty(), area) {
                (true, Some(area)) => letter(area).to_owned(),
                (false, Some(area)) => format!("{station} {}", letter(area)),
                (true, None) => "signals".to_owned(),
                (false, None) => station.to_owned(),
            };
            writer.add_module(&inner.unique(&name))?;
            let mut names = Names::default();
            for index in members {
                let column = &self.columns.columns[index];
                let (kind, width) = match column.kind {
                    ValueKind::Bit => (VarType::Wire, 1),
                    ValueKind::Real => (VarType::Real, 64),
                    ValueKind::Signed => (VarType::Integer, 64),
                    ValueKind::Unsigned => (VarType::Wire, 64),
                    ValueKind::Count => (VarType::Integer, 32),
                };
                let name = names.unique(&column.title());
                var(&mut writer, kind, width, &self.ids[index], &name)?;
            }
            writer.upscope()?;
        }
        writer.upscope()?;
        writer.enddefinitions()
    }

    /// The columns by station and area, in order of first occurrence.
    fn places(&self) -> Vec<(Scope<'_>, Vec<usize>)> {
        let mut places: Vec<(Scope<'_>, Vec<usize>)> = Vec::new();
        let place = |column: &'_ Column| column.address.map(|address| address.area);
        for (index, column) in self.columns.columns.iter().enumerate() {
            let key = (column.station.as_str(), place(column));
            match places.iter_mut().find(|(known, _)| *known == key) {
                Some((_, members)) => members.push(index),
                None => places.push((key, vec![index])),
            }
        }
        places
    }
}

fn letter(area: Area) -> &'static str {
    match area {
        Area::Input => "I",
        Area::Output => "Q",
    }
}

impl Sink for VcdSink {
    fn header(&mut self, out: &mut Vec<u8>) {
        // Writing to memory cannot fail. No date, so that equal runs give equal files.
        let _ = writeln!(out, "$version tickbus {} $end", env!("CARGO_PKG_VERSION"));
        let _ = Writer::new(&mut *out).timescale(1, TimescaleUnit::NS);
        for line in self.comments() {
            let _ = writeln!(out, "$comment {line} $end");
        }
        let _ = self.scopes(out);
    }

    fn tick(&mut self, tick: &Tick, out: &mut Vec<u8>) {
        let last = self.last.as_ref();
        if last.is_none_or(|last| last.time != tick.time) {
            let _ = writeln!(out, "#{}", tick.time.0);
        }
        if last.is_none() {
            out.extend_from_slice(b"$dumpvars\n");
        }
        for (index, (column, id)) in self.columns.columns.iter().zip(&self.ids).enumerate() {
            let value = tick.values[index];
            if last.is_some_and(|last| last.values[index] == value) {
                continue;
            }
            let _ = match column.kind {
                ValueKind::Bit if value.real().is_nan() => writeln!(out, "x{id}"),
                ValueKind::Bit => writeln!(out, "{}{id}", u8::from(value.real() != 0.0)),
                ValueKind::Real => {
                    out.push(b'r');
                    real(value.real(), out);
                    writeln!(out, " {id}")
                }
                ValueKind::Signed | ValueKind::Unsigned => {
                    writeln!(out, "b{:b} {id}", value.unsigned())
                }
                ValueKind::Count => writeln!(out, "b{:b} {id}", count(value.real())),
            };
        }
        let statuses = std::iter::once(&tick.status).chain(&tick.stations);
        for (index, (status, id)) in statuses.zip(&self.status).enumerate() {
            let before = last.map(|last| match index {
                0 => last.status,
                station => last.stations[station - 1],
            });
            if before != Some(*status) {
                let _ = writeln!(out, "b{status:b} {id}");
            }
        }
        if last.is_none_or(|last| last.dropped != tick.dropped) {
            let _ = writeln!(out, "b{:b} {}", tick.dropped, self.dropped);
        }
        let _ = writeln!(out, "b{:b} {}", tick.number, self.tick);
        if last.is_none() {
            out.extend_from_slice(b"$end\n");
        }
        match &mut self.last {
            Some(last) => last.clone_from(tick),
            none => *none = Some(tick.clone()),
        }
    }

    fn end(&mut self, note: &str, out: &mut Vec<u8>) {
        let _ = writeln!(out, "$comment end {} $end", quoted(note));
    }
}

/// Quotes a text so that it cannot end the comment or span lines; escapes everything that is not ASCII, since
/// some readers accept nothing else.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        if matches!(c, '"' | '\\' | '$') || !c.is_ascii() || c.is_ascii_control() {
            let _ = write!(out, "\\u{{{:x}}}", u32::from(c));
        } else {
            out.push(c);
        }
    }
    out.push('"');
    out
}

/// Names as VCD permits them, each unique.
#[derive(Default)]
struct Names(HashMap<String, usize>);

impl Names {
    /// Letters, digits and underscores, not beginning with a digit.
    fn unique(&mut self, name: &str) -> String {
        let legal = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let mut base: String = name.chars().map(legal).collect();
        if base.is_empty() || base.starts_with(|c: char| c.is_ascii_digit()) {
            base.insert(0, '_');
        }
        let mut unique = base.clone();
        // The search for a free number starts at the number of times the name was requested.
        while self.0.contains_key(&unique) {
            let wanted = self.0.entry(base.clone()).or_default();
            *wanted += 1;
            unique = format!("{base}_{}", *wanted + 1);
        }
        self.0.insert(unique.clone(), 0);
        unique
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_legal_and_stay_apart() {
        let mut names = Names::default();
        let seen = [
            "LA1 position",
            "LA1.position",
            "4 way",
            "",
            "Förderband",
            "a",
        ]
        .map(|name| names.unique(name));
        let wanted = [
            "LA1_position",
            "LA1_position_2",
            "_4_way",
            "_",
            "F_rderband",
            "a",
        ];
        assert_eq!(seen, wanted);
    }
}
