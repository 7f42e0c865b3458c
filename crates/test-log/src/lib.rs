//! What the log has been told: a warning that no test has asked for fails the process of the tests.
//!
//! What happens to a line is what most of these tests are about, and they ask the line itself. So its state is expected
//! in the log, unless it is a defect, and so is a fault that was injected. Every other warning has to be
//! [expected](expect).

use std::sync::{Mutex, MutexGuard, PoisonError};

/// The log of this process, as far as it is not expected yet.
struct Ledger {
    /// Drivers that are open.
    open: usize,
    /// The part of tickbus whose messages count.
    part: &'static str,
    /// Words of lines that may come, and how many have.
    expected: Vec<(&'static str, u64)>,
    unexpected: Vec<String>,
}

static LEDGER: Mutex<Ledger> = Mutex::new(Ledger {
    open: 0,
    part: "tickbus",
    expected: Vec::new(),
    unexpected: Vec::new(),
});

fn ledger() -> MutexGuard<'static, Ledger> {
    LEDGER.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Logger;

impl log::Log for Logger {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.target().starts_with("tickbus")
    }

    fn log(&self, record: &log::Record<'_>) {
        let mut ledger = ledger();
        if record.level() > log::Level::Warn || !record.target().starts_with(ledger.part) {
            return;
        }
        let line = record.args().to_string();
        if !ledger.expects(&line) && !is_asked_for(&line) {
            ledger.unexpected.push(line);
        }
    }

    fn flush(&self) {}
}

impl Ledger {
    fn expects(&mut self, line: &str) -> bool {
        let mut expected = self.expected.iter_mut();
        let found = expected.find(|(words, _)| line.contains(words));
        found.map(|(_, times)| *times += 1).is_some()
    }
}

/// Whether it tells the state of a driver's line, and no defect; or a fault that a test has injected.
fn is_asked_for(line: &str) -> bool {
    if line.contains("\": injected fault \"") {
        return true;
    }
    let state = line
        .strip_prefix("driver \"")
        .and_then(|rest| rest.split_once("\" is "))
        .and_then(|(_, rest)| rest.split_once(": "));
    state.is_some_and(|(state, reason)| {
        ["opening", "stale", "failed"].contains(&state) && !reason.contains("panicked")
    })
}

/// A warning with these words is part of a test.
pub fn expect(words: &'static str) {
    let mut ledger = ledger();
    ledger.unexpected.retain(|line| !line.contains(words));
    if !ledger.expected.iter().any(|(known, _)| *known == words) {
        ledger.expected.push((words, 0));
    }
}

/// How many warnings have come with the words of an [expectation](expect).
pub fn times(words: &str) -> u64 {
    let ledger = ledger();
    let mut expected = ledger.expected.iter();
    expected
        .find(|(known, _)| *known == words)
        .map_or(0, |(_, times)| *times)
}

/// An open driver. When none is left, nothing unexpected may have been logged.
pub struct Watch(());

impl Watch {
    /// All of tickbus counts.
    pub fn new() -> Self {
        Self::over("tickbus")
    }

    /// Where tests of other parts of tickbus run in the same process, and nobody looks after what they log.
    pub fn over(part: &'static str) -> Self {
        // It fails where another test was first, or the process has a logger of its own.
        if log::set_logger(&Logger).is_ok() {
            log::set_max_level(log::LevelFilter::Warn);
        }
        let mut ledger = ledger();
        ledger.open += 1;
        ledger.part = part;
        drop(ledger);
        Self(())
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        let unexpected = {
            let mut ledger = ledger();
            ledger.open -= 1;
            if ledger.open > 0 {
                return;
            }
            std::mem::take(&mut ledger.unexpected)
        };
        if !std::thread::panicking() {
            assert!(
                unexpected.is_empty(),
                "warnings that no test of this process expects (logged::expect): {unexpected:#?}"
            );
        }
    }
}
