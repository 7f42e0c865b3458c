//! Speeds that change at limited rates, step by step.

/// The speed after `seconds` on its way to `wanted`, at the rates of acceleration and deceleration. A rate of 0 is none:
/// the speed changes at once.
pub(crate) fn ramped(speed: f64, wanted: f64, rates: [f64; 2], seconds: f64) -> f64 {
    let faster = wanted.abs() > speed.abs() && wanted * speed >= 0.0;
    let rate = rates[usize::from(!faster)].abs();
    let most = if rate > 0.0 {
        // An infinite rate has no product with a tick of no time.
        (rate * seconds).max(0.0)
    } else {
        f64::INFINITY
    };
    speed + (wanted - speed).clamp(-most, most)
}

/// A position and the speed there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Place {
    pub(crate) position: f64,
    pub(crate) speed: f64,
}

impl Place {
    /// Moves for `seconds` towards `target` from any speed, no faster than `top`, so that the move can still stop there.
    /// Returns true once the target is reached.
    pub(crate) fn chase(&mut self, target: f64, top: f64, rates: [f64; 2], seconds: f64) -> bool {
        let way = target - self.position;
        let safe = (2.0 * rates[1].abs() * way.abs()).sqrt().min(top.abs());
        self.speed = ramped(self.speed, safe.copysign(way), rates, seconds);
        let moved = self.speed * seconds;
        if moved * way >= 0.0 && moved.abs() >= way.abs() {
            (self.position, self.speed) = (target, 0.0);
            return true;
        }
        self.position += moved;
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_infinite_rate_changes_nothing_in_a_tick_of_no_time_and_all_in_any_other() {
        let rates = [f64::INFINITY; 2];
        let speeds = [0.0, 0.001].map(|seconds| ramped(1.0, 5.0, rates, seconds));
        assert_eq!(speeds.map(f64::to_bits), [1.0, 5.0].map(f64::to_bits));
    }
}
