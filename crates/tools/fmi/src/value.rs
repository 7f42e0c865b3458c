//! The parts that both directions share: the versions, the types of variables, and their values.

use serde::{Deserialize, Serialize};

use tickbus_binding::SlotKind;
use tickbus_image::signal::Slot;

/// A version of FMI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

impl Version {
    /// Both versions.
    pub const ALL: [Self; 2] = [Self::Two, Self::Three];

    /// Returns the version's name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Two => "fmi2",
            Self::Three => "fmi3",
        }
    }

    /// Returns the version's number, as a model description writes it.
    pub const fn number(self) -> &'static str {
        match self {
            Self::Two => "2.0",
            Self::Three => "3.0",
        }
    }
}

/// The status that a function of FMI returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Status {
    /// Success.
    Ok = 0,
    /// Success, with a message.
    Warning = 1,
    /// The step was not done.
    Discard = 2,
    /// The call failed, and this instance has ended.
    Error = 3,
    /// The call failed, and all instances have ended.
    Fatal = 4,
}

impl Status {
    /// Returns the status with this number; numbers that a version does not define are fatal.
    pub const fn of(number: i32) -> Self {
        match number {
            0 => Self::Ok,
            1 => Self::Warning,
            2 => Self::Discard,
            3 => Self::Error,
            _ => Self::Fatal,
        }
    }
}

/// The type of a scalar variable, by its name in FMI 3.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum ValueType {
    /// 32-bit IEEE 754 number.
    Float32,
    /// 64-bit IEEE 754 number; `Real` of FMI 2.0.
    Float64,
    /// 8-bit signed integer.
    Int8,
    /// 8-bit unsigned integer.
    UInt8,
    /// 16-bit signed integer.
    Int16,
    /// 16-bit unsigned integer.
    UInt16,
    /// 32-bit signed integer; `Integer` and `Enumeration` of FMI 2.0.
    Int32,
    /// 32-bit unsigned integer.
    UInt32,
    /// 64-bit signed integer; `Enumeration` of FMI 3.0.
    Int64,
    /// 64-bit unsigned integer.
    UInt64,
    /// True or false.
    Boolean,
    /// A text.
    String,
}

impl ValueType {
    /// Returns the type's name in FMI 3.0.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Float32 => "Float32",
            Self::Float64 => "Float64",
            Self::Int8 => "Int8",
            Self::UInt8 => "UInt8",
            Self::Int16 => "Int16",
            Self::UInt16 => "UInt16",
            Self::Int32 => "Int32",
            Self::UInt32 => "UInt32",
            Self::Int64 => "Int64",
            Self::UInt64 => "UInt64",
            Self::Boolean => "Boolean",
            Self::String => "String",
        }
    }

    /// Returns the type's name in a version.
    pub const fn name_in(self, version: Version) -> &'static str {
        match (version, self) {
            (Version::Two, Self::Float64) => "Real",
            (Version::Two, Self::Int32) => "Integer",
            _ => self.name(),
        }
    }

    /// Returns true for a floating point number; only these can have a unit.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::Float32 | Self::Float64)
    }
}

/// The value of a variable that can be a signal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// The value of a floating point number.
    Real(f64),
    /// The value of a signed integer.
    Signed(i64),
    /// The value of an unsigned integer.
    Unsigned(u64),
    /// The value of a Boolean.
    Boolean(bool),
}

impl Value {
    /// Returns the value as a double; a large integer is rounded to the nearest one.
    #[expect(clippy::cast_precision_loss, reason = "as documented")]
    pub const fn real(self) -> f64 {
        match self {
            Self::Real(value) => value,
            Self::Signed(value) => value as f64,
            Self::Unsigned(value) => value as f64,
            Self::Boolean(value) => value as u8 as f64,
        }
    }

    /// Returns the value as a slot holds it.
    pub fn slot(self, kind: SlotKind) -> Slot {
        match (kind, self) {
            (SlotKind::Real, value) => Slot::from_real(value.real()),
            (SlotKind::Signed, Self::Signed(value)) => Slot::from_signed(value),
            (SlotKind::Signed, Self::Unsigned(value)) => {
                Slot::from_signed(i64::try_from(value).unwrap_or(i64::MAX))
            }
            (SlotKind::Signed, value) => Slot::from_signed(i64::from_real(value.real())),
            (SlotKind::Unsigned, Self::Unsigned(value)) => Slot::from_unsigned(value),
            (SlotKind::Unsigned, Self::Signed(value)) => {
                Slot::from_unsigned(u64::try_from(value).unwrap_or(0))
            }
            (SlotKind::Unsigned, value) => Slot::from_unsigned(u64::from_real(value.real())),
        }
    }

    /// Reads the value that a slot holds.
    pub const fn of(slot: Slot, kind: SlotKind) -> Self {
        match kind {
            SlotKind::Real => Self::Real(slot.real()),
            SlotKind::Signed => Self::Signed(slot.signed()),
            SlotKind::Unsigned => Self::Unsigned(slot.unsigned()),
        }
    }
}

/// A number type of the FMI functions.
pub trait Number: Copy {
    /// The FMI type whose functions use this number type.
    const TYPE: ValueType;

    /// Converts to the nearest value of this type; 0 for NaN.
    fn from_real(value: f64) -> Self;

    /// Converts to the nearest value of this type.
    fn of(value: Value) -> Self;

    /// Returns this number as a [`Value`].
    fn value(self) -> Value;
}

macro_rules! floats {
    ($($own:ident: $name:ident,)+) => {$(
        impl Number for $own {
            const TYPE: ValueType = ValueType::$name;

            #[allow(clippy::cast_possible_truncation, reason = "the nearest one")]
            #[inline]
            fn from_real(value: f64) -> Self {
                value as Self
            }

            #[inline]
            fn of(value: Value) -> Self {
                Self::from_real(value.real())
            }

            #[inline]
            fn value(self) -> Value {
                Value::Real(self.into())
            }
        }
    )+};
}

macro_rules! integers {
    ($($own:ident: $name:ident, $value:ident;)+) => {$(
        impl Number for $own {
            const TYPE: ValueType = ValueType::$name;

            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the nearest one")]
            #[inline]
            fn from_real(value: f64) -> Self {
                value.round() as Self
            }

            #[inline]
            fn of(value: Value) -> Self {
                match value {
                    Value::Signed(value) => {
                        Self::try_from(value).unwrap_or(if value < 0 { Self::MIN } else { Self::MAX })
                    }
                    Value::Unsigned(value) => Self::try_from(value).unwrap_or(Self::MAX),
                    value => Self::from_real(value.real()),
                }
            }

            #[inline]
            fn value(self) -> Value {
                Value::$value(self.into())
            }
        }
    )+};
}

floats! { f32: Float32, f64: Float64, }
integers! {
    i8: Int8, Signed;
    u8: UInt8, Unsigned;
    i16: Int16, Signed;
    u16: UInt16, Unsigned;
    i32: Int32, Signed;
    u32: UInt32, Unsigned;
    i64: Int64, Signed;
    u64: UInt64, Unsigned;
}

impl Number for bool {
    const TYPE: ValueType = ValueType::Boolean;

    #[inline]
    fn from_real(value: f64) -> Self {
        value != 0.0
    }

    #[inline]
    fn of(value: Value) -> Self {
        match value {
            Value::Boolean(value) => value,
            Value::Signed(value) => value != 0,
            Value::Unsigned(value) => value != 0,
            Value::Real(value) => Self::from_real(value),
        }
    }

    #[inline]
    fn value(self) -> Value {
        Value::Boolean(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_of_64_bits_pass_unchanged_and_others_take_the_nearest_value() {
        let large = u64::MAX - 1;
        let slot = Value::Unsigned(large).slot(SlotKind::Unsigned);
        assert_eq!(u64::of(Value::of(slot, SlotKind::Unsigned)), large);
        let slot = Value::Signed(i64::MIN + 1).slot(SlotKind::Signed);
        assert_eq!(i64::of(Value::of(slot, SlotKind::Signed)), i64::MIN + 1);
        assert_eq!(
            Value::Real(2.5e30).slot(SlotKind::Signed).signed(),
            i64::MAX
        );
        assert_eq!(Value::Real(-1.0).slot(SlotKind::Unsigned).unsigned(), 0);
        assert_eq!(
            Value::Unsigned(u64::MAX).slot(SlotKind::Signed).signed(),
            i64::MAX
        );
        assert_eq!(i8::of(Value::Real(-300.0)), -128);
        assert_eq!(u16::of(Value::Real(f64::NAN)), 0);
        assert_eq!(i32::of(Value::Real(2.5)), 3);
        assert!(bool::of(Value::Real(0.1)) && !bool::of(Value::Signed(0)));
    }
}
