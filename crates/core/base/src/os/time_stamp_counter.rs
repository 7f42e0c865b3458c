//! The processor's time stamp counter.

/// The processor's time stamp counter, on a computer whose system takes its own time from it.
///
/// Linux does so only if the counter runs evenly, equally on all processors and while they idle; Linux keeps checking,
/// and otherwise changes to another source of time. In a virtual machine the host has to promise this. Other systems do
/// not use the counter, but read the system's clock.
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

    /// The file in which Linux names its source of time.
    const SOURCE: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";

    impl TimeStampCounter {
        /// The counter, if the system trusts it. The system is asked once per process.
        pub fn trusted() -> Option<Self> {
            static IS_TRUSTED: LazyLock<bool> = LazyLock::new(|| {
                std::fs::read_to_string(SOURCE).is_ok_and(|source| source.trim() == "tsc")
            });
            IS_TRUSTED.then_some(Self(()))
        }

        /// The current count. The count may wrap, and jumps while the computer sleeps.
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
