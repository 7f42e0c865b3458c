//! When received data are stale.

use tickbus_base::time::Nanos;

/// Whether received data are stale: the rule of the tick, which then delivers fail-safe values, of the line's state and
/// of the statistics. Data that are exactly as old as `max_age` are fresh.
#[inline]
pub const fn is_stale(age: Nanos, max_age: Nanos, is_valid: bool) -> bool {
    !is_valid || age.0 > max_age.0
}
