#![expect(clippy::float_cmp, reason = "these values have no rounding")]

use std::sync::Arc;

use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, read_text};
use tickbus_fieldbus::faults::{FaultBoard, Random};
use tickbus_image::signal::{Area, DataType, Scale, Signal, SignalTable, Slot};

use super::{Replies, Reply, Scope, read_sections};

mod motors;
mod states;

/// The bits a to f and the numbers i, j, k and l of the machine; of the PLC the bits A to D, the number N, and the 64-bit
/// integer L.
fn table() -> SignalTable {
    let mut signals = Vec::new();
    for (names, area) in [("abcdef", Area::Input), ("ABCD", Area::Output)] {
        for (bit, name) in (0..).zip(names.chars()) {
            signals.push(Signal {
                bit,
                ..Signal::new(name, area, 0, DataType::Bool)
            });
        }
    }
    let number = |name: &str, area, byte, data_type| Signal::new(name, area, byte, data_type);
    signals.extend([
        number("i", Area::Input, 2, DataType::Real),
        Signal {
            scale: Scale::through([0.0, 27_648.0], [0.0, 100.0]),
            range: Some([0.0, 100.0]),
            ..number("j", Area::Input, 6, DataType::Int)
        },
        number("k", Area::Input, 8, DataType::Byte),
        number("l", Area::Input, 16, DataType::Ulint),
        number("N", Area::Output, 2, DataType::Real),
        number("L", Area::Output, 8, DataType::Lint),
    ]);
    SignalTable::of_one_station(24, 16, signals)
}

/// Reads sections; the mistakes are one a line, without the file.
fn read(text: &str) -> Result<Vec<Reply>, String> {
    read_after(text, &[])
}

/// Reads sections of a machine that has some replies already.
fn read_after(text: &str, earlier: &[Reply]) -> Result<Vec<Reply>, String> {
    let table = table();
    let mut collector = Collector::new("x", text);
    let taken = [(table.position("f").expect("f"), "the axis \"X\"".to_owned())];
    let scope = Scope {
        table: &table,
        writes: Area::Input,
        tick: Some(Nanos::from_millis(10)),
        taken: &taken,
        earlier,
    };
    let read = read_text(&mut collector, text, |mut root| {
        let sections = root.require("reply", "write some");
        root.finish();
        Some(read_sections(sections?.tables("[[reply]]"), scope))
    });
    match collector.finish() {
        Some(mistakes) => Err(mistakes.to_string()),
        None => Ok(read.expect("no mistakes")),
    }
}

/// A machine of replies alone, in ticks of 10 ms.
struct Machine {
    table: SignalTable,
    replies: Replies,
    board: Arc<FaultBoard>,
    slots: Vec<Slot>,
    ticks: i64,
}

impl Machine {
    #[track_caller]
    fn new(text: &str) -> Self {
        let (table, board) = (table(), Arc::<FaultBoard>::default());
        let replies = read(text).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        Self {
            replies: Replies::new(&replies, &table, &board).expect("replies"),
            slots: table
                .signals
                .iter()
                .map(|signal| signal.fail_safe)
                .collect(),
            table,
            board,
            ticks: 0,
        }
    }

    fn place(&self, name: &str) -> usize {
        self.table.position(name).expect(name)
    }

    fn set(&mut self, name: &str, value: f64) {
        let place = self.place(name);
        self.slots[place] = Slot::from_real(value);
    }

    fn value(&self, name: &str) -> f64 {
        self.slots[self.place(name)].real()
    }

    fn tick(&mut self) {
        let time = Nanos::from_millis(10).times(self.ticks);
        self.ticks += 1;
        self.replies.step(time, &mut self.slots);
    }

    /// The values of a signal in each of the next `ticks` ticks, as text.
    fn values(&mut self, name: &str, ticks: usize) -> String {
        let values = (0..ticks).map(|_| {
            self.tick();
            format!("{} ", self.value(name))
        });
        values.collect::<String>().trim_end().to_owned()
    }

    fn statistics(&self) -> String {
        let mut statistics = Statistics::default();
        self.board.write(&mut statistics);
        statistics.to_string()
    }
}

#[test]
fn a_constant_has_its_value_at_every_tick_whatever_its_type() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"constant\"\nsignal = \"a\"\nvalue = true\n\
         [[reply]]\nkind = \"constant\"\nsignal = \"j\"\nvalue = 21.5\n\
         [[reply]]\nkind = \"constant\"\nsignal = \"l\"\nvalue = 18446744073709551615\n",
    );
    machine.tick();
    assert_eq!((machine.value("a"), machine.value("j")), (1.0, 21.5));
    assert_eq!(machine.slots[machine.place("l")].unsigned(), u64::MAX);
}

#[test]
fn a_bit_follows_its_conditions_after_its_delays_and_a_short_pulse_never() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"follows\"\nsignal = \"a\"\nwhen = [\"A\", \"not B\"]\non_after = \"30ms\"\noff_after = \"20ms\"\n\
         [[reply]]\nkind = \"follows\"\nsignal = \"b\"\nwhen = \"N > 5\"\ninverted = true\n",
    );
    assert_eq!(machine.values("a", 2), "0 0");
    assert_eq!(machine.value("b"), 1.0);
    machine.set("A", 1.0);
    assert_eq!(machine.values("a", 5), "0 0 0 1 1");
    machine.set("B", 1.0);
    machine.set("N", 6.0);
    assert_eq!(machine.values("a", 4), "1 1 0 0");
    assert_eq!(machine.value("b"), 0.0);
    machine.set("B", 0.0);
    assert_eq!(machine.values("a", 2), "0 0");
    machine.set("B", 1.0);
    assert_eq!(machine.values("a", 3), "0 0 0");
}

#[test]
fn a_cylinder_travels_between_its_switches_and_a_spring_brings_it_back() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"cylinder\"\nextend = \"A\"\nextended = \"a\"\nretracted = \"b\"\nposition = \"j\"\n\
         extend_time = \"40ms\"\nretract_time = \"20ms\"\n",
    );
    assert_eq!(machine.values("b", 1), "1");
    machine.set("A", 1.0);
    assert_eq!(machine.values("j", 5), "25 50 75 100 100");
    assert_eq!((machine.value("a"), machine.value("b")), (1.0, 0.0));
    machine.set("A", 0.0);
    assert_eq!(machine.values("j", 3), "50 0 0");
    assert_eq!((machine.value("a"), machine.value("b")), (0.0, 1.0));
}

#[test]
fn with_two_commands_a_part_stands_between_them_and_with_impulses_it_goes_on() {
    let two = "[[reply]]\nkind = \"cylinder\"\nextend = \"A\"\nretract = \"B\"\nposition = \"j\"\nextend_time = \"40ms\"\n";
    for (text, expected) in [
        (two.to_owned(), "25 25 25"),
        (format!("{two}impulse = true\n"), "50 75 100"),
    ] {
        let mut machine = Machine::new(&text);
        machine.tick();
        machine.set("A", 1.0);
        machine.tick();
        machine.set("A", 0.0);
        assert_eq!(machine.values("j", 3), expected);
        machine.set("A", 1.0);
        machine.set("B", 1.0);
        let before = machine.value("j");
        machine.tick();
        assert_eq!(machine.value("j"), before, "both commands");
    }
}

#[test]
fn a_valve_goes_to_the_position_that_a_number_says_and_no_further() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"valve\"\ntarget = \"N\"\nopened = \"a\"\nclosed = \"b\"\nposition = \"j\"\nopen_time = \"100ms\"\n\
         start = 50\n",
    );
    machine.set("N", 75.0);
    assert_eq!(machine.values("j", 5), "50 60 70 75 75");
    machine.set("N", 900.0);
    machine.set("N", f64::NAN);
    assert_eq!(machine.values("j", 1), "75");
    machine.set("N", 900.0);
    assert_eq!(machine.values("j", 4), "85 95 100 100");
    assert_eq!((machine.value("a"), machine.value("b")), (1.0, 0.0));
}

#[test]
fn a_lag_has_63_percent_of_a_step_after_its_time_in_ticks_of_any_length() {
    let text = "[[reply]]\nkind = \"lag\"\nsignal = \"i\"\nwhen = \"A\"\non = 80\noff = 20\ntime = \"1s\"\n";
    let mut values = Vec::new();
    for step in [1, 10, 250] {
        let mut machine = Machine::new(text);
        machine.tick();
        assert_eq!(machine.value("i"), 20.0, "it begins where it leads");
        machine.set("A", 1.0);
        for tick in 1..=1000 / step {
            let time = Nanos::from_millis(tick * step);
            machine.replies.step(time, &mut machine.slots);
        }
        values.push(machine.value("i"));
    }
    let expected = 80.0 - 60.0 * (-1.0_f64).exp();
    for value in values {
        assert!((value - expected).abs() < 1e-9, "{value} {expected}");
    }
}

#[test]
fn noise_comes_from_its_seed_and_stays_within_the_limits() {
    let text = |seed| {
        format!(
            "[[reply]]\nkind = \"lag\"\nsignal = \"i\"\ninput = \"N\"\ngain = 2\noffset = 1\ntime = \"10ms\"\nnoise = 0.5\n\
             limits = [0, 7.25]\nseed = {seed}\n"
        )
    };
    let run = |seed| {
        let mut machine = Machine::new(&text(seed));
        machine.set("N", 3.0);
        let values: Vec<f64> = (0..100)
            .map(|_| {
                machine.tick();
                machine.value("i")
            })
            .collect();
        assert!(values.iter().all(|value| (6.5..=7.25).contains(value)));
        assert!(values.iter().any(|value| *value < 6.7));
        values
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn a_switch_has_a_hysteresis_and_reads_what_another_reply_has_made_in_the_same_tick() {
    // The switch stands before the number that it reads.
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"switch\"\nsignal = \"a\"\ninput = \"j\"\nabove = 50\nhysteresis = 30\n\
         [[reply]]\nkind = \"cylinder\"\nextend = \"A\"\nposition = \"j\"\nextend_time = \"40ms\"\n",
    );
    machine.tick();
    machine.set("A", 1.0);
    assert_eq!(machine.values("a", 4), "0 1 1 1");
    machine.set("A", 0.0);
    assert_eq!(machine.values("a", 4), "1 1 1 0");
}

#[test]
fn counters_and_encoders_count_and_wrap() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"counter\"\nsignal = \"k\"\nwhen = \"A\"\ndown = \"B\"\nreset = \"C\"\nlimits = [0, 2]\n\
         [[reply]]\nkind = \"encoder\"\nsignal = \"l\"\nforward = \"D\"\nrate = 250\n",
    );
    machine.set("A", 1.0);
    assert_eq!(machine.values("k", 1), "0", "a level is no edge");
    for expected in ["1", "2", "0"] {
        machine.set("A", 0.0);
        machine.tick();
        machine.set("A", 1.0);
        assert_eq!(machine.values("k", 2), format!("{expected} {expected}"));
    }
    machine.set("B", 1.0);
    assert_eq!(machine.values("k", 1), "2");
    machine.set("C", 1.0);
    assert_eq!(machine.values("k", 1), "0");
    machine.set("D", 1.0);
    let counts: Vec<u64> = (0..4)
        .map(|_| {
            machine.tick();
            machine.slots[machine.place("l")].unsigned()
        })
        .collect();
    assert_eq!(counts, [2, 5, 7, 10]);
}

#[test]
fn lamps_blink_and_life_signs_count_or_repeat() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"blink\"\nsignal = \"a\"\non_for = \"20ms\"\noff_for = \"10ms\"\nwhen = \"A\"\n\
         [[reply]]\nkind = \"life-sign\"\nsignal = \"k\"\nevery = \"20ms\"\nlimits = [1, 3]\n\
         [[reply]]\nkind = \"life-sign\"\nsignal = \"b\"\ninput = \"B\"\n\
         [[reply]]\nkind = \"life-sign\"\nsignal = \"c\"\nevery = \"10ms\"\n",
    );
    assert_eq!(machine.values("k", 9), "1 1 2 2 3 3 1 1 2");
    assert_eq!(machine.value("a"), 0.0);
    machine.set("A", 1.0);
    assert_eq!(machine.values("a", 7), "1 1 0 1 1 0 1");
    machine.set("B", 1.0);
    assert_eq!(machine.values("b", 1), "1");
    assert_eq!(machine.values("c", 3), "1 0 1");
}

#[test]
fn a_rule_takes_effect_at_each_change_of_a_number() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"rule\"\nwhen = \"N changes\"\nset = { a = true }\n\
         [[reply]]\nkind = \"rule\"\nwhen = \"A\"\nset = { a = false }\n",
    );
    // The value of the first tick is no change.
    machine.set("N", 5.0);
    assert_eq!(machine.values("a", 2), "0 0");
    for value in [6.0, 5.0] {
        machine.set("N", value);
        assert_eq!(machine.values("a", 2), "1 1");
        machine.set("A", 1.0);
        assert_eq!(machine.values("a", 1), "0");
        machine.set("A", 0.0);
        machine.tick();
    }
}

#[test]
fn rules_set_and_clear_one_signal_and_move_another_also_under_a_simulation_that_hands_over_zeros() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"rule\"\nwhen = \"A rises\"\nset = { a = true }\n\
         [[reply]]\nkind = \"rule\"\nwhen = \"B\"\nset = { a = false, b = true }\nelse = { b = false }\n\
         [[reply]]\nkind = \"rule\"\nwhen = [\"a\", \"not b\"]\nafter = \"20ms\"\n\
         ramp = { signal = \"j\", to = 30, per_second = 1000 }\n\
         [[reply]]\nkind = \"switch\"\nsignal = \"c\"\ninput = \"j\"\nabove = 30\n",
    );
    machine.tick();
    machine.set("A", 1.0);
    assert_eq!(machine.values("a", 1), "1");
    machine.set("a", 0.0);
    machine.set("A", 0.0);
    assert_eq!(machine.values("a", 2), "1 1");
    assert_eq!(machine.value("j"), 10.0, "it moves from 20 ms on");
    assert_eq!(machine.values("j", 3), "20 30 30");
    assert_eq!(machine.value("c"), 1.0);
    machine.set("B", 1.0);
    machine.tick();
    assert_eq!((machine.value("a"), machine.value("b")), (0.0, 1.0));
    machine.set("B", 0.0);
    machine.tick();
    assert_eq!((machine.value("a"), machine.value("b")), (0.0, 0.0));
    assert_eq!(machine.statistics(), "replies=4\nreplies.overruled=\n");
}

#[test]
fn a_rule_sees_what_a_later_reply_made_in_the_tick_before_also_under_zeros() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"rule\"\nwhen = \"b\"\nset = { a = true }\nelse = { a = false }\n\
         [[reply]]\nkind = \"follows\"\nsignal = \"b\"\nwhen = \"A\"\n",
    );
    machine.set("A", 1.0);
    let seen: Vec<f64> = (0..4)
        .map(|_| {
            for name in ["a", "b"] {
                machine.set(name, 0.0);
            }
            machine.tick();
            machine.value("a")
        })
        .collect();
    assert_eq!(seen, [0.0, 1.0, 1.0, 1.0]);
}

#[test]
fn a_simulation_that_writes_the_signal_wins_and_one_that_hands_over_zeros_does_not() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"constant\"\nsignal = \"a\"\nvalue = true\n\
         [[reply]]\nkind = \"constant\"\nsignal = \"i\"\nvalue = 21.5\n",
    );
    machine.tick();
    // The simulator hands over all its values, of which it knows none.
    machine.set("a", 0.0);
    machine.set("i", 0.0);
    machine.tick();
    assert_eq!((machine.value("a"), machine.value("i")), (1.0, 21.5));
    assert_eq!(machine.statistics(), "replies=2\nreplies.overruled=\n");
    machine.set("i", 4.0);
    machine.tick();
    machine.set("i", 0.0);
    assert_eq!(machine.values("i", 2), "0 0");
    assert_eq!(machine.value("a"), 1.0);
    assert_eq!(machine.statistics(), "replies=2\nreplies.overruled=i\n");
}

#[test]
fn a_borrowed_signal_is_left_alone_until_it_is_given_back() {
    let mut machine =
        Machine::new("[[reply]]\nkind = \"constant\"\nsignal = \"i\"\nvalue = 21.5\n");
    machine.tick();
    let place = machine.place("i");
    machine.replies.borrow(place, true);
    machine.set("i", 4.0);
    assert_eq!(machine.values("i", 2), "4 4");
    machine.replies.borrow(place, false);
    assert_eq!(machine.values("i", 2), "21.5 21.5");
    assert_eq!(machine.statistics(), "replies=1\nreplies.overruled=\n");
}

#[test]
fn ticks_that_are_longer_than_a_time_are_noted_and_a_late_one_is_not() {
    let text = "[[reply]]\nkind = \"follows\"\nsignal = \"a\"\nwhen = \"A\"\non_after = \"10ms\"\n";
    for (steps, is_noted) in [(vec![50, 5, 50, 5], false), (vec![50; 12], true)] {
        let mut machine = Machine::new(text);
        let (before, mut time) = (machine.board.news(), Nanos::ZERO);
        for step in steps {
            machine.replies.step(time, &mut machine.slots);
            time += Nanos::from_millis(step);
        }
        assert_eq!(machine.board.news() > before, is_noted);
    }
}

#[test]
fn a_reply_that_rests_makes_what_it_would_make_at_work() {
    let shows_numbers = "[[reply]]\nkind = \"follows\"\nsignal = \"a\"\nwhen = [\"A\", \"not d\"]\non_after = \"30ms\"\n\
                [[reply]]\nkind = \"motor\"\ncontactor = \"B\"\nrunning = \"b\"\non_after = \"20ms\"\nstart_time = \"50ms\"\n\
                speed = \"i\"\ntrip = \"C\"\nreset = \"D\"\noverload = \"c\"\n\
                [[reply]]\nkind = \"blink\"\nsignal = \"d\"\nwhen = \"C\"\non_for = \"20ms\"\n\
                [[reply]]\nkind = \"cylinder\"\nextend = \"a\"\nposition = \"j\"\nextend_time = \"70ms\"\n\
                [[reply]]\nkind = \"rule\"\nwhen = \"b falls\"\nafter = \"10ms\"\nset = { e = true }\n\
                [[reply]]\nkind = \"rule\"\nwhen = \"D\"\nset = { e = false }\n\
                [[reply]]\nkind = \"counter\"\nsignal = \"k\"\nwhen = \"a\"\nreset = \"D\"\n\
                [[reply]]\nkind = \"encoder\"\nsignal = \"l\"\ninput = \"i\"\n";
    // Nothing shows how far these are, so that they rest on their way.
    let shows_ends = "[[reply]]\nkind = \"motor\"\ncontactor = \"B\"\nat_speed = \"b\"\non_after = \"30ms\"\n\
                start_time = \"110ms\"\nstop_time = \"70ms\"\n\
                [[reply]]\nkind = \"cylinder\"\nextend = \"b\"\nretract = \"D\"\nimpulse = true\nextended = \"a\"\n\
                extend_time = \"90ms\"\nretract_time = \"170ms\"\n\
                [[reply]]\nkind = \"valve\"\nopen = \"A\"\nclose = \"C\"\nopened = \"c\"\nclosed = \"d\"\nopen_time = \"130ms\"\n\
                [[reply]]\nkind = \"blink\"\nsignal = \"e\"\nwhen = \"A\"\non_for = \"50ms\"\noff_for = \"30ms\"\n\
                [[reply]]\nkind = \"life-sign\"\nsignal = \"k\"\nevery = \"20ms\"\n\
                [[reply]]\nkind = \"counter\"\nsignal = \"l\"\nwhen = \"a\"\n";
    for text in [shows_numbers, shows_ends] {
        let (mut resting, mut working) = (Machine::new(text), Machine::new(text));
        let (mut random, mut time) = (Random::new(1, 0), Nanos::ZERO);
        let mut changes = vec![0; resting.slots.len()];
        for tick in 0..20_000 {
            for (name, chance) in [("A", 0.1), ("B", 0.05), ("C", 0.02), ("D", 0.02)] {
                if random.happens(chance) {
                    let value = 1.0 - resting.value(name);
                    resting.set(name, value);
                    working.set(name, value);
                }
            }
            // A simulation hands over zeros from time to time.
            if random.happens(0.05) {
                for name in ["a", "b", "e", "j"] {
                    resting.set(name, 0.0);
                    working.set(name, 0.0);
                }
            }
            // Most ticks are as long as the last one, some longer, some take no time.
            time += Nanos::from_millis(match tick % 7 {
                3 => 0,
                5 => 13,
                _ => 10,
            });
            let before = resting.slots.clone();
            working.replies.awake.wake_all();
            resting.replies.step(time, &mut resting.slots);
            working.replies.step(time, &mut working.slots);
            assert_eq!(resting.slots, working.slots, "{tick}");
            for (changes, (before, now)) in
                changes.iter_mut().zip(before.iter().zip(&resting.slots))
            {
                *changes += u32::from(before != now);
            }
        }
        let made = resting.table.signals.iter().zip(&changes);
        let still = made.filter(|(signal, changes)| {
            text.contains(&format!("= \"{}\"\n", signal.name)) && **changes < 20
        });
        let still: Vec<_> = still.map(|(signal, _)| signal.name.as_str()).collect();
        assert!(
            still.iter().all(|name| "ABCD".contains(name)),
            "they move: {still:?}"
        );
    }
}

#[test]
fn a_time_that_a_reply_does_not_state_follows_the_one_that_it_defaults_to() {
    for (kind, [forth, back]) in [
        (
            "kind = \"cylinder\"\nextend = \"A\"\nextended = \"a\"",
            ["extend_time", "retract_time"],
        ),
        (
            "kind = \"valve\"\nopen = \"A\"\nopened = \"a\"",
            ["open_time", "close_time"],
        ),
        (
            "kind = \"motor\"\ncontactor = \"A\"\nrunning = \"a\"",
            ["start_time", "stop_time"],
        ),
        ("kind = \"blink\"\nsignal = \"a\"", ["on_for", "off_for"]),
    ] {
        let settings = |reply: &Reply| {
            let value = |key| reply.settings().into_iter().find(|one| one.key == key);
            [forth, back].map(|key| value(key).expect(key).value)
        };
        let text = format!("[[reply]]\n{kind}\n{forth} = \"200ms\"\n");
        let mut reply = read(&text).expect(kind).remove(0);
        assert_eq!(settings(&reply), [0.2, 0.2]);
        reply.set(forth, 0.5);
        assert_eq!(settings(&reply), [0.5, 0.5]);
        // From then on it has its own.
        reply.set(back, 0.25);
        reply.set(forth, 0.125);
        assert_eq!(settings(&reply), [0.125, 0.25]);
        let text = format!("{text}{back} = \"100ms\"\n");
        let mut reply = read(&text).expect(kind).remove(0);
        reply.set(forth, 0.5);
        assert_eq!(settings(&reply), [0.5, 0.1]);
    }
}

#[test]
fn time_that_stands_still_or_goes_back_moves_nothing() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"cylinder\"\nextend = \"A\"\nposition = \"j\"\nextend_time = \"40ms\"\n",
    );
    machine.set("A", 1.0);
    let positions = [0, 10, 10, 3, 13].map(|millis| {
        let time = Nanos::from_millis(millis);
        machine.replies.step(time, &mut machine.slots);
        machine.value("j")
    });
    assert_eq!(positions, [0.0, 25.0, 25.0, 25.0, 50.0]);
}

#[test]
fn wrong_sections_are_refused_at_their_place() {
    for (text, told) in [
        (
            "kind = \"folows\"",
            "x:2:8: \"folows\" is not one of the kinds of replies; did you mean \"follows\"?",
        ),
        (
            "kind = \"follows\"\nsignal = \"A\"\nwhen = \"B\"",
            "x:3:10: \"A\" (%QX0.0) is written by the PLC program; name a signal that it reads",
        ),
        (
            "kind = \"follows\"\nsignal = \"i\"\nwhen = \"B\"",
            "x:3:10: \"i\" (REAL) is no BOOL; name a BOOL here",
        ),
        (
            "kind = \"follows\"\nsignal = \"f\"\nwhen = \"B\"",
            "x:3:10: \"f\" is made by the axis \"X\"; name another signal; each has one writer",
        ),
        (
            "kind = \"follows\"\nsignal = \"a\"\nwhen = \"B rises\"",
            "x:4:8: a reply waits for no edge, which is over at once; write the condition without \"rises\", \"falls\" or \"changes\"; a \
             counter counts how often it begins to hold",
        ),
        (
            "kind = \"follows\"\nsignal = \"a\"\nwhen = \"B\"\non_after = \"2ms\"",
            "x:5:12: \"on_after\" is 2ms, and a tick is 10ms: a reply is made once in each; write at least \"10ms\"",
        ),
        (
            "kind = \"constant\"\nsignal = \"a\"",
            "x:1:1: [[reply]] has no \"value\"; write the value, such as value = true",
        ),
        (
            "kind = \"constant\"\nsignal = \"a\"\nvalue = true\nnoise = 1",
            "x:5:9: a reply of kind \"constant\" has no \"noise\"; remove it; it is for lag",
        ),
        (
            "kind = \"motor\"\ncontactor = \"A\"",
            "x:1:1: [[reply]] has no \"running\" and no \"at_speed\" and no \"speed\" and no \"overload\" and no \"healthy\"; name \
             a signal that the motor makes, such as running = \"Pump 1 running\"",
        ),
        (
            "kind = \"switch\"\nsignal = \"a\"\ninput = \"i\"\nabove = 1\nbelow = 2",
            "x:6:9: \"below\" stands beside \"above\"; remove one of them",
        ),
        (
            "kind = \"switch\"\nsignal = \"a\"\ninput = \"B\"\nabove = 1",
            "x:4:9: \"B\" is a BOOL, and no number; name a signal of another type here",
        ),
        (
            "kind = \"switch\"\nsignal = \"a\"\ninput = \"a\"\nabove = 1",
            "x:4:9: \"a\" is a BOOL, and no number; name a signal of another type here",
        ),
        (
            "kind = \"lag\"\nsignal = \"i\"\nwhen = \"A\"\non = 1\ntime = \"1s\"",
            "x:4:8: \"when\" stands without \"off\"; add \"off\", or remove it",
        ),
        (
            "kind = \"counter\"\nsignal = \"k\"\nwhen = \"A\"\nlimits = [0, 256]",
            "x:5:10: \"k\" cannot go from 0 to 256; write limits within 0 and 255, what a BYTE can have",
        ),
        (
            "kind = \"rule\"\nwhen = \"A rises\"\nset = { a = true }\nelse = { a = false }",
            "x:5:8: an edge has no \"else\": it is over at once; write the condition without \"rises\", \"falls\" or \"changes\", or a second rule",
        ),
        (
            "kind = \"rule\"\nwhen = \"A\"\nset = { A = true }",
            "x:4:13: \"A\" (%QX0.0) is written by the PLC program; set signals that it reads; the others can be conditions",
        ),
        (
            "kind = \"counter\"\nsignal = \"k\"\nwhen = \"A\"\nlimits = [5, 5]",
            "x:5:10: \"limits\" go from 5 to 5; write the lower one first, such as [0, 100]",
        ),
        (
            "kind = \"cylinder\"\nextend = \"A\"\nposition = \"j\"\nextend_time = \"1s\"\nstart = 101",
            "x:6:9: \"start\" is 101; write a number from 0 to 100",
        ),
        (
            "kind = \"cylinder\"\nextend = \"A\"\nposition = \"j\"\nextend_time = \"1s\"\nimpulse = true",
            "x:6:11: \"impulse\" stands without \"retract\"; add \"retract\", or remove it",
        ),
    ] {
        let told_so = read(&format!("[[reply]]\n{text}\n")).expect_err(text);
        assert_eq!(told_so.trim_end(), told, "{text}");
    }
}

#[test]
fn two_writers_of_a_signal_and_replies_in_a_circle_are_refused() {
    let follows = |signal: &str, when: &str| {
        format!("[[reply]]\nkind = \"follows\"\nsignal = \"{signal}\"\nwhen = \"{when}\"\n")
    };
    let twins = read(&[follows("a", "A"), follows("a", "B")].concat()).expect_err("twins");
    assert_eq!(
        twins.trim_end(),
        "x:7:10: \"a\" is made by the reply on line 3, too; name another signal; each has one writer"
    );
    let circle = read(
        &[
            follows("d", "a"),
            follows("a", "b"),
            follows("b", "c"),
            follows("c", "a"),
        ]
        .concat(),
    );
    assert_eq!(
        circle.expect_err("a circle").trim_end(),
        "x:6:8: replies read each other in a circle: \"follows a\" reads \"follows b\" reads \"follows c\" reads \
         \"follows a\"; let one of them read a signal of the PLC, or of the simulation"
    );
    let chain = [follows("d", "a"), follows("a", "b"), follows("b", "C")];
    let chain = read(&chain.concat()).expect("a chain");
    let names: Vec<&str> = chain.iter().map(|reply| reply.name.as_str()).collect();
    assert_eq!(names, ["follows b", "follows a", "follows d"]);
    assert_eq!(
        chain[2].what(&table()),
        "\"follows d\" (follows): \"d\" from \"a\""
    );
    // The same where the last one was there before.
    let earlier = read(&follows("d", "a")).expect("one");
    let all = read_after(&follows("a", "b"), &earlier).expect("two files");
    let names: Vec<&str> = all.iter().map(|reply| reply.name.as_str()).collect();
    assert_eq!(names, ["follows a", "follows d"]);
    let circle = read_after(&follows("a", "d"), &earlier).expect_err("a circle");
    assert!(
        circle.starts_with(
            "x:2:8: replies read each other in a circle: \"follows a\" reads \"follows d\""
        ),
        "{circle}"
    );
}
