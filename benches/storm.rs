//! The tick while a peer opens 10,000 connections in 3 s without sending anything, and the same while stderr
//! is not read.
//!
//! Three alternating phases in several rounds of one run: quiet, storm, and storm with stderr on a full pipe.
//! Each tick is timed on its own; p99.9 and the maximum are medians over the rounds. Prints one `rust NAME
//! VALUE` per line on stdout. The counted log lines are those that reached the log of the process, whether or
//! not they were dropped after that.
#![allow(missing_docs, reason = "a bench")]

#[cfg(unix)]
#[path = "../tests/peers/full_pipe.rs"]
mod full_pipe;

#[cfg(unix)]
fn main() {
    storm::main();
}

#[cfg(not(unix))]
fn main() {
    println!("the storm needs the pipes of Unix");
}

#[cfg(unix)]
mod storm {
    use std::net::{SocketAddr, TcpStream};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::{Duration, Instant};

    use tickbus::driver::Driver;
    use tickbus::driver_cfg::Config;
    use tickbus::time::{Clock, Monotonic, Nanos, Pace, Stop, TimeHistogram};

    use super::full_pipe::full_pipe;

    /// The time between two ticks.
    const TICK: Nanos = Nanos::from_micros(100);
    /// Connections per second.
    const RATE: u32 = 10_000 / 3;

    pub(super) fn main() {
        // `cargo bench` passes this; `cargo test` only checks that the bench runs.
        let measured = std::env::args().any(|argument| argument == "--bench");
        let (rounds, span) = if measured {
            (7, Duration::from_secs(3))
        } else {
            (1, Duration::from_millis(50))
        };
        tickbus::os::log_to_stderr(log::LevelFilter::Warn);
        let (mut driver, address) = device();
        let stderr = rustix::io::dup(rustix::stdio::stderr()).expect("it is open");
        let (_reader, full) = full_pipe();
        let mut phases = [
            Phase::new("quiet", false),
            Phase::new("open", true),
            Phase::new("blocked", true),
        ];
        for _ in 0..rounds {
            for phase in &mut phases {
                if phase.name == "blocked" {
                    rustix::stdio::dup2_stderr(&full).expect("both are open");
                }
                phase.run(&mut driver, address, span);
            }
            let begin = Instant::now();
            std::hint::black_box(driver.statistics());
            phases[2].statistics.push(micros(begin.elapsed()));
            rustix::stdio::dup2_stderr(&stderr).expect("both are open");
        }
        let quiet = median(&mut phases[0].tails);
        for phase in &mut phases {
            let (name, tail) = (phase.name, median(&mut phase.tails));
            println!("rust storm.{name}.tick_p999_us {tail:.1}");
            println!(
                "rust storm.{name}.tick_max_us {:.1}",
                median(&mut phase.most)
            );
            if phase.storms {
                println!("rust storm.{name}.ratio {:.2}", tail / quiet);
                println!("rust storm.{name}.connections {}", phase.connections);
            }
        }
        println!(
            "rust storm.blocked.statistics_us {:.1}",
            median(&mut phases[2].statistics)
        );
        let text = driver.statistics();
        for key in ["cause.left", "log.untold", "log.dropped"] {
            let found = text
                .lines()
                .find_map(|line| line.strip_prefix(&format!("{key}=")));
            println!("rust storm.{key} {}", found.unwrap_or("0"));
        }
        driver.close();
    }

    struct Phase {
        name: &'static str,
        storms: bool,
        /// p99.9 and maximum of each round, in microseconds.
        tails: Vec<f64>,
        most: Vec<f64>,
        statistics: Vec<f64>,
        connections: u64,
    }

    impl Phase {
        fn new(name: &'static str, storms: bool) -> Self {
            Self {
                name,
                storms,
                tails: Vec::new(),
                most: Vec::new(),
                statistics: Vec::new(),
                connections: 0,
            }
        }

        fn run(&mut self, driver: &mut Driver, address: SocketAddr, span: Duration) {
            let over = AtomicBool::new(false);
            std::thread::scope(|scope| {
                let storm = self.storms.then(|| scope.spawn(|| storm(address, &over)));
                let ticks = tick(driver, span);
                over.store(true, Ordering::Relaxed);
                self.connections += storm.map_or(0, |storm| storm.join().expect("no panic"));
                self.tails.push(ticks.quantile(0.999).as_micros());
                self.most.push(ticks.quantile(1.0).as_micros());
            });
        }
    }

    /// A device that sends nothing until it receives something, and its address.
    fn device() -> (Driver, SocketAddr) {
        let text = "[driver]\nid = 1\nname = \"stormed\"\n[fieldbus]\nkind = \"socket\"\n\
                    address = \"127.0.0.1:0\"\nsend = \"reply\"\n\
                    [[signal]]\nname = \"in\"\naddress = \"%IW0\"\n\
                    [[signal]]\nname = \"out\"\naddress = \"%QW0\"\n";
        let config = Config::parse("driver.cfg", text, &tickbus::KINDS)
            .unwrap_or_else(|why| panic!("{why}"));
        let clock = Monotonic::shared();
        let driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
        loop {
            let statistics = driver.statistics();
            let mut lines = statistics.lines();
            if let Some(address) = lines.find_map(|line| line.strip_prefix("address=")) {
                return (driver, address.parse().expect("an address"));
            }
            std::thread::yield_now();
        }
    }

    /// Connects and closes at its rate; returns how many times.
    fn storm(address: SocketAddr, over: &AtomicBool) -> u64 {
        let begin = Instant::now();
        let mut connections = 0_u32;
        while !over.load(Ordering::Relaxed) {
            let due = begin + Duration::from_secs(1) * connections / RATE;
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            drop(TcpStream::connect(address));
            connections += 1;
        }
        connections.into()
    }

    /// Ticks at a fixed interval for `span`; returns how long each exchange took.
    fn tick(driver: &mut Driver, span: Duration) -> TimeHistogram {
        let clock = Monotonic::shared();
        let mut slots = driver.initial_slots();
        let (begin, stop) = (Instant::now(), Stop::new());
        let mut pace = Pace::new(clock.now(), TICK);
        let mut spans = TimeHistogram::new();
        while begin.elapsed() < span {
            if pace.take(clock.now()) {
                let begin = Instant::now();
                driver.exchange(Nanos::ZERO, &mut slots);
                let span = i64::try_from(begin.elapsed().as_nanos()).unwrap_or(i64::MAX);
                spans.record(Nanos(span));
            }
            clock.wait_until(pace.due(), &stop);
        }
        spans
    }

    fn micros(span: Duration) -> f64 {
        span.as_secs_f64() * 1e6
    }

    fn median(values: &mut [f64]) -> f64 {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    }
}
