//! Members of S7 structures with standard (non-optimised) access, laid so that each signal gets its own offset.
//!
//! The rules of that layout: BOOLs fill the bits of a byte one after another; a value of one byte begins on a byte;
//! wider ones and arrays on an even byte; structures and arrays end on an even byte.

use super::Cpu;
use crate::record::{Place, Record};
use crate::siemens::spelling;
use tickbus_image::signal::{ByteOrder, DataType, Width};

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
}

/// Whether a member of the signal's own type holds its value: of a type that the CPU has, in the byte order of S7, and
/// where S7 puts such a value. The others lie there as bytes.
fn is_native(place: &Place<'_>, cpu: Cpu) -> bool {
    place.size() == 1
        || (place.signal.order == ByteOrder::Abcd
            && place.byte.is_multiple_of(2)
            && (cpu.has_long() || place.data_type().width() != Width::Long))
}

/// Where a signal's value is in the structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Path {
    /// One member of its own type.
    Value(String),
    /// A member for each byte, the first byte of the bus first.
    Bytes(Vec<String>),
}

impl Path {
    /// Where the value of `place` is.
    pub(super) fn of(place: &Place<'_>, cpu: Cpu) -> Self {
        let name = &place.name;
        if is_native(place, cpu) {
            return Self::Value(name.clone());
        }
        Self::Bytes(
            (0..place.size())
                .map(|number| format!("{name}__{number}"))
                .collect(),
        )
    }

    /// Its members.
    pub(super) fn members(&self) -> &[String] {
        match self {
            Self::Value(name) => std::slice::from_ref(name),
            Self::Bytes(names) => names,
        }
    }
}

/// Members in the making.
#[derive(Debug, Default)]
pub(super) struct Members {
    list: Vec<Member>,
    /// The next free bit.
    at: usize,
}

impl Members {
    /// The members of a record.
    pub(super) fn of(record: &Record<'_>, cpu: Cpu) -> Vec<Member> {
        let mut members = Self::default();
        for place in &record.places {
            members.put(place, cpu);
        }
        members.finish(record.bytes)
    }

    fn put(&mut self, place: &Place<'_>, cpu: Cpu) {
        self.fill(place.byte * 8 + usize::from(place.bit()));
        let path = Path::of(place, cpu);
        let (kind, mut remark) = match &path {
            Path::Value(_) => (place.data_type(), place.remark()),
            Path::Bytes(_) => {
                let whole = spelling(place.data_type());
                (
                    DataType::Byte,
                    format!("{}, {whole} as bytes", place.remark()),
                )
            }
        };
        for name in path.members() {
            self.push(
                name.clone(),
                Kind::Value(kind),
                kind.width().bits(),
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
