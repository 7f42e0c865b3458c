//! The state of a line, its cause, and the reason in words.

mod journal;

use std::collections::BTreeMap;
use std::fmt::{Arguments, Write as _};
use std::sync::atomic::{AtomicU8, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::os::one_line;
use tickbus_base::statistics::{Key, Statistics};
use tickbus_base::time::{Nanos, SharedHistogram};

use super::BusError;
use super::max_age::MaxAge;
use super::rarely::Rarely;
use super::traffic::{Rates, Traffic};
use journal::Journal;
pub use journal::LineEvent;
use tickbus_image::is_stale;

/// The state of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LinkState {
    /// Not open.
    Closed,
    /// Connecting to the peer, or waiting for it.
    Opening,
    /// The peer is present.
    Running,
    /// The peer was present, but no valid data have come from it for longer than `max_age`.
    Stale,
    /// The line broke; the bus retries after a pause.
    Failed,
}

impl LinkState {
    /// All states; the code of each is its index here.
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

/// The cause of a line's state, as a code for programs; the reason in words is for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// The line was not opened yet.
    NotOpened,
    /// Connecting, or waiting for the peer.
    Waiting,
    /// Nothing is wrong.
    Running,
    /// The peer is silent.
    Silent,
    /// The peer closed the connection properly.
    Left,
    /// The line is broken, or was never up.
    Link,
    /// The peer violated the protocol.
    Protocol,
    /// The peer refused a request.
    Refused,
    /// A defect in tickbus itself.
    Defect,
    /// A call into a library does not return.
    Hung,
    /// The line was closed.
    Closed,
    /// An injected fault holds the line down.
    Injected,
    /// The PLC does not run its program.
    Stopped,
    /// A signal that should keep changing does not.
    Frozen,
}

impl Cause {
    /// All causes; the code of each is its index here.
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

/// State, cause and reason at a moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Link {
    /// The state of the line.
    pub state: LinkState,
    /// The cause, for programs.
    pub cause: Cause,
    /// The reason in words, for people; one line.
    pub reason: String,
    /// When the line entered this state.
    pub since: Nanos,
}

/// The state of a line, shared by bus and driver.
#[derive(Clone, Debug)]
pub struct LinkStatus(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    driver: String,
    max_age: MaxAge,
    /// The names of the stations, if there are several.
    stations: Vec<String>,
    /// A copy of the record's state that can be read without the lock.
    state: AtomicU8,
    /// How many stations were stale when the reason was written.
    stale: AtomicUsize,
    /// The times from one bus cycle to the next.
    cycle: SharedHistogram,
    /// How old the values of this end were when the bus took them.
    sent_age: SharedHistogram,
    traffic: Traffic,
    record: Mutex<Record>,
}

#[derive(Debug)]
struct Record {
    link: Link,
    journal: Journal,
    /// The reason of the last running state, to be restored when the line runs again.
    running: String,
    call: Option<Call>,
    /// The active line faults, as text.
    injected: String,
    /// The cause and reason for invalid data; `None` while all are valid.
    doubt: Option<(Cause, String)>,
    /// The state that a hanging call interrupted.
    before_hang: Option<Link>,
    /// How often each state was entered, and how often each cause occurred.
    entered: [u64; LinkState::ALL.len()],
    caused: [u64; Cause::ALL.len()],
    facts: BTreeMap<Key, String>,
    counts: BTreeMap<&'static str, u64>,
    rates: Rates,
    /// The counts of logged messages.
    log: Rarely,
}

/// A library call in progress.
#[derive(Clone, Debug)]
struct Call {
    what: Arc<str>,
    since: Nanos,
    limit: Nanos,
}

impl Record {
    /// Returns true if the call has exceeded its limit.
    fn is_hung(&self, now: Nanos) -> bool {
        self.call
            .as_ref()
            .is_some_and(|call| now - call.since > call.limit)
    }
}

impl LinkStatus {
    /// The state of the line of the driver called `driver`, closed at first. Data older than `max_age` make the line
    /// stale.
    pub fn new(driver: &str, max_age: Nanos) -> Self {
        Self::of_stations(driver, max_age, Vec::new())
    }

    /// As [`new`](Self::new), for a driver with `stations` of these names: if there are several, a silent station is
    /// reported by its name.
    pub fn of_stations(driver: &str, max_age: Nanos, stations: Vec<String>) -> Self {
        let link = Link {
            state: LinkState::Closed,
            cause: Cause::NotOpened,
            reason: "not opened yet".to_owned(),
            since: Nanos::ZERO,
        };
        Self(Arc::new(Shared {
            driver: driver.to_owned(),
            max_age: MaxAge::new(max_age),
            traffic: Traffic::new(stations.len()),
            stations,
            state: AtomicU8::new(0),
            stale: AtomicUsize::new(0),
            cycle: SharedHistogram::new(),
            sent_age: SharedHistogram::new(),
            record: Mutex::new(Record {
                link,
                journal: Journal::default(),
                running: String::new(),
                call: None,
                injected: String::new(),
                doubt: None,
                before_hang: None,
                entered: [0; LinkState::ALL.len()],
                caused: [0; Cause::ALL.len()],
                facts: BTreeMap::new(),
                counts: BTreeMap::new(),
                rates: Rates::default(),
                log: Rarely::default(),
            }),
        }))
    }

    /// The name of the line's driver.
    pub fn driver(&self) -> &str {
        &self.0.driver
    }

    /// Sets the active line faults, as text; empty for none. The reason of a silence mentions them.
    pub fn injected(&self, faults: &str) {
        let injected = &mut self.lock().injected;
        injected.clear();
        injected.push_str(faults);
    }

    /// The limit of age.
    pub fn max_age(&self) -> Nanos {
        self.0.max_age.get()
    }

    /// The limit of age, for others who compare with it.
    pub fn limit(&self) -> MaxAge {
        self.0.max_age.clone()
    }

    /// Forgets what the bus has reported, because another one takes its place: facts, a call that hangs, and doubts about
    /// received data. Counters stay.
    pub fn forget_bus(&self) {
        let mut record = self.lock();
        record.facts.clear();
        (record.call, record.before_hang, record.doubt) = (None, None, None);
    }

    /// The current state, without a lock.
    #[inline]
    pub fn state(&self) -> LinkState {
        let state = usize::from(self.0.state.load(Ordering::Relaxed));
        // The code is always one of the states.
        LinkState::ALL
            .get(state)
            .copied()
            .unwrap_or(LinkState::Failed)
    }

    /// Returns true if the line is running or stale, that is, the peer is present as far as last entered.
    #[inline]
    pub fn is_up(&self) -> bool {
        const RUNNING: u8 = LinkState::Running as u8;
        const STALE: u8 = LinkState::Stale as u8;
        matches!(self.0.state.load(Ordering::Relaxed), RUNNING | STALE)
    }

    /// The reason of the last running state; empty before the line ran for the first time.
    pub fn running_reason(&self) -> String {
        self.lock().running.clone()
    }

    /// How many times the line has come up.
    pub fn runs(&self) -> u64 {
        self.lock().entered[LinkState::Running as usize]
    }

    /// Returns true if the line has failed, and has never come up. A line that waits for its first peer has not failed.
    pub fn has_only_failed(&self) -> bool {
        let entered = &self.lock().entered;
        entered[LinkState::Running as usize] == 0 && entered[LinkState::Failed as usize] > 0
    }

    /// The current state, cause and reason.
    pub fn link(&self) -> Link {
        self.lock().link.clone()
    }

    /// Enters a state at `now`; does nothing if the line is in this state with the same reason.
    pub fn enter(&self, now: Nanos, state: LinkState, cause: Cause, reason: &str) {
        self.0.enter(self.lock(), now, state, cause, reason);
    }

    /// The peer is present. A line that is running or stale keeps its state.
    pub fn running(&self, now: Nanos, reason: &str) {
        if self.is_up() {
            return;
        }
        let mut record = self.lock();
        reason.clone_into(&mut record.running);
        let (state, cause) = (LinkState::Running, Cause::Running);
        let up = self.0.change(&mut record, now, state, cause, reason);
        let doubt = record.doubt.clone();
        let doubt = doubt.and_then(|(cause, reason)| {
            let state = LinkState::Stale;
            self.0.change(&mut record, now, state, cause, &reason)
        });
        drop(record);
        up.into_iter().chain(doubt).for_each(Message::write);
    }

    /// Declares received data invalid, with a cause and a reason, or valid again (`None`). While data are invalid, a
    /// running line is stale; any other line becomes stale when it comes up. `ages` are the ages of the stations' data.
    /// Silence takes precedence over a frozen signal, since without data nothing can change.
    pub fn doubt(
        &self,
        now: Nanos,
        doubt: Option<(Cause, String)>,
        ages: impl Iterator<Item = Nanos> + Clone,
    ) {
        let mut record = self.lock();
        let before = std::mem::replace(&mut record.doubt, doubt);
        if !matches!(record.link.state, LinkState::Running | LinkState::Stale) {
            return;
        }
        let limit = self.max_age();
        let stale = ages
            .clone()
            .filter(|age| is_stale(*age, limit, true))
            .count();
        let (state, cause, reason) = match (record.doubt.clone(), before) {
            (Some((Cause::Frozen, _)), _) if record.link.cause == Cause::Silent => return,
            (Some((cause, reason)), _) => (LinkState::Stale, cause, reason),
            (None, Some((cause, _))) if record.link.cause == cause => {
                if stale > 0 {
                    let reason = self.0.silence(&record, Nanos::MAX, ages);
                    self.0.silent(record, now, stale, &reason);
                    return;
                }
                (LinkState::Running, Cause::Running, record.running.clone())
            }
            (None, _) => return,
        };
        self.0.enter(record, now, state, cause, &reason);
    }

    /// Checks the time: a running line becomes stale when the newest data of a station are too old (`ages`
    /// has one entry per station), and running again when all are recent and none is invalid. Lock-free
    /// unless something changes.
    #[inline]
    pub fn observe(&self, now: Nanos, ages: impl Iterator<Item = Nanos> + Clone) {
        let limit = self.max_age();
        let stale = ages
            .clone()
            .filter(|age| is_stale(*age, limit, true))
            .count();
        match self.state() {
            LinkState::Running if stale > 0 => {}
            LinkState::Stale if stale == 0 || stale != self.0.stale.load(Ordering::Relaxed) => {}
            _ => return,
        }
        self.look_again(now, ages);
    }

    /// Updates the state from the ages as they are now: since the first look, another thread may have received data, or
    /// entered a state at a later time than `now`, which then stays.
    #[cold]
    fn look_again(&self, now: Nanos, ages: impl Iterator<Item = Nanos> + Clone) {
        let limit = self.max_age();
        let mut record = self.lock();
        if now < record.link.since {
            return;
        }
        let all = ages.clone();
        let stale = all.filter(|age| is_stale(*age, limit, true)).count();
        let shown = now - record.link.since;
        match record.link.state {
            // A line that has just come up may still have old data.
            LinkState::Running if shown > limit && stale > 0 => {
                let reason = self.0.silence(&record, shown, ages);
                self.0.silent(record, now, stale, &reason);
            }
            // A frozen signal becomes silence when its data are too old.
            LinkState::Stale
                if stale > 0 && record.link.cause == Cause::Frozen && shown > limit =>
            {
                let reason = self.0.silence(&record, Nanos::MAX, ages);
                self.0.silent(record, now, stale, &reason);
            }
            LinkState::Stale if stale > 0 && record.link.cause == Cause::Frozen => {}
            LinkState::Stale if stale > 0 => {
                self.0.stale.store(stale, Ordering::Relaxed);
                if record.link.cause == Cause::Silent {
                    record.link.reason = self.0.silence(&record, Nanos::MAX, ages);
                }
            }
            LinkState::Stale if stale == 0 && !record.is_hung(now) => {
                let (state, cause, reason) = match record.doubt.clone() {
                    Some((cause, reason)) => (LinkState::Stale, cause, reason),
                    None => (LinkState::Running, Cause::Running, record.running.clone()),
                };
                self.0.enter(record, now, state, cause, &reason);
            }
            _ => {}
        }
    }

    /// Checks if a library call has exceeded its limit. Called by other threads: the bus cannot check while it is in
    /// the call.
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
            self.0.enter(record, now, state, cause, &reason);
        }
    }

    /// A library call begins, which should last at most `limit`.
    pub fn call_begins(&self, now: Nanos, what: &Arc<str>, limit: Nanos) {
        self.lock().call = Some(Call {
            what: Arc::clone(what),
            since: now,
            limit,
        });
    }

    /// The call has returned. A line that was waiting for its peer when the call hung resumes waiting; one
    /// that was running stays stale until the peer is heard from.
    pub fn call_ends(&self, now: Nanos) {
        let mut record = self.lock();
        let call = record.call.take();
        if record.link.cause != Cause::Hung {
            return;
        }
        let before = record.before_hang.take();
        if let Some(link) = before.filter(|link| link.state == LinkState::Opening) {
            self.0
                .enter(record, now, link.state, link.cause, &link.reason);
        } else if let Some(call) = call {
            let reason = format!(
                "{} returned after {}, and nothing has come from the peer since",
                call.what,
                (now - call.since).rounded()
            );
            let (state, cause) = (LinkState::Stale, Cause::Silent);
            self.0.enter(record, now, state, cause, &reason);
        }
    }

    /// Sets a fact for the statistics, such as the bound address.
    pub fn tell(&self, key: impl Into<Key>, fact: &str) {
        self.lock().facts.insert(key.into(), one_line(fact));
    }

    /// The fact that was set last for this key.
    pub fn fact(&self, key: &'static str) -> Option<String> {
        self.lock().facts.get(&key.into()).cloned()
    }

    /// Increments a counter of the statistics.
    pub fn count(&self, key: &'static str) {
        *self.lock().counts.entry(key).or_default() += 1;
    }

    /// Logs a message that a peer can cause any number of times, with the name of the driver. `kind` is its
    /// topic: the first 20 messages of a kind are logged, then those whose number is a power of two.
    pub fn log(&self, level: log::Level, kind: &'static str, message: Arguments<'_>) {
        let told = self.lock().log.count(("", kind));
        if let Some(times) = told {
            log::log!(level, "driver \"{}\": {message}{times}", self.driver());
        }
    }

    /// Records a bus cycle of length `span`. Only the thread that runs the bus calls this.
    #[inline]
    pub fn cycle(&self, span: Nanos) {
        self.0.cycle.record(span);
    }

    /// Records that the bus took values of this `age`. Only the thread that runs the bus calls this.
    #[inline]
    pub(crate) fn sends(&self, age: Nanos) {
        self.0.sent_age.record(age);
    }

    /// The octets, frames and process data that pass.
    #[inline]
    pub(crate) fn traffic(&self) -> &Traffic {
        &self.0.traffic
    }

    /// Adds the state of the line.
    pub fn write(&self, now: Nanos, statistics: &mut Statistics) {
        let mut record = self.lock();
        let record = &mut *record;
        let link = &record.link;
        statistics.text("state", link.state.name());
        statistics.count("state.code", link.state as u64);
        statistics.text("cause", link.cause.name());
        statistics.count("cause.code", link.cause as u64);
        statistics.text("reason", &link.reason);
        statistics.number("state.for_s", (now - link.since).as_micros() / 1e6, 3);
        statistics.time("max_age", self.max_age());
        for (key, fact) in &record.facts {
            statistics.text(key.clone(), fact);
        }
        for (state, count) in LinkState::ALL.iter().zip(record.entered) {
            statistics.count(format!("link.{}", state.name()), count);
        }
        for (cause, count) in Cause::ALL.iter().zip(record.caused) {
            if count > 0 {
                statistics.count(format!("cause.{}", cause.name()), count);
            }
        }
        for (key, count) in &record.counts {
            statistics.count(*key, *count);
        }
        statistics.count("log.untold", record.log.untold());
        statistics.distribution("bus_cycle", &self.0.cycle.read());
        statistics.distribution("sent_age", &self.0.sent_age.read());
        let (traffic, stations) = (self.traffic(), &self.0.stations);
        traffic.write(now, &mut record.rates, stations, statistics);
    }

    fn lock(&self) -> MutexGuard<'_, Record> {
        // The record is consistent after every change, so a poisoned lock is safe to use.
        self.0.record.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A log message, made while the record is locked and written after it is released.
#[must_use]
struct Message(log::Level, String);

impl Message {
    fn write(self) {
        log::log!(self.0, "{}", self.1);
    }
}

impl Shared {
    /// Enters a state. Logs after releasing the record, so that no thread waits for a slow reader of the log.
    fn enter(
        &self,
        mut record: MutexGuard<'_, Record>,
        now: Nanos,
        state: LinkState,
        cause: Cause,
        reason: &str,
    ) {
        let message = self.change(&mut record, now, state, cause, reason);
        drop(record);
        if let Some(message) = message {
            message.write();
        }
    }

    /// The line is stale because the data of `stale` stations are too old.
    fn silent(&self, record: MutexGuard<'_, Record>, now: Nanos, stale: usize, reason: &str) {
        self.enter(record, now, LinkState::Stale, Cause::Silent, reason);
        self.stale.store(stale, Ordering::Relaxed);
    }

    /// Changes the state, and returns the message to be logged.
    fn change(
        &self,
        record: &mut Record,
        now: Nanos,
        state: LinkState,
        cause: Cause,
        reason: &str,
    ) -> Option<Message> {
        let reason = one_line(reason);
        if (record.link.state, record.link.cause) == (state, cause) {
            // A state whose reason only changed its wording, such as its duration, is not entered again.
            record.link.reason = reason;
            return None;
        }
        record.journal.note(now, Some((state, cause)), &reason);
        record.entered[state as usize] += 1;
        record.caused[cause as usize] += 1;
        if state == LinkState::Running {
            record.rates.begin(now);
        }
        self.state.store(state as u8, Ordering::Relaxed);
        // The count of an earlier silence does not apply to the next one.
        self.stale.store(0, Ordering::Relaxed);
        let trouble = matches!(state, LinkState::Stale | LinkState::Failed)
            || (state == LinkState::Opening && cause != Cause::Waiting);
        let level = if trouble {
            log::Level::Warn
        } else {
            log::Level::Info
        };
        let told = record.log.count((state.name(), cause.name()));
        let message = told.filter(|_| log::log_enabled!(level)).map(|times| {
            let (driver, state) = (&self.driver, state.name());
            Message(
                level,
                format!("driver \"{driver}\" is {state}: {reason}{times}"),
            )
        });
        record.link = Link {
            state,
            cause,
            reason,
            since: now,
        };
        message
    }

    /// The reason of a silence: which data are too old, although the line has been up for `shown`.
    fn silence(
        &self,
        record: &Record,
        shown: Nanos,
        ages: impl Iterator<Item = Nanos> + Clone,
    ) -> String {
        let limit = self.max_age.get();
        let mut reason = "nothing has come from ".to_owned();
        // Writing to a string cannot fail.
        if self.stations.len() < 2 {
            let age = ages.max().unwrap_or_default().min(shown);
            let _ = write!(reason, "the peer for {}", age.rounded());
        } else {
            let silent = ages.zip(&self.stations);
            let silent = silent.filter(|(age, _)| *age > limit);
            for (index, (age, name)) in silent.enumerate() {
                let comma = if index > 0 { ", " } else { "" };
                let _ = write!(reason, "{comma}station \"{name}\" ");
                let _ = match age {
                    Nanos::MAX => write!(reason, "at all"),
                    age => write!(reason, "for {}", age.rounded()),
                };
            }
        }
        let _ = write!(reason, "; the limit is max_age = {limit}");
        if !record.injected.is_empty() {
            let _ = write!(reason, "; injected fault: {}", record.injected);
        }
        reason
    }
}

#[cfg(test)]
mod tests;
