//! Reports of the library's thread, for the thread of the run.

use std::collections::BTreeMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_image::signal::DataType;

use super::scalar;

/// How often a waiting thread looks whether it was stopped.
const LOOK: Duration = Duration::from_millis(50);

/// How long to wait for the name of the participant that stops the simulation.
const NAMING: Nanos = Nanos::from_millis(200);

/// The states of a participant that matter, and of the whole simulation: `SilKit_ParticipantState`, `SilKit_SystemState`.
mod states {
    pub(super) const PAUSED: i16 = 60;
    pub(super) const STOPPING: i16 = 70;
    pub(super) const STOPPED: i16 = 80;
    pub(super) const ERROR: i16 = 90;
    pub(super) const SHUTTING_DOWN: i16 = 100;
    pub(super) const SHUTDOWN: i16 = 110;
    pub(super) const ABORTING: i16 = 120;
}

/// A subscription: the topic and the type of its values.
#[derive(Debug)]
pub(super) struct Slot {
    topic: String,
    data_type: DataType,
    value: u64,
    /// The last value of the current step or later; it is not for this step.
    later: Option<(i64, u64)>,
    has_come: bool,
}

impl Slot {
    pub(super) fn new(topic: &str, data_type: DataType, initial: u64) -> Self {
        Self {
            topic: topic.to_owned(),
            data_type,
            value: initial,
            later: None,
            has_come: false,
        }
    }
}

/// The reports so far.
#[derive(Debug)]
pub(super) struct Inbox {
    name: String,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    is_ready: bool,
    is_shut: bool,
    /// The time of the step that waits for us, in nanoseconds.
    step: Option<u64>,
    /// Values from before this time are for the current step.
    until: i64,
    slots: Vec<Slot>,
    /// The participants that pause, with their reasons.
    paused: BTreeMap<String, String>,
    /// The participant that stopped the simulation, with its reason.
    stopped: Option<(String, String)>,
    /// The simulation stops.
    is_stopping: bool,
    /// Why the simulation has ended.
    ended: Option<String>,
}

impl Inbox {
    /// The inbox of the participant with this name.
    pub(super) fn new(name: &str, slots: Vec<Slot>) -> Self {
        Self {
            name: name.to_owned(),
            state: Mutex::new(State {
                is_ready: false,
                is_shut: false,
                step: None,
                until: 0,
                slots,
                paused: BTreeMap::new(),
                stopped: None,
                is_stopping: false,
                ended: None,
            }),
            changed: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.lock());
        self.changed.notify_all();
    }

    /// All participants have connected; they begin when we are ready.
    pub(super) fn ready(&self) {
        self.change(|state| state.is_ready = true);
    }

    /// The simulation has reached our step at this time.
    pub(super) fn step(&self, time: u64) {
        self.change(|state| state.step = Some(time));
    }

    /// A value of a subscription, published at `time`; one from before the simulation began has a negative time.
    pub(super) fn message(&self, slot: usize, time: i64, message: &[u8]) {
        let mut state = self.lock();
        let until = state.until;
        let slot = &mut state.slots[slot];
        slot.has_come = true;
        match scalar::raw(slot.data_type, message) {
            Some(value) if time < until => slot.value = value,
            Some(value) => slot.later = Some((time, value)),
            None => {
                let told = format!(
                    "the topic \"{}\" has sent {} bytes, but one {} has {}; write the type that its publisher sends, and \
                     let it send one number per topic",
                    slot.topic,
                    message.len(),
                    slot.data_type,
                    scalar::size(slot.data_type)
                );
                state.ended.get_or_insert(told);
                drop(state);
                self.changed.notify_all();
            }
        }
    }

    /// A participant, perhaps our own, has another state.
    pub(super) fn participant(&self, name: &str, code: i16, reason: &str) {
        let is_own = name == self.name;
        self.change(|state| {
            // Whoever ends in a pause does not pause any longer.
            state.paused.remove(name);
            match code {
            states::PAUSED => {
                state.paused.insert(name.to_owned(), reason.to_owned());
            }
            // All others follow the one that stops, and their states may be heard first.
            states::STOPPING if !is_own && !reason.starts_with("Received new system state") => {
                let first = || (name.to_owned(), reason.to_owned());
                state.stopped.get_or_insert_with(first);
            }
            states::ERROR if is_own && reason.contains("not part of the set of") => {
                state.ended.get_or_insert(format!(
                    "the system controller does not wait for the participant \"{name}\"; name it there, as in \
                     sil-kit-system-controller {name} and all others"
                ));
            }
            states::ERROR if is_own => {
                let told = format!("SIL Kit reports: {reason}");
                state.ended.get_or_insert(told);
            }
            states::ERROR => {
                let told = match reason {
                    "Connection Lost" => "has left without stopping, or its process has died".to_owned(),
                    reason => format!("has failed: {reason}"),
                };
                state.ended.get_or_insert(format!(
                    "the participant \"{name}\" {told}; start the simulation again as a whole"
                ));
            }
            states::SHUTDOWN if is_own => state.is_shut = true,
            _ => {}
            }
        });
    }

    /// The simulation has another state.
    pub(super) fn system(&self, code: i16) {
        self.change(|state| {
            let told = match code {
                states::STOPPING | states::STOPPED | states::SHUTTING_DOWN | states::SHUTDOWN => {
                    state.is_stopping = true;
                    return;
                }
                states::ERROR => {
                    "the simulation is in its error state; start it again as a whole".to_owned()
                }
                states::ABORTING => "the simulation was aborted".to_owned(),
                _ => return,
            };
            state.ended.get_or_insert(told);
        });
    }

    /// Waits until all participants have connected, for any time.
    ///
    /// # Errors
    ///
    /// Why that will not be.
    pub(super) fn wait_ready(&self, clock: &dyn Clock, stop: &Stop) -> Result<(), String> {
        self.wait(clock, stop, (None, ""), &mut |_| {}, |state| {
            state.is_ready.then_some(())
        })
    }

    /// Waits for our step, and takes the values that were published before it into `values`; the next step will be at
    /// `next`. Returns its time. While a participant pauses, the limit does not run, and `news` gets a line about it.
    ///
    /// # Errors
    ///
    /// Why the step does not come.
    pub(super) fn wait_step(
        &self,
        (clock, stop): (&dyn Clock, &Stop),
        limit: (Nanos, Nanos),
        news: &mut dyn FnMut(&str),
        (next, values): (i64, &mut [u64]),
    ) -> Result<u64, String> {
        let (limit, at) = limit;
        let what = format!("come to {at}");
        self.wait(clock, stop, (Some(limit), &what), news, |state| {
            let time = state.step.take()?;
            state.until = next;
            for (slot, value) in state.slots.iter_mut().zip(&mut *values) {
                *value = slot.value;
                if slot.later.is_some_and(|(later, _)| later < next) {
                    slot.value = slot.later.take().map_or(slot.value, |(_, value)| value);
                }
            }
            Some(time)
        })
    }

    /// Waits until our participant has shut down, for `limit` at most.
    pub(super) fn wait_shut(&self, clock: &dyn Clock, limit: Nanos) {
        let end = clock.now() + limit;
        let mut state = self.lock();
        while !state.is_shut && clock.now() < end {
            state = self.sleep(state);
        }
    }

    /// True if the simulation ends without us: there is no one to report an error to.
    pub(super) fn has_stopped(&self) -> bool {
        let state = self.lock();
        state.is_shut || state.is_stopping
    }

    /// The topics that nothing has come from.
    pub(super) fn silent(&self) -> Vec<String> {
        let state = self.lock();
        let silent = state.slots.iter().filter(|slot| !slot.has_come);
        silent.map(|slot| slot.topic.clone()).collect()
    }

    fn sleep<'a>(&self, state: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        let woken = self.changed.wait_timeout(state, LOOK);
        woken.unwrap_or_else(PoisonError::into_inner).0
    }

    fn wait<T>(
        &self,
        clock: &dyn Clock,
        stop: &Stop,
        (limit, what): (Option<Nanos>, &str),
        news: &mut dyn FnMut(&str),
        mut take: impl FnMut(&mut State) -> Option<T>,
    ) -> Result<T, String> {
        let mut end = limit.map(|limit| clock.now() + limit);
        let mut is_paused = false;
        let mut name_by = None;
        let mut state = self.lock();
        loop {
            if let Some(ended) = &state.ended {
                return Err(ended.clone());
            }
            let now = clock.now();
            if let (Some((name, reason)), true) = (&state.stopped, state.is_stopping) {
                return Err(format!(
                    "the participant \"{name}\" has stopped the simulation: {reason}"
                ));
            }
            if state.is_stopping {
                if now >= *name_by.get_or_insert(now + NAMING) {
                    return Err("the simulation has stopped".to_owned());
                }
                state = self.sleep(state);
                continue;
            }
            if let Some(taken) = take(&mut state) {
                if is_paused {
                    news("the simulation continues");
                }
                return Ok(taken);
            }
            if stop.is_stopped() {
                return Err("it was stopped".to_owned());
            }
            if let Some((name, reason)) = state.paused.first_key_value() {
                end = limit.map(|limit| now + limit);
                if !std::mem::replace(&mut is_paused, true) {
                    news(&format!(
                        "the participant \"{name}\" pauses the simulation: {reason}; the run waits, and its server ends \
                         it after the time \"hang\" of its file"
                    ));
                }
            }
            if let (Some(limit), true) = (limit, end.is_some_and(|end| now >= end)) {
                return Err(format!(
                    "the simulation has not {what} within {limit}; look which participant does not complete its step, \
                     or allow more by --timeout"
                ));
            }
            state = self.sleep(state);
        }
    }
}

#[cfg(test)]
mod tests {
    use tickbus_base::time::Monotonic;

    use super::*;

    fn inbox() -> Inbox {
        let slots = vec![Slot::new("tank/level", DataType::Int, 5)];
        Inbox::new("tickbus", slots)
    }

    /// The value that a step finds.
    fn found(inbox: &Inbox, limit: Nanos, next: i64) -> Result<u64, String> {
        let mut values = [0];
        let clock = Monotonic::shared();
        inbox.wait_step(
            (&*clock, &Stop::new()),
            (limit, Nanos(next)),
            &mut |_| {},
            (next, &mut values),
        )?;
        Ok(values[0])
    }

    #[test]
    fn a_step_finds_what_was_published_before_it_and_not_in_it() {
        let inbox = inbox();
        let limit = Nanos::from_secs(5);
        inbox.step(0);
        assert_eq!(found(&inbox, limit, 10), Ok(5), "the initial value");
        inbox.message(0, i64::MIN, &[6, 0]);
        inbox.message(0, 0, &[7, 0]);
        // Another participant is already in its step at 10.
        inbox.message(0, 10, &[8, 0]);
        inbox.step(10);
        assert_eq!(found(&inbox, limit, 20), Ok(7));
        inbox.message(0, 20, &[0xFF, 0xFF]);
        inbox.step(20);
        assert_eq!(found(&inbox, limit, 30), Ok(8));
        inbox.step(30);
        assert_eq!(found(&inbox, limit, 40), Ok(u64::MAX), "-1");
        assert!(inbox.silent().is_empty());
    }

    #[test]
    fn a_step_that_does_not_come_is_told_with_the_reason() {
        let told = |report: &dyn Fn(&Inbox), limit| {
            let inbox = inbox();
            report(&inbox);
            found(&inbox, limit, 10).expect_err("it does not come")
        };
        let long = Nanos::from_secs(5);
        let size = told(&|inbox| inbox.message(0, 0, &[0; 12]), long);
        assert!(
            size.contains("\"tank/level\" has sent 12 bytes, but one INT has 2"),
            "{size}"
        );
        let died = |inbox: &Inbox| inbox.participant("tank", states::ERROR, "Connection Lost");
        let told_died = told(&died, long);
        assert!(
            told_died.contains("\"tank\" has left without stopping"),
            "{told_died}"
        );
        let stops = |inbox: &Inbox| {
            let follows = "Received new system state: Stopping";
            inbox.participant("controller", states::STOPPING, follows);
            inbox.system(states::STOPPING);
            inbox.participant("tank", states::STOPPING, "enough");
        };
        let expected = "the participant \"tank\" has stopped the simulation: enough";
        assert_eq!(told(&stops, long), expected);
        let late = told(&|_| {}, Nanos::from_millis(60));
        assert!(late.contains("has not come to 10ns within 60ms"), "{late}");
    }

    #[test]
    fn the_limit_does_not_run_in_a_pause() {
        let inbox = inbox();
        let (clock, stop) = (Monotonic::shared(), Stop::new());
        inbox.participant("tank", states::PAUSED, "coffee");
        let mut lines = Vec::new();
        let mut news = |line: &str| {
            lines.push(line.to_owned());
            stop.stop();
        };
        let limit = (Nanos::from_millis(1), Nanos(10));
        let told = inbox.wait_step((&*clock, &stop), limit, &mut news, (10, &mut [0]));
        assert_eq!(told, Err("it was stopped".to_owned()));
        assert!(
            lines[0].contains("\"tank\" pauses the simulation: coffee"),
            "{lines:?}"
        );
    }
}
