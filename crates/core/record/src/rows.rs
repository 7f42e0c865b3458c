//! The rows passed to a recorder.

use tickbus_image::signal::{Area, Plan, SignalTable, Slot};

use super::Columns;

/// The rows passed to a recorder, tick by tick.
#[derive(Debug)]
pub struct Rows {
    pub(super) columns: Columns,
    /// Per station, the codec of the values that this end sends, and a frame for it.
    sent: Vec<(Plan, Box<[u8]>)>,
}

impl From<Columns> for Rows {
    /// Rows that are recorded unchanged.
    fn from(columns: Columns) -> Self {
        Self {
            columns,
            sent: Vec::new(),
        }
    }
}

impl Rows {
    /// Rows whose values of `area` have yet to pass the codec: the recording gets the result, which is on the line. The
    /// first columns are the signals of `table`.
    pub fn sending(columns: Columns, table: &SignalTable, area: Area) -> Self {
        let stations = table.stations.iter().enumerate();
        let sent = stations.map(|(index, station)| {
            let bytes = match area {
                Area::Input => station.input_bytes,
                Area::Output => station.output_bytes,
            };
            (Plan::new(table, index, area), vec![0; bytes].into())
        });
        Self {
            columns,
            sent: sent.collect(),
        }
    }

    /// Replaces the values that this end sends by those on the line: saturated, rounded, fail-safe values for NaN.
    pub fn put_on_the_line(&mut self, values: &mut [Slot]) {
        for (codec, frame) in &mut self.sent {
            codec.encode(values, frame);
            codec.decode(frame, values);
        }
    }
}
