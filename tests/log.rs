//! The log: logging never waits for a reader, and no peer can fill the log.
#![cfg(unix)]
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

#[path = "peers/full_pipe.rs"]
mod full_pipe;

use std::io::Read as _;
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use full_pipe::full_pipe;
use tickbus::time::Monotonic;
use tickbus_conformance::rig::{End, await_that};

const DEVICE: &str = "[driver]\nid = 1\nname = \"stormed\"\n[fieldbus]\nkind = \"socket\"\n\
                      address = \"127.0.0.1:0\"\nsend = \"reply\"\n[[signal]]\nname = \"in\"\naddress = \"%IB0\"\n\
                      [[signal]]\nname = \"out\"\naddress = \"%QB0\"\n";

/// A device that listens, on the clock of the system, and its address.
fn device() -> (End, SocketAddr) {
    let clock = Monotonic::shared();
    let end = End::open(DEVICE, &clock, &tickbus::KINDS);
    let mut address = None;
    await_that("it listens", || {
        let text = end.driver.statistics();
        let line = text.lines().find_map(|line| line.strip_prefix("address="));
        address = line.map(|line| line.parse().expect("an address"));
        address.is_some()
    });
    (end, address.expect("it was waited for"))
}

/// Connects and disconnects until this many clients were served and have left.
fn storm(end: &End, address: SocketAddr, times: u64) {
    let left = || number(end, "cause.left");
    while left() < times {
        for _ in 0..50 {
            drop(TcpStream::connect(address).expect("it listens"));
        }
    }
}

/// The value of a counter in the statistics; 0 if it is absent.
fn number(end: &End, key: &str) -> u64 {
    let text = end.driver.statistics();
    let found = text
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{key}=")));
    found.map_or(0, |count| count.parse().expect("a number"))
}

/// Kills a child process that hangs.
struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        // Both fail if it has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Marks a process as the child of a test.
const MARK: &str = "TICKBUS_TEST_STDERR_IS_FULL";

#[test]
fn ticks_statistics_and_closing_go_on_though_nobody_reads_stderr() {
    if std::env::var_os(MARK).is_some() {
        return with_a_full_stderr();
    }
    let (_reader, writer) = full_pipe();
    let name = "ticks_statistics_and_closing_go_on_though_nobody_reads_stderr";
    let child = Command::new(std::env::current_exe().expect("the test's own file"))
        .args([name, "--exact", "--test-threads=1", "--nocapture"])
        .env(MARK, "1")
        .env("TICKBUS_LOG", "debug")
        .stdout(Stdio::piped())
        .stderr(Stdio::from(writer))
        .spawn()
        .expect("the test's own file runs");
    let mut child = Killed(child);
    let limit = Instant::now() + Duration::from_secs(60);
    let status = loop {
        if let Some(status) = child.0.try_wait().expect("it was started") {
            break status;
        }
        assert!(
            Instant::now() < limit,
            "it is held up by a stderr that nobody reads"
        );
        std::thread::yield_now();
    };
    let mut told = String::new();
    let out = child.0.stdout.as_mut().expect("it is ours");
    out.read_to_string(&mut told).expect("text");
    assert!(status.success() && told.contains("1 passed"), "{told}");
}

fn with_a_full_stderr() {
    tickbus::os::log_to_stderr(log::LevelFilter::Warn);
    let (mut end, address) = device();
    storm(&end, address, 100);
    // More than the queue holds.
    let line = "x".repeat(1000);
    for _ in 0..1000 {
        log::warn!(target: "tickbus", "{line}");
    }
    let before = number(&end, "ticks");
    for _ in 0..1000 {
        end.tick();
    }
    assert_eq!(number(&end, "ticks"), before + 1000);
    assert!(
        number(&end, "log.dropped") > 500,
        "what has no room is counted"
    );
    storm(&end, address, 200);
    end.driver.close();
}

/// The messages logged, with their levels.
static LOGGED: Mutex<Vec<(log::Level, String)>> = Mutex::new(Vec::new());

struct Logger;

impl log::Log for Logger {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        let line = (record.level(), record.args().to_string());
        LOGGED.lock().expect("no panic").push(line);
    }

    fn flush(&self) {}
}

#[test]
fn a_storm_of_connections_gives_a_bounded_number_of_log_lines() {
    if std::env::var_os(MARK).is_some() {
        return;
    }
    log::set_boxed_logger(Box::new(Logger)).expect("the only one");
    log::set_max_level(log::LevelFilter::Info);
    let (end, address) = device();
    // Some messages are still on their way when the counters are read: too few to pass the next power of two.
    storm(&end, address, 1500);
    let (left, untold) = (number(&end, "cause.left"), number(&end, "log.untold"));
    end.driver.close();
    let logged = LOGGED.lock().expect("no panic");
    let left_at_once = "driver \"stormed\" is opening: the peer left: ";
    let lines = logged.iter().map(|(_, line)| line);
    let lines: Vec<&String> = lines
        .filter(|line| line.starts_with(left_at_once))
        .collect();
    assert!(left >= 1500 && untold >= 1400, "{left}, {untold}");
    // The first 20, and 32, 64, ... up to the number of messages.
    let most = 20 + (left.ilog2() as usize).saturating_sub(4);
    assert!((20..=most).contains(&lines.len()), "{lines:#?}");
    let last = lines.last().expect("there are some");
    let ends = last.ends_with(" times so far; told more rarely from now on)");
    assert!(ends, "{last}");
    // Connecting, leaving, being turned away, and the end of the line.
    assert!(logged.len() <= 3 * (most + 2), "{}", logged.len());
}
