//! Clients that run on the server's own thread.

use tickbus_base::time::Nanos;

use crate::client::Asked;
use crate::server::{Server, ToClient};
use crate::step::step_at;
use crate::{Declaration, Ended, Outcome, Participant};

/// The participants on the server's thread, with their seats.
#[derive(Default)]
pub(crate) struct Locals<'p>(Vec<Local<'p>>);

struct Local<'p> {
    participant: &'p mut dyn Participant,
    seat: usize,
    /// The virtual time of one step of the server.
    length: Nanos,
    asked: Option<Asked>,
    /// The step after which the server wants the state, or the state to take over.
    saves: Option<u64>,
    restores: Option<(u64, Vec<u8>)>,
    reads: Vec<u64>,
    writes: Vec<u64>,
    end: Option<Result<Outcome, Ended>>,
}

impl<'p> Locals<'p> {
    /// Lets these participants join.
    pub(crate) fn join(
        server: &mut Server<'_>,
        now: Nanos,
        participants: impl IntoIterator<Item = &'p mut dyn Participant>,
    ) -> Self {
        let declared = |participant: &'p mut dyn Participant| {
            let declaration = participant.declare();
            (participant, declaration)
        };
        let mut declared: Vec<_> = participants.into_iter().map(declared).collect();
        // Local clients run one after another in the order of all clients.
        declared.sort_by(|(_, a), (_, b)| a.name.cmp(&b.name));
        let local = |(participant, declaration): (&'p mut dyn Participant, Declaration)| {
            let seat = server.connected(now);
            let local = Local {
                participant,
                seat,
                length: Nanos::ZERO,
                asked: None,
                saves: None,
                restores: None,
                reads: vec![0; declaration.reads.len()],
                writes: vec![0; declaration.writes.len()],
                end: None,
            };
            server.can_save(seat);
            server.join(now, seat, declaration);
            local
        };
        Self(declared.into_iter().map(local).collect())
    }

    /// Takes a message, if it is for one of the local participants. They run once all messages were sent, at the same
    /// time as clients elsewhere.
    pub(crate) fn take(&mut self, seat: usize, message: &ToClient<'_>) -> bool {
        let mut locals = self.0.iter_mut();
        let Some(local) = locals.find(|local| local.seat == seat && local.end.is_none()) else {
            return false;
        };
        match message {
            ToClient::Start { step, .. } => {
                local.length = *step;
                local.asked = Some(Asked::Initial);
            }
            ToClient::Step { step, reads } => {
                local.reads.copy_from_slice(reads);
                local.asked = Some(Asked::Step(*step));
            }
            ToClient::Save(step) => local.saves = Some(*step),
            ToClient::Restore {
                sequence,
                writes,
                state,
            } => {
                local.writes.copy_from_slice(writes);
                local.restores = Some((*sequence, state.to_vec()));
            }
            // Participants on the server's thread cannot meet others.
            ToClient::Waiting(_)
            | ToClient::Meet(_)
            | ToClient::Members(..)
            | ToClient::Until(_) => {}
            ToClient::End(end) => {
                local.asked = None;
                local.end = Some((*end).clone());
            }
        }
        true
    }

    /// Runs the participants that have requests; false if there were none.
    pub(crate) fn run(&mut self, server: &mut Server<'_>, now: Nanos) -> bool {
        let mut has_run = false;
        for local in &mut self.0 {
            let Local {
                participant,
                seat,
                length,
                reads,
                writes,
                ..
            } = local;
            if let Some(step) = local.saves.take() {
                has_run = true;
                let state = participant.save();
                let state = state.as_deref().map_err(|reason| &**reason);
                server.has_saved(now, *seat, step, state);
                continue;
            }
            if let Some((step, state)) = local.restores.take() {
                has_run = true;
                match participant.restore(&state) {
                    Ok(()) => server.done(now, *seat, step, writes.iter().copied()),
                    Err(reason) => server.gave_up(*seat, &reason),
                }
                continue;
            }
            let (sequence, ran) = match local.asked.take() {
                Some(Asked::Initial) => {
                    participant.initial(writes);
                    (0, Ok(()))
                }
                Some(Asked::Step(step)) => (step.sequence, participant.run(step, reads, writes)),
                Some(Asked::End(_)) | None => continue,
            };
            has_run = true;
            match ran {
                Ok(()) => {
                    let next = (participant.next_update()).map_or(0, |time| step_at(time, *length));
                    server.done_until(now, *seat, (sequence, next), writes.iter().copied());
                }
                Err(reason) => server.gave_up(*seat, &reason),
            }
        }
        has_run
    }

    /// The first local participant that was refused before the run.
    pub(crate) fn refusal(&self) -> Option<&Ended> {
        let mut ends = self.0.iter().filter_map(|local| local.end.as_ref());
        ends.find_map(|end| end.as_ref().err())
    }
}
