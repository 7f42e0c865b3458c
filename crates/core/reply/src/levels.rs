//! Conditions of replies.

use tickbus_image::signal::Slot;

use super::condition::{Condition, Demand};
use super::signal::Form;

/// Conditions that must hold together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Levels(Box<[Level]>);

#[derive(Clone, Debug, PartialEq)]
enum Level {
    /// The signal is a BOOL, and is on if this is true. Most conditions are this small.
    Bit(u32, bool),
    Other(Box<(Condition, Form)>),
}

impl Levels {
    pub(crate) fn new(conditions: Vec<(Condition, Form)>) -> Self {
        let level = |(condition, form): (Condition, Form)| match (
            &condition.demand,
            u32::try_from(condition.signal),
        ) {
            (Demand::On, Ok(signal)) => Level::Bit(signal, true),
            (Demand::Off, Ok(signal)) => Level::Bit(signal, false),
            _ => Level::Other(Box::new((condition, form))),
        };
        Self(conditions.into_iter().map(level).collect())
    }

    pub(crate) fn hold(&self, slots: &[Slot]) -> bool {
        self.0.iter().all(|level| match level {
            Level::Bit(signal, on) => (slots[*signal as usize].real() != 0.0) == *on,
            Level::Other(it) => {
                let (condition, form) = &**it;
                condition.holds_for(form.real(slots[condition.signal]), slots)
            }
        })
    }
}
