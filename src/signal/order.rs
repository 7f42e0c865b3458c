//! Byte orders of multi-byte values.

/// How the bytes of a multi-byte value lie in the image; `A` is the most significant byte.
///
/// For 64-bit values the letters name 16-bit words in the same manner, as Modbus gateways do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ByteOrder {
    /// Big-endian, as Siemens and most fieldbuses send.
    #[default]
    Abcd,
    /// Words swapped: the least significant 16-bit word first, each word big-endian.
    Cdab,
    /// Bytes swapped within each 16-bit word, words in order.
    Badc,
    /// Little-endian.
    Dcba,
}
