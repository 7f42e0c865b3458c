//! Tests of the faults of a simulation's model: when the model hears of them, and which names it knows.

use tickbus_base::time::{Manual, Nanos};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Slot;

use crate::Driver;

const TEXT: &str = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\n\
                    program = \"mirror\"\nscan = \"1ms\"\n[[signal]]\nname = \"a\"\naddress = \"%IB0\"\n\
                    [[signal]]\nname = \"b\"\naddress = \"%QB0\"\n";

fn open(faults: &str) -> Driver {
    let config = Config::parse("driver.cfg", &format!("{TEXT}{faults}"), &crate::KINDS);
    Driver::open(config.unwrap_or_else(|why| panic!("{why}")), Manual::new()).expect("opens")
}

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn inject(driver: &mut Driver, text: &str) -> u32 {
    let injected = driver.inject_text(&format!("kind = \"model\"\n{text}"));
    injected.unwrap_or_else(|why| panic!("{why}"))
}

/// The changes since the last call, as text.
fn told(driver: &mut Driver) -> String {
    let mut told = Vec::new();
    while let Some((place, value)) = driver.next_model_change() {
        let value = value.map_or("off".to_owned(), |value| value.to_string());
        told.push(format!("{place}={value}"));
    }
    told.join(" ")
}

/// Ticks with each of these values of `a`, in one piece or in halves; returns the changes that the model gets per tick.
fn run(driver: &mut Driver, values: &[u8], is_halved: bool) -> Vec<String> {
    let mut slots = driver.initial_slots();
    let tick = |(number, value): (i64, &u8)| {
        let time = Nanos::from_millis(number);
        let value = Slot::from_real(f64::from(*value));
        if is_halved {
            driver.receive(time, &mut slots);
            let told = told(driver);
            slots[0] = value;
            driver.send(&mut slots);
            told
        } else {
            slots[0] = value;
            driver.exchange(time, &mut slots);
            told(driver)
        }
    };
    (1..).zip(values).map(tick).collect()
}

#[test]
fn a_model_is_told_its_faults_in_the_ticks_in_which_they_begin_and_end() {
    let faults = "[[fault]]\nkind = \"model\"\nname = \"wear\"\nvalue = 0.2\ntick = 2\n\
                  [[fault]]\nkind = \"model\"\nname = \"leak\"\nwhen = \"a > 3\"\nticks = 2\ntimes = 2\n\
                  [[fault]]\nkind = \"model\"\nname = \"wear\"\nvalue = 0.6\ntick = 4\nticks = 2\n";
    for is_halved in [false, true] {
        let mut driver = open(faults);
        let declared = driver.declare_model_faults(names(&["leak", "wear"]));
        declared.expect("they are known");
        let seen = run(&mut driver, &[0, 0, 9, 0, 0, 9, 0, 0, 9], is_halved);
        // A condition sees what this end has written: in halves that is the value of the tick before.
        let expected: [&str; 9] = if is_halved {
            [
                "",
                "1=0.2",
                "",
                "0=1 1=0.6",
                "",
                "0=off 1=0.2",
                "0=1",
                "",
                "0=off",
            ]
        } else {
            [
                "",
                "1=0.2",
                "0=1",
                "1=0.6",
                "0=off",
                "0=1 1=0.2",
                "",
                "0=off",
                "",
            ]
        };
        assert_eq!(seen, expected, "halved: {is_halved}");
        // A new episode begins without faults, and then has those of the configuration again.
        let mut slots = driver.initial_slots();
        driver.reset(&mut slots).expect("it can");
        assert_eq!(told(&mut driver), "1=off");
        assert_eq!(run(&mut driver, &[0, 0], is_halved), ["", "1=0.2"]);
        driver.close();
    }
}

#[test]
fn an_injected_fault_of_the_model_ends_on_request() {
    let mut driver = open("");
    driver
        .declare_model_faults(names(&["leak"]))
        .expect("one name");
    let fault = inject(&mut driver, "name = \"leak\"\nvalue = 0.4\n");
    assert_eq!(run(&mut driver, &[0, 0], false), ["0=0.4", ""]);
    assert!(driver.end_fault(fault));
    assert_eq!(told(&mut driver), "", "no tick has passed");
    let mut slots = driver.initial_slots();
    driver.exchange(Nanos::from_millis(3), &mut slots);
    assert_eq!(told(&mut driver), "0=off");
    driver.close();
}

#[test]
fn a_fault_that_the_model_does_not_know_is_a_mistake_with_the_nearest_name() {
    let faults = "[[fault]]\nkind = \"model\"\nname = \"leek\"\nat = \"1s\"\n";
    let mut driver = open(faults);
    let refused = driver.declare_model_faults(names(&["leak", "wear"]));
    assert_eq!(
        refused.expect_err("leek").to_string(),
        "the model has no fault \"leek\"; did you mean \"leak\"?"
    );
    driver.close();
    let mut driver = open("");
    let mut refused = |text: &str| driver.inject_text(text).expect_err("unknown").to_string();
    assert_eq!(
        refused("kind = \"model\"\nname = \"wer\"\n"),
        "fault: the model has no fault \"wer\"; let the simulation declare it before its first tick"
    );
    driver
        .declare_model_faults(names(&["leak", "wear"]))
        .expect("names");
    let mut refused = |text: &str| driver.inject_text(text).expect_err("unknown").to_string();
    assert_eq!(
        refused("kind = \"model\"\nname = \"wer\"\n"),
        "fault: the model has no fault \"wer\"; did you mean \"wear\"?"
    );
    for wrong in [&["a", "a"][..], &[""], &["a\nb"]] {
        let refused = driver
            .declare_model_faults(names(wrong))
            .expect_err("no names");
        let right = "give each a name of its own, without control characters";
        assert!(refused.to_string().ends_with(right), "{refused}");
    }
    // The names from before still count.
    inject(&mut driver, "name = \"wear\"\nat = \"1s\"\n");
    driver.close();
}
