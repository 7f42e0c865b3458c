//! All variables of a driver.cfg as an FMU exposes them, and the slots behind them.

use std::collections::BTreeSet;

use tickbus_binding::SlotKind;
use tickbus_driver::SlotMap;
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{DataType, Signal, SignalTable, Slot};

use super::arrays::{self, Array};
use super::own::own_variables;
use super::variables::{Place, Start, Use, Variable};
use crate::value::{Value, ValueType, Version};

/// The place of a slot in its variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The slot is a variable.
    Whole,
    /// The slot is the first element of the array with this index.
    First(usize),
    /// The slot is a further element of an array.
    Further,
}

/// One slot, as seen by the functions of FMI.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// The place of the slot in its variable.
    pub part: Part,
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
    /// The arrays.
    pub arrays: Vec<Array>,
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

impl Exposed {
    /// Returns the variables of `config` in a version.
    pub fn of(config: &Config, version: Version) -> Self {
        let (table, (writes, _)) = (&config.table, config.role.areas());
        let map = SlotMap::new(table, config.role);
        let mut variables = own_variables(config, version);
        let mut cells = Vec::with_capacity(map.count);
        for signal in &table.signals {
            cells.push(Cell {
                part: Part::Whole,
                value_type: type_of(signal, version),
                kind: kind_of(signal),
                is_input: signal.area == writes,
            });
        }
        let arrays = match version {
            Version::Two => Vec::new(),
            Version::Three => {
                let counted = table.signals.iter().zip(&map.edges);
                let counted = counted.filter(|(_, slot)| slot.is_some());
                let edges: Vec<String> = counted.map(|(signal, _)| edges_of(signal)).collect();
                arrays_of(table, &cells, &variables, &edges)
            }
        };
        for (index, array) in arrays.iter().enumerate() {
            for (at, slot) in array.slots.iter().enumerate() {
                cells[*slot].part = if at == 0 {
                    Part::First(index)
                } else {
                    Part::Further
                };
            }
        }
        for (slot, (signal, cell)) in table.signals.iter().zip(&cells).enumerate() {
            let only = [slot];
            let (name, slots, sizes) = match cell.part {
                Part::Whole => (&signal.name, &only[..], Vec::new()),
                Part::First(index) => {
                    let array = &arrays[index];
                    (&array.name, &array.slots[..], array.sizes.clone())
                }
                Part::Further => continue,
            };
            let starts = slots.iter().map(|slot| {
                let signal: &Signal = &table.signals[*slot];
                Value::of(signal.fail_safe, cell.kind)
            });
            variables.push(Variable {
                name: name.clone(),
                reference: Place::Slot(slot).reference(),
                value_type: cell.value_type,
                enumeration: None,
                sizes,
                usage: if cell.is_input {
                    Use::Input
                } else {
                    Use::Output
                },
                unit: unit_of(signal, cell.value_type),
                start: Start::Numbers(starts.collect()),
                description: describe(table, slots),
            });
        }
        let edges = Cell {
            part: Part::Whole,
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
                name: edges_of(signal),
                reference: Place::Slot(*slot).reference(),
                value_type: edges.value_type,
                enumeration: None,
                sizes: Vec::new(),
                usage: Use::Output,
                unit: None,
                start: Start::Numbers(vec![Value::Unsigned(0)]),
                description: format!("edges of {} since the last step", signal.address()),
            });
            cells.push(edges);
        }
        Self {
            variables,
            cells,
            arrays,
        }
    }

    /// Returns the variable that a value reference stands for.
    pub fn variable(&self, reference: u32) -> Option<&Variable> {
        self.variables
            .iter()
            .find(|variable| variable.reference == reference)
    }

    /// Returns the number of values of the variables with these value references; an unknown one counts as one.
    pub fn count(&self, references: &[u32]) -> usize {
        let counts = references.iter().map(|reference| {
            let variable = self.variable(*reference);
            variable.map_or(1, Variable::count)
        });
        counts.sum()
    }
}

/// Returns the name of the variable that counts the edges of a signal.
fn edges_of(signal: &Signal) -> String {
    format!("{}.edges", signal.name)
}

/// Returns the arrays among the signals; none has a name of `own` variables or of those that count `edges`. Their elements have the same type, direction, unit and station.
fn arrays_of(
    table: &SignalTable,
    cells: &[Cell],
    own: &[Variable],
    edges: &[String],
) -> Vec<Array> {
    let names = table.signals.iter().map(|signal| signal.name.as_str());
    let taken: BTreeSet<&str> = names
        .chain(own.iter().map(|variable| variable.name.as_str()))
        .chain(edges.iter().map(String::as_str))
        .collect();
    let signals = table.signals.iter().zip(cells).map(|(signal, cell)| {
        let kind = (cell.value_type, cell.is_input, &signal.unit, signal.station);
        (signal.name.as_str(), kind)
    });
    arrays::find(signals, &taken)
}

fn unit_of(signal: &Signal, value_type: ValueType) -> Option<String> {
    signal.unit.clone().filter(|_| value_type.is_float())
}

/// Describes the signals in these slots, the elements of one variable: their addresses, type and station.
fn describe(table: &SignalTable, slots: &[usize]) -> String {
    let first = &table.signals[slots[0]];
    let station = &table.stations[first.station].name;
    let station = if station.is_empty() {
        String::new()
    } else {
        format!(" of {station}")
    };
    let address = first.address();
    let last = slots.last().filter(|_| slots.len() > 1);
    let Some(last) = last.map(|slot| &table.signals[*slot]) else {
        return format!("{address} {}{station}", first.data_type);
    };
    format!(
        "{} at {address} to {} at {} {}{station}",
        first.name,
        last.name,
        last.address(),
        first.data_type
    )
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
