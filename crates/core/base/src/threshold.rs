//! A switch at a number.

/// A switch that a number trips: on from the trip point on, or down to it, and off again when the number has come back
/// by more than the hysteresis.
#[derive(Clone, Debug, PartialEq)]
pub struct Threshold {
    at: f64,
    above: bool,
    hysteresis: f64,
    is_on: bool,
}

impl Threshold {
    /// A switch that is off, on above `at` or below it. The hysteresis is not negative.
    pub const fn new(at: f64, above: bool, hysteresis: f64) -> Self {
        Self {
            at,
            above,
            hysteresis,
            is_on: false,
        }
    }

    /// The trip point, to be changed, of a switch that is on above it, or below it.
    pub fn trip_point(&mut self, above: bool) -> Option<&mut f64> {
        (self.above == above).then_some(&mut self.at)
    }

    /// Returns whether the switch is on at this number.
    pub fn update(&mut self, number: f64) -> bool {
        // The distance beyond the trip point: the switch turns on at 0, and off below minus the hysteresis.
        let beyond = if self.above {
            number - self.at
        } else {
            self.at - number
        };
        let needed = if self.is_on { -self.hysteresis } else { 0.0 };
        self.is_on = beyond >= needed;
        self.is_on
    }
}
