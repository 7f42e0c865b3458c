//! Sets and gets the values of variables.

use std::ffi::CString;

use tickbus_fieldbus::LinkState;

use super::super::exposed::{Cell, Part};
use super::super::variables::{Place, Use, Variable, seconds};
use super::{Instance, Phase};
use crate::real_time::RealTime;
use crate::value::{Number, Value, ValueType, Version};

impl Instance {
    /// Sets variables of one type: one value for each, and for an array one for each element.
    ///
    /// # Errors
    ///
    /// A variable does not exist, is of another type, or cannot be set now; or there are more or fewer values. The
    /// variables before it are set.
    #[inline]
    pub fn set<T: Number>(
        &mut self,
        references: &[u32],
        mut values: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), String> {
        let count = values.len();
        if count != references.len() {
            self.check_count(references, count)?;
        }
        let is_settable = self.is_settable();
        for &reference in references {
            if let Some(Place::Slot(slot)) = Place::of(reference)
                && let Some(cell) = self.exposed.cells.get(slot)
                && cell.value_type == T::TYPE
                && (cell.is_input || is_settable)
            {
                match cell.part {
                    Part::Whole => {
                        if let Some(value) = values.next() {
                            self.slots[slot] = value.value().slot(cell.kind);
                            continue;
                        }
                    }
                    Part::First(array) => {
                        let array = &self.exposed.arrays[array];
                        if values.len() < array.slots.len() {
                            return self.check_count(references, count);
                        }
                        for (&slot, value) in array.slots.iter().zip(&mut values) {
                            self.slots[slot] = value.value().slot(cell.kind);
                        }
                        continue;
                    }
                    Part::Further => {}
                }
            }
            match values.next() {
                Some(value) => self.set_other(reference, T::TYPE, value.value())?,
                None => return self.check_count(references, count),
            }
        }
        Ok(())
    }

    /// Sets a variable that is not an input.
    #[cold]
    fn set_other(&mut self, reference: u32, given: ValueType, value: Value) -> Result<(), String> {
        let place = self.number(reference, given)?;
        match place {
            Place::Slot(slot) if self.exposed.cells[slot].is_input || self.is_settable() => {
                self.slots[slot] = value.slot(self.exposed.cells[slot].kind);
                Ok(())
            }
            Place::Pace if value.real().is_finite() && value.real() >= 0.0 => {
                self.real_time = RealTime::new(value.real());
                Ok(())
            }
            Place::Pace => Err(format!(
                "the pace is {}; write 1 for real time, or 0 for as fast as possible",
                value.real()
            )),
            // These variables have their start values, and nothing has been exchanged yet.
            Place::Status | Place::Age | Place::Sequence | Place::Lag | Place::State
                if self.is_settable() =>
            {
                Ok(())
            }
            _ => Err(self.read_only(reference)),
        }
    }

    /// Gets variables of one type, with one value for each, and for an array one for each element: `count` values in
    /// all. `put` gets the place of each value and the value.
    ///
    /// # Errors
    ///
    /// A variable does not exist, or is of another type; or `count` is wrong.
    #[inline]
    pub fn get<T: Number>(
        &self,
        references: &[u32],
        count: usize,
        mut put: impl FnMut(usize, T),
    ) -> Result<(), String> {
        if count != references.len() {
            self.check_count(references, count)?;
        }
        let mut at = 0;
        for &reference in references {
            if at >= count {
                return self.check_count(references, count);
            }
            if let Some(Place::Slot(slot)) = Place::of(reference)
                && let Some(&Cell {
                    part,
                    value_type,
                    kind,
                    ..
                }) = self.exposed.cells.get(slot)
                && value_type == T::TYPE
                && part != Part::Further
            {
                let only = [slot];
                let slots = match part {
                    Part::First(array) => &self.exposed.arrays[array].slots[..],
                    _ => &only,
                };
                if slots.len() > count - at {
                    return self.check_count(references, count);
                }
                for &slot in slots {
                    put(at, T::of(Value::of(self.slots[slot], kind)));
                    at += 1;
                }
            } else {
                put(at, T::of(self.other(reference, T::TYPE)?));
                at += 1;
            }
        }
        Ok(())
    }

    fn other(&self, reference: u32, asked: ValueType) -> Result<Value, String> {
        Ok(match self.number(reference, asked)? {
            Place::Time => Value::Real(self.time),
            Place::Pace => Value::Real(self.real_time.pace),
            Place::Status => Value::Signed(self.found.code.code().into()),
            Place::Age => Value::Real(seconds(self.found.age)),
            Place::Sequence => Value::Unsigned(self.found.sequence),
            Place::Lag => Value::Real(seconds(self.real_time.lag())),
            Place::State => Value::Signed(self.state()),
            Place::Slot(slot) => Value::of(self.slots[slot], self.exposed.cells[slot].kind),
            Place::Address | Place::Record | Place::Reason | Place::Cycle => {
                return Err(self.mistyped(reference, asked));
            }
        })
    }

    /// Returns the state of the line, as an item of its enumeration.
    fn state(&self) -> i64 {
        let state = self.driver.as_ref().map(|driver| driver.link().state);
        let place = LinkState::ALL.iter().position(|one| Some(*one) == state);
        place
            .and_then(|place| i64::try_from(place).ok())
            .unwrap_or(0)
    }

    /// Checks the number of values for these variables.
    ///
    /// # Errors
    ///
    /// The number is wrong.
    #[cold]
    pub fn check_count(&self, references: &[u32], count: usize) -> Result<(), String> {
        let right = self.exposed.count(references);
        if count == right {
            return Ok(());
        }
        Err(format!(
            "{count} values for variables that have {right}; hand in one for each, and for an array one for each element"
        ))
    }

    /// Sets a text.
    ///
    /// # Errors
    ///
    /// There is no such text, or the run has begun.
    pub fn set_text(&mut self, reference: u32, text: CString) -> Result<(), String> {
        let place = self.checked(reference, ValueType::String)?;
        if !self.is_settable() {
            return Err(self.read_only(reference));
        }
        text.to_str()
            .map_err(|why| format!("a text that is not UTF-8: {why}"))?;
        match place {
            Place::Address => self.address = text,
            Place::Record => self.record = text,
            // The start value; nothing has happened yet.
            _ => {}
        }
        Ok(())
    }

    /// Brings the texts up to date that the instance itself writes. Texts read before are no longer valid.
    pub fn refresh_texts(&mut self) {
        let Some(driver) = &self.driver else { return };
        let reason = driver.link().reason.replace('\0', " ");
        self.reason = CString::new(reason).unwrap_or_default();
    }

    /// Returns a text, which stays valid until it is set or brought up to date, or the instance ends.
    ///
    /// # Errors
    ///
    /// There is no such text.
    pub fn text(&self, reference: u32) -> Result<&CString, String> {
        Ok(match self.checked(reference, ValueType::String)? {
            Place::Address => &self.address,
            Place::Reason => &self.reason,
            _ => &self.record,
        })
    }

    /// Returns whether a clock ticks.
    ///
    /// # Errors
    ///
    /// There is no such clock, or the instance is not in the event mode.
    pub fn ticks(&self, reference: u32) -> Result<bool, String> {
        if self.phase != Phase::Events {
            return Err(self.unfit("asking whether a clock ticks"));
        }
        match (Place::of(reference), self.exposed.variable(reference)) {
            (Some(Place::Cycle), Some(_)) => Ok(self.ticks),
            (_, Some(variable)) => Err(format!(
                "\"{}\" (value reference {reference}) is of type {}, not Clock; call the functions of its own type",
                variable.name,
                variable.element()
            )),
            (_, None) => Err(unknown(reference)),
        }
    }

    /// As [`checked`](Self::checked), for numbers. In FMI 2.0 some tools get and set every variable as a Real; that is
    /// accepted, since nothing is lost.
    fn number(&self, reference: u32, asked: ValueType) -> Result<Place, String> {
        let is_text = |one: &Variable| one.value_type == ValueType::String;
        match (Place::of(reference), self.exposed.variable(reference)) {
            (Some(place), Some(variable))
                if self.version == Version::Two
                    && asked == ValueType::Float64
                    && !is_text(variable) =>
            {
                Ok(place)
            }
            _ => self.checked(reference, asked),
        }
    }

    /// Returns the place that a value reference stands for, if it is of this type.
    fn checked(&self, reference: u32, asked: ValueType) -> Result<Place, String> {
        let variable = self.exposed.variable(reference);
        match (Place::of(reference), variable) {
            (Some(place), Some(variable))
                if variable.value_type == asked && variable.usage != Use::Clock =>
            {
                Ok(place)
            }
            (Some(_), Some(_)) => Err(self.mistyped(reference, asked)),
            _ => Err(unknown(reference)),
        }
    }

    fn mistyped(&self, reference: u32, asked: ValueType) -> String {
        match self.exposed.variable(reference) {
            Some(variable) => format!(
                "\"{}\" (value reference {reference}) is of type {}, not {}; call the functions of its own type",
                variable.name,
                variable.element(),
                asked.name()
            ),
            None => unknown(reference),
        }
    }

    fn read_only(&self, reference: u32) -> String {
        let name = self.exposed.variable(reference);
        let name = name.map_or_else(String::new, |variable| variable.name.clone());
        format!(
            "\"{name}\" cannot be set now: outputs and fixed parameters have the values that they got before the initialisation"
        )
    }
}

fn unknown(reference: u32) -> String {
    format!(
        "there is no variable with the value reference {reference}; take those of modelDescription.xml"
    )
}
