//! A simulation whose ticks are of any length: `step = "tick"`; and what a waiting client knows.

use std::sync::mpsc;
use std::thread;

use crate::sdsp::{controller, of_two, open};
use crate::server::Server;
use tickbus_base::time::Nanos;
use tickbus_conformance::rig::{await_that, statistic};
use tickbus_driver::Code;
use tickbus_fieldbus::LinkState;
use tickbus_virtual_time::server::Control;
use tickbus_virtual_time::{Settings, StartCondition, TraceHash};

const MICRO: i64 = 1000;

/// Runs a machine with this key and ticks in microseconds beside a PLC that counts its steps of 1 ms. Returns, per tick,
/// the code, the granted time, and the PLC's count; and the trace hash.
fn run(key: &str, ticks: &[i64]) -> (Vec<(Code, i64, f64)>, TraceHash) {
    let server = of_two(12);
    let plc = controller(server.port, "", |end, _| {
        end.set("echo", end.get("echo") + 1.0);
    });
    let mut machine = open(server.port, "device", key);
    let mut seen = Vec::new();
    for tick in ticks {
        machine.slots[0] =
            tickbus_image::signal::Slot::from_real(i32::try_from(*tick).expect("few").into());
        let now = Nanos(tick * MICRO);
        let found = machine.driver.exchange(now, &mut machine.slots);
        seen.push((found.code, found.granted.0, machine.slots[2].real()));
    }
    // Beyond the last step.
    let end = machine
        .driver
        .exchange(Nanos::from_secs(1), &mut machine.slots);
    assert_eq!(end.code, Code::Stale);
    let outcome = server.end().expect("it ends");
    assert_eq!(outcome.steps, 12);
    plc.join().expect("no panic");
    (seen, outcome.hash)
}

#[test]
fn a_tick_is_the_first_step_at_or_after_its_time() {
    let ms = 1_000_000;
    // The machine's own time begins at 100 ms.
    let ticks = [100_000, 100_400, 100_900, 102_500, 102_600, 107_000];
    let (seen, _) = run("step = \"tick\"", &ticks);
    let expected = [
        (Code::Fresh, 101 * ms, 0.0),
        (Code::Fresh, 102 * ms, 1.0),
        (Code::Unchanged, 102 * ms, 1.0),
        (Code::Fresh, 104 * ms, 3.0),
        (Code::Unchanged, 104 * ms, 3.0),
        (Code::Fresh, 108 * ms, 7.0),
    ];
    assert_eq!(seen, expected);
}

#[test]
fn ticks_over_several_steps_give_the_run_of_a_machine_that_takes_each_of_them() {
    let ticks = [0, 1000, 4000, 5000, 9000];
    let (seen, hash) = run("step = \"tick\"", &ticks);
    let (seen_stepwise, stepwise) = run("", &ticks);
    let values = |seen: &[(Code, i64, f64)]| -> Vec<(Code, f64)> {
        seen.iter()
            .map(|(code, _, count)| (*code, *count))
            .collect()
    };
    assert_eq!(values(&seen), values(&seen_stepwise));
    assert_eq!(hash, stepwise);
}

#[test]
fn a_client_that_waits_knows_for_whom() {
    let mut settings = Settings::new(Nanos::from_millis(1), StartCondition::Count(2));
    (settings.steps, settings.paused) = (Some(3), true);
    let server = Server::start(settings);
    let (to, watches) = mpsc::channel();
    let port = server.port;
    let machine = thread::spawn(move || {
        let mut machine = open(port, "device", "");
        to.send(machine.driver.watch()).expect("it listens");
        while machine.tick().code == Code::Fresh {}
        (
            machine.link().state,
            statistic(&machine.driver, "sdsp.waits_for"),
        )
    });
    let watch = watches.recv().expect("it opens");
    let waits = |whom: &str| {
        await_that(whom, || {
            watch
                .statistics()
                .to_string()
                .contains(&format!("sdsp.waits_for={whom}"))
        });
    };
    waits("1 of 2 clients; joined have: ");
    let plc = controller(port, "", |_, _| ());
    waits("a command, since the run is paused");
    server.controls.send(Control::Run);
    let ended = machine.join().expect("no panic");
    assert_eq!(ended, (LinkState::Stale, Some("nobody".to_owned())));
    assert!(server.end().is_ok());
    plc.join().expect("no panic");
}
