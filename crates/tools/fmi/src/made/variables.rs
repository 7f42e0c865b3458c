//! The variables of the FMU made from a driver.cfg.

use std::ops::DerefMut as _;

use tickbus_binding::SlotKind;
use tickbus_driver::{Exchange, SlotMap};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{DataType, Signal, SignalTable, Slot};

use crate::value::{Value, ValueType, Version};

/// The value reference of the first slot; references below it are not signals.
const FIRST_SLOT: u32 = 16;

/// The meaning of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The simulation's time.
    Time,
    /// The seconds of simulation per second of the wall clock; 0 for as fast as possible.
    Pace,
    /// The address of the line, which replaces that in the driver.cfg.
    Address,
    /// The file of the recording.
    Record,
    /// The status of the data: 0 fresh, 1 unchanged, 2 stale.
    Status,
    /// The age of the data in seconds.
    Age,
    /// The number of bus cycles that have arrived.
    Sequence,
    /// A slot of the driver: a signal, or the count of its edges.
    Slot(usize),
}

/// Says how the importing tool uses a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// The tool uses it as the time.
    Independent,
    /// The tool sets it before the run.
    Parameter,
    /// The tool sets it before every step.
    Input,
    /// The tool reads it after every step.
    Output,
}

/// The value of a variable before the first step.
#[derive(Clone, Debug, PartialEq)]
pub enum Start {
    /// None: the time has its own start value.
    None,
    /// A number.
    Number(Value),
    /// A text.
    Text(String),
}

/// One variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// The variable's unique name.
    pub name: String,
    /// The value reference, which identifies the variable in calls.
    pub reference: u32,
    /// The variable's type in the FMU's version.
    pub value_type: ValueType,
    /// The variable's use.
    pub usage: Use,
    /// The unit, for floating point numbers only.
    pub unit: Option<String>,
    /// The value before the first step.
    pub start: Start,
    /// The description, one line for people.
    pub description: String,
}

/// One slot, as seen by the functions of FMI.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// The variable's type.
    pub value_type: ValueType,
    /// The kind of value in the slot.
    pub kind: SlotKind,
    /// True if the importing tool sets the slot.
    pub is_input: bool,
}

/// All variables of a driver.cfg, in the order of the model description.
#[derive(Clone, Debug)]
pub struct Exposed {
    /// The variables.
    pub variables: Vec<Variable>,
    /// The slots, in order.
    pub cells: Vec<Cell>,
}

impl Place {
    /// Returns the meaning of a value reference.
    #[inline]
    pub fn of(reference: u32) -> Option<Self> {
        Some(match reference {
            0 => Self::Time,
            1 => Self::Pace,
            2 => Self::Address,
            3 => Self::Record,
            4 => Self::Status,
            5 => Self::Age,
            6 => Self::Sequence,
            FIRST_SLOT.. => Self::Slot((reference - FIRST_SLOT) as usize),
            _ => return None,
        })
    }

    fn reference(self) -> u32 {
        match self {
            Self::Time => 0,
            Self::Pace => 1,
            Self::Address => 2,
            Self::Record => 3,
            Self::Status => 4,
            Self::Age => 5,
            Self::Sequence => 6,
            Self::Slot(slot) => FIRST_SLOT + u32::try_from(slot).unwrap_or(u32::MAX - FIRST_SLOT),
        }
    }
}

/// Returns the age of data in seconds, as a variable shows it.
#[expect(clippy::cast_precision_loss, reason = "for people")]
pub(super) fn seconds(found: &Exchange) -> f64 {
    found.age.0 as f64 * 1e-9
}

/// Returns the type of a counter; FMI 2.0 has no unsigned one.
const fn counter(version: Version) -> ValueType {
    match version {
        Version::Two => ValueType::Float64,
        Version::Three => ValueType::UInt64,
    }
}

/// Returns the type of a signal in a version: the type that can represent all its values.
pub(super) fn type_of(signal: &Signal, version: Version) -> ValueType {
    if signal.scale.is_some() {
        return ValueType::Float64;
    }
    let (two, three) = match signal.data_type {
        DataType::Bool => (ValueType::Boolean, ValueType::Boolean),
        DataType::Byte | DataType::Usint => (ValueType::Int32, ValueType::UInt8),
        DataType::Sint => (ValueType::Int32, ValueType::Int8),
        DataType::Word | DataType::Uint => (ValueType::Int32, ValueType::UInt16),
        DataType::Int => (ValueType::Int32, ValueType::Int16),
        DataType::Dint => (ValueType::Int32, ValueType::Int32),
        DataType::Dword | DataType::Udint => (ValueType::Float64, ValueType::UInt32),
        DataType::Lint => (ValueType::Float64, ValueType::Int64),
        DataType::Lword | DataType::Ulint => (ValueType::Float64, ValueType::UInt64),
        DataType::Real => (ValueType::Float64, ValueType::Float32),
        DataType::Lreal => (ValueType::Float64, ValueType::Float64),
    };
    match version {
        Version::Two => two,
        Version::Three => three,
    }
}

/// Returns the kind of value in the slot of a signal.
pub fn kind_of(signal: &Signal) -> SlotKind {
    match signal.data_type {
        _ if !signal.is_integer_slot() => SlotKind::Real,
        DataType::Lint => SlotKind::Signed,
        _ => SlotKind::Unsigned,
    }
}

/// Returns the name of a variable that is not a signal: `name`, unless a signal has that name.
fn free_name(name: &str, table: &SignalTable) -> String {
    // Names with this prefix are reserved.
    match table.position(name) {
        None => name.to_owned(),
        Some(_) => format!("bus.{name}"),
    }
}

impl Exposed {
    /// Returns the variables of `config` in a version.
    pub fn of(config: &Config, version: Version) -> Self {
        let (table, (writes, _)) = (&config.table, config.role.areas());
        let map = SlotMap::new(table, config.role);
        let mut variables = own_variables(config, version);
        let mut cells = Vec::with_capacity(map.count);
        for (slot, signal) in table.signals.iter().enumerate() {
            let cell = Cell {
                value_type: type_of(signal, version),
                kind: kind_of(signal),
                is_input: signal.area == writes,
            };
            let unit = signal.unit.clone().filter(|_| cell.value_type.is_float());
            let station = &table.stations[signal.station].name;
            let station = if station.is_empty() {
                String::new()
            } else {
                format!(" of {station}")
            };
            variables.push(Variable {
                name: signal.name.clone(),
                reference: Place::Slot(slot).reference(),
                value_type: cell.value_type,
                usage: if cell.is_input {
                    Use::Input
                } else {
                    Use::Output
                },
                unit,
                start: Start::Number(Value::of(signal.fail_safe, cell.kind)),
                description: format!("{} {}{station}", signal.address(), signal.data_type),
            });
            cells.push(cell);
        }
        let edges = Cell {
            value_type: match version {
                Version::Two => ValueType::Int32,
                Version::Three => ValueType::UInt32,
            },
            kind: SlotKind::Real,
            is_input: false,
        };
        for (signal, slot) in table.signals.iter().zip(&map.edges) {
            let Some(slot) = slot else { continue };
            debug_assert_eq!(
                *slot,
                cells.len(),
                "edges follow in the order of the signals"
            );
            variables.push(Variable {
                name: format!("{}.edges", signal.name),
                reference: Place::Slot(*slot).reference(),
                value_type: edges.value_type,
                usage: Use::Output,
                unit: None,
                start: Start::Number(Value::Unsigned(0)),
                description: format!("edges of {} since the last step", signal.address()),
            });
            cells.push(edges);
        }
        Self { variables, cells }
    }

    /// Returns the variable that a value reference stands for.
    pub fn variable(&self, reference: u32) -> Option<&Variable> {
        self.variables
            .iter()
            .find(|variable| variable.reference == reference)
    }
}

/// Returns the variables that are not signals.
fn own_variables(config: &Config, version: Version) -> Vec<Variable> {
    let variable =
        |name: &str, place: Place, value_type, usage, start, description: &str| Variable {
            name: if name.starts_with("bus.") {
                name.to_owned()
            } else {
                free_name(name, &config.table)
            },
            reference: place.reference(),
            value_type,
            usage,
            unit: matches!(place, Place::Time | Place::Age).then(|| "s".to_owned()),
            start,
            description: description.to_owned(),
        };
    let number = Start::Number;
    let real = ValueType::Float64;
    let record = config.record.as_ref();
    let record = record.map(|record| record.file.to_string_lossy().into_owned());
    let mut all = Vec::new();
    // FMI 2.0 does not need this variable, and a library used by some of its tools rejects it.
    if version == Version::Three {
        let time = variable(
            "time",
            Place::Time,
            real,
            Use::Independent,
            Start::None,
            "Simulation time",
        );
        all.push(time);
    }
    all.push(
        variable(
            "pace",
            Place::Pace,
            real,
            Use::Parameter,
            number(Value::Real(default_pace(config))),
            "Seconds of simulation in one of the clock on the wall: 1 for real time, 0 for as fast as possible",
        ),
    );
    if has_address(config) {
        all.push(variable(
            "address",
            Place::Address,
            ValueType::String,
            Use::Parameter,
            Start::Text(String::new()),
            "Address of the line, in place of the one in driver.cfg; empty for that one",
        ));
    }
    all.extend([
        variable(
            "record",
            Place::Record,
            ValueType::String,
            Use::Parameter,
            Start::Text(record.unwrap_or_default()),
            "File that every step is recorded to, ending in .vcd or .csv, from the current folder on; empty for none",
        ),
        variable(
            "bus.status",
            Place::Status,
            ValueType::Int32,
            Use::Output,
            number(Value::Signed(2)),
            "0 fresh, 1 unchanged, 2 stale",
        ),
        variable(
            "bus.age",
            Place::Age,
            real,
            Use::Output,
            number(Value::Real(seconds(&Exchange::NONE))),
            "Age of the oldest station's data",
        ),
        variable(
            "bus.sequence",
            Place::Sequence,
            counter(version),
            Use::Output,
            number(Value::Unsigned(0)),
            "Bus cycles so far",
        ),
    ]);
    all
}

/// Returns true if the bus has an address that can be replaced.
fn has_address(config: &Config) -> bool {
    // The empty text need not be a valid address.
    config.bus.clone().deref_mut().set_address("").is_some()
}

/// Returns true if the bus runs in the steps of the simulation.
pub fn is_stepped(config: &Config) -> bool {
    config.bus.is_stepped()
}

/// Returns the default pace. A free-running bus is a PLC in real time: a simulation that runs faster would see only a
/// few of its cycles.
pub(super) fn default_pace(config: &Config) -> f64 {
    if is_stepped(config) { 0.0 } else { 1.0 }
}

/// Returns the slots before the first step.
pub(super) fn initial_slots(config: &Config) -> Vec<Slot> {
    let map = SlotMap::new(&config.table, config.role);
    let mut slots = vec![Slot::default(); map.count];
    for (slot, signal) in slots.iter_mut().zip(&config.table.signals) {
        *slot = signal.fail_safe;
    }
    slots
}
