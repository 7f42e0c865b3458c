//! Where signals lie, for people: both ways to count, side by side.

use crate::fieldbus::Role;
use crate::signal::{Area, DataType, Signal};

use super::{Block, ClientOptions, Place, ServerOptions, Table};

impl ServerOptions {
    /// What the line is and does.
    pub fn shown(&self) -> Vec<String> {
        let mut parts = vec![format!("listens on {}", self.line)];
        parts.extend(self.stations.shown(None));
        if let Some(offset) = self.map.window {
            let table = Table::HoldingRegisters;
            parts.push(format!("%I also from {} on", Place { table, offset }));
        }
        if self.every_write {
            parts.push("every write".to_owned());
        }
        parts
    }

    /// Where a signal lies.
    pub fn place(&self, signal: &Signal) -> String {
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
    /// What the line is and does, for the end with `role`.
    pub fn shown(&self, role: Role) -> Vec<String> {
        let (writes, reads) = role.areas();
        let mut parts = vec![format!("asks {}", self.line)];
        parts.extend(self.stations.shown(Some(self.unit(0))));
        parts.extend([(reads, "reads"), (writes, "writes")].map(|(area, does)| {
            let places: Vec<String> = self.places(area).map(|place| place.to_string()).collect();
            format!("{does} {area} from {} on", places.join(" and from "))
        }));
        parts.push(format!("answers within {}", self.timeout));
        if !self.combine {
            parts.push("never writes and reads in one request".to_owned());
        }
        parts.push(match self.stations.write_to(0) {
            Some(identity) => format!("writes only into \"{identity}\""),
            None => "writes nothing, as no \"write_to\" names the device".to_owned(),
        });
        parts
    }

    /// Where a signal of a station with areas of so many bytes lies.
    pub fn place(&self, signal: &Signal, bytes: usize) -> String {
        let blocks = self.blocks(signal.area, bytes).unwrap_or_default();
        let holds = |block: &&Block| (block.byte..block.byte + block.bytes).contains(&signal.byte);
        let block = blocks.iter().find(holds);
        block.map_or_else(String::new, |block| place_in(*block, signal))
    }
}

/// Where a signal lies whose first byte is in `block`.
fn place_in(block: Block, signal: &Signal) -> String {
    let byte = signal.byte - block.byte;
    let table = block.table;
    let element = if table.is_bits() {
        byte * 8 + usize::from(signal.bit)
    } else {
        byte / 2
    };
    let place = Place {
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
