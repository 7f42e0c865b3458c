//! Clients that say when they want to run next: the paper's `t_next` update, for simulations of discrete events.

use std::thread;

use tickbus_base::time::{Monotonic, Nanos};
use tickbus_image::signal::DataType;
use tickbus_net::Address;
use tickbus_virtual_time::server::{Server, ToClient};
use tickbus_virtual_time::{
    Controls, Declaration, Exchange, Hosting, Logic, Participant, Settings, Step, Variable, hear,
    in_process, tcp, wire,
};

use crate::common::{client, settings};

/// A simulation with events at these times in ns, which counts them, and remembers its steps.
struct Events {
    times: Vec<i64>,
    ran: Vec<u64>,
    /// False: it runs in each step, and does nothing in those without an event.
    asks: bool,
    /// True beside the counter.
    checks: bool,
}

impl Events {
    fn new(times: &[i64], asks: bool) -> Self {
        let (times, ran) = (times.to_vec(), Vec::new());
        Self {
            times,
            ran,
            asks,
            checks: true,
        }
    }
}

impl Participant for Events {
    fn declare(&self) -> Declaration {
        let mut declaration = Declaration::new("events");
        declaration.writes = vec![Variable::new("count", DataType::Udint)];
        declaration.reads = vec!["x".to_owned()];
        declaration
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.ran.push(step.sequence);
        if self.checks {
            assert_eq!(reads[0], step.sequence - 1, "the newest value is read");
        }
        let passed = self.times.iter().filter(|time| **time <= step.time.0);
        writes[0] = passed.count() as u64;
        Ok(())
    }

    fn next_update(&self) -> Option<Nanos> {
        let done = self.ran.last().map_or(0, |sequence| {
            let time = i64::try_from(sequence - 1).expect("few") * 1_000_000;
            self.times.iter().filter(|event| **event <= time).count()
        });
        let next = self.times.get(done).copied().map_or(Nanos::MAX, Nanos);
        self.asks.then_some(next)
    }
}

const TIMES: [i64; 5] = [0, 2_500_000, 2_600_000, 7_000_000, 7_000_001];

fn counter() -> impl Participant {
    client("counter", 1, &["x"], &["count"], |step, _, writes| {
        writes[0] = step.sequence;
        Ok(())
    })
}

fn twelve() -> Settings {
    settings(12, &["counter", "events"])
}

#[test]
fn a_simulation_of_events_runs_in_the_steps_of_its_events_only() {
    let mut hashes = Vec::new();
    for (asks, steps) in [
        (true, vec![1, 4, 8, 9]),
        (false, (1..=12).collect::<Vec<u64>>()),
    ] {
        let (mut events, mut counter) = (Events::new(&TIMES, asks), counter());
        let both: Vec<&mut dyn Participant> = vec![&mut events, &mut counter];
        let outcome = in_process::run(twelve(), both, Logic::new()).expect("it runs");
        assert_eq!(outcome.steps, 12);
        assert_eq!(events.ran, steps);
        hashes.push(outcome.hash);
    }
    // The values are the same, so the runs are equal.
    assert_eq!(hashes[0], hashes[1]);
}

#[test]
fn the_run_is_the_same_over_tcp_and_on_the_server_s_thread() {
    let (mut events, mut other) = (Events::new(&TIMES, true), counter());
    let both: Vec<&mut dyn Participant> = vec![&mut events, &mut other];
    let expected = in_process::run(twelve(), both, Logic::new()).expect("it runs");
    for is_local in [false, true] {
        let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
        let address = Address::local(listener.address().port());
        let mut events = Events::new(&TIMES, true);
        let outcome = thread::scope(|scope| {
            scope.spawn(|| tcp::join(&address, &mut counter()).expect("it runs"));
            let mut locals: Vec<&mut dyn Participant> = Vec::new();
            if is_local {
                locals.push(&mut events);
            } else {
                let (events, address) = (&mut events, &address);
                scope.spawn(move || tcp::join(address, events).expect("it runs"));
            }
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &Controls::default(),
                news: &mut |_| {},
            };
            listener.run_with(twelve(), Logic::new(), hosting, locals)
        });
        assert_eq!(outcome, Ok(expected));
        assert_eq!(events.ran, [1, 4, 8, 9]);
    }
}

/// Runs a client with the multiple 3 that wants the next step `next(step)`; returns the steps that it ran in.
fn steps_of(next: impl Fn(u64) -> u64) -> Vec<u64> {
    let now = Nanos::ZERO;
    let mut server = Server::new(settings(14, &["a", "b"]), Logic::new(), now).expect("right");
    let mut ran = Vec::new();
    for (name, multiple) in [("a", 3_u32), ("b", 1)] {
        let mut declaration = Declaration::new(name);
        declaration.multiple = multiple.try_into().expect("above zero");
        let mut frame = Vec::new();
        wire::join(&mut frame, &declaration).expect("short");
        if name == "b" {
            // A client of version 1 beside one of version 2.
            frame[wire::HEADER + 5] = 1;
            frame.drain(wire::HEADER + 11..wire::HEADER + 19);
        }
        let seat = server.connected(now);
        hear(&mut server, now, seat, &frame[wire::HEADER..]);
    }
    loop {
        let (seat, sequence) = match server.poll() {
            Some((seat, ToClient::Start { .. })) => (seat, 0),
            Some((seat, ToClient::Step { step, .. })) => (seat, step.sequence),
            Some((_, ToClient::End(outcome))) => {
                assert!(outcome.is_ok(), "{outcome:?}");
                return ran;
            }
            other => panic!("{other:?}"),
        };
        let next = if seat == 0 { next(sequence) } else { 0 };
        if seat == 0 && sequence > 0 {
            ran.push(sequence);
        }
        let mut frame = Vec::new();
        wire::done(&mut frame, sequence, next, &[]);
        hear(&mut server, now, seat, &frame[wire::HEADER..]);
    }
}

#[test]
fn a_step_that_has_passed_is_the_following_one_and_none_is_that_of_the_multiple() {
    assert_eq!(steps_of(|_| 0), [1, 4, 7, 10, 13]);
    assert_eq!(steps_of(|_| 1), (1..=14).collect::<Vec<u64>>(), "passed");
    assert_eq!(steps_of(|step| step + 5), [5, 10], "from the start on");
    assert_eq!(
        steps_of(|step| if step == 4 { 6 } else { 0 }),
        [1, 4, 6, 9, 12]
    );
    assert_eq!(
        steps_of(|step| if step == 1 { u64::MAX } else { 0 }),
        [1],
        "never again"
    );
    assert_eq!(
        steps_of(|step| if step == 0 { 15 } else { 0 }),
        [0_u64; 0],
        "after the end"
    );
}

#[test]
fn a_run_without_an_end_is_over_when_no_client_wants_to_run_again() {
    let mut endless = twelve();
    endless.steps = None;
    let unchecked = |times: &[i64]| Events {
        checks: false,
        ..Events::new(times, true)
    };
    let mut events = unchecked(&TIMES);
    let mut other = unchecked(&[4_000_000]);
    let expected = {
        let mut declared = Renamed(&mut other);
        let clients: Vec<&mut dyn Participant> = vec![&mut events, &mut declared];
        in_process::run(endless.clone(), clients, Logic::new()).expect("it ends")
    };
    assert_eq!((expected.steps, &*events.ran), (9, &[1, 4, 8, 9][..]));
    for direct in [false, true] {
        let settings = Settings {
            exchange: if direct {
                Exchange::Direct
            } else {
                Exchange::ByServer { rejoin: None }
            },
            ..endless.clone()
        };
        let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
        let address = Address::local(listener.address().port());
        let outcome = thread::scope(|scope| {
            scope.spawn(|| tcp::join(&address, &mut unchecked(&TIMES)).expect("it ends"));
            scope.spawn(|| {
                let mut other = unchecked(&[4_000_000]);
                tcp::join(&address, &mut Renamed(&mut other)).expect("it ends")
            });
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &Controls::default(),
                news: &mut |_| {},
            };
            listener.run(settings, Logic::new(), hosting)
        });
        assert_eq!(outcome, Ok(expected), "direct: {direct}");
    }
}

/// Events of another client, the one that counts in the tests above.
struct Renamed<'e>(&'e mut Events);

impl Participant for Renamed<'_> {
    fn declare(&self) -> Declaration {
        let mut declaration = Declaration::new("counter");
        declaration.writes = vec![Variable::new("x", DataType::Udint)];
        declaration
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.0.run(step, reads, writes)
    }

    fn next_update(&self) -> Option<Nanos> {
        self.0.next_update()
    }
}
