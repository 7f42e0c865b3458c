//! Writing CSV: one line per tick, for spreadsheets and scripts.

use std::io::Write as _;

use super::columns::{Columns, Tick, ValueKind};
use super::sink::{Sink, count, real};

/// The columns before the signals; their names are reserved, so that no signal can have them.
pub(super) const HEAD: [&str; 4] = ["bus.tick", "bus.time_ns", "bus.status", "bus.dropped"];

/// The prefix of the status columns of stations.
pub(super) const STATION: &str = "bus.status.";

/// Writes CSV.
pub(super) struct CsvSink(pub(super) Columns);

impl Sink for CsvSink {
    fn header(&mut self, out: &mut Vec<u8>) {
        let Columns {
            stations, columns, ..
        } = &self.0;
        out.extend_from_slice(HEAD.join(",").as_bytes());
        let stations = stations.iter().map(|station| format!("{STATION}{station}"));
        for name in stations.chain(columns.iter().map(super::Column::title)) {
            out.push(b',');
            if name.contains(['"', ',']) || name.trim() != name {
                // Writing to memory cannot fail.
                let _ = write!(out, "\"{}\"", name.replace('"', "\"\""));
            } else {
                out.extend_from_slice(name.as_bytes());
            }
        }
        out.push(b'\n');
    }

    fn tick(&mut self, tick: &Tick, out: &mut Vec<u8>) {
        let (number, time) = (tick.number, tick.time.0);
        let _ = write!(out, "{number},{time},{},{}", tick.status, tick.dropped);
        for status in &tick.stations {
            let _ = write!(out, ",{status}");
        }
        for (column, value) in self.0.columns.iter().zip(&tick.values) {
            out.push(b',');
            let _ = match column.kind {
                ValueKind::Bit if !value.real().is_nan() => {
                    write!(out, "{}", u8::from(value.real() != 0.0))
                }
                ValueKind::Bit | ValueKind::Real => {
                    real(value.real(), out);
                    Ok(())
                }
                ValueKind::Signed => write!(out, "{}", value.signed()),
                ValueKind::Unsigned => write!(out, "{}", value.unsigned()),
                ValueKind::Count => write!(out, "{}", count(value.real())),
            };
        }
        out.push(b'\n');
    }

    fn end(&mut self, _note: &str, _out: &mut Vec<u8>) {}
}
