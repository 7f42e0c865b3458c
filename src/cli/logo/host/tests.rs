use super::*;
use tickbus_function_blocks::{Program, Terminals};

fn terminal() -> Terminal {
    let program = Program::parse("lab.toml", "[outputs]\nQ1 = \"I1\"\n", Terminals::default());
    Terminal::new(Controller::new(program.expect("it is right")))
}

fn channel(text: &str) -> Channel {
    Channel::parse(text.as_bytes()).expect(text)
}

#[test]
fn between_5_and_8_volts_an_input_keeps_its_state() {
    let mut terminal = terminal();
    for (volts, is_on) in [
        ("7.9", false),
        ("8", false),
        ("8.1", true),
        ("5", true),
        ("4.9", false),
        ("24", true),
        ("-24", false),
    ] {
        terminal.set(
            channel("I1"),
            &Number::parse(volts.as_bytes()).expect(volts),
        );
        assert_eq!(terminal.inputs[0], is_on, "{volts}");
    }
}

#[test]
fn an_input_that_would_switch_twice_asks_for_a_scan() {
    let (on, off) = (Number::of(24).expect("24"), Number::ZERO);
    let mut terminal = terminal();
    terminal.set(channel("I1"), &on);
    assert!(!terminal.would_lose_an_edge(channel("I1"), &on));
    assert!(terminal.would_lose_an_edge(channel("I1"), &off));
    assert!(!terminal.would_lose_an_edge(channel("I2"), &on));
    assert!(!terminal.would_lose_an_edge(channel("AI1"), &on));
    terminal.changed.fill(false);
    assert!(!terminal.would_lose_an_edge(channel("I1"), &off));
}

#[test]
fn without_a_dispatcher_all_inputs_are_off() {
    let mut terminal = terminal();
    let on = Number::of(24).expect("24");
    terminal.set(channel("I1"), &on);
    terminal.controller.scan(Nanos::ZERO, WallTime::default());
    assert!(terminal.controller.outputs()[0]);
    terminal.pull_all_cables();
    terminal.controller.scan(Nanos::ZERO, WallTime::default());
    assert!(!terminal.controller.outputs()[0]);
    assert!(terminal.changed[0], "that is an edge, too");
}

#[test]
fn the_week_is_that_of_the_time_zone() {
    let now = wall_time(&TimeZone::UTC);
    let later = wall_time(&TimeZone::fixed(jiff::tz::offset(14)));
    let hour = 3600 * 1_000_000_000;
    let of_week =
        |wall: WallTime| wall.day * 24 + usize::try_from(wall.time.0 / hour).expect("hours");
    let hours = (of_week(later) + 7 * 24 - of_week(now)) % (7 * 24);
    // The hour may have ended in between.
    assert!((14..=15).contains(&hours), "{hours} hours");
    assert!(now.time.0 < 24 * hour);
}
