//! Siemens' notation of addresses and types.

use super::record::PlacedSignal;
use tickbus_image::signal::{DataType, Width};

/// A type as TIA Portal writes it.
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

/// An address in Siemens' notation, `%I0.3` for `%IX0.3` of IEC 61131-3; the number counts bytes.
pub(super) fn address(place: &PlacedSignal<'_>) -> String {
    let address = place.address();
    match address.width {
        Width::Bit => format!("{}{}.{}", address.area, address.byte, address.bit),
        _ => address.to_string(),
    }
}
