//! The server, without I/O: state, time and messages in; messages and the next deadline out.

mod direct;
mod joining;
mod message;
mod outbox;
mod patience;
mod rejoining;
mod saving;
mod showing;
mod stepping;

use std::collections::{BTreeSet, VecDeque};

use tickbus_base::Mistake;
use tickbus_base::time::{Nanos, Pace};
use tickbus_base::toml_text::{printable, shown};

use crate::barrier::{Barrier, State};
use crate::logic::Logic;
use crate::{Cause, Declaration, Ended, Outcome, Settings, Step};
use direct::{Allowed, Meeting};
use joining::Joining;
pub(crate) use joining::MOST_CLIENTS;
pub use message::{Control, ToClient};
use outbox::Out;
use rejoining::Rejoining;
pub(crate) use saving::Saved;
use saving::Saving;

/// The time for the clients to finish a step after the run was stopped.
const STOP_PATIENCE: Nanos = Nanos::from_secs(1);

/// A server for one run.
///
/// The owner of the connections gives each a seat by [`connected`](Self::connected), reports everything that arrives,
/// fetches the messages by [`poll`](Self::poll) until none are left, and calls [`tick`](Self::tick) when
/// [`deadline`](Self::deadline) has come. A seat is free again when its client was [lost](Self::lost), or its
/// [`ToClient::End`] was fetched; the owner then forgets the connection. The run is over when there is an
/// [`outcome`](Self::outcome) and no message is left.
#[derive(Debug)]
pub struct Server<'l> {
    settings: Settings,
    phase: Phase<'l>,
    seats: Vec<Seat>,
    /// The seats whose clients learn that the server waits.
    informed: BTreeSet<usize>,
    /// When these clients were last informed.
    informed_at: Nanos,
    /// The text that they got.
    waits_for: String,
    outbox: VecDeque<Out>,
    news: VecDeque<String>,
    /// The end of a refused client, while its message is fetched.
    refused: Result<Outcome, Ended>,
    /// When the clients could begin to join, or were last sent a request.
    asked: Nanos,
    is_paused: bool,
    /// The number of steps to run in spite of the pause.
    singles: u64,
    /// The deadline for the end of a stopped run.
    stop_by: Option<Nanos>,
    pace: Option<Pace>,
    /// The seats whose clients can meet.
    able: BTreeSet<usize>,
    /// The clients that meet before the start.
    meeting: Option<Meeting>,
    /// The steps of clients that exchange their values without the server; `None` if the server passes them on.
    allowed: Option<Allowed>,
    rejoining: Rejoining,
    saving: Saving,
}

#[derive(Debug)]
enum Phase<'l> {
    Joining(Joining, Logic<'l>),
    /// The barrier, and the seats of the clients.
    Running(Box<Barrier<'l>>, Vec<usize>),
    Ended(Result<Outcome, Ended>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seat {
    Free,
    /// Connected at this time, but has not joined.
    Silent(Nanos),
    /// Joined; the run has not started.
    Joined,
    /// The client of this number.
    Client(usize),
    /// The client of this number has come back, and runs its steps again.
    Back(usize),
    /// The next message is the end.
    Leaving,
}

impl<'l> Server<'l> {
    /// A server that waits for its clients from `now` on.
    ///
    /// # Errors
    ///
    /// The settings make no sense.
    pub fn new(settings: Settings, logic: Logic<'l>, now: Nanos) -> Result<Self, Mistake> {
        settings.check()?;
        if (settings.save.is_some() || settings.restore.is_some()) && !logic.is_passive() {
            return Err(Mistake::new(
                "a run whose server has logic cannot be saved or restored: the logic may remember anything",
                "make a client of the logic, or run without saving",
            ));
        }
        let joining = Joining::new(&settings.start)?;
        Ok(Self {
            is_paused: settings.paused,
            phase: Phase::Joining(joining, logic),
            rejoining: Rejoining::new(&settings),
            saving: Saving::new(&settings),
            settings,
            seats: Vec::new(),
            informed: BTreeSet::new(),
            informed_at: now,
            waits_for: String::new(),
            outbox: VecDeque::new(),
            news: VecDeque::new(),
            refused: Err(Ended::before(Cause::Refused, "")),
            asked: now,
            singles: 0,
            stop_by: None,
            pace: None,
            able: BTreeSet::new(),
            meeting: None,
            allowed: None,
        })
    }

    /// The state of the run.
    pub fn state(&self) -> State {
        match &self.phase {
            Phase::Joining(..) => State::Start,
            Phase::Running(barrier, _) => barrier.state(),
            Phase::Ended(_) => State::Ended,
        }
    }

    /// The current or last step; `None` before the start and after the end.
    pub fn step(&self) -> Option<Step> {
        match &self.phase {
            Phase::Running(barrier, _) => Some(barrier.step()),
            _ => None,
        }
    }

    /// True if no further step begins.
    pub fn is_paused(&self) -> bool {
        self.is_paused && self.singles == 0
    }

    /// The outcome of the run, once it has ended.
    pub fn outcome(&self) -> Option<&Result<Outcome, Ended>> {
        match &self.phase {
            Phase::Ended(outcome) => Some(outcome),
            _ => None,
        }
    }

    /// The name of the client at `seat`, once it has joined.
    pub fn name(&self, seat: usize) -> Option<&str> {
        match (&self.phase, self.seats[seat]) {
            (Phase::Joining(joining, _), Seat::Joined) => joining.name(seat),
            (Phase::Running(barrier, _), Seat::Client(client) | Seat::Back(client)) => {
                Some(&barrier.declaration(client).name)
            }
            _ => None,
        }
    }

    /// The clients that the start waits for, as text for people; `None` once everyone has joined.
    pub fn missing(&self) -> Option<String> {
        match &self.phase {
            Phase::Joining(joining, _) => Some(joining.missing()),
            _ => None,
        }
    }

    /// The seat of the first client, in the order of names, that owes an answer.
    pub fn awaited(&self) -> Option<usize> {
        match &self.phase {
            Phase::Running(barrier, seats) => {
                let mut owing = barrier.owing().filter(|client| !self.is_away(*client));
                owing.next().map(|client| seats[client])
            }
            _ => None,
        }
    }

    /// The next line for people about an event: a client joined or was refused and why, or the run starts.
    pub fn news(&mut self) -> Option<String> {
        self.news.pop_front()
    }

    /// Ends the run for a reason of its host.
    pub fn abort(&mut self, cause: Cause, reason: &str) {
        if self.outcome().is_none() {
            self.end_for(cause, None, reason.to_owned());
        }
    }

    /// A client has connected; returns its seat.
    pub fn connected(&mut self, now: Nanos) -> usize {
        let free = self.seats.iter().position(|seat| *seat == Seat::Free);
        let seat = free.unwrap_or_else(|| {
            self.seats.push(Seat::Free);
            self.seats.len() - 1
        });
        self.seats[seat] = Seat::Silent(now);
        self.informed.remove(&seat);
        self.able.remove(&seat);
        self.saving.connected(seat);
        if self.outcome().is_some() {
            self.seats[seat] = Seat::Leaving;
            self.outbox.push_back(Out::End(seat));
        }
        seat
    }

    /// The client at `seat` wants [`ToClient::Waiting`].
    pub(crate) fn keep_informed(&mut self, seat: usize) {
        self.informed.insert(seat);
    }

    /// The client at `seat` declares its variables.
    pub fn join(&mut self, now: Nanos, seat: usize, mut declaration: Declaration) {
        match self.seats[seat] {
            Seat::Silent(_) => {}
            Seat::Joined | Seat::Client(_) | Seat::Back(_) => {
                return self.violated(seat, "joined twice");
            }
            Seat::Free | Seat::Leaving => return,
        }
        let name = declaration.name.clone();
        let refused = match &mut self.phase {
            Phase::Joining(..) if self.meeting.is_some() => {
                Err("the run is about to start without this client".to_owned())
            }
            Phase::Joining(joining, _) => declaration
                .fit(self.settings.step)
                .and_then(|()| match &self.settings.restore {
                    Some(saved) => saved.takes(&declaration, self.saving.is_able(seat)),
                    None => Ok(()),
                })
                .and_then(|()| joining.join(seat, declaration)),
            Phase::Running(..) => {
                let fit = declaration.fit(self.settings.step);
                match fit.and_then(|()| self.come_back(now, seat, &declaration)) {
                    Ok(()) => return,
                    refused => refused,
                }
            }
            Phase::Ended(_) => Err("the run has ended".to_owned()),
        };
        if let Err(reason) = refused {
            return self.refuse(seat, Some(name), &reason);
        }
        self.seats[seat] = Seat::Joined;
        self.news.push_back(format!("client \"{name}\" has joined"));
        if let Phase::Joining(joining, _) = &self.phase
            && joining.is_complete()
        {
            self.meet_or_start(now);
        }
    }

    /// The client at `seat` has finished its run of the step `sequence` (0: the initial write), and writes `values`.
    pub fn done(
        &mut self,
        now: Nanos,
        seat: usize,
        sequence: u64,
        values: impl ExactSizeIterator<Item = u64>,
    ) {
        self.done_until(now, seat, (sequence, 0), values);
    }

    /// Like [`done`](Self::done), for a client that wants to run again in the step `next`: in the following one if that
    /// has passed, and as declared if it is 0.
    pub fn done_until(
        &mut self,
        now: Nanos,
        seat: usize,
        (sequence, next): (u64, u64),
        values: impl ExactSizeIterator<Item = u64>,
    ) {
        if matches!(self.seats[seat], Seat::Back(_))
            && self.outbox.iter().all(|out| out.seat() != seat)
        {
            return self.done_again(now, seat, sequence, values);
        }
        let (Seat::Client(client), Phase::Running(barrier, _)) =
            (self.seats[seat], &mut self.phase)
        else {
            return self.violated(seat, "answered before it was asked");
        };
        if self.allowed.is_none() && self.outbox.iter().any(|out| out.seat() == seat) {
            return self.violated(seat, "answered before it was asked");
        }
        if let Some(allowed) = &mut self.allowed {
            allowed.has_reported(sequence);
        }
        if let Err(reason) = barrier.done(client, (sequence, next), values) {
            return self.violated(seat, &reason);
        }
        if barrier.is_synchronised() {
            self.advance(now);
        }
    }

    /// The client at `seat` reports that it cannot, or need not, continue.
    pub fn gave_up(&mut self, seat: usize, reason: &str) {
        match self.seats[seat] {
            Seat::Client(_) | Seat::Back(_) => {
                self.blame(seat, Cause::Failed, &format!("gave up: {reason}"));
            }
            Seat::Free | Seat::Leaving => {}
            Seat::Silent(_) | Seat::Joined => {
                let name = self.name(seat).map(str::to_owned);
                self.refuse(seat, name, &format!("gave up before the start: {reason}"));
            }
        }
    }

    /// The connection of the client at `seat` is gone; frees the seat.
    pub fn lost(&mut self, seat: usize, reason: &str) {
        match std::mem::replace(&mut self.seats[seat], Seat::Free) {
            Seat::Client(client) | Seat::Back(client) => {
                if let Err(more) = self.wait_for(client, reason)
                    && let Phase::Running(barrier, _) = &self.phase
                {
                    let client = barrier.declaration(client).name.clone();
                    let reason = format!("was lost: {reason}{more}");
                    self.end_for(Cause::Lost, Some(client), reason);
                }
            }
            Seat::Joined => {
                if let Phase::Joining(joining, _) = &mut self.phase {
                    let name = joining.name(seat).unwrap_or_default();
                    self.news
                        .push_back(format!("client \"{name}\" is gone again: {reason}"));
                    joining.remove(seat);
                    self.meeting = None;
                }
            }
            Seat::Free | Seat::Silent(_) | Seat::Leaving => {}
        }
        self.outbox.retain(|out| out.seat() != seat);
        self.saving.gone(seat);
    }

    /// The client at `seat` violates the protocol: it is excluded, or, once the run has started, ends it.
    pub fn violated(&mut self, seat: usize, reason: &str) {
        match self.seats[seat] {
            Seat::Client(_) | Seat::Back(_) => self.blame(seat, Cause::Protocol, reason),
            Seat::Silent(_) | Seat::Joined => {
                let name = self.name(seat).map(str::to_owned);
                self.refuse(seat, name, reason);
            }
            Seat::Free | Seat::Leaving => {}
        }
    }

    /// Pauses, steps, continues or stops.
    pub fn control(&mut self, now: Nanos, control: Control) {
        match control {
            Control::Pause => (self.is_paused, self.singles) = (true, 0),
            Control::Step(count) => {
                self.singles = if self.is_paused { self.singles } else { 0 };
                self.is_paused = true;
                self.singles = self.singles.saturating_add(count);
            }
            Control::Run => (self.is_paused, self.singles) = (false, 0),
            Control::Save => self.ask_to_save(),
            Control::Stop => match &self.phase {
                Phase::Joining(joining, _) => {
                    let reason = format!("stopped while it waited for {}", joining.missing());
                    self.end_for(Cause::Stopped, None, reason);
                }
                Phase::Running(..) => {
                    self.stop_by.get_or_insert(now + STOP_PATIENCE);
                }
                Phase::Ended(_) => {}
            },
        }
        self.advance(now);
    }

    /// All clients that are due were sent their requests by `now`, and those on the server's own thread have run. The
    /// time to answer starts here for the others, so that the server's own time does not count.
    pub fn sent(&mut self, now: Nanos) {
        // While members are missing no step begins, and only those that have come back are asked.
        if matches!(self.phase, Phase::Running(..)) && !self.misses_members() {
            self.asked = now;
        }
        self.rejoining.have_begun(now);
    }

    fn blame(&mut self, seat: usize, cause: Cause, reason: &str) {
        let client = self.name(seat).map(str::to_owned);
        self.end_for(cause, client, reason.to_owned());
    }

    fn end_for(&mut self, cause: Cause, client: Option<String>, reason: String) {
        let steps = match &self.phase {
            Phase::Running(barrier, _) => barrier.steps(),
            _ => 0,
        };
        self.end(Err(Ended {
            cause,
            client,
            reason,
            steps,
        }));
    }

    /// Ends the run for everyone; discards a step that was not sent yet.
    fn end(&mut self, outcome: Result<Outcome, Ended>) {
        self.outbox
            .retain(|out| matches!(out, Out::Refused(..) | Out::End(_)));
        for (at, seat) in self.seats.iter_mut().enumerate() {
            if !matches!(seat, Seat::Free | Seat::Leaving) {
                *seat = Seat::Leaving;
                self.outbox.push_back(Out::End(at));
            }
        }
        self.phase = Phase::Ended(outcome);
        self.end_of_saving();
    }

    /// Refuses a client before the start.
    fn refuse(&mut self, seat: usize, client: Option<String>, reason: &str) {
        if let Phase::Joining(joining, _) = &mut self.phase
            && self.seats[seat] == Seat::Joined
        {
            joining.remove(seat);
            self.meeting = None;
        }
        self.seats[seat] = Seat::Leaving;
        let who = match &client {
            Some(name) => format!("client \"{}\"", shown(name)),
            None => "a client without a name".to_owned(),
        };
        // The reason may contain a client's text.
        self.news
            .push_back(format!("{who} was refused: {}", printable(reason)));
        let ended = Ended {
            client,
            ..Ended::before(Cause::Refused, reason)
        };
        self.outbox.push_back(Out::Refused(seat, Box::new(ended)));
    }
}
