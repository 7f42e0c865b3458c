//! The start of a run, and its way from step to step.

use tickbus_base::time::{Nanos, Pace};

use super::{Out, Phase, STOP_PATIENCE, Seat, Server};
use crate::barrier::{Barrier, State};
use crate::{Cause, Ended, Step};

/// The most states without a due client to pass in a row before anything else is done.
const EMPTY_STATES: usize = 1000;

impl Server<'_> {
    /// Starts the run: everyone has joined.
    pub(super) fn start(&mut self, now: Nanos) {
        let ended = Phase::Ended(Err(Ended::before(Cause::Configuration, "")));
        let Phase::Joining(joining, logic) = std::mem::replace(&mut self.phase, ended) else {
            unreachable!("a run starts once");
        };
        let (seats, clients) = joining.into_clients();
        let mut barrier = match Barrier::new(self.settings.step, clients, logic) {
            Ok(barrier) => barrier,
            Err(mistake) => {
                return self.end_for(Cause::Configuration, None, mistake.to_string());
            }
        };
        let mut restored = self.settings.restore.take();
        if let Some(saved) = restored.as_mut().filter(|saved| saved.memory.is_some()) {
            // A client of an older version cannot take over a state: it runs its steps again.
            for (client, seat) in saved.clients.iter_mut().zip(&seats) {
                client.state = client.state.take().filter(|_| self.saving.is_able(*seat));
            }
        }
        let started = match &restored {
            None => (barrier.start()).map_err(|reason| (Cause::Logic, of_logic(&reason))),
            Some(saved) => (barrier.restore(saved)).map_err(|reason| (Cause::System, reason)),
        };
        self.news.push_back(match &restored {
            None => "all have joined: the run starts".to_owned(),
            Some(saved) => saved.news(),
        });
        for (client, seat) in seats.iter().enumerate() {
            self.seats[*seat] = match restored {
                None => Seat::Client(client),
                Some(_) => Seat::Back(client),
            };
            if self.allowed.is_some() {
                self.outbox.push_back(Out::Until(*seat));
            }
            self.outbox.push_back(Out::Start(*seat));
        }
        self.asked = now;
        if let Some(saved) = restored {
            self.rejoining.begin_again(now, &seats, saved);
        }
        self.phase = Phase::Running(Box::new(barrier), seats);
        if let Err((cause, reason)) = started {
            self.end_for(cause, None, reason);
        }
    }

    /// Advances as far as possible.
    pub(super) fn advance(&mut self, now: Nanos) {
        for _ in 0..EMPTY_STATES {
            if self.save_if_due(now) {
                return;
            }
            let misses_members = self.misses_members();
            let Phase::Running(barrier, seats) = &mut self.phase else {
                return;
            };
            if !barrier.is_synchronised() {
                return;
            }
            if barrier.state() != State::PreRead {
                self.remember_due();
                let Phase::Running(barrier, _) = &mut self.phase else {
                    return;
                };
                if let Err(reason) = barrier.commit() {
                    return self.end_for(Cause::Logic, None, of_logic(&reason));
                }
                if let Err(reason) = barrier.show_commit() {
                    return self.end_for(Cause::System, None, reason);
                }
                self.remember_commit();
                self.ask_again(now);
                continue;
            }
            let Step { sequence, time } = barrier.step();
            let has_run_ahead =
                (self.allowed.as_ref()).is_some_and(|allowed| allowed.until() > sequence);
            let is_idle = self.settings.steps.is_none() && barrier.is_idle_for_ever();
            let is_last = self.stop_by.is_some() || self.settings.steps == Some(sequence);
            // In the steps that idle clients are allowed they do nothing.
            if is_idle || (is_last && !has_run_ahead) {
                let outcome = barrier.outcome();
                return self.end(Ok(outcome));
            }
            if time.0.checked_add(self.settings.step.0).is_none() {
                let reason = "virtual time has no room for a further step".to_owned();
                return self.end_for(Cause::Configuration, None, reason);
            }
            if self.allowed.is_some() {
                if !self.allow_steps(now) {
                    return;
                }
                let Phase::Running(barrier, _) = &mut self.phase else {
                    return;
                };
                self.asked = now;
                // The clients finish all steps that they are allowed.
                self.stop_by = self.stop_by.map(|_| now + STOP_PATIENCE);
                barrier.begin_step().expect("there is no logic");
                continue;
            }
            if (self.is_paused && self.singles == 0) || misses_members {
                return;
            }
            if let Some(interval) = self.settings.pacing.interval(self.settings.step) {
                let pace = self.pace.get_or_insert_with(|| Pace::new(now, interval));
                if !pace.take(now) {
                    return;
                }
            }
            self.singles = self.singles.saturating_sub(1);
            self.asked = now;
            if let Err(reason) = barrier.begin_step() {
                return self.end_for(Cause::Logic, None, of_logic(&reason));
            }
            let due = barrier.due().map(|client| Out::Step(seats[client]));
            self.outbox.extend(due);
        }
    }
}

fn of_logic(reason: &str) -> String {
    format!("the server's logic failed: {reason}")
}
