//! The times to set in the PLC's project for a line whose answers take as long as here.

use std::fmt::Write as _;

use tickbus_base::time::{Nanos, TimeHistogram};

use crate::finder::bits;
use crate::rates::{RATES, Rate, SLOT_TIME_LIMIT};
use crate::station::MIN_TSDR;

/// The slot time exceeds the longest wait for an answer by at least this many bits.
const BEHIND: i64 = 15;

/// A serial port is not suitable for PROFIBUS above this rate.
const FASTEST: u32 = 500_000;

/// The settings for the PLC's project at one rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Advice {
    /// The rate, in bits per second.
    pub baud: u32,
    /// The longest wait for an answer by the standard, in bits.
    pub standard: u16,
    /// The share of answers that arrive within that wait, from 0 to 1.
    pub in_time: f64,
    /// `MaxTsdr` and the slot time, in bits; `None` if no slot time is long enough.
    pub bits: Option<(u16, u16)>,
}

/// Advice for each rate that a program in user space can serve. `replies` are the times from the last byte of a request
/// to the first of its answer, at the highest of these rates, where the wait before an answer is almost nothing.
/// `held_back` is the delay that the port itself adds.
pub fn advise(replies: &TimeHistogram, held_back: Nanos) -> Vec<Advice> {
    let of_user_space = RATES.iter().filter(|rate| rate.baud <= FASTEST);
    of_user_space
        .map(|rate| advise_rate(rate, replies, held_back))
        .collect()
}

fn advise_rate(rate: &Rate, replies: &TimeHistogram, held_back: Nanos) -> Advice {
    let baud = i64::from(rate.baud);
    let wait = i64::from(MIN_TSDR);
    let limit = bits(rate.baud, i64::from(rate.max_tsdr) - wait) - held_back;
    let steps = replies.steps().filter(|(longest, _)| *longest <= limit);
    let in_time: u64 = steps.map(|(_, count)| count).sum();
    // Waits can be longer than the longest one seen.
    let longest = replies.longest() + held_back;
    let needed = (longest.0 + longest.0 / 4).saturating_mul(baud) / 1_000_000_000 + 1 + wait;
    let max_tsdr = needed.max(rate.max_tsdr.into()).next_multiple_of_ten();
    let slot = (max_tsdr + BEHIND).next_multiple_of_ten();
    let fits = slot <= i64::from(SLOT_TIME_LIMIT);
    let small = |bits: i64| u16::try_from(bits).ok();
    #[expect(clippy::cast_precision_loss, reason = "a share to three digits")]
    let in_time = in_time as f64 / replies.count().max(1) as f64;
    Advice {
        baud: rate.baud,
        standard: rate.max_tsdr,
        in_time,
        bits: fits
            .then(|| Some((small(max_tsdr)?, small(slot)?)))
            .flatten(),
    }
}

trait Tens {
    fn next_multiple_of_ten(self) -> Self;
}

impl Tens for i64 {
    fn next_multiple_of_ten(self) -> Self {
        (self + 9) / 10 * 10
    }
}

/// The advice as a table.
pub fn table(all: &[Advice]) -> String {
    let mut text = "    bit/s  max TSDR of the standard  in time  MaxTsdr  slot time\n".to_owned();
    for advice in all {
        let bits = match advice.bits {
            Some((max_tsdr, slot)) => format!("{max_tsdr:>7}  {slot:>9}"),
            None => "      -  none is long enough".to_owned(),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:>9}  {:>24}  {:>6.1}%  {bits}",
            advice.baud,
            advice.standard,
            100.0 * advice.in_time,
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replies(micros: &[i64]) -> TimeHistogram {
        let mut replies = TimeHistogram::new();
        for span in micros {
            replies.record(Nanos::from_micros(*span));
        }
        replies
    }

    fn of(all: &[Advice], baud: u32) -> Advice {
        let found = all.iter().find(|advice| advice.baud == baud);
        *found.expect("a rate of user space")
    }

    #[test]
    fn fast_answers_need_no_more_than_the_standard() {
        let all = advise(&replies(&[50; 100]), Nanos(0));
        let slow = of(&all, 9_600);
        assert_eq!((slow.bits, slow.standard), (Some((60, 80)), 60));
        assert!((slow.in_time - 1.0).abs() < 1e-9);
        assert_eq!(all.len(), 6);
    }

    #[test]
    fn slow_answers_need_a_longer_slot_time_at_higher_rates() {
        // 1 ms in one of ten: 500 bits at 500 kbit/s, plus a quarter.
        let mut micros = vec![100; 9];
        micros.push(1000);
        let all = advise(&replies(&micros), Nanos(0));
        let fast = of(&all, 500_000);
        let (max_tsdr, slot) = fast.bits.expect("there is one");
        assert!(
            (630..=650).contains(&max_tsdr) && slot == max_tsdr + 20,
            "{fast:?}"
        );
        assert!((fast.in_time - 0.9).abs() < 1e-9, "{fast:?}");
        assert_eq!(of(&all, 9_600).bits, Some((60, 80)));
    }

    #[test]
    fn a_port_that_holds_bytes_back_counts_too_until_no_slot_time_is_long_enough() {
        let all = advise(&replies(&[100; 10]), Nanos::from_millis(16));
        let slow = of(&all, 9_600);
        assert!(slow.in_time.abs() < 1e-9, "{slow:?}");
        assert!(
            slow.bits
                .is_some_and(|(max_tsdr, _)| (190..=210).contains(&max_tsdr)),
            "{slow:?}"
        );
        let all = advise(&replies(&[100; 10]), Nanos::from_millis(60));
        assert_eq!(of(&all, 500_000).bits, None);
        assert!(table(&all).contains("none is long enough"));
    }
}
