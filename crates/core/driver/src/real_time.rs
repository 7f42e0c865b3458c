//! The real-time settings of a driver's threads.

use tickbus_base::RealTime;
use tickbus_base::os::wake_on_time;
use tickbus_base::time::Clock;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::LinkStatus;

use super::DriverError;

/// Tries the settings of a driver that must not open without them.
///
/// # Errors
///
/// The system refuses one of them.
pub(super) fn check(config: &Config, clock: &dyn Clock) -> Result<(), DriverError> {
    let required = config.real_time.filter(|real_time| real_time.required);
    let Some(real_time) = required.filter(|_| clock.simulation().is_none()) else {
        return Ok(());
    };
    let refused = real_time.tried();
    let refused =
        refused.map_err(|source| DriverError::no_thread("a trial of real_time", source))?;
    if refused.is_empty() {
        return Ok(());
    }
    let file = config.path.display();
    let refused = refused.join("; ");
    Err(DriverError::RealTime(format!(
        "{file}: real_time is required, and {refused}; or remove \"required\""
    )))
}

/// Lets the calling thread, which is `what`, wake on time, applies the settings to it, and reports the result.
pub(super) fn begin(
    real_time: Option<RealTime>,
    what: &str,
    status: &LinkStatus,
    clock: &dyn Clock,
) {
    wake_on_time();
    let Some(real_time) = real_time.filter(|_| clock.simulation().is_none()) else {
        return;
    };
    let refused = real_time.apply();
    for refusal in &refused {
        log::warn!(
            "driver \"{}\": {what} runs without a part of its real_time: {refusal}",
            status.driver()
        );
    }
    let mut fact = real_time.to_string();
    if !refused.is_empty() {
        fact.push_str("; refused: ");
        fact.push_str(&refused.join("; "));
    }
    status.tell("real_time", &fact);
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tickbus_base::statistics::entries;
    use tickbus_base::time::{Monotonic, Nanos, Stop};

    use super::*;
    use crate::{Code, Driver};

    /// A loopback of this name with these settings.
    fn config(name: &str, real_time: &str) -> Config {
        let text = format!(
            "[driver]\nid = 1\nname = \"{name}\"\nreal_time = {real_time}\n[fieldbus]\nkind = \"loopback\"\nmode = \"free\"\nlink = \"x\"\n\
             [[signal]]\nname = \"In\"\naddress = \"%IX0.0\"\n"
        );
        Config::parse("driver.cfg", &text, &crate::KINDS).unwrap_or_else(|wrong| panic!("{wrong}"))
    }

    /// An open driver, and what its statistics say about real time.
    fn opened(name: &str, real_time: &str) -> (Driver, String) {
        let clock = Monotonic::shared();
        let driver = Driver::open(config(name, real_time), Arc::clone(&clock) as _).expect("opens");
        let (stop, begin) = (Stop::new(), clock.now());
        while clock.now() - begin < Nanos::from_secs(20) {
            let text = driver.statistics();
            if let Some((_, fact)) = entries(&text).find(|(key, _)| key == "real_time") {
                let fact = fact.to_owned();
                return (driver, fact);
            }
            clock.wait_until(clock.now() + Nanos::from_millis(1), &stop);
        }
        panic!("the thread has not begun");
    }

    #[test]
    fn a_driver_goes_on_without_a_setting_that_the_system_refuses_and_says_so() {
        // No computer has this processor.
        let (driver, fact) = opened("x", "{ cpu = 1023 }");
        let told = "cpu 1023; refused: the system refuses cpu = 1023 (";
        assert!(fact.starts_with(told), "{fact}");
        driver.close();
    }

    #[test]
    fn a_driver_that_requires_a_setting_does_not_open_without_it() {
        let config = config("x", "{ cpu = 1023, required = true }");
        let error = Driver::open(config, Monotonic::shared()).expect_err("refused");
        assert_eq!(error.code(), Code::BusFailed);
        let text = error.to_string();
        let told = "driver.cfg: real_time is required, and the system refuses cpu = 1023 (";
        assert!(text.starts_with(told), "{text}");
    }

    /// The priority and the class of this process's thread with this name; see proc(5), `stat`.
    #[cfg(target_os = "linux")]
    fn class_of(name: &str) -> Option<(u32, u32)> {
        let threads = std::fs::read_dir("/proc/self/task").expect("threads");
        let mut stats = threads
            .filter_map(|thread| std::fs::read_to_string(thread.ok()?.path().join("stat")).ok());
        stats.find_map(|stat| {
            let (head, fields) = stat.split_once(") ")?;
            let fields: Vec<&str> = fields.split(' ').collect();
            let number = |at: usize| fields.get(at)?.parse().ok();
            let is_it = head.split_once('(')?.1 == name;
            is_it.then(|| Some((number(37)?, number(38)?)))?
        })
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_thread_of_the_bus_has_the_class_and_this_one_has_not() {
        const FIFO: u32 = 1;
        let (driver, fact) = opened("rt", "{ priority = 3 }");
        if fact == "priority 3" {
            assert_eq!(class_of("bus rt"), Some((3, FIFO)));
        } else {
            assert!(fact.contains("LimitRTPRIO=3"), "{fact}");
            assert_eq!(class_of("bus rt"), Some((0, 0)));
        }
        driver.close();
    }
}
