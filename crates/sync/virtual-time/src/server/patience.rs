//! The parts that depend on the wall clock: pacing of steps, and timeouts.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;

use super::{Out, Phase, STOP_PATIENCE, Seat, Server};
use crate::{Cause, State};

/// The most clients that are named as those that the server waits for.
const MOST_NAMED: usize = 5;

/// How often idle clients learn that the server waits.
const INFORM: Nanos = Nanos::from_secs(1);

impl Server<'_> {
    /// The next time for [`tick`](Self::tick), unless something happens before; a time in the past means at once.
    pub fn deadline(&self) -> Nanos {
        let silent = self.seats.iter().filter_map(|seat| match seat {
            Seat::Silent(since) => Some(*since + self.settings.hang),
            _ => None,
        });
        let silent = silent.min().unwrap_or(Nanos::MAX);
        let informs = !self.informed.is_empty() && !matches!(self.phase, Phase::Ended(_));
        let inform = informs.then(|| self.informed_at + INFORM);
        let inform = inform.unwrap_or(Nanos::MAX);
        silent
            .min(inform)
            .min(self.rejoin_deadline())
            .min(match &self.phase {
                Phase::Joining(..) if self.meeting.is_some() => self.meeting_until(),
                Phase::Joining(..) => self.asked + self.settings.join,
                Phase::Running(..) if self.misses_members() && self.awaited().is_none() => {
                    self.stop_by.unwrap_or(Nanos::MAX)
                }
                Phase::Running(..) if self.collecting_until().is_some() => {
                    self.collecting_until().unwrap_or(Nanos::MAX)
                }
                Phase::Running(barrier, _) if barrier.state() == State::PreRead => {
                    match (self.is_paused() && !self.has_run_ahead(), &self.pace) {
                        (true, _) => Nanos::MAX,
                        (false, Some(pace)) => pace.due(),
                        // Too many empty steps came in a row.
                        (false, None) => Nanos::ZERO,
                    }
                }
                Phase::Running(barrier, _) if barrier.is_synchronised() => Nanos::ZERO,
                Phase::Running(..) => {
                    let hang = self.asked + self.settings.hang;
                    hang.min(self.stop_by.unwrap_or(Nanos::MAX))
                }
                Phase::Ended(_) => Nanos::MAX,
            })
    }

    /// Does the work due at `now`: the next step, or a timeout.
    pub fn tick(&mut self, now: Nanos) {
        let hang = self.settings.hang;
        self.inform(now);
        for seat in 0..self.seats.len() {
            if matches!(self.seats[seat], Seat::Silent(since) if now >= since + hang) {
                let reason = format!("did not join within {hang}");
                self.refuse(seat, None, &reason);
            }
        }
        self.check_rejoin(now);
        self.end_of_collecting(now);
        match &self.phase {
            Phase::Joining(joining, _)
                if self.meeting.is_none() && now >= self.asked + self.settings.join =>
            {
                let (limit, missing) = (self.settings.join, joining.missing());
                let reason = format!("still waiting for {missing}, after {limit}");
                self.end_for(Cause::Hung, None, reason);
            }
            Phase::Running(barrier, _) if !barrier.is_synchronised() => {
                if now >= self.asked + hang && self.awaited().is_some() {
                    self.end_of_patience(Cause::Hung, &format!("within {hang}"));
                } else if self.stop_by.is_some_and(|by| now >= by) {
                    let limit = format!("within {STOP_PATIENCE} after the run was stopped");
                    self.end_of_patience(Cause::Stopped, &limit);
                }
            }
            _ => self.end_of_meeting(now),
        }
        self.advance(now);
    }

    /// Tells idle clients once a second that the server waits.
    fn inform(&mut self, now: Nanos) {
        if now < self.informed_at + INFORM {
            return;
        }
        self.informed_at = now;
        if self.informed.is_empty() {
            return;
        }
        self.waits_for = self.waits_for();
        let barrier = match &self.phase {
            Phase::Joining(..) => None,
            Phase::Running(barrier, _) => Some(barrier),
            Phase::Ended(_) => return,
        };
        for seat in &self.informed {
            let is_idle = match self.seats[*seat] {
                Seat::Joined => true,
                Seat::Client(client) => {
                    barrier.is_some_and(|barrier| barrier.owing().all(|owing| owing != client))
                }
                Seat::Free | Seat::Silent(_) | Seat::Back(_) | Seat::Leaving => false,
            };
            if is_idle && self.outbox.iter().all(|out| out.seat() != *seat) {
                self.outbox.push_back(Out::Waiting(*seat));
            }
        }
    }

    /// Says what the server waits for, as the continuation of "it waits for …".
    fn waits_for(&self) -> String {
        let barrier = match &self.phase {
            Phase::Joining(joining, _) => return format!("{} to join", joining.missing()),
            Phase::Running(barrier, _) => barrier,
            Phase::Ended(_) => return String::new(),
        };
        if let Some((client, is_back)) = self.missed().next() {
            let name = shown(&barrier.declaration(client).name);
            let what = if is_back {
                "to run its steps again"
            } else {
                "to come back"
            };
            return match self.missed().count() - 1 {
                0 => format!("\"{name}\" {what}"),
                more => format!("\"{name}\" {what}, and for {more} more"),
            };
        }
        if let Some(seat) = self.saving.awaited() {
            return format!(
                "\"{}\" to save its state",
                shown(self.name(seat).unwrap_or_default())
            );
        }
        let mut owing = (barrier.owing()).map(|client| shown(&barrier.declaration(client).name));
        let named: Vec<String> = (owing.by_ref().take(MOST_NAMED))
            .map(|name| format!("\"{name}\""))
            .collect();
        let more = match owing.count() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        match self.owed_step(barrier.step().sequence) {
            _ if named.is_empty() && self.is_paused() => {
                "a command, since the run is paused".to_owned()
            }
            _ if named.is_empty() => "the time of the next step".to_owned(),
            0 => format!("{}{more} to send initial values", named.join(", ")),
            step => format!("{}{more} to finish step {step}", named.join(", ")),
        }
    }

    /// Ends the run for a client that has not answered.
    fn end_of_patience(&mut self, cause: Cause, limit: &str) {
        let Phase::Running(barrier, _) = &self.phase else {
            return;
        };
        let present = barrier.owing().filter(|client| !self.is_away(*client));
        let away = barrier.owing().filter(|client| self.is_away(*client));
        let mut owing = present
            .chain(away)
            .map(|client| &*barrier.declaration(client).name);
        let client = owing.next().map(str::to_owned);
        let others: Vec<String> = owing.map(|name| format!("\"{name}\"")).collect();
        let others = match &*others {
            [] => String::new(),
            _ => format!("; nor has {}", others.join(", nor ")),
        };
        let reason = match self.owed_step(barrier.step().sequence) {
            0 => format!("has not sent its initial values {limit}{others}"),
            sequence => format!("has not finished step {sequence} {limit}{others}"),
        };
        self.end_for(cause, client, reason);
    }
}
