//! A signal that reaches the PLC late.

use std::collections::VecDeque;

use tickbus_image::signal::Slot;

/// Holds the changes of one signal back, each by the same number of ticks.
#[derive(Clone, Debug)]
pub(super) struct Late {
    signal: usize,
    /// The values on their way.
    way: VecDeque<Slot>,
    truth: Option<Slot>,
}

impl Late {
    /// A signal that has had the present value for long.
    pub(super) fn begin(signal: usize, ticks: usize, slots: &[Slot]) -> Self {
        Self {
            signal,
            way: std::iter::repeat_n(slots[signal], ticks).collect(),
            truth: None,
        }
    }

    /// Replaces the value by the one that arrives now.
    pub(super) fn apply_to(&mut self, slots: &mut [Slot]) {
        let truth = slots[self.signal];
        self.way.push_back(truth);
        slots[self.signal] = self.way.pop_front().unwrap_or(truth);
        self.truth = Some(truth);
    }

    /// Restores the true value.
    pub(super) fn restore(&mut self, slots: &mut [Slot]) {
        if let Some(truth) = self.truth.take() {
            slots[self.signal] = truth;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_change_comes_later_by_the_same_time_and_the_truth_is_kept() {
        let mut slots = [Slot::from_real(0.0)];
        let mut late = Late::begin(0, 2, &slots);
        let mut seen = Vec::new();
        for value in [1.0, 2.0, 2.0, 3.0, 3.0, 3.0] {
            slots[0] = Slot::from_real(value);
            late.apply_to(&mut slots);
            seen.push(slots[0].real());
            late.restore(&mut slots);
            assert_eq!(slots[0], Slot::from_real(value));
        }
        assert_eq!(seen, [0.0, 0.0, 1.0, 2.0, 2.0, 3.0]);
    }
}
