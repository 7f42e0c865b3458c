//! Edge detection: `R_TRIG` and `F_TRIG`.

/// Rising edge, `R_TRIG`: on for the one call at which the input has become true.
///
/// As in the standard, an input that is true at the very first call is an edge.
#[derive(Clone, Copy, Debug, Default)]
pub struct RTrig {
    memory: bool,
}

impl RTrig {
    /// Evaluates the block and returns `Q`.
    pub fn call(&mut self, clk: bool) -> bool {
        let q = clk && !self.memory;
        self.memory = clk;
        q
    }
}

/// Falling edge, `F_TRIG`: on for the one call at which the input has become false.
///
/// As in the standard, an input that is false at the very first call is an edge.
#[derive(Clone, Copy, Debug, Default)]
pub struct FTrig {
    memory: bool,
}

impl FTrig {
    /// Evaluates the block and returns `Q`.
    pub fn call(&mut self, clk: bool) -> bool {
        let q = !clk && !self.memory;
        self.memory = !clk;
        q
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_edge_shows_for_one_call() {
        let (mut rising, mut falling) = (RTrig::default(), FTrig::default());
        let clk = [false, true, true, false, false, true];
        assert_eq!(
            clk.map(|clk| rising.call(clk)),
            [false, true, false, false, false, true]
        );
        assert_eq!(
            clk.map(|clk| falling.call(clk)),
            [true, false, false, true, false, false]
        );
    }

    #[test]
    fn the_first_call_counts_as_an_edge() {
        assert!(RTrig::default().call(true));
        assert!(FTrig::default().call(false));
        assert!(!RTrig::default().call(false));
        assert!(!FTrig::default().call(true));
    }
}
