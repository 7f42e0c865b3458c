//! The record of one direction: the images of all stations, one after another, as arranged in the PLC.

use super::names::{Names, legal};
use tickbus_base::toml_text::short_number;
use tickbus_image::signal::{Address, Area, ByteOrder, DataType, Signal, SignalTable};

/// The bytes of one direction, and the place of each signal.
#[derive(Debug)]
pub(super) struct Record<'a> {
    pub(super) bytes: usize,
    /// The signals in the order of their bytes.
    pub(super) places: Vec<PlacedSignal<'a>>,
}

/// The place of a signal in the PLC, and its name there.
#[derive(Clone, Debug)]
pub(super) struct PlacedSignal<'a> {
    pub(super) signal: &'a Signal,
    /// The name of the signal's station; empty for a single station.
    pub(super) station: &'a str,
    /// The signal's first byte, counted from the start of the record.
    pub(super) byte: usize,
    /// The signal's unique legal name.
    pub(super) name: String,
}

impl PlacedSignal<'_> {
    pub(super) fn data_type(&self) -> DataType {
        self.signal.data_type
    }

    pub(super) fn bit(&self) -> u8 {
        self.signal.bit
    }

    pub(super) fn size(&self) -> usize {
        self.signal.data_type.size_bytes()
    }

    /// The offset just beyond the signal's last byte.
    pub(super) fn end(&self) -> usize {
        self.byte + self.size()
    }

    /// The signal's address in the PLC, in bytes.
    pub(super) fn address(&self) -> Address {
        Address {
            byte: self.byte,
            ..self.signal.address()
        }
    }

    /// The facts for a comment, beside name and type in the PLC: address, name, station, unit, scale.
    pub(super) fn remark(&self) -> String {
        let mut text = format!("{} \"{}\"", self.address(), self.signal.name);
        if !self.station.is_empty() {
            text = format!("{text} of station \"{}\"", self.station);
        }
        for more in facts(self.signal) {
            text.push_str(", ");
            text.push_str(&more);
        }
        text
    }
}

/// Unit, scale and byte order as text.
pub(super) fn facts(signal: &Signal) -> Vec<String> {
    let mut facts = Vec::new();
    if let Some(scale) = signal.scale {
        let unit = signal.unit.as_deref().unwrap_or("value");
        let mut text = format!("{unit} = raw * {}", short_number(scale.gain));
        if scale.offset != 0.0 {
            let sign = if scale.offset < 0.0 { '-' } else { '+' };
            text = format!("{text} {sign} {}", short_number(scale.offset.abs()));
        }
        facts.push(text);
    } else if let Some(unit) = &signal.unit {
        facts.push(unit.clone());
    }
    if signal.order != ByteOrder::Abcd {
        facts.push(format!("byte order {}", signal.order));
    }
    facts
}

impl<'a> Record<'a> {
    /// The record of one direction; names are taken from `names`.
    pub(super) fn of(table: &'a SignalTable, area: Area, names: &mut Names) -> Self {
        Self::aligned(table, area, 1, names)
    }

    /// As [`of`](Self::of), with each station at a multiple of `aligned` bytes.
    pub(super) fn aligned(
        table: &'a SignalTable,
        area: Area,
        aligned: usize,
        names: &mut Names,
    ) -> Self {
        let mut starts = Vec::with_capacity(table.stations.len());
        let mut bytes: usize = 0;
        for station in &table.stations {
            bytes = bytes.next_multiple_of(aligned);
            starts.push(bytes);
            bytes += station.bytes(area);
        }
        let several = table.stations.len() > 1;
        let here = table.signals.iter().filter(|signal| signal.area == area);
        let mut places: Vec<PlacedSignal<'a>> = here
            .map(|signal| PlacedSignal {
                signal,
                station: if several {
                    &table.stations[signal.station].name
                } else {
                    ""
                },
                byte: starts[signal.station] + signal.byte,
                name: String::new(),
            })
            .collect();
        places.sort_by_key(|place| place.address().bits().start);
        for place in &mut places {
            let full = if several {
                format!("{} {}", place.station, place.signal.name)
            } else {
                place.signal.name.clone()
            };
            place.name = names.give(&full);
        }
        Self { bytes, places }
    }

    /// The offset of each station's image, for a comment; empty for a single station.
    pub(super) fn stations(table: &SignalTable) -> Vec<String> {
        Self::stations_aligned(table, 1)
    }

    /// As [`stations`](Self::stations), with each station at a multiple of `aligned` bytes.
    pub(super) fn stations_aligned(table: &SignalTable, aligned: usize) -> Vec<String> {
        if table.stations.len() < 2 {
            return Vec::new();
        }
        let mut starts = [0_usize; 2];
        let mut lines = Vec::new();
        for station in &table.stations {
            starts = starts.map(|start| start.next_multiple_of(aligned));
            lines.push(format!(
                "station \"{}\": its %IB0 is %IB{} here, its %QB0 is %QB{}",
                station.name, starts[0], starts[1]
            ));
            starts[0] += station.input_bytes;
            starts[1] += station.output_bytes;
        }
        lines
    }
}

/// The prefix of the names of a driver's blocks.
pub(super) fn block_prefix(driver: &str) -> String {
    let name: String = legal(driver).chars().take(40).collect();
    legal(&name)
}
