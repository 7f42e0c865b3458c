//! The timers `TON`, `TOF` and `TP`.
//!
//! `ET` stops at `PT`; a negative `PT` counts as 0, and a clock that steps back gives an `ET` of 0. With a
//! `PT` of 0, `TON` is on and `TP` stays off from the first call, according to the standard; in some
//! implementations (`matiec`) that takes a second call.

use tickbus_base::time::Nanos;

/// The time since `start`, limited to the range from 0 to `pt`.
fn elapsed(now: Nanos, start: Nanos, pt: Nanos) -> Nanos {
    (now - start).clamp(Nanos::ZERO, pt.max(Nanos::ZERO))
}

/// On-delay, `TON`: on once the input has been true for `PT`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ton {
    /// `Q`, as of the last call.
    pub q: bool,
    /// The elapsed time, `ET`, as of the last call.
    pub et: Nanos,
    start: Option<Nanos>,
}

impl Ton {
    /// Evaluates the block and returns `Q`.
    pub fn call(&mut self, now: Nanos, input: bool, pt: Nanos) -> bool {
        if input {
            self.et = elapsed(now, *self.start.get_or_insert(now), pt);
            self.q = self.et >= pt;
        } else {
            *self = Self::default();
        }
        self.q
    }
}

/// Off-delay, `TOF`: off once the input has been false for `PT`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tof {
    /// `Q`, as of the last call.
    pub q: bool,
    /// The elapsed time, `ET`, as of the last call.
    pub et: Nanos,
    start: Option<Nanos>,
}

impl Tof {
    /// Evaluates the block and returns `Q`.
    pub fn call(&mut self, now: Nanos, input: bool, pt: Nanos) -> bool {
        if input {
            *self = Self {
                q: true,
                ..Self::default()
            };
        } else if self.q {
            self.et = elapsed(now, *self.start.get_or_insert(now), pt);
            self.q = self.et < pt;
        }
        self.q
    }
}

/// Pulse, `TP`: a rising input makes a pulse of length `PT`, whatever the input does meanwhile.
///
/// The block rearms when a call after the pulse finds the input false.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tp {
    /// `Q`, as of the last call.
    pub q: bool,
    /// The elapsed time, `ET`, as of the last call; stays at `PT` until the block rearms.
    pub et: Nanos,
    start: Option<Nanos>,
}

impl Tp {
    /// Evaluates the block and returns `Q`.
    pub fn call(&mut self, now: Nanos, input: bool, pt: Nanos) -> bool {
        if self.start.is_none() && input {
            self.start = Some(now);
            self.q = true;
        }
        if let Some(start) = self.start {
            // A pulse that is over stays over, even if PT grows.
            if self.q {
                self.et = elapsed(now, start, pt);
                self.q = self.et < pt;
            }
            if !self.q && !input {
                *self = Self::default();
            }
        }
        self.q
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN: i64 = 10;
    const PT: Nanos = Nanos::from_millis(30);
    const IN: &str = "0111111001100100000011110000";

    /// `Q` and `ET` in milliseconds for each call of the golden input, one call per scan.
    fn play(mut call: impl FnMut(Nanos, bool) -> (bool, Nanos)) -> (String, Vec<i64>) {
        IN.bytes()
            .enumerate()
            .map(|(scan, input)| {
                let now = Nanos::from_millis(SCAN * i64::try_from(scan).expect("short"));
                let (q, et) = call(now, input == b'1');
                (if q { '1' } else { '0' }, et.0 / 1_000_000)
            })
            .unzip()
    }

    #[test]
    fn ton_follows_the_golden_row() {
        let mut ton = Ton::default();
        let (q, et) = play(|now, input| (ton.call(now, input, PT), ton.et));
        assert_eq!(q, "0000111000000000000000010000");
        assert_eq!(et[..9], [0, 0, 10, 20, 30, 30, 30, 0, 0]);
    }

    #[test]
    fn tof_follows_the_golden_row() {
        let mut tof = Tof::default();
        let (q, et) = play(|now, input| (tof.call(now, input, PT), tof.et));
        assert_eq!(q, "0111111111111111100011111110");
        assert_eq!(et[12..21], [10, 0, 0, 10, 20, 30, 30, 30, 0]);
    }

    #[test]
    fn tp_follows_the_golden_row() {
        let mut tp = Tp::default();
        let (q, et) = play(|now, input| (tp.call(now, input, PT), tp.et));
        assert_eq!(q, "0111000001110111000011100000");
        assert_eq!(et[..9], [0, 0, 10, 20, 30, 30, 30, 0, 0]);
        assert_eq!(et[9..18], [0, 10, 20, 0, 0, 10, 20, 0, 0]);
    }

    #[test]
    fn a_preset_of_zero_needs_no_second_call() {
        assert!(Ton::default().call(Nanos(5), true, Nanos::ZERO));
        assert!(!Tp::default().call(Nanos(5), true, Nanos::ZERO));
        let mut tof = Tof::default();
        tof.call(Nanos(5), true, Nanos::ZERO);
        assert!(!tof.call(Nanos(6), false, Nanos::ZERO));
    }

    #[test]
    fn a_negative_preset_counts_as_zero_and_time_that_steps_back_as_none() {
        let mut ton = Ton::default();
        assert!(ton.call(Nanos(0), true, Nanos(-1)));
        let mut ton = Ton::default();
        ton.call(Nanos(100), true, PT);
        assert!(!ton.call(Nanos(50), true, PT));
        assert_eq!(ton.et, Nanos::ZERO);
    }
}
