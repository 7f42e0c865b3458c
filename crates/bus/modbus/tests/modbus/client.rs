//! The client, and a hand-written PLC at the other end.

use super::*;

/// A machine that polls `plc`, and may write to it although it does not report its identity.
fn asks(plc: &Plc, further: &str) -> Alone {
    let address = plc.address;
    Alone::open(
        &format!(
            "[driver]\nid = 1\nname = \"machine\"\n[fieldbus]\nkind = \"modbus-client\"\naddress = \"{address}\"\n\
         cycle = \"1ms\"\nmax_age = \"300ms\"\nreconnect = [\"10ms\"]\n{further}"
        ),
        &KINDS,
    )
}

const AT: &str = r#"
[fieldbus.at]
"level"  = "holding-register:21"
"long"   = "input-register offset:30:LREAL"
"door"   = "discrete-input:3"
"valve"  = "000008"
"force"  = "%MW40"
"ready"  = "400101.3"
"pump"   = "coil:5"
"fan"    = "coil:7"

[[signal]]
name    = "level"
address = "%QW0"
type    = "INT"

[[signal]]
name    = "long"
address = "%QL8"
type    = "LREAL"
order   = "CDAB"

[[signal]]
name    = "door"
address = "%QX2.0"

[[signal]]
name    = "valve"
address = "%QX2.1"

[[signal]]
name    = "force"
address = "%ID0"
type    = "REAL"

[[signal]]
name    = "ready"
address = "%IX4.0"
latch   = "rising"

[[signal]]
name    = "pump"
address = "%IX4.1"

[[signal]]
name    = "fan"
address = "%IX4.2"
"#;

#[test]
fn single_signals_lie_where_the_plc_has_them_and_nothing_else_in_it_is_written() {
    let single: plc::Habits = |_, function| match function {
        15 | 16 => Habit::Refuses(1),
        _ => Habit::Answers,
    };
    for habits in [|_, _| Habit::Answers, single] {
        let plc = Plc::start(habits);
        let identity = format!("modbus device at {}, unit 1", plc.address);
        let before = plc.with(|memory| {
            memory.registers[1][20] = 4711;
            // 1.5 with swapped words.
            memory.registers[0][30..34].copy_from_slice(&[0, 0, 0, 0x3FF8]);
            memory.bits[1][2] = true;
            memory.bits[0][7] = true;
            (memory.bits.clone(), memory.registers.clone())
        });
        let mut machine = asks(&plc, &format!("write_to = \"{identity}\"\n{AT}"));
        machine.end.set("force", 2.5);
        machine.end.set("fan", 1.0);
        machine.until("both ends have all", |end| {
            let arrived = end.get("level") == 4711.0 && end.get("long") == 1.5;
            let written = plc.with(|memory| memory.registers[1][40..42] == [0x4020, 0]);
            arrived && written && end.get("door") == 1.0 && end.get("valve") == 1.0
        });
        // A pulse of one tick is written to a bit of a register.
        machine.end.set("ready", 1.0);
        machine.end.tick();
        machine.end.set("ready", 0.0);
        machine.until("the PLC had the pulse", |_| {
            plc.with(|memory| memory.masked.contains(&0xA5AD))
        });
        machine.until("it is over", |_| {
            plc.with(|memory| memory.registers[1][100] == 0xA5A5)
        });
        let (mut bits, mut registers) = before;
        bits[0][4] = false;
        bits[0][6] = true;
        registers[1][40..42].copy_from_slice(&[0x4020, 0]);
        machine.end.driver.close();
        plc.with(|memory| {
            assert_eq!(memory.bits, bits);
            assert_eq!(memory.registers, registers);
        });
    }
}

const TWO_WORDS: &str = "[[signal]]\nname = \"from\"\naddress = \"%QW0\"\n\
                         [[signal]]\nname = \"to\"\naddress = \"%IW0\"\n\
                         [[signal]]\nname = \"further\"\naddress = \"%IW8\"\n";

#[test]
fn registers_between_two_signals_are_left_alone() {
    let plc = Plc::start(|_, _| Habit::Answers);
    let write_to = format!("write_to = \"modbus device at {}, unit 1\"", plc.address);
    let mut machine = asks(
        &plc,
        &format!("inputs = \"offset:100\"\n{write_to}\n{TWO_WORDS}"),
    );
    machine.end.set("to", 1.0);
    machine.end.set("further", 2.0);
    machine.until("both are written", |_| {
        plc.with(|memory| memory.registers[1][100] == 1 && memory.registers[1][104] == 2)
    });
    machine.end.driver.close();
    plc.with(|memory| assert_eq!(memory.registers[1][101..104], [0xA5A5; 3]));
}

#[test]
fn a_plc_that_ignores_or_hangs_up_on_the_question_who_it_is_is_read_and_written() {
    for habits in [
        (|_, function| {
            if function == 43 {
                Habit::Ignores
            } else {
                Habit::Answers
            }
        }) as plc::Habits,
        |_, function| {
            if function == 43 {
                Habit::HangsUp
            } else {
                Habit::Answers
            }
        },
    ] {
        let plc = Plc::start(habits);
        let write_to = format!("write_to = \"modbus device at {}, unit 1\"", plc.address);
        let mut machine = asks(
            &plc,
            &format!("timeout = \"20ms\"\n{write_to}\n{TWO_WORDS}"),
        );
        machine.until("it is read", |end| end.get("from") == f64::from(0xA5A5_u16));
        machine.end.set("to", 7.0);
        machine.until("it is written", |_| {
            plc.with(|memory| memory.registers[1][1024] == 7)
        });
        machine.until("it is asked for its values alone", |_| {
            plc.with(|memory| {
                let mut last = memory.asked.iter().rev().take(50);
                memory.asked.len() > 50 && last.all(|asked| asked.1 != 43)
            })
        });
        machine.until("it runs", |end| end.link().state == LinkState::Running);
        let asked = plc.with(|memory| memory.asked.iter().filter(|asked| asked.1 == 43).count());
        assert!(asked >= 2, "one silence may be an accident: {asked}");
        machine.end.driver.close();
    }
}

#[test]
fn a_unit_in_fault_is_fail_safe_alone_and_the_other_is_read_on() {
    logged::expect("the other stations go on");
    for habits in [
        (|unit, _| {
            if unit == 7 {
                Habit::Refuses(4)
            } else {
                Habit::Answers
            }
        }) as plc::Habits,
        |unit, _| {
            if unit == 7 {
                Habit::Ignores
            } else {
                Habit::Answers
            }
        },
    ] {
        let plc = Plc::start(habits);
        let mut machine = asks(&plc, TWO_UNITS);
        for value in [1_u8, 2, 3] {
            plc.with(|memory| memory.registers[1][0] = u16::from(value));
            machine.until("the press is read", |end| {
                end.get("press") == f64::from(value)
            });
            assert_eq!(machine.end.get("oven"), -1.0);
        }
        machine.end.driver.close();
    }
}
