//! Splits an image into Modbus telegrams: the registers of each request.

use tickbus_bus_modbus::ServerOptions;
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Area;

/// The most registers of one read telegram, and of one write telegram.
const TELEGRAM: [usize; 2] = [125, 123];

/// The registers of one station that one request in each direction transfers, inputs first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Telegrams {
    /// The unit.
    pub(super) unit: u8,
    /// The first registers in the tables of the unit.
    pub(super) first: [usize; 2],
    /// The same registers in the record of all stations, where each starts at its own register.
    pub(super) record: [usize; 2],
    /// The number of registers.
    pub(super) count: [usize; 2],
}

impl Telegrams {
    /// All requests, station by station.
    pub(super) fn all(config: &Config, options: &ServerOptions) -> Vec<Self> {
        let mut all = Vec::new();
        let mut record = [0, 0];
        for (number, station) in config.table.stations.iter().enumerate() {
            let sizes = [Area::Input, Area::Output].map(|area| station.bytes(area).div_ceil(2));
            let pieces = sizes
                .iter()
                .zip(TELEGRAM)
                .map(|(size, most)| size.div_ceil(most));
            for piece in 0..pieces.max().unwrap_or(0) {
                let first = [0, 1].map(|way| (piece * TELEGRAM[way]).min(sizes[way]));
                all.push(Self {
                    unit: options.stations.unit(number).unwrap_or(1),
                    first,
                    record: [0, 1].map(|way| record[way] + first[way]),
                    count: [0, 1].map(|way| (sizes[way] - first[way]).min(TELEGRAM[way])),
                });
            }
            record = [0, 1].map(|way| record[way] + sizes[way]);
        }
        all
    }
}
