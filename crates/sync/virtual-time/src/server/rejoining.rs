//! Members that come back: a run with `rejoin` waits for a member that was lost. The member starts again, and is asked
//! again for all steps that it had run; when it has written the same values, the run continues.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::printable;

use super::{Out, Phase, Seat, Server, ToClient};
use crate::barrier::{Barrier, State};
use crate::memory::{MOST, MOST_SAVED, Memory, Place};
use crate::step::step_of;
use crate::{Cause, Declaration, SavedRun, Settings};

/// The members that are missing, and the memory of the run.
#[derive(Debug)]
pub(super) struct Rejoining {
    /// How long the run waits for each of them; `None`: it ends.
    limit: Option<Nanos>,
    /// True if the run can be saved.
    saves: bool,
    /// `None` if nothing needs it, or once the run is longer than the memory.
    pub(super) memory: Option<Memory>,
    away: Vec<Away>,
}

/// A member that was lost.
#[derive(Debug)]
struct Away {
    client: usize,
    reason: String,
    /// When that was noticed.
    since: Option<Nanos>,
    replay: Option<Replay>,
}

/// A member that has come back, and is asked again.
#[derive(Debug)]
struct Replay {
    seat: usize,
    place: Place,
    /// The step that it was asked for; `None` if it waits for the end of the current one.
    asked: Option<u64>,
    asked_at: Nanos,
    reads: Vec<u64>,
    /// The state that the member takes over after its initial values, in place of running its steps.
    state: Option<Vec<u8>>,
    has_restored: bool,
}

impl Replay {
    /// The member at `seat` is asked from the beginning.
    fn begin(seat: usize, now: Nanos, memory: Option<&Memory>) -> Self {
        Self {
            seat,
            place: memory.unwrap_or(&Memory::default()).start(),
            asked: Some(0),
            asked_at: now,
            reads: Vec::new(),
            state: None,
            has_restored: false,
        }
    }
}

impl Rejoining {
    pub(super) fn new(settings: &Settings) -> Self {
        let (limit, saves) = (settings.exchange.rejoin(), settings.save.is_some());
        Self {
            limit,
            saves,
            memory: (saves || limit.is_some()).then(Memory::default),
            away: Vec::new(),
        }
    }

    /// The run was restored: the clients at `seats` take over their states, or are asked again for all steps.
    pub(super) fn begin_again(&mut self, now: Nanos, seats: &[usize], saved: SavedRun) {
        let clients = seats.iter().zip(saved.clients).enumerate();
        let away = clients.map(|(client, (seat, saved_client))| Away {
            client,
            reason: String::new(),
            since: None,
            replay: Some(Replay {
                state: saved_client.state,
                ..Replay::begin(*seat, now, saved.memory.as_ref())
            }),
        });
        self.away = away.collect();
        self.memory = saved.memory;
    }

    /// The message by which a client takes over its state.
    pub(super) fn state<'m>(&'m self, client: usize, barrier: &'m Barrier<'_>) -> ToClient<'m> {
        let away = self.away_of(client).and_then(|at| self.away.get(at));
        let replay = away.and_then(|away| away.replay.as_ref());
        ToClient::Restore {
            sequence: barrier.step().sequence,
            writes: &barrier.committed()[barrier.writes(client)],
            state: (replay.and_then(|replay| replay.state.as_deref())).unwrap_or_default(),
        }
    }

    /// The members that have come back were asked for their initial values by `now`.
    pub(super) fn have_begun(&mut self, now: Nanos) {
        let replays = self.away.iter_mut().filter_map(|away| away.replay.as_mut());
        for replay in replays.filter(|replay| replay.asked == Some(0)) {
            replay.asked_at = now;
        }
    }

    /// True if no member is missing.
    pub(super) fn is_complete(&self) -> bool {
        self.away.is_empty()
    }

    /// True if commits are kept.
    fn keeps(&self) -> bool {
        self.saves || self.limit.is_some()
    }

    fn replay_at(&self, seat: usize) -> Option<&Replay> {
        let mut replays = self.away.iter().filter_map(|away| away.replay.as_ref());
        replays.find(|replay| replay.seat == seat)
    }

    fn away_of(&self, client: usize) -> Option<usize> {
        self.away.iter().position(|away| away.client == client)
    }
}

impl Server<'_> {
    /// True if a member is missing, or has not caught up yet: no step begins.
    pub(super) fn misses_members(&self) -> bool {
        !self.rejoining.away.is_empty()
    }

    /// True if this client is missing, or has not caught up yet.
    pub(super) fn is_away(&self, client: usize) -> bool {
        self.rejoining.away_of(client).is_some()
    }

    /// The clients that are missing, or have not caught up yet; true if they are back.
    pub(super) fn missed(&self) -> impl Iterator<Item = (usize, bool)> {
        let away = self.rejoining.away.iter();
        away.map(|away| (away.client, away.replay.is_some()))
    }

    /// The step that the memory gets next has these due clients.
    pub(super) fn remember_due(&mut self) {
        if !self.rejoining.keeps() {
            return;
        }
        if let (Phase::Running(barrier, _), Some(memory)) =
            (&self.phase, &mut self.rejoining.memory)
        {
            memory.note_due(barrier.members().clients.len(), barrier.due());
        }
    }

    /// Keeps the commit that was just made.
    pub(super) fn remember_commit(&mut self) {
        let (rejoining, Phase::Running(barrier, _)) = (&mut self.rejoining, &self.phase) else {
            return;
        };
        if !rejoining.keeps() {
            // All clients of a restored run have caught up.
            rejoining.memory = None;
            return;
        }
        let Some(memory) = &mut rejoining.memory else {
            return;
        };
        let step = barrier.step().sequence;
        memory.commit(step, barrier.committed());
        let most = if rejoining.saves { MOST_SAVED } else { MOST };
        // Whoever is missing already is still waited for.
        if memory.bytes() > most && rejoining.away.is_empty() {
            rejoining.memory = None;
            let what = match (rejoining.limit, rejoining.saves) {
                (None, _) => "the run can be saved only with the states of all clients",
                (Some(_), false) => "no member can come back any more",
                (Some(_), true) => {
                    "no member can come back any more, and the run can be saved only with the states of all clients"
                }
            };
            self.news.push_back(format!(
                "after step {step} {what}: the memory of the run is full ({} MiB)",
                most >> 20
            ));
        }
    }

    /// The client has been lost: waits for it.
    ///
    /// # Errors
    ///
    /// The run cannot wait for it; the text says why, if the run has the key `rejoin`.
    pub(super) fn wait_for(&mut self, client: usize, reason: &str) -> Result<(), String> {
        let (rejoining, Phase::Running(barrier, _)) = (&mut self.rejoining, &self.phase) else {
            return Err(String::new());
        };
        let Some(limit) = rejoining.limit else {
            return Err(String::new());
        };
        if rejoining.memory.is_none() {
            return Err("; it cannot come back, since the memory of the run is full".to_owned());
        }
        if barrier.state() == State::InitialWrite {
            return Err("; a member can come back from step 1 on".to_owned());
        }
        let name = &barrier.declaration(client).name;
        self.news.push_back(format!(
            "client \"{name}\" was lost: {}; the run waits {limit} for it to come back",
            printable(reason)
        ));
        // A member that had come back has its whole time again.
        rejoining.away.retain(|away| away.client != client);
        rejoining.away.push(Away {
            client,
            reason: reason.to_owned(),
            since: None,
            replay: None,
        });
        Ok(())
    }

    /// A client joins a run that has started. If it is one that is missing, it is asked again.
    pub(super) fn come_back(
        &mut self,
        now: Nanos,
        seat: usize,
        declaration: &Declaration,
    ) -> Result<(), String> {
        let Phase::Running(barrier, seats) = &mut self.phase else {
            return Err("the run has ended".to_owned());
        };
        let step = barrier.step().sequence;
        let started = format!("the run has started, and is at step {step}");
        let Rejoining { memory, away, .. } = &mut self.rejoining;
        let mut away = away.iter_mut();
        let Some(away) =
            away.find(|away| barrier.declaration(away.client).name == declaration.name)
        else {
            return Err(format!("{started}; start it again with this client"));
        };
        if away.replay.is_some() {
            return Err(format!(
                "{started}, and \"{}\" has come back already",
                declaration.name
            ));
        }
        if let Some(difference) = barrier.declaration(away.client).difference(declaration) {
            return Err(format!(
                "{started}, and its member \"{}\" is missing, but declared other things: {difference}",
                declaration.name
            ));
        }
        away.replay = Some(Replay::begin(seat, now, memory.as_ref()));
        seats[away.client] = seat;
        self.seats[seat] = Seat::Back(away.client);
        self.outbox.push_back(Out::Start(seat));
        self.news.push_back(format!(
            "client \"{}\" is back, and runs the steps up to {step} again",
            declaration.name
        ));
        Ok(())
    }

    /// The message of a step that is asked for again.
    pub(super) fn replayed(&self, seat: usize) -> Option<ToClient<'_>> {
        let replay = self.rejoining.replay_at(seat)?;
        Some(ToClient::Step {
            step: step_of(replay.asked?, self.settings.step),
            reads: &replay.reads,
        })
    }

    /// A member that has come back answers: its values must be those that it had written.
    pub(super) fn done_again(
        &mut self,
        now: Nanos,
        seat: usize,
        sequence: u64,
        values: impl ExactSizeIterator<Item = u64>,
    ) {
        let (rejoining, Phase::Running(barrier, _)) = (&mut self.rejoining, &self.phase) else {
            return;
        };
        let mut replays = rejoining.away.iter_mut().filter_map(|away| {
            let client = away.client;
            away.replay.as_mut().map(|replay| (client, replay))
        });
        let Some((client, replay)) = replays.find(|(_, replay)| replay.seat == seat) else {
            return;
        };
        if replay.asked != Some(sequence) {
            let reason = format!("answered step {sequence}, for which it was not asked again");
            return self.violated(seat, &reason);
        }
        let range = barrier.writes(client);
        if values.len() != range.len() {
            let reason = format!(
                "wrote {} values in step {sequence}, expected {}",
                values.len(),
                range.len()
            );
            return self.violated(seat, &reason);
        }
        replay.asked = None;
        let had_written = match &rejoining.memory {
            _ if replay.state.is_some() && sequence > 0 => &barrier.committed()[range.clone()],
            Some(memory) => {
                memory.pass(&mut replay.place);
                replay.place.of(range.clone())
            }
            // The initial values are not kept.
            None => &[],
        };
        let has_restored = replay.state.is_some() && sequence > 0;
        let mut pairs = values.zip(had_written).zip(range);
        if let Some(((value, before), at)) = pairs.find(|((value, before), _)| value != *before) {
            let variable = &barrier.members().variables[at].name;
            let reason = format!(
                "came back as another one: in step {sequence} it had written 0x{before:x} to \"{variable}\", and now \
                 writes 0x{value:x}; a member that is to come back must compute the same from the same reads"
            );
            return self.blame(seat, Cause::Failed, &reason);
        }
        if has_restored {
            replay.has_restored = true;
        }
        self.ask_again(now);
        self.advance(now);
    }

    /// Asks all members that have come back for their next steps. Members that have caught up take part again.
    pub(super) fn ask_again(&mut self, now: Nanos) {
        let (rejoining, Phase::Running(barrier, _)) = (&mut self.rejoining, &self.phase) else {
            return;
        };
        let memory = &rejoining.memory;
        let (seats, outbox, news) = (&mut self.seats, &mut self.outbox, &mut self.news);
        let asked = &mut self.asked;
        rejoining.away.retain_mut(|Away { client, replay, .. }| {
            let Some(replay) = replay.as_mut().filter(|replay| replay.asked.is_none()) else {
                return true;
            };
            replay.asked_at = now;
            if replay.state.is_some() && !replay.has_restored {
                replay.asked = Some(barrier.step().sequence);
                outbox.push_back(Out::Restore(replay.seat));
                return true;
            }
            replay.asked = match memory {
                Some(memory) if !replay.has_restored => memory.next(&mut replay.place, *client),
                _ => None,
            };
            if replay.asked.is_some() {
                replay.place.read(barrier.reads(*client), &mut replay.reads);
                outbox.push_back(Out::Step(replay.seat));
                return true;
            }
            let owes = barrier.owing().any(|owing| owing == *client);
            let was_due = barrier.due().any(|due| due == *client);
            if barrier.state() != State::PreRead && was_due && !owes {
                // It had answered the step that is under way, which others have not finished yet.
                return true;
            }
            seats[replay.seat] = Seat::Client(*client);
            if owes {
                outbox.push_back(Out::Step(replay.seat));
                *asked = now;
            }
            let name = &barrier.declaration(*client).name;
            news.push_back(format!("client \"{name}\" has caught up"));
            false
        });
    }

    /// When the next patience ends.
    pub(super) fn rejoin_deadline(&self) -> Nanos {
        let rejoining = &self.rejoining;
        let limit = rejoining.limit.unwrap_or(Nanos::MAX);
        let ends = rejoining
            .away
            .iter()
            .map(|away| match (&away.replay, away.since) {
                (Some(replay), _) if replay.asked.is_some() => replay.asked_at + self.settings.hang,
                (Some(_), _) => Nanos::MAX,
                (None, Some(since)) => since + limit,
                (None, None) => Nanos::ZERO,
            });
        ends.min().unwrap_or(Nanos::MAX)
    }

    /// Ends the run for a member that does not come back in time.
    pub(super) fn check_rejoin(&mut self, now: Nanos) {
        let (rejoining, Phase::Running(barrier, _)) = (&mut self.rejoining, &self.phase) else {
            return;
        };
        let limit = rejoining.limit.unwrap_or(Nanos::MAX);
        let hang = self.settings.hang;
        let mut end = None;
        for away in &mut rejoining.away {
            let since = *away.since.get_or_insert(now);
            let late =
                match &away.replay {
                    Some(replay) => replay.asked.filter(|_| now >= replay.asked_at + hang).map(
                        |step| {
                            (
                                Cause::Hung,
                                format!(
                                    "has come back, and has not run step {step} again within {hang}"
                                ),
                            )
                        },
                    ),
                    None if now >= since + limit => {
                        let reason = &away.reason;
                        let reason =
                            format!("was lost: {reason}; it did not come back within {limit}");
                        Some((Cause::Lost, reason))
                    }
                    None => None,
                };
            end = end.or(late.map(|late| (barrier.declaration(away.client).name.clone(), late)));
        }
        if let Some((client, (cause, reason))) = end {
            self.end_for(cause, Some(client), reason);
        }
    }
}
