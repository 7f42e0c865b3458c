//! The tick in Rust: one exchange of a driver, without the call from Java.
//!
//! `rig` has the test rig's 16 bits in each direction, `reals` a number of REAL signals in each direction. On
//! a free bus most exchanges find nothing new, as in a simulation that ticks faster than its bus; on a
//! stepped one every exchange runs a bus cycle and a scan of the hosted program, on the same thread.
#![allow(missing_docs, reason = "a bench")]

mod signals;

use std::fmt::Write as _;
use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use signals::{bits, latched_bits};
use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::image::triple_buffer;
use tickbus::signal::Slot;
use tickbus::time::{Monotonic, Nanos};

/// A frame such as the image hands over.
#[derive(Clone)]
#[expect(dead_code, reason = "handed over, and not looked at")]
struct Frame {
    bytes: Box<[u8]>,
    edges: Box<[u32]>,
    sequence: u64,
}

/// Faults of the rig's first bits, and of the line, as sections of a driver.cfg; none of them stops the bus.
const FAULTS: &str = "
[[fault]]
kind   = \"invert\"
signal = \"I 0.0\"
[[fault]]
kind   = \"noise\"
signal = \"Q 0.0\"
chance = 0.1
[[fault]]
kind = \"delay\"
by   = \"5ms\"
[[fault]]
kind   = \"drop\"
chance = 0.1
";

fn config(mode: &str, signals: &str) -> Config {
    let text = format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
         scan = \"1ms\"\ncycle = \"1ms\"\nmode = \"{mode}\"\n{signals}"
    );
    Config::parse("driver.cfg", &text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"))
}

/// Bits each in a byte of its own, like the `Execute` bits of `count` axes.
fn lone_bits(count: usize, latch: &str) -> String {
    let mut text = String::new();
    for area in ['Q', 'I'] {
        for byte in 0..count {
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area} {byte}\"\naddress = \"%{area}X{byte}.0\"\n{latch}\n"
            );
        }
    }
    text
}

fn reals(count: usize) -> String {
    let mut text = String::new();
    for area in ['Q', 'I'] {
        for index in 0..count {
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area} {index}\"\naddress = \"%{area}D{}\"\ntype = \"REAL\"\n",
                index * 4
            );
        }
    }
    text
}

/// The cost of 2,000 latched signals that all change in each tick.
fn latches(criterion: &mut Criterion) {
    const COUNT: usize = 2_000;
    let mut group = criterion.benchmark_group("latches");
    for (name, latch) in [("without", ""), ("with", "latch = \"rising\"")] {
        for mode in ["free", "stepped"] {
            let config = config(mode, &lone_bits(COUNT, latch));
            let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
            let mut slots = driver.initial_slots();
            let mut time = Nanos::ZERO;
            group.bench_function(BenchmarkId::new(name, mode), |bencher| {
                bencher.iter(|| {
                    time += Nanos::from_millis(1);
                    for slot in &mut slots[COUNT..2 * COUNT] {
                        *slot = Slot::from_real(1.0 - slot.real());
                    }
                    black_box(driver.exchange(time, &mut slots))
                });
            });
        }
    }
    group.finish();
}

fn exchange(criterion: &mut Criterion) {
    let clock = Monotonic::shared();
    let mut group = criterion.benchmark_group("exchange");
    let latched = latched_bits();
    // Waiting faults, and active faults.
    let wait = FAULTS.replace("[[fault]]", "[[fault]]\nat = \"1000h\"");
    let tables = [
        ("rig, faults waiting", format!("{latched}{wait}")),
        ("rig, faults active", format!("{latched}{FAULTS}")),
        ("rig", latched),
        ("rig unlatched", bits("")),
        ("1000 reals", reals(1_000)),
    ];
    for (name, signals) in tables {
        for mode in ["free", "stepped"] {
            let mut driver =
                Driver::open(config(mode, &signals), Arc::clone(&clock) as _).expect("opens");
            let mut slots = driver.initial_slots();
            let mut time = Nanos::ZERO;
            group.bench_function(BenchmarkId::new(name, mode), |bencher| {
                bencher.iter(|| {
                    time += Nanos::from_millis(1);
                    // Something changes at every tick.
                    for slot in &mut slots[16..20] {
                        *slot = Slot::from_real(1.0 - slot.real().abs().min(1.0));
                    }
                    black_box(driver.exchange(time, &mut slots))
                });
            });
        }
    }
    group.finish();
}

/// 64 bits of the simulation, and the signals of 500 replies that they drive; the replies themselves, if asked for.
fn machine(has_replies: bool) -> String {
    let (mut signals, mut replies) = (String::new(), String::new());
    let mut bits = 0..;
    let mut bit = |name: &str| {
        let at = bits.next().unwrap_or(0);
        let address = format!("%IX{}.{}", at / 8, at % 8);
        let _ = write!(
            signals,
            "[[signal]]\nname = \"{name}\"\naddress = \"{address}\"\n"
        );
    };
    for command in 0..64 {
        bit(&format!("C {command}"));
    }
    for of_ten in 0..50 {
        for (place, kind) in "ffffmmccbk".chars().enumerate() {
            let (name, command) = (format!("{of_ten}.{place}"), (of_ten * 10 + place) % 64);
            let (keys, made) = match kind {
                'f' => (
                    format!(
                        "kind = \"follows\"\nwhen = \"C {command}\"\non_after = \"50ms\"\nsignal"
                    ),
                    "",
                ),
                'm' => (
                    format!(
                        "kind = \"motor\"\ncontactor = \"C {command}\"\nstart_time = \"500ms\"\nrunning"
                    ),
                    "at_speed",
                ),
                'c' => (
                    format!(
                        "kind = \"cylinder\"\nextend = \"C {command}\"\nextend_time = \"400ms\"\nextended"
                    ),
                    "retracted",
                ),
                'b' => (
                    "kind = \"blink\"\non_for = \"500ms\"\nsignal".to_owned(),
                    "",
                ),
                _ => ("kind = \"constant\"\nvalue = true\nsignal".to_owned(), ""),
            };
            bit(&name);
            let _ = write!(replies, "[[reply]]\n{keys} = \"{name}\"\n");
            if !made.is_empty() {
                bit(&format!("{name} too"));
                let _ = writeln!(replies, "{made} = \"{name} too\"");
            }
        }
    }
    if has_replies {
        signals + replies.as_str()
    } else {
        signals
    }
}

/// The same commands, and 500 positions of cylinders that they move; the replies themselves, if asked for. No cylinder
/// arrives before its command changes again, so that every position changes in every tick.
fn cylinders(has_replies: bool) -> String {
    let mut text = String::new();
    for bit in 0..64 {
        let address = format!("%IX{}.{}", bit / 8, bit % 8);
        let _ = write!(
            text,
            "[[signal]]\nname = \"C {bit}\"\naddress = \"{address}\"\n"
        );
    }
    for part in 0..500 {
        let _ = write!(
            text,
            "[[signal]]\nname = \"P {part}\"\naddress = \"%ID{}\"\ntype = \"REAL\"\n",
            8 + 4 * part
        );
        if has_replies {
            let _ = write!(
                text,
                "[[reply]]\nkind = \"cylinder\"\nextend = \"C {}\"\nposition = \"P {part}\"\nextend_time = \"2s\"\n",
                part % 64
            );
        }
    }
    text
}

/// The cost of 500 replies: each command changes every second, so that most parts are under way.
fn replies(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("replies");
    for (name, text) in [
        ("none", machine(false)),
        ("500", machine(true)),
        ("no positions", cylinders(false)),
        ("500 positions", cylinders(true)),
    ] {
        let config = config("free", &text);
        let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
        let mut slots = driver.initial_slots();
        let mut tick = 0;
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                tick += 1;
                if tick % 16 == 0 {
                    let command = tick / 16 % 64;
                    slots[command] = Slot::from_real(1.0 - slots[command].real());
                }
                let time = Nanos::from_millis(i64::try_from(tick).expect("a short run"));
                black_box(driver.exchange(time, &mut slots))
            });
        });
    }
    group.finish();
}

/// Our triple buffer compared with the crate of that name: publish and read on one thread.
fn hand_over(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("hand-over");
    for size in [64, 512, 4096] {
        let frame = Frame {
            bytes: vec![0; size].into(),
            edges: vec![0; 16].into(),
            sequence: 0,
        };
        let source = vec![1_u8; size];
        let (mut writer, mut reader) = triple_buffer(&frame);
        group.bench_function(BenchmarkId::new("own", size), |bencher| {
            bencher.iter(|| {
                writer.with_buffer(|frame| frame.bytes.copy_from_slice(black_box(&source)));
                writer.publish();
                reader.update();
                reader.with(|frame| black_box(frame.bytes[0]))
            });
        });
        let (mut input, mut output) = triple_buffer::TripleBuffer::new(&frame).split();
        group.bench_function(BenchmarkId::new("crate triple_buffer", size), |bencher| {
            bencher.iter(|| {
                input
                    .input_buffer_mut()
                    .bytes
                    .copy_from_slice(black_box(&source));
                input.publish();
                output.update();
                black_box(output.output_buffer().bytes[0])
            });
        });
    }
    group.finish();
}

criterion_group!(benches, exchange, latches, replies, hand_over);
criterion_main!(benches);
