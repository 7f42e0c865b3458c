//! Linear scaling between raw PLC values and engineering units.

/// `value = raw × gain + offset`, unclamped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Engineering units per raw count; never zero, always finite.
    pub gain: f64,
    /// The value at raw zero, in engineering units; always finite.
    pub offset: f64,
}

impl Scale {
    /// The line through two points: raw `raw[0]` is `value[0]`, raw `raw[1]` is `value[1]`.
    ///
    /// `None` when the points give no line that can be inverted in doubles: equal raw or equal values,
    /// numbers that are not finite, or a slope beyond the range of a double.
    pub fn through(raw: [f64; 2], value: [f64; 2]) -> Option<Self> {
        let gain = (value[1] - value[0]) / (raw[1] - raw[0]);
        let offset = value[0] - raw[0] * gain;
        let usable = gain.is_finite() && gain != 0.0 && gain.recip().is_finite();
        (usable && offset.is_finite()).then_some(Self { gain, offset })
    }

    /// The engineering value of a raw one.
    pub fn value(self, raw: f64) -> f64 {
        raw * self.gain + self.offset
    }

    /// The raw value of an engineering one, not rounded.
    pub fn raw(self, value: f64) -> f64 {
        (value - self.offset) / self.gain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_runs_through_its_points_and_back() {
        let scale = Scale::through([0.0, 27_648.0], [4.0, 20.0]).expect("a line");
        for (raw, value) in [
            (0.0, 4.0),
            (27_648.0, 20.0),
            (13_824.0, 12.0),
            (-6_912.0, 0.0),
        ] {
            assert!((scale.value(raw) - value).abs() < 1e-9);
            assert!((scale.raw(value) - raw).abs() < 1e-9);
        }
    }

    #[test]
    fn what_is_no_line_is_refused() {
        for (raw, value) in [
            ([1.0, 1.0], [0.0, 1.0]),
            ([0.0, 1.0], [2.0, 2.0]),
            ([0.0, f64::INFINITY], [0.0, 1.0]),
            ([0.0, 1.0], [f64::NAN, 1.0]),
            ([0.0, 1.0], [-f64::MAX, f64::MAX]),
            ([0.0, f64::MAX], [0.0, f64::MIN_POSITIVE]),
        ] {
            assert_eq!(Scale::through(raw, value), None, "{raw:?} {value:?}");
        }
    }
}
