//! Conditions of replies.

use tickbus_image::signal::Slot;

use super::condition::{Condition, Demand};
use super::signal::Form;

/// Conditions that must hold together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Levels {
    /// A single BOOL, which is on if this is true: most conditions are so, and need no memory elsewhere.
    Bit(u32, bool),
    All(Box<[(Condition, Form)]>),
}

impl Levels {
    pub(crate) fn new(conditions: Vec<(Condition, Form)>) -> Self {
        if let [(condition, _)] = &conditions[..]
            && let Ok(signal) = u32::try_from(condition.signal)
        {
            match condition.demand {
                Demand::On => return Self::Bit(signal, true),
                Demand::Off => return Self::Bit(signal, false),
                _ => {}
            }
        }
        Self::All(conditions.into())
    }

    pub(crate) fn hold(&self, slots: &[Slot]) -> bool {
        match self {
            Self::Bit(signal, on) => (slots[*signal as usize].real() != 0.0) == *on,
            Self::All(all) => all.iter().all(|(condition, form)| {
                condition.holds_for(form.real(slots[condition.signal]), slots)
            }),
        }
    }
}
