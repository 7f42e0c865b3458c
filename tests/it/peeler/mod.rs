//! The programs "charger" and "lathe" against a small peeling line in Rust, byte by byte, in simulation time.

mod line;
mod plant;

use line::Line;
use tickbus::plc::Report;
use tickbus::statistics::Statistics;
use tickbus_test_log as logged;

/// The text after `key=` in a report, if there is one.
fn text_of(report: &dyn Report, key: &str) -> Option<String> {
    let mut statistics = Statistics::default();
    report.write(&mut statistics);
    let text = statistics.to_string();
    let mut lines = text.lines();
    let found = lines.find_map(|line| line.strip_prefix(&format!("{key}=")));
    found.map(str::to_owned)
}

/// The same, as a number that must be there.
fn told(report: &dyn Report, key: &str) -> f64 {
    let text = text_of(report, key).unwrap_or_else(|| panic!("no {key}"));
    text.parse().expect("a number")
}

/// The same, as a count.
fn counted(report: &dyn Report, key: &str) -> u32 {
    let number = told(report, key);
    (0..1_000)
        .find(|count| f64::from(*count) >= number)
        .expect("a small number")
}

#[test]
fn both_programs_peel_block_after_block() {
    let mut line = Line::new(&[], &[]);
    line.until("three cores", 300.0, |line| line.plant.cores == 3);
    let (charger, lathe) = (line.report(0), line.report(1));
    assert_eq!(counted(&*charger, "peeler.faults"), 0);
    assert_eq!(counted(&*lathe, "peeler.faults"), 0);
    line.seconds(3.0);
    assert_eq!(counted(&*lathe, "peeler.blocks"), 3);
    assert!(told(&*charger, "peeler.blocks") >= 3.0);
    assert!(
        line.plant.veneer > 3.0 * 20_000.0,
        "{} mm of veneer",
        line.plant.veneer
    );
}

#[test]
fn an_acknowledge_gives_many_commands_a_second_where_holding_gives_two() {
    let rotation = "peeler.commands_per_s.spindle rotation";
    let hold = [("hold", "500ms")];
    let mut held = Line::new(&hold, &hold);
    held.until("a core", 150.0, |line| line.plant.cores == 1);
    let mut quick = Line::new(&[], &[]);
    quick.until("a core", 150.0, |line| line.plant.cores == 1);
    let (held, quick) = (held.report(1), quick.report(1));
    println!("hold:\n{}acknowledge:\n{}", held.summary(), quick.summary());
    assert!(told(&*held, rotation) <= 2.0);
    assert!(told(&*quick, rotation) >= 10.0, "{}", quick.summary());
    // The purpose of the command rate: a constant speed of the veneer.
    let error = "peeler.speed_error_rms_percent";
    assert!(
        told(&*held, error) > 2.0 * told(&*quick, error),
        "{}{}",
        held.summary(),
        quick.summary()
    );
}

#[test]
fn an_axis_that_fails_stops_all_axes_and_the_line_goes_on_when_it_is_well() {
    let failures = [
        (1, 3, "knife carriage"),
        (0, 8, "transfer arm"),
        (0, 2, "centring spindle left"),
        (1, 0, "spindle left"),
    ];
    for (number, axis, name) in failures {
        logged::expect("\" is not healthy; all axes stop, and the sequence begins anew");
        let mut line = Line::new(&[], &[]);
        line.until("a core", 150.0, |line| line.plant.cores == 1);
        line.seconds(4.0);
        line.plant.sides[number].drives[axis].healthy = false;
        line.seconds(0.1);
        let enabled = |line: &Line| line.enabled(number);
        assert_eq!(enabled(&line), 0, "axis {axis} of side {number}");
        let report = line.report(number);
        let told = |key| text_of(&*report, key);
        assert_eq!(told("peeler.not_healthy").as_deref(), Some(name));
        line.seconds(1.0);
        line.plant.sides[number].drives[axis].healthy = true;
        line.seconds(0.5);
        assert_eq!(
            enabled(&line),
            0,
            "not before it has been well for a second"
        );
        line.until("another core", 150.0, |line| line.plant.cores == 3);
        let report = line.report(number);
        assert_eq!(text_of(&*report, "peeler.not_healthy"), None);
        assert_eq!(
            text_of(&*report, "peeler.failed_axes").as_deref(),
            Some(name)
        );
        let summary = report.summary();
        let named = format!("axes that were not healthy: {name}\n");
        assert!(summary.contains(&named), "{summary}");
        assert_eq!(counted(&*line.report(number), "peeler.faults"), 1);
    }
}

#[test]
fn a_simulation_that_is_started_again_begins_anew() {
    logged::expect(
        "lathe: the step Clamp takes too long; all axes stop, and the sequence begins anew",
    );
    let mut line = Line::new(&[], &[]);
    line.until("a block in the lathe", 60.0, |line| {
        line.plant.held.is_some()
    });
    line.restart();
    line.until("a core", 150.0, |line| line.plant.cores == 1);
    assert_eq!(counted(&*line.report(0), "peeler.restarts"), 1);
    assert_eq!(counted(&*line.report(0), "peeler.faults"), 0);
}

#[test]
fn a_link_that_breaks_at_any_moment_loses_no_block() {
    for moment in (0_u8..40).step_by(3) {
        let mut line = Line::new(&[], &[]);
        line.seconds(3.0 + f64::from(moment));
        for side in [0, 1] {
            line.alive[side] = (usize::from(moment) / 2 + side) % 2 == 1;
        }
        line.seconds(1.0);
        line.alive = [true; 2];
        line.until("a core", 150.0, |line| line.plant.cores == 2);
    }
}

#[test]
fn a_line_that_stands_still_waits_and_goes_on() {
    logged::expect(
        "lathe: the step Clamp takes too long; all axes stop, and the sequence begins anew",
    );
    let mut line = Line::new(&[], &[]);
    line.until("a block in the lathe", 60.0, |line| {
        line.plant.held.is_some()
    });
    line.frozen = true;
    line.seconds(100.0);
    line.frozen = false;
    line.until("a core", 150.0, |line| line.plant.cores == 1);
    assert_eq!(
        counted(&*line.report(0), "peeler.faults"),
        0,
        "a pause is no fault"
    );
}

/// A program's error about options or a table that it cannot use.
fn refusal(name: &str, options: &[(&str, &str)]) -> String {
    let options: Vec<(String, String)> = options
        .iter()
        .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
        .collect();
    let refused = tickbus::programs::program(name, &options).err();
    refused.expect("refused").to_string()
}

#[test]
fn wrong_options_are_told_with_what_would_be_right() {
    for (name, option, value, part) in [
        ("charger", "hold", "long", "write a duration, such as 500ms"),
        ("lathe", "hold", "0s", "write a duration, such as 500ms"),
        ("charger", "blocks", "0", "after how many blocks"),
        (
            "charger",
            "thickness",
            "1.5",
            "it takes \"hold\" and \"blocks\"",
        ),
        ("lathe", "thickness", "-1", "in mm, such as 1.5"),
        ("lathe", "peeling_speed", "fast", "in mm/s, such as 3000"),
    ] {
        let told = refusal(name, &[(option, value)]);
        assert!(told.contains(part), "{told}");
    }
}

#[test]
fn a_table_that_lacks_a_signal_is_told_by_its_name() {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("plc/peeler/charger.cfg");
    let text = std::fs::read_to_string(file).expect("the file");
    for (from, to, part) in [
        (
            "acknowledge = true\n",
            "",
            "give the option hold, such as hold=500ms",
        ),
        (
            "\"transfer arm\"",
            "\"arm\"",
            "finds no signal \"transfer arm.",
        ),
        (
            "\"simulation time\"",
            "\"time\"",
            "finds no signal \"simulation time\"",
        ),
    ] {
        let text = text.replace(from, to);
        let config = tickbus::driver_cfg::Config::parse("charger.cfg", &text, &tickbus::KINDS)
            .expect("a good file");
        let mut program = tickbus::programs::program("charger", &[]).expect("a program");
        let told = program.fit(&config.table, config.addressing);
        let told = told.expect_err("a signal is missing").to_string();
        assert!(told.contains(part), "{told}");
    }
}

#[test]
fn a_program_is_done_after_its_blocks() {
    let mut line = Line::new(&[], &[("blocks", "1")]);
    assert!(!line.report(1).is_done());
    line.until("its end", 150.0, |line| line.report(1).is_done());
    assert!(!line.report(0).is_done(), "the charger was asked for none");
}

/// Three disturbances one after another, at random times; a block that two hold must not be released by both.
#[test]
fn troubles_at_random_moments_lose_no_block() {
    logged::expect("all axes stop, and the sequence begins anew");
    let mut random = 0x2545_F491_u32;
    let mut next = |below: u32| {
        random ^= random << 13;
        random ^= random >> 17;
        random ^= random << 5;
        random % below
    };
    for run in 0..10 {
        let mut line = Line::new(&[], &[]);
        let mut troubles = Vec::new();
        for _ in 0..3 {
            let wait = f64::from(next(4_000)) / 100.0;
            line.seconds(wait);
            let (side, lasts) = (usize::from(next(2) == 1), f64::from(next(400)) / 100.0);
            if next(2) == 0 {
                troubles.push(format!("after {wait} s the link of {side} for {lasts} s"));
                line.alive[side] = false;
                line.seconds(lasts);
                line.alive[side] = true;
            } else {
                let axis = next(12) as usize;
                troubles.push(format!(
                    "after {wait} s axis {axis} of {side} for {lasts} s"
                ));
                line.plant.sides[side].drives[axis].healthy = false;
                line.seconds(lasts);
                line.plant.sides[side].drives[axis].healthy = true;
            }
        }
        println!("run {run}: {}", troubles.join(", "));
        let cores = line.plant.cores;
        line.until("two more cores", 200.0, |line| {
            line.plant.cores == cores + 2
        });
    }
}

/// Both PLCs are gone while both hold the block: the first to return must not rely on the other.
#[test]
fn a_block_in_two_hands_is_dropped_by_neither_when_both_plcs_come_back() {
    for away in [[1.0_f64, 1.0], [1.0, 3.0], [3.0, 1.0]] {
        let mut line = Line::new(&[], &[]);
        line.until("a block in two hands", 60.0, |line| line.plant.is_shared());
        line.alive = [false; 2];
        let [first, second] = away;
        let (sooner, later) = if first < second { (0, 1) } else { (1, 0) };
        line.seconds(first.min(second));
        line.alive[sooner] = true;
        line.seconds((first - second).abs());
        line.alive[later] = true;
        line.until("a core", 150.0, |line| line.plant.cores == 1);
        assert!(line.plant.veneer > 20_000.0, "it was peeled, not dropped");
    }
}
