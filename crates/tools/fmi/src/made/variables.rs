//! The variables of the FMU made from a driver.cfg.

use tickbus_base::time::Nanos;

use crate::value::{Value, ValueType};

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
    /// How late the last step ended.
    Lag,
    /// The state of the line.
    State,
    /// Why the line is in its state.
    Reason,
    /// The clock that ticks when a new whole bus cycle has arrived.
    Cycle,
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
    /// The tool asks in the event mode whether it ticks.
    Clock,
}

/// The value of a variable before the first step.
#[derive(Clone, Debug, PartialEq)]
pub enum Start {
    /// None: the time has its own start value.
    None,
    /// A number, or those of an array.
    Numbers(Vec<Value>),
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
    /// The enumeration that the type is, if it is one.
    pub enumeration: Option<&'static Enumeration>,
    /// The number of elements in each dimension; empty for a scalar.
    pub sizes: Vec<usize>,
    /// The variable's use.
    pub usage: Use,
    /// The unit, for floating point numbers only.
    pub unit: Option<String>,
    /// The value before the first step.
    pub start: Start,
    /// The description, one line for people.
    pub description: String,
}

/// An enumeration of FMI 3.0.
#[derive(Debug, PartialEq, Eq)]
pub struct Enumeration {
    /// The name of the type.
    pub name: &'static str,
    /// The names of the items; the value of each is its index here.
    pub items: &'static [&'static str],
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
            7 => Self::Lag,
            8 => Self::State,
            9 => Self::Reason,
            10 => Self::Cycle,
            FIRST_SLOT.. => Self::Slot((reference - FIRST_SLOT) as usize),
            _ => return None,
        })
    }

    /// Returns the value reference of a variable with this meaning.
    pub(super) fn reference(self) -> u32 {
        match self {
            Self::Time => 0,
            Self::Pace => 1,
            Self::Address => 2,
            Self::Record => 3,
            Self::Status => 4,
            Self::Age => 5,
            Self::Sequence => 6,
            Self::Lag => 7,
            Self::State => 8,
            Self::Reason => 9,
            Self::Cycle => 10,
            Self::Slot(slot) => FIRST_SLOT + u32::try_from(slot).unwrap_or(u32::MAX - FIRST_SLOT),
        }
    }
}

/// Returns a span in seconds, as a variable shows it.
#[expect(clippy::cast_precision_loss, reason = "for people")]
pub(super) fn seconds(span: Nanos) -> f64 {
    span.0 as f64 / 1e9
}

impl Variable {
    /// Returns the name of the variable's element in a model description of FMI 3.0, which is that of its type.
    pub const fn element(&self) -> &'static str {
        match (self.usage, self.enumeration) {
            (Use::Clock, _) => "Clock",
            (_, Some(_)) => "Enumeration",
            _ => self.value_type.name(),
        }
    }

    /// Returns the number of values.
    pub fn count(&self) -> usize {
        self.sizes.iter().product()
    }
}
