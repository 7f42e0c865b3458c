//! `reserved`: elements of a device that exist and carry nothing.

use crate::TagAddress;
use crate::table::{Span, Table};
use tickbus_base::toml_text::{Key, Shape, Value};

/// The most ranges in `reserved`.
pub(crate) const RANGES: usize = 1000;

/// The keys of a range in `reserved`.
pub(crate) const RANGE_KEYS: &[Key] = &[
    Key::required("at", Shape::Text, "The first element, such as \"400021\""),
    Key::new("count", Shape::Whole(1, 0x1_0000), "How many elements").or("1"),
];

/// Reads the ranges of elements that exist and carry nothing.
pub(super) fn read_reserved(value: &Value<'_>) -> Option<Vec<(Table, Span)>> {
    const RIGHT: &str = "write a list such as [{ at = \"400021\", count = 10 }]";
    let list = value.list(RIGHT)?;
    if list.len() > RANGES {
        value.wrong(
            format!("it has {} ranges", list.len()),
            format!("write at most {RANGES}"),
        );
        return None;
    }
    let read = list.iter().map(|element| {
        let mut keys = element.table("a range of elements", RIGHT)?;
        let at = keys.require("at", RIGHT);
        let count = keys.take("count");
        keys.finish();
        let at = at?;
        let place: TagAddress = (at.text("write an address such as \"400021\"")?.parse())
            .map_err(|mistake| at.refuse(mistake))
            .ok()?;
        if place.bit.is_some() || place.data_type.is_some() {
            at.wrong(
                "it names more than an element",
                "leave out the bit and the type: whole elements are reserved",
            );
            return None;
        }
        let most = 0x1_0000 - place.place.offset;
        let count = match count {
            Some(count) => count.whole(1..=i128::try_from(most).ok()?)?,
            None => 1,
        };
        let span = Span {
            first: place.place.offset,
            count: usize::try_from(count).ok()?,
        };
        Some((place.place.table, span))
    });
    // All mistakes are reported, not only the first.
    read.collect::<Vec<_>>().into_iter().collect()
}
