//! Values of a run as values of a federation, and back, without a loss.

use tickbus_image::signal::DataType;
use tickbus_virtual_time::is_raw;

/// The type of a value in a federation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Double,
    Integer,
    Boolean,
}

/// A value in a federation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value {
    Double(f64),
    Integer(i64),
    Boolean(bool),
}

impl Kind {
    /// The type of the federation for variables of this type.
    pub(crate) const fn of(data_type: DataType) -> Self {
        match data_type {
            DataType::Bool => Self::Boolean,
            DataType::Real | DataType::Lreal => Self::Double,
            _ => Self::Integer,
        }
    }

    /// The name in messages, as HELICS spells it.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Double => "double",
            Self::Integer => "int64",
            Self::Boolean => "bool",
        }
    }
}

impl Value {
    /// The value of a [raw](is_raw) slot.
    ///
    /// # Errors
    ///
    /// An unsigned number beyond 63 bits, which a federation does not have.
    #[expect(clippy::cast_possible_truncation, reason = "a REAL has 32 bits")]
    pub(crate) fn of_raw(data_type: DataType, raw: u64) -> Result<Self, String> {
        Ok(match (Kind::of(data_type), data_type) {
            (Kind::Boolean, _) => Self::Boolean(raw != 0),
            (Kind::Double, DataType::Real) => Self::Double(f32::from_bits(raw as u32).into()),
            (Kind::Double, _) => Self::Double(f64::from_bits(raw)),
            (Kind::Integer, _) if data_type.is_signed() => Self::Integer(raw.cast_signed()),
            (Kind::Integer, _) => Self::Integer(i64::try_from(raw).map_err(|_| {
                format!(
                    "{raw} is more than the federation's whole numbers hold, {}",
                    i64::MAX
                )
            })?),
        })
    }

    /// The raw slot of the value in a variable of this type.
    ///
    /// # Errors
    ///
    /// The type does not have this whole number. A number for a REAL is rounded to its 32 bits.
    #[expect(clippy::cast_possible_truncation, reason = "a REAL has 32 bits")]
    pub(crate) fn raw(self, data_type: DataType) -> Result<u64, String> {
        match self {
            Self::Boolean(on) => Ok(on.into()),
            Self::Double(number) if data_type == DataType::Real => {
                Ok((number as f32).to_bits().into())
            }
            Self::Double(number) => Ok(number.to_bits()),
            Self::Integer(number) => {
                let fits = (data_type.is_signed() || number >= 0)
                    && is_raw(data_type, number.cast_unsigned());
                if !fits {
                    return Err(format!("{number} does not fit into its type {data_type}"));
                }
                Ok(number.cast_unsigned())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_pass_both_ways_without_a_loss_or_are_refused() {
        for (data_type, raw, value) in [
            (DataType::Bool, 1, Value::Boolean(true)),
            (DataType::Lreal, 0.1_f64.to_bits(), Value::Double(0.1)),
            (
                DataType::Int,
                (-300_i64).cast_unsigned(),
                Value::Integer(-300),
            ),
            (DataType::Word, 0xFFFF, Value::Integer(65_535)),
            (
                DataType::Ulint,
                i64::MAX.unsigned_abs(),
                Value::Integer(i64::MAX),
            ),
            (DataType::Lint, u64::MAX, Value::Integer(-1)),
        ] {
            assert_eq!(Value::of_raw(data_type, raw), Ok(value), "{data_type}");
            assert_eq!(value.raw(data_type), Ok(raw), "{data_type}");
        }
        let real = u64::from(0.1_f32.to_bits());
        let wide = Value::Double(f64::from(0.1_f32));
        assert_eq!(Value::of_raw(DataType::Real, real), Ok(wide));
        assert!(Value::of_raw(DataType::Lword, 1 << 63).is_err());
        for (data_type, number) in [
            (DataType::Int, 32_768),
            (DataType::Usint, -1),
            (DataType::Ulint, -1),
            (DataType::Dword, 1 << 32),
        ] {
            let told = Value::Integer(number).raw(data_type);
            let told = told.expect_err("it does not fit");
            assert_eq!(
                told,
                format!("{number} does not fit into its type {data_type}")
            );
        }
    }
}
