//! The time of day, for what carries dates: certificates and the timestamps of protocols.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Gives the time of day as the time since 1970-01-01, UTC. Code that judges or stamps dates takes one as an argument;
/// production hands in [`system_time`].
pub type WallClock = fn() -> Duration;

/// The time of day as the operating system has it. It may jump, so it measures no spans.
pub fn system_time() -> Duration {
    // A system that counts from before 1970 has not been set.
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
}
