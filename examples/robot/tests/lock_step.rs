//! The robot in lock-step: every run is the same, whichever client is first and however busy the computer.

use std::sync::{Mutex, PoisonError};
use std::thread;

use tickbus_net::Address;
use tickbus_robot::experiment::{Experiment, Kind, verdict};
use tickbus_robot::load::Load;
use tickbus_robot::lock_step;
use tickbus_robot::metrics::Run;
use tickbus_robot::participants::{Machine, Program, STEPS};
use tickbus_virtual_time::{Ended, Meeting, Outcome};

/// The trace hash of the run. A client in another language must give the same, as `java/sdsp` does.
const HASH: &str = "9e758daaecadc30e";

/// Runs one test at a time, so that the load of one does not affect the others.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Makes this many runs and compares them; `one` receives true if the PLC is first.
#[track_caller]
fn assert_all_equal(runs: u32, one: impl Fn(bool) -> Result<(Run, Outcome), Ended>) {
    let runs = (0..runs).map(|number| one(number % 3 == 0).expect("it runs"));
    let (runs, outcomes): (Vec<Run>, Vec<Outcome>) = runs.unzip();
    for outcome in outcomes {
        assert_eq!(outcome.steps, STEPS as u64);
        assert_eq!(outcome.time.0, 4_701_000_000);
        assert_eq!(outcome.hash.to_string(), HASH);
    }
    let bits = |run: &Run| {
        run.iter()
            .flatten()
            .map(|x| x.to_bits())
            .collect::<Vec<_>>()
    };
    for run in &runs[1..] {
        assert_eq!(bits(run), bits(&runs[0]));
    }
    let experiment = Experiment::new("lock-step", Kind::LockStep, runs);
    assert_eq!(verdict(&[experiment]), Ok(()));
}

#[test]
fn in_one_process_all_runs_are_equal() {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let _load = Load::on_all_processors();
    assert_all_equal(10, lock_step::in_process);
}

/// Makes a run with a thread for each client.
fn with_threads(at: Meeting, plc_first: bool) -> Result<(Run, Outcome), Ended> {
    lock_step::served(at, |server| {
        let mut machine = Machine::default();
        thread::scope(|scope| {
            let plant = || lock_step::join(server, &mut machine).expect("the plant has its run");
            let plc = || {
                let outcome = lock_step::join(server, &mut Program::default());
                outcome.expect("the PLC has its run")
            };
            let [first, second] = if plc_first {
                let plc = scope.spawn(plc);
                [plc, scope.spawn(plant)]
            } else {
                let plant = scope.spawn(plant);
                [plant, scope.spawn(plc)]
            };
            let outcome = first.join().expect("no panic");
            assert_eq!(second.join().expect("no panic"), outcome);
        });
        machine.into_run()
    })
}

#[test]
fn over_tcp_all_runs_are_the_same_as_in_one_process() {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let _load = Load::on_all_processors();
    assert_all_equal(10, |plc_first| {
        with_threads(Meeting::Tcp(Address::local(0)), plc_first)
    });
}

#[cfg(unix)]
#[test]
fn over_a_unix_socket_a_run_is_the_same_as_in_one_process() {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let place = format!("unix:robot-test-{}", std::process::id());
    assert_all_equal(3, |plc_first| {
        with_threads(place.parse().expect("a place"), plc_first)
    });
}

#[cfg(unix)]
#[test]
fn through_shared_memory_a_run_is_the_same_as_in_one_process() {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let name = format!("robot-test-{}", std::process::id());
    assert_all_equal(3, |plc_first| {
        with_threads(Meeting::SharedMemory(name.clone()), plc_first)
    });
}
