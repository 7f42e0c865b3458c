//! Assigns addresses in %I and %Q to tags that have none.

use super::rows::Tag;
use tickbus_base::Mistake;
use tickbus_image::signal::{AREA_LIMIT, Address, Area, Width};

/// Removes the addresses of values wider than bits, in each area where addresses overlap: in the PLC each size has its
/// own memory. Returns true if there were any.
pub(super) fn part(tags: &mut [Tag]) -> bool {
    let mut is_parted = false;
    for area in [Area::Input, Area::Output] {
        let mut ranges: Vec<_> = tags
            .iter()
            .filter(|tag| tag.area == area)
            .filter_map(|tag| tag.address.map(Address::bits))
            .collect();
        ranges.sort_by_key(|range| range.start);
        if ranges.windows(2).all(|pair| pair[0].end <= pair[1].start) {
            continue;
        }
        is_parted = true;
        for tag in tags.iter_mut().filter(|tag| tag.area == area) {
            if let Some(address) = tag.address.filter(|address| address.width != Width::Bit) {
                tag.at = format!(
                    "{}{}{}",
                    area,
                    address.width.letter(),
                    address.byte / address.width.bytes()
                );
                tag.address = None;
            }
        }
    }
    is_parted
}

/// Assigns an address to each tag without one, after those that have one: the widest first, bits last, so that no bytes
/// are wasted.
///
/// # Errors
///
/// There is not enough room; the message has the remedy.
pub(super) fn lay(tags: &mut [Tag]) -> Result<(), Mistake> {
    // The next free bit of %I and %Q. Eight bytes are the widest value.
    let mut free = [Area::Input, Area::Output].map(|area| {
        let ends = tags.iter().filter(|tag| tag.area == area);
        let ends = ends.filter_map(|tag| Some(tag.address?.bits().end));
        ends.max().unwrap_or(0).next_multiple_of(64)
    });
    for width in [
        Width::Long,
        Width::Double,
        Width::Word,
        Width::Byte,
        Width::Bit,
    ] {
        for tag in tags.iter_mut().filter(|tag| tag.data_type.width() == width) {
            if tag.address.is_some() {
                continue;
            }
            let free = &mut free[usize::from(tag.area == Area::Output)];
            #[expect(clippy::cast_possible_truncation, reason = "below 8")]
            let bit = (*free % 8) as u8;
            tag.address = Some(Address {
                area: tag.area,
                width,
                byte: *free / 8,
                bit,
            });
            *free += width.bits();
            if *free > AREA_LIMIT * 8 {
                return Err(Mistake::new(
                    format!(
                        "the tags fill more than the {AREA_LIMIT} bytes of {}",
                        tag.area
                    ),
                    "split the list over several drivers",
                ));
            }
        }
    }
    Ok(())
}
