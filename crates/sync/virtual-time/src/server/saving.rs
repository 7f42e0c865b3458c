//! Runs that are saved after a step.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::printable;

use super::{Out, Phase, Seat, Server};
use crate::barrier::State;
use crate::saved_run::{self, ClientState, LONGEST_STATE};
use crate::{SavedRun, Settings};

/// The requests to save the run, and the result for the host.
#[derive(Debug)]
pub(super) struct Saving {
    /// The seats of clients that are asked for their states.
    able: BTreeSet<usize>,
    is_asked: bool,
    /// The step after which the run is to be saved, until that is done.
    at: Option<u64>,
    collecting: Option<Collecting>,
    /// The results that the host has not taken, the oldest first.
    saved: VecDeque<Saved>,
}

/// Clients that are asked for their states; no step begins.
#[derive(Debug)]
struct Collecting {
    /// The seats of those that have not answered.
    missing: BTreeSet<usize>,
    /// The states by client, or the reasons why clients give none.
    states: BTreeMap<usize, Result<Vec<u8>, String>>,
    since: Nanos,
}

/// The step after which a run was saved, and the content of its file; or why it was not saved.
pub(crate) type Saved = Result<(u64, Vec<u8>), String>;

impl Saving {
    pub(super) fn new(settings: &Settings) -> Self {
        Self {
            able: BTreeSet::new(),
            is_asked: false,
            at: settings.save.as_ref().and_then(|save| save.at),
            collecting: None,
            saved: VecDeque::new(),
        }
    }

    /// Another client is at this seat.
    pub(super) fn connected(&mut self, seat: usize) {
        self.able.remove(&seat);
    }

    /// True if the client at this seat can save and take over its state.
    pub(super) fn is_able(&self, seat: usize) -> bool {
        self.able.contains(&seat)
    }

    /// The client at this seat has gone.
    pub(super) fn gone(&mut self, seat: usize) {
        if let Some(collecting) = &mut self.collecting {
            collecting.missing.remove(&seat);
        }
    }

    /// The first seat whose client has not answered.
    pub(super) fn awaited(&self) -> Option<usize> {
        let collecting = self.collecting.as_ref()?;
        collecting.missing.first().copied()
    }
}

impl Server<'_> {
    /// When clients have had the time to give their states; a run that was stopped does not wait for long.
    pub(super) fn collecting_until(&self) -> Option<Nanos> {
        let collecting = self.saving.collecting.as_ref()?;
        let until = collecting.since + self.settings.hang;
        Some(match collecting.missing.len() {
            0 => Nanos::ZERO,
            _ => until.min(self.stop_by.unwrap_or(Nanos::MAX)),
        })
    }

    /// The client at `seat` may be asked for its state.
    pub(crate) fn can_save(&mut self, seat: usize) {
        self.saving.able.insert(seat);
    }

    /// The run that was just saved, for the file of [`Settings::save`].
    pub(crate) fn take_saved(&mut self) -> Option<Saved> {
        self.saving.saved.pop_front()
    }

    /// The file for it.
    pub(crate) fn saved_to(&self) -> Option<&Path> {
        self.settings.save.as_ref().map(|save| &*save.file)
    }

    /// Someone wants the run to be saved after the current step.
    pub(super) fn ask_to_save(&mut self) {
        match (&self.settings.save, &self.phase) {
            (Some(_), Phase::Running(..)) => self.saving.is_asked = true,
            (Some(_), _) => {
                let why = "the run has not started, or has ended";
                self.saving.saved.push_back(Err(why.to_owned()));
            }
            (None, _) => {
                let why =
                    "the server does not keep what a saved run needs; start it with --save-to FILE";
                self.saving.saved.push_back(Err(why.to_owned()));
            }
        }
    }

    /// Saves the run, if it is between two steps and someone wants that; true while clients are asked for their states.
    pub(super) fn save_if_due(&mut self, now: Nanos) -> bool {
        if let Some(collecting) = &self.saving.collecting {
            if !collecting.missing.is_empty() {
                return true;
            }
            self.save();
        }
        let Phase::Running(barrier, seats) = &self.phase else {
            return false;
        };
        let saving = &mut self.saving;
        let step = barrier.step().sequence;
        let is_due = saving.is_asked || saving.at == Some(step);
        if !is_due || barrier.state() != State::PreRead {
            return false;
        }
        if self.rejoining.memory.is_none() && !self.rejoining.is_complete() {
            // Only states can be saved: the clients of a restored run have to take over theirs first.
            return false;
        }
        saving.is_asked = false;
        saving.at = saving.at.filter(|at| *at != step);
        // Clients that exchange their values are ahead of the server.
        let asked = if self.allowed.is_none() && step > 0 && self.rejoining.is_complete() {
            let able = seats.iter().filter(|seat| saving.able.contains(seat));
            able.copied().collect()
        } else {
            BTreeSet::new()
        };
        (self.outbox).extend(asked.iter().map(|seat| Out::Save(*seat, step)));
        let is_waiting = !asked.is_empty();
        saving.collecting = Some(Collecting {
            missing: asked,
            states: BTreeMap::new(),
            since: now,
        });
        if !is_waiting {
            self.save();
        }
        is_waiting
    }

    /// The client at `seat` has this state after the step `sequence`, or none to give for this reason.
    pub(crate) fn has_saved(
        &mut self,
        now: Nanos,
        seat: usize,
        sequence: u64,
        state: Result<&[u8], &str>,
    ) {
        let (Seat::Client(client), Phase::Running(barrier, _)) = (self.seats[seat], &self.phase)
        else {
            return self.violated(seat, "sent a state that nobody asked for");
        };
        if let Some(collecting) = &mut self.saving.collecting
            && sequence == barrier.step().sequence
            && collecting.missing.remove(&seat)
        {
            let state = match state {
                Ok(state) if state.len() <= LONGEST_STATE => Ok(state.to_vec()),
                // One on the server's own thread; others have looked before.
                Ok(state) => Err(format!(
                    "its state has {} bytes, {LONGEST_STATE} at most",
                    state.len()
                )),
                Err(reason) => Err(printable(reason)),
            };
            collecting.states.insert(client, state);
            return self.advance(now);
        }
        // An answer that comes too late counts for nothing.
        if sequence > barrier.step().sequence {
            self.violated(seat, "sent a state that nobody asked for");
        }
    }

    /// Clients that have not answered in time have no state.
    pub(super) fn end_of_collecting(&mut self, now: Nanos) {
        if self.collecting_until().is_some_and(|until| now >= until)
            && let Some(collecting) = &mut self.saving.collecting
        {
            collecting.missing.clear();
        }
    }

    /// Saves the run with the states that have come.
    fn save(&mut self) {
        let (Some(mut collecting), Phase::Running(barrier, _)) =
            (self.saving.collecting.take(), &self.phase)
        else {
            return;
        };
        let step = barrier.step().sequence;
        let memory = self.rejoining.memory.as_ref();
        let clients = 0..barrier.members().clients.len();
        if memory.is_none() {
            let stateless = clients
                .clone()
                .find_map(|at| match collecting.states.get(&at) {
                    Some(Ok(_)) => None,
                    Some(Err(reason)) => Some((at, &**reason)),
                    None => Some((at, "it was not asked or has not answered")),
                });
            if let Some((at, reason)) = stateless {
                let name = &barrier.declaration(at).name;
                let why = format!(
                    "after step {step} the run is longer than the server can keep, and client \"{name}\" gave no state: \
                     {reason}"
                );
                self.saving.saved.push_back(Err(why));
                return;
            }
        }
        let states = clients.map(|at| ClientState {
            declaration: barrier.declaration(at).clone(),
            next: barrier.next_update(at),
            state: collecting.states.remove(&at).and_then(Result::ok),
        });
        let run = SavedRun {
            length: self.settings.step,
            step,
            trace: barrier.trace().clone(),
            values: barrier.committed().to_vec(),
            clients: states.collect(),
            memory: None,
        };
        let content = saved_run::to_bytes(&run, memory);
        self.saving.saved.push_back(Ok((step, content)));
    }

    /// The run has ended: what was not saved is never saved.
    pub(super) fn end_of_saving(&mut self) {
        let at = self.saving.at.take();
        if self.saving.collecting.take().is_some() {
            let why = "the run ended while its clients were asked for their states";
            self.saving.saved.push_back(Err(why.to_owned()));
        } else if let Some(at) = at {
            let why = format!("the run ended before the end of step {at}");
            self.saving.saved.push_back(Err(why));
        } else if std::mem::take(&mut self.saving.is_asked) {
            let why = "the run ended before the end of the step";
            self.saving.saved.push_back(Err(why.to_owned()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Declaration, Logic, Outcome, Participant, Save, StartCondition, Step, Variable, in_process,
    };
    use tickbus_image::signal::DataType;

    /// Sums up, and can save that.
    struct Sum {
        total: u64,
        steps: u64,
        saves: bool,
    }

    impl Participant for Sum {
        fn declare(&self) -> Declaration {
            let mut declaration = Declaration::new("sum");
            declaration
                .writes
                .push(Variable::new("sum", DataType::Ulint));
            declaration
        }

        fn initial(&mut self, _: &mut [u64]) {}

        fn run(&mut self, step: Step, _: &[u64], writes: &mut [u64]) -> Result<(), String> {
            self.total += step.sequence;
            self.steps += 1;
            writes[0] = self.total;
            Ok(())
        }

        fn save(&mut self) -> Result<Vec<u8>, String> {
            let state = self.total.to_le_bytes().to_vec();
            self.saves
                .then_some(state)
                .ok_or_else(|| "it keeps\nno sum".to_owned())
        }

        fn restore(&mut self, state: &[u8]) -> Result<(), String> {
            let state = state.try_into().map_err(|_| "no sum".to_owned())?;
            self.total = u64::from_le_bytes(state);
            Ok(())
        }
    }

    fn run(settings: Settings, saves: bool) -> (Result<Outcome, crate::Ended>, u64) {
        let mut sum = Sum {
            total: 0,
            steps: 0,
            saves,
        };
        let outcome = in_process::run(settings, vec![&mut sum], Logic::new());
        (outcome, sum.steps)
    }

    #[test]
    fn a_run_that_is_longer_than_the_memory_is_saved_if_all_clients_have_states() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.saved");
        let plain = Settings {
            steps: Some(1000),
            ..Settings::new(Nanos::from_millis(1), StartCondition::Count(1))
        };
        let whole = run(plain.clone(), true).0.expect("it runs");
        let saving = Settings {
            save: Some(Save {
                file: file.clone(),
                at: Some(700),
            }),
            ..plain.clone()
        };
        let told = run(saving.clone(), false).0.expect_err("it has no state");
        assert_eq!(
            told.reason,
            "the run was not saved: after step 700 the run is longer than the server can keep, and client \"sum\" gave \
             no state: it keeps\\nno sum"
        );
        assert_eq!(run(saving, true).0, Ok(whole));
        let saved = SavedRun::load(&file).expect("it was saved");
        assert_eq!((saved.steps(), &saved.memory), (700, &None));
        let restoring = Settings {
            restore: Some(saved),
            ..plain
        };
        assert_eq!(run(restoring, true), (Ok(whole), 300));
    }
}
