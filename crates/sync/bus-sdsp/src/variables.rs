//! The signals of one area as variables of a run.

use tickbus_image::signal::{Area, DataType, RawValues, Signal, SignalTable};
use tickbus_virtual_time::Variable;

/// The signals of one area of all stations as variables: one per signal, with its type, and its raw value in the image.
#[derive(Debug)]
pub struct Variables {
    raw: RawValues,
    /// In the order of their declaration, each with its signal's position in the table.
    list: Vec<(usize, Variable)>,
}

impl Variables {
    /// The variables of those signals of `area` for which `name` returns a name.
    pub fn new(table: &SignalTable, area: Area, name: impl Fn(&Signal) -> Option<String>) -> Self {
        let signals = table.signals.iter().enumerate();
        let signals = signals.filter(|(_, signal)| signal.area == area);
        let list = signals.filter_map(|(index, signal)| {
            Some((index, Variable::new(name(signal)?, signal.data_type)))
        });
        Self {
            raw: RawValues::new(table, area),
            list: list.collect(),
        }
    }

    /// The variables, in the order of the slots.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Variable> {
        self.list.iter().map(|(_, variable)| variable)
    }

    /// Reads the values of a station's frame.
    ///
    /// # Panics
    ///
    /// When the frame is shorter than the station's area.
    pub fn take(&mut self, station: usize, frame: &[u8]) {
        self.raw.take(station, frame);
    }

    /// Puts the values of all variables into their slots.
    pub fn get(&self, slots: &mut [u64]) {
        for ((index, variable), slot) in self.list.iter().zip(slots) {
            *slot = extended(variable.data_type, self.raw.bits(*index));
        }
    }

    /// Takes the values of all variables from their slots.
    pub fn set(&mut self, slots: &[u64]) {
        for ((index, variable), slot) in self.list.iter().zip(slots) {
            let bits = u64::MAX >> (64 - variable.data_type.width().bits());
            self.raw.set(*index, slot & bits);
        }
    }

    /// Writes a station's frame; bits that belong to no variable become zero.
    ///
    /// # Panics
    ///
    /// The same as for [`take`](Self::take).
    pub fn give(&self, station: usize, frame: &mut [u8]) {
        self.raw.give(station, frame);
    }
}

/// The bits of a value in the format of a slot: extended by the sign, or by zeros.
const fn extended(data_type: DataType, bits: u64) -> u64 {
    let unused = 64 - data_type.width().bits();
    if data_type.is_signed() {
        ((bits << unused).cast_signed() >> unused).cast_unsigned()
    } else {
        bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::ByteOrder;
    use tickbus_virtual_time::is_raw;

    #[test]
    fn a_frame_becomes_slots_of_every_type_and_a_frame_again() {
        let mut signals: Vec<Signal> = (DataType::ALL.iter().enumerate())
            .map(|(at, data_type)| Signal {
                order: ByteOrder::Dcba,
                ..Signal::new(data_type.name(), Area::Input, 8 * at, *data_type)
            })
            .collect();
        signals[0].bit = 5;
        let table = SignalTable::of_one_station(8 * signals.len(), 0, signals);
        let name = |signal: &Signal| Some(signal.name.clone());
        let mut variables = Variables::new(&table, Area::Input, name);
        let mut slots = vec![0; variables.iter().len()];
        for byte in [0x00, 0x01, 0x7F, 0x80, 0xFF] {
            let frame = vec![byte; 8 * slots.len()];
            variables.take(0, &frame);
            variables.get(&mut slots);
            for (variable, slot) in variables.iter().zip(&slots) {
                assert!(is_raw(variable.data_type, *slot), "{variable:?} {slot:x}");
            }
            variables.set(&vec![0; slots.len()]);
            variables.set(&slots);
            let mut again = vec![0xAA; frame.len()];
            variables.give(0, &mut again);
            for (at, data_type) in DataType::ALL.iter().enumerate() {
                let mask = if at == 0 { 1 << 5 } else { 0xFF };
                for byte in 8 * at..8 * at + data_type.size_bytes() {
                    assert_eq!(again[byte], frame[byte] & mask, "{data_type}");
                }
            }
        }
        let int = DataType::ALL.iter().position(|t| *t == DataType::Int);
        assert_eq!(slots[int.expect("a type")], u64::MAX, "-1, by its sign");
    }

    #[test]
    fn signals_without_a_name_are_left_out_and_their_bits_are_zero() {
        let signals = ["a", "b"].iter().enumerate();
        let signals =
            signals.map(|(at, name)| Signal::new(*name, Area::Output, at, DataType::Byte));
        let table = SignalTable::of_one_station(0, 2, signals.collect());
        let mut variables = Variables::new(&table, Area::Output, |signal| {
            (signal.name == "b").then(|| "other".to_owned())
        });
        let mut slots = [0];
        variables.take(0, &[1, 2]);
        variables.get(&mut slots);
        assert_eq!(slots, [2]);
        variables.set(&[7]);
        let mut frame = [9, 9];
        variables.give(0, &mut frame);
        assert_eq!(frame[1], 7);
    }
}
