//! The place of a whole area of the image: `inputs` and `outputs` of a driver.cfg.

use crate::element_address::SHAPE;
use crate::table::{ADDRESSES, Span, Table};
use crate::{ElementAddress, Piece};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Key, Shape, Value};
use tickbus_image::signal::{Area, Signal};

/// The most parts that an area may have.
pub(crate) const PARTS: usize = 100;

/// The most bytes of a part.
const PART_BYTES: i128 = 0x1_0000;

/// The keys of a part.
pub(crate) const PART_KEYS: &[Key] = &[
    Key::required("at", Shape::Text, "The first element, such as \"coil:1\""),
    Key::new(
        "bytes",
        Shape::Whole(1, PART_BYTES),
        "How many bytes of the image lie there; all that are left in the last part",
    ),
];

/// The place of an area of the image in the tables of a unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AreaMapping {
    /// Consecutive parts of the area, from its first byte on.
    parts: Vec<Part>,
    /// The offset of the key in the driver.cfg.
    pub(super) at: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Part {
    place: ElementAddress,
    /// The number of bytes; `None` for all remaining ones.
    bytes: Option<usize>,
}

/// Consecutive bytes of an image in one table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// The table.
    pub table: Table,
    /// The wire offset of the first element.
    pub first: usize,
    /// The first byte of the image.
    pub byte: usize,
    /// The number of bytes. If it is odd, the last register carries only one byte, in its high half.
    pub bytes: usize,
}

impl Block {
    /// The elements that hold the bytes.
    pub fn span(self) -> Span {
        Span {
            first: self.first,
            count: self.table.elements(self.bytes),
        }
    }
}

impl Piece {
    /// The part of `signal` in `block`, for an area placed as a whole.
    pub(super) fn of_block(signal: &Signal, block: &Block) -> Option<Self> {
        let bits = signal.address().bits();
        let begin = bits.start.max(block.byte * 8);
        let end = bits.end.min((block.byte + block.bytes) * 8);
        (begin < end).then(|| Self {
            table: block.table,
            wire: block.first * block.table.width() + begin - block.byte * 8,
            bit: begin,
            bits: end - begin,
            fills: true,
        })
    }
}

impl AreaMapping {
    /// Reads `value`; without one the whole area is at `default`. `writes` says that this end writes the
    /// area, and `at` is the offset of the bus's table.
    pub(super) fn read(
        value: Option<&Value<'_>>,
        at: usize,
        default: ElementAddress,
        writes: bool,
    ) -> Option<Self> {
        let Some(value) = value else {
            let parts = vec![Part {
                place: default,
                bytes: None,
            }];
            return Some(Self { parts, at });
        };
        let at = value.at();
        if value.as_text().is_some() {
            let place = read_place(value, default.table, writes)?;
            let parts = vec![Part { place, bytes: None }];
            return Some(Self { parts, at });
        }
        let right = format!(
            "{SHAPE}; or a list such as [{{ at = \"coil:1\", bytes = 2 }}, {{ at = \"offset:0\" }}]"
        );
        let list = value.list(&right)?;
        if list.is_empty() || list.len() > PARTS {
            value.wrong(
                format!("it has {} parts", list.len()),
                format!("write 1 to {PARTS}"),
            );
            return None;
        }
        let count = list.len();
        let parts: Vec<Option<Part>> = list
            .iter()
            .enumerate()
            .map(|(number, element)| {
                let mut table = element.table("a part of the image", &right)?;
                let place = table.require("at", SHAPE);
                let bytes = if number + 1 < count {
                    table.require("bytes", "write how many bytes of the image lie there")
                } else {
                    table.take("bytes")
                };
                table.finish();
                let place = place.and_then(|value| read_place(&value, default.table, writes));
                let bytes = match bytes {
                    None => None,
                    Some(value) => {
                        let bytes = value.whole(1..=PART_BYTES)?;
                        Some(usize::try_from(bytes).ok()?)
                    }
                };
                Some(Part {
                    place: place?,
                    bytes,
                })
            })
            .collect();
        let parts = parts.into_iter().collect::<Option<Vec<Part>>>()?;
        Some(Self { parts, at })
    }

    /// The first elements of the parts.
    pub(super) fn places(&self) -> impl Iterator<Item = ElementAddress> {
        self.parts.iter().map(|part| part.place)
    }

    /// The blocks of `area`, which has `bytes` bytes.
    ///
    /// # Errors
    ///
    /// The area does not fit; the message has the remedy.
    pub(super) fn blocks(&self, area: Area, bytes: usize) -> Result<Vec<Block>, Mistake> {
        let mut blocks = Vec::new();
        let mut byte = 0;
        for (number, part) in self.parts.iter().enumerate() {
            let left = bytes - byte;
            let is_last = number + 1 == self.parts.len();
            let size = part.bytes.unwrap_or(left);
            if size > left || (is_last && size < left) {
                let all: usize = self.parts.iter().filter_map(|part| part.bytes).sum();
                return Err(Mistake::new(
                    format!("the parts of {area} have {all} bytes, but {area} has {bytes}"),
                    "let \"bytes\" out of the last part, which then has all that are left, or change the \
                     size of the image",
                ));
            }
            let block = Block {
                table: part.place.table,
                first: part.place.offset,
                byte,
                bytes: size,
            };
            if block.span().end() > ADDRESSES {
                return Err(Mistake::new(
                    format!(
                        "{area} would lie at {} {} from {} on, and end at offset {}",
                        block.span().count,
                        block.table,
                        part.place,
                        block.span().end() - 1
                    ),
                    "begin further to the front; the last offset is 65535",
                ));
            }
            byte += size;
            if size > 0 {
                blocks.push(block);
            }
        }
        Ok(blocks)
    }

    /// Checks that the blocks of `area`, which this end writes, do not overlap.
    ///
    /// # Errors
    ///
    /// Two blocks overlap; the message has the remedy.
    pub(super) fn check_apart(area: Area, blocks: &[Block]) -> Result<(), Mistake> {
        for (index, block) in blocks.iter().enumerate() {
            let other = blocks[..index].iter().find(|other| {
                let (own, others) = (block.span(), other.span());
                other.table == block.table && own.first < others.end() && others.first < own.end()
            });
            let Some(other) = other else {
                continue;
            };
            let place = |block: &Block| ElementAddress {
                table: block.table,
                offset: block.first,
            };
            return Err(Mistake::new(
                format!(
                    "the parts of {area} at {} and at {} would be written over one another: the first has {} {}, the \
                     second {}",
                    place(other),
                    place(block),
                    other.span().count,
                    block.table,
                    block.span().count
                ),
                "begin the second one behind the first; a register has 2 bytes of the image, a coil 1 bit",
            ));
        }
        Ok(())
    }
}

fn read_place(value: &Value<'_>, table: Table, writes: bool) -> Option<ElementAddress> {
    let place = ElementAddress::parse(value.text(SHAPE)?, table)
        .map_err(|mistake| value.refuse(mistake))
        .ok()?;
    if writes && !place.table.is_writable() {
        value.refuse(nobody_writes(place.table));
        return None;
    }
    Some(place)
}

/// The error for writing to a read-only table, with the remedy.
pub(super) fn nobody_writes(table: Table) -> Mistake {
    Mistake::new(
        format!("nobody can write {table}"),
        "this end writes them: choose holding registers or coils, or check \"role\"",
    )
}
