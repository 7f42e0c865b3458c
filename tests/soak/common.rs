//! The common parts of the soaks: their duration, requests to a driver, and checks of its state.

use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use socket2::SockRef;
use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::time::Monotonic;
pub use tickbus_conformance::resources::Resources;
pub use tickbus_conformance::rig::{address, eventually, statistic};

/// The end of the soak: some seconds from now, or as requested by `make soak`.
pub fn end() -> Instant {
    let seconds = std::env::var("TICKBUS_SOAK_SECONDS").map_or(5, |text| {
        text.parse().expect("TICKBUS_SOAK_SECONDS is a number")
    });
    Instant::now() + Duration::from_secs(seconds)
}

/// Opens the driver of a driver.cfg, in real time.
pub fn open(text: &str) -> Driver {
    let config =
        Config::parse("soak.cfg", text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"));
    Driver::open(config, Monotonic::shared() as Arc<Monotonic>).expect("opens")
}

/// A connection as the peer of a driver.
pub fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).expect("it listens");
    stream.set_nodelay(true).expect("a socket option");
    let limit = Some(Duration::from_secs(20));
    stream.set_read_timeout(limit).expect("a socket option");
    stream
}

/// Lets a connection end by a reset; unread bytes would cause one as well, but not at once.
pub fn reset(stream: &TcpStream) {
    let socket = SockRef::from(stream);
    let at_once = Some(Duration::ZERO);
    socket.set_linger(at_once).expect("a socket option");
}

pub fn count(driver: &Driver, key: &str) -> u64 {
    statistic(driver, key).map_or(0, |text| text.parse().expect("a count"))
}

/// The resources of the process when the last peer is forgotten. A server of OPC UA can take longer for that than resources take
/// to settle, so they are compared with those of a moment later.
pub fn rest() -> Resources {
    let limit = Instant::now() + Duration::from_secs(10);
    let mut before = Resources::settled(|| {});
    loop {
        std::thread::sleep(Duration::from_millis(300));
        let now = Resources::settled(|| {});
        if now == before || Instant::now() > limit {
            return now;
        }
        before = now;
    }
}

/// A sign of life in soaks that last for hours.
pub struct Told(Instant);

impl Told {
    pub fn new() -> Self {
        Self(Instant::now())
    }

    /// Reports the progress, every 30 s.
    pub fn tell(&mut self, how: impl FnOnce() -> String) {
        if self.0.elapsed() > Duration::from_secs(30) {
            self.0 = Instant::now();
            println!("soak: {}, {:?}", how(), Resources::now());
        }
    }
}

/// Checks that every failure has a reason that a peer gave.
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
