//! How Siemens spells addresses and types.

use super::record::Place;
use tickbus_image::signal::{DataType, Width};

/// A type, in the letters of TIA Portal.
pub(super) fn spelling(data_type: DataType) -> &'static str {
    match data_type {
        DataType::Bool => "Bool",
        DataType::Byte => "Byte",
        DataType::Sint => "SInt",
        DataType::Usint => "USInt",
        DataType::Word => "Word",
        DataType::Int => "Int",
        DataType::Uint => "UInt",
        DataType::Dword => "DWord",
        DataType::Dint => "DInt",
        DataType::Udint => "UDInt",
        DataType::Real => "Real",
        DataType::Lword => "LWord",
        DataType::Lint => "LInt",
        DataType::Ulint => "ULInt",
        DataType::Lreal => "LReal",
    }
}

/// An address as Siemens spells it, `%I0.3` where IEC 61131-3 has `%IX0.3`; it counts bytes.
pub(super) fn address(place: &Place<'_>) -> String {
    let address = place.address();
    match address.width {
        Width::Bit => format!("{}{}.{}", address.area, address.byte, address.bit),
        _ => address.to_string(),
    }
}
