//! The signal table of one driver.

use std::ops::Range;

use super::{Address, Area, ByteOrder, DataType, Notes, Scale, Slot};
use tickbus_base::time::Nanos;

/// Which edges of a BOOL signal must not be lost between two exchanges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Latch {
    /// From 0 to 1.
    Rising,
    /// From 1 to 0.
    Falling,
    /// Both.
    Both,
}

/// One signal of the process image.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// The name, unique in the table; names that start with `bus.` are reserved.
    pub name: String,
    /// Index of the station in [`SignalTable::stations`].
    pub station: usize,
    /// `%I` or `%Q`.
    pub area: Area,
    /// Offset of the first byte in the station's area.
    pub byte: usize,
    /// Bit within that byte, 0 to 7; 0 unless the type is BOOL.
    pub bit: u8,
    /// The data type.
    pub data_type: DataType,
    /// The byte order; irrelevant for types of up to one byte.
    pub order: ByteOrder,
    /// Conversion to engineering units; `None` for raw values.
    pub scale: Option<Scale>,
    /// Name of the engineering unit, for people.
    pub unit: Option<String>,
    /// Edges that must not be lost; only on BOOL.
    pub latch: Option<Latch>,
    /// True if its swallowed changes are counted, false if they are not; `None` counts those of a BOOL without a latch.
    pub count_swallowed: Option<bool>,
    /// On a `%I`: how long a latched pulse is held at least, in addition to the one completed exchange that
    /// always carries it.
    pub hold: Nanos,
    /// The substitute value when the data are stale (`%Q`) or the simulation has stopped (`%I`), in engineering units,
    /// in the format of the signal's slot.
    pub fail_safe: Slot,
    /// True if the file states that value, and it is not merely the default 0.
    pub states_fail_safe: bool,
    /// How far the value may move, in engineering units, before a bus that sends on change sends it; zero
    /// sends every change. Never negative, and zero on a BOOL.
    pub dead_band: f64,
    /// The lowest and the highest value of normal operation, in engineering units: the two values that the scale names.
    /// A hint for displays; values are not limited to it.
    pub range: Option<[f64; 2]>,
    /// In an [observer's table](SignalTable::observed), where the PLC has a `%I` that the image has behind the `%Q`.
    pub in_plc: Option<Address>,
    /// The comment and the folder, in a box because the tick has no use for them.
    pub notes: Option<Box<Notes>>,
}

impl Signal {
    /// A signal of the first station with only a name, place and type: unscaled, without a latch.
    pub fn new(name: impl Into<String>, area: Area, byte: usize, data_type: DataType) -> Self {
        Self {
            name: name.into(),
            station: 0,
            area,
            byte,
            bit: 0,
            data_type,
            order: ByteOrder::Abcd,
            scale: None,
            unit: None,
            latch: None,
            count_swallowed: None,
            hold: Nanos::ZERO,
            fail_safe: Slot::default(),
            states_fail_safe: false,
            dead_band: 0.0,
            range: None,
            in_plc: None,
            notes: None,
        }
    }

    /// The comment; empty without one.
    pub fn comment(&self) -> &str {
        self.notes.as_ref().map_or("", |notes| &notes.comment)
    }

    /// The folder; empty without one.
    pub fn folder(&self) -> &str {
        self.notes.as_ref().map_or("", |notes| &notes.folder)
    }

    /// True if the slot holds a 64-bit integer and not a double: an unscaled LWORD, LINT or ULINT.
    pub const fn is_integer_slot(&self) -> bool {
        self.scale.is_none()
            && matches!(
                self.data_type,
                DataType::Lword | DataType::Lint | DataType::Ulint
            )
    }

    /// True if changes that no other side sees are counted.
    pub fn counts_swallowed(&self) -> bool {
        let is_plain = self.data_type == DataType::Bool && self.latch.is_none();
        self.count_swallowed.unwrap_or(is_plain)
    }

    /// The address in the image of the station.
    pub const fn address(&self) -> Address {
        Address {
            area: self.area,
            width: self.data_type.width(),
            byte: self.byte,
            bit: self.bit,
        }
    }

    /// The address in the PLC, as people write it: that in the image, except in an observer's table.
    pub fn plc_address(&self) -> Address {
        self.in_plc.unwrap_or_else(|| self.address())
    }

    /// The signal with its place in the PLC for that in the image.
    #[must_use]
    pub fn as_in_plc(&self) -> Self {
        let Address { area, byte, .. } = self.plc_address();
        Self {
            area,
            byte,
            in_plc: None,
            ..self.clone()
        }
    }
}

/// One station (slave, unit, node) of a driver, with a frame for each area.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Station {
    /// The name, unique in the table; empty where a driver.cfg declares no station.
    pub name: String,
    /// Size of `%I` in bytes.
    pub input_bytes: usize,
    /// Size of `%Q` in bytes.
    pub output_bytes: usize,
    /// How many of these bytes, the last ones, are the `%I` of the PLC: in an [observer's
    /// table](SignalTable::observed) all bytes of `%I`, and otherwise 0.
    pub observed_bytes: usize,
}

/// All signals of a driver, in the order of its driver.cfg.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SignalTable {
    /// At least one.
    pub stations: Vec<Station>,
    /// In file order, which is slot order.
    pub signals: Vec<Signal>,
    /// The parts of the only station that a bus can send in messages of their own, such as those of axes.
    pub structures: Vec<Structure>,
}

/// Bytes of a station that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    /// Those of `%I`.
    pub inputs: Range<usize>,
    /// Those of `%Q`.
    pub outputs: Range<usize>,
}

impl Structure {
    /// The bytes in an area.
    pub fn bytes(&self, area: Area) -> Range<usize> {
        match area {
            Area::Input => self.inputs.clone(),
            Area::Output => self.outputs.clone(),
        }
    }
}

impl Station {
    /// Size of an area in bytes.
    pub const fn bytes(&self, area: Area) -> usize {
        match area {
            Area::Input => self.input_bytes,
            Area::Output => self.output_bytes,
        }
    }

    /// Size of an area in the PLC: that in the image, except in an observer's table.
    pub const fn plc_bytes(&self, area: Area) -> usize {
        match area {
            Area::Input => self.input_bytes + self.observed_bytes,
            Area::Output => self.output_bytes - self.observed_bytes,
        }
    }
}

impl SignalTable {
    /// The signals of a single station without a name, whose areas have these numbers of bytes.
    pub fn of_one_station(input_bytes: usize, output_bytes: usize, signals: Vec<Signal>) -> Self {
        Self {
            stations: vec![Station {
                name: String::new(),
                input_bytes,
                output_bytes,
                observed_bytes: 0,
            }],
            signals,
            structures: Vec::new(),
        }
    }

    /// The table of an end that only reads: every `%I` is moved behind the `%Q` of its station, so that the image has
    /// one frame for both, and no byte that this end could write. [`Signal::plc_address`] is where the PLC has it.
    #[must_use]
    pub fn observed(mut self) -> Self {
        for signal in &mut self.signals {
            if signal.area == Area::Input {
                signal.in_plc = Some(signal.address());
                signal.area = Area::Output;
                signal.byte += self.stations[signal.station].output_bytes;
                // A pulse is held by the end that writes it.
                signal.hold = Nanos::ZERO;
            }
        }
        for station in &mut self.stations {
            station.observed_bytes = std::mem::take(&mut station.input_bytes);
            station.output_bytes += station.observed_bytes;
        }
        self.structures.clear();
        self
    }

    /// The table as the PLC has it: that of an observer before it was [`observed`](Self::observed), for people.
    #[must_use]
    pub fn as_in_plc(&self) -> Self {
        let mut table = self.clone();
        for station in &mut table.stations {
            station.input_bytes = station.plc_bytes(Area::Input);
            station.output_bytes = station.plc_bytes(Area::Output);
            station.observed_bytes = 0;
        }
        table.signals = self.signals.iter().map(Signal::as_in_plc).collect();
        table
    }

    /// Index of the signal with this name.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.signals.iter().position(|signal| signal.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_observer_has_both_areas_in_the_one_frame_that_it_reads() {
        let table = SignalTable::of_one_station(
            4,
            3,
            vec![
                Signal::new("level", Area::Input, 2, DataType::Word),
                Signal {
                    bit: 5,
                    ..Signal::new("full", Area::Input, 0, DataType::Bool)
                },
                Signal::new("speed", Area::Output, 1, DataType::Word),
            ],
        );
        let before: Vec<Address> = table.signals.iter().map(Signal::address).collect();
        let seen = table.clone().observed();
        assert_eq!(
            (seen.stations[0].input_bytes, seen.stations[0].output_bytes),
            (0, 7)
        );
        let places = seen.signals.iter().map(|signal| (signal.area, signal.byte));
        assert!(places.eq([(Area::Output, 5), (Area::Output, 3), (Area::Output, 1)]));
        assert!(seen.signals.iter().map(Signal::plc_address).eq(before));
        assert_eq!(seen.as_in_plc(), table);
        assert_eq!(table.as_in_plc(), table);
    }
}
