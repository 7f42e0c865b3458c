//! Converts between the bits of signals and OPC UA values, which are raw values without scale.

use opcua::types::{DataTypeId, Variant, VariantScalarTypeId};

use tickbus_image::signal::DataType;

/// The OPC UA type of a data type.
pub(super) fn scalar(data_type: DataType) -> VariantScalarTypeId {
    match data_type {
        DataType::Bool => VariantScalarTypeId::Boolean,
        DataType::Sint => VariantScalarTypeId::SByte,
        DataType::Byte | DataType::Usint => VariantScalarTypeId::Byte,
        DataType::Int => VariantScalarTypeId::Int16,
        DataType::Word | DataType::Uint => VariantScalarTypeId::UInt16,
        DataType::Dint => VariantScalarTypeId::Int32,
        DataType::Dword | DataType::Udint => VariantScalarTypeId::UInt32,
        DataType::Real => VariantScalarTypeId::Float,
        DataType::Lint => VariantScalarTypeId::Int64,
        DataType::Lword | DataType::Ulint => VariantScalarTypeId::UInt64,
        DataType::Lreal => VariantScalarTypeId::Double,
    }
}

/// The types of signals, one for each type of OPC UA that a signal can have.
const TYPES: [DataType; 11] = [
    DataType::Bool,
    DataType::Sint,
    DataType::Usint,
    DataType::Int,
    DataType::Uint,
    DataType::Dint,
    DataType::Udint,
    DataType::Real,
    DataType::Lint,
    DataType::Ulint,
    DataType::Lreal,
];

/// The data type of an OPC UA type; `None` if no signal can have it.
pub(super) fn of_scalar(theirs: VariantScalarTypeId) -> Option<DataType> {
    TYPES.into_iter().find(|own| scalar(*own) == theirs)
}

/// The data type of values that the node `theirs` describes; `None` if no signal can have it, or if the values have types
/// of their own.
pub(super) fn of_data_type_id(theirs: DataTypeId) -> Option<DataType> {
    TYPES.into_iter().find(|own| data_type_id(*own) == theirs)
}

/// The node that describes a type.
pub(super) fn data_type_id(data_type: DataType) -> DataTypeId {
    match scalar(data_type) {
        VariantScalarTypeId::Boolean => DataTypeId::Boolean,
        VariantScalarTypeId::SByte => DataTypeId::SByte,
        VariantScalarTypeId::Byte => DataTypeId::Byte,
        VariantScalarTypeId::Int16 => DataTypeId::Int16,
        VariantScalarTypeId::UInt16 => DataTypeId::UInt16,
        VariantScalarTypeId::Int32 => DataTypeId::Int32,
        VariantScalarTypeId::UInt32 => DataTypeId::UInt32,
        VariantScalarTypeId::Float => DataTypeId::Float,
        VariantScalarTypeId::Int64 => DataTypeId::Int64,
        VariantScalarTypeId::UInt64 => DataTypeId::UInt64,
        _ => DataTypeId::Double,
    }
}

/// A signal's bits as an OPC UA value.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "the bits of a width, taken as what they are"
)]
pub(super) fn variant(data_type: DataType, wide: u64) -> Variant {
    match scalar(data_type) {
        VariantScalarTypeId::Boolean => Variant::Boolean(wide != 0),
        VariantScalarTypeId::SByte => Variant::SByte(wide as i8),
        VariantScalarTypeId::Byte => Variant::Byte(wide as u8),
        VariantScalarTypeId::Int16 => Variant::Int16(wide as i16),
        VariantScalarTypeId::UInt16 => Variant::UInt16(wide as u16),
        VariantScalarTypeId::Int32 => Variant::Int32(wide as i32),
        VariantScalarTypeId::UInt32 => Variant::UInt32(wide as u32),
        VariantScalarTypeId::Float => Variant::Float(f32::from_bits(wide as u32)),
        VariantScalarTypeId::Int64 => Variant::Int64(wide as i64),
        VariantScalarTypeId::UInt64 => Variant::UInt64(wide),
        _ => Variant::Double(f64::from_bits(wide)),
    }
}

/// The bits of a value, for a signal of this type; `None` when the value has another type.
pub(super) fn bits(data_type: DataType, value: &Variant) -> Option<u64> {
    if value.scalar_type_id() != Some(scalar(data_type)) {
        return None;
    }
    Some(match *value {
        Variant::Boolean(value) => value.into(),
        Variant::SByte(value) => value.cast_unsigned().into(),
        Variant::Byte(value) => value.into(),
        Variant::Int16(value) => value.cast_unsigned().into(),
        Variant::UInt16(value) => value.into(),
        Variant::Int32(value) => value.cast_unsigned().into(),
        Variant::UInt32(value) => value.into(),
        Variant::Float(value) => value.to_bits().into(),
        Variant::Int64(value) => value.cast_unsigned(),
        Variant::UInt64(value) => value,
        Variant::Double(value) => value.to_bits(),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn every_type_goes_both_ways_with_every_bit() {
        for (data_type, values) in [
            (
                DataType::Bool,
                vec![Variant::Boolean(true), Variant::Boolean(false)],
            ),
            (
                DataType::Sint,
                vec![Variant::SByte(-128), Variant::SByte(127)],
            ),
            (DataType::Byte, vec![Variant::Byte(255)]),
            (
                DataType::Int,
                vec![Variant::Int16(-2), Variant::Int16(i16::MAX)],
            ),
            (DataType::Word, vec![Variant::UInt16(0xFF01)]),
            (
                DataType::Dint,
                vec![Variant::Int32(i32::MIN), Variant::Int32(-3)],
            ),
            (DataType::Udint, vec![Variant::UInt32(u32::MAX - 1)]),
            (
                DataType::Real,
                vec![Variant::Float(-0.0), Variant::Float(f32::INFINITY)],
            ),
            (DataType::Lint, vec![Variant::Int64(i64::MIN + 1)]),
            (DataType::Ulint, vec![Variant::UInt64(u64::MAX - 1)]),
            (DataType::Lreal, vec![Variant::Double(-1e300)]),
        ] {
            for value in &values {
                let bits = bits(data_type, value).expect("its own type");
                assert_eq!(&variant(data_type, bits), value);
            }
        }
    }

    #[test]
    fn a_value_of_another_type_is_none() {
        assert_eq!(bits(DataType::Int, &Variant::Int32(1)), None);
        assert_eq!(bits(DataType::Bool, &Variant::Byte(1)), None);
        assert_eq!(bits(DataType::Real, &Variant::Double(1.0)), None);
        let list = Variant::from(vec![1_i16, 2]);
        assert_eq!(bits(DataType::Int, &list), None);
    }
}
