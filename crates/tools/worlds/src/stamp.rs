//! Values that show who wrote them, and in which tick.

use crate::random::scramble;

/// The contents of a stamp: the writer's life, its area and station, and its tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stamp {
    pub(crate) life: u64,
    pub(crate) area: u64,
    pub(crate) station: u64,
    pub(crate) tick: u64,
}

impl Stamp {
    pub(crate) fn number(self) -> u64 {
        self.life << 48 | self.area << 44 | self.station << 40 | self.tick
    }

    pub(crate) fn of(number: u64) -> Self {
        Self {
            life: number >> 48,
            area: number >> 44 & 0xF,
            station: number >> 40 & 0xF,
            tick: number & 0xFF_FFFF_FFFF,
        }
    }
}

/// The values beside a stamp, which follow from it.
pub(crate) fn level(stamp: u64) -> bool {
    scramble(stamp) & 1 == 1
}

pub(crate) fn whole(stamp: u64) -> i16 {
    let [one, other, ..] = scramble(stamp).to_be_bytes();
    i16::from_be_bytes([one, other])
}

/// A multiple of one half, so that it passes the scale and 32 bits unchanged.
pub(crate) fn real(stamp: u64) -> f64 {
    let [_, _, one, other, ..] = scramble(stamp).to_be_bytes();
    f64::from(i16::from_be_bytes([one, other])) / 2.0
}
