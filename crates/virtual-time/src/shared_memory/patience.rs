//! Waiting for another process: spinning for a moment, then letting others run, then sleeping.

/// How often a wait looks again without letting others run, where every process has a core of its own.
const SPINS: u32 = 2000;

/// How often others are let run before the wait sleeps.
const YIELDS: u32 = 400;

/// How often a wait spins when this many processes take part.
pub(super) fn spins(processes: usize) -> u32 {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if processes <= cores { SPINS } else { 0 }
}

/// Looks until `is_there`; false if it is time to sleep.
pub(super) fn look(spins: u32, mut is_there: impl FnMut() -> bool) -> bool {
    for _ in 0..spins {
        if is_there() {
            return true;
        }
        std::hint::spin_loop();
    }
    for _ in 0..YIELDS {
        if is_there() {
            return true;
        }
        std::thread::yield_now();
    }
    is_there()
}
