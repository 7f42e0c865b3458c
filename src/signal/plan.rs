//! The codec plan: how slots become frame bytes and back, compiled once from the signal table.

use super::{Area, SignalTable, Slot};

/// What encoding had to bend, as counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conversions {
    /// Values beyond the range of their type, replaced by the nearest end of it.
    pub saturated: u32,
    /// NaN values, replaced by the signal's fail-safe value.
    pub not_a_number: u32,
}

/// The way between slots and one frame (one area of one station).
#[derive(Debug)]
pub struct Plan;

impl Plan {
    /// Compiles the plan for `area` of the station with index `station`.
    ///
    /// Slot numbers are positions in `table.signals`. Frames must be as long as the station says.
    pub fn new(_table: &SignalTable, _station: usize, _area: Area) -> Self {
        Self
    }

    /// Encodes the area's slots into `frame`. Bytes and bits that no signal covers become zero.
    ///
    /// # Panics
    ///
    /// When `frame` or `slots` is shorter than the plan was made for.
    pub fn encode(&self, _slots: &[Slot], _frame: &mut [u8]) -> Conversions {
        Conversions::default()
    }

    /// Decodes `frame` into the area's slots; other slots stay untouched.
    ///
    /// # Panics
    ///
    /// When `frame` or `slots` is shorter than the plan was made for.
    pub fn decode(&self, _frame: &[u8], _slots: &mut [Slot]) {}

    /// Writes the fail-safe values of the area's signals into their slots.
    ///
    /// # Panics
    ///
    /// When `slots` is shorter than the plan was made for.
    pub fn fail_safe(&self, _slots: &mut [Slot]) {}
}
