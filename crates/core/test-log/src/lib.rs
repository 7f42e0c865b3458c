//! Makes a test process fail on any unexpected warning in the log.
//!
//! Most of these tests are about line states, which they check on the line itself. So changes of state are
//! always expected in the log, unless the cause is a defect, and so are injected faults and swallowed changes. Every other warning
//! must be [expected](expect).

use std::sync::{Mutex, MutexGuard, PoisonError};

/// The unexpected log of this process.
struct Ledger {
    /// Drivers that are open.
    open: usize,
    /// The part of tickbus whose messages count.
    part: &'static str,
    /// Texts of lines that may appear, and how many have.
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

/// True if a line reports a line state other than a defect, a fault that a test has injected, or what the steps of a test
/// have swallowed.
fn is_asked_for(line: &str) -> bool {
    let is_asked_for = [
        "\": injected fault \"",
        "changed and changed back",
        "were swallowed",
        "simulation ticks every",
    ];
    if is_asked_for.iter().any(|words| line.contains(words)) {
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

/// A warning with this text is part of a test.
pub fn expect(words: &'static str) {
    let mut ledger = ledger();
    ledger.unexpected.retain(|line| !line.contains(words));
    if !ledger.expected.iter().any(|(known, _)| *known == words) {
        ledger.expected.push((words, 0));
    }
}

/// How many warnings have matched the text of an [expectation](expect).
pub fn times(words: &str) -> u64 {
    let ledger = ledger();
    let mut expected = ledger.expected.iter();
    expected
        .find(|(known, _)| *known == words)
        .map_or(0, |(_, times)| *times)
}

/// An open driver. When none is left, nothing unexpected may have been logged.
pub struct Watch(());

impl Default for Watch {
    fn default() -> Self {
        Self::new()
    }
}

impl Watch {
    /// All of tickbus counts.
    pub fn new() -> Self {
        Self::over("tickbus")
    }

    /// For processes that also run tests of other parts of tickbus, whose messages are not checked.
    pub fn over(part: &'static str) -> Self {
        // Fails if another test was first, or if the process has its own logger.
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
