//! How late the system may wake a thread.

/// From now on the system wakes this thread when its wait is over. By default Linux allows itself 50 microseconds more
/// (`timerslack_ns` in proc(5)), to wake several threads at once: half a bus cycle of 100 microseconds.
pub fn wake_on_time() {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    if let Err(error) = rustix::thread::set_current_timer_slack(Some(std::num::NonZeroU64::MIN)) {
        log::debug!("this thread may be woken some microseconds late: {error}");
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
