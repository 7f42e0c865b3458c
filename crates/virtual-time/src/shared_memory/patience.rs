//! Waiting for another process: spinning for a moment, then letting others run, then sleeping.

use tickbus_base::time::{Clock as _, Monotonic, Nanos};

/// How often a wait looks again without letting others run, where every process has a core of its own.
const SPINS: u32 = 4000;

/// How often others are let run before the wait sleeps.
const YIELDS: u32 = 400;

/// If others take the processor for longer than this, the computer is busy with something else: who sleeps then gets it
/// back sooner than who lets others run.
const LONG: Nanos = Nanos::from_millis(1);

/// For how many waits that is remembered at first, and at most: each time that it turns out to be so still, four times as many.
const BUSY: u32 = 200;
const BUSIEST: u32 = 51_200;

/// How often a wait spins on a busy computer, some 2 µs: whom it waits for may need this very core.
const FEW: u32 = 50;

/// How a process waits for another one.
#[derive(Clone, Debug)]
pub(super) struct Patience {
    spins: u32,
    /// For how many more waits others are not let run.
    busy: u32,
    /// How many that were when others last took long; 0 if they did not.
    was_busy: u32,
}

impl Patience {
    /// The patience of those who spin this often.
    pub(super) const fn new(spins: u32) -> Self {
        Self {
            spins,
            busy: 0,
            was_busy: 0,
        }
    }

    /// How often a wait spins when this many processes take part.
    pub(super) fn spins(processes: usize) -> u32 {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        if processes <= cores { SPINS } else { 0 }
    }

    /// Looks until `is_there`; false if it is time to sleep.
    pub(super) fn look(&mut self, mut is_there: impl FnMut() -> bool) -> bool {
        let spins = if self.busy > 0 { FEW } else { self.spins };
        for _ in 0..spins {
            if is_there() {
                return true;
            }
            std::hint::spin_loop();
        }
        if self.busy > 0 {
            self.busy -= 1;
            return is_there();
        }
        let clock = Monotonic::shared();
        let mut before = clock.now();
        for _ in 0..YIELDS {
            if is_there() {
                return true;
            }
            std::thread::yield_now();
            let now = clock.now();
            if now - before > LONG {
                self.was_busy = (4 * self.was_busy).clamp(BUSY, BUSIEST);
                self.busy = self.was_busy;
                return is_there();
            }
            before = now;
        }
        self.was_busy = 0;
        is_there()
    }
}
