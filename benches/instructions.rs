//! Counts the instructions of a tick, which a busy machine does not change: `tools/instructions` runs this under
//! valgrind, and compares with `instructions.txt`.
//!
//! `instructions CASE TICKS` makes that many ticks; `instructions --list` gives the cases. Valgrind counts in the function
//! `ticks` alone. The clock stands still meanwhile, so that a free bus has nothing to do. `doors/instructions.c` counts the
//! entry through the C interface; `instructions --still` prints its driver.cfg, whose bus has a cycle of an hour. What the
//! clock itself costs, and the way from Java, are in the times of `make bench`.
#![allow(missing_docs, reason = "a bench")]

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Manual, Nanos};

const TICK: Nanos = Nanos::from_millis(1);

/// One case: the signals of the table, how the bus runs, and what the simulation does before each exchange.
struct Case {
    name: &'static str,
    signals: fn() -> String,
    each_way: usize,
    mode: &'static str,
    /// Receives and sends in two calls, in place of one exchange.
    is_halved: bool,
    /// Sets the values; they are got after the exchange then.
    set: Option<fn(&mut Copies, &mut [Slot])>,
    /// Further tables of driver.cfg.
    tables: fn() -> String,
}

impl Case {
    /// The driver.cfg, for a bus and a program with this cycle.
    fn driver_cfg(&self, cycle: &str) -> String {
        format!(
            "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
             scan = \"{cycle}\"\ncycle = \"{cycle}\"\nmode = \"{}\"\n{}{}",
            self.mode,
            (self.tables)(),
            (self.signals)()
        )
    }
}

/// 16 BOOLs each way on a free bus, and nothing else.
const PLAIN: Case = Case {
    name: "exchange.free.16",
    signals: || bits(16, 8, ""),
    each_way: 16,
    mode: "free",
    is_halved: false,
    set: None,
    tables: String::new,
};

const CASES: &[Case] = &[
    PLAIN,
    Case {
        name: "receive-send.free.16",
        is_halved: true,
        ..PLAIN
    },
    Case {
        name: "exchange.free.16.waiting",
        tables: || four_faults("at = \"1000h\""),
        ..PLAIN
    },
    Case {
        name: "exchange.free.16.active",
        tables: || four_faults(""),
        ..PLAIN
    },
    Case {
        name: "exchange.free.16.recorded",
        tables: || format!("[record]\nfile = '{}'\n", recording().display()),
        ..PLAIN
    },
    Case {
        name: "set-get.free.16",
        set: Some(Copies::set_two),
        ..PLAIN
    },
    Case {
        name: "set-get.stepped.16",
        mode: "stepped",
        set: Some(Copies::set_two),
        ..PLAIN
    },
    Case {
        name: "set-get.stepped.16.latched",
        signals: || bits(16, 8, "latch = \"rising\""),
        mode: "stepped",
        set: Some(Copies::set_two),
        ..PLAIN
    },
    Case {
        name: "reals.stepped.1000",
        signals: || reals(1_000),
        each_way: 1_000,
        mode: "stepped",
        set: Some(Copies::set_two),
        ..PLAIN
    },
    Case {
        name: "reals.stepped.10000",
        signals: || reals(10_000),
        each_way: 10_000,
        mode: "stepped",
        set: Some(Copies::set_two),
        ..PLAIN
    },
    Case {
        name: "bools.free.2000",
        signals: || bits(2_000, 1, ""),
        each_way: 2_000,
        set: Some(Copies::set_all),
        ..PLAIN
    },
    Case {
        name: "bools.free.2000.latched",
        signals: || bits(2_000, 1, "latch = \"rising\""),
        each_way: 2_000,
        set: Some(Copies::set_all),
        ..PLAIN
    },
    Case {
        name: "bools.stepped.2000",
        signals: || bits(2_000, 1, ""),
        each_way: 2_000,
        mode: "stepped",
        set: Some(Copies::set_all),
        ..PLAIN
    },
    Case {
        name: "bools.stepped.2000.latched",
        signals: || bits(2_000, 1, "latch = \"rising\""),
        each_way: 2_000,
        mode: "stepped",
        set: Some(Copies::set_all),
        ..PLAIN
    },
];

fn main() {
    let mut arguments = std::env::args().skip(1);
    match (arguments.next(), arguments.next()) {
        (Some(name), Some(ticks)) if !name.starts_with('-') => {
            let case = CASES.iter().find(|case| case.name == name);
            let case = case.unwrap_or_else(|| panic!("there is no case {name}; see --list"));
            run(case, ticks.parse().expect("a number of ticks"));
        }
        (Some(list), _) if list == "--list" => {
            for case in CASES {
                println!("{}", case.name);
            }
        }
        (Some(still), _) if still == "--still" => print!("{}", PLAIN.driver_cfg("1h")),
        // `cargo test` and `cargo bench` want to see that it runs.
        _ => {
            for case in CASES {
                run(case, 2);
            }
        }
    }
}

/// Opens the driver of a case and makes `ticks` ticks.
fn run(case: &Case, ticks: u64) {
    let config = Config::parse("driver.cfg", &case.driver_cfg("1ms"), &tickbus::KINDS)
        .unwrap_or_else(|why| panic!("{why}"));
    let clock = Manual::new();
    let mut driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
    let mut slots = driver.initial_slots();
    let mut time = Nanos::ZERO;
    if case.mode == "free" {
        // Until bus and program have nothing more to do, and the peer is there.
        for _ in 0..10 {
            while !clock.is_settled(3) {
                std::thread::yield_now();
            }
            time += TICK;
            driver.exchange(time, &mut slots);
            clock.advance(TICK);
        }
        while !clock.is_settled(3) {
            std::thread::yield_now();
        }
    }
    self::ticks(case, ticks, &mut driver, &mut slots, time);
    driver.close();
    // Only a recorded case has the file.
    let _ = std::fs::remove_file(recording());
}

/// Valgrind counts the instructions in this function.
#[inline(never)]
fn ticks(case: &Case, count: u64, driver: &mut Driver, slots: &mut [Slot], begin: Nanos) {
    let mut copies = Copies::new(case.each_way);
    let mut time = begin;
    for _ in 0..count {
        time += TICK;
        if let Some(set) = case.set {
            set(&mut copies, slots);
        }
        if case.is_halved {
            black_box(driver.receive(time, slots));
            black_box(driver.send(slots));
        } else {
            black_box(driver.exchange(time, slots));
        }
        if case.set.is_some() {
            copies.get(slots);
        }
    }
}

/// The simulation's own arrays: the values that it writes, and those that it has read.
struct Copies {
    values: Vec<f64>,
    inputs: Vec<f64>,
    at: usize,
}

impl Copies {
    fn new(each_way: usize) -> Self {
        Self {
            values: vec![0.0; each_way],
            inputs: vec![0.0; each_way],
            at: 0,
        }
    }

    /// Two values change, and all are set.
    fn set_two(&mut self, slots: &mut [Slot]) {
        let at = self.at % self.values.len();
        for at in [at, at ^ 1] {
            self.values[at] = 1.0 - self.values[at];
        }
        self.at += 1;
        self.set(slots);
    }

    /// All values change, and are set.
    fn set_all(&mut self, slots: &mut [Slot]) {
        for value in &mut self.values {
            *value = 1.0 - *value;
        }
        self.set(slots);
    }

    fn set(&mut self, slots: &mut [Slot]) {
        for (slot, value) in slots.iter_mut().zip(&self.values) {
            *slot = Slot::from_real(*value);
        }
    }

    fn get(&mut self, slots: &[Slot]) {
        let slots = &slots[self.inputs.len()..];
        for (value, slot) in self.inputs.iter_mut().zip(slots) {
            *value = slot.real();
        }
        black_box(&mut self.inputs);
    }
}

/// BOOLs each way, in the order that the simulation has them: first those that it writes.
///
/// `in_a_byte` of them lie side by side in each byte.
fn bits(each_way: usize, in_a_byte: usize, latch: &str) -> String {
    let mut text = String::new();
    for area in ['I', 'Q'] {
        for signal in 0..each_way {
            let (byte, bit) = (signal / in_a_byte, signal % in_a_byte);
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area} {signal}\"\naddress = \"%{area}X{byte}.{bit}\"\n{latch}\n"
            );
        }
    }
    text
}

/// Four faults of signals, two in each direction.
fn four_faults(when: &str) -> String {
    let mut text = String::new();
    for (kind, signal) in [
        ("stuck", "I 3"),
        ("invert", "Q 2"),
        ("invert", "I 4"),
        ("stuck", "Q 11"),
    ] {
        let _ = write!(
            text,
            "[[fault]]\n{when}\nkind = \"{kind}\"\nsignal = \"{signal}\"\n"
        );
    }
    text
}

/// A recording for this process alone. The recorder has room for more ticks than are counted.
fn recording() -> PathBuf {
    std::env::temp_dir().join(format!("instructions-{}.vcd", std::process::id()))
}

/// REALs each way, without gaps.
fn reals(each_way: usize) -> String {
    let mut text = String::new();
    for area in ['I', 'Q'] {
        for signal in 0..each_way {
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area} {signal}\"\naddress = \"%{area}D{}\"\ntype = \"REAL\"\n",
                signal * 4
            );
        }
    }
    text
}
