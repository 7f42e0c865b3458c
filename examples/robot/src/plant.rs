//! The robot: two servo axes that follow a commanded speed with a lag.

use crate::path::{CORNERS, Point};

/// The step of the simulation, in milliseconds.
pub const STEP_MILLIS: i64 = 1;
/// The step of the simulation, in seconds.
const STEP: f64 = 1e-3;

/// The fraction of a speed difference that an axis makes up for in one step: 1 − e^(−h/τ), for h = 1 ms and τ = 20 ms.
///
/// Written out, since the last bit of `exp` differs from library to library, and the path must not.
const CATCH_UP: f64 = 0.048_770_575_499_285_984;

/// The axes at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    position: Point,
    speed: Point,
}

impl Default for Plant {
    /// Creates axes at rest at the first corner.
    fn default() -> Self {
        Self {
            position: CORNERS[0],
            speed: [0.0, 0.0],
        }
    }
}

impl Plant {
    /// Returns the position of the tool in mm.
    pub fn position(&self) -> Point {
        self.position
    }

    /// Does one step of 1 ms with the commanded speeds in mm/s.
    pub fn step(&mut self, command: Point) {
        for (axis, command) in command.into_iter().enumerate() {
            self.speed[axis] += (command - self.speed[axis]) * CATCH_UP;
            self.position[axis] += self.speed[axis] * STEP;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_lags_behind_its_command_by_its_time_constant() {
        assert!((CATCH_UP - (1.0 - (-1.0_f64 / 20.0).exp())).abs() < 1e-16);
        let mut plant = Plant::default();
        for _ in 0..20 {
            plant.step([100.0, 0.0]);
        }
        assert!((plant.speed[0] - 100.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
        assert_eq!(plant.speed[1].to_bits(), 0);
        for _ in 20..1000 {
            plant.step([100.0, 0.0]);
        }
        // 1 s at full speed, less the lag, which is τ to within half a step.
        assert!((plant.position()[0] - 100.0 * (1.0 - 0.02)).abs() < 0.06);
    }
}
