//! Shrinks a world that broke a promise.

use crate::broken::Broken;
use crate::plan::Plan;
use crate::seed::Seed;

impl Seed {
    /// The smallest world found that breaks the same promise. Features and misfortunes are left out one by one, as long
    /// as the promise stays broken.
    #[must_use]
    pub fn shrunk(self, promise: &str) -> Self {
        self.smallest(|seed| {
            Plan::draw(seed)
                .run()
                .is_err_and(|Broken { promise: other, .. }| other == promise)
        })
    }

    /// The smallest seed found that is still broken.
    pub(crate) fn smallest(self, is_broken: impl Fn(Self) -> bool) -> Self {
        let mut smallest = self;
        for bit in 0..u64::BITS {
            let fewer = Self {
                features: smallest.features & !(1 << bit),
                ..smallest
            };
            if is_broken(fewer) {
                smallest = fewer;
            }
        }
        for bit in 0..u32::BITS {
            let fewer = Self {
                more: smallest.more & !(1 << bit),
                ..smallest
            };
            if is_broken(fewer) {
                smallest = fewer;
            }
        }
        for bit in 0..u8::BITS {
            let fewer = Self {
                events: smallest.events & !(1 << bit),
                ..smallest
            };
            if is_broken(fewer) {
                smallest = fewer;
            }
        }
        smallest
    }
}
