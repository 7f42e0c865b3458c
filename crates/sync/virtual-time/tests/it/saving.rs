//! Runs that are saved at a step and restored: the run is the uninterrupted one.

use std::path::{Path, PathBuf};
use std::thread;

use tickbus_base::time::{Monotonic, Nanos};
use tickbus_record::Options;
use tickbus_virtual_time::server::{Control, Server};
use tickbus_virtual_time::{
    Cause, Declaration, Exchange, Logic, Outcome, Participant, RecordedRun, Save, SavedRun,
    Settings, StartCondition, Step, compare, in_process, tcp,
};

use crate::common::{Mixer, client, mixer_settings, mixers, run_until, serve, settings};

const STEPS: u64 = 1000;
const CLIENTS: u32 = 3;

/// A mixer that asks for its next step.
struct Events(Mixer, Option<Nanos>);

impl Participant for Events {
    fn declare(&self) -> Declaration {
        self.0.declare()
    }

    fn initial(&mut self, writes: &mut [u64]) {
        self.0.initial(writes);
    }

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.0.run(step, reads, writes)?;
        let wait = i64::try_from(writes[0] % 5).expect("below 5");
        self.1 = Some(step.time + Nanos::from_millis(wait));
        Ok(())
    }

    fn next_update(&self) -> Option<Nanos> {
        self.1
    }
}

/// A mixer that saves its state, and counts its steps.
struct Stateful(Mixer, u64);

impl Participant for Stateful {
    fn declare(&self) -> Declaration {
        self.0.declare()
    }

    fn initial(&mut self, writes: &mut [u64]) {
        self.0.initial(writes);
    }

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.1 += 1;
        self.0.run(step, reads, writes)
    }

    fn save(&mut self) -> Result<Vec<u8>, String> {
        Ok(self.0.state().to_le_bytes().to_vec())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), String> {
        let state = <[u8; 8]>::try_from(state).map_err(|_| "not 8 bytes".to_owned())?;
        *self.0.state() = u64::from_le_bytes(state);
        Ok(())
    }
}

/// The clients of a run as they are when their processes begin: with multiples, with events, and with an interval that
/// is no whole number of steps.
fn clients() -> Vec<Box<dyn Participant + Send>> {
    let mut mixers = mixers(CLIENTS).into_iter();
    let [a, b, c] = std::array::from_fn(|_| mixers.next().expect("three"));
    let mut c = c;
    c.every(Nanos::from_micros(2_500));
    vec![Box::new(a), Box::new(Events(b, None)), Box::new(c)]
}

fn recording(file: &Path, steps: u64) -> Logic<'static> {
    let options = Options::to(file).expect("a format");
    let clock = Monotonic::shared() as _;
    let attached = RecordedRun::attach(Logic::new(), &options, "cell", Some(steps), &clock);
    attached.expect("a file").0
}

fn run_here(settings: Settings, logic: Logic<'_>) -> Outcome {
    let mut clients = clients();
    let clients = clients
        .iter_mut()
        .map(|client| &mut **client as &mut dyn Participant);
    in_process::run(settings, clients.collect(), logic).expect("it runs")
}

fn run_over_tcp(settings: Settings, logic: Logic<'_>) -> (Outcome, Vec<String>) {
    let (outcome, news, joined) = serve(settings, logic, |address, _, _| {
        thread::scope(|scope| {
            let join = |mut client: Box<dyn Participant + Send>| {
                scope.spawn(move || tcp::join(address, &mut *client))
            };
            let joined: Vec<_> = clients().into_iter().map(join).collect();
            let ends = joined.into_iter().map(|one| one.join().expect("no panic"));
            ends.collect::<Vec<_>>()
        })
    });
    let outcome = outcome.expect("it runs");
    assert!(joined.iter().all(|end| *end == Ok(outcome)), "{joined:?}");
    (outcome, news)
}

fn saving(steps: u64, file: &Path, at: Option<u64>) -> Settings {
    let file = file.to_owned();
    Settings {
        save: Some(Save { file, at }),
        ..mixer_settings(steps, CLIENTS)
    }
}

fn restoring(steps: u64, file: &Path) -> Settings {
    Settings {
        restore: Some(SavedRun::load(file).expect("it was saved")),
        ..mixer_settings(steps, CLIENTS)
    }
}

#[test]
fn a_run_that_was_saved_and_restored_is_the_uninterrupted_one_and_so_is_its_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let whole = run_here(
        mixer_settings(STEPS, CLIENTS),
        recording(&at("whole.vcd"), STEPS),
    );

    // The first process ends with the step, the second one runs on, and the third one saves again.
    let first = run_here(saving(500, &at("a.saved"), Some(500)), Logic::new());
    assert_eq!(first.steps, 500);
    let saved = SavedRun::load(&at("a.saved")).expect("it was saved");
    assert_eq!((saved.steps(), saved.hash()), (500, first.hash));
    let second = run_here(
        restoring(STEPS, &at("a.saved")),
        recording(&at("second.vcd"), STEPS),
    );
    assert_eq!(second, whole);
    let third = Settings {
        save: Some(Save {
            file: at("b.saved"),
            at: Some(750),
        }),
        ..restoring(STEPS, &at("a.saved"))
    };
    let (third, news) = run_over_tcp(third, Logic::new());
    assert_eq!(third, whole);
    let expected = [
        "all have joined: the clients run the steps up to 500 again, then the run continues"
            .to_owned(),
        format!("saved after step 750 in {}", at("b.saved").display()),
    ];
    for line in expected {
        assert!(news.contains(&line), "{line} in {news:#?}");
    }
    let (fourth, _) = run_over_tcp(
        restoring(STEPS, &at("b.saved")),
        recording(&at("fourth.vcd"), STEPS),
    );
    assert_eq!(fourth, whole);
    for name in ["second.vcd", "fourth.vcd"] {
        let compared = compare([&*at("whole.vcd"), &*at(name)]).expect("two recordings");
        assert_eq!(
            (compared.steps, compared.hash, compared.parting),
            (STEPS, Some(whole.hash), None)
        );
    }
}

#[test]
fn a_run_whose_clients_exchange_their_values_directly_is_saved_and_restored() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.saved");
    let small = |steps, save, restore| Settings {
        exchange: Exchange::Direct,
        save,
        restore,
        ..mixer_settings(steps, 2)
    };
    let run = |settings: Settings| {
        let (outcome, news, ()) = serve(settings, Logic::new(), |address, _, _| {
            thread::scope(|scope| {
                for mut mixer in mixers(2) {
                    scope.spawn(move || tcp::join(address, &mut mixer));
                }
            });
        });
        (outcome.expect("it runs"), news)
    };
    let whole = run(small(STEPS, None, None)).0;
    let save = Save {
        file: file.clone(),
        at: Some(500),
    };
    let (saved, news) = run(small(STEPS, Some(save), None));
    let directly = "the clients exchange their values directly";
    assert!(news.iter().any(|line| line == directly), "{news:#?}");
    assert_eq!(saved, whole);
    let restored = SavedRun::load(&file).expect("it was saved");
    let (restored, news) = run(small(STEPS, None, Some(restored)));
    assert_eq!(restored, whole);
    let through = "the server passes the values on: the run was restored";
    assert!(news.iter().any(|line| line == through), "{news:#?}");
}

#[cfg(unix)]
#[test]
fn a_run_through_shared_memory_is_saved_and_restored() {
    use tickbus_virtual_time::{Controls, Hosting, shared_memory};

    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.saved");
    let run = |part: &str, settings: Settings| {
        let name = format!("test-saving-{part}-{}", std::process::id());
        let listener = shared_memory::Listener::bind(&name, &settings).expect("a free name");
        thread::scope(|scope| {
            for mut client in clients() {
                let name = &name;
                scope.spawn(move || shared_memory::join(name, &mut *client));
            }
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                controls: &Controls::default(),
                news: &mut |_| {},
            };
            let outcome = listener.run(settings, Logic::new(), hosting);
            outcome.expect("it runs")
        })
    };
    let whole = run_here(mixer_settings(STEPS, CLIENTS), Logic::new());
    run("first", saving(300, &file, Some(300)));
    assert_eq!(run("second", restoring(STEPS, &file)), whole);
}

#[test]
fn clients_with_states_take_them_over_and_the_others_run_their_steps_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.saved");
    // Two clients with states beside one without, in one process and over TCP.
    let run = |settings: Settings, is_here: bool| {
        let mut mixers = mixers(CLIENTS).into_iter();
        let [a, b, mut c] = std::array::from_fn(|_| mixers.next().expect("three"));
        let (mut a, mut b) = (Stateful(a, 0), Stateful(b, 0));
        let (outcome, news) = if is_here {
            let clients: Vec<&mut dyn Participant> = vec![&mut a, &mut b, &mut c];
            (in_process::run(settings, clients, Logic::new()), Vec::new())
        } else {
            let (outcome, news, ()) = serve(settings, Logic::new(), |address, _, _| {
                thread::scope(|scope| {
                    let clients: [&mut (dyn Participant + Send); 3] = [&mut a, &mut b, &mut c];
                    for client in clients {
                        scope.spawn(move || tcp::join(address, client));
                    }
                });
            });
            (outcome, news)
        };
        (outcome.expect("it runs"), [a.1, b.1], news)
    };
    let (whole, ran, _) = run(mixer_settings(STEPS, CLIENTS), true);
    assert_eq!(ran, [1000, 500]);
    for is_here in [true, false] {
        let (outcome, ..) = run(saving(STEPS, &file, Some(500)), is_here);
        assert_eq!(outcome, whole);
        let (outcome, ran, news) = run(restoring(STEPS, &file), !is_here);
        assert_eq!((outcome, ran), (whole, [500, 250]), "{news:#?}");
        let line = "all have joined: 1 of 3 clients run the steps up to 500 again, the others take over their states, \
                    then the run continues";
        assert!(!is_here || news.iter().any(|it| it == line), "{news:#?}");
    }
}

#[test]
fn a_paused_run_is_saved_on_request_and_a_member_that_was_restored_can_come_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.saved");
    let paused = Settings {
        paused: true,
        ..saving(STEPS, &file, None)
    };
    let (outcome, news, ()) = serve(paused, Logic::new(), |address, controls, news| {
        controls.send(Control::Step(40));
        thread::scope(|scope| {
            for mut client in clients() {
                scope.spawn(move || tcp::join(address, &mut *client));
            }
            let is_saved = |line: &String| line.starts_with("saved after step 40 in ");
            let end = std::time::Instant::now() + std::time::Duration::from_secs(20);
            // The run may not have come to step 40 yet.
            while !news.lock().expect("no panic").iter().any(is_saved) {
                assert!(std::time::Instant::now() < end, "{news:?}");
                controls.send(Control::Save);
                thread::sleep(std::time::Duration::from_millis(10));
            }
            controls.send(Control::Stop);
        });
    });
    assert_eq!(outcome.expect("it is stopped").steps, 40, "{news:#?}");
    let whole = run_here(mixer_settings(STEPS, CLIENTS), Logic::new());
    let rejoining = Settings {
        exchange: Exchange::ByServer {
            rejoin: Some(Nanos::from_secs(20)),
        },
        ..restoring(STEPS, &file)
    };
    let (outcome, news, ()) = serve(rejoining, Logic::new(), |address, _, _| {
        thread::scope(|scope| {
            let mut clients = clients().into_iter();
            let mut lost = Some(clients.next().expect("three"));
            for mut client in clients {
                scope.spawn(move || tcp::join(address, &mut *client));
            }
            // Lost in its steps that it runs again, and after them.
            for last in [20, 60] {
                let mut client = (lost.take()).unwrap_or_else(|| self::clients().swap_remove(0));
                run_until(address, &mut *client, last, false);
            }
            let mut again = self::clients().swap_remove(0);
            tcp::join(address, &mut *again).expect("it is back");
        });
    });
    assert_eq!(outcome, Ok(whole), "{news:#?}");
}

fn refused(settings: Settings, logic: Logic<'_>) -> String {
    let refused = Server::new(settings, logic, Nanos::ZERO).map(|_| ());
    refused.expect_err("it makes no sense").to_string()
}

#[test]
fn what_cannot_be_saved_or_restored_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.saved");
    run_here(saving(100, &file, Some(100)), Logic::new());

    let logic = || Logic::new().on_time(|_| Ok(()));
    let restored = |change: &dyn Fn(&mut Settings)| {
        let mut settings = restoring(STEPS, &file);
        change(&mut settings);
        refused(settings, Logic::new())
    };
    let save = |at| {
        Some(Save {
            file: PathBuf::new(),
            at: Some(at),
        })
    };
    for (told, part) in [
        (
            refused(saving(9, &file, None), logic()),
            "whose server has logic",
        ),
        (
            refused(restoring(STEPS, &file), logic()),
            "whose server has logic",
        ),
        (
            refused(saving(9, &file, Some(10)), Logic::new()),
            "saved after step 10, and ends after step 9",
        ),
        (
            restored(&|it| it.step = Nanos::from_millis(2)),
            "the saved run has steps of 1ms, and this one of 2ms; give it steps of 1ms",
        ),
        (
            restored(&|it| it.steps = Some(99)),
            "saved after step 100, and is to end after step 99",
        ),
        (
            restored(&|it| it.save = save(99)),
            "saved after step 100, and is to be saved after step 99",
        ),
        (
            restored(&|it| it.start = StartCondition::Count(2)),
            "the clients are others than those of the saved run: [\"m0\", \"m1\", \"m2\"]",
        ),
    ] {
        assert!(told.contains(part), "{told}");
    }

    // A client that declares other things, and one that computes something else.
    let other = |run: fn(u64) -> u64, writes: &[&str], part: &str| {
        let file = folder.path().join("b.saved");
        let save = Settings {
            save: Some(Save {
                file: file.clone(),
                at: Some(5),
            }),
            ..settings(5, &["a"])
        };
        let mut a = client("a", 1, &["x"], &[], |step, _, writes| {
            writes[0] = step.sequence;
            Ok(())
        });
        in_process::run(save, vec![&mut a], Logic::new()).expect("it runs");
        let restore = Settings {
            restore: Some(SavedRun::load(&file).expect("it was saved")),
            ..settings(9, &["a"])
        };
        let mut a = client("a", 1, writes, &[], |step, _, writes| {
            writes[0] = run(step.sequence);
            Ok(())
        });
        let ended = in_process::run(restore, vec![&mut a], Logic::new()).expect_err("it differs");
        assert!(ended.reason.contains(part), "{ended}");
        ended.cause
    };
    let cause = other(
        |step| step,
        &["y"],
        "in the saved run \"a\" declared other things: number 1 of what it writes was \"x\" (ULINT)",
    );
    assert_eq!(cause, Cause::Refused);
    let cause = other(
        |step| step.min(3),
        &["x"],
        "in step 4 it had written 0x4 to \"x\"",
    );
    assert_eq!(cause, Cause::Failed);
}

#[test]
fn a_run_that_was_not_saved_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |settings: Settings, sends: &[Control]| {
        let (_, news, unsaved) = serve(settings, Logic::new(), |address, controls, _| {
            for control in sends {
                controls.send(*control);
            }
            thread::scope(|scope| {
                for mut client in clients() {
                    scope.spawn(move || tcp::join(address, &mut *client));
                }
            });
            controls.clone()
        });
        (news, unsaved.unsaved())
    };
    let nowhere = folder.path().join("none/a.saved");
    for (settings, sends, part) in [
        (saving(20, &nowhere, Some(10)), &[][..], "none/a.saved: "),
        (
            mixer_settings(20, CLIENTS),
            &[Control::Save],
            "start it with --save-to FILE",
        ),
    ] {
        let (news, unsaved) = run(settings, sends);
        let unsaved = unsaved.expect("it was not saved");
        assert!(unsaved.contains(part), "{unsaved}");
        let line = format!("not saved: {unsaved}");
        assert!(news.contains(&line), "{line} in {news:#?}");
    }
    let stopped = folder.path().join("a.saved");
    let (outcome, news, ()) = serve(
        saving(20, &stopped, Some(15)),
        Logic::new(),
        |address, _, _| {
            thread::scope(|scope| {
                let mut clients = clients();
                let mut lost = clients.swap_remove(0);
                for mut client in clients {
                    scope.spawn(move || tcp::join(address, &mut *client));
                }
                run_until(address, &mut *lost, 10, true);
            });
        },
    );
    assert_eq!(outcome.expect_err("it is lost").cause, Cause::Lost);
    let line = "not saved: the run ended before the end of step 15";
    assert!(news.iter().any(|it| it == line), "{news:#?}");
    assert!(!stopped.exists());
}
