//! Members of S7 structures with standard (non-optimised) access, arranged so that each signal gets its own
//! offset.
//!
//! The rules of that layout: consecutive BOOLs fill the bits of a byte; a value of one byte starts at any
//! byte; wider values and arrays start at an even byte; structures and arrays end at an even byte.

use super::Cpu;
use crate::record::{PlacedSignal, Record};
use crate::siemens::spelling;
use tickbus_image::signal::{ByteOrder, DataType, Width};

/// One member.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Member {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// The member's first byte and bit, from the start of the structure.
    pub(super) byte: usize,
    pub(super) bit: u8,
    /// The member's comment.
    pub(super) remark: String,
}

/// The contents of a member.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A value of an elementary type.
    Value(DataType),
    /// An even number of unused bytes.
    Bytes(usize),
}

/// Returns true if a single member of the signal's own type can hold the value: the CPU has the type, the byte order is
/// that of S7, and S7 would put such a value at this place. Other values are arrays of bytes.
fn is_native(place: &PlacedSignal<'_>, cpu: Cpu) -> bool {
    place.size() == 1
        || (place.signal.order == ByteOrder::Abcd
            && place.byte.is_multiple_of(2)
            && (cpu.has_long() || place.data_type().width() != Width::Long))
}

/// How to access a signal's value in the structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Path {
    /// One member of its own type.
    Value(String),
    /// One member per byte, in bus order.
    Bytes(Vec<String>),
}

impl Path {
    /// The members of `place`.
    pub(super) fn of(place: &PlacedSignal<'_>, cpu: Cpu) -> Self {
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

    /// The members' names.
    pub(super) fn members(&self) -> &[String] {
        match self {
            Self::Value(name) => std::slice::from_ref(name),
            Self::Bytes(names) => names,
        }
    }
}

/// The list of members while it is built.
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

    fn put(&mut self, place: &PlacedSignal<'_>, cpu: Cpu) {
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

    /// Inserts reserve bytes up to bit `to`.
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

    /// All members, with reserve bytes up to `bytes`.
    fn finish(mut self, bytes: usize) -> Vec<Member> {
        self.fill(self.at.next_multiple_of(8));
        self.fill(bytes * 8);
        self.list
    }
}
