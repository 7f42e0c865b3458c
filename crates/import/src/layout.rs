//! Assigns addresses in %I and %Q to tags that have none.

use super::rows::Tag;
use tickbus_base::Mistake;
use tickbus_image::signal::{AREA_LIMIT, Address, Area, Width};

/// Assigns an address to each tag without one: the widest first, bits last, so that no bytes are wasted.
///
/// # Errors
///
/// There is not enough room: what is wrong, and what would be right.
pub(super) fn lay(tags: &mut [Tag]) -> Result<(), Mistake> {
    // The next free bit of %I and %Q.
    let mut free = [0_usize; 2];
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
