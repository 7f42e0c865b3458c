//! The age of received data, and when data are stale.

use tickbus_base::time::Nanos;

/// Never: earlier than any time of a clock.
pub(super) const NEVER: i64 = i64::MIN;

/// `now - then`, for a `then` that may be [`NEVER`].
#[inline]
pub(super) fn age(now: Nanos, then: i64) -> Nanos {
    if then == NEVER {
        return Nanos::MAX;
    }
    // Without overflow, since the difference of two numbers of 64 bits fits into 64 bits without a sign: fewer
    // instructions than a difference that saturates at both ends.
    let age = now.0.abs_diff(then.min(now.0));
    Nanos(i64::try_from(age).unwrap_or(i64::MAX))
}

/// True if received data are stale. This rule applies to the tick, which then delivers fail-safe values, to the line's
/// state and to the statistics. Data of exactly the age `max_age` are fresh.
#[inline]
pub const fn is_stale(age: Nanos, max_age: Nanos, is_valid: bool) -> bool {
    !is_valid || age.0 > max_age.0
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn an_age_is_never_negative_and_saturates() {
        for (now, then, expected) in [
            (7, 5, 2),
            (5, 7, 0),
            (-5, -7, 2),
            (5, -7, 12),
            (0, NEVER, i64::MAX),
            (-5, NEVER, i64::MAX),
            (i64::MAX, -1, i64::MAX),
            (i64::MAX, NEVER + 1, i64::MAX),
            (NEVER, i64::MAX, 0),
        ] {
            assert_eq!(age(Nanos(now), then), Nanos(expected), "{now} - {then}");
        }
    }
}
