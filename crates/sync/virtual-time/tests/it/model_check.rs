//! Exhaustive search of the barrier: every order in which the messages of two and three clients can arrive, with a
//! fault at every point of each.

use std::num::NonZeroU32;

use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;
use tickbus_virtual_time::server::{Server, ToClient};
use tickbus_virtual_time::{
    Cause, Declaration, Ended, Logic, Outcome, Settings, StartCondition, State, TraceHash, Variable,
};

const HANG: Nanos = Nanos::from_secs(1);

/// Makes the choices of one path after another, until all paths were taken.
#[derive(Default)]
struct Choices {
    /// The choices taken, each with the number of alternatives.
    taken: Vec<(usize, usize)>,
    at: usize,
}

/// True for a client that asks for each of its steps, in place of declaring a multiple.
const fn asks(client: usize) -> bool {
    client % 2 == 1
}

impl Choices {
    fn choose(&mut self, of: usize) -> usize {
        if self.at == self.taken.len() {
            self.taken.push((0, of));
        }
        let (chosen, was) = self.taken[self.at];
        assert_eq!(was, of, "a path is the same when it is taken again");
        self.at += 1;
        chosen
    }

    /// Moves to the next path; false after the last one.
    fn next(&mut self) -> bool {
        self.at = 0;
        while let Some((chosen, of)) = self.taken.pop() {
            if chosen + 1 < of {
                self.taken.push((chosen + 1, of));
                return true;
            }
        }
        false
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    /// Connects and joins.
    Join(usize),
    /// Answers the request.
    Answer(usize),
    Lose(usize),
    /// Repeats the previous answer, or answers before any request.
    Unasked(usize),
    /// Answers the request, and at once the possible next one.
    Early(usize),
    GiveUp(usize),
    /// Nobody does anything any more.
    Silence,
    /// Another client connects and joins.
    Stranger,
}

#[derive(Clone, Debug)]
struct Client {
    name: String,
    multiple: u32,
    seat: Option<usize>,
    /// The last request without an answer.
    owes: Option<u64>,
    /// The steps that this client answered.
    answered: Vec<u64>,
    end: Option<Result<Outcome, Ended>>,
}

struct World {
    server: Server<'static>,
    clients: Vec<Client>,
    steps: u64,
    fault: Option<Action>,
    stranger: Option<usize>,
    is_stranger_refused: bool,
}

impl World {
    fn new(multiples: &[u32], steps: u64) -> Self {
        let names: Vec<String> = (0..multiples.len()).map(|at| format!("c{at}")).collect();
        let settings = Settings {
            steps: Some(steps),
            hang: HANG,
            ..Settings::new(Nanos::from_millis(1), StartCondition::Names(names.clone()))
        };
        let client = |(name, multiple): (&String, &u32)| Client {
            name: name.clone(),
            multiple: *multiple,
            seat: None,
            owes: None,
            answered: Vec::new(),
            end: None,
        };
        Self {
            server: Server::new(settings, Logic::new(), Nanos::ZERO).expect("right"),
            clients: names.iter().zip(multiples).map(client).collect(),
            steps,
            fault: None,
            stranger: None,
            is_stranger_refused: false,
        }
    }

    fn has_started(&self) -> bool {
        self.server.state() != State::Start
    }

    fn actions(&self, with_stranger: bool) -> Vec<Action> {
        let mut actions = Vec::new();
        if self.server.outcome().is_some() {
            return actions;
        }
        for (at, client) in self.clients.iter().enumerate() {
            match (client.seat, client.owes) {
                (None, _) => actions.push(Action::Join(at)),
                (_, Some(_)) => {
                    actions.push(Action::Answer(at));
                    if self.fault.is_none() {
                        actions.push(Action::Early(at));
                    }
                }
                _ => {}
            }
            if self.fault.is_none() && client.seat.is_some() {
                actions.extend([Action::Lose(at), Action::Unasked(at), Action::GiveUp(at)]);
            }
        }
        if self.fault.is_none() && self.has_started() {
            actions.push(Action::Silence);
        }
        if with_stranger && self.stranger.is_none() {
            actions.push(Action::Stranger);
        }
        actions
    }

    fn take(&mut self, action: Action) {
        let now = Nanos::ZERO;
        match action {
            Action::Join(at) => {
                let seat = self.server.connected(now);
                self.clients[at].seat = Some(seat);
                let declaration = self.declaration(at);
                self.server.join(now, seat, declaration);
            }
            Action::Answer(at) => {
                let sequence = self.clients[at].owes.take().expect("enabled");
                self.clients[at].answered.push(sequence);
                let seat = self.clients[at].seat.expect("enabled");
                let value = 100 * sequence + at as u64;
                let answer = (sequence, self.next(at, sequence));
                self.server
                    .done_until(now, seat, answer, [value].into_iter());
            }
            Action::Lose(at) => {
                let was_running = self.has_started();
                self.fault = Some(action);
                let seat = self.clients[at].seat.take().expect("enabled");
                self.server.lost(seat, "cut");
                if was_running {
                    // A client that is gone does not come again, and gets nothing.
                    self.clients[at].seat = Some(usize::MAX);
                }
            }
            Action::Unasked(at) => {
                self.fault = Some(action);
                let seat = self.clients[at].seat.expect("enabled");
                let sequence = match self.clients[at].owes {
                    Some(owed) => owed.wrapping_sub(1),
                    None => self.clients[at].answered.last().copied().unwrap_or(0),
                };
                self.server.done(now, seat, sequence, [7].into_iter());
            }
            Action::Early(at) => {
                self.fault = Some(action);
                let sequence = self.clients[at].owes.take().expect("enabled");
                self.clients[at].answered.push(sequence);
                let seat = self.clients[at].seat.expect("enabled");
                for sequence in [sequence, sequence + 1] {
                    let value = 100 * sequence + at as u64;
                    let answer = (sequence, self.next(at, sequence));
                    self.server
                        .done_until(now, seat, answer, [value].into_iter());
                }
            }
            Action::GiveUp(at) => {
                self.fault = Some(action);
                let seat = self.clients[at].seat.expect("enabled");
                self.server.gave_up(seat, "no more");
            }
            Action::Silence => {
                self.fault = Some(action);
                assert_eq!(self.server.deadline(), HANG, "somebody's patience ends");
                self.server.tick(HANG - Nanos(1));
                assert_eq!(self.server.outcome(), None, "not before");
                self.server.tick(HANG);
            }
            Action::Stranger => {
                let seat = self.server.connected(now);
                self.stranger = Some(seat);
                self.server.join(now, seat, Declaration::new("stranger"));
            }
        }
        self.deliver();
    }

    /// The step that a client asks for when it answers the step `sequence`.
    fn next(&self, at: usize, sequence: u64) -> u64 {
        match sequence {
            1.. if asks(at) => sequence + u64::from(self.clients[at].multiple),
            _ => 0,
        }
    }

    fn declaration(&self, at: usize) -> Declaration {
        let client = &self.clients[at];
        Declaration {
            interval: None,
            name: client.name.clone(),
            multiple: NonZeroU32::new(if asks(at) { 1 } else { client.multiple })
                .expect("above zero"),
            writes: vec![Variable::new(format!("x{at}"), DataType::Ulint)],
            reads: (0..self.clients.len()).map(|at| format!("x{at}")).collect(),
        }
    }

    /// The value that a client has committed before the step `sequence`.
    fn committed(&self, at: usize, sequence: u64) -> u64 {
        let multiple = u64::from(self.clients[at].multiple);
        let last = match sequence {
            1 => 0,
            sequence => (sequence - 2) / multiple * multiple + 1,
        };
        100 * last + at as u64
    }

    fn deliver(&mut self) {
        loop {
            let (seat, asked, reads, end) = match self.server.poll() {
                None => return,
                Some((seat, ToClient::Start { .. })) => (seat, 0, None, None),
                Some((seat, ToClient::Step { step, reads })) => {
                    assert_eq!(step.time.0, (step.sequence.cast_signed() - 1) * 1_000_000);
                    (seat, step.sequence, Some(reads.to_vec()), None)
                }
                Some((seat, ToClient::End(end))) => (seat, 0, None, Some(end.clone())),
                Some((_, ToClient::Waiting(_))) => continue,
                Some((_, other)) => panic!("{other:?} without being asked for"),
            };
            if self.stranger == Some(seat) {
                let refused = end.expect("nothing else").expect_err("it is refused");
                assert_eq!(refused.cause, Cause::Refused);
                self.is_stranger_refused = true;
                self.stranger = Some(usize::MAX - 1);
                continue;
            }
            let at = self.clients.iter().position(|c| c.seat == Some(seat));
            let at = at.expect("it is somebody's seat");
            assert_eq!(self.clients[at].end, None, "nothing follows the end");
            if let Some(end) = end {
                let excluded = end.is_err() && !self.has_started();
                if excluded {
                    // The client may come again.
                    self.clients[at].seat = None;
                } else {
                    self.clients[at].end = Some(end);
                }
                continue;
            }
            assert!(self.fault.is_none() || self.clients[at].seat.is_some());
            assert_eq!(self.clients[at].owes, None, "one question at a time");
            self.clients[at].owes = Some(asked);
            if let Some(reads) = reads {
                self.check_step(at, asked, &reads);
            }
        }
    }

    /// Checks that a step begins only when every due client has finished the previous one, and shows exactly that.
    fn check_step(&self, at: usize, sequence: u64, reads: &[u64]) {
        let multiple = u64::from(self.clients[at].multiple);
        assert_eq!((sequence - 1) % multiple, 0, "it is due");
        for (other, client) in self.clients.iter().enumerate() {
            let multiple = u64::from(client.multiple);
            let before = 1 + (1..sequence).filter(|s| (s - 1) % multiple == 0).count();
            assert_eq!(client.answered.len(), before, "the barrier holds");
            assert_eq!(reads[other], self.committed(other, sequence));
        }
    }

    /// Checks the end, when nothing can happen any more.
    fn check_end(&self, expected: &mut Option<TraceHash>) {
        let outcome = self.server.outcome().expect("no run hangs");
        for client in &self.clients {
            let is_lost = client.seat == Some(usize::MAX);
            let end = (!is_lost).then(|| outcome.clone());
            assert_eq!(client.end, end, "all learn the same");
        }
        assert_eq!(self.stranger.is_some(), self.is_stranger_refused);
        match outcome {
            Ok(outcome) => {
                assert_eq!(outcome.steps, self.steps);
                assert_eq!(*expected.get_or_insert(outcome.hash), outcome.hash);
            }
            Err(ended) => self.check_broken_off(ended),
        }
    }

    fn check_broken_off(&self, ended: &Ended) {
        // The steps that all due clients have finished.
        let is_finished = |sequence: &u64| {
            self.clients.iter().all(|client| {
                let is_due = (sequence - 1).is_multiple_of(u64::from(client.multiple));
                !is_due || client.answered.contains(sequence)
            })
        };
        let finished = (1..=self.steps).take_while(is_finished).count();
        let fault = self.fault.expect("without a fault there is no end");
        assert_eq!(ended.steps, finished as u64, "{ended} by {fault:?}");
        let (at, cause) = match fault {
            Action::Lose(at) => (at, Cause::Lost),
            Action::Unasked(at) | Action::Early(at) => (at, Cause::Protocol),
            Action::GiveUp(at) => (at, Cause::Failed),
            Action::Silence => {
                let first = self.clients.iter().position(|client| client.owes.is_some());
                (first.expect("somebody is waited for"), Cause::Hung)
            }
            other => panic!("{other:?} is no fault"),
        };
        assert_eq!(ended.cause, cause, "{ended} by {fault:?}");
        assert_eq!(ended.client.as_deref(), Some(&*self.clients[at].name));
    }
}

/// Takes every path; returns their number.
fn search(multiples: &[u32], steps: u64, with_stranger: bool) -> usize {
    let (mut choices, mut paths, mut hash) = (Choices::default(), 0, None);
    loop {
        let mut world = World::new(multiples, steps);
        loop {
            let actions = world.actions(with_stranger);
            if actions.is_empty() {
                break;
            }
            world.take(actions[choices.choose(actions.len())]);
        }
        world.check_end(&mut hash);
        paths += 1;
        if !choices.next() {
            return paths;
        }
    }
}

#[test]
fn no_order_of_two_clients_breaks_the_barrier() {
    let paths = search(&[1, 1], 3, false);
    assert!(paths > 500, "{paths}");
    let paths = search(&[2, 1], 3, true);
    assert!(paths > 4_000, "{paths}");
    let paths = search(&[2, 3], 5, false);
    assert!(paths > 300, "{paths}");
}

#[test]
fn no_order_of_three_clients_breaks_the_barrier() {
    let paths = search(&[1, 2, 1], 2, false);
    assert!(paths > 10_000, "{paths}");
}
