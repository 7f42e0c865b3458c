//! Faults of one station among several.

use std::fmt::Write as _;
use std::sync::Arc;
use tickbus::driver::Code;
use tickbus::time::{Manual, Nanos};
use tickbus_conformance::rig::{End, await_that, pass};

use crate::faults::Link;

#[test]
fn one_station_of_two_is_gone() {
    let link = Link::new();
    let text = |role: &str| {
        format!(
            "[driver]\nid = 1\nname = \"{role}\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"{}\"\n\
             role = \"{role}\"\nmode = \"stepped\"\nmax_age = \"300ms\"\n\
             [[station]]\nname = \"one\"\n[[station]]\nname = \"two\"\n\
             [[signal]]\nname = \"first\"\nstation = \"one\"\naddress = \"%QB0\"\n\
             [[signal]]\nname = \"second\"\nstation = \"two\"\naddress = \"%QB0\"\nfail_safe = 99\n",
            link.0
        )
    };
    let clock = Manual::new();
    let mut device = End::open(
        &(text("device")
            + "[[fault]]\nkind = \"station-down\"\nstation = \"two\"\ntick = 11\nticks = 100\n"),
        &clock,
        &tickbus::KINDS,
    );
    let mut controller = End::open(&text("controller"), &clock, &tickbus::KINDS);
    let mut tick = |number: u8| {
        let time = Nanos::from_millis(10 * i64::from(number));
        controller.set("first", f64::from(number));
        controller.set("second", f64::from(number));
        controller.driver.exchange(time, &mut controller.slots);
        let code = device.driver.exchange(time, &mut device.slots).code;
        (
            code,
            device.get("first"),
            device.get("second"),
            device.link().reason,
        )
    };
    for number in 1..=10 {
        tick(number);
    }
    let (code, first, second, _) = tick(11);
    assert_eq!((code, first, second), (Code::Unchanged, 11.0, 10.0));
    for number in 12..=60 {
        tick(number);
    }
    let (code, first, second, reason) = tick(61);
    assert_eq!(
        (code, first, second),
        (Code::Stale, 61.0, 99.0),
        "the other one lives"
    );
    assert!(
        reason.ends_with("injected fault: \"station-down\" (station-down)"),
        "{reason}"
    );
    for number in 62..=110 {
        tick(number);
    }
    let (code, first, second, _) = tick(111);
    assert_eq!((code, first, second), (Code::Fresh, 111.0, 111.0));
}

#[test]
fn the_other_end_of_a_loopback_sees_that_one_station_is_down() {
    let link = Link::new();
    let open = |role: &str, clock: &Arc<Manual>| {
        let mut text = format!(
            "[driver]\nid = 1\nname = \"{role}\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"{}\"\n\
             role = \"{role}\"\ncycle = \"1ms\"\nmax_age = \"300ms\"\n",
            link.0
        );
        for station in ["one", "two"] {
            writeln!(text, "[[station]]\nname = \"{station}\"").expect("a String takes all");
        }
        for station in ["one", "two"] {
            writeln!(
                text,
                "[[signal]]\nname = \"{station}\"\nstation = \"{station}\"\naddress = \"%IB0\""
            )
            .expect("a String takes all");
        }
        End::open(&text, clock, &tickbus::KINDS)
    };
    let clock = Manual::new();
    let (mut device, mut controller) = (open("device", &clock), open("controller", &clock));
    let stale =
        |end: &End| ["one", "two"].map(|name| end.statistic(&format!("station.{name}.stale")));
    let mut until = |right: [&str; 2], fault: Option<&str>| {
        if let Some(fault) = fault {
            device.driver.inject_text(fault).expect("a right fault");
        }
        await_that("the controller sees it", || {
            pass(&clock, 2);
            device.tick();
            controller.tick();
            stale(&controller) == right
        });
    };
    until(["false", "false"], None);
    until(
        ["false", "true"],
        Some("kind = \"station-down\"\nstation = \"two\""),
    );
}
