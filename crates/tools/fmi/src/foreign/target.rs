//! A variable as calls of an FMU name it.

use serde::{Deserialize, Serialize};

use super::library::Instance;
use super::model::{Element, ForeignVariable};
use crate::value::{Status, Value, ValueType};

/// A scalar variable, or an element of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Target {
    pub kind: ValueType,
    pub reference: u32,
    /// The place in the array, from 0.
    pub at: usize,
    /// The number of elements of the array; 1 for a scalar.
    pub of: usize,
}

impl Target {
    /// The variable; `None` if its type is none of numbers.
    pub(super) fn of(variable: &ForeignVariable) -> Option<Self> {
        let element = variable.element.unwrap_or(Element { at: 0, of: 1 });
        Some(Self {
            kind: variable.value_type?,
            reference: variable.reference,
            at: element.at,
            of: element.of,
        })
    }

    /// Reads the variable by a call of its own; of an array all elements.
    pub(super) fn get(&self, instance: &mut Instance) -> (Status, Value) {
        let mut values = vec![Value::Real(0.0); self.of];
        let status = instance.get(self.kind, &[self.reference], &mut values);
        (status, values[self.at])
    }

    /// Sets the variable by a call of its own; of an array, the other elements keep their values.
    pub(super) fn set(&self, instance: &mut Instance, value: Value) -> Status {
        let mut values = vec![value; self.of];
        if self.of > 1 {
            let status = instance.get(self.kind, &[self.reference], &mut values);
            if !matches!(status, Status::Ok | Status::Warning) {
                return status;
            }
            values[self.at] = value;
        }
        instance.set(self.kind, &[self.reference], &values)
    }
}
