//! Values as SIL Kit's own serialiser (`silkit/util/serdes`) writes a single number: little endian, without a name or a
//! type.

use tickbus_image::signal::DataType;

/// The media type of such data.
pub(super) const MEDIA_TYPE: &str = "application/vnd.vector.silkit.data; protocolVersion=1";

/// The bytes of the largest number.
pub(super) const LONGEST: usize = 8;

/// The bytes of a variable in a message; a BOOL has one.
pub(super) const fn size(data_type: DataType) -> usize {
    data_type.size_bytes()
}

/// The bytes of a raw slot; the first [`size`] of them are the message.
pub(super) const fn bytes(raw: u64) -> [u8; LONGEST] {
    raw.to_le_bytes()
}

/// The raw slot of a message, `None` if it has another size.
pub(super) fn raw(data_type: DataType, message: &[u8]) -> Option<u64> {
    if message.len() != size(data_type) {
        return None;
    }
    let is_negative = data_type.is_signed() && message.last().is_some_and(|last| last & 0x80 != 0);
    let mut bytes = [if is_negative { 0xFF } else { 0 }; LONGEST];
    bytes[..message.len()].copy_from_slice(message);
    let raw = u64::from_le_bytes(bytes);
    // As SIL Kit's own deserialiser has it.
    Some(match data_type {
        DataType::Bool => (raw != 0).into(),
        _ => raw,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_the_bytes_of_the_serialiser_both_ways() {
        for (data_type, value, message) in [
            (DataType::Bool, 1, &[1][..]),
            (DataType::Usint, 200, &[200]),
            (DataType::Int, (-2_i64).cast_unsigned(), &[0xFE, 0xFF]),
            (DataType::Dint, 258, &[2, 1, 0, 0]),
            (DataType::Ulint, u64::MAX, &[0xFF; 8]),
            (
                DataType::Real,
                u64::from(1.5_f32.to_bits()),
                &[0, 0, 0xC0, 0x3F],
            ),
            (
                DataType::Lreal,
                25.5_f64.to_bits(),
                &[0, 0, 0, 0, 0, 0x80, 0x39, 0x40],
            ),
        ] {
            assert_eq!(&bytes(value)[..size(data_type)], message, "{data_type}");
            assert_eq!(raw(data_type, message), Some(value), "{data_type}");
            assert_eq!(raw(data_type, &[0; 9]), None, "{data_type}");
            assert_eq!(raw(data_type, &[]), None, "{data_type}");
        }
        assert_eq!(raw(DataType::Bool, &[7]), Some(1));
        // The sign of a REAL is one bit of it.
        let negative = (-1.0_f32).to_le_bytes();
        let expected = Some(u64::from((-1.0_f32).to_bits()));
        assert_eq!(raw(DataType::Real, &negative), expected);
    }
}
