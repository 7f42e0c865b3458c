//! Any sequence of events at a server of virtual time: clients that connect, send right and wrong frames, answer, go
//! silent and vanish, time that passes, controls; and what a client reads.
//!
//! The input is a header with the settings, followed by operations of two or more bytes.

#![no_main]

use std::collections::BTreeMap;

use libfuzzer_sys::fuzz_target;
use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;
use tickbus_virtual_time::client::{Asked, Client};
use tickbus_virtual_time::server::{Control, Server, ToClient};
use tickbus_virtual_time::{
    Declaration, Logic, Outcome, Pacing, Settings, StartCondition, State, Variable, hear, wire,
};

const HANG: Nanos = Nanos::from_secs(1);

fuzz_target!(|data: &[u8]| {
    let Some(([header, steps], operations)) = data.split_first_chunk::<2>() else {
        return;
    };
    // The same bytes as the frames of a server, too.
    let _ = wire::from_server(data);
    let names = vec!["n0".to_owned(), "n1".to_owned()];
    let start = match header % 2 {
        0 => StartCondition::Names(names),
        _ => StartCondition::Count(2),
    };
    let settings = Settings {
        steps: (header & 2 == 0).then_some(u64::from(*steps)),
        pacing: if header & 4 == 0 { Pacing::Fast } else { Pacing::Times(1.0) },
        paused: header & 8 != 0,
        hang: HANG,
        ..Settings::new(Nanos::from_millis(1), start)
    };
    Run::new(settings).operate(operations);
});

/// A client as its own end sees it; only those that behave have one.
struct Seat {
    client: Option<Client>,
    owes: bool,
}

struct Run {
    server: Server<'static>,
    pacing: Pacing,
    seats: BTreeMap<usize, Seat>,
    now: Nanos,
    outcome: Option<Outcome>,
}

impl Run {
    fn new(settings: Settings) -> Self {
        let pacing = settings.pacing;
        let server = Server::new(settings, Logic::new(), Nanos::ZERO).expect("right settings");
        Self { server, pacing, seats: BTreeMap::new(), now: Nanos::ZERO, outcome: None }
    }

    fn operate(mut self, mut operations: &[u8]) {
        while let [operation, operand, rest @ ..] = operations {
            operations = rest;
            let seat = usize::from(operand % 4);
            let is_here = self.seats.contains_key(&seat);
            match operation % 8 {
                0 if self.seats.len() < 4 => {
                    let seat = self.server.connected(self.now);
                    let new = Seat { client: None, owes: false };
                    assert!(self.seats.insert(seat, new).is_none(), "a free seat");
                }
                1 if is_here => self.join(seat, operand / 4),
                2 | 3 if is_here => self.answer(seat, operand / 4),
                4 if is_here => {
                    // Whatever these bytes are.
                    let count = usize::from(operand / 4).min(rest.len());
                    let (frame, after) = rest.split_at(count);
                    operations = after;
                    self.seats.get_mut(&seat).expect("here").client = None;
                    hear(&mut self.server, self.now, seat, frame);
                }
                5 if is_here => {
                    self.seats.remove(&seat);
                    self.server.lost(seat, "cut");
                }
                6 => {
                    self.now = self.now + Nanos::from_millis(i64::from(*operand) * 4);
                    self.server.tick(self.now);
                }
                7 => {
                    let control = match operand % 8 {
                        0 => Control::Stop,
                        1 | 2 => Control::Pause,
                        3 | 4 => Control::Step(u64::from(operand / 8)),
                        _ => Control::Run,
                    };
                    self.server.control(self.now, control);
                }
                _ => {}
            }
            self.deliver();
            self.check();
        }
    }

    fn join(&mut self, seat: usize, what: u8) {
        let mut declaration = Declaration::new(format!("n{}", what % 4));
        declaration.multiple = (1 + u32::from(what / 4 % 3)).try_into().expect("above zero");
        declaration.writes = vec![Variable::new(format!("x{}", what / 16), DataType::Byte)];
        declaration.reads = vec![format!("x{}", what / 32)];
        let client = Client::new(declaration).expect("it is right");
        let frame = client.frame()[wire::HEADER..].to_vec();
        let here = self.seats.get_mut(&seat).expect("here");
        // Who joins twice no longer behaves.
        here.client = here.client.is_none().then_some(client);
        hear(&mut self.server, self.now, seat, &frame);
    }

    /// Answers, and asks for one of the next steps, or for none.
    fn answer(&mut self, seat: usize, next: u8) {
        let here = self.seats.get_mut(&seat).expect("here");
        if let (true, Some(client)) = (here.owes, &mut here.client) {
            here.owes = false;
            let next = (next >= 16).then(|| Nanos::from_millis(i64::from(next) - 16));
            client.answer_until(&[7], next);
            let frame = client.frame()[wire::HEADER..].to_vec();
            hear(&mut self.server, self.now, seat, &frame);
        }
    }

    /// Checks that the server's messages are right for every client that behaves.
    fn deliver(&mut self) {
        let mut frame = Vec::new();
        while let Some((seat, message)) = self.server.poll() {
            frame.clear();
            wire::to_client(&mut frame, &message);
            let is_end = matches!(message, ToClient::End(_));
            let here = self.seats.get_mut(&seat).expect("only who is there is told");
            let content = wire::frame(&frame).expect("a frame").expect("complete");
            if let Some(client) = &mut here.client {
                match client.receive(content).expect("the server behaves") {
                    None => assert!(!here.owes, "nothing is waited for"),
                    Some(Asked::Initial | Asked::Step(_)) => here.owes = true,
                    Some(Asked::End(Ok(outcome))) => {
                        assert_eq!(*self.outcome.get_or_insert(outcome), outcome, "one end");
                    }
                    Some(Asked::End(Err(_))) => {}
                }
            }
            if is_end {
                self.seats.remove(&seat);
            }
        }
    }

    /// Every wait has a limit in time.
    fn check(&self) {
        match self.server.state() {
            State::InitialWrite | State::Write => assert!(self.server.deadline() <= self.now + HANG),
            State::PreRead => {
                // Or there are many steps without a due client: the rest of them at once.
                let continues = self.server.deadline() <= self.now;
                assert!(self.server.is_paused() || self.pacing != Pacing::Fast || continues);
            }
            State::Start => {}
            State::Ended => assert!(self.seats.is_empty(), "everyone was told the end"),
            other => panic!("the server rests in {other:?}"),
        }
    }
}
