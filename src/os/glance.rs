//! The clock for those who look at it all the time.

#![allow(
    unsafe_code,
    reason = "the processor's counter has no safe function in the standard library"
)]

use std::sync::Arc;

use crate::time::{Clock, Nanos};

/// The clock of one thread that looks at it again and again, within microseconds: the tick.
///
/// The operating system's clock costs half as much as a small exchange. For a millisecond after a look at it, the
/// processor's counter tells how much time has passed since, by the pace at which it counted between two looks: so the
/// time is right to two microseconds. Whatever becomes of the counter, as where a virtual machine moves to another
/// computer, the clock itself is looked at again after a millisecond of counting. Where the processor has no such
/// counter, or the clock is not the operating system's, each look is one at the clock.
#[derive(Debug)]
pub struct Glance {
    clock: Arc<dyn Clock>,
    /// Reads the processor's counter; `None` where it cannot stand in for the clock.
    counter: Option<fn() -> u64>,
    /// The look at the clock that counts from.
    base: Base,
    /// Nanoseconds per count, times 2^32; zero while that is not known.
    pace: u64,
    /// Counts for which the pace is trusted.
    trusted: u64,
}

/// Counter and clock at the same moment.
#[derive(Clone, Copy, Debug)]
struct Base {
    count: u64,
    time: Nanos,
    /// How much was counted while the clock was looked at: so well do the two belong together.
    blur: u64,
}

/// How long the counter stands in for the clock.
const TRUST: Nanos = Nanos::from_millis(1);

/// The fraction of a span, as a shift, that its ends may be blurred for the pace to be taken from it.
const SHARPNESS: u32 = 10;

/// No counter is slower or faster than this, in nanoseconds per count times 2^32.
const SLOWEST: u64 = 5 << 32;
const FASTEST: u64 = (1 << 32) / 20;

impl Glance {
    /// Looks at `clock`.
    pub fn at(clock: Arc<dyn Clock>) -> Self {
        let counter = if clock.is_of_the_system() {
            counter()
        } else {
            None
        };
        Self::with(clock, counter)
    }

    fn with(clock: Arc<dyn Clock>, counter: Option<fn() -> u64>) -> Self {
        Self {
            clock,
            counter,
            base: Base {
                count: 0,
                time: Nanos::ZERO,
                blur: u64::MAX,
            },
            pace: 0,
            trusted: 0,
        }
    }

    /// The time now.
    #[inline]
    pub fn now(&mut self) -> Nanos {
        let Some(counter) = self.counter else {
            return self.clock.now();
        };
        let counted = counter().wrapping_sub(self.base.count);
        if counted >= self.trusted {
            return self.look(counter);
        }
        // Neither overflows: a millisecond has at most 2^25 counts of at most 2^35.
        self.base.time + Nanos(((counted * self.pace) >> 32).cast_signed())
    }

    /// Looks at the clock itself, and learns the counter's pace from that.
    #[cold]
    fn look(&mut self, counter: fn() -> u64) -> Nanos {
        let count = counter();
        let time = self.clock.now();
        let before = std::mem::replace(
            &mut self.base,
            Base {
                count,
                time,
                blur: counter().wrapping_sub(count),
            },
        );
        let counted = count.wrapping_sub(before.count);
        let passed = (time - before.time).0.unsigned_abs();
        let is_sharp = before.blur.saturating_add(self.base.blur) <= counted >> SHARPNESS;
        let pace = (u128::from(passed) << 32) / u128::from(counted.max(1));
        let pace = u64::try_from(pace).unwrap_or(u64::MAX);
        if !(FASTEST..=SLOWEST).contains(&pace) {
            self.pace = 0;
        } else if is_sharp {
            self.pace = pace;
        }
        let trusted = (TRUST.0.unsigned_abs() << 32).checked_div(self.pace);
        // Whoever was kept from the processor between counter and clock looks again next time.
        self.trusted = trusted
            .filter(|trusted| self.base.blur <= trusted >> SHARPNESS)
            .unwrap_or_default();
        time
    }
}

/// The counter of this processor, if it counts at one pace whatever the processor does.
#[cfg(all(target_arch = "x86_64", not(miri)))]
fn counter() -> Option<fn() -> u64> {
    use std::arch::x86_64::{__cpuid, _rdtsc};

    const POWER: u32 = 0x8000_0007;
    const IS_INVARIANT: u32 = 1 << 8;
    let is_invariant = __cpuid(0x8000_0000).eax >= POWER && __cpuid(POWER).edx & IS_INVARIANT != 0;
    // SAFETY: every processor of this kind has the instruction.
    is_invariant.then_some(|| unsafe { _rdtsc() })
}

/// Here the clock is asked each time.
#[cfg(not(all(target_arch = "x86_64", not(miri))))]
fn counter() -> Option<fn() -> u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::{Manual, Monotonic};
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn it_shows_the_time_of_the_clock_and_never_goes_back_by_more_than_a_blur() {
        let clock = Monotonic::shared();
        let mut glance = Glance::at(Arc::clone(&clock) as _);
        let mut last = Nanos::ZERO;
        for _ in 0..200_000 {
            let before = clock.now();
            let now = glance.now();
            let after = clock.now();
            let slack = Nanos::from_micros(20);
            assert!(
                before - slack <= now && now <= after + slack,
                "{before} {now} {after}"
            );
            assert!(last - slack <= now, "{last} {now}");
            last = now;
        }
    }

    #[test]
    fn a_manual_clock_is_looked_at_each_time() {
        let clock = Manual::new();
        let mut glance = Glance::at(Arc::clone(&clock) as _);
        for nanos in [0, 1, 5, 1_000_000_000] {
            clock.set(Nanos(nanos));
            assert_eq!(glance.now(), Nanos(nanos));
        }
    }

    /// A counter that the test moves; each reading of it counts one.
    static COUNT: AtomicU64 = AtomicU64::new(1 << 40);

    fn count() -> u64 {
        COUNT.fetch_add(1, Ordering::Relaxed)
    }

    #[test]
    fn the_counter_stands_in_for_a_millisecond_and_is_not_believed_when_it_jumps() {
        let clock = Manual::new();
        let mut glance = Glance::with(Arc::clone(&clock) as _, Some(count));
        // Three counts in each nanosecond.
        let go = |glance: &mut Glance, nanos: i64, counts: u64| {
            clock.advance(Nanos(nanos));
            COUNT.fetch_add(counts, Ordering::Relaxed);
            (glance.now() - clock.now()).0
        };
        assert_eq!(go(&mut glance, 50_000, 150_000), 0, "the first look");
        assert_eq!(go(&mut glance, 50_000, 150_000), 0, "learns the pace");
        let off = go(&mut glance, 900_000, 2_700_000);
        assert!(
            off.abs() < 1_000,
            "within the millisecond, by the counter: {off}"
        );
        assert_eq!(
            go(&mut glance, 200_000, 600_000),
            0,
            "a look at the clock again"
        );
        // The computer is another one, whose counter is elsewhere.
        assert_eq!(go(&mut glance, 10_000, 1 << 50), 0);
        assert_eq!(
            go(&mut glance, 10_000, 30_000),
            0,
            "nothing is known of its pace"
        );
        assert_eq!(go(&mut glance, 10_000, (1_u64 << 50).wrapping_neg()), 0);
    }
}
