//! The raw bits of values, as they are on the line.

use tickbus_image::signal::{Area, Plan, RawValues, Signal, SignalTable, Slot};

/// The bits of all values, of both areas.
#[derive(Debug)]
pub(crate) struct Codec {
    areas: [(Vec<Plan>, RawValues); 2],
    frame: Vec<u8>,
}

impl Codec {
    pub(crate) fn new(table: &SignalTable) -> Self {
        let areas = [Area::Input, Area::Output].map(|area| {
            let stations = 0..table.stations.len();
            let plans = stations.map(|station| Plan::new(table, station, area));
            (plans.collect(), RawValues::new(table, area))
        });
        let sizes = table.stations.iter();
        let sizes = sizes.map(|station| station.input_bytes.max(station.output_bytes));
        Self {
            areas,
            frame: vec![0; sizes.max().unwrap_or(0)],
        }
    }

    pub(crate) fn take(&mut self, table: &SignalTable, slots: &[Slot]) {
        for (index, station) in table.stations.iter().enumerate() {
            for ((plans, values), area) in self.areas.iter_mut().zip([Area::Input, Area::Output]) {
                let frame = &mut self.frame[..station.bytes(area)];
                frame.fill(0);
                plans[index].encode(slots, frame);
                values.take(index, frame);
            }
        }
    }

    pub(crate) fn bits(&self, signal: &Signal, index: usize) -> u64 {
        let (_, values) = &self.areas[usize::from(signal.area == Area::Output)];
        values.bits(index)
    }
}
