//! Bistables: `SR` and `RS`.

/// Set-dominant bistable, `SR`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sr {
    /// `Q1`, as of the last call.
    pub q1: bool,
}

impl Sr {
    /// Evaluates the block and returns `Q1`.
    pub fn call(&mut self, s1: bool, r: bool) -> bool {
        self.q1 = s1 || (!r && self.q1);
        self.q1
    }
}

/// Reset-dominant bistable, `RS`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rs {
    /// `Q1`, as of the last call.
    pub q1: bool,
}

impl Rs {
    /// Evaluates the block and returns `Q1`.
    pub fn call(&mut self, s: bool, r1: bool) -> bool {
        self.q1 = !r1 && (s || self.q1);
        self.q1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_remember_and_differ_where_set_meets_reset() {
        let (mut sr, mut rs) = (Sr::default(), Rs::default());
        for (set, reset, q_sr, q_rs) in [
            (false, false, false, false),
            (true, false, true, true),
            (false, false, true, true),
            (false, true, false, false),
            (true, true, true, false),
            (false, false, true, false),
        ] {
            assert_eq!((sr.call(set, reset), rs.call(set, reset)), (q_sr, q_rs));
        }
    }
}
