//! The signals that replies read and make.

use tickbus_image::signal::{DataType, Signal, Slot};

/// The value in a slot of `signal`; the nearest double if it is a 64-bit integer.
pub fn real(slot: Slot, signal: &Signal) -> f64 {
    Form::of(signal).real(slot)
}

/// The meaning of a slot's bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    Double,
    Signed,
    Unsigned,
}

impl Form {
    pub(crate) fn of(signal: &Signal) -> Self {
        if !signal.is_integer_slot() {
            Self::Double
        } else if signal.data_type == DataType::Lint {
            Self::Signed
        } else {
            Self::Unsigned
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "for people and comparisons")]
    pub(crate) fn real(self, slot: Slot) -> f64 {
        match self {
            Self::Double => slot.real(),
            Self::Signed => slot.signed() as f64,
            Self::Unsigned => slot.unsigned() as f64,
        }
    }

    /// The slot of a number; of the nearest whole one where the slot is an integer.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the limits of the reply are those of the type"
    )]
    pub(crate) fn slot(self, value: f64) -> Slot {
        match self {
            Self::Double => Slot::from_real(value),
            Self::Signed => Slot::from_signed(value.round() as i64),
            Self::Unsigned => Slot::from_unsigned(value.round() as u64),
        }
    }
}

/// A signal whose number a reply reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Input {
    pub(crate) signal: usize,
    pub(crate) form: Form,
}

impl Input {
    pub(crate) fn value(self, slots: &[Slot]) -> f64 {
        self.form.real(slots[self.signal])
    }
}

/// A signal that a reply makes. Small, because a tick looks at all of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Output {
    signal: u32,
    pub(crate) form: Form,
}

impl Output {
    /// The signal with this index; `None` beyond what a table can have.
    pub(crate) fn new(signal: usize, form: Form) -> Option<Self> {
        let signal = u32::try_from(signal).ok()?;
        Some(Self { signal, form })
    }

    pub(crate) const fn signal(self) -> usize {
        self.signal as usize
    }
}
