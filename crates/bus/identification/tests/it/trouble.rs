//! Faults between a controller and a machine at the two ends of a pseudo-terminal, and the damage that they must not
//! do.
#![cfg(unix)]

use std::io::{Read as _, Write as _};

use tickbus_base::os::LinkedTerminal;
use tickbus_base::time::{Clock as _, Manual, Monotonic, Nanos};
use tickbus_bus_identification::Access;
use tickbus_conformance::rig::{await_that, statistic};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::LinkState;

use crate::ends::{KINDS, Line, Pair, command};

const READ: Access<'_> = Access::Read {
    address: 0,
    length: 1,
};

#[test]
fn the_machine_sees_what_a_repeated_command_does_though_the_client_only_listens() {
    let line = Line::new();
    let mut machine = line.reader(&[1]);
    machine.set("present", 1.0);
    let mut port = line.open_port(&mut machine);
    let write = Access::Write {
        address: 0,
        data: b"x",
    };
    port.write_all(&command(true, write)).expect("room");
    await_that("the repetitions are counted", || {
        machine.tick();
        machine.get("writes") >= 3.0
    });
    assert_eq!(machine.link().state, LinkState::Running);
}

#[test]
fn a_controller_that_pauses_beyond_its_watchdog_gives_no_command_twice() {
    const WATCHDOG: Nanos = Nanos::from_millis(10);
    let mut pair = Pair::with(&[1], "watchdog = \"10ms\"");
    pair.put(&[1]);
    assert_eq!(pair.ask(b'k', 0, 1, &[7]), (0, vec![]));
    let last = pair.controller.get("echo");
    assert_eq!(last, f64::from(b'k' | 0x80), "unlike the fail-safe 0");
    let clock = Monotonic::shared();
    let begin = clock.now();
    await_that("the controller has paused", || {
        pair.machine.tick();
        clock.now() - begin > WATCHDOG
    });
    let paused = pair.cycles();
    await_that("its fail-safe values are looked at", || {
        pair.machine.tick();
        pair.cycles() > paused + 2
    });
    let resumed = pair.cycles();
    pair.until("it has gone on", |pair| pair.cycles() > resumed + 2);
    assert_eq!(pair.controller.get("echo"), last);
    assert_eq!(pair.ask(b'w', 0, 1, &[]), (0, vec![7]));
    pair.until("the machine is shown it", |pair| {
        pair.machine.get("out 0") == 7.0
    });
    assert_eq!(pair.machine.get("writes"), 1.0);
}

#[test]
fn while_the_line_is_down_by_a_fault_a_repeated_command_rests() {
    let line = Line::new();
    let clock = Manual::new();
    let mut machine = line.reader_by("pty:", &[1], &clock);
    let mut port = line.open_port(&mut machine);
    port.write_all(&command(true, READ)).expect("room");
    await_that("it is answered", || {
        machine.tick();
        port.read(&mut [0; 16]).is_ok()
    });
    let fault = machine.driver.inject_text("kind = \"link-down\"");
    fault.expect("a fault");
    machine.tick();
    // The next repetition is due by now.
    clock.advance(Nanos::from_millis(100));
    await_that("the bus waits", || clock.is_settled(1));
}

#[test]
fn a_carrier_keeps_what_was_written_when_the_adapter_is_plugged_in_again() {
    let line = Line::new();
    let mut machine = line.reader_by("", &[1], &Monotonic::shared());
    machine.set("present", 1.0);
    machine.set("in 0", 5.0);
    let mut ask = |access: Access<'_>, length: usize| {
        let mut far = LinkedTerminal::open(&line.name()).expect("a terminal");
        await_that("the machine listens", || {
            machine.tick();
            machine.link().reason.starts_with("listening")
        });
        far.write_all(&command(false, access)).expect("room");
        let mut heard = Vec::new();
        await_that("the answer comes", || {
            machine.tick();
            let mut some = [0; 64];
            if let Ok(count) = far.read(&mut some) {
                heard.extend_from_slice(&some[..count]);
            }
            heard.len() >= length
        });
        drop(far);
        await_that("the line has failed", || {
            machine.tick();
            machine.link().state == LinkState::Failed
        });
        heard
    };
    let write = Access::Write {
        address: 0,
        data: &[9],
    };
    assert!(ask(write, 5).starts_with(b"k00"));
    assert!(ask(READ, 6).starts_with(b"w00\x09"));
}

#[test]
fn a_status_that_says_nothing_of_a_carrier_shows_none_that_is_not_there() {
    let mut pair = Pair::new();
    pair.machine.set("fault", 6.0);
    let seen = |pair: &Pair| {
        (
            pair.controller.get("present"),
            pair.controller.get("connected"),
        )
    };
    await_that("the fault is taken over", || {
        pair.ask(b'w', 0, 1, &[]).0 == 6
    });
    assert_eq!(seen(&pair), (0.0, 1.0));
    pair.machine.set("fault", 0.0);
    pair.put(&[1]);
    pair.machine.set("fault", 6.0);
    await_that("the fault is taken over", || {
        pair.ask(b'w', 0, 1, &[]).0 == 6
    });
    assert_eq!(seen(&pair), (1.0, 1.0), "it was there before");
}

#[test]
fn after_noise_a_client_of_little_patience_leaves_the_reader_the_silence_that_it_needs() {
    let mut pair = Pair::with(&[1], "timeout = \"50ms\"");
    pair.put(&[1]);
    let mut other = std::fs::OpenOptions::new();
    let mut other = other.write(true).open(pair.line.name()).expect("a port");
    other.write_all(b"?").expect("room");
    pair.until("the reader has given it up", |pair| {
        statistic(&pair.machine.driver, "ivi-reader.damaged").is_some_and(|count| count != "0")
    });
    pair.until("they meet again", |pair| {
        pair.controller.get("present") == 1.0 && pair.controller.link().state == LinkState::Running
    });
}

#[test]
fn at_a_low_rate_the_default_age_outlasts_a_round_of_questions() {
    let timing = |kind: &str, extra: &str| {
        let text = format!(
            "[driver]\nid = 1\nname = \"slow\"\n[fieldbus]\nkind = \"{kind}\"\ndevice = \"/dev/ttyS0\"\n\
             input_bytes = 8\noutput_bytes = 8\n{extra}\n"
        );
        Config::parse("driver.cfg", &text, &KINDS).map(|config| config.timing.max_age)
    };
    let client = "role = \"controller\"\nbaud = 300";
    // A question takes about half a second.
    for found in [
        timing("ivi-client", client),
        timing("ivi-reader", "baud = 300"),
    ] {
        let found = found.expect("a configuration");
        assert!(found > Nanos::from_secs(1), "{found}");
    }
    let usual = timing("ivi-reader", "").expect("a configuration");
    assert_eq!(usual, Nanos::from_millis(250));
    let refused = timing("ivi-client", &format!("{client}\nmax_age = \"100ms\""));
    assert!(
        refused
            .expect_err("too short")
            .to_string()
            .contains("max_age")
    );
}

#[test]
fn a_command_that_was_not_sent_yet_is_taken_back() {
    let mut pair = Pair::new();
    pair.put(&[1]);
    assert_eq!(pair.ask(b'w', 0, 1, &[]), (0, vec![1]));
    // Finished commands stay finished.
    let done = pair.controller.get("echo");
    pair.controller.set("command", f64::from(b'q' | 0x80));
    let seen = pair.cycles();
    pair.until("it is looked at", |pair| pair.cycles() > seen + 2);
    assert_eq!(pair.controller.get("echo"), done);
    let Pair {
        line,
        machine,
        mut controller,
        toggle,
    } = pair;
    drop(machine);
    await_that("the line has failed", || {
        controller.tick();
        controller.link().state == LinkState::Failed
    });
    controller.set("count", 1.0);
    controller.set("command", f64::from(b'k'));
    controller.tick();
    controller.set("command", f64::from(b'q'));
    controller.tick();
    let machine = line.reader(&[1]);
    let mut pair = Pair {
        line,
        machine,
        controller,
        toggle: toggle ^ 0x80,
    };
    pair.put(&[6]);
    assert_eq!(pair.answer(b'q'), (0, vec![]));
    assert_eq!(pair.ask(b'w', 0, 1, &[]), (0, vec![6]));
    assert_eq!(pair.machine.get("writes"), 0.0);
}
