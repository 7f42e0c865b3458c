//! The PLC program: the position loops of both axes.

use tickbus_base::time::Nanos;

use crate::path::{Path, Point};

/// The cycle of the program, in milliseconds.
pub const CYCLE_MILLIS: i64 = 10;

/// The gain of the position loops, in 1/s.
const GAIN: f64 = 20.0;
/// The highest commanded speed, in mm/s.
const LIMIT: f64 = 600.0;

/// Returns the speeds to command at `time` to the axes at `position`, in mm/s.
pub fn command(path: &Path, time: Nanos, position: Point) -> Point {
    let target = path.at(time);
    [0, 1].map(|axis| (GAIN * (target[axis] - position[axis])).clamp(-LIMIT, LIMIT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_is_the_error_times_the_gain_within_the_limits() {
        let path = Path::default();
        assert_eq!(command(&path, Nanos::ZERO, [1.0, -2.0]), [-20.0, 40.0]);
        assert_eq!(command(&path, Nanos::ZERO, [31.0, -31.0]), [-600.0, 600.0]);
    }
}
