//! The processor's time stamp counter.

/// The processor's time stamp counter, on a computer whose system takes its own time from it.
///
/// Linux does so only if the counter runs evenly, equally on all processors and while they idle; Linux keeps checking,
/// and otherwise changes to another source of time. Windows is not so plain: it takes its time from the counter if the
/// processor promises an even pace and the frequency of its clock is 10 MHz, to which Windows scales the counter since
/// version 1809; other sources have frequencies of their own (the HPET 14.3 MHz, the ACPI timer 3.6 MHz). Wine's clock
/// always has 10 MHz, so there the processor's promise decides alone. In a virtual machine the host has to keep it.
/// Other systems do not use the counter, but read the system's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeStampCounter(());

#[cfg(all(any(target_os = "linux", windows), target_arch = "x86_64", not(miri)))]
mod x86_64 {
    #![allow(
        unsafe_code,
        reason = "the instruction that reads the counter is an unsafe function before Rust 1.89 or so; so are the questions to \
                  the processor and to Windows"
    )]

    use std::sync::LazyLock;

    use super::TimeStampCounter;

    impl TimeStampCounter {
        /// The counter, if the system trusts it. The system is asked once per process.
        pub fn trusted() -> Option<Self> {
            static IS_TRUSTED: LazyLock<bool> = LazyLock::new(is_trusted);
            IS_TRUSTED.then_some(Self(()))
        }

        /// The current count. The count may wrap, and jumps while the computer sleeps.
        #[inline]
        pub fn read(self) -> u64 {
            // SAFETY: every processor of this architecture has the instruction, and it touches no memory. A system can
            // forbid it to its programs; one that takes its time from the counter does not, since its own clock reads it in
            // the program.
            unsafe { std::arch::x86_64::_rdtsc() }
        }
    }

    #[cfg(target_os = "linux")]
    fn is_trusted() -> bool {
        /// The file in which Linux names its source of time.
        const SOURCE: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
        std::fs::read_to_string(SOURCE).is_ok_and(|source| source.trim() == "tsc")
    }

    #[cfg(windows)]
    fn is_trusted() -> bool {
        /// The frequency in Hz of a clock that Windows takes from the counter.
        const SCALED: i64 = 10_000_000;
        let mut frequency = 0;
        // SAFETY: the function writes to the number alone.
        let is_known = unsafe {
            windows_sys::Win32::System::Performance::QueryPerformanceFrequency(&raw mut frequency)
        };
        is_known != 0 && frequency == SCALED && has_even_pace()
    }

    /// True if the processor promises that the counter's pace never changes ("invariant TSC": CPUID leaf 8000_0007h, EDX,
    /// bit 8; Intel SDM volume 3, section "Invariant TSC").
    #[cfg(windows)]
    #[allow(unused_unsafe, reason = "since Rust 1.94 or so the function is safe")]
    fn has_even_pace() -> bool {
        const PACE: u32 = 0x8000_0007;
        // SAFETY: every processor of this architecture has the instruction.
        let last = unsafe { std::arch::x86_64::__cpuid(0x8000_0000) }.eax;
        // SAFETY: as above.
        last >= PACE && unsafe { std::arch::x86_64::__cpuid(PACE) }.edx & 1 << 8 != 0
    }
}

#[cfg(not(all(any(target_os = "linux", windows), target_arch = "x86_64", not(miri))))]
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
