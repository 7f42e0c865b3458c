//! Motion profiles: from standstill to standstill over a distance.

/// The limits of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The highest speed.
    pub speed: f64,
    /// The highest acceleration.
    pub acceleration: f64,
    /// The highest deceleration.
    pub deceleration: f64,
    /// The highest rate of change of the acceleration; `None` lets it jump, as the simulator of 2018 did.
    pub jerk: Option<f64>,
}

/// The state of a move at some time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// The distance covered.
    pub distance: f64,
    /// The speed; never negative.
    pub speed: f64,
    /// The acceleration; negative while the speed decreases.
    pub acceleration: f64,
}

/// A move over a distance, from standstill to standstill.
///
/// Without a limit of jerk the speed over time is a trapezoid, or a triangle if the distance is too short for
/// full speed; with one it is an S-curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    distance: f64,
    pieces: [Piece; PIECES],
}

/// Rising, constant and falling acceleration; constant speed; and the same three for the deceleration.
const PIECES: usize = 7;

/// A stretch of time with constant jerk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Piece {
    lasts: f64,
    begins: State,
    jerk: f64,
}

impl Piece {
    fn at(&self, time: f64) -> State {
        let State {
            distance,
            speed,
            acceleration,
        } = self.begins;
        State {
            distance: distance
                + time * (speed + time * (acceleration / 2.0 + time * self.jerk / 6.0)),
            speed: speed + time * (acceleration + time * self.jerk / 2.0),
            acceleration: acceleration + time * self.jerk,
        }
    }
}

/// The transition between standstill and a speed.
#[derive(Clone, Copy, Debug)]
struct Ramp {
    /// How long the acceleration takes to build up, and again to fall to zero.
    bends: f64,
    /// How long the acceleration is constant.
    stays: f64,
    /// The highest acceleration.
    peak: f64,
}

impl Ramp {
    fn to(speed: f64, acceleration: f64, jerk: Option<f64>) -> Self {
        let Some(jerk) = jerk else {
            return Self {
                bends: 0.0,
                stays: speed / acceleration,
                peak: acceleration,
            };
        };
        let peak = acceleration.min((speed * jerk).sqrt());
        let bends = peak / jerk;
        Self {
            bends,
            stays: (speed / peak - bends).max(0.0),
            peak,
        }
    }

    fn lasts(self) -> f64 {
        2.0 * self.bends + self.stays
    }
}

impl Limits {
    /// True if all limits are finite and positive.
    pub fn make_sense(&self) -> bool {
        let all = [
            self.speed,
            self.acceleration,
            self.deceleration,
            self.jerk.unwrap_or(1.0),
        ];
        all.iter().all(|limit| limit.is_finite() && *limit > 0.0)
    }

    fn ramps(&self, speed: f64) -> (Ramp, Ramp) {
        (
            Ramp::to(speed, self.acceleration, self.jerk),
            Ramp::to(speed, self.deceleration, self.jerk),
        )
    }

    /// The distance needed to reach `speed` and stop again.
    fn least_distance(&self, speed: f64) -> f64 {
        let (up, down) = self.ramps(speed);
        // Each ramp is symmetric, so its mean speed is half of the highest.
        speed / 2.0 * (up.lasts() + down.lasts())
    }

    /// The highest speed of a move over `distance`.
    fn peak(&self, distance: f64) -> f64 {
        if self.least_distance(self.speed) <= distance {
            return self.speed;
        }
        if self.jerk.is_none() {
            let (a, b) = (self.acceleration, self.deceleration);
            return (2.0 * distance * a * b / (a + b)).sqrt();
        }
        // The distance grows monotonically with the speed, by a different formula in each of four ranges.
        // Bisection finds the speed to the last bit in about as many steps as a double has bits.
        let (mut low, mut high) = (0.0, self.speed);
        for _ in 0..64 {
            let middle = f64::midpoint(low, high);
            if self.least_distance(middle) <= distance {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

impl Profile {
    /// The fastest move over `distance` within `limits`; `None` when the limits or the distance make no sense.
    pub fn new(distance: f64, limits: &Limits) -> Option<Self> {
        if !limits.make_sense() || !distance.is_finite() || distance < 0.0 {
            return None;
        }
        let mut pieces = [Piece::default(); PIECES];
        let peak = limits.peak(distance);
        if peak > 0.0 {
            let (up, down) = limits.ramps(peak);
            let steady = ((distance - limits.least_distance(peak)) / peak).max(0.0);
            let jerk = limits.jerk.unwrap_or(0.0);
            let plan = [
                (up.bends, 0.0, jerk),
                (up.stays, up.peak, 0.0),
                (up.bends, up.peak, -jerk),
                (steady, 0.0, 0.0),
                (down.bends, 0.0, -jerk),
                (down.stays, -down.peak, 0.0),
                (down.bends, -down.peak, jerk),
            ];
            let mut now = State::default();
            for (piece, (lasts, acceleration, jerk)) in pieces.iter_mut().zip(plan) {
                *piece = Piece {
                    lasts,
                    begins: State {
                        acceleration,
                        ..now
                    },
                    jerk,
                };
                now = piece.at(lasts);
            }
        }
        Some(Self { distance, pieces })
    }

    /// How long the move takes, in seconds.
    pub fn duration(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.lasts).sum()
    }

    /// The state `time` seconds after the beginning; before it and after the end, the state at that end.
    pub fn at(&self, time: f64) -> State {
        let mut left = time.max(0.0);
        for piece in &self.pieces {
            if left < piece.lasts {
                return piece.at(left);
            }
            left -= piece.lasts;
        }
        State {
            distance: self.distance,
            ..State::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limits(speed: f64, acceleration: f64, deceleration: f64, jerk: Option<f64>) -> Limits {
        Limits {
            speed,
            acceleration,
            deceleration,
            jerk,
        }
    }

    /// The move that the thesis of 2018 documents.
    const CAPTURED: Limits = Limits {
        speed: 8_000.0,
        acceleration: 15_000.0,
        deceleration: 15_000.0,
        jerk: None,
    };

    #[test]
    fn the_captured_move_takes_its_time() {
        for (distance, seconds) in [
            (6_300.0, 1.320_83),
            (13_950.0, 2.277_08),
            (1_000.0, 0.516_40),
        ] {
            let profile = Profile::new(distance, &CAPTURED).expect("a move");
            assert!(
                (profile.duration() - seconds).abs() < 0.000_01,
                "{distance}: {}",
                profile.duration()
            );
        }
    }

    #[test]
    fn a_short_move_is_a_triangle_with_the_peak_of_the_formula() {
        let profile = Profile::new(1_000.0, &CAPTURED).expect("a move");
        let middle = profile.at(profile.duration() / 2.0);
        assert!((middle.speed - 3_872.98).abs() < 0.01, "{middle:?}");
        let limit = 4_266.67;
        let (below, above) = (limit - 1.0, limit + 1.0);
        let top = |distance| CAPTURED.peak(distance);
        assert!(top(below) < 8_000.0);
        assert!((top(above) - 8_000.0).abs() < 1e-9);
    }

    #[test]
    fn an_s_curve_takes_longer_by_the_time_of_its_bends() {
        // v / a + a / j for each ramp, and the rest at full speed.
        let s = limits(100.0, 200.0, 400.0, Some(2_000.0));
        let profile = Profile::new(1_000.0, &s).expect("a move");
        let ramps = (0.5 + 0.1) + (0.25 + 0.2);
        let expected = ramps + (1_000.0 - 50.0 * ramps) / 100.0;
        assert!((profile.duration() - expected).abs() < 1e-9);
        // The speed is too low to reach the highest acceleration: twice √(v / j).
        let slow = limits(5.0, 200.0, 200.0, Some(2_000.0));
        let profile = Profile::new(0.5, &slow).expect("a move");
        let ramp = 2.0 * (5.0_f64 / 2_000.0).sqrt();
        let expected = 2.0 * ramp + (0.5 - 5.0 * ramp) / 5.0;
        assert!((profile.duration() - expected).abs() < 1e-9);
    }

    #[test]
    fn what_makes_no_sense_is_no_move() {
        for wrong in [
            limits(0.0, 1.0, 1.0, None),
            limits(1.0, -1.0, 1.0, None),
            limits(1.0, 1.0, f64::NAN, None),
            limits(1.0, 1.0, 1.0, Some(0.0)),
            limits(f64::INFINITY, 1.0, 1.0, None),
        ] {
            assert_eq!(Profile::new(1.0, &wrong), None, "{wrong:?}");
        }
        assert_eq!(Profile::new(-1.0, &CAPTURED), None);
        let nowhere = Profile::new(0.0, &CAPTURED).expect("a move");
        assert!(nowhere.duration() <= 0.0);
        assert_eq!(nowhere.at(1.0), State::default());
    }

    proptest! {
        #[test]
        fn every_move_keeps_its_limits_and_arrives(
            distance in 0.001_f64..10_000.0,
            speed in 0.1_f64..10_000.0,
            acceleration in 0.1_f64..50_000.0,
            deceleration in 0.1_f64..50_000.0,
            jerk in prop::option::of(0.1_f64..1_000_000.0),
        ) {
            let limits = limits(speed, acceleration, deceleration, jerk);
            let profile = Profile::new(distance, &limits).expect("a move");
            let end = profile.duration();
            let slack = 1e-6;
            let mut before = State::default();
            let steps = 200;
            for step in 1..=steps {
                let state = profile.at(end * f64::from(step) / f64::from(steps));
                prop_assert!(state.distance >= before.distance - slack * distance);
                prop_assert!(state.speed >= -slack * speed && state.speed <= speed * (1.0 + slack));
                prop_assert!(state.acceleration <= acceleration * (1.0 + slack));
                prop_assert!(state.acceleration >= -deceleration * (1.0 + slack));
                if let Some(jerk) = jerk {
                    let change = (state.acceleration - before.acceleration).abs();
                    let most = jerk * end / f64::from(steps);
                    prop_assert!(change <= most * (1.0 + slack) + slack * acceleration.max(deceleration));
                }
                before = state;
            }
            // The last piece ends at the target, without a jump.
            let last = profile.at(end * (1.0 - 1e-9));
            prop_assert!((last.distance - distance).abs() <= 1e-5 * distance.max(1.0));
        }
    }
}
