//! Clients that exchange their values without the server: they meet before the start, and run in windows of steps that
//! the server allows. They report their values in order, a few steps late, and the server follows by the same rules; so
//! it records, hashes and shows the run as ever.

use std::collections::BTreeMap;
use std::hash::{BuildHasher as _, Hasher as _, RandomState};

use tickbus_base::time::Nanos;

use super::{Out, Phase, Seat, Server};
use crate::{Declaration, Exchange, MemberList, Pacing, State};

/// How long clients may take to meet.
const MEETING: Nanos = Nanos::from_secs(10);

/// The most clients that meet: each connects with each.
const MOST: usize = 64;

/// The most values that such a client writes. Its frame fits into the buffers of a socket several times, so that two
/// clients never wait for each other to read.
const MOST_VALUES: usize = 1000;

/// The window grows if half of it is used up faster, and shrinks if it takes four times as long: so a pause comes soon, and
/// the clients seldom wait for the server.
const HALF: Nanos = Nanos::from_millis(5);

/// The largest window, in steps.
const MOST_STEPS: u64 = 1 << 16;

/// The values of a client in one window, in bytes: what the server has to keep for a client that others have left behind.
const MOST_BYTES: u64 = 1 << 18;

/// Clients that meet before the start.
#[derive(Debug)]
pub(super) struct Meeting {
    pub(super) list: MemberList,
    /// The seats of the clients, in the order of the list.
    seats: Vec<usize>,
    /// The answers so far, by seat.
    answers: BTreeMap<usize, String>,
    has_addresses: bool,
    until: Nanos,
}

/// The steps that clients may run without the server.
#[derive(Debug)]
pub(super) struct Allowed {
    until: u64,
    window: u64,
    most: u64,
    /// When the window was last moved.
    at: Nanos,
    /// The last step that a client has reported: all have finished the one before.
    reported: u64,
}

impl Allowed {
    pub(super) const fn until(&self) -> u64 {
        self.until
    }

    pub(super) fn has_reported(&mut self, sequence: u64) {
        self.reported = self.reported.max(sequence);
    }

    pub(super) const fn reported(&self) -> u64 {
        self.reported
    }
}

impl Server<'_> {
    /// The client at `seat` can exchange its values with others.
    pub(crate) fn can_meet(&mut self, seat: usize) {
        self.able.insert(seat);
    }

    /// True if the clients exchange their values without the server. Then `done` may come before the server is there:
    /// see [`takes`](Self::takes).
    pub fn is_direct(&self) -> bool {
        self.allowed.is_some()
    }

    /// True if the next values of the client at `seat` are due. Those of a client that is ahead have to wait.
    pub fn takes(&self, seat: usize) -> bool {
        match (&self.phase, self.seats[seat]) {
            (Phase::Running(barrier, _), Seat::Client(client)) => barrier.is_owing(client),
            _ => true,
        }
    }

    /// A client has sent its values of this step, which have to wait.
    pub(crate) fn is_ahead(&mut self, sequence: u64) {
        if let Some(allowed) = &mut self.allowed {
            allowed.has_reported(sequence.min(allowed.until));
        }
    }

    /// True if clients have run, or may run, steps that the server has not followed yet.
    pub(super) fn has_run_ahead(&self) -> bool {
        self.step().is_some_and(|step| self.until() > step.sequence)
    }

    /// The last step that the clients may run without the server.
    pub(super) fn until(&self) -> u64 {
        self.allowed.as_ref().map_or(0, Allowed::until)
    }

    /// The client at `seat` listens at `address`.
    pub(crate) fn is_at(&mut self, now: Nanos, seat: usize, token: u64, address: &str) {
        self.answered(now, seat, token, (false, address));
    }

    /// The client at `seat` has reached all others, or not, for this reason.
    pub(crate) fn has_met(&mut self, now: Nanos, seat: usize, token: u64, reason: &str) {
        self.answered(now, seat, token, (true, reason));
    }

    pub(super) fn token(&self) -> u64 {
        (self.meeting.as_ref()).map_or(0, |meeting| meeting.list.token)
    }

    /// When a meeting takes too long.
    pub(super) fn meeting_until(&self) -> Nanos {
        (self.meeting.as_ref()).map_or(Nanos::MAX, |meeting| meeting.until)
    }

    /// All have joined: lets them meet, if they shall and can, or starts the run.
    pub(super) fn meet_or_start(&mut self, now: Nanos) {
        if self.settings.exchange != Exchange::Direct {
            return self.start(now);
        }
        if let Err(why) = self.begin_meeting(now) {
            self.start_without(now, &why);
        }
    }

    /// Ends a meeting that takes too long.
    pub(super) fn end_of_meeting(&mut self, now: Nanos) {
        let Some(meeting) = &self.meeting else {
            return;
        };
        if now >= meeting.until {
            let silent = (meeting.seats.iter()).find(|seat| !meeting.answers.contains_key(seat));
            let name = silent.and_then(|seat| self.name(*seat)).unwrap_or_default();
            let why = format!("\"{name}\" has not met the others within {MEETING}");
            self.start_without(now, &why);
        }
    }

    /// Allows further steps, if the run is not held; false if none is left.
    pub(super) fn allow_steps(&mut self, now: Nanos) -> bool {
        let (Phase::Running(barrier, seats), Some(allowed)) = (&self.phase, &mut self.allowed)
        else {
            return false;
        };
        let step = barrier.step();
        let left = allowed.until - step.sequence;
        let is_held = self.stop_by.is_some() || (self.is_paused && self.singles == 0);
        if is_held || left > allowed.window / 2 {
            return left > 0;
        }
        let took = now - allowed.at;
        if took < HALF {
            allowed.window = (allowed.window * 2).min(allowed.most);
        } else if took > HALF + HALF + HALF + HALF {
            allowed.window = (allowed.window / 2).max(1);
        }
        allowed.at = now;
        let mut until = (step.sequence + allowed.window).min(barrier.last_step());
        until = until.min(self.settings.steps.unwrap_or(u64::MAX));
        if self.is_paused {
            until = until.min(allowed.until.saturating_add(self.singles));
        }
        if until > allowed.until {
            if self.is_paused {
                self.singles -= until - allowed.until;
            }
            allowed.until = until;
            self.outbox
                .extend(seats.iter().map(|seat| Out::Until(*seat)));
        }
        allowed.until > step.sequence
    }

    /// The step that a client owes at least: others, who have finished the one before, may have reported it.
    pub(super) fn owed_step(&self, sequence: u64) -> u64 {
        let reported = self.allowed.as_ref().map_or(0, Allowed::reported);
        sequence.max(reported)
    }

    fn begin_meeting(&mut self, now: Nanos) -> Result<(), String> {
        let Phase::Joining(joining, logic) = &self.phase else {
            return Err("the run has started".to_owned());
        };
        if !logic.is_passive() {
            return Err("the server has logic".to_owned());
        }
        if self.settings.restore.is_some() {
            return Err("the run was restored".to_owned());
        }
        if self.settings.pacing != Pacing::Fast {
            return Err("the run has a pace".to_owned());
        }
        if joining.joined().len() > MOST {
            return Err(format!("more than {MOST} clients take part"));
        }
        let mut joined: Vec<&(usize, Declaration)> = joining.joined().collect();
        joined.sort_by(|a, b| a.1.name.cmp(&b.1.name));
        for (seat, declaration) in &joined {
            let name = &declaration.name;
            if !self.able.contains(seat) {
                return Err(format!(
                    "\"{name}\" cannot exchange values with other clients"
                ));
            }
            if declaration.interval.is_some() {
                // Earlier clients of this version know multiples only.
                return Err(format!(
                    "the interval of \"{name}\" is no whole number of steps"
                ));
            }
            if declaration.writes.len() > MOST_VALUES {
                return Err(format!(
                    "\"{name}\" writes more than {MOST_VALUES} variables"
                ));
            }
        }
        let member =
            |(_, declaration): &&(usize, Declaration)| (String::new(), declaration.clone());
        let list = MemberList {
            // Above 0, which belongs to no meeting.
            token: RandomState::new().build_hasher().finish() | 1,
            step: self.settings.step,
            own: 0,
            members: joined.iter().map(member).collect(),
        };
        let seats: Vec<usize> = joined.iter().map(|(seat, _)| *seat).collect();
        self.outbox
            .extend(seats.iter().map(|seat| Out::Meet(*seat)));
        self.meeting = Some(Meeting {
            list,
            seats,
            answers: BTreeMap::new(),
            has_addresses: false,
            until: now + MEETING,
        });
        Ok(())
    }

    /// Takes an answer to the first question of a meeting, or to the second one.
    fn answered(&mut self, now: Nanos, seat: usize, token: u64, (is_second, answer): (bool, &str)) {
        let Some(meeting) = &mut self.meeting else {
            // The others have left, or did not wait any longer.
            return;
        };
        if meeting.list.token != token || meeting.has_addresses != is_second {
            return;
        }
        let Some(place) = meeting.seats.iter().position(|other| *other == seat) else {
            return;
        };
        // A second answer replaces nothing.
        let answer = &*(meeting.answers.entry(seat)).or_insert_with(|| answer.to_owned());
        if !is_second {
            meeting.list.members[place].0.clone_from(answer);
        }
        if meeting.answers.len() < meeting.seats.len() {
            return;
        }
        let failed = (meeting.seats.iter().enumerate())
            .find(|(_, seat)| meeting.answers[seat].is_empty() != is_second)
            .map(|(at, seat)| (&meeting.list.members[at].1.name, &meeting.answers[seat]));
        if let Some((name, reason)) = failed {
            let why = if is_second {
                format!("\"{name}\" {}", tickbus_base::toml_text::printable(reason))
            } else {
                format!("\"{name}\" cannot be reached by other clients")
            };
            return self.start_without(now, &why);
        }
        if !is_second {
            if !meeting.list.fits() {
                let why = "the names of all variables together are too long";
                return self.start_without(now, why);
            }
            meeting.has_addresses = true;
            meeting.answers.clear();
            let places = meeting.seats.iter().enumerate();
            let members = places.map(|(at, seat)| Out::Members(*seat, at));
            return self.outbox.extend(members);
        }
        let values = (meeting.list.members.iter()).map(|(_, declaration)| declaration.writes.len());
        let bytes = 21 + 8 * values.max().unwrap_or(0) as u64;
        self.allowed = Some(Allowed {
            until: 0,
            window: 1,
            most: (MOST_BYTES / bytes).clamp(1, MOST_STEPS),
            at: now,
            reported: 0,
        });
        self.meeting = None;
        self.news
            .push_back("the clients exchange their values directly".to_owned());
        self.start(now);
    }

    /// Starts a run in which the server passes the values on.
    fn start_without(&mut self, now: Nanos, why: &str) {
        debug_assert_eq!(self.state(), State::Start, "the clients meet before it");
        self.meeting = None;
        self.news
            .push_back(format!("the server passes the values on: {why}"));
        self.start(now);
    }
}
