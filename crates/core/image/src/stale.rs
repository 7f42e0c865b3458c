//! The age of received data, and when data are stale.

use tickbus_base::time::Nanos;

/// Never: earlier than any time of a clock.
pub(super) const NEVER: i64 = i64::MIN;

/// `now - then`, for a `then` that may be [`NEVER`].
#[inline]
pub(super) fn age(now: Nanos, then: i64) -> Nanos {
    if then == NEVER {
        Nanos::MAX
    } else {
        (now - Nanos(then)).max(Nanos::ZERO)
    }
}

/// True if received data are stale. This rule applies to the tick, which then delivers fail-safe values, to the line's
/// state and to the statistics. Data of exactly the age `max_age` are fresh.
#[inline]
pub const fn is_stale(age: Nanos, max_age: Nanos, is_valid: bool) -> bool {
    !is_valid || age.0 > max_age.0
}
