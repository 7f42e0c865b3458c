//! The processor's time stamp counter.

/// The processor's counter of time stamps, on a computer whose system takes its own time from it.
///
/// Linux does so only where the counter runs evenly, on all processors alike and while they idle; it keeps checking, and
/// changes to another source of time if it finds otherwise. In a virtual machine it is the host that has to promise this.
/// On other systems the counter is not used: the system's clock is read instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeStampCounter(());

#[cfg(all(target_os = "linux", target_arch = "x86_64", not(miri)))]
mod x86_64 {
    #![allow(
        unsafe_code,
        reason = "the instruction that reads the counter is an unsafe function before Rust 1.89 or so"
    )]

    use std::sync::LazyLock;

    use super::TimeStampCounter;

    /// Where Linux says what it takes its time from.
    const SOURCE: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";

    impl TimeStampCounter {
        /// The counter, if the system trusts it. It is asked once per process.
        pub fn trusted() -> Option<Self> {
            static IS_TRUSTED: LazyLock<bool> = LazyLock::new(|| {
                std::fs::read_to_string(SOURCE).is_ok_and(|source| source.trim() == "tsc")
            });
            IS_TRUSTED.then_some(Self(()))
        }

        /// What it counts now. It may wrap, and is not the same after the computer has slept.
        #[inline]
        pub fn read(self) -> u64 {
            // SAFETY: every processor of this architecture has the instruction, and it touches no memory. A system can
            // forbid it to its programs; one that takes its time from the counter does not, since its own clock reads it in
            // the program (vDSO).
            unsafe { std::arch::x86_64::_rdtsc() }
        }
    }
}

#[cfg(not(all(target_os = "linux", target_arch = "x86_64", not(miri))))]
impl TimeStampCounter {
    /// Not used on this system.
    pub const fn trusted() -> Option<Self> {
        None
    }

    /// Never called.
    pub const fn read(self) -> u64 {
        0
    }
}
