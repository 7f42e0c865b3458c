//! The contents of a model description.

use serde::{Deserialize, Serialize};

use crate::value::{ValueType, Version};

/// The contents of a model description that a run needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The version of FMI.
    pub version: Version,
    /// The model's name.
    pub name: String,
    /// The name of the FMU's library.
    pub identifier: String,
    /// The token that the library expects.
    pub token: String,
    /// The step that the FMU proposes, in seconds.
    pub step: Option<f64>,
    /// The start time that the FMU proposes, in seconds.
    pub start: f64,
    /// The relative tolerance that the FMU proposes for its solver.
    pub tolerance: Option<f64>,
    /// True if the FMU needs the tool that generated it.
    pub needs_tool: bool,
    /// The variables, in the order of the model description. The elements of an array are variables of their own.
    pub variables: Vec<ForeignVariable>,
    /// True if the FMU has an event mode.
    pub(super) has_event_mode: bool,
    /// The clocks that the importer lets tick at their times.
    pub(super) clocks: Vec<Clock>,
    /// The clocks that the FMU lets tick.
    pub(super) own_clocks: Vec<u32>,
    /// The arrays among the variables, by each of their names.
    pub(super) arrays: Vec<Array>,
    /// The variables as the model description has them.
    pub(super) declared: Vec<Declared>,
}

/// The role of a variable for the importing tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// The tool sets it before every step.
    Input,
    /// The tool reads it after every step.
    Output,
    /// The tool can set it before the run.
    Parameter,
    /// Any other variable; the tool can read it.
    Local,
}

/// One variable.
#[derive(Clone, Debug, PartialEq)]
pub struct ForeignVariable {
    /// The variable's name.
    pub name: String,
    /// The value reference, which identifies the variable in calls.
    pub reference: u32,
    /// The variable's type; `None` if the variable cannot be a signal.
    pub value_type: Option<ValueType>,
    /// The name of the type, with "array of" for an array without elements; for people.
    pub type_name: String,
    /// The variable's role for the importing tool.
    pub causality: Causality,
    /// True if the tool can set the variable while the FMU runs: an input, or a tunable parameter.
    pub is_changeable: bool,
    /// The unit, if the variable names one.
    pub unit: Option<String>,
    /// The variable's other names.
    pub aliases: Vec<String>,
    /// True for a structural parameter, which the tool sets before all others.
    pub(super) is_structural: bool,
    /// The values of an enumeration, by name.
    pub(super) items: Vec<(String, i64)>,
    /// The clocks at whose ticks alone the variable has a value.
    pub(super) clocks: Vec<u32>,
    /// The place in an array; `None` for a scalar.
    pub(super) element: Option<Element>,
}

impl ForeignVariable {
    /// Returns true for an element of an array.
    pub fn is_element(&self) -> bool {
        self.element.is_some()
    }
}

/// One dimension of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dimension {
    /// A fixed number of elements.
    Fixed(u64),
    /// The value of the structural parameter with this value reference.
    Structural(u32),
}

/// A variable as the model description has it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Declared {
    pub variable: ForeignVariable,
    /// Empty for a scalar.
    pub dimensions: Vec<Dimension>,
    /// The start value of a structural parameter.
    pub size: Option<u64>,
}

/// The place of an element in its array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Element {
    /// Counts from 0, in row-major order.
    pub at: usize,
    /// The number of elements of the array.
    pub of: usize,
}

/// An array whose elements are variables.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    /// The name of the array.
    pub name: String,
    /// The type of its elements.
    pub type_name: String,
    /// The position of the first element among the variables.
    pub first: usize,
    /// The number of elements.
    pub count: usize,
    /// The number of elements along each dimension.
    pub shape: Vec<u64>,
}

/// The times at which a clock ticks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Timing {
    /// First after `shift`, then every `interval`, in seconds.
    Periodic { interval: f64, shift: f64 },
    /// First after `shift`, for which the FMU is asked if its model description does not state it; then after the
    /// interval, for which the FMU is asked at the beginning, and after each of its events.
    Asked { shift: Option<f64> },
    /// Once after each interval that the FMU states.
    Countdown,
}

/// A clock that the importer lets tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Clock {
    pub reference: u32,
    pub timing: Timing,
}
