//! The contents of a recording for every tick.

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{Address, DataType, Signal, SignalTable, Slot};

/// The type of a column's values, in a slot and in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ValueKind {
    /// A BOOL: a double that is 0 or 1, or NaN.
    Bit,
    /// A double.
    Real,
    /// A signed 64-bit integer.
    Signed,
    /// An unsigned 64-bit integer.
    Unsigned,
    /// A double that counts edges, less than 2^32.
    Count,
}

impl ValueKind {
    /// The kind for a signal of this type, with or without a scale.
    pub const fn of(data_type: DataType, scaled: bool) -> Self {
        match data_type {
            DataType::Bool => Self::Bit,
            DataType::Lint if !scaled => Self::Signed,
            DataType::Lword | DataType::Ulint if !scaled => Self::Unsigned,
            _ => Self::Real,
        }
    }

    /// The type of a plain signal with such values, for a column whose type is unknown.
    pub const fn data_type(self) -> DataType {
        match self {
            Self::Bit => DataType::Bool,
            Self::Signed => DataType::Lint,
            Self::Unsigned => DataType::Ulint,
            Self::Real | Self::Count => DataType::Lreal,
        }
    }

    /// The value as recorded: a BOOL that is neither 0 nor NaN becomes 1, and every NaN the same NaN.
    pub fn kept(self, slot: Slot) -> Slot {
        let value = slot.real();
        match self {
            Self::Signed | Self::Unsigned => slot,
            _ if value.is_nan() => Slot::from_real(f64::NAN),
            Self::Bit => Slot::from_real(f64::from(u8::from(value != 0.0))),
            Self::Real | Self::Count => slot,
        }
    }
}

/// One column: a signal, or a signal's edges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// The signal's name.
    pub name: String,
    /// True if the column counts the signal's edges since the previous tick.
    pub is_edges: bool,
    /// The type of the values.
    pub kind: ValueKind,
    /// The signal's address; unknown in a CSV file, and without meaning in a recording of virtual time.
    pub address: Option<Address>,
    /// The signal's type; unknown in a CSV file, whose columns get the type of their kind if they are written as VCD.
    pub data_type: Option<DataType>,
    /// The signal's unit, for people.
    pub unit: Option<String>,
    /// The signal's station; empty if there is a single station without a name.
    pub station: String,
}

impl Column {
    /// The column of a signal or variable without an address, a scale and a unit.
    pub const fn plain(name: String, data_type: DataType, station: String) -> Self {
        Self {
            name,
            is_edges: false,
            kind: ValueKind::of(data_type, false),
            address: None,
            data_type: Some(data_type),
            unit: None,
            station,
        }
    }

    /// True for a 64-bit integer that is a double because of a scale.
    pub(super) fn is_scaled_integer(&self) -> bool {
        let plain = |data_type| ValueKind::of(data_type, false) != self.kind;
        self.kind == ValueKind::Real && self.data_type.is_some_and(plain)
    }

    /// The name for people: `Start button`, or `Start button.edges`.
    pub fn title(&self) -> String {
        let edges = if self.is_edges { ".edges" } else { "" };
        format!("{}{edges}", self.name)
    }
}

/// The contents of a recording for every tick, and the driver that made it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Columns {
    /// The driver's name; empty in a CSV file.
    pub driver: String,
    /// Which end of the line was recorded: `device` or `controller`; empty in a CSV file.
    pub role: String,
    /// The stations, if there are several: each has its own status.
    pub stations: Vec<String>,
    /// The signals in the order of their table, then the edges.
    pub columns: Vec<Column>,
}

impl Columns {
    /// The columns of a driver called `driver` with these signals. `edges` has, per signal, the slot of its
    /// edge count, if any.
    pub fn new(driver: &str, role: &str, table: &SignalTable, edges: &[Option<usize>]) -> Self {
        let column = |signal: &Signal, is_edges| Column {
            name: signal.name.clone(),
            is_edges,
            kind: if is_edges {
                ValueKind::Count
            } else {
                ValueKind::of(signal.data_type, signal.scale.is_some())
            },
            address: Some(signal.plc_address()),
            data_type: Some(signal.data_type),
            unit: signal.unit.clone().filter(|_| !is_edges),
            station: table.stations[signal.station].name.clone(),
        };
        let signals = table.signals.iter().map(|signal| column(signal, false));
        let counted = table.signals.iter().zip(edges);
        let counted = counted.filter(|(_, edges)| edges.is_some());
        let stations = table.stations.iter().map(|station| station.name.clone());
        Self {
            driver: driver.to_owned(),
            role: role.to_owned(),
            stations: if table.stations.len() > 1 {
                stations.collect()
            } else {
                Vec::new()
            },
            columns: signals
                .chain(counted.map(|(signal, _)| column(signal, true)))
                .collect(),
        }
    }

    /// The index of the column of `signal`, if there is one of its name.
    ///
    /// # Errors
    ///
    /// That column is of another kind, direction or unit.
    pub fn of_signal(&self, signal: &Signal) -> Result<Option<usize>, Mistake> {
        let Some(index) = self.position(&signal.name, false) else {
            return Ok(None);
        };
        let column = &self.columns[index];
        let name = shown(&signal.name);
        let moved = column.address.is_some_and(|was| was.area != signal.area);
        if moved || column.kind != ValueKind::of(signal.data_type, signal.scale.is_some()) {
            return Err(Mistake::new(
                format!(
                    "\"{name}\" ({} {}) is another signal in this recording",
                    signal.address(),
                    signal.data_type
                ),
                "use a recording of a driver with this signal table",
            ));
        }
        match (&column.unit, &signal.unit) {
            (Some(was), Some(unit)) if was != unit => Err(Mistake::new(
                format!(
                    "\"{name}\" is in {} in this recording, and in {} in the driver.cfg",
                    shown(was),
                    shown(unit)
                ),
                "give it the same unit and scale, or use another recording",
            )),
            _ => Ok(Some(index)),
        }
    }

    /// The index of the column of a signal, or of its edges.
    pub fn position(&self, name: &str, is_edges: bool) -> Option<usize> {
        self.columns
            .iter()
            .position(|column| column.name == name && column.is_edges == is_edges)
    }
}

/// One tick of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tick {
    /// The number, from 1; the numbers of dropped ticks are missing.
    pub number: u64,
    /// Simulation time.
    pub time: Nanos,
    /// The number of the status: 0 fresh, 1 unchanged, 2 stale, negative for errors.
    pub status: i32,
    /// Ticks dropped between the start of the recording and this one.
    pub dropped: u64,
    /// The status of each of [`Columns::stations`].
    pub stations: Vec<i32>,
    /// One value per column.
    pub values: Vec<Slot>,
}

impl Tick {
    /// A tick with room for all `columns`.
    pub fn new(columns: &Columns) -> Self {
        Self {
            stations: vec![0; columns.stations.len()],
            values: vec![Slot::default(); columns.columns.len()],
            ..Self::default()
        }
    }
}
