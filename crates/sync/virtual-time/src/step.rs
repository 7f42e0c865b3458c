//! Steps of virtual time.

use tickbus_base::time::Nanos;

/// One step of virtual time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// The number of the server's step, from 1. A client with a multiple sees only some of them.
    pub sequence: u64,
    /// The virtual time of this step; that of the first is 0.
    pub time: Nanos,
}

/// The step of this number, in a run with steps of `length`.
pub(crate) fn step_of(sequence: u64, length: Nanos) -> Step {
    let before = sequence.cast_signed() - 1;
    Step {
        sequence,
        time: Nanos(before * length.0),
    }
}

/// The number of the first step at or after a virtual time, with steps of `length`.
pub(crate) fn step_at(time: Nanos, length: Nanos) -> u64 {
    let time = time.0.max(0).unsigned_abs();
    time.div_ceil(length.0.unsigned_abs().max(1)) + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_belongs_to_the_first_step_that_is_not_before_it() {
        let cases = [
            (i64::MIN, 1),
            (-1, 1),
            (0, 1),
            (1, 2),
            (9, 2),
            (10, 2),
            (11, 3),
        ];
        for (time, step) in cases {
            assert_eq!(step_at(Nanos(time), Nanos(10)), step, "{time}");
        }
        assert_eq!(step_at(Nanos::MAX, Nanos(1)), 1 << 63);
    }
}
