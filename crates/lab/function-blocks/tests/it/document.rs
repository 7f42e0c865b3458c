//! The examples in docs/virtual-lab.md: the behaviour of each block, and whole programs.

use std::collections::BTreeSet;

use tickbus_base::time::Nanos;
use tickbus_function_blocks::{Controller, Program, Terminals, WallTime};

const DAYS: [&str; 7] = ["Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun"];

fn document() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/virtual-lab.md");
    std::fs::read_to_string(path).expect("the document")
}

/// The contents of the code blocks that begin like this.
fn code<'d>(document: &'d str, beginning: &'d str) -> impl Iterator<Item = &'d str> {
    let blocks = document.split(beginning).skip(1);
    blocks.map(|block| block.split_once("\n```").expect("an end").0)
}

fn number(text: &str) -> f64 {
    if text == "." {
        return 0.0;
    }
    text.parse().expect(text)
}

fn row(line: &str) -> (&str, Vec<f64>) {
    let (name, values) = line.split_once(' ').expect("a name");
    (name, values.split_whitespace().map(number).collect())
}

#[test]
fn every_block_behaves_as_it_is_drawn() {
    let document = document();
    let mut seen = BTreeSet::new();
    for example in code(&document, "```text\nlamp = ") {
        let mut lines = example.lines();
        let (block, timing) = lines
            .next()
            .and_then(|line| line.split_once(" # "))
            .expect("a block and an interval");
        let (interval, from) = timing.split_once(" from ").unwrap_or((timing, "Mon 00:00"));
        let interval: Nanos = interval.parse().expect("an interval");
        let hour: i64 = from[4..6].parse().expect("an hour");
        let mut wall = WallTime {
            day: DAYS
                .iter()
                .position(|day| from.starts_with(day))
                .expect(from),
            time: Nanos::from_secs(3600 * hour),
        };
        let mut rows: Vec<_> = lines.map(row).collect();
        let (lamp, expected) = rows.pop().expect("the lamp");
        assert_eq!(lamp, "lamp");

        let text = format!("[blocks]\nlamp = {block}\n[outputs]\nQ1 = \"lamp\"\n");
        let program = Program::parse("document", &text, Terminals::default());
        let mut controller = Controller::new(program.unwrap_or_else(|wrong| panic!("{wrong}")));
        let mut now = Nanos::ZERO;
        for (column, expected) in expected.iter().enumerate() {
            for (name, values) in &rows {
                if let Some(place) = name.strip_prefix("AI") {
                    let place = place.parse().expect(name);
                    controller.set_analog_input(place, values[column]);
                } else {
                    let place = name[1..].parse().expect(name);
                    controller.set_input(place, values[column] > 0.5);
                }
            }
            controller.scan(now, wall);
            let is_on = controller.outputs()[0];
            assert_eq!(is_on, *expected > 0.5, "column {column} of {example}");
            now += interval;
            wall.time += interval;
            if wall.time >= Nanos::from_secs(24 * 3600) {
                wall.time = wall.time - Nanos::from_secs(24 * 3600);
                wall.day += 1;
            }
        }
        seen.insert(block.split('"').nth(1).expect("a type").to_owned());
    }
    // The table of blocks and the examples have the same types.
    let table = document.lines().filter(|line| line.starts_with("| [`"));
    let table: BTreeSet<String> = table
        .map(|line| line.split('`').nth(1).expect("a type").to_owned())
        .collect();
    assert_eq!(seen, table);
    assert_eq!(seen.len(), 12);
}

#[test]
fn the_programs_can_be_read() {
    let document = document();
    let programs: Vec<_> = code(&document, "```toml\n[blocks]").collect();
    assert_eq!(programs.len(), 2);
    for program in programs {
        let text = format!("[blocks]{program}");
        if let Err(wrong) = Program::parse("document", &text, Terminals::default()) {
            panic!("{wrong}");
        }
    }
}

#[test]
fn the_mistakes_are_those_that_are_shown() {
    let document = document();
    let text = code(&document, "```toml\n[blocks]").next().expect("stairs");
    let text = format!("[blocks]{text}")
        .replace("\"I2\"", "\"I9\"")
        .replace("\"button\"", "\"buton\"")
        .replace("time", "tine");
    let told = Program::parse("stairs.toml", &text, Terminals::default()).expect_err("it is wrong");
    let shown = code(&document, "```text\nstairs.toml:").next();
    let shown = shown.expect("the mistakes are in the document");
    assert_eq!(told.to_string(), format!("stairs.toml:{shown}"));
}
