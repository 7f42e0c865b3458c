//! Whole programs: mistakes and their places, loops, deadlines.

use tickbus_base::time::Nanos;
use tickbus_function_blocks::{Controller, Program, Terminals, WallTime};

fn controller(text: &str) -> Controller {
    let program = Program::parse("lab.toml", text, Terminals::default());
    Controller::new(program.unwrap_or_else(|wrong| panic!("{wrong}")))
}

fn ms(milliseconds: i64) -> Nanos {
    Nanos::from_millis(milliseconds)
}

#[track_caller]
fn told(text: &str, expected: &[&str]) {
    let wrong = Program::parse("lab.toml", text, Terminals::default()).expect_err("it is wrong");
    let wrong = wrong.to_string();
    assert_eq!(wrong.lines().collect::<Vec<_>>(), expected);
}

#[test]
fn mistakes_in_wires_are_told_at_their_place() {
    told(
        "[blocks]\n\
         a = { type = \"AND\", inputs = [\"I1\", \"I9\", \"pomp\", 3] }\n\
         pump = { type = \"NOT\", input = \"AI1\" }\n\
         c = { type = \"comparator\", a = \"pump\", b = \"AI3\" }\n\
         d = { type = \"NOT\", input = \"Q2\" }\n\
         e = { type = \"NOT\", input = \"Q01\" }\n\
         [outputs]\n\
         Q1 = \"a\"\n\
         Q5 = \"a\"\n\
         I1 = \"a\"\n\
         AQ1 = true\n\
         AQ2 = \"I1\"\n",
        &[
            "lab.toml:2:37: there is no input I9; write I1 to I8",
            "lab.toml:2:43: there is no block \"pomp\"; did you mean \"pump\"?",
            "lab.toml:2:51: element 4 of \"inputs\" is a whole number; write the name of a block or an input in quotes, such as \"I1\"",
            "lab.toml:3:32: AI1 is analog, and this is on or off; put a comparator or a hysteresis in between",
            "lab.toml:4:32: \"pump\" is on or off, and this is a number; write an analog input, a counter or a number, such as \"AI1\" or 4.5",
            "lab.toml:4:44: there is no input AI3; write AI1 to AI2",
            "lab.toml:5:29: Q2 is read, but nothing is wired to it; write a line Q2 = in [outputs]",
            "lab.toml:6:29: there is no block \"Q01\"; blocks are a, pump, c, d, e",
            "lab.toml:9:6: there is no output Q5; write Q1 to Q4",
            "lab.toml:10:6: \"I1\" is no output; write Q1, AQ1 or the like",
            "lab.toml:11:7: \"AQ1\" is a boolean; write an analog input, a counter or a number, such as \"AI1\" or 4.5",
            "lab.toml:12:7: \"I1\" is on or off, and this is a number; write an analog input, a counter or a number, such as \"AI1\" or 4.5",
        ],
    );
}

#[test]
fn mistakes_in_blocks_are_told_at_their_place() {
    told(
        "[blocks]\n\
         a = { type = \"NAND\", inputs = [\"I1\"] }\n\
         b = { type = \"on-delay\", input = \"I1\", tine = \"3s\" }\n\
         c = { type = \"pulse\", input = \"I1\", time = 3 }\n\
         d = { type = \"XOR\", inputs = [\"I1\", \"I2\", \"I3\"] }\n\
         e = { type = \"counter\", input = \"I1\", limit = 0 }\n\
         f = { type = \"hysteresis\", input = \"AI1\", on = 5, off = 5.0 }\n\
         g = { type = \"RS\", set = \"I1\" }\n\
         h = { inputs = [\"I1\"] }\n\
         i = \"I1\"\n\
         Q1 = { type = \"NOT\", input = \"I1\" }\n\
         j = { type = \"AND\", inputs = [] }\n\
         [outputs]\n\
         Q1 = \"j\"\n",
        &[
            "lab.toml:2:14: \"NAND\" is not one of the types of blocks; did you mean \"AND\"?",
            "lab.toml:3:40: unknown key \"tine\" in \"b\"; did you mean \"time\"?",
            "lab.toml:4:44: \"time\" is a whole number; write a duration in quotes, such as \"10ms\"",
            "lab.toml:5:5: an XOR with 3 inputs; write a list of two, such as [\"I1\", \"I2\"]",
            "lab.toml:6:47: \"limit\" is 0; write a whole number from 1 to 32767",
            "lab.toml:7:5: it switches on and off at 5; let \"on\" and \"off\" differ, or take a comparator",
            "lab.toml:8:5: \"g\" has no \"reset\"; write a block or an input, such as \"I1\"",
            "lab.toml:9:5: \"h\" has no \"type\"; write a type such as \"AND\"",
            "lab.toml:10:5: \"i\" is a text; write a table such as { type = \"NOT\", input = \"I1\" }",
            "lab.toml:11:6: \"Q1\" cannot be the name of a block; write a name that is no input and no output, such as pump",
            "lab.toml:12:30: 0 inputs; write a list of 1 to 16 blocks and inputs, such as [\"I1\", \"I2\"]",
        ],
    );
}

#[test]
fn mistakes_in_cams_are_told_at_their_place() {
    told(
        "[blocks]\n\
         a = { type = \"weekly-timer\", cams = [{ days = [\"Mo\"], on = \"6:00\", off = \"07:00\" }, { days = [], on = \"08:00\", of = \"09:00\" }] }\n\
         b = { type = \"weekly-timer\", cams = [] }\n\
         c = { type = \"weekly-timer\", cams = [{ days = [\"Sun\"], on = \"06:00\", off = \"06:00\" }] }\n\
         [outputs]\n\
         Q1 = \"a\"\n",
        &[
            "lab.toml:2:48: \"Mo\" is not one of the days; did you mean \"Mon\"?",
            "lab.toml:2:60: \"6:00\" is no time of day; write a time of day, from \"00:00\" to \"24:00\"",
            "lab.toml:2:94: there is no day in it; write a list of days, such as [\"Mon\", \"Tue\"]",
            "lab.toml:2:112: unknown key \"of\" in the cam; did you mean \"off\"?",
            "lab.toml:3:5: a weekly timer without a cam; write cams = [{ days = [\"Mon\"], on = \"06:00\", off = \"07:30\" }]",
            "lab.toml:4:38: the cam switches on and off at the same time; for a whole day write on = \"00:00\", off = \"24:00\"",
        ],
    );
}

#[test]
fn a_program_has_outputs() {
    told(
        "[blocks]\n",
        &[
            "lab.toml:1:1: the file has no [outputs]; write an [outputs] table with lines such as Q1 = \"pump\"",
        ],
    );
    told(
        "[outputs]\n[block]\n",
        &[
            "lab.toml:1:1: no output is wired; write lines such as Q1 = \"pump\" in [outputs]",
            "lab.toml:2:2: unknown key \"block\" in the file; did you mean \"blocks\"?",
        ],
    );
}

#[test]
fn a_loop_reads_the_last_scan() {
    // A blinker made of a NOT of itself, and a chain against the order of the file, one scan per block.
    let mut controller = controller(
        "[blocks]\n\
         third = { type = \"AND\", inputs = [\"second\"] }\n\
         second = { type = \"AND\", inputs = [\"first\"] }\n\
         first = { type = \"AND\", inputs = [\"I1\"] }\n\
         blinker = { type = \"NOT\", input = \"Q2\" }\n\
         [outputs]\n\
         Q1 = \"third\"\n\
         Q2 = \"blinker\"\n",
    );
    controller.set_input(1, true);
    let mut outputs = Vec::new();
    for scan in 0..4 {
        controller.scan(ms(scan), WallTime::default());
        outputs.push((controller.outputs()[0], controller.outputs()[1]));
    }
    let expected = [(false, true), (false, false), (true, true), (true, false)];
    assert_eq!(outputs, expected);
}

#[test]
fn analog_outputs_pass_on_inputs_counts_and_constants() {
    let mut controller = controller(
        "[blocks]\nparts = { type = \"counter\", input = \"I1\", limit = 100 }\n\
         [outputs]\nAQ1 = \"AI2\"\nAQ2 = \"parts\"\n",
    );
    controller.set_analog_input(2, -3.25);
    for scan in 0..5 {
        controller.set_input(1, scan % 2 == 0);
        controller.scan(ms(scan), WallTime::default());
    }
    assert_eq!(controller.analog_outputs(), [-3.25, 3.0]);
    assert_eq!(controller.outputs(), [false; 4]);
}

/// All blocks with times.
const TIMERS: &str = "[blocks]\n\
    on = { type = \"on-delay\", input = \"I1\", time = \"30ms\" }\n\
    off = { type = \"off-delay\", input = \"I1\", time = \"70ms\" }\n\
    pulse = { type = \"pulse\", input = \"I1\", time = \"45ms\" }\n\
    week = { type = \"weekly-timer\", cams = [{ days = [\"Sun\"], on = \"23:59:59\", off = \"24:00\" }] }\n\
    [outputs]\n\
    Q1 = \"on\"\n\
    Q2 = \"off\"\n\
    Q3 = \"pulse\"\n\
    Q4 = \"week\"\n";

#[test]
fn nothing_changes_before_the_next_scan_is_due() {
    let wall = |now: Nanos| {
        let midnight = Nanos::from_secs(24 * 3600);
        let time = midnight - ms(1500) + now;
        if time < midnight {
            WallTime { day: 6, time }
        } else {
            let time = time - midnight;
            WallTime { day: 0, time }
        }
    };
    // One is scanned each millisecond, the other only when its input changes and when a scan is due.
    let (mut busy, mut lazy) = (controller(TIMERS), controller(TIMERS));
    let mut due = Nanos::ZERO;
    let mut scans = 0;
    let mut changes = 0;
    let mut random = 7_u32;
    for millisecond in 0..3000 {
        let now = ms(millisecond);
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let changes_now = random >> 16 < 1800;
        if changes_now {
            changes += 1;
            busy.set_input(1, changes % 2 == 1);
            lazy.set_input(1, changes % 2 == 1);
        }
        busy.scan(now, wall(now));
        if changes_now || now >= due {
            due = lazy.scan(now, wall(now));
            assert!(due > now, "it makes progress");
            scans += 1;
        }
        assert_eq!(busy.outputs(), lazy.outputs(), "{millisecond} ms");
    }
    assert!(changes > 40, "{changes}");
    assert!(
        scans <= 4 * changes + 8,
        "{scans} scans for {changes} changes"
    );
}

#[test]
fn nothing_is_due_where_no_timer_runs() {
    let mut controller = controller("[outputs]\nQ1 = \"I1\"\n");
    assert_eq!(controller.scan(ms(5), WallTime::default()), Nanos::MAX);
}

#[test]
fn a_controller_has_the_terminals_that_it_is_given() {
    let terminals = Terminals {
        inputs: 1,
        outputs: 12,
        analog_inputs: 0,
        analog_outputs: 0,
    };
    let text = "[outputs]\nQ12 = \"I1\"\nQ1 = \"I2\"\nQ2 = \"AI1\"\nQ13 = \"I1\"\n";
    let wrong = Program::parse("lab.toml", text, terminals).expect_err("it is wrong");
    assert_eq!(
        wrong.to_string().lines().collect::<Vec<_>>(),
        [
            "lab.toml:3:6: there is no input I2; write I1",
            "lab.toml:4:6: there is no input AI1; this controller has no AI",
            "lab.toml:5:7: there is no output Q13; write Q1 to Q12",
        ]
    );
    let program = Program::parse("lab.toml", "[outputs]\nQ12 = \"I1\"\n", terminals);
    let mut controller = Controller::new(program.expect("it is right"));
    controller.set_input(1, true);
    controller.scan(Nanos::ZERO, WallTime::default());
    assert!(controller.outputs()[11]);
}

#[test]
fn a_damaged_program_is_refused_or_runs() {
    let text = "[blocks]\n\
        a = { type = \"AND\", inputs = [\"I1\", \"b\"] }\n\
        b = { type = \"RS\", set = \"I1\", reset = \"Q1\" }\n\
        c = { type = \"counter\", input = \"a\", reset = \"c\", limit = 3 }\n\
        d = { type = \"on-delay\", input = \"I1\", time = \"30ms\" }\n\
        e = { type = \"pulse\", input = \"d\", time = \"1.5s\" }\n\
        f = { type = \"weekly-timer\", cams = [{ days = [\"Mon\"], on = \"22:00\", off = \"06:00\" }] }\n\
        g = { type = \"comparator\", a = \"c\", b = 1 }\n\
        h = { type = \"hysteresis\", input = \"AI1\", on = 1, off = 0 }\n\
        [outputs]\n\
        Q1 = \"h\"\n\
        AQ1 = \"c\"\n";
    let mut ran = 0;
    for at in 0..text.len() {
        for other in ["", "\"", "9", "[", "]", "=", "I", "\n", "\u{fc}"] {
            let damaged = format!("{}{other}{}", &text[..at], &text[at + 1..]);
            if let Ok(program) = Program::parse("lab.toml", &damaged, Terminals::default()) {
                let mut controller = Controller::new(program);
                controller.scan(Nanos::ZERO, WallTime::default());
                controller.set_input(1, true);
                controller.scan(Nanos::MAX, WallTime::default());
                ran += 1;
            }
        }
    }
    assert!(ran > 100, "{ran}");
}

#[test]
fn an_output_that_reads_an_output_reads_its_last_scan() {
    let mut controller = controller(
        "[outputs]\nQ1 = \"I1\"\nQ2 = \"Q1\"\nQ3 = \"Q2\"\nAQ1 = \"AI1\"\nAQ2 = \"AQ1\"\n",
    );
    controller.set_input(1, true);
    controller.set_analog_input(1, 7.0);
    let seen: Vec<_> = (1..=3)
        .map(|scan| {
            controller.scan(ms(scan), WallTime::default());
            (
                controller.outputs()[..3].to_vec(),
                controller.analog_outputs().to_vec(),
            )
        })
        .collect();
    let expected = [
        (vec![true, false, false], vec![7.0, 0.0]),
        (vec![true, true, false], vec![7.0, 7.0]),
        (vec![true, true, true], vec![7.0, 7.0]),
    ];
    assert_eq!(seen, expected);
}
