//! The real-time clock, `RTC`.

use tickbus_base::time::Nanos;

/// A settable clock, `RTC`.
///
/// While `IN` is false, `CDT` is the clock passed to the call. A rising `IN` loads `PDT`; while `IN` stays true, `CDT`
/// is that date plus the time since then. `Q` is `IN`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rtc {
    /// The current date and time, `CDT`, as of the last call.
    pub cdt: Nanos,
    /// `Q`, as of the last call.
    pub q: bool,
    loaded: Nanos,
    since: Nanos,
}

impl Rtc {
    /// Evaluates the block and returns `Q`. Dates count in nanoseconds from the epoch of `now`.
    pub fn call(&mut self, now: Nanos, input: bool, pdt: Nanos) -> bool {
        if input && !self.q {
            self.loaded = pdt;
            self.since = now;
        }
        self.cdt = if input {
            self.loaded + (now - self.since)
        } else {
            now
        };
        self.q = input;
        self.q
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rising_input_loads_the_preset_and_a_falling_one_forgets_it() {
        let mut rtc = Rtc::default();
        let mut dates = Vec::new();
        for (now, input, pdt) in [
            (10, false, 500),
            (20, true, 500),
            (30, true, 900),
            (40, false, 900),
            (50, true, 700),
        ] {
            assert_eq!(rtc.call(Nanos(now), input, Nanos(pdt)), input);
            dates.push(rtc.cdt.0);
        }
        assert_eq!(dates, [10, 500, 510, 40, 700]);
    }
}
