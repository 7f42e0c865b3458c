//! The rules that make a run deterministic, with clients in this process.

use std::cell::RefCell;
use std::sync::Mutex;

use crate::common::{client, mixer_settings, mixers, settings};
use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;
use tickbus_virtual_time::{
    Cause, Ended, Logic, Outcome, Participant, Settings, StartCondition, Variable, in_process,
};

fn run(
    settings: Settings,
    clients: &mut [&mut dyn Participant],
    logic: Logic<'_>,
) -> Result<Outcome, Ended> {
    let clients = clients
        .iter_mut()
        .map(|client| &mut **client as _)
        .collect();
    in_process::run(settings, clients, logic)
}

#[test]
fn the_first_step_is_at_time_zero_and_the_due_set_holds_through_the_step() {
    let log = RefCell::new(Vec::new());
    let note = |name: &'static str| {
        let log = &log;
        move |step: tickbus_virtual_time::Step, _: &[u64], _: &mut [u64]| {
            log.borrow_mut().push((name, step.sequence, step.time));
            Ok(())
        }
    };
    let mut every = client("every", 1, &[], &[], note("every"));
    let mut third = client("third", 3, &[], &[], note("third"));
    let ended = run(
        settings(5, &["every", "third"]),
        &mut [&mut third, &mut every],
        Logic::new(),
    );
    assert_eq!(ended.expect("it runs").time, Nanos::from_millis(4));
    let ms = Nanos::from_millis;
    assert_eq!(
        *log.borrow(),
        [
            ("every", 1, ms(0)),
            ("third", 1, ms(0)),
            ("every", 2, ms(1)),
            ("every", 3, ms(2)),
            ("every", 4, ms(3)),
            ("third", 4, ms(3)),
            ("every", 5, ms(4)),
        ]
    );
}

#[test]
fn everyone_reads_the_snapshot_of_the_step_before() {
    let seen = RefCell::new(Vec::new());
    let mut one = client("one", 1, &["a"], &["b"], |_, reads, writes| {
        seen.borrow_mut().push(reads[0]);
        writes[0] = reads[0] + 1;
        Ok(())
    });
    let mut two = client("two", 1, &["b"], &["a"], |_, reads, writes| {
        writes[0] = reads[0] + 10;
        Ok(())
    });
    let clients: &mut [&mut dyn Participant] = &mut [&mut one, &mut two];
    run(settings(6, &["one", "two"]), clients, Logic::new()).expect("it runs");
    // One step of latency each way: b is 0, 0+10, 1+10, 11+10, ...
    assert_eq!(*seen.borrow(), [0, 10, 11, 21, 22, 32]);
}

#[test]
fn the_order_of_the_clients_does_not_matter() {
    let hash = |turn: usize| {
        let mut mixers = mixers(5);
        mixers.rotate_left(turn);
        let clients = mixers.iter_mut().map(|mixer| mixer as _).collect();
        in_process::run(mixer_settings(1000, 5), clients, Logic::new()).expect("it runs")
    };
    let first = hash(0);
    for turn in 1..5 {
        assert_eq!(hash(turn), first);
    }
    // Pinned: equal on every machine, in every version.
    assert_eq!(first.hash.to_string(), "c368d732f6faaa2f");
}

#[test]
fn two_writers_of_one_variable_are_both_named() {
    for turned in [false, true] {
        let idle = |_: tickbus_virtual_time::Step, _: &[u64], _: &mut [u64]| Ok(());
        let mut robot = client("robot", 1, &["x"], &[], idle);
        let mut plc = client("plc", 1, &["x"], &[], idle);
        let mut clients: [&mut dyn Participant; 2] = [&mut robot, &mut plc];
        if turned {
            clients.reverse();
        }
        let ended = run(settings(1, &["robot", "plc"]), &mut clients, Logic::new());
        let ended = ended.expect_err("two writers");
        assert_eq!(ended.cause, Cause::Configuration);
        let expected = "the variable \"x\" is written by client \"plc\" and by client \"robot\"";
        assert!(ended.reason.starts_with(expected), "{ended}");
    }
}

#[test]
fn a_variable_that_nobody_writes_cannot_be_read() {
    let mut plc = client("plc", 1, &["start"], &["strat"], |_, _, _| Ok(()));
    let ended = run(settings(1, &["plc"]), &mut [&mut plc], Logic::new());
    assert_eq!(
        ended.expect_err("nobody writes it").to_string(),
        "the run ended before its first step: client \"plc\" reads the variable \"strat\", which nobody writes; \
         did you mean \"start\"?"
    );
}

#[test]
fn logic_runs_in_its_order_and_its_writes_join_the_commit() {
    let log = Mutex::new(Vec::new());
    let note = |text: String| log.lock().expect("no panic").push(text);
    let mut plc = client("plc", 1, &["a"], &["sum", "now"], |step, reads, writes| {
        note(format!(
            "run {} sum {} now {}",
            step.sequence, reads[0], reads[1]
        ));
        writes[0] = step.sequence * 10;
        Ok(())
    });
    let logic = Logic::new()
        .variable(Variable::new("sum", DataType::Ulint))
        .variable(Variable::new("now", DataType::Lint))
        .on_start(|access| access.set("sum", 7))
        .on_time(|access| {
            note(format!("time {}", access.step().time));
            access.set("now", access.step().time.0.cast_unsigned())
        })
        .on_change("a", |access| {
            let (a, sum) = (access.get("a")?, access.get("sum")?);
            note(format!("change a {a} at {}", access.step().sequence));
            access.set("sum", sum + a)
        })
        .on_read("sum", |access| {
            let reader = access.reader().unwrap_or_default().to_owned();
            note(format!("read by {reader} sum {}", access.get("sum")?));
            Ok(())
        });
    run(settings(2, &["plc"]), &mut [&mut plc], logic).expect("it runs");
    drop(plc);
    assert_eq!(
        log.into_inner().expect("no panic"),
        [
            "read by plc sum 7",
            "time 0s",
            "run 1 sum 7 now 0",
            "change a 10 at 1",
            "read by plc sum 17",
            "time 1ms",
            "run 2 sum 17 now 0",
            "change a 20 at 2",
        ]
    );
}

#[test]
fn logic_that_fails_or_oversteps_ends_the_run() {
    let plc = || {
        client("plc", 1, &["a"], &["a"], |_, _, writes| {
            writes[0] += 1;
            Ok(())
        })
    };
    let ended = |logic| run(settings(9, &["plc"]), &mut [&mut plc()], logic).expect_err("it fails");
    let late = ended(
        Logic::new().on_change("a", |access| match access.get("a")? {
            3 => Err("three is too many".to_owned()),
            _ => Ok(()),
        }),
    );
    assert_eq!((late.cause, late.steps), (Cause::Logic, 2));
    assert!(late.reason.ends_with("three is too many"), "{late}");
    let read = ended(
        Logic::new().on_read("a", |access| match access.step().sequence {
            2 => Err("nobody reads it thrice".to_owned()),
            _ => Ok(()),
        }),
    );
    assert_eq!((read.cause, read.steps), (Cause::Logic, 2), "{read}");
    for (logic, part) in [
        (Logic::new().on_time(|a| a.set("a", 1)), "is a client's"),
        (Logic::new().on_time(|a| a.set("b", 1)), "no variable \"b\""),
        (
            Logic::new().on_change("b", |_| Ok(())),
            "which nobody writes",
        ),
        (
            Logic::new()
                .variable(Variable::new("b", DataType::Bool))
                .on_time(|access| access.set("b", 2)),
            "0x2 is not a valid BOOL",
        ),
        (
            Logic::new()
                .variable(Variable::new("b", DataType::Bool))
                .on_change("b", |_| Ok(())),
            "its own variable",
        ),
    ] {
        let told = ended(logic).to_string();
        assert!(told.contains(part), "{told}");
    }
}

#[test]
fn a_participant_that_fails_ends_the_run_and_is_named() {
    let mut good = client("good", 1, &[], &[], |_, _, _| Ok(()));
    let mut bad = client("bad", 1, &[], &[], |step, _, _| match step.sequence {
        3 => Err("out of paper".to_owned()),
        _ => Ok(()),
    });
    let clients: &mut [&mut dyn Participant] = &mut [&mut bad, &mut good];
    let ended = run(settings(9, &["bad", "good"]), clients, Logic::new()).expect_err("it fails");
    assert_eq!(
        ended.to_string(),
        "the run ended after 2 steps: client \"bad\" gave up: out of paper"
    );
}

#[test]
fn settings_without_sense_are_refused() {
    let one = || StartCondition::Count(1);
    let step = Nanos::from_millis(1);
    let named = |names: &[&str]| {
        StartCondition::Names(names.iter().map(|name| (*name).to_owned()).collect())
    };
    for (settings, part) in [
        (Settings::new(Nanos::ZERO, one()), "\"step\" is 0s"),
        (Settings::new(step, StartCondition::Count(0)), "0 clients"),
        (Settings::new(step, named(&[])), "0 clients"),
        (Settings::new(step, named(&["a", "a"])), "expected twice"),
        (Settings::new(step, named(&["b"])), "expected are \"b\""),
        (
            Settings::new(step, StartCondition::Count(2)),
            "waits for 1 of 2 clients",
        ),
    ] {
        let mut a = client("a", 1, &[], &[], |_, _, _| Ok(()));
        let told = run(settings, &mut [&mut a], Logic::new());
        let told = told.expect_err(part).to_string();
        assert!(told.contains(part), "{told}");
    }
}

#[test]
fn time_beyond_292_years_ends_the_run() {
    let mut a = client("a", 1, &[], &[], |_, _, _| Ok(()));
    let one = StartCondition::Count(1);
    let ended = run(
        Settings::new(Nanos(i64::MAX / 3), one),
        &mut [&mut a],
        Logic::new(),
    );
    let ended = ended.expect_err("time ends");
    assert_eq!(ended.steps, 4, "{ended}");
}
