//! Any sequence of events: the server keeps its promises to every seat.

use std::collections::HashMap;

use proptest::prelude::*;
use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;
use tickbus_virtual_time::server::{Control, Server, ToClient};
use tickbus_virtual_time::{Declaration, Logic, Pacing, Settings, StartCondition, State, Variable};

#[derive(Clone, Debug)]
enum Event {
    Connect,
    Join(usize, usize, u32),
    /// The right answer, where one is due.
    Answer(usize),
    /// The same, followed at once by the answer to the next step.
    Early(usize),
    Done(usize, u64, usize, u64),
    GiveUp(usize),
    Lose(usize),
    Violate(usize),
    Pass(i64),
    Control(Control),
}

fn event() -> impl Strategy<Value = Event> {
    let seat = 0..4_usize;
    prop_oneof![
        3 => Just(Event::Connect),
        4 => (seat.clone(), 0..4_usize, 1..4_u32).prop_map(|(s, n, m)| Event::Join(s, n, m)),
        20 => seat.clone().prop_map(Event::Answer),
        1 => seat.clone().prop_map(Event::Early),
        1 => (seat.clone(), 0..4_u64, 0..3_usize, 0..3_u64)
            .prop_map(|(s, q, n, v)| Event::Done(s, q, n, v)),
        1 => seat.clone().prop_map(Event::GiveUp),
        1 => seat.clone().prop_map(Event::Lose),
        1 => seat.prop_map(Event::Violate),
        4 => (0..400_000_000_i64).prop_map(Event::Pass),
        1 => prop_oneof![
            Just(Control::Pause),
            (0..3_u64).prop_map(Control::Step),
            Just(Control::Run),
            Just(Control::Stop)
        ]
        .prop_map(Event::Control),
    ]
}

/// The messages to a seat.
#[derive(Default)]
struct Seat {
    owes: Option<u64>,
    last: Option<u64>,
}

fn declaration(name: usize, multiple: u32) -> Declaration {
    let mut declaration = Declaration::new(format!("n{name}"));
    declaration.multiple = multiple.try_into().expect("above zero");
    declaration.writes = vec![Variable::new(format!("x{name}"), DataType::Bool)];
    declaration.reads = vec![format!("x{name}")];
    declaration
}

fn play(events: &[Event], pacing: Pacing, steps: Option<u64>) {
    let start = StartCondition::Names(vec!["n0".to_owned(), "n1".to_owned()]);
    let hang = Nanos::from_secs(1);
    let settings = Settings {
        steps,
        pacing,
        hang,
        ..Settings::new(Nanos::from_millis(1), start)
    };
    let mut now = Nanos::ZERO;
    let mut server = Server::new(settings, Logic::new(), now).expect("right settings");
    let mut seats: HashMap<usize, Seat> = HashMap::new();
    for event in events {
        let here = |seat: &usize| seats.contains_key(seat);
        match event {
            Event::Connect if seats.len() < 4 => {
                let seat = server.connected(now);
                assert!(seats.insert(seat, Seat::default()).is_none(), "a free seat");
            }
            Event::Join(seat, name, multiple) if here(seat) => {
                server.join(now, *seat, declaration(*name, *multiple));
            }
            Event::Answer(seat) => {
                let owed = seats.get_mut(seat).and_then(|seat| seat.owes.take());
                if let Some(sequence) = owed {
                    server.done(now, *seat, sequence, [sequence % 2].into_iter());
                }
            }
            Event::Early(seat) => {
                let owed = seats.get_mut(seat).and_then(|seat| seat.owes.take());
                if let Some(sequence) = owed {
                    for sequence in [sequence, sequence + 1] {
                        server.done(now, *seat, sequence, [sequence % 2].into_iter());
                    }
                    assert!(server.outcome().is_some(), "it did not wait to be asked");
                }
            }
            Event::Done(seat, sequence, count, value) if here(seat) => {
                server.done(now, *seat, *sequence, vec![*value; *count].into_iter());
            }
            Event::GiveUp(seat) if here(seat) => server.gave_up(*seat, "enough"),
            Event::Violate(seat) if here(seat) => server.violated(*seat, "sent rubbish"),
            Event::Lose(seat) if seats.remove(seat).is_some() => server.lost(*seat, "cut"),
            Event::Pass(span) => {
                now += Nanos(*span);
                server.tick(now);
            }
            Event::Control(control) => server.control(now, *control),
            _ => {}
        }
        let was_over = server.outcome().is_some();
        while let Some((at, message)) = server.poll() {
            let seat = seats.get_mut(&at).expect("only who is there is told");
            let asked = match message {
                ToClient::Start { .. } => 0,
                ToClient::Step { step, reads } => {
                    assert_eq!(reads.len(), 1);
                    step.sequence
                }
                ToClient::Waiting(_) => continue,
                ToClient::End(_) => {
                    seats.remove(&at);
                    continue;
                }
                other => panic!("{other:?} without being asked for"),
            };
            assert!(!was_over, "no step after the end");
            assert!(seat.last < Some(asked), "steps come in order");
            (seat.owes, seat.last) = (Some(asked), Some(asked));
        }
        // Every wait has a time limit.
        match server.state() {
            State::InitialWrite | State::Write => assert!(server.deadline() <= now + hang),
            State::PreRead => assert!(server.is_paused() || pacing != Pacing::Fast),
            State::Start => {}
            State::Ended => assert!(seats.is_empty(), "everyone was told the end"),
            other => panic!("the server rests in {other:?}"),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn the_server_keeps_its_promises(
        events in proptest::collection::vec(event(), 0..120),
        pace in prop_oneof![Just(Pacing::Fast), Just(Pacing::Times(1.0))],
        steps in proptest::option::of(0..9_u64),
    ) {
        // Most sequences begin with a run that starts, so that there is something to break.
        let begin = [
            Event::Connect,
            Event::Connect,
            Event::Join(0, 1, 1),
            Event::Join(1, 0, 2),
        ];
        let events: Vec<Event> = begin.into_iter().chain(events.iter().cloned()).collect();
        play(&events, pace, steps);
        play(&events[4..], pace, steps);
    }
}
