//! Descriptions of the line and of signals' places for people, in both notations.

use tickbus_fieldbus::{OBSERVES, Role};
use tickbus_image::signal::{Area, DataType, Signal, SignalTable};

use crate::Tls;

use super::{Block, ClientOptions, ElementAddress, Request, ServerOptions, Side, Table};

impl ServerOptions {
    /// Describes the line, given the signal table.
    pub fn shown(&self, signals: &SignalTable) -> Vec<String> {
        let mut parts = vec![format!("listens on {}", self.line)];
        parts.extend(self.tls.as_ref().map(Tls::shown));
        parts.extend(self.stations.shown(None));
        let bytes = |area| {
            signals
                .stations
                .iter()
                .map(move |station| station.bytes(area))
                .max()
        };
        let outputs = bytes(Area::Output).unwrap_or_default();
        let table = Table::HoldingRegisters;
        if !self.at.is_empty() {
            parts.push("has the elements of [fieldbus.at], and refuses all others".to_owned());
        }
        let stations = 0..signals.stations.len();
        if stations
            .into_iter()
            .all(|station| self.is_placed(signals, station))
        {
            return parts;
        }
        if bytes(Area::Input) > Some(0)
            && let Some(offset) = self.window(outputs)
        {
            parts.push(format!(
                "%I also from {} on",
                ElementAddress { table, offset }
            ));
        }
        if outputs > 0 && self.input == Side::Sends {
            // A client that expects %I there would read plausible numbers: its own written outputs.
            parts.push(format!(
                "{} and the {} behind it are %Q: read, they give back what was written last",
                ElementAddress { table, offset: 0 },
                table.elements(outputs) - 1
            ));
        }
        parts
    }

    /// The place of a signal.
    pub fn place(&self, signal: &Signal) -> String {
        if let Some(spot) = self.at.get(&signal.name) {
            return spot.to_string();
        }
        let is_bit = signal.data_type == DataType::Bool;
        let table = match (signal.area, is_bit) {
            (Area::Input, true) => Table::DiscreteInputs,
            (Area::Input, false) => Table::InputRegisters,
            (Area::Output, true) => Table::Coils,
            (Area::Output, false) => Table::HoldingRegisters,
        };
        let whole = Block {
            table,
            first: 0,
            byte: 0,
            bytes: signal.byte + 1,
        };
        place_in(whole, signal)
    }
}

impl ClientOptions {
    /// Describes the line, for the end with `role`, given the signal table.
    pub fn shown(&self, role: Role, table: &SignalTable) -> Vec<String> {
        let (own, others) = role.areas();
        let mut parts = vec![format!("asks {}", self.line)];
        parts.extend(self.tls.as_ref().map(Tls::shown));
        parts.extend(self.stations.shown(Some(self.unit(0))));
        parts.extend([others, own].map(|area| {
            let does = if role.writes(area) { "writes" } else { "reads" };
            if !self.lies_as_a_whole(area, table) {
                return format!("{does} {area} where [fieldbus.at] says");
            }
            let places: Vec<String> = self.places(area).map(|place| place.to_string()).collect();
            let places = places.join(" and from ");
            let elsewhere = |signal: &Signal| {
                signal.plc_address().area == area && self.at.contains_key(&signal.name)
            };
            if table.signals.iter().any(elsewhere) {
                format!("{does} {area} where [fieldbus.at] says, the rest from {places} on")
            } else {
                format!("{does} {area} from {places} on")
            }
        }));
        parts.push(match self.timeout {
            Some(timeout) => format!("answers within {timeout}"),
            None if table.stations.len() > 1 => {
                "answers within half of max_age, at most 1s".to_owned()
            }
            None => "answers within 1s".to_owned(),
        });
        if role == Role::Observer {
            parts.push(OBSERVES.to_owned());
            return parts;
        }
        if !self.combine {
            parts.push("never writes and reads in one request".to_owned());
        }
        parts.push(match self.stations.write_to(0) {
            Some(identity) => format!("writes only into \"{identity}\""),
            None => "writes nothing, as no \"write_to\" names the device".to_owned(),
        });
        parts
    }

    /// The requests of a cycle, one per line.
    pub fn shown_requests(&self, table: &SignalTable) -> Vec<String> {
        let mut lines = Vec::new();
        for station in 0..table.stations.len() {
            let unit = match table.stations.len() {
                1 => String::new(),
                _ => format!("unit {}: ", self.unit(station)),
            };
            let blocked = match self.stations.write_to(station) {
                Some(_) => "",
                None => "; written once \"write_to\" names the device",
            };
            for query in self.requests(table, station) {
                let Some(write) = query.write() else {
                    lines.push(format!("{unit}{query}"));
                    continue;
                };
                let zeros = match query {
                    Request::Mask(_) => 0,
                    _ => write.zeros(),
                };
                let rest = match zeros {
                    0 => String::new(),
                    1 => "; 1 of the bits written has no signal and becomes 0".to_owned(),
                    bits => format!("; {bits} of the bits written have no signal and become 0"),
                };
                lines.push(format!("{unit}{query}{rest}{blocked}"));
            }
        }
        lines
    }

    /// The place of a signal in a station with areas of `bytes` bytes.
    pub fn place(&self, signal: &Signal, bytes: usize) -> String {
        if let Some(spot) = self.at.get(&signal.name) {
            return spot.to_string();
        }
        let blocks = self.blocks(signal.area, bytes).unwrap_or_default();
        let holds = |block: &&Block| (block.byte..block.byte + block.bytes).contains(&signal.byte);
        let block = blocks.iter().find(holds);
        block.map_or_else(String::new, |block| place_in(*block, signal))
    }
}

/// The place of a signal whose first byte is in `block`.
fn place_in(block: Block, signal: &Signal) -> String {
    let byte = signal.byte - block.byte;
    let table = block.table;
    let element = if table.is_bits() {
        byte * 8 + usize::from(signal.bit)
    } else {
        byte / 2
    };
    let place = ElementAddress {
        table,
        offset: block.first + element,
    };
    let is_bit = signal.data_type == DataType::Bool;
    if table.is_bits() == is_bit {
        let half = match (is_bit, signal.data_type.size_bytes(), byte % 2) {
            (false, 1, 0) => ", high byte",
            (false, _, 1) => ", low byte",
            _ => "",
        };
        return format!("{place}{half}");
    }
    if is_bit {
        // The high byte of a register comes first.
        return format!(
            "{place}, bit {}",
            8 * (1 - byte % 2) + usize::from(signal.bit)
        );
    }
    format!("{place} and {} more", signal.data_type.size_bytes() * 8 - 1)
}
