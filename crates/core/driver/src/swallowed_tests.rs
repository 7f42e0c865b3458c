//! Tests of the counting of swallowed changes over a whole line.

use std::collections::HashMap;
use std::sync::Arc;

use tickbus_base::statistics::entries;
use tickbus_base::time::{Manual, Nanos};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Slot;

use crate::Driver;

const TICK: Nanos = Nanos::from_millis(1);

/// Opens an end of a loopback, with one BOOL in each direction.
fn open(fieldbus: &str, latch: &str, clock: &Arc<Manual>) -> Driver {
    let text = format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\n{fieldbus}\n\
         [[signal]]\nname = \"In\"\naddress = \"%IX0.0\"\n{latch}\n\
         [[signal]]\nname = \"Out\"\naddress = \"%QX0.0\"\n"
    );
    let config = Config::parse("driver.cfg", &text, &crate::KINDS);
    let config = config.unwrap_or_else(|mistakes| panic!("{mistakes}"));
    Driver::open(config, Arc::clone(clock) as _).expect("opens")
}

fn statistics(driver: &Driver) -> HashMap<String, u64> {
    let text = driver.statistics();
    let numbers = entries(&text).filter_map(|(key, value)| Some((key, value.parse().ok()?)));
    numbers.collect()
}

/// Ticks for a second, in which `In` is on for one tick of seven; returns the pulses.
fn pulse(driver: &mut Driver, mut wait: impl FnMut()) -> u64 {
    let mut slots = driver.initial_slots();
    let mut pulses = 0;
    for tick in 0..1_000 {
        let is_on = tick > 50 && tick % 7 == 0;
        pulses += u64::from(is_on);
        slots[0] = Slot::from_real(f64::from(u8::from(is_on)));
        driver.exchange(TICK.times(tick), &mut slots);
        wait();
    }
    pulses
}

#[test]
fn every_pulse_of_the_machine_is_seen_by_the_plc_or_counted_as_swallowed() {
    let hosted = "program = \"mirror\"\nscan = \"10ms\"\ncycle = \"2ms\"\nmode = ";
    for mode in ["stepped", "free"] {
        let clock = Manual::new();
        let mut driver = open(&format!("{hosted}\"{mode}\""), "", &clock);
        let settle = || {
            if mode == "free" {
                while !clock.is_settled(3) {
                    std::thread::yield_now();
                }
                clock.advance(TICK);
                while !clock.is_settled(3) {
                    std::thread::yield_now();
                }
            }
        };
        let pulses = pulse(&mut driver, settle);
        let found = statistics(&driver);
        let seen = found["plc.rises.In"];
        assert!(seen > 0 && seen < pulses / 2, "{mode}: {seen} of {pulses}");
        assert_eq!(seen + found["swallowed.In"], pulses, "{mode}");
        assert_eq!(found["swallowed_inputs"], found["swallowed.In"]);
        assert_eq!(found["swallowed_outputs"], 0);
        assert!(found["sent_age.count"] > 100, "{mode}");
    }
}

#[test]
fn nothing_is_swallowed_where_the_pulses_are_latched_or_as_long_as_a_scan() {
    let hosted = "program = \"mirror\"\nmode = \"stepped\"\nscan = ";
    for (scan, latch) in [("10ms", "latch = \"rising\""), ("1ms", "")] {
        let mut driver = open(&format!("{hosted}\"{scan}\""), latch, &Manual::new());
        pulse(&mut driver, || {});
        let found = statistics(&driver);
        assert_eq!(found["swallowed_inputs"], 0, "{scan} {latch}");
        assert!(!found.contains_key("swallowed.In"));
    }
}

#[test]
fn a_pulse_of_the_plc_between_two_ticks_is_counted_at_its_end_and_a_reset_begins_again() {
    let link = "mode = \"stepped\"\nlink = \"swallowed\"";
    let mut machine = open(link, "", &Manual::new());
    let role = format!("{link}\nrole = \"controller\"");
    let mut plc = open(&role, "", &Manual::new());
    let (mut inputs, mut outputs) = (machine.initial_slots(), plc.initial_slots());
    let mut both = |levels: &[u8], plc: &mut Driver| {
        for level in levels {
            outputs[1] = Slot::from_real(f64::from(*level));
            plc.exchange(None, &mut outputs);
        }
        machine.exchange(None, &mut inputs);
    };
    // They meet, and the first frame arrives.
    both(&[0], &mut plc);
    both(&[0], &mut plc);
    both(&[1, 0, 1, 0, 1], &mut plc);
    both(&[0], &mut plc);
    let found = statistics(&plc);
    assert_eq!((found["swallowed.Out"], found["swallowed_outputs"]), (2, 2));
    both(&[1, 0], &mut plc);
    assert_eq!(statistics(&plc)["swallowed.Out"], 3);
    plc.reset(&mut plc.initial_slots())
        .expect("it is its own line");
    assert_eq!(statistics(&plc)["swallowed_outputs"], 0);
}
