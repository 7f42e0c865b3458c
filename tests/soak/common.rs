//! What the soaks share: how long they last, what they ask a driver, and what must not have happened to it.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use tickbus::driver::Driver;
pub use tickbus_conformance::resources::Resources;

/// When it is over: some seconds from now, or what `make soak` asks for.
pub fn end() -> Instant {
    let seconds = std::env::var("TICKBUS_SOAK_SECONDS").map_or(5, |text| {
        text.parse().expect("TICKBUS_SOAK_SECONDS is a number")
    });
    Instant::now() + Duration::from_secs(seconds)
}

pub fn statistic(driver: &Driver, key: &str) -> Option<String> {
    let text = driver.statistics();
    let found = text
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{key}=")));
    found.map(str::to_owned)
}

pub fn count(driver: &Driver, key: &str) -> u64 {
    statistic(driver, key).map_or(0, |text| text.parse().expect("a count"))
}

/// Where it listens.
pub fn address(driver: &Driver) -> SocketAddr {
    let limit = Instant::now() + Duration::from_secs(20);
    loop {
        if let Some(address) = statistic(driver, "address") {
            return address.parse().expect("an address");
        }
        assert!(Instant::now() < limit, "{}", driver.statistics());
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// What the process holds when the last peer is forgotten.
pub fn rest() -> Resources {
    Resources::settled(|| std::thread::sleep(Duration::from_millis(5)))
}

/// A sign of life for whoever watches a soak of hours.
pub struct Told(Instant);

impl Told {
    pub fn new() -> Self {
        Self(Instant::now())
    }

    /// Says how it goes, every 30 s.
    pub fn tell(&mut self, how: impl FnOnce() -> String) {
        if self.0.elapsed() > Duration::from_secs(30) {
            self.0 = Instant::now();
            println!("soak: {}, {:?}", how(), Resources::now());
        }
    }
}

/// Nothing has failed for a reason that no peer gives.
#[track_caller]
pub fn assert_all_explained(driver: &Driver) {
    for unexplained in [
        "link.failed",
        "cause.refused",
        "cause.defect",
        "cause.hung",
        "failed",
    ] {
        assert_eq!(
            count(driver, unexplained),
            0,
            "{unexplained}: {}",
            driver.statistics()
        );
    }
}
