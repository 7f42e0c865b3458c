//! How late the system may wake a thread.

#![cfg_attr(
    windows,
    allow(unsafe_code, reason = "the system is asked for finer timers")
)]

/// From now on the system wakes this thread when its wait is over. By default Linux allows itself 50 microseconds more
/// (`timerslack_ns` in proc(5)), to wake several threads at once: half a bus cycle of 100 microseconds. Windows allows
/// itself 16 ms, or 1 ms for a process that asks, which this one then does until it ends.
pub fn wake_on_time() {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    if let Err(error) = rustix::thread::set_current_timer_slack(Some(std::num::NonZeroU64::MIN)) {
        log::debug!("this thread may be woken some microseconds late: {error}");
    }
    #[cfg(windows)]
    {
        static ONCE: std::sync::Once = std::sync::Once::new();
        ONCE.call_once(|| {
            // SAFETY: the call has no preconditions.
            let result = unsafe { windows_sys::Win32::Media::timeBeginPeriod(1) };
            if result != 0 {
                log::debug!("threads may be woken up to 16 ms late: error {result}");
            }
        });
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #[test]
    fn the_system_may_not_wake_the_thread_later_than_asked() {
        super::wake_on_time();
        let slack = rustix::thread::current_timer_slack().expect("a process may ask");
        assert_eq!(slack, 1, "nanoseconds");
    }
}
