//! The server alone, on a clock that the test sets: refusals with reasons, patience, pace, pause and stop.

use crate::common::{client, settings};
use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;
use tickbus_virtual_time::server::{Control, Server, ToClient};
use tickbus_virtual_time::{
    Cause, Declaration, Ended, Logic, Outcome, Pacing, Settings, StartCondition, State, Variable,
    hear, in_process, wire,
};

const MS: i64 = 1_000_000;

/// A server with the clients "a" and "b", which have joined; each writes a BOOL of its name.
struct Bench {
    server: Server<'static>,
    now: Nanos,
}

fn declaration(name: &str) -> Declaration {
    let mut declaration = client(name, 1, &[], &[], |_, _, _| Ok(())).declaration;
    declaration.writes = vec![Variable::new(name, DataType::Bool)];
    declaration
}

impl Bench {
    fn new(settings: Settings) -> Self {
        let now = Nanos::ZERO;
        let server = Server::new(settings, Logic::new(), now).expect("right settings");
        let mut bench = Self { server, now };
        for name in ["a", "b"] {
            let seat = bench.server.connected(now);
            bench.server.join(now, seat, declaration(name));
        }
        bench
    }

    /// A bench in which all clients have sent their initial values.
    fn started(settings: Settings) -> Self {
        let mut bench = Self::new(settings);
        assert_eq!(bench.asked(), [0, 0]);
        bench.answer(0);
        bench
    }

    /// The steps requested so far; 0 is the start.
    #[track_caller]
    fn asked(&mut self) -> Vec<u64> {
        let mut asked = Vec::new();
        while let Some((_, message)) = self.server.poll() {
            asked.push(match message {
                ToClient::Start { .. } => 0,
                ToClient::Step { step, .. } => step.sequence,
                ToClient::Waiting(_) => continue,
                other => panic!("{other:?}"),
            });
        }
        asked
    }

    fn answer(&mut self, sequence: u64) {
        for seat in 0..2 {
            self.server.done(self.now, seat, sequence, [1].into_iter());
        }
    }

    fn pass(&mut self, span: Nanos) {
        self.now += span;
        self.server.tick(self.now);
    }

    fn outcome(&self) -> Result<Outcome, Ended> {
        self.server.outcome().expect("it has ended").clone()
    }

    #[track_caller]
    fn ended(&self, text: &str) {
        assert_eq!(self.outcome().expect_err(text).to_string(), text);
    }
}

fn two() -> Settings {
    settings(9, &["a", "b"])
}

/// The end that a seat receives.
fn refusal(server: &mut Server<'_>) -> (usize, Ended) {
    match server.poll() {
        Some((seat, ToClient::End(Err(ended)))) => (seat, ended.clone()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn who_may_not_join_is_told_why_and_the_others_wait_on() {
    let now = Nanos::ZERO;
    let mut server = Server::new(two(), Logic::new(), now).expect("right settings");
    let first = server.connected(now);
    server.join(now, first, declaration("a"));
    for (name, part) in [
        ("a", "a client of the name \"a\" has joined already"),
        (
            "c",
            "no client of the name \"c\" is expected; expected are \"a\", \"b\"",
        ),
        ("b ", "has blanks around it"),
    ] {
        let seat = server.connected(now);
        server.join(now, seat, declaration(name));
        let (told, ended) = refusal(&mut server);
        assert_eq!((told, ended.cause), (seat, Cause::Refused));
        assert!(ended.reason.contains(part), "{ended}");
    }
    let silent = server.connected(now);
    server.tick(Nanos::from_secs(10));
    let (told, ended) = refusal(&mut server);
    assert_eq!((told, ended.cause), (silent, Cause::Refused));
    server.join(now, first, declaration("a"));
    let (told, ended) = refusal(&mut server);
    assert_eq!(told, first);
    assert_eq!(ended.reason, "joined twice");
    assert_eq!(server.state(), State::Start);
    assert_eq!(server.missing().as_deref(), Some("\"a\", \"b\""));
}

#[test]
fn an_answer_before_the_question_was_sent_is_none() {
    let now = Nanos::ZERO;
    let mut server = Server::new(settings(9, &["a"]), Logic::new(), now).expect("right settings");
    let seat = server.connected(now);
    server.join(now, seat, declaration("a"));
    // All frames in one piece, before the server has sent anything.
    server.done(now, seat, 0, [1].into_iter());
    let ended = server.outcome().expect("it has ended").clone();
    let ended = ended.expect_err("it violates the protocol");
    assert_eq!(ended.cause, Cause::Protocol);
    assert_eq!(ended.reason, "answered before it was asked");
}

#[test]
fn the_time_that_the_server_takes_is_not_the_clients() {
    let now = Nanos::ZERO;
    let mut server = Server::new(settings(9, &["a"]), Logic::new(), now).expect("right settings");
    let seat = server.connected(now);
    server.join(now, seat, declaration("a"));
    while server.poll().is_some() {}
    let sent = Nanos::from_secs(11);
    server.sent(sent);
    server.tick(sent);
    assert_eq!(server.outcome(), None, "it was asked just now");
    server.tick(sent + Nanos::from_secs(10));
    let ended = server.outcome().expect("it hangs").clone();
    assert_eq!(ended.expect_err("it hangs").cause, Cause::Hung);
}

#[test]
fn clients_that_never_come_end_the_wait() {
    let now = Nanos::ZERO;
    let limit = Nanos::from_secs(60);
    let settings = Settings {
        join: limit,
        ..two()
    };
    let mut server = Server::new(settings, Logic::new(), now).expect("right settings");
    assert_eq!(server.deadline(), limit);
    let seat = server.connected(now);
    server.join(now, seat, declaration("b"));
    server.tick(limit);
    let ended = server.outcome().expect("it has ended").clone();
    let ended = ended.expect_err("it waits in vain").to_string();
    let expected = "the run ended before its first step: still waiting for \"a\", after 1min";
    assert_eq!(ended, expected);
}

#[test]
fn every_violation_names_its_client_and_what_it_did() {
    type Violation = fn(&mut Bench);
    let cases: [(Violation, &str); 6] = [
        (
            |bench| bench.server.done(bench.now, 1, 0, [1].into_iter()),
            "answered step 0 in step 1",
        ),
        (
            |bench| {
                for _ in 0..2 {
                    bench.server.done(bench.now, 1, 1, [1].into_iter());
                }
            },
            "answered step 1 twice",
        ),
        (
            |bench| bench.server.done(bench.now, 1, 1, [1, 1].into_iter()),
            "wrote 2 values in step 1, expected 1, one for each variable that it declared",
        ),
        (
            |bench| bench.server.done(bench.now, 1, 1, [2].into_iter()),
            "wrote a wrong value in step 1: 0x2 is not a valid BOOL, the type of the variable \"b\"",
        ),
        (
            |bench| bench.server.join(bench.now, 1, declaration("b")),
            "joined twice",
        ),
        (
            |bench| bench.server.gave_up(1, "no paper"),
            "gave up: no paper",
        ),
    ];
    for (violate, reason) in cases {
        let mut bench = Bench::started(two());
        assert_eq!(bench.asked(), [1, 1]);
        violate(&mut bench);
        bench.ended(&format!(
            "the run ended before its first step: client \"b\" {reason}"
        ));
    }
}

#[test]
fn all_who_hang_are_named_in_order() {
    let mut bench = Bench::started(two());
    bench.asked();
    assert_eq!(bench.server.deadline(), Nanos::from_secs(10));
    bench.pass(Nanos::from_secs(10) - Nanos(1));
    assert_eq!(bench.server.outcome(), None);
    bench.pass(Nanos(1));
    bench.ended(
        "the run ended before its first step: client \"a\" has not finished step 1 within 10s; nor has \"b\"",
    );
}

#[test]
fn the_pace_is_a_limit_and_late_steps_are_not_made_up_for() {
    let settings = Settings {
        pacing: Pacing::Times(0.5),
        ..two()
    };
    let mut bench = Bench::started(settings);
    // Steps of 1 ms, half as fast as the wall clock.
    assert_eq!(bench.asked(), [1, 1]);
    bench.answer(1);
    assert_eq!(bench.asked(), [0; 0]);
    assert_eq!(bench.server.deadline(), Nanos(2 * MS));
    bench.pass(Nanos(2 * MS));
    assert_eq!(bench.asked(), [2, 2]);
    bench.pass(Nanos(5 * MS));
    bench.answer(2);
    assert_eq!(bench.asked(), [3, 3], "the step that is late comes at once");
    bench.answer(3);
    assert_eq!(bench.asked(), [0; 0], "and only that one");
    assert_eq!(bench.server.deadline(), Nanos(8 * MS));
}

#[test]
fn a_pause_holds_between_steps_and_single_steps_go_on() {
    let settings = Settings {
        paused: true,
        ..two()
    };
    let mut bench = Bench::started(settings);
    assert_eq!(bench.asked(), [0; 0]);
    assert!(bench.server.is_paused());
    assert_eq!(bench.server.deadline(), Nanos::MAX, "a pause has no limit");
    bench.pass(Nanos::from_secs(3600));
    bench.server.control(bench.now, Control::Step(2));
    assert_eq!(bench.asked(), [1, 1]);
    bench.answer(1);
    assert_eq!(bench.asked(), [2, 2]);
    bench.answer(2);
    assert_eq!(bench.asked(), [0; 0]);
    bench.server.control(bench.now, Control::Run);
    assert_eq!(bench.asked(), [3, 3]);
    bench.server.control(bench.now, Control::Pause);
    bench.answer(3);
    assert_eq!(bench.asked(), [0; 0]);
    bench.server.control(bench.now, Control::Stop);
    assert_eq!(bench.outcome().map(|outcome| outcome.steps), Ok(3));
}

#[test]
fn a_stop_waits_for_the_step_but_not_for_long() {
    let mut bench = Bench::started(two());
    bench.asked();
    bench.server.control(bench.now, Control::Stop);
    assert_eq!(bench.server.outcome(), None);
    bench.answer(1);
    assert_eq!(bench.outcome().map(|outcome| outcome.steps), Ok(1));

    let mut bench = Bench::started(two());
    bench.asked();
    bench.server.done(bench.now, 0, 1, [1].into_iter());
    bench.server.control(bench.now, Control::Stop);
    assert_eq!(bench.server.deadline(), Nanos::from_secs(1));
    bench.pass(Nanos::from_secs(1));
    bench.ended(
        "the run ended before its first step: client \"b\" has not finished step 1 within 1s after the run was stopped",
    );
    assert_eq!(
        bench.outcome().expect_err("it was stopped").cause,
        Cause::Stopped
    );
}

#[test]
fn an_answer_to_what_was_not_fetched_yet_is_a_violation() {
    // All answers at once, like a client that does not wait.
    let mut bench = Bench::new(two());
    bench.server.done(bench.now, 0, 0, [1].into_iter());
    bench.ended("the run ended before its first step: client \"a\" answered before it was asked");

    let mut bench = Bench::started(two());
    assert_eq!(bench.asked(), [1, 1]);
    bench.answer(1);
    bench.server.done(bench.now, 1, 2, [1].into_iter());
    bench.ended("the run ended after 1 step: client \"b\" answered before it was asked");
}

#[test]
fn the_server_s_own_time_is_not_charged_to_its_clients() {
    let mut bench = Bench::started(two());
    bench.asked();
    bench.now += Nanos::from_secs(11);
    bench.server.sent(bench.now);
    bench.pass(Nanos::ZERO);
    assert_eq!(bench.server.outcome(), None);
    assert_eq!(bench.server.deadline(), bench.now + Nanos::from_secs(10));
}

#[test]
fn a_client_that_gives_up_before_the_start_is_named_with_its_reason() {
    let now = Nanos::ZERO;
    let mut server = Server::new(two(), Logic::new(), now).expect("right settings");
    let seat = server.connected(now);
    server.join(now, seat, declaration("a"));
    server.gave_up(seat, "no paper\nsync: ok\u{1b}[2J");
    let (_, ended) = refusal(&mut server);
    assert_eq!(ended.cause, Cause::Refused);
    assert_eq!(ended.client.as_deref(), Some("a"));
    assert_eq!(
        ended.reason,
        "gave up before the start: no paper\nsync: ok\u{1b}[2J"
    );
    let news: Vec<String> = std::iter::from_fn(|| server.news()).collect();
    assert_eq!(
        news[1],
        "client \"a\" was refused: gave up before the start: no paper\\nsync: ok\\u{1b}[2J"
    );
    assert_eq!(server.missing().as_deref(), Some("\"a\", \"b\""));
}

/// A client that joins by a frame, in this version of the format; returns its seat.
fn joined(server: &mut Server<'_>, name: &str, version: u8) -> usize {
    let mut frame = Vec::new();
    wire::join(&mut frame, &Declaration::new(name)).expect("short");
    // The interval, after kind, letters, version and multiple.
    if version == 1 {
        frame[wire::HEADER + 5] = 1;
        frame.drain(wire::HEADER + 11..wire::HEADER + 19);
    }
    let seat = server.connected(Nanos::ZERO);
    hear(server, Nanos::ZERO, seat, &frame[wire::HEADER..]);
    seat
}

#[test]
fn clients_that_have_nothing_to_do_are_told_every_second_that_the_server_waits() {
    let settings = Settings {
        paused: true,
        hang: Nanos::from_secs(600),
        ..settings(9, &["a", "b", "c"])
    };
    let now = |seconds| Nanos::from_secs(seconds);
    let mut server = Server::new(settings, Logic::new(), now(0)).expect("right settings");
    // The seats that get a waiting message; there are no other messages.
    let told = |server: &mut Server<'_>| {
        let mut seats = Vec::new();
        while let Some((seat, message)) = server.poll() {
            let ToClient::Waiting(whom) = message else {
                panic!("{message:?}");
            };
            seats.push((seat, whom.to_owned()));
        }
        seats
    };
    let (a, b) = (joined(&mut server, "a", 2), joined(&mut server, "b", 1));
    assert_eq!(server.deadline(), now(1));
    server.tick(now(1));
    let expected = [(a, "\"c\" to join".to_owned())];
    assert_eq!(told(&mut server), expected, "b is of version 1");
    server.tick(now(1) + Nanos(MS));
    assert_eq!(told(&mut server), []);
    let c = joined(&mut server, "c", 2);
    assert!((0..3).all(|_| matches!(server.poll(), Some((_, ToClient::Start { .. })))));
    server.done(now(1), a, 0, [].into_iter());
    server.tick(now(2));
    let expected = [(a, "\"b\", \"c\" to send initial values".to_owned())];
    assert_eq!(told(&mut server), expected);
    for seat in [b, c] {
        server.done(now(2), seat, 0, [].into_iter());
    }
    server.tick(now(3));
    let paused = || "a command, since the run is paused".to_owned();
    assert_eq!(told(&mut server), [(a, paused()), (c, paused())]);
    server.control(now(3), Control::Run);
    assert!((0..3).all(|_| server.poll().is_some()), "all are due");
    server.done(now(3), c, 1, [].into_iter());
    server.tick(now(4));
    let expected = [(c, "\"a\", \"b\" to finish step 1".to_owned())];
    assert_eq!(told(&mut server), expected);
}

#[test]
fn a_client_that_states_its_interval_has_a_step_for_each() {
    let mut server = Server::new(two(), Logic::new(), Nanos::ZERO).expect("right settings");
    let with = |name: &str, micros| Declaration {
        interval: Some(Nanos::from_micros(micros)),
        ..Declaration::new(name)
    };
    let seat = server.connected(Nanos::ZERO);
    server.join(Nanos::ZERO, seat, with("a", 999));
    let (_, ended) = refusal(&mut server);
    assert_eq!(
        ended.reason,
        "its step of 999us is shorter than the server's, 1ms, in which a client runs once at most; make the server's step \
         shorter"
    );
    let seats = [("a", 3_000), ("b", 1_000)].map(|(name, micros)| {
        let seat = server.connected(Nanos::ZERO);
        server.join(Nanos::ZERO, seat, with(name, micros));
        seat
    });
    let mut asked = Vec::new();
    loop {
        let mut due = Vec::new();
        while let Some((seat, message)) = server.poll() {
            match message {
                ToClient::Start { .. } => due.push((seat, 0)),
                ToClient::Step { step, .. } => due.push((seat, step.sequence)),
                _ => {}
            }
        }
        if due.is_empty() {
            break;
        }
        for (seat, sequence) in due {
            asked.extend((seat == seats[0]).then_some(sequence));
            server.done(Nanos::ZERO, seat, sequence, [].into_iter());
        }
    }
    assert_eq!(asked, [0, 1, 4, 7]);
}

#[test]
fn a_hook_of_reads_that_fails_in_the_first_step_ends_the_run_before_it() {
    let mut one = client("one", 1, &["x"], &["x"], |_, _, _| Ok(()));
    let logic = Logic::new().on_read("x", |_| Err("no".to_owned()));
    let ended = in_process::run(settings(5, &["one"]), vec![&mut one], logic);
    assert_eq!(
        ended.expect_err("it fails").to_string(),
        "the run ended before its first step: the server's logic failed: no"
    );
}

#[test]
fn no_participant_in_this_process_is_left_out() {
    let [mut a, mut b, mut c] =
        ["a", "b", "c"].map(|name| client(name, 1, &[], &[], |_, _, _| Ok(())));
    let settings = Settings {
        start: StartCondition::Count(2),
        ..settings(5, &[])
    };
    let ended = in_process::run(settings, vec![&mut a, &mut b, &mut c], Logic::new());
    let ended = ended.expect_err("the third has no place");
    assert_eq!(
        (ended.cause, ended.client.as_deref()),
        (Cause::Refused, Some("c"))
    );
}
