//! The time of day, for everything that carries dates: certificates and protocol timestamps.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Returns the time of day as the time since 1970-01-01, UTC. Code that checks or writes dates takes one as an
/// argument; production passes [`system_time`].
pub type WallClock = fn() -> Duration;

/// The time of day of the operating system. It may jump, so it must not be used to measure spans.
pub fn system_time() -> Duration {
    // A clock that reads earlier than 1970 has not been set.
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
}
