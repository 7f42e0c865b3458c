//! The tick allocates nothing, as counted by the allocator of this program.

use std::sync::Arc;

use tickbus::driver::{Driver, Force};
use tickbus::driver_cfg::Config;
use tickbus::faults::{Lasts, SignalEffect};
use tickbus::signal::Slot;
use tickbus::time::{Manual, Nanos};
use tickbus_binding::Handles;
use tickbus_conformance::resources::allocations_of_thread;

/// Every type in both directions, latched bits that change, values that saturate, a NaN.
fn config(fieldbus: &str, faults: &str) -> Config {
    use std::fmt::Write as _;

    let mut text = format!("[driver]\nid = 1\nname = \"all\"\n[fieldbus]\n{fieldbus}\n");
    for (area, latch) in [('Q', "both"), ('I', "rising")] {
        for bit in 0..16 {
            let (byte, bit) = (bit / 8, bit % 8);
            write!(
                text,
                "[[signal]]\nname = \"{area} bit {byte}.{bit}\"\naddress = \"%{area}X{byte}.{bit}\"\nlatch = \"{latch}\"\n"
            )
            .expect("a string takes all");
        }
        let types = [
            "BYTE", "SINT", "WORD", "INT", "DWORD", "DINT", "REAL", "LWORD", "LINT", "LREAL",
        ];
        let sizes = [1, 1, 2, 2, 4, 4, 4, 8, 8, 8];
        let letters = ['B', 'B', 'W', 'W', 'D', 'D', 'D', 'L', 'L', 'L'];
        let mut byte = 8;
        for ((data_type, size), letter) in types.into_iter().zip(sizes).zip(letters) {
            write!(
                text,
                "[[signal]]\nname = \"{area} {data_type}\"\naddress = \"%{area}{letter}{byte}\"\ntype = \"{data_type}\"\n"
            )
            .expect("a string takes all");
            byte += size;
        }
    }
    text += faults;
    Config::parse("driver.cfg", &text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"))
}

/// Every signal fault in both directions, and every line fault, beginning and ending.
const FAULTS: &str = "
[[fault]]\nkind = \"stuck\"\nsignal = \"I bit 0.0\"\n
[[fault]]\nkind = \"invert\"\nsignal = \"Q bit 0.1\"\n
[[fault]]\nkind = \"invert\"\nsignal = \"Q LWORD\"\n
[[fault]]\nkind = \"offset\"\nsignal = \"I LINT\"\nby = 7\n
[[fault]]\nkind = \"noise\"\nsignal = \"I LREAL\"\namplitude = 0.5\n
[[fault]]\nkind = \"noise\"\nsignal = \"Q bit 1.0\"\nchance = 0.5\n
[[fault]]\nkind = \"stuck\"\nsignal = \"Q INT\"\nwhen = \"I REAL > 0\"\nticks = 3\ntimes = 1000000\n
[[fault]]\nkind = \"model\"\nname = \"leak\"\nwhen = \"I REAL > 0\"\nticks = 2\ntimes = 1000000\n
[[fault]]\nkind = \"drop\"\nchance = 0.2\n
[[fault]]\nkind = \"duplicate\"\nchance = 0.2\n
[[fault]]\nkind = \"delay\"\nby = \"20ms\"\n
[[fault]]\nkind = \"values-late\"\nby = \"30ms\"\n
";

/// Ticks with changing values; returns the allocations in 10,000 ticks after a warm-up, both exchanges and
/// ticks in two halves.
fn allocations(fieldbus: &str, faults: &str) -> u64 {
    let clock = Manual::new();
    let mut driver =
        Driver::open(config(fieldbus, faults), Arc::clone(&clock) as _).expect("opens");
    let names = ["wear", "leak"].map(str::to_owned);
    driver.declare_model_faults(names.into()).expect("names");
    let mut slots = driver.initial_slots();
    let (mut before, mut changes) = (0, 0);
    for tick in 0..11_000_i32 {
        if tick == 1_000 {
            before = allocations_of_thread();
        }
        for (index, slot) in slots.iter_mut().enumerate().take(52) {
            let value = if (tick + i32::try_from(index).expect("small")) % 97 == 0 {
                f64::NAN
            } else {
                f64::from(tick) * 1e3
            };
            *slot = Slot::from_real(value);
        }
        let time = Nanos::from_millis(tick.into());
        if tick % 2 == 0 {
            driver.exchange(time, &mut slots);
        } else {
            driver.receive(time, &mut slots);
            driver.send(&mut slots);
        }
        while driver.next_model_change().is_some() {
            changes += 1;
        }
    }
    let is_told = faults.contains("\"model\"");
    assert_eq!(changes > 100, is_told, "the model has its fault");
    allocations_of_thread() - before
}

const FREE: &str = "kind = \"loopback\"\nprogram = \"mirror\"\nscan = \"1ms\"";
const STEPPED: &str =
    "kind = \"loopback\"\nprogram = \"mirror\"\nscan = \"1ms\"\nmode = \"stepped\"";

/// A viewer looks at every tick, and forces one signal after the other, in both directions.
#[test]
fn a_driver_that_is_watched_and_forced() {
    for fieldbus in [FREE, STEPPED] {
        let clock = Manual::new();
        let config = config(fieldbus, "");
        let signals = config.table.signals.len();
        let mut driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
        let mut watch = driver.watch();
        let mut slots = driver.initial_slots();
        let (mut count, mut forced) = (0, None);
        for tick in 0..2_000_usize {
            watch.ask(tick % 3 == 0);
            if tick % 5 == 0 {
                let id = watch.force(tick % signals, Slot::from_real(1.0));
                let before = forced.replace(id.expect("there is room"));
                if let Some(id) = before {
                    watch.end_fault(id).expect("it is taken");
                }
            } else if tick % 5 == 1 {
                // Two at once: one for a tick, and one along a ramp.
                let ramp = SignalEffect::Ramp {
                    from: None,
                    to: Slot::from_real(1.0),
                    within: Nanos::from_millis(2),
                };
                let force = |signal, effect, ticks| Force {
                    signal: signal % signals,
                    effect,
                    lasts: Lasts::Ticks(ticks),
                };
                let once = SignalEffect::Stuck(Some(Slot::from_real(1.0)));
                let both = [force(tick, once, 1), force(tick + 1, ramp, 3)];
                watch.force_all(&both, Vec::new()).expect("there is room");
            } else if tick % 500 == 7 {
                // No signal is forced for a while.
                if let Some(id) = forced.take() {
                    watch.end_fault(id).expect("it is taken");
                }
            }
            let time = Nanos::from_millis(tick.try_into().expect("small"));
            let before = allocations_of_thread();
            driver.exchange(time, &mut slots);
            if tick >= 100 {
                count += allocations_of_thread() - before;
            }
            assert!(watch.update(), "a copy came with its tick");
        }
        assert_eq!(count, 0);
    }
}

/// Replies of each kind, made from what the mirror sends back.
const REPLIES: &str = "
[[reply]]\nkind = \"constant\"\nsignal = \"I bit 0.0\"\nvalue = true\n
[[reply]]\nkind = \"follows\"\nsignal = \"I bit 0.1\"\nwhen = [\"Q bit 0.0\", \"Q INT == 0\"]\non_after = \"5ms\"\n
[[reply]]\nkind = \"motor\"\ncontactor = \"Q bit 0.1\"\nrunning = \"I bit 0.2\"\nspeed = \"I INT\"\nstart_time = \"1s\"\n
[[reply]]\nkind = \"cylinder\"\nextend = \"I bit 1.2\"\nextended = \"I bit 0.3\"\nposition = \"I REAL\"\nextend_time = \"300ms\"\n
[[reply]]\nkind = \"valve\"\ntarget = \"I REAL\"\nposition = \"I DINT\"\nopen_time = \"2s\"\n
[[reply]]\nkind = \"lag\"\nsignal = \"I LREAL\"\ninput = \"I REAL\"\ntime = \"1s\"\nnoise = 0.5\n
[[reply]]\nkind = \"switch\"\nsignal = \"I bit 0.4\"\ninput = \"I LREAL\"\nabove = 50\n
[[reply]]\nkind = \"counter\"\nsignal = \"I LINT\"\nwhen = \"I bit 1.2\"\n
[[reply]]\nkind = \"encoder\"\nsignal = \"I LWORD\"\nforward = \"I bit 1.2\"\nrate = 1000\n
[[reply]]\nkind = \"blink\"\nsignal = \"I bit 1.2\"\non_for = \"400ms\"\n
[[reply]]\nkind = \"life-sign\"\nsignal = \"I BYTE\"\nevery = \"10ms\"\n
";

/// An integrator and a track on signals of their own, and a drive of each kind; what the drives tell comes back as what they
/// receive.
const STATES: &str = "
[[signal]]\nname = \"Level\"\naddress = \"%ID300\"\ntype = \"REAL\"\n
[[signal]]\nname = \"Gate\"\naddress = \"%IX304.0\"\n
[[signal]]\nname = \"Gone\"\naddress = \"%IW306\"\ntype = \"INT\"\n
[[signal]]\nname = \"Part 1\"\naddress = \"%ID308\"\ntype = \"REAL\"\n
[[signal]]\nname = \"Part 2\"\naddress = \"%ID312\"\ntype = \"REAL\"\n
[[reply]]\nkind = \"integrator\"\nsignal = \"Level\"\nlimits = [0, 100]\nreset = \"Level > 90\"\n
flows = [{ rate = 50 }, { when = \"Gate\", input = \"Level\", gain = -0.1 }]\n
[[reply]]\nkind = \"track\"\nforward = \"not Q bit 0.0\"\nrate = 250\nlength = 1000\nsize = 50\nparts = [80, 40]\n
sensors = [{ signal = \"Gate\", at = 200, above = 60 }]\nexits = [{ at = 500, when = \"Level >= 0\", signal = \"Gone\" }]\n
places = [{ position = \"Part 1\" }, { position = \"Part 2\" }]\n
[[drive]]\nname = \"Servo\"\ntelegram = 5\ncommand_offset = 200\nfeedback_offset = 200\nfault = \"Level > 80\"\n
[[drive]]\nname = \"Positioner\"\ntelegram = 111\ncommand_offset = 240\nfeedback_offset = 240\nwarning = \"Gate\"\n
";

/// A PLC would write STW1; here each drive is switched on and off by forcing it.
#[test]
fn drives_integrators_and_tracks() {
    for fieldbus in [FREE, STEPPED] {
        let config = config(fieldbus, STATES);
        let of = |name: &str| config.table.position(name).expect("a signal");
        let words = ["Servo.STW1", "Positioner.STW1"].map(of);
        let setpoint = of("Servo.NSOLL_B");
        let seen = ["Part 1", "Gone", "Servo.NIST_B"].map(of);
        let mut driver = Driver::open(config, Manual::new() as _).expect("opens");
        let mut watch = driver.watch();
        let mut slots = driver.initial_slots();
        let held = watch.force(setpoint, Slot::from_real(300.0));
        held.expect("there is room");
        let (mut count, mut most, mut forced) = (0, [0.0_f64; 3], None);
        for tick in 0..5_000_i64 {
            watch.ask(true);
            if tick % 50 == 0 {
                let stw1 = if tick % 500 == 0 { 0x047E } else { 0x047F };
                let now = words.map(|word| {
                    let id = watch.force(word, Slot::from_real(f64::from(stw1)));
                    id.expect("there is room")
                });
                for id in forced.replace(now).into_iter().flatten() {
                    watch.end_fault(id).expect("it is taken");
                }
            }
            let before = allocations_of_thread();
            driver.exchange(Nanos::from_millis(tick), &mut slots);
            if tick >= 100 {
                count += allocations_of_thread() - before;
                for (most, signal) in most.iter_mut().zip(seen) {
                    *most = most.max(slots[signal].real());
                }
            }
            assert!(watch.update(), "a copy came with its tick");
        }
        assert_eq!(count, 0, "{fieldbus}");
        let [part, gone, speed] = most;
        assert!(part > 400.0 && gone > 0.0 && speed > 50.0, "{most:?}");
    }
}

/// The simulation overrules one of the replies in the middle of the run.
#[test]
fn a_driver_with_replies() {
    for fieldbus in [FREE, STEPPED] {
        let clock = Manual::new();
        let config = config(fieldbus, REPLIES);
        let byte = config.table.position("I BYTE").expect("a signal");
        let mut driver = Driver::open(config, Arc::clone(&clock) as _).expect("opens");
        let mut slots = driver.initial_slots();
        let mut count = 0;
        for tick in 0..5_000_i64 {
            if tick == 2_500 {
                slots[byte] = Slot::from_real(201.0);
            }
            let before = allocations_of_thread();
            driver.exchange(Nanos::from_millis(tick), &mut slots);
            if tick >= 100 && !(2_500..=2_510).contains(&tick) {
                count += allocations_of_thread() - before;
            }
        }
        assert_eq!(count, 0, "{fieldbus}");
        let moved = slots.iter().filter(|slot| slot.0 != 0).count();
        assert!(moved > 5, "{moved} slots have moved");
    }
}

#[test]
fn a_free_bus() {
    assert_eq!(allocations(FREE, ""), 0);
}

#[test]
fn a_stepped_bus_with_its_program() {
    assert_eq!(allocations(STEPPED, ""), 0);
}

#[test]
fn a_free_bus_with_faults() {
    assert_eq!(allocations(FREE, FAULTS), 0);
}

#[test]
fn a_stepped_bus_with_faults() {
    assert_eq!(allocations(STEPPED, FAULTS), 0);
}

/// Every reflex of an axis; with a mirror the PLC's bits come back as feedback and vice versa.
const AXES: &str = "
[[axis]]\nname = \"A\"\ncommand_offset = 100\nfeedback_offset = 100\nacknowledge = true\ndiagnostics = true\n
command = [{ number = 1, position = 5.0 }, { number = 2, mode = \"speed\", speed = 1.0 }]\n
[[axis.switch]]\nname = \"up\"\nabove = 10.0\naddress = \"%IX140.0\"\n
[[axis.switch]]\nname = \"down\"\nbelow = 1.0\nhysteresis = 0.5\naddress = \"%IX140.1\"\n
";

#[test]
fn axes_with_all_their_reflexes() {
    assert_eq!(allocations(FREE, AXES), 0);
    assert_eq!(allocations(STEPPED, AXES), 0);
}

#[test]
fn a_link_whose_other_end_is_absent() {
    assert_eq!(allocations("kind = \"loopback\"\nlink = \"nobody\"", ""), 0);
}

/// With a ring that is never full, with one that is always full, and with one that waits for room.
#[test]
fn a_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = "kind = \"loopback\"\nlink = \"recorded\"";
    let program = "kind = \"loopback\"\nprogram = \"mirror\"\nscan = \"1ms\"\nmode = \"stepped\"";
    for (number, (fieldbus, ring)) in [(link, 16_384), (link, 4), (program, 64)]
        .into_iter()
        .enumerate()
    {
        for format in ["vcd", "csv"] {
            let file = folder.path().join(format!("{number}.{format}"));
            let file = file.display();
            let record = format!("[record]\nfile = '{file}'\nring = {ring}");
            assert_eq!(allocations(&format!("{fieldbus}\n{record}"), ""), 0);
        }
    }
}

#[test]
fn many_drivers_in_one_call() {
    let handles: Box<Handles<(Driver, Vec<Slot>)>> = Box::default();
    let open = |number: usize| {
        let fieldbus = [FREE, STEPPED][number % 2];
        let driver = Driver::open(config(fieldbus, ""), Manual::new()).expect("opens");
        let slots = driver.initial_slots();
        handles
            .reserve()
            .expect("a place is free")
            .fill("many", (driver, slots))
    };
    let list: Vec<i64> = (0..100).map(open).collect();
    let (mut before, mut failed) = (0, 0);
    for tick in 0..1_100_i32 {
        if tick == 100 {
            before = allocations_of_thread();
        }
        let exchange = |_, (driver, slots): &mut (Driver, Vec<Slot>)| {
            slots[..52].fill(Slot::from_real(f64::from(tick)));
            driver.exchange(Nanos::from_millis(tick.into()), slots).code
        };
        handles.tick_each(list.iter().copied(), exchange, |_, code| {
            failed += u32::from(code.code() < 0);
        });
    }
    assert_eq!((allocations_of_thread() - before, failed), (0, 0));
    handles.close_all(|(driver, _)| driver.close());
}

#[test]
fn the_counter_counts() {
    let before = allocations_of_thread();
    drop(std::hint::black_box(Box::new(1)));
    assert_eq!(allocations_of_thread() - before, 1);
}
