//! Counting: `CTU`.

use super::RTrig;

/// Up-counter, `CTU`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ctu {
    /// `Q`, as of the last call: `CV` has reached `PV`.
    pub q: bool,
    /// `CV`, the count; it stops at 32767.
    pub cv: i16,
    edge: RTrig,
}

impl Ctu {
    /// Evaluates the block with the limit `pv` and returns `Q`. Rising edges of `cu` count, except while `r` resets.
    pub fn call(&mut self, cu: bool, r: bool, pv: i16) -> bool {
        let rises = self.edge.call(cu);
        if r {
            self.cv = 0;
        } else if rises {
            self.cv = self.cv.saturating_add(1);
        }
        self.q = self.cv >= pv;
        self.q
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_counts_edges_that_no_reset_hides() {
        let mut counter = Ctu::default();
        for (cu, r, cv, q) in [
            (false, false, 0, false),
            (true, false, 1, false),
            (true, false, 1, false),
            (false, false, 1, false),
            (true, false, 2, true),
            (false, true, 0, false),
            (true, true, 0, false),
            (true, false, 0, false),
            (false, false, 0, false),
            (true, false, 1, false),
        ] {
            assert_eq!((counter.call(cu, r, 2), counter.cv), (q, cv));
        }
    }

    #[test]
    fn it_stops_at_the_largest_count() {
        let mut counter = Ctu {
            cv: i16::MAX - 1,
            ..Ctu::default()
        };
        for _ in 0..3 {
            counter.call(true, false, i16::MAX);
            counter.call(false, false, i16::MAX);
        }
        assert_eq!((counter.cv, counter.q), (i16::MAX, true));
    }
}
