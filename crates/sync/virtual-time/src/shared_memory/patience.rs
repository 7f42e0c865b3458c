//! Waiting for another process: spin for a moment, then yield, then sleep.

use tickbus_base::time::{Clock as _, Monotonic, Nanos};

/// The number of spins before the first yield, where every process has its own core.
const SPINS: u32 = 4000;

/// The number of yields before the wait sleeps.
const YIELDS: u32 = 400;

/// A yield longer than this means that the computer is busy with something else. A thread that sleeps then gets the
/// processor back sooner than one that yields.
const LONG: Nanos = Nanos::from_millis(1);

/// The number of following waits that do not yield, at first and at most; it quadruples each time that the computer is
/// still busy.
const BUSY: u32 = 200;
const BUSIEST: u32 = 51_200;

/// The number of spins on a busy computer, some 2 µs: the other process may need this very core.
const FEW: u32 = 50;

/// How a process waits for another one.
#[derive(Clone, Debug)]
pub(super) struct Patience {
    spins: u32,
    /// The number of further waits that do not yield.
    busy: u32,
    /// That number when a yield last took long; 0 if none did.
    was_busy: u32,
}

impl Patience {
    /// The patience of a wait with this many spins.
    pub(super) const fn new(spins: u32) -> Self {
        Self {
            spins,
            busy: 0,
            was_busy: 0,
        }
    }

    /// The number of spins when this many processes take part.
    pub(super) fn spins(processes: usize) -> u32 {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        if processes <= cores { SPINS } else { 0 }
    }

    /// Looks until `is_there`; false when it is time to sleep.
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
