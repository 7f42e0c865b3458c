//! Members of S7 structures with standard (non-optimised) access, laid so that each signal gets its own offset.
//!
//! The rules of that layout: BOOLs fill the bits of a byte one after another; a value of one byte begins on a byte;
//! wider ones, arrays and structures on an even byte; structures and arrays end on an even byte.

use crate::export::record::{Group, Place, Record};
use crate::export::siemens::spelling;
use crate::signal::{ByteOrder, DataType};

/// One member.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Member {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// Its first byte and bit, counted from the start of the structure.
    pub(super) byte: usize,
    pub(super) bit: u8,
    /// What is to be known about it.
    pub(super) remark: String,
}

/// What a member is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A value of an elementary type.
    Value(DataType),
    /// Nobody's bytes, of which there is an even number.
    Bytes(usize),
    /// A structure of its own.
    Structure(String),
}

/// Whether a member of the signal's own type holds its value: in the byte order of S7, and where S7 puts such a
/// value. The others lie there as bytes.
pub(super) fn is_native(place: &Place<'_>, byte: usize) -> bool {
    place.size() == 1 || (place.signal.order == ByteOrder::Abcd && byte.is_multiple_of(2))
}

/// The names of the bytes as which a value that is not native lies there.
pub(super) fn byte_names(name: &str, size: usize) -> Vec<String> {
    (0..size)
        .map(|number| format!("{name}__{number}"))
        .collect()
}

/// Members in the making.
#[derive(Debug, Default)]
pub(super) struct Members {
    list: Vec<Member>,
    /// The next free bit.
    at: usize,
}

impl Members {
    /// The members of one structure.
    pub(super) fn of_group(group: &Group<'_, '_>) -> Vec<Member> {
        let mut members = Self::default();
        for (place, name) in group.places.iter().zip(group.members()) {
            members.put(place, &name, place.byte - group.byte, String::new());
        }
        members.finish(group.bytes)
    }

    /// The members of a record whose `groups` are structures of the types that `types` names.
    pub(super) fn of_record(
        record: &Record<'_>,
        groups: &[Group<'_, '_>],
        types: &[String],
        group_names: &[String],
    ) -> Vec<Member> {
        let mut members = Self::default();
        let mut places = record.places.iter().peekable();
        let mut groups = groups.iter().zip(types).zip(group_names).peekable();
        while let Some(place) = places.peek() {
            if let Some(((group, type_name), name)) =
                groups.next_if(|((group, _), _)| group.byte == place.byte)
            {
                members.fill(group.byte * 8);
                let first = &group.places[0];
                members.push(
                    name.clone(),
                    Kind::Structure(type_name.clone()),
                    group.bytes * 8,
                    format!("{} on: \"{}\"", first.address(), group.name),
                );
                for _ in 0..group.places.len() {
                    places.next();
                }
            } else if let Some(place) = places.next() {
                members.put(place, &place.name, place.byte, place.remark());
            }
        }
        members.finish(record.bytes)
    }

    fn put(&mut self, place: &Place<'_>, name: &str, byte: usize, remark: String) {
        if is_native(place, byte) {
            self.fill(byte * 8 + usize::from(place.bit()));
            let bits = place.data_type().width().bits();
            self.push(
                name.to_owned(),
                Kind::Value(place.data_type()),
                bits,
                remark,
            );
            return;
        }
        self.fill(byte * 8);
        let mut remark = format!("{remark}, {} as bytes", spelling(place.data_type()));
        for name in byte_names(name, place.size()) {
            self.push(
                name,
                Kind::Value(DataType::Byte),
                8,
                std::mem::take(&mut remark),
            );
        }
    }

    fn push(&mut self, name: String, kind: Kind, bits: usize, remark: String) {
        let (byte, bit) = (self.at / 8, self.at % 8);
        #[expect(clippy::cast_possible_truncation, reason = "below 8")]
        let bit = bit as u8;
        self.list.push(Member {
            name,
            kind,
            byte,
            bit,
            remark,
        });
        self.at += bits;
    }

    /// Reserves what lies before bit `to`.
    fn fill(&mut self, to: usize) {
        while self.at < to {
            let (byte, bit) = (self.at / 8, self.at % 8);
            let whole = (to - self.at) / 8;
            if bit != 0 || whole == 0 {
                let name = format!("_reserve_{byte}_{bit}");
                self.push(name, Kind::Value(DataType::Bool), 1, String::new());
            } else if whole == 1 || byte % 2 == 1 {
                let name = format!("_reserve_{byte}");
                self.push(name, Kind::Value(DataType::Byte), 8, String::new());
            } else {
                let name = format!("_reserve_{byte}");
                let bytes = whole & !1;
                self.push(name, Kind::Bytes(bytes), bytes * 8, String::new());
            }
        }
    }

    /// All members, with the reserve up to the end of the `bytes`.
    fn finish(mut self, bytes: usize) -> Vec<Member> {
        self.fill(self.at.next_multiple_of(8));
        self.fill(bytes * 8);
        self.list
    }
}
