//! Variables: their place and width, and the CPU's return code for each of them.

use std::fmt;
use std::ops::Range;

/// Bytes of an item's address in a job's parameters.
pub const ADDRESS: usize = 12;

/// Bytes before an item's data: return code (0 in a job), unit of the length, length.
pub const DATA_HEADER: usize = 4;

/// The variable specification at the start of every item.
const SPECIFICATION: u8 = 0x12;
/// The syntax id of an address with area, byte and bit: the S7 "any" pointer.
const ANY: u8 = 0x10;

/// The units of a data length: see [`Element::counted`].
mod counted {
    pub(super) const BIT: u8 = 3;
    pub(super) const BYTE: u8 = 4;
    pub(super) const INT: u8 = 5;
    pub(super) const REAL: u8 = 7;
    pub(super) const OCTETS: u8 = 9;
}

/// An object in a CPU's memory, by the area code of an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Object {
    /// The inputs, `%I`.
    Inputs,
    /// The outputs, `%Q`.
    Outputs,
    /// The flags, `%M`.
    Flags,
    /// A data block, by its number.
    Block(u16),
}

impl Object {
    const fn code(self) -> (u8, u16) {
        match self {
            Self::Inputs => (0x81, 0),
            Self::Outputs => (0x82, 0),
            Self::Flags => (0x83, 0),
            Self::Block(number) => (0x84, number),
        }
    }
}

impl fmt::Display for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Inputs => f.write_str("%I"),
            Self::Outputs => f.write_str("%Q"),
            Self::Flags => f.write_str("%M"),
            Self::Block(number) => write!(f, "DB{number}"),
        }
    }
}

/// The type of an item's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Element {
    /// One bit.
    Bit,
    /// Bytes.
    Byte,
    /// Characters.
    Char,
    /// Words of 16 bits.
    Word,
    /// Signed words.
    Int,
    /// Words of 32 bits.
    DWord,
    /// Signed words of 32 bits.
    DInt,
    /// Floating-point numbers of 32 bits.
    Real,
    /// Dates and times, by their width in bytes.
    Time(u8),
}

impl Element {
    const fn of(code: u8) -> Option<Self> {
        Some(match code {
            0x01 => Self::Bit,
            0x02 => Self::Byte,
            0x03 => Self::Char,
            0x04 => Self::Word,
            0x05 => Self::Int,
            0x06 => Self::DWord,
            0x07 => Self::DInt,
            0x08 => Self::Real,
            // DATE and S5TIME; TIME_OF_DAY and TIME; DATE_AND_TIME.
            0x09 | 0x0C => Self::Time(2),
            0x0A | 0x0B => Self::Time(4),
            0x0F => Self::Time(8),
            _ => return None,
        })
    }

    /// Width of one element in bytes; a bit takes a byte on the wire.
    pub const fn width(self) -> usize {
        match self {
            Self::Bit | Self::Byte | Self::Char => 1,
            Self::Word | Self::Int => 2,
            Self::DWord | Self::DInt | Self::Real => 4,
            Self::Time(width) => width as usize,
        }
    }

    /// The unit of the length, and the length of `bytes` bytes in it.
    fn counted(self, bytes: usize) -> (u8, u16) {
        let count = |count: usize| u16::try_from(count).expect("a unit holds far fewer");
        match self {
            Self::Bit => (counted::BIT, count(bytes)),
            Self::Char => (counted::OCTETS, count(bytes)),
            Self::Real => (counted::REAL, count(bytes)),
            Self::Int | Self::DInt => (counted::INT, count(bytes * 8)),
            Self::Byte | Self::Word | Self::DWord | Self::Time(_) => {
                (counted::BYTE, count(bytes * 8))
            }
        }
    }
}

/// The return code of one item.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct ReturnCode(pub u8);

impl ReturnCode {
    /// Done.
    pub const OK: Self = Self(0xFF);
    /// The item must not be written, or not by this client.
    pub const ACCESS: Self = Self(0x03);
    /// The address is beyond the object, or invalid.
    pub const ADDRESS: Self = Self(0x05);
    /// The type does not exist.
    pub const TYPE: Self = Self(0x06);
    /// Data and address differ in type or length.
    pub const INCONSISTENT: Self = Self(0x07);
    /// The object does not exist.
    pub const MISSING: Self = Self(0x0A);

    /// The meaning of the code.
    pub const fn words(self) -> &'static str {
        match self.0 {
            0xFF => "done",
            0x01 => "hardware fault",
            0x03 => "access is not allowed",
            0x05 => "the address is out of range",
            0x06 => "the data type is not supported",
            0x07 => "data type and length do not go together",
            0x0A => "the object does not exist",
            _ => "no code that is known",
        }
    }
}

impl fmt::Debug for ReturnCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

impl fmt::Display for ReturnCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (code 0x{:02X})", self.words(), self.0)
    }
}

/// One variable, or several consecutive ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Item {
    /// The object that contains it.
    pub object: Object,
    /// The first byte in the object.
    pub byte: usize,
    /// The bit within that byte; 0 for whole bytes.
    pub bit: u8,
    /// The type of the elements.
    pub element: Element,
    /// The number of elements. Positive, and 1 for bits.
    pub count: u16,
}

impl Item {
    /// Bytes of an object.
    pub fn bytes(object: Object, range: Range<usize>) -> Self {
        Self {
            object,
            byte: range.start,
            bit: 0,
            element: Element::Byte,
            count: u16::try_from(range.len()).expect("a unit holds far fewer"),
        }
    }

    /// One bit of an object.
    pub const fn bit_of(object: Object, byte: usize, bit: u8) -> Self {
        Self {
            object,
            byte,
            bit,
            element: Element::Bit,
            count: 1,
        }
    }

    /// The bit number; `None` for bytes.
    pub fn bit(&self) -> Option<u8> {
        (self.element == Element::Bit).then_some(self.bit)
    }

    /// The bytes in the object.
    pub fn range(&self) -> Range<usize> {
        self.byte..self.byte + usize::from(self.count) * self.element.width()
    }

    fn read(specification: &[u8]) -> Result<Self, ReturnCode> {
        let [ANY, element, c0, c1, b0, b1, area, a0, a1, a2] = *specification else {
            return Err(ReturnCode::TYPE);
        };
        let object = match area {
            0x81 => Object::Inputs,
            0x82 => Object::Outputs,
            0x83 => Object::Flags,
            0x84 => Object::Block(u16::from_be_bytes([b0, b1])),
            _ => return Err(ReturnCode::MISSING),
        };
        let element = Element::of(element).ok_or(ReturnCode::TYPE)?;
        let count = u16::from_be_bytes([c0, c1]);
        let address = u32::from_be_bytes([0, a0, a1, a2]);
        let [.., bit] = (address % 8).to_be_bytes();
        match (element, count, bit) {
            (_, 0, _) => return Err(ReturnCode::ADDRESS),
            (Element::Bit, 1, _) => {}
            (Element::Bit, ..) => return Err(ReturnCode::TYPE),
            (_, _, 0) => {}
            _ => return Err(ReturnCode::ADDRESS),
        }
        Ok(Self {
            object,
            byte: (address / 8) as usize,
            bit,
            element,
            count,
        })
    }

    /// Appends the item's address.
    pub fn write(&self, out: &mut Vec<u8>) {
        let element = match self.element {
            Element::Bit => 0x01,
            Element::Char => 0x03,
            Element::Word => 0x04,
            Element::Int => 0x05,
            Element::DWord => 0x06,
            Element::DInt => 0x07,
            Element::Real => 0x08,
            Element::Byte | Element::Time(_) => 0x02,
        };
        let (area, block) = self.object.code();
        let address = u32::try_from(self.byte * 8 + usize::from(self.bit)).unwrap_or(u32::MAX);
        let [c0, c1] = self.count.to_be_bytes();
        let [b0, b1] = block.to_be_bytes();
        let [_, a0, a1, a2] = address.to_be_bytes();
        out.extend_from_slice(&[
            SPECIFICATION,
            0x0A,
            ANY,
            element,
            c0,
            c1,
            b0,
            b1,
            area,
            a0,
            a1,
            a2,
        ]);
    }
}

/// The addresses in a job's parameters, one after another.
#[derive(Clone, Debug)]
pub struct Addresses<'a>(&'a [u8]);

impl<'a> Addresses<'a> {
    /// The `count` addresses in `bytes`.
    pub fn new(count: u8, bytes: &'a [u8]) -> Option<Self> {
        let mut rest = bytes;
        for _ in 0..count {
            let [SPECIFICATION, length, after @ ..] = rest else {
                return None;
            };
            rest = after.get(usize::from(*length)..)?;
        }
        rest.is_empty().then_some(Self(bytes))
    }
}

impl Iterator for Addresses<'_> {
    type Item = Result<Item, ReturnCode>;

    fn next(&mut self) -> Option<Self::Item> {
        let [_, length, rest @ ..] = self.0 else {
            return None;
        };
        let (specification, rest) = rest.split_at(usize::from(*length));
        self.0 = rest;
        Some(Item::read(specification))
    }
}

/// The data of one item, and their return code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Datum<'a> {
    /// The return code; meaningless in a job that writes.
    pub code: ReturnCode,
    /// The item's data.
    pub bytes: &'a [u8],
}

/// The data of several items, each padded to an even offset; some peers pad the last one as well.
#[derive(Clone, Debug)]
pub struct Data<'a>(&'a [u8]);

impl<'a> Data<'a> {
    /// The data of `count` items.
    pub fn new(count: u8, bytes: &'a [u8]) -> Option<Self> {
        let mut all = Self(bytes);
        for _ in 0..count {
            all.next()?;
        }
        all.0.is_empty().then_some(Self(bytes))
    }
}

impl<'a> Iterator for Data<'a> {
    type Item = Datum<'a>;

    fn next(&mut self) -> Option<Datum<'a>> {
        let (header, rest) = self.0.split_first_chunk::<DATA_HEADER>()?;
        let [code, counted, high, low] = *header;
        let count = usize::from(u16::from_be_bytes([high, low]));
        let length = match counted {
            counted::BIT | counted::BYTE | counted::INT => count.div_ceil(8),
            _ => count,
        };
        let (bytes, rest) = rest.split_at_checked(length)?;
        self.0 = match rest {
            [_, after @ ..] if length % 2 == 1 => after,
            rest => rest,
        };
        Some(Datum {
            code: ReturnCode(code),
            bytes,
        })
    }
}

/// Appends the header for `bytes` bytes of an item's data.
pub fn write_header(code: ReturnCode, element: Element, bytes: usize, out: &mut Vec<u8>) {
    let (counted, count) = element.counted(bytes);
    let [high, low] = count.to_be_bytes();
    out.extend_from_slice(&[code.0, counted, high, low]);
}

/// Appends the data header of an item that cannot be read.
pub fn write_refusal(code: ReturnCode, out: &mut Vec<u8>) {
    out.extend_from_slice(&[code.0, 0, 0, 0]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hex;

    fn read(text: &str) -> Result<Item, ReturnCode> {
        let bytes = hex(text);
        let mut all = Addresses::new(1, &bytes).expect("well made");
        all.next().expect("there is one")
    }

    #[test]
    fn the_captured_addresses_are_read_and_written() {
        for (text, object, range) in [
            ("12 0a 10 02 0004 0001 84 000000", Object::Block(1), 0..4),
            ("12 0a 10 02 0002 0001 84 000010", Object::Block(1), 2..4),
        ] {
            let item = Item::bytes(object, range);
            assert_eq!(read(text), Ok(item));
            let mut out = Vec::new();
            item.write(&mut out);
            assert_eq!(out, hex(text));
        }
        let bit = read("12 0a 10 01 0001 0000 82 00000b").expect("a bit");
        assert_eq!(
            (bit.object, bit.range(), bit.bit),
            (Object::Outputs, 1..2, 3)
        );
    }

    #[test]
    fn what_an_address_cannot_be_has_its_code() {
        for (text, code) in [
            ("12 0a 10 02 0000 0001 84 000000", ReturnCode::ADDRESS),
            ("12 0a 10 02 0001 0001 84 000001", ReturnCode::ADDRESS),
            ("12 0a 10 01 0002 0001 84 000001", ReturnCode::TYPE),
            ("12 0a 10 01 0002 0001 84 000000", ReturnCode::TYPE),
            ("12 0a 10 44 0001 0001 84 000000", ReturnCode::TYPE),
            ("12 0a 10 02 0001 0000 1c 000000", ReturnCode::MISSING),
            ("12 0a b2 02 0001 0000 84 000000", ReturnCode::TYPE),
            ("12 00", ReturnCode::TYPE),
        ] {
            assert_eq!(read(text), Err(code), "{text}");
        }
    }

    #[test]
    fn lists_of_addresses_add_up_or_are_none() {
        let one = hex("12 0a 10 02 0004 0001 84 000000");
        let two = [&one[..], &one[..]].concat();
        assert_eq!(Addresses::new(2, &two).expect("two").count(), 2);
        for (count, bytes) in [
            (1, &two[..]),
            (3, &two[..]),
            (2, &two[..23]),
            (255, &one[..]),
        ] {
            assert!(Addresses::new(count, bytes).is_none());
        }
        assert!(Addresses::new(0, &[]).is_some());
    }

    #[test]
    fn odd_data_are_filled_up_between_items_and_need_not_be_at_the_end() {
        let bytes = hex("ff 04 0018 010203 00 0a 00 0000 ff 09 0001 07");
        let data: Vec<_> = Data::new(3, &bytes).expect("three").collect();
        assert_eq!(data[0].bytes, [1, 2, 3]);
        assert_eq!(data[1].code, ReturnCode::MISSING);
        assert_eq!(data[2].bytes, [7]);
        let filled = [&bytes[..], &[0]].concat();
        assert!(Data::new(3, &filled).is_some());
        let longer = [&filled[..], &[0]].concat();
        assert!(Data::new(3, &longer).is_none());
        for cut in 0..bytes.len() {
            assert!(Data::new(3, &bytes[..cut]).is_none(), "{cut}");
        }
    }

    #[test]
    fn data_are_counted_in_what_their_type_asks_for() {
        for (element, bytes, header) in [
            (Element::Bit, 1, "ff 03 0001"),
            (Element::Byte, 4, "ff 04 0020"),
            (Element::Char, 4, "ff 09 0004"),
            (Element::Word, 4, "ff 04 0020"),
            (Element::Int, 2, "ff 05 0010"),
            (Element::DInt, 4, "ff 05 0020"),
            (Element::Real, 8, "ff 07 0008"),
        ] {
            let mut out = Vec::new();
            write_header(ReturnCode::OK, element, bytes, &mut out);
            assert_eq!(out, hex(header), "{element:?}");
            out.resize(DATA_HEADER + bytes, 0);
            let mut data = Data::new(1, &out).expect("well made");
            assert_eq!(data.next().map(|datum| datum.bytes.len()), Some(bytes));
        }
    }
}
