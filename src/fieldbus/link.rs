//! How a line is doing: its state, the cause of that, and the reason in words.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::os::one_line;
use crate::time::{Nanos, Spans};

use super::BusError;

/// How a line is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LinkState {
    /// Not open.
    Closed,
    /// Trying to reach the peer, or waiting for it.
    Opening,
    /// The peer is there.
    Running,
    /// The peer was there, and nothing that counts has come from it for longer than `max_age`.
    Stale,
    /// The line broke; it is tried again after a pause.
    Failed,
}

impl LinkState {
    /// All of them; each one's code is its place here.
    pub const ALL: [Self; 5] = [
        Self::Closed,
        Self::Opening,
        Self::Running,
        Self::Stale,
        Self::Failed,
    ];

    /// The state's name, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Opening => "opening",
            Self::Running => "running",
            Self::Stale => "stale",
            Self::Failed => "failed",
        }
    }
}

/// Why a line is in its state, for programs; the reason in words is for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// It was not opened yet.
    NotOpened,
    /// It is on its way, or waits for its peer.
    Waiting,
    /// All is well.
    Running,
    /// The peer is silent.
    Silent,
    /// The peer left in good order.
    Left,
    /// The line is broken, or was never there.
    Link,
    /// The peer broke the protocol.
    Protocol,
    /// The peer refused.
    Refused,
    /// A defect of tickbus itself.
    Defect,
    /// A call into a library does not return.
    Hung,
    /// It was closed.
    Closed,
    /// A fault was injected, and holds the line down.
    Injected,
    /// The PLC does not run its program.
    Stopped,
    /// A signal that has to change does not.
    Frozen,
}

impl Cause {
    /// All of them; each one's code is its place here.
    pub const ALL: [Self; 14] = [
        Self::NotOpened,
        Self::Waiting,
        Self::Running,
        Self::Silent,
        Self::Left,
        Self::Link,
        Self::Protocol,
        Self::Refused,
        Self::Defect,
        Self::Hung,
        Self::Closed,
        Self::Injected,
        Self::Stopped,
        Self::Frozen,
    ];

    /// The cause's name, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotOpened => "not-opened",
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Silent => "silent",
            Self::Left => "left",
            Self::Link => "link",
            Self::Protocol => "protocol",
            Self::Refused => "refused",
            Self::Defect => "defect",
            Self::Hung => "hung",
            Self::Closed => "closed",
            Self::Injected => "injected",
            Self::Stopped => "stopped",
            Self::Frozen => "frozen",
        }
    }
}

impl From<&BusError> for Cause {
    fn from(error: &BusError) -> Self {
        match error {
            BusError::Link(_) => Self::Link,
            BusError::Left(_) => Self::Left,
            BusError::Protocol(_) => Self::Protocol,
            BusError::Refused(_) => Self::Refused,
        }
    }
}

/// State, cause and reason at one moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Link {
    /// How the line is doing.
    pub state: LinkState,
    /// Why, for programs.
    pub cause: Cause,
    /// Why, for people; one line.
    pub reason: String,
    /// When it came into this state.
    pub since: Nanos,
}

/// The state of a line as bus and driver share it.
#[derive(Clone, Debug)]
pub struct LinkStatus(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    driver: String,
    max_age: Nanos,
    /// The record's state once more, to be read without its lock.
    state: AtomicU8,
    record: Mutex<Record>,
}

#[derive(Debug)]
struct Record {
    link: Link,
    /// Why the line was running, for when it does so again.
    running: String,
    call: Option<Call>,
    /// The injected faults of the line that are active, in words.
    injected: String,
    /// Why data that arrive do not count; `None` while they do.
    doubt: Option<(Cause, String)>,
    /// What a call that hangs interrupted.
    before_hang: Option<Link>,
    /// How often each state was entered, and each cause given.
    entered: [u64; LinkState::ALL.len()],
    caused: [u64; Cause::ALL.len()],
    facts: BTreeMap<Cow<'static, str>, String>,
    counts: BTreeMap<&'static str, u64>,
    cycle: Spans,
}

/// A call into a library that is under way.
#[derive(Clone, Debug)]
struct Call {
    what: Arc<str>,
    since: Nanos,
    limit: Nanos,
}

impl Record {
    /// Whether a call lasts longer than it may.
    fn is_hung(&self, now: Nanos) -> bool {
        self.call
            .as_ref()
            .is_some_and(|call| now - call.since > call.limit)
    }
}

impl LinkStatus {
    /// The state of the line of the driver called `driver`, which is closed so far. Data older than
    /// `max_age` make it stale.
    pub fn new(driver: &str, max_age: Nanos) -> Self {
        let link = Link {
            state: LinkState::Closed,
            cause: Cause::NotOpened,
            reason: "not opened yet".to_owned(),
            since: Nanos::ZERO,
        };
        Self(Arc::new(Shared {
            driver: driver.to_owned(),
            max_age,
            state: AtomicU8::new(0),
            record: Mutex::new(Record {
                link,
                running: String::new(),
                call: None,
                injected: String::new(),
                doubt: None,
                before_hang: None,
                entered: [0; LinkState::ALL.len()],
                caused: [0; Cause::ALL.len()],
                facts: BTreeMap::new(),
                counts: BTreeMap::new(),
                cycle: Spans::new(),
            }),
        }))
    }

    /// The driver whose line it is.
    pub fn driver(&self) -> &str {
        &self.0.driver
    }

    /// The injected faults of the line that are active, in words; empty for none. A reason of silence tells
    /// of them.
    pub fn injected(&self, faults: &str) {
        let injected = &mut self.lock().injected;
        injected.clear();
        injected.push_str(faults);
    }

    /// The limit of age.
    pub fn max_age(&self) -> Nanos {
        self.0.max_age
    }

    /// The state as it was entered last, without a lock.
    pub fn state(&self) -> LinkState {
        LinkState::ALL[usize::from(self.0.state.load(Ordering::Relaxed)) % LinkState::ALL.len()]
    }

    /// How often the line came up.
    pub fn runs(&self) -> u64 {
        self.lock().entered[LinkState::Running as usize]
    }

    /// State, cause and reason as they were entered last.
    pub fn link(&self) -> Link {
        self.lock().link.clone()
    }

    /// Enters a state at `now`; entering the present one with the same reason does nothing.
    pub fn enter(&self, now: Nanos, state: LinkState, cause: Cause, reason: &str) {
        self.0.enter(&mut self.lock(), now, state, cause, reason);
    }

    /// The peer is there. A line that is running or stale stays so.
    pub fn running(&self, now: Nanos, reason: &str) {
        if matches!(self.state(), LinkState::Running | LinkState::Stale) {
            return;
        }
        let mut record = self.lock();
        reason.clone_into(&mut record.running);
        let (state, cause) = (LinkState::Running, Cause::Running);
        self.0.enter(&mut record, now, state, cause, reason);
        if let Some((cause, reason)) = record.doubt.clone() {
            self.0
                .enter(&mut record, now, LinkState::Stale, cause, &reason);
        }
    }

    /// Data that arrive do not count, for a cause and a reason in words, or they do again (`None`). A line that is
    /// running is stale meanwhile; one that is not will be when it comes up.
    pub fn doubt(&self, now: Nanos, doubt: Option<(Cause, String)>) {
        let mut record = self.lock();
        let before = std::mem::replace(&mut record.doubt, doubt);
        if !matches!(record.link.state, LinkState::Running | LinkState::Stale) {
            return;
        }
        let (state, cause, reason) = match (record.doubt.clone(), before) {
            (Some((cause, reason)), _) => (LinkState::Stale, cause, reason),
            (None, Some((cause, _))) if record.link.cause == cause => {
                (LinkState::Running, Cause::Running, record.running.clone())
            }
            (None, _) => return,
        };
        self.0.enter(&mut record, now, state, cause, &reason);
    }

    /// Looks at the clock: a running line whose newest data are `age` old becomes stale or, when the data
    /// are young again, running. Lock-free unless something changes.
    pub fn observe(&self, now: Nanos, age: Nanos) {
        match self.state() {
            LinkState::Running if age > self.0.max_age => {}
            LinkState::Stale if age <= self.0.max_age => {}
            _ => return,
        }
        let mut record = self.lock();
        let silence = age.min(now - record.link.since);
        match record.link.state {
            // A line that has only just come up may still have the old data.
            LinkState::Running if silence > self.0.max_age => {
                let mut reason = format!(
                    "nothing has come from the peer for {}; the limit is max_age = {}",
                    silence.rounded(),
                    self.0.max_age
                );
                if !record.injected.is_empty() {
                    let _ = write!(reason, "; injected fault: {}", record.injected);
                }
                let (state, cause) = (LinkState::Stale, Cause::Silent);
                self.0.enter(&mut record, now, state, cause, &reason);
            }
            LinkState::Stale
                if age <= self.0.max_age && record.doubt.is_none() && !record.is_hung(now) =>
            {
                let reason = record.running.clone();
                let (state, cause) = (LinkState::Running, Cause::Running);
                self.0.enter(&mut record, now, state, cause, &reason);
            }
            _ => {}
        }
    }

    /// Looks whether a call into a library lasts longer than it may. For those who ask from outside: the
    /// bus itself cannot, while it is in the call.
    pub fn observe_call(&self, now: Nanos) {
        let mut record = self.lock();
        if let Some(call) = &record.call
            && record.is_hung(now)
        {
            let reason = format!(
                "{} has not returned for {}; it may take {}",
                call.what,
                (now - call.since).rounded(),
                call.limit
            );
            if record.link.cause != Cause::Hung {
                record.before_hang = Some(record.link.clone());
            }
            let (state, cause) = (LinkState::Stale, Cause::Hung);
            self.0.enter(&mut record, now, state, cause, &reason);
        }
    }

    /// A call into a library begins, and may last for `limit`.
    pub fn call_begins(&self, now: Nanos, what: &Arc<str>, limit: Nanos) {
        self.lock().call = Some(Call {
            what: Arc::clone(what),
            since: now,
            limit,
        });
    }

    /// The call has returned. A line that was waiting for its peer when the call hung waits on; one that was
    /// running stays stale until the peer is heard of.
    pub fn call_ends(&self, now: Nanos) {
        let mut record = self.lock();
        let call = record.call.take();
        if record.link.cause != Cause::Hung {
            return;
        }
        let before = record.before_hang.take();
        if let Some(link) = before.filter(|link| link.state == LinkState::Opening) {
            self.0
                .enter(&mut record, now, link.state, link.cause, &link.reason);
        } else if let Some(call) = call {
            let reason = format!(
                "{} returned after {}, and nothing has come from the peer since",
                call.what,
                (now - call.since).rounded()
            );
            let (state, cause) = (LinkState::Stale, Cause::Silent);
            self.0.enter(&mut record, now, state, cause, &reason);
        }
    }

    /// Notes a fact for the statistics, such as the address that was bound.
    pub fn tell(&self, key: impl Into<Cow<'static, str>>, fact: &str) {
        self.lock().facts.insert(key.into(), one_line(fact));
    }

    /// Counts something for the statistics.
    pub fn count(&self, key: &'static str) {
        *self.lock().counts.entry(key).or_default() += 1;
    }

    /// A bus cycle was `span` long.
    pub fn cycle(&self, span: Nanos) {
        self.lock().cycle.record(span);
    }

    /// Appends what is known of the line, one `key=value` a line.
    pub fn write(&self, now: Nanos, text: &mut String) {
        let record = self.lock();
        let link = &record.link;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "state={}", link.state.name());
        let _ = writeln!(text, "state.code={}", link.state as u8);
        let _ = writeln!(text, "cause={}", link.cause.name());
        let _ = writeln!(text, "cause.code={}", link.cause as u8);
        let _ = writeln!(text, "reason={}", link.reason);
        let _ = writeln!(
            text,
            "state.for_s={:.3}",
            (now - link.since).as_micros() / 1e6
        );
        let _ = writeln!(text, "max_age={}", self.0.max_age);
        for (key, fact) in &record.facts {
            let _ = writeln!(text, "{key}={fact}");
        }
        for (state, count) in LinkState::ALL.iter().zip(record.entered) {
            let _ = writeln!(text, "link.{}={count}", state.name());
        }
        for (cause, count) in Cause::ALL.iter().zip(record.caused) {
            if count > 0 {
                let _ = writeln!(text, "cause.{}={count}", cause.name());
            }
        }
        for (key, count) in &record.counts {
            let _ = writeln!(text, "{key}={count}");
        }
        record.cycle.write("bus_cycle", text);
    }

    fn lock(&self) -> MutexGuard<'_, Record> {
        // Every change leaves a record that can be read.
        self.0.record.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shared {
    fn enter(&self, record: &mut Record, now: Nanos, state: LinkState, cause: Cause, reason: &str) {
        let link = &mut record.link;
        let reason = one_line(reason);
        if (link.state, link.cause) == (state, cause) {
            // A state that only tells it in other words, such as how long it has lasted, goes on.
            link.reason = reason;
            return;
        }
        let trouble = matches!(state, LinkState::Stale | LinkState::Failed)
            || (state == LinkState::Opening && cause != Cause::Waiting);
        let level = if trouble {
            log::Level::Warn
        } else {
            log::Level::Info
        };
        log::log!(
            level,
            "driver \"{}\" is {}: {reason}",
            self.driver,
            state.name()
        );
        *link = Link {
            state,
            cause,
            reason,
            since: now,
        };
        record.entered[state as usize] += 1;
        record.caused[cause as usize] += 1;
        self.state.store(state as u8, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAX_AGE: Nanos = Nanos::from_millis(100);

    fn at(millis: i64) -> Nanos {
        Nanos::from_millis(millis)
    }

    #[test]
    fn names_and_codes_are_told_apart() {
        for (code, state) in LinkState::ALL.iter().enumerate() {
            assert_eq!(*state as usize, code);
        }
        for (code, cause) in Cause::ALL.iter().enumerate() {
            assert_eq!(*cause as usize, code);
        }
    }

    #[test]
    fn a_running_line_becomes_stale_and_running_again_by_age_alone() {
        let status = LinkStatus::new("test", MAX_AGE);
        status.running(at(1000), "the peer is there");
        // Data of an earlier peer, or none at all: it has the time to send its first.
        status.observe(at(1100), Nanos::MAX);
        assert_eq!(status.state(), LinkState::Running);
        status.observe(at(1101), Nanos::MAX);
        let link = status.link();
        assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Silent));
        assert_eq!(
            link.reason,
            "nothing has come from the peer for 101ms; the limit is max_age = 100ms"
        );
        status.running(at(1102), "the peer is there");
        assert_eq!(
            status.state(),
            LinkState::Stale,
            "being there is not enough"
        );
        status.observe(at(1103), at(3));
        let link = status.link();
        assert_eq!(link.state, LinkState::Running);
        assert_eq!(link.reason, "the peer is there");
    }

    #[test]
    fn a_call_that_does_not_return_is_told() {
        let status = LinkStatus::new("test", MAX_AGE);
        status.running(at(0), "the peer is there");
        status.call_begins(at(10), &"exchange() of libx.so".into(), at(50));
        status.observe_call(at(60));
        assert_eq!(status.state(), LinkState::Running);
        status.observe_call(at(3210));
        let link = status.link();
        assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Hung));
        assert_eq!(
            link.reason,
            "exchange() of libx.so has not returned for 3200ms; it may take 50ms"
        );
        status.call_ends(at(3211));
        let link = status.link();
        assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Silent));
        status.observe(at(3211), at(1));
        assert_eq!(status.state(), LinkState::Running);
        assert_eq!(status.link().reason, "the peer is there");
    }

    #[test]
    fn a_line_that_waited_when_a_call_hung_waits_on() {
        let status = LinkStatus::new("test", MAX_AGE);
        let (state, cause) = (LinkState::Opening, Cause::Waiting);
        status.enter(at(0), state, cause, "waiting for the peer");
        status.call_begins(at(10), &"exchange() of libx.so".into(), at(50));
        status.observe_call(at(100));
        status.observe_call(at(200));
        assert_eq!(status.link().cause, Cause::Hung);
        status.call_ends(at(210));
        let link = status.link();
        assert_eq!((link.state, link.cause), (state, cause));
        assert_eq!(link.reason, "waiting for the peer");
        status.running(at(211), "the peer is there");
        assert_eq!(status.link().reason, "the peer is there");
    }

    #[test]
    fn statistics_have_one_line_per_key_whatever_the_reason_says() {
        let status = LinkStatus::new("test", MAX_AGE);
        let (state, cause) = (LinkState::Failed, Cause::Defect);
        status.enter(
            at(5),
            state,
            cause,
            "assertion failed\n  left: 1\n right: 2",
        );
        status.tell("address", "127.0.0.1:5");
        status.count("socket.turned_away");
        let mut text = String::new();
        status.write(at(1005), &mut text);
        assert!(
            text.starts_with(
                "state=failed\nstate.code=4\ncause=defect\ncause.code=8\n\
                 reason=assertion failed left: 1 right: 2\nstate.for_s=1.000\nmax_age=100ms\naddress=127.0.0.1:5\n"
            ),
            "{text}"
        );
        assert!(text.contains("\nlink.failed=1\ncause.defect=1\nsocket.turned_away=1\n"));
        assert!(text.lines().all(|line| line.contains('=')), "{text}");
    }
}
