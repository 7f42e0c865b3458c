//! The date, for what others are told; never for what has to happen.

use std::time::{SystemTime, UNIX_EPOCH};

use super::Nanos;

/// The time since the beginning of 1970 (UTC) by the computer's clock, which is set and may jump: for certificates and
/// for time stamps that other computers see. Whatever waits or measures takes a [`Clock`](super::Clock).
pub fn unix_time() -> Nanos {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    // Before 1970 is no date; after 2262 the clock stands still.
    since.map_or(Nanos::ZERO, |since| {
        Nanos(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
    })
}
