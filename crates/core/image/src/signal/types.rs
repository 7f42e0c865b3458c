//! Elementary data types of IEC 61131-3.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use super::address::Width;

/// An elementary data type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DataType {
    /// One bit.
    Bool,
    /// 8 bits, as an unsigned number.
    Byte,
    /// 8-bit signed integer.
    Sint,
    /// 8-bit unsigned integer.
    Usint,
    /// 16 bits, as an unsigned number.
    Word,
    /// 16-bit signed integer.
    Int,
    /// 16-bit unsigned integer.
    Uint,
    /// 32 bits, as an unsigned number.
    Dword,
    /// 32-bit signed integer.
    Dint,
    /// 32-bit unsigned integer.
    Udint,
    /// 32-bit IEEE 754 number.
    Real,
    /// 64 bits, as an unsigned number.
    Lword,
    /// 64-bit signed integer.
    Lint,
    /// 64-bit unsigned integer.
    Ulint,
    /// 64-bit IEEE 754 number.
    Lreal,
}

impl DataType {
    /// All types, smallest first.
    pub const ALL: [Self; 15] = [
        Self::Bool,
        Self::Byte,
        Self::Sint,
        Self::Usint,
        Self::Word,
        Self::Int,
        Self::Uint,
        Self::Dword,
        Self::Dint,
        Self::Udint,
        Self::Real,
        Self::Lword,
        Self::Lint,
        Self::Ulint,
        Self::Lreal,
    ];

    /// The name in the standard: `BOOL` to `LREAL`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "BOOL",
            Self::Byte => "BYTE",
            Self::Sint => "SINT",
            Self::Usint => "USINT",
            Self::Word => "WORD",
            Self::Int => "INT",
            Self::Uint => "UINT",
            Self::Dword => "DWORD",
            Self::Dint => "DINT",
            Self::Udint => "UDINT",
            Self::Real => "REAL",
            Self::Lword => "LWORD",
            Self::Lint => "LINT",
            Self::Ulint => "ULINT",
            Self::Lreal => "LREAL",
        }
    }

    /// The width of addresses for this type.
    pub const fn width(self) -> Width {
        match self {
            Self::Bool => Width::Bit,
            Self::Byte | Self::Sint | Self::Usint => Width::Byte,
            Self::Word | Self::Int | Self::Uint => Width::Word,
            Self::Dword | Self::Dint | Self::Udint | Self::Real => Width::Double,
            Self::Lword | Self::Lint | Self::Ulint | Self::Lreal => Width::Long,
        }
    }

    /// The size in bytes: 1, 2, 4 or 8; a BOOL occupies a bit of one byte.
    pub const fn size_bytes(self) -> usize {
        self.width().bytes()
    }

    /// True for an integer or a bit string of more than one bit: every type except BOOL, REAL and LREAL.
    pub const fn is_integer(self) -> bool {
        !matches!(self, Self::Bool | Self::Real | Self::Lreal)
    }

    /// True for a signed integer.
    pub const fn is_signed(self) -> bool {
        matches!(self, Self::Sint | Self::Int | Self::Dint | Self::Lint)
    }

    /// Smallest and largest raw value, bit strings as unsigned numbers, BOOL as 0 and 1; `None` for
    /// REAL and LREAL.
    pub const fn range(self) -> Option<RangeInclusive<i128>> {
        if matches!(self, Self::Real | Self::Lreal) {
            return None;
        }
        let bits = self.width().bits();
        Some(if self.is_signed() {
            -(1 << (bits - 1))..=(1 << (bits - 1)) - 1
        } else {
            0..=(1 << bits) - 1
        })
    }
}

impl Width {
    /// The default type of a signal at such an address: BOOL, BYTE, WORD, DWORD or LWORD.
    pub const fn data_type(self) -> DataType {
        match self {
            Self::Bit => DataType::Bool,
            Self::Byte => DataType::Byte,
            Self::Word => DataType::Word,
            Self::Double => DataType::Dword,
            Self::Long => DataType::Lword,
        }
    }
}

impl fmt::Display for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The text does not name an elementary data type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "not an elementary data type; types are BOOL, BYTE, SINT, USINT, WORD, INT, UINT, DWORD, DINT, UDINT, REAL, LWORD, LINT, ULINT, LREAL"
)]
pub struct UnknownType;

/// Reads a name of the standard, in upper or lower case.
impl FromStr for DataType {
    type Err = UnknownType;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|data_type| data_type.name().eq_ignore_ascii_case(text))
            .ok_or(UnknownType)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_in_any_case() {
        for data_type in DataType::ALL {
            assert_eq!(data_type.to_string().parse(), Ok(data_type));
            assert_eq!(data_type.name().to_lowercase().parse(), Ok(data_type));
        }
        assert_eq!("FLOAT".parse::<DataType>(), Err(UnknownType));
    }

    #[test]
    fn ranges_are_those_of_the_machine_types() {
        let range = |min: i128, max: i128| Some(min..=max);
        assert_eq!(DataType::Bool.range(), range(0, 1));
        assert_eq!(DataType::Byte.range(), range(0, u8::MAX.into()));
        assert_eq!(
            DataType::Sint.range(),
            range(i8::MIN.into(), i8::MAX.into())
        );
        assert_eq!(
            DataType::Int.range(),
            range(i16::MIN.into(), i16::MAX.into())
        );
        assert_eq!(DataType::Uint.range(), range(0, u16::MAX.into()));
        assert_eq!(
            DataType::Dint.range(),
            range(i32::MIN.into(), i32::MAX.into())
        );
        assert_eq!(
            DataType::Lint.range(),
            range(i64::MIN.into(), i64::MAX.into())
        );
        assert_eq!(DataType::Lword.range(), range(0, u64::MAX.into()));
        assert_eq!(DataType::Real.range(), None);
        assert_eq!(DataType::Lreal.range(), None);
    }

    #[test]
    fn every_type_fits_the_address_that_implies_it() {
        for data_type in DataType::ALL {
            assert_eq!(
                data_type.width().data_type().size_bytes(),
                data_type.size_bytes()
            );
        }
    }
}
