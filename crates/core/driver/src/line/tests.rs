use tickbus_base::time::Monotonic;
use tickbus_fieldbus::LinkState;
use tickbus_image::signal::Slot;
use tickbus_programs::Mirror;

use super::*;
use crate::{Code, Driver, Host};

/// The text of a driver.cfg on a link of this name.
fn text(role: &str, link: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nrole = \"{role}\"\nlink = \"{link}\"\n\
         cycle = \"1ms\"\n[[signal]]\nname = \"in\"\naddress = \"%IB0\"\n\
         [[signal]]\nname = \"out\"\naddress = \"%QB0\"\nfail_safe = 77\n"
    )
}

fn config(text: &str) -> Config {
    Config::parse("driver.cfg", text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"))
}

fn opened(text: &str) -> (Driver, Vec<Slot>) {
    let driver = Driver::open(config(text), Monotonic::shared()).expect("opens");
    let slots = driver.initial_slots();
    (driver, slots)
}

/// A PLC that sends `value`.
fn plc(link: &str, value: f64) -> (Driver, Vec<Slot>) {
    let (driver, mut slots) = opened(&text("controller", link));
    slots[1] = Slot::from_real(value);
    (driver, slots)
}

/// Ticks until `is_seen`, for a while.
fn tick_until(
    drivers: &mut [&mut (Driver, Vec<Slot>)],
    is_seen: impl Fn(Code, &[Slot]) -> bool,
) -> bool {
    eventually(|| {
        let mut seen = false;
        for (at, (driver, slots)) in drivers.iter_mut().enumerate() {
            let found = driver.exchange(None, slots);
            seen |= at == 0 && is_seen(found.code, slots);
        }
        seen
    })
}

/// Returns true once `is_done` does, and false after a long time.
fn eventually(mut is_done: impl FnMut() -> bool) -> bool {
    let clock = Monotonic::shared();
    let end = clock.now() + Nanos::from_secs(20);
    while clock.now() < end {
        if is_done() {
            return true;
        }
        std::thread::yield_now();
    }
    false
}

fn is(value: f64) -> impl Fn(Code, &[Slot]) -> bool {
    move |code, slots| code != Code::Stale && slots[1] == Slot::from_real(value)
}

#[test]
fn a_driver_goes_to_another_plc_and_back_without_a_restart() {
    let mut machine = opened(&text("device", "line-first"));
    let mut first = plc("line-first", 5.0);
    let mut second = plc("line-second", 9.0);
    let line = machine.0.line().expect("a free bus");
    assert!(tick_until(&mut [&mut machine, &mut first], is(5.0)));

    let other = text("device", "line-second").replace("cycle", "max_age = \"3s\"\ncycle");
    assert!(line.take(config(&other)).expect("only the line differs"));
    assert!(!line.take(config(&other)).expect("the same again"));
    assert!(tick_until(&mut [&mut machine, &mut second], is(9.0)));
    let statistics = machine.0.statistics();
    assert!(statistics.contains("max_age=3s"), "{statistics}");

    // Nobody is at this end: an outage like any other.
    let nowhere = text("device", "line-nowhere");
    assert!(line.take(config(&nowhere)).expect("only the line differs"));
    let is_out = |code, slots: &[Slot]| code == Code::Stale && slots[1] == Slot::from_real(77.0);
    assert!(tick_until(&mut [&mut machine, &mut first], is_out));
    assert_ne!(machine.0.link().state, LinkState::Running);

    let back = config(&text("device", "line-first"));
    assert!(line.take(back).expect("only the line differs"));
    assert!(tick_until(&mut [&mut machine, &mut first], is(5.0)));
    let ticks = machine.0.statistics();
    machine.0.close();
    assert!(ticks.contains("ticks="), "{ticks}");
    let back = config(&text("device", "line-first"));
    assert!(matches!(line.take(back), Err(Untaken::Closed)));
}

#[test]
fn what_needs_a_restart_is_refused_and_the_old_line_goes_on() {
    let mut machine = opened(&text("device", "line-refused"));
    let mut peer = plc("line-refused", 5.0);
    let line = machine.0.line().expect("a free bus");
    assert!(tick_until(&mut [&mut machine, &mut peer], is(5.0)));
    let other = text("device", "line-x").replace("\"%QB0\"", "\"%QB0\"\ntype = \"SINT\"");
    let refused = line.take(config(&other)).expect_err("another type");
    assert_eq!(
        refused.to_string(),
        "signal 2 \"out\" has another type; restart the simulation for that"
    );
    // A bus that the tick runs.
    let stepped = text("device", "line-x").replace("cycle = \"1ms\"", "mode = \"stepped\"");
    let refused = line.take(config(&stepped)).expect_err("in step");
    assert!(refused.to_string().contains("in step with"), "{refused}");
    assert!(tick_until(&mut [&mut machine, &mut peer], is(5.0)));
    assert_eq!(machine.0.link().state, LinkState::Running);
    machine.0.close();
}

#[test]
fn the_plc_of_before_gets_the_fail_safe_values_if_at_close_says_so() {
    let leaves = text("device", "line-leaves").replace("cycle", "at_close = \"fail_safe\"\ncycle");
    let leaves = leaves.replace("\"%IB0\"", "\"%IB0\"\nfail_safe = 33");
    let mut machine = opened(&leaves);
    machine.1[0] = Slot::from_real(8.0);
    let (mut old, mut slots) = plc("line-leaves", 5.0);
    let line = machine.0.line().expect("a free bus");
    assert!(eventually(|| {
        machine.0.exchange(None, &mut machine.1);
        old.exchange(None, &mut slots);
        slots[0] == Slot::from_real(8.0)
    }));
    let moved = leaves.replace("line-leaves", "line-left");
    assert!(line.take(config(&moved)).expect("only the line differs"));
    old.exchange(None, &mut slots);
    assert_eq!(slots[0], Slot::from_real(33.0));
    machine.0.close();
}

#[test]
fn a_hosted_program_takes_another_line_and_keeps_its_forced_signals() {
    let config_of = |link| config(&text("device", link));
    let tick = Nanos::from_millis(1);
    let program = Box::new(Mirror);
    let clock = Monotonic::shared();
    let host = Host::open(&config_of("line-host-a"), program, tick, clock).expect("opens");
    let line = host.line().expect("a free bus");
    let mut watch = host.watch().expect("the first");
    let mut plcs = [plc("line-host-a", 5.0), plc("line-host-b", 9.0)];
    let comes_back = |(driver, slots): &mut (Driver, Vec<Slot>), value: f64| {
        eventually(|| {
            driver.exchange(None, slots);
            slots[0] == Slot::from_real(value)
        })
    };
    assert!(comes_back(&mut plcs[0], 5.0));
    let other = text("device", "line-host-b").replace("cycle", "watchdog = \"1min\"\ncycle");
    assert!(line.take(config(&other)).expect("only the line differs"));
    assert!(comes_back(&mut plcs[1], 9.0));
    watch.force(0, Slot::from_real(42.0)).expect("room");
    watch.ask(false);
    assert!(comes_back(&mut plcs[1], 42.0));
    let back = config_of("line-host-a");
    assert!(line.take(back).expect("only the line differs"));
    assert!(comes_back(&mut plcs[0], 42.0));
    assert_eq!(host.close(), None);
}

#[test]
fn a_driver_leaves_the_program_at_its_other_end_for_a_plc_and_a_reset_keeps_that() {
    let own = text("device", "x").replace("link = \"x\"", "program = \"mirror\"\nscan = \"1ms\"");
    let mut machine = opened(&own);
    machine.1[0] = Slot::from_real(3.0);
    let line = machine.0.line().expect("a free bus");
    assert!(tick_until(&mut [&mut machine], is(3.0)));
    machine.0.reset(&mut machine.1).expect("its own line");
    machine.1[0] = Slot::from_real(4.0);
    assert!(tick_until(&mut [&mut machine], is(4.0)));

    let mut real = plc("line-real", 9.0);
    let moved = config(&text("device", "line-real"));
    assert!(line.take(moved).expect("only the line differs"));
    assert!(tick_until(&mut [&mut machine, &mut real], is(9.0)));
    machine.0.reset(&mut machine.1).expect("the line stays");
    assert!(tick_until(&mut [&mut machine, &mut real], is(9.0)));
    assert!(!machine.0.statistics().contains("plc.scans"));
    machine.0.close();
}

#[test]
fn a_watch_has_the_limits_that_the_line_has_taken() {
    let with = |more: &str| {
        let text = text("device", "line-limits");
        text.replace("cycle = \"1ms\"\n", &format!("cycle = \"1ms\"\n{more}"))
    };
    let (mut driver, _) = opened(&with("watchdog = \"1s\"\n"));
    let watch = driver.watch();
    assert_eq!(watch.watchdog(), Some(Nanos::from_secs(1)));
    let line = driver.line().expect("free");
    let next = config(&with("watchdog = \"2s\"\nmax_age = \"7s\"\n"));
    assert!(line.take(next).expect("it can"));
    assert_eq!(watch.watchdog(), Some(Nanos::from_secs(2)));
    assert_eq!(watch.max_age(), Nanos::from_secs(7));
    driver.close();
}
