//! The 8-byte slots through which a simulation and the driver exchange values.

/// One value, as 64 bits.
///
/// A slot holds an IEEE 754 double, except for an unscaled LWORD, LINT or ULINT: a double cannot represent
/// all of their 64 bits, so their slots hold an integer ([`Signal::is_integer_slot`](super::Signal)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct Slot(pub u64);

impl Slot {
    /// A slot that holds a double.
    pub const fn from_real(value: f64) -> Self {
        Self(value.to_bits())
    }

    /// The double that the slot holds.
    pub const fn real(self) -> f64 {
        f64::from_bits(self.0)
    }

    /// A slot that holds a signed 64-bit integer.
    pub const fn from_signed(value: i64) -> Self {
        Self(value.cast_unsigned())
    }

    /// The signed 64-bit integer that the slot holds.
    pub const fn signed(self) -> i64 {
        self.0.cast_signed()
    }

    /// A slot that holds an unsigned 64-bit integer.
    pub const fn from_unsigned(value: u64) -> Self {
        Self(value)
    }

    /// The unsigned 64-bit integer that the slot holds.
    pub const fn unsigned(self) -> u64 {
        self.0
    }
}
