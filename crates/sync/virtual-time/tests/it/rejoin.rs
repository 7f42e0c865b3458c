//! Members that are lost within a run, and come back: the run is the one that it would have been.

use std::sync::Mutex;
use std::thread;

use crate::common::{run_until, serve};
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_image::signal::DataType;
use tickbus_virtual_time::server::Control;
use tickbus_virtual_time::{
    Cause, Declaration, Exchange, Logic, Participant, Settings, StartCondition, Step, Variable,
    in_process, tcp,
};

const STEPS: u64 = 60;

/// A client whose values depend on all that it has read.
struct Mixer {
    name: &'static str,
    other: &'static str,
    multiple: u32,
    sum: u64,
    /// The steps from one event to the next, if it is a simulation of events.
    events: Option<u64>,
    next: u64,
    salt: u64,
}

impl Mixer {
    fn new(name: &'static str, other: &'static str, multiple: u32) -> Self {
        Self {
            name,
            other,
            multiple,
            sum: 0,
            events: None,
            next: 0,
            salt: 3,
        }
    }
}

impl Participant for Mixer {
    fn declare(&self) -> Declaration {
        Declaration {
            multiple: self.multiple.try_into().expect("not 0"),
            writes: vec![
                Variable::new(format!("{} sum", self.name), DataType::Lword),
                Variable::new(format!("{} odd", self.name), DataType::Bool),
            ],
            reads: vec![format!("{} sum", self.other), format!("{} odd", self.name)],
            ..Declaration::new(self.name)
        }
    }

    fn initial(&mut self, writes: &mut [u64]) {
        writes[0] = self.salt;
    }

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.sum = self
            .sum
            .wrapping_mul(31)
            .wrapping_add(reads[0] ^ step.sequence)
            + reads[1];
        writes[0] = self.sum;
        writes[1] = self.sum & 1;
        self.next = step.sequence + self.events.unwrap_or(1) + (self.sum & 3);
        Ok(())
    }

    fn next_update(&self) -> Option<Nanos> {
        self.events
            .map(|_| Nanos::from_millis(self.next.cast_signed()))
    }
}

fn settings() -> Settings {
    let names = ["a", "b"].map(str::to_owned).to_vec();
    Settings {
        steps: Some(STEPS),
        exchange: Exchange::ByServer {
            rejoin: Some(Nanos::from_secs(30)),
        },
        hang: Nanos::from_secs(20),
        ..Settings::new(Nanos::from_millis(1), StartCondition::Names(names))
    }
}

/// Waits for a line of the server's news.
fn await_news(news: &Mutex<Vec<String>>, part: &str, count: usize) {
    let clock = Monotonic::shared();
    let end = clock.now() + Nanos::from_secs(20);
    loop {
        let found = news.lock().expect("no panic");
        if found.iter().filter(|line| line.contains(part)).count() >= count {
            return;
        }
        assert!(clock.now() < end, "no {part} in {found:?}");
        drop(found);
        clock.wait_until(clock.now() + Nanos::from_millis(5), &Stop::new());
    }
}

#[test]
fn a_run_whose_members_are_lost_and_come_back_is_the_undisturbed_one() {
    for (multiple, events) in [(1, None), (3, None), (1, Some(4))] {
        let a = || Mixer {
            events,
            ..Mixer::new("a", "b", multiple)
        };
        let b = || Mixer::new("b", "a", 1);
        let undisturbed = in_process::run(settings(), vec![&mut a(), &mut b()], Logic::new());
        let undisturbed = undisturbed.expect("it runs");
        for owing in [true, false] {
            let (outcome, news, joined) = serve(settings(), Logic::new(), |address, _, news| {
                thread::scope(|scope| {
                    let other = scope.spawn(|| {
                        run_until(address, &mut b(), 30, owing);
                        await_news(news, "client \"b\" was lost", 1);
                        tcp::join(address, &mut b())
                    });
                    for (times, last) in [(1, 10), (2, 20)] {
                        run_until(address, &mut a(), last, owing);
                        await_news(news, "client \"a\" was lost", times);
                    }
                    let outcome = tcp::join(address, &mut a());
                    [outcome, other.join().expect("no panic")]
                })
            });
            let joined_as = joined.map(|one| one.expect("it is back"));
            assert_eq!(joined_as, [undisturbed; 2], "{news:#?}");
            assert_eq!(outcome, Ok(undisturbed), "{news:#?}");
            for (part, count) in [
                ("\"a\" is back", 2),
                ("\"a\" has caught up", 2),
                ("\"b\" has caught up", 1),
            ] {
                let found = news.iter().filter(|line| line.contains(part)).count();
                assert_eq!(found, count, "{part} in {news:#?}");
            }
        }
    }
}

#[test]
fn members_that_are_all_lost_come_back_in_any_order() {
    let undisturbed = in_process::run(
        settings(),
        vec![&mut Mixer::new("a", "b", 1), &mut Mixer::new("b", "a", 2)],
        Logic::new(),
    );
    let (outcome, news, joined) = serve(settings(), Logic::new(), |address, controls, news| {
        controls.send(Control::Step(10));
        thread::scope(|scope| {
            scope.spawn(|| run_until(address, &mut Mixer::new("a", "b", 1), 8, true));
            scope.spawn(|| run_until(address, &mut Mixer::new("b", "a", 2), 7, false));
        });
        await_news(news, "was lost", 2);
        controls.send(Control::Run);
        thread::scope(|scope| {
            let b = scope.spawn(|| tcp::join(address, &mut Mixer::new("b", "a", 2)));
            await_news(news, "\"b\" is back", 1);
            let a = tcp::join(address, &mut Mixer::new("a", "b", 1));
            [a, b.join().expect("no panic")]
        })
    });
    assert_eq!(outcome, undisturbed, "{news:#?}");
    assert_eq!(joined, [outcome.clone(), outcome]);
}

#[test]
fn a_member_that_computes_something_else_ends_the_run_with_the_variable() {
    let (outcome, ..) = serve(settings(), Logic::new(), |address, _, news| {
        thread::scope(|scope| {
            scope.spawn(|| tcp::join(address, &mut Mixer::new("b", "a", 1)));
            run_until(address, &mut Mixer::new("a", "b", 1), 10, true);
            await_news(news, "was lost", 1);
            let mut other = Mixer {
                salt: 4,
                ..Mixer::new("a", "b", 1)
            };
            let told = tcp::join(address, &mut other).expect_err("it differs");
            assert_eq!(told.cause, Cause::Failed);
        });
    });
    let ended = outcome.expect_err("it differs");
    assert_eq!((ended.cause, ended.steps), (Cause::Failed, 9));
    assert_eq!(ended.client.as_deref(), Some("a"));
    let told =
        "came back as another one: in step 0 it had written 0x3 to \"a sum\", and now writes 0x4";
    assert!(ended.reason.contains(told), "{}", ended.reason);
}

#[test]
fn a_member_that_stays_away_or_is_another_one_is_told() {
    let exchange = Exchange::ByServer {
        rejoin: Some(Nanos::from_millis(300)),
    };
    let (outcome, news, ()) = serve(
        Settings {
            exchange,
            ..settings()
        },
        Logic::new(),
        |address, _, news| {
            thread::scope(|scope| {
                scope.spawn(|| tcp::join(address, &mut Mixer::new("b", "a", 1)));
                run_until(address, &mut Mixer::new("a", "b", 1), 10, true);
                await_news(news, "was lost", 1);
                let refused =
                    tcp::join(address, &mut Mixer::new("a", "b", 2)).expect_err("it differs");
                assert_eq!(refused.cause, Cause::Refused);
                assert!(
                    refused.reason.contains("its multiple was 1, and is 2"),
                    "{refused}"
                );
                let refused =
                    tcp::join(address, &mut Mixer::new("a", "a", 1)).expect_err("it differs");
                let told = "number 1 of what it reads was \"b sum\", and is \"a sum\"";
                assert!(refused.reason.contains(told), "{refused}");
            });
        },
    );
    let ended = outcome.expect_err("it stays away");
    assert_eq!((ended.cause, ended.steps), (Cause::Lost, 9));
    assert_eq!(ended.client.as_deref(), Some("a"));
    assert!(
        ended
            .reason
            .ends_with("; it did not come back within 300ms"),
        "{}",
        ended.reason
    );
    let told =
        "client \"a\" was lost: it closed the connection; the run waits 300ms for it to come back";
    assert!(news.iter().any(|line| line == told), "{news:#?}");
}

#[test]
fn a_run_that_waits_for_a_member_can_be_stopped() {
    let (outcome, ..) = serve(settings(), Logic::new(), |address, controls, news| {
        thread::scope(|scope| {
            scope.spawn(|| tcp::join(address, &mut Mixer::new("b", "a", 1)));
            run_until(address, &mut Mixer::new("a", "b", 1), 10, true);
            await_news(news, "was lost", 1);
            controls.send(Control::Stop);
        });
    });
    let ended = outcome.expect_err("step 10 is not finished");
    assert_eq!((ended.cause, ended.steps), (Cause::Stopped, 9));
    assert_eq!(ended.client.as_deref(), Some("a"));
}
