//! Numbers: how one slot becomes one word and back.

use std::fmt::Debug;
use std::marker::PhantomData;

use super::Conversions;
use super::word::Word;
use crate::signal::{Scale, Slot};

/// The conversion between a slot and a word of one type, scaled or not.
///
/// Encoding has a fast and a slow path. [`Codec::raw`], [`Codec::fits`] and [`Codec::word`] have no branches,
/// so that loops over them are vectorised; [`Codec::bend`] handles a value that does not fit.
pub(super) trait Codec: Debug + Send + Sync + 'static {
    /// The type on the wire.
    type Word: Word;
    /// The number between slot and word: unscaled, not yet rounded.
    type Raw: Copy;
    /// The codec's form of a signal's scale.
    type Scale: Copy + Debug + Send + Sync + 'static;

    /// Converts a signal's scale to that form.
    fn scale(scale: Option<Scale>) -> Self::Scale;

    /// The raw number of `slot`.
    fn raw(slot: Slot, scale: Self::Scale) -> Self::Raw;

    /// True if `raw` can be encoded unchanged.
    fn fits(raw: Self::Raw) -> bool;

    /// The word of a raw number that fits.
    fn word(raw: Self::Raw) -> Self::Word;

    /// The word of a slot whose raw number does not fit: saturated, or `fail_safe` for NaN; counted.
    fn bend(
        slot: Slot,
        scale: Self::Scale,
        fail_safe: Self::Word,
        conversions: &mut Conversions,
    ) -> Self::Word;

    /// The slot for `word`.
    fn decode(word: Self::Word, scale: Self::Scale) -> Slot;

    /// The word of `slot`, whether its value fits or not.
    fn encode(
        slot: Slot,
        scale: Self::Scale,
        fail_safe: Self::Word,
        conversions: &mut Conversions,
    ) -> Self::Word {
        let raw = Self::raw(slot, scale);
        if Self::fits(raw) {
            Self::word(raw)
        } else {
            Self::bend(slot, scale, fail_safe, conversions)
        }
    }

    /// The word of a signal's fail-safe value; zero if that is NaN.
    fn fail_safe(slot: Slot, scale: Self::Scale) -> Self::Word {
        let zero = Self::word(Self::raw(Slot::from_real(0.0), Self::scale(None)));
        Self::encode(slot, scale, zero, &mut Conversions::default())
    }
}

/// Slots that hold a 64-bit integer: unscaled LWORD, LINT and ULINT.
#[derive(Debug)]
pub(super) struct Integer64;

impl Codec for Integer64 {
    type Word = u64;
    type Raw = u64;
    type Scale = Unscaled;

    fn scale(_: Option<Scale>) -> Unscaled {
        Unscaled
    }

    fn raw(slot: Slot, _: Unscaled) -> u64 {
        slot.0
    }

    fn fits(_: u64) -> bool {
        true
    }

    fn word(raw: u64) -> u64 {
        raw
    }

    fn bend(slot: Slot, _: Unscaled, _: u64, _: &mut Conversions) -> u64 {
        slot.0
    }

    fn decode(word: u64, _: Unscaled) -> Slot {
        Slot(word)
    }
}

/// Slots that hold a double, words that hold the number `N`, and the scaling `S` between them.
#[derive(Debug)]
pub(super) struct Real<N, S>(PhantomData<(N, S)>);

impl<N: Number, S: Scaling> Codec for Real<N, S> {
    type Word = N::Word;
    type Raw = f64;
    type Scale = S;

    fn scale(scale: Option<Scale>) -> S {
        S::of(scale)
    }

    fn raw(slot: Slot, scale: S) -> f64 {
        scale.raw(slot.real())
    }

    fn fits(raw: f64) -> bool {
        N::fits(raw)
    }

    fn word(raw: f64) -> N::Word {
        N::to_word(raw)
    }

    #[cold]
    fn bend(slot: Slot, scale: S, fail_safe: N::Word, conversions: &mut Conversions) -> N::Word {
        let raw = Self::raw(slot, scale);
        if raw.is_nan() {
            conversions.not_a_number += 1;
            fail_safe
        } else if N::HAS_INFINITY && slot.real().is_infinite() {
            N::to_word(raw)
        } else {
            conversions.saturated += 1;
            N::to_word(raw.clamp(N::LOWEST, N::HIGHEST))
        }
    }

    fn decode(word: N::Word, scale: S) -> Slot {
        Slot::from_real(scale.value(N::from_word(word)))
    }
}

/// The conversion between engineering units and raw numbers.
pub(super) trait Scaling: Copy + Debug + Send + Sync + 'static {
    /// From a signal's scale, which is present exactly if the scaling needs it.
    fn of(scale: Option<Scale>) -> Self;

    /// Engineering units to raw, not yet rounded.
    fn raw(self, value: f64) -> f64;

    /// Raw to engineering units.
    fn value(self, raw: f64) -> f64;
}

/// The raw number is the value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unscaled;

impl Scaling for Unscaled {
    fn of(_: Option<Scale>) -> Self {
        Self
    }

    fn raw(self, value: f64) -> f64 {
        value
    }

    fn value(self, raw: f64) -> f64 {
        raw
    }
}

impl Scaling for Scale {
    fn of(scale: Option<Scale>) -> Self {
        scale.unwrap_or(Self {
            gain: 1.0,
            offset: 0.0,
        })
    }

    // A division rather than a multiplication by the reciprocal: it inverts `value` to within a few units in
    // the last place, so every raw number survives the round trip after rounding.
    fn raw(self, value: f64) -> f64 {
        (value - self.offset) / self.gain
    }

    fn value(self, raw: f64) -> f64 {
        raw * self.gain + self.offset
    }
}

/// A number type on the wire.
pub(super) trait Number: Debug + Send + Sync + 'static {
    /// The integer that has its bits.
    type Word: Word;
    /// The most negative finite number, as near as a double comes.
    const LOWEST: f64;
    /// The greatest finite number, as near as a double comes.
    const HIGHEST: f64;
    /// True if infinities are numbers of this type.
    const HAS_INFINITY: bool;

    /// True if `raw`, once rounded, is a finite number of this type; false for NaN.
    fn fits(raw: f64) -> bool;

    /// The number nearest to `raw`: integers round half away from zero.
    fn to_word(raw: f64) -> Self::Word;

    /// The double of the same value, or the nearest for 64-bit integers.
    fn from_word(word: Self::Word) -> f64;
}

/// Moves `raw` away from zero, so that truncating it rounds half away from zero.
///
/// Adds the greatest double below one half. A plain half would round 0.49999999999999994 up to 1, and odd integers
/// beyond 2^52 to their even neighbour.
pub(super) fn nudge(raw: f64) -> f64 {
    raw + 0.499_999_999_999_999_94_f64.copysign(raw)
}

macro_rules! integer {
    ($int:ident as $word:ident, $below:expr, $above:expr) => {
        impl Number for $int {
            type Word = $word;
            #[allow(clippy::cast_precision_loss, clippy::cast_lossless)]
            const LOWEST: f64 = $int::MIN as f64;
            #[allow(clippy::cast_precision_loss, clippy::cast_lossless)]
            const HIGHEST: f64 = $int::MAX as f64;
            const HAS_INFINITY: bool = false;

            fn fits(raw: f64) -> bool {
                let nudged = nudge(raw);
                (nudged > $below) & (nudged < $above)
            }

            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                clippy::cast_possible_wrap
            )]
            fn to_word(raw: f64) -> $word {
                nudge(raw) as $int as $word
            }

            #[allow(
                clippy::cast_precision_loss,
                clippy::cast_lossless,
                clippy::cast_possible_wrap
            )]
            fn from_word(word: $word) -> f64 {
                word as $int as f64
            }
        }
    };
}

// The bounds are the first doubles that truncation would no longer bring into the type's range.
integer!(i8 as u8, -129.0, 128.0);
integer!(u8 as u8, -1.0, 256.0);
integer!(i16 as u16, -32_769.0, 32_768.0);
integer!(u16 as u16, -1.0, 65_536.0);
integer!(i32 as u32, -2_147_483_649.0, 2_147_483_648.0);
integer!(u32 as u32, -1.0, 4_294_967_296.0);
integer!(
    i64 as u64,
    -9_223_372_036_854_777_856.0,
    9_223_372_036_854_775_808.0
);
integer!(u64 as u64, -1.0, 18_446_744_073_709_551_616.0);

impl Number for f32 {
    type Word = u32;
    const LOWEST: f64 = f32::MIN as f64;
    const HIGHEST: f64 = f32::MAX as f64;
    const HAS_INFINITY: bool = true;

    fn fits(raw: f64) -> bool {
        raw.abs() <= Self::HIGHEST
    }

    #[allow(clippy::cast_possible_truncation)]
    fn to_word(raw: f64) -> u32 {
        (raw as f32).to_bits()
    }

    fn from_word(word: u32) -> f64 {
        f64::from(f32::from_bits(word))
    }
}

impl Number for f64 {
    type Word = u64;
    const LOWEST: f64 = f64::MIN;
    const HIGHEST: f64 = f64::MAX;
    const HAS_INFINITY: bool = true;

    fn fits(raw: f64) -> bool {
        raw.is_finite()
    }

    fn to_word(raw: f64) -> u64 {
        raw.to_bits()
    }

    fn from_word(word: u64) -> f64 {
        f64::from_bits(word)
    }
}

/// Rounded by the definition: `f64::round` is that of the C library, and not right on every system.
#[cfg(test)]
pub(super) fn half_away_from_zero(raw: f64) -> f64 {
    let whole = raw.trunc();
    if (raw - whole).abs() >= 0.5 {
        whole + 1_f64.copysign(raw)
    } else {
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nudging_and_cutting_is_rounding_half_away_from_zero() {
        let two_52 = 4_503_599_627_370_496.0;
        for magnitude in [
            0.0,
            0.499_999_999_999_999_94,
            0.5,
            0.500_000_000_000_000_1,
            1.0,
            1.499_999_999_999_999_8,
            1.5,
            2.5,
            32_767.499_999_999_996,
            32_767.5,
            two_52 / 2.0 - 0.5,
            two_52 / 2.0 + 0.5,
            two_52 - 0.5,
            two_52 + 1.0,
            2.0 * two_52 - 1.0,
            2.0 * two_52 + 2.0,
        ] {
            for raw in [magnitude, -magnitude] {
                let cut = nudge(raw).trunc();
                let expected = half_away_from_zero(raw);
                assert_eq!(cut.to_bits(), expected.to_bits(), "{raw:e}");
            }
        }
    }
}
