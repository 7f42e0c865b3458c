//! Elementary data types of IEC 61131-3.

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
