//! Clients that exchange their values without the server: the run is the same, the server follows, and whoever breaks it
//! off is named.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::thread;

use crate::common::{client, mixer_settings, mixers, settings};
use tickbus_base::time::{Monotonic, Nanos};
use tickbus_net::Address;
use tickbus_virtual_time::server::Control;
use tickbus_virtual_time::{
    Cause, Controls, Declaration, Ended, Exchange, Hosting, Logic, MemberList, Mesh, Next, Outcome,
    Participant, Settings, Step, in_process, tcp, wire,
};

pub(crate) type Ends = Vec<Result<Outcome, Ended>>;

/// The news of a run whose clients exchange their values.
pub(crate) const DIRECTLY: &str = "the clients exchange their values directly";

/// A run with a thread for each client, at a Unix socket or over TCP: the server's result, those of the clients, and the
/// news.
pub(crate) fn run<'c>(
    settings: Settings,
    logic: Logic<'_>,
    controls: &Controls,
    is_local: bool,
    clients: Vec<Box<dyn Participant + Send + 'c>>,
) -> (Result<Outcome, Ended>, Ends, Vec<String>) {
    let folder = tempfile::tempdir().expect("a folder");
    // A path of Windows is none of a Unix socket.
    let local = if cfg!(unix) {
        format!("unix:{}", folder.path().join("run").display())
    } else {
        "unix:unused".to_owned()
    };
    let local: tickbus_net::LocalAddress = local.parse().expect("a path");
    let listener = if is_local {
        tcp::Listener::bind_local(&local).expect("a free path")
    } else {
        tcp::Listener::bind(&Address::local(0)).expect("a free port")
    };
    let address = Address::local(listener.address().port());
    let news = Mutex::new(Vec::new());
    let (outcome, ends) = thread::scope(|scope| {
        let join = |mut client: Box<dyn Participant + Send + 'c>| {
            let (address, local) = (&address, &local);
            scope.spawn(move || {
                if is_local {
                    tcp::join_local(local, &mut *client)
                } else {
                    tcp::join(address, &mut *client)
                }
            })
        };
        let joined: Vec<_> = clients.into_iter().map(join).collect();
        let hosting = Hosting {
            clock: &*Monotonic::shared(),
            controls,
            news: &mut |line| news.lock().expect("no panic").push(line.to_owned()),
        };
        let outcome = listener.run(settings, logic, hosting);
        let ends = joined.into_iter().map(|end| end.join().expect("no panic"));
        (outcome, ends.collect())
    });
    (outcome, ends, news.into_inner().expect("no panic"))
}

pub(crate) fn boxed<'c, P: Participant + Send + 'c>(
    clients: Vec<P>,
) -> Vec<Box<dyn Participant + Send + 'c>> {
    let boxed = |client| Box::new(client) as Box<dyn Participant + Send + 'c>;
    clients.into_iter().map(boxed).collect()
}

pub(crate) fn direct(settings: Settings) -> Settings {
    Settings {
        exchange: Exchange::Direct,
        ..settings
    }
}

pub(crate) fn in_this_process(steps: u64, count: u32) -> Outcome {
    let mut mixers = mixers(count);
    let clients = mixers.iter_mut().map(|mixer| mixer as _).collect();
    in_process::run(mixer_settings(steps, count), clients, Logic::new()).expect("it runs")
}

#[test]
fn a_run_without_the_server_between_is_the_one_in_this_process() {
    for (count, is_local) in [
        (1, false),
        (2, false),
        (4, false),
        (8, false),
        (4, cfg!(unix)),
    ] {
        let expected = in_this_process(3000, count);
        for turn in 0..3 {
            let mut clients = mixers(count);
            clients.rotate_left(turn % count as usize);
            let settings = direct(mixer_settings(3000, count));
            let (outcome, ends, news) = run(
                settings,
                Logic::new(),
                &Controls::default(),
                is_local,
                boxed(clients),
            );
            assert_eq!(outcome, Ok(expected), "{news:?}");
            assert!(ends.iter().all(|end| *end == outcome), "{ends:?}");
            assert!(news.contains(&DIRECTLY.to_owned()), "{news:?}");
        }
    }
}

/// A client that asks for its next step: after 1, 2, 3 and again 1 steps.
struct Eventful(&'static str, u64, Step);

impl Participant for Eventful {
    fn declare(&self) -> Declaration {
        client(self.0, 1, &[self.0], &["a", "b"], |_, _, _| Ok(())).declaration
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.2 = step;
        writes[0] = reads[0].wrapping_mul(31) ^ reads[1] ^ step.sequence;
        Ok(())
    }

    fn next_update(&self) -> Option<Nanos> {
        let pause = 1 + (self.2.sequence + self.1) % 7;
        let time = self.2.time.0 + 1_000_000 * pause.cast_signed();
        // Now and then as declared.
        (pause != 3).then_some(Nanos(time))
    }
}

#[test]
fn a_simulation_of_events_and_every_commit_are_the_same() {
    let clients = || {
        let step = Step {
            sequence: 0,
            time: Nanos::ZERO,
        };
        vec![Eventful("a", 1, step), Eventful("b", 5, step)]
    };
    let trace = |runs: &dyn Fn(Logic<'_>) -> Result<Outcome, Ended>| {
        let commits = Mutex::new(Vec::new());
        let logic = Logic::new().on_commit(|commit| {
            let mut commits = commits.lock().expect("no panic");
            commits.push((commit.step(), commit.values().to_vec()));
            Ok(())
        });
        let outcome = runs(logic).expect("it runs");
        (outcome, commits.into_inner().expect("no panic"))
    };
    let expected = trace(&|logic| {
        let mut clients = clients();
        let clients = clients.iter_mut().map(|client| client as _).collect();
        in_process::run(settings(5000, &["a", "b"]), clients, logic)
    });
    let found = trace(&|logic| {
        let settings = direct(settings(5000, &["a", "b"]));
        let (outcome, _, news) = run(
            settings,
            logic,
            &Controls::default(),
            false,
            boxed(clients()),
        );
        assert!(news.contains(&DIRECTLY.to_owned()), "{news:?}");
        outcome
    });
    assert_eq!(found.0, expected.0);
    assert!(found.1 == expected.1, "the commits differ");
}

#[test]
fn a_run_that_the_server_has_to_see_goes_through_it_and_says_why() {
    let expected = in_this_process(100, 2);
    let logic = Logic::new().on_time(|_| Ok(()));
    let settings = direct(mixer_settings(100, 2));
    let (outcome, ends, news) = run(
        settings,
        logic,
        &Controls::default(),
        false,
        boxed(mixers(2)),
    );
    assert_eq!(outcome, Ok(expected));
    assert!(ends.iter().all(|end| *end == outcome), "{ends:?}");
    let why = "the server passes the values on: the server has logic";
    assert!(news.contains(&why.to_owned()), "{news:?}");
}

#[test]
fn a_paused_run_makes_exactly_the_steps_that_it_is_let() {
    let controls = Controls::default();
    let ran = Mutex::new(0);
    let mut settings = direct(settings(0, &["a", "b"]));
    settings.steps = None;
    settings.paused = true;
    let counts = |name| {
        client(name, 1, &[name], &["a", "b"], |step, _, _| {
            *ran.lock().expect("no panic") = step.sequence;
            Ok(())
        })
    };
    let logic = Logic::new().on_commit(|commit| {
        // The first command comes from outside; these follow.
        match commit.step().sequence {
            0 => controls.send(Control::Step(7)),
            7 => controls.send(Control::Step(3)),
            10 => controls.send(Control::Stop),
            more => assert!(more < 10, "step {more}"),
        }
        Ok(())
    });
    let clients = boxed(vec![counts("a"), counts("b")]);
    let (outcome, ends, news) = run(settings, logic, &controls, false, clients);
    assert!(news.contains(&DIRECTLY.to_owned()), "{news:?}");
    assert_eq!(outcome.as_ref().map(|outcome| outcome.steps), Ok(10));
    assert!(ends.iter().all(|end| *end == outcome), "{ends:?}");
    assert_eq!(*ran.lock().expect("no panic"), 10);
}

#[test]
fn a_stop_ends_the_run_with_a_hash_that_all_have() {
    let controls = Controls::default();
    let mut settings = direct(mixer_settings(0, 3));
    settings.steps = None;
    let logic = Logic::new().on_commit(|commit| {
        if commit.step().sequence == 1000 {
            controls.send(Control::Stop);
        }
        Ok(())
    });
    let (outcome, ends, _) = run(settings, logic, &controls, false, boxed(mixers(3)));
    let outcome = outcome.expect("it is stopped between two steps");
    assert!(outcome.steps >= 1000);
    assert!(ends.iter().all(|end| *end == Ok(outcome)), "{ends:?}");
    assert_eq!(in_this_process(outcome.steps, 3), outcome);
}

#[test]
fn a_client_that_hangs_is_named_with_its_step() {
    // The first by name: the server looks for its values first, and those of the others have come.
    let mut settings = direct(settings(5000, &["first", "good", "other"]));
    settings.hang = Nanos::from_millis(500);
    let (sender, receiver) = std::sync::mpsc::channel::<()>();
    let sender = Mutex::new(Some(sender));
    let stuck = client("first", 1, &["x"], &[], move |step, _, _| {
        if step.sequence == 1007 {
            // Until the other end is dropped, when the run has ended.
            let _ = receiver.recv();
        }
        Ok(())
    });
    let good = |name| {
        let sender = &sender;
        Waits(client(name, 1, &[], &["x"], |_, _, _| Ok(())), move || {
            drop(sender.lock().expect("no panic").take());
        })
    };
    let clients: Vec<Box<dyn Participant + Send>> = vec![
        Box::new(good("good")),
        Box::new(stuck),
        Box::new(good("other")),
    ];
    let (outcome, ends, _) = run(settings, Logic::new(), &Controls::default(), false, clients);
    let ended = outcome.expect_err("it hangs");
    assert_eq!(ended.cause, Cause::Hung);
    assert_eq!(ended.client.as_deref(), Some("first"));
    assert_eq!(ended.reason, "has not finished step 1007 within 500ms");
    assert!(ended.steps <= 1006, "{ended}");
    assert!(
        ends.iter().all(|end| *end == Err(ended.clone())),
        "{ends:?}"
    );
}

/// A client that does something when it is dropped, at its end.
struct Waits<P, F: FnMut()>(P, F);

impl<P, F: FnMut()> Drop for Waits<P, F> {
    fn drop(&mut self) {
        self.1();
    }
}

impl<P: Participant, F: FnMut()> Participant for Waits<P, F> {
    fn declare(&self) -> Declaration {
        self.0.declare()
    }

    fn initial(&mut self, writes: &mut [u64]) {
        self.0.initial(writes);
    }

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.0.run(step, reads, writes)
    }
}

#[test]
fn a_client_that_gives_up_or_writes_a_wrong_value_is_named() {
    for (is_wrong, cause, part) in [
        (false, Cause::Failed, "gave up: enough"),
        (true, Cause::Protocol, "is not a valid ULINT"),
    ] {
        let mut bad = client("bad", 1, &["x"], &[], move |step, _, writes| {
            if step.sequence == 1234 {
                writes[0] = u64::MAX;
                return if is_wrong {
                    Ok(())
                } else {
                    Err("enough".to_owned())
                };
            }
            Ok(())
        });
        if is_wrong {
            bad.declaration.writes[0].data_type = tickbus_image::signal::DataType::Byte;
        }
        let good = client("good", 1, &[], &["x"], |_, _, _| Ok(()));
        let clients: Vec<Box<dyn Participant + Send>> = vec![Box::new(good), Box::new(bad)];
        let settings = direct(settings(5000, &["bad", "good"]));
        let (outcome, ends, _) = run(settings, Logic::new(), &Controls::default(), false, clients);
        let ended = outcome.expect_err("it breaks");
        assert_eq!(
            (ended.cause, ended.client.as_deref()),
            (cause, Some("bad")),
            "{ended}"
        );
        assert!(ended.reason.contains(part) || is_wrong, "{ended}");
        // The values of the other client may still be on their way to the server.
        assert!(ended.steps <= 1233, "{ended}");
        assert!(
            ends.iter().all(|end| *end == Err(ended.clone())),
            "{ends:?}"
        );
    }
}

/// Any order in which frames arrive at the clients gives the run of one process.
#[test]
fn no_order_of_frames_between_clients_changes_a_run() {
    const STEPS: u64 = 12;
    let expected = in_this_process(STEPS, 3);
    for seed in 0..2000_u64 {
        let mut random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut choose = |count: usize| {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            usize::try_from(random % count as u64).expect("below a length")
        };
        let mut participants = mixers(3);
        let declared = participants
            .iter()
            .map(|mixer| (String::new(), mixer.declare()));
        let members: Vec<_> = declared.collect();
        let mut meshes: Vec<Mesh> = (0..3)
            .map(|own| {
                let list = MemberList {
                    token: 1,
                    step: Nanos::from_millis(1),
                    own,
                    members: members.clone(),
                };
                Mesh::new(&list).expect("it is right")
            })
            .collect();
        let mut writes = vec![vec![0; 2]; 3];
        // The frames on their way, by sender and receiver.
        let mut ways = vec![VecDeque::<Vec<u8>>::new(); 9];
        let mut allowed = 0;
        loop {
            let mut can = Vec::new();
            for (at, mesh) in meshes.iter_mut().enumerate() {
                match mesh.advance() {
                    Next::Run(_) => can.push((at, at)),
                    Next::Wait(_) | Next::Server => {}
                }
                can.extend((0..3).map(|from| (from, at)).filter(|(from, to)| {
                    from != to && !ways[3 * from + to].is_empty() && mesh.takes(*from)
                }));
            }
            if allowed < STEPS {
                can.push((3, choose(3)));
            }
            if can.is_empty() {
                break;
            }
            let (from, to) = can[choose(can.len())];
            if from == 3 {
                // The server's message reaches one client before another.
                allowed += 1;
                (0..3).for_each(|at| meshes[(to + at) % 3].allow(allowed));
            } else if from != to {
                let frame = ways[3 * from + to].pop_front().expect("on its way");
                meshes[to].hear(from, &frame).expect("it is right");
            } else if let Next::Run(step) = meshes[to].advance() {
                match step.sequence {
                    0 => participants[to].initial(&mut writes[to]),
                    sequence => {
                        assert!(sequence <= allowed);
                        let reads = meshes[to].reads();
                        let ran = participants[to].run(step, reads, &mut writes[to]);
                        ran.expect("it runs");
                    }
                }
                let mut frame = Vec::new();
                wire::done(&mut frame, step.sequence, 0, &writes[to]);
                frame.drain(..wire::HEADER);
                meshes[to].hear(to, &frame).expect("it is right");
                for other in (0..3).filter(|other| *other != to) {
                    ways[3 * to + other].push_back(frame.clone());
                }
            }
        }
        for mesh in &mut meshes {
            assert_eq!(mesh.advance(), Next::Server, "seed {seed}");
            assert_eq!(mesh.outcome(), Some(expected), "seed {seed}");
        }
    }
}

#[test]
fn what_a_client_sends_another_is_checked() {
    let declared = mixers(2)
        .into_iter()
        .map(|mixer| (String::new(), mixer.declare()));
    let list = MemberList {
        token: 1,
        step: Nanos::from_millis(1),
        own: 0,
        members: declared.collect(),
    };
    let frame = |sequence, writes: &[u64]| {
        let mut frame = Vec::new();
        wire::done(&mut frame, sequence, 0, writes);
        frame.split_off(wire::HEADER)
    };
    let mut join = Vec::new();
    wire::join(&mut join, &list.members[1].1).expect("short names");
    for (bytes, part) in [
        (frame(1, &[0, 0]), "answered step 1 in step 0"),
        (frame(0, &[0]), "wrote 1 values in step 0, expected 2"),
        (frame(0, &[0, 70_000]), "wrote a wrong value in step 0"),
        (join.split_off(wire::HEADER), "something else than values"),
        (vec![2, 0], "too short"),
    ] {
        let mut mesh = Mesh::new(&list).expect("it is right");
        let told = mesh.hear(1, &bytes).expect_err("it is wrong");
        assert!(told.contains(part), "{told}");
    }
    let twice = MemberList {
        members: vec![list.members[0].clone(), list.members[0].clone()],
        ..list.clone()
    };
    Mesh::new(&twice).expect_err("two of one name");
    Mesh::new(&MemberList { own: 2, ..list }).expect_err("not in the list");
}
