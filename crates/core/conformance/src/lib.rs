//! The tests that every bus must pass, written once and instantiated per bus by [`conformance!`].

#![allow(
    missing_docs,
    clippy::missing_panics_doc,
    clippy::float_cmp,
    reason = "tests: a name is the sentence that it proves, and the values are small whole numbers"
)]

pub mod peers;
pub mod resources;
pub mod rig;
pub mod standin;

use std::sync::atomic::{AtomicBool, Ordering};

use resources::Resources;
use rig::{Bus, End, MAX_AGE, Rig, await_that, config, eventually, pass};
use tickbus_base::time::{Manual, Monotonic, Nanos};
use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{Cause, LinkState};

pub fn opens_and_exchanges_both_ways(bus: &impl Bus) {
    let mut rig = Rig::new(bus);
    rig.connect();
    rig.controller.set("run", 1.0);
    rig.controller.set("speed", 1234.0);
    rig.device.set("position", -4321.0);
    rig.until("values arrive", |rig| {
        rig.device.tick();
        rig.controller.tick();
        rig.device.get("speed") == 1234.0
            && rig.device.get("run") == 1.0
            && rig.controller.get("position") == -4321.0
    });
}

/// Two values that are always written together must always arrive together.
pub fn exchanges_whole_images_only(bus: &impl Bus) {
    let mut rig = Rig::new(bus);
    rig.connect();
    let mut seen = 0.0;
    let mut value = 0.0;
    rig.until("500 images have gone by", |rig| {
        value += 1.0;
        rig.controller.set("speed", value);
        rig.controller.set("echo", value);
        rig.controller.tick();
        if rig.device.tick().code == Code::Fresh && rig.device.get("speed") >= 0.0 {
            let (speed, echo) = (rig.device.get("speed"), rig.device.get("echo"));
            assert_eq!(speed, echo, "a torn image");
            assert!(speed >= seen, "an image went back from {seen} to {speed}");
            seen = speed;
        }
        seen >= 500.0
    });
}

/// The pulse edges that one end has seen.
#[derive(Default)]
struct Pulse {
    /// The number of edges so far.
    edges: f64,
    was_high: bool,
    is_over: bool,
}

impl Pulse {
    /// Checks a signal after a tick.
    fn watch(&mut self, end: &End, signal: &str) {
        let is_high = end.get(signal) == 1.0;
        self.edges += end.edges(signal);
        self.was_high |= is_high;
        self.is_over = self.was_high && !is_high;
    }
}

/// Pulses of one tick arrive, with any ratio of tick to cycle: several ticks per cycle, or several cycles per
/// tick.
pub fn keeps_edges_both_ways(bus: &impl Bus) {
    for (ticks, cycles) in [(1, 1), (3, 1), (10, 1), (1, 3), (1, 10)] {
        let mut rig = Rig::new(bus);
        rig.connect();
        for pulse in 1..=20 {
            let (mut run, mut sensor) = (Pulse::default(), Pulse::default());
            // Every tick is watched: the bus threads may carry the pulse at once.
            let mut tick = |rig: &mut Rig| {
                rig.controller.tick();
                sensor.watch(&rig.controller, "sensor");
                rig.device.tick();
                run.watch(&rig.device, "run");
                run.is_over && sensor.is_over
            };
            for level in [1.0, 0.0] {
                rig.controller.set("run", level);
                rig.device.set("sensor", level);
                tick(&mut rig);
            }
            rig.until("the pulse is through and gone", |rig| {
                // One cycle has passed already.
                for _ in 1..cycles {
                    pass(&rig.clock, 2);
                }
                (0..ticks).fold(false, |_, _| tick(rig))
            });
            assert_eq!(
                (run.edges, sensor.edges),
                (1.0, 1.0),
                "pulse {pulse}, {ticks} ticks in {cycles} cycles"
            );
        }
    }
}

/// A simulation that receives, computes and sends: its answer is sent in the tick that received the question,
/// no pulse is lost, and age and watchdog work as in any other tick.
pub fn answers_within_the_tick(bus: &impl Bus) {
    let mut rig = Rig::with(bus, "watchdog = \"500ms\"");
    rig.connect();
    for value in [3.0, 4.0] {
        rig.controller.set("speed", value);
        rig.until("the question arrives", |rig| {
            rig.controller.tick();
            rig.device.receive();
            rig.device.get("speed") == value
        });
        rig.device.set("position", value);
        rig.device.send();
        let mut watched = 0;
        rig.until("the answer arrives without another tick", |rig| {
            rig.controller.tick();
            watched += 1;
            rig.controller.get("position") == value || watched == 400
        });
        assert_eq!(rig.controller.get("position"), value);
    }
    for _ in 0..10 {
        let (mut run, mut sensor) = (Pulse::default(), Pulse::default());
        for level in [1.0, 0.0] {
            rig.controller.set("run", level);
            rig.controller.tick();
            sensor.watch(&rig.controller, "sensor");
        }
        rig.until("the pulse is answered, and over", |rig| {
            rig.device.receive();
            run.watch(&rig.device, "run");
            rig.device.set("sensor", rig.device.get("run"));
            rig.device.send();
            rig.controller.tick();
            sensor.watch(&rig.controller, "sensor");
            run.is_over && sensor.is_over
        });
        assert_eq!((run.edges, sensor.edges), (1.0, 1.0));
    }
    rig.until(
        "the watchdog trips although the simulation receives",
        |rig| {
            rig.device.receive();
            rig.controller.tick();
            rig.controller.get("position") == 77.0
        },
    );
    let (clock, mut device) = rig.alone();
    await_that("the data are stale", || {
        pass(&clock, 1);
        let found = device.receive();
        assert_eq!(device.send().code, found.code);
        assert_eq!(found.code == Code::Stale, found.age > MAX_AGE);
        found.code == Code::Stale
    });
    assert_eq!(device.get("speed"), -1.0, "the fail-safe value");
}

/// A closing controller switches its outputs off, and sends the fail-safe values in time.
pub fn leaves_the_fail_safe_values_behind(bus: &impl Bus) {
    let clock = Monotonic::shared();
    let open = |role| {
        let text = config(bus, role, "events = true").replace("300ms", "20s");
        End::open(&text, &clock, bus.kinds())
    };
    let (mut device, mut controller) = (open("device"), open("controller"));
    controller.set("run", 1.0);
    controller.set("speed", 10.0);
    eventually("the machine runs", || {
        let has_met = controller.tick().code != Code::Stale;
        device.tick();
        (has_met && device.get("run") == 1.0 && device.get("speed") == 10.0).then_some(())
    });
    controller.driver.close();
    let mut events = vec![tickbus_image::Event::default(); 64];
    let mut last = [f64::NAN; 2];
    // Only received frames make events; a stale line makes none.
    eventually("the machine has the fail-safe values", || {
        let count = device.driver.poll_events(&mut events);
        for event in &events[..count] {
            if let Some(last) = last.get_mut(event.signal as usize) {
                *last = event.value.real();
            }
        }
        (last == [0.0, -1.0]).then_some(())
    });
}

/// A controller whose machine shows no sign of life sends fail-safe values until the machine is alive again.
pub fn sends_fail_safe_values_while_it_is_blind(bus: &impl Bus) {
    let alive = "alive = { signal = \"position\", within = \"100ms\" }";
    let clock = Manual::new();
    let mut rig = Rig {
        device: End::open(&config(bus, "device", ""), &clock, bus.kinds()),
        controller: End::open(&config(bus, "controller", alive), &clock, bus.kinds()),
        clock,
    };
    rig.controller.set("speed", 10.0);
    let mut position = 0.0;
    let mut gets = |rig: &mut Rig, moves: bool, speed: f64| {
        if moves {
            position = (position + 1.0) % 100.0;
        }
        rig.device.set("position", position);
        rig.controller.tick();
        rig.device.tick().code != Code::Stale && rig.device.get("speed") == speed
    };
    rig.until("the machine runs", |rig| gets(rig, true, 10.0));
    rig.until("the machine stops, since its sign of life does", |rig| {
        gets(rig, false, -1.0)
    });
    rig.until("it runs again", |rig| gets(rig, true, 10.0));
}

pub fn keeps_events_in_order(bus: &impl Bus) {
    let mut rig = Rig::with(bus, "events = true");
    rig.connect();
    let mut events = vec![tickbus_image::Event::default(); 64];
    rig.device.driver.poll_events(&mut events);
    for value in [5.0, 6.0, 7.0] {
        rig.send_speed(value);
    }
    let count = rig.device.driver.poll_events(&mut events);
    let values: Vec<_> = events[..count]
        .iter()
        .map(|event| (event.signal, event.value.real()))
        .collect();
    assert_eq!(values, [(1, 5.0), (1, 6.0), (1, 7.0)]);
    assert_eq!(rig.device.statistic("events_lost"), "0");
}

/// A silent peer makes the line stale and the values fail-safe; the line recovers. All of it runs on the injected
/// clock.
pub fn is_stale_without_its_peer_and_recovers(bus: &impl Bus) {
    let clock = Manual::new();
    let mut device = End::open(&config(bus, "device", ""), &clock, bus.kinds());
    let first = device.tick();
    assert_eq!(
        (first.code, first.age),
        (Code::Stale, Nanos::MAX),
        "before the first contact"
    );
    assert_eq!(
        device.get("speed"),
        -1.0,
        "fail-safe before the first contact"
    );
    assert_ne!(device.link().state, LinkState::Running);
    let mut rig = Rig::around(bus, clock, device);
    rig.send_speed(10.0);
    let link = rig.device.link();
    assert_eq!(
        (link.state, link.cause),
        (LinkState::Running, Cause::Running)
    );

    let (clock, mut device) = rig.alone();
    await_that("the device is stale", || {
        pass(&clock, 1);
        device.tick().code == Code::Stale
    });
    assert_eq!(device.get("speed"), -1.0, "fail-safe when stale");
    assert!(device.tick().age > MAX_AGE);
    await_that("the line says so, and why", || {
        pass(&clock, 1);
        device.tick();
        let link = device.link();
        link.state != LinkState::Running && link.cause != Cause::Running && !link.reason.is_empty()
    });

    // The line may run more than once. The clock of the test does not wait for a thread that has bytes to read but no
    // processor. On a busy machine a line may thus be silent for too long, and run again, although its peer is there.
    let runs = |device: &End| device.statistic("link.running").parse::<u32>();
    let before = runs(&device).expect("a count");
    assert_ne!(before, 0, "it ran");

    let mut rig = Rig::around(bus, clock, device);
    rig.send_speed(11.0);
    rig.until("the line runs", |rig| {
        rig.controller.tick();
        rig.device.tick();
        rig.device.link().state == LinkState::Running
    });
    let after = runs(&rig.device).expect("a count");
    assert!(after > before, "it runs anew: {after} after {before}");
}

/// The peer violates the protocol: the line reports the violation, uses none of the peer's data, and serves an honest
/// peer afterwards.
pub fn sees_through_a_peer_that_lies(bus: &impl Bus) {
    let clock = Manual::new();
    let liar = bus.liar(&clock);
    let mut device = End::open(&config(bus, "device", ""), &clock, bus.kinds());
    await_that("the device says what its peer did", || {
        pass(&clock, 1);
        device.tick();
        let link = device.link();
        assert_eq!(device.get("speed"), -1.0, "nothing was believed");
        link.cause.name() == liar.cause && link.reason.contains(liar.words)
    });
    drop(liar);
    Rig::around(bus, clock, device);
}

/// When the simulation stops ticking, the PLC gets the fail-safe values; when it ticks again, the true ones.
pub fn the_watchdog_bites_when_the_simulation_stops(bus: &impl Bus) {
    let mut rig = Rig::with(bus, "watchdog = \"50ms\"");
    rig.connect();
    rig.device.set("position", 5.0);
    rig.until("the value arrives", |rig| {
        rig.device.tick();
        rig.controller.tick();
        rig.controller.get("position") == 5.0
    });
    rig.until("the fail-safe value arrives", |rig| {
        rig.controller.tick();
        rig.controller.get("position") == 77.0
    });
    rig.until("the true value arrives again", |rig| {
        rig.device.tick();
        rig.controller.tick();
        rig.controller.get("position") == 5.0
    });
}

/// Peers die and return 200 times: each is served, and no resources accumulate.
///
/// Resources are counted, so this runs in a separate process: `test` is the calling test's name.
pub fn survives_200_peers(bus: &impl Bus, test: &str) {
    const LIVES: u32 = 200;
    const WARM_UP: u32 = 20;
    if !resources::alone(test) {
        return;
    }
    let clock = Manual::new();
    let mut device = End::open(&config(bus, "device", ""), &clock, bus.kinds());
    let mut before = None;
    for life in 1..=WARM_UP + LIVES {
        let mut controller = End::open(&config(bus, "controller", ""), &clock, bus.kinds());
        await_that("the next peer's value arrives", || {
            pass(&clock, 2);
            controller.set("speed", f64::from(life));
            controller.tick();
            device.tick();
            device.get("speed") == f64::from(life)
        });
        controller.driver.close();
        if life == WARM_UP || life == WARM_UP + LIVES {
            await_that("the device has noticed", || {
                pass(&clock, 1);
                device.tick();
                device.link().state != LinkState::Running
            });
        }
        if life == WARM_UP {
            before = Some(Resources::settled(|| pass(&clock, 1)));
        }
    }
    let after = Resources::settled(|| pass(&clock, 1));
    println!("before {before:?}, after {after:?}");
    assert_eq!(before, Some(after), "something piles up");
}

/// Closing during traffic waits for no deadline and no peer.
pub fn closes_while_busy(bus: &impl Bus) {
    for first in ["device", "controller"] {
        let mut rig = Rig::new(bus);
        rig.connect();
        let Rig {
            clock,
            device,
            controller,
        } = rig;
        let (closing, mut staying) = if first == "device" {
            (device, controller)
        } else {
            (controller, device)
        };
        let over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    pass(&clock, 2);
                }
            });
            scope.spawn(|| {
                closing.driver.close();
                over.store(true, Ordering::Relaxed);
            });
            while !over.load(Ordering::Relaxed) {
                staying.tick();
            }
        });
    }
}

/// Mistakes in the bus's own table are reported with their line and the remedy.
pub fn refuses_bad_configuration(bus: &impl Bus) {
    let wrong = bus.wrong();
    assert!(!wrong.is_empty());
    for (table, word) in wrong {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\n{table}\n\
             [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n"
        );
        let told = match Config::parse("driver.cfg", &text, bus.kinds()) {
            Err(mistakes) => mistakes.to_string(),
            Ok(config) => match Driver::open(config, Manual::new()) {
                Ok(_) => panic!("nothing was wrong with {table}"),
                Err(error) => error.to_string(),
            },
        };
        let shaped = told.starts_with("driver.cfg:") && told.contains("; ");
        assert!(shaped && told.contains(word), "{table}\n{told}");
    }
}

pub fn opens_closes_and_opens_again(bus: &impl Bus) {
    for _ in 0..3 {
        let mut rig = Rig::new(bus);
        rig.connect();
        rig.controller.driver.close();
        rig.device.driver.close();
    }
}

pub fn keeps_several_instances_apart(bus: &impl Bus, other: &impl Bus) {
    let (mut one, mut two) = (Rig::new(bus), Rig::new(other));
    one.connect();
    two.connect();
    for (rig, speed) in [(&mut one, 1.0), (&mut two, 2.0)] {
        rig.send_speed(speed);
    }
}

/// Each end uses a signal of the other end to detect whether that end works. The PLC watches a heartbeat of the
/// simulation.
pub fn is_stale_while_a_signal_that_has_to_change_does_not(bus: &impl Bus) {
    let within = "within = \"100ms\"";
    let watched = format!(
        "alive = {{ signal = \"speed\", {within} }}\nheartbeat = {{ signal = \"copy\", every = \"10ms\" }}"
    );
    let watches = format!("alive = {{ signal = \"copy\", {within} }}");
    let clock = Manual::new();
    let mut rig = Rig {
        device: End::open(&config(bus, "device", &watched), &clock, bus.kinds()),
        controller: End::open(&config(bus, "controller", &watches), &clock, bus.kinds()),
        clock,
    };
    let mut speed = 0.0;
    let mut change = |rig: &mut Rig| {
        speed = (speed + 1.0) % 100.0;
        rig.controller.set("speed", speed);
    };
    let is_good = |rig: &mut Rig| {
        let codes = [rig.controller.tick().code, rig.device.tick().code];
        codes.iter().all(|code| *code != Code::Stale)
    };
    rig.until("what changes is fresh at both ends", |rig| {
        change(rig);
        is_good(rig)
    });
    let frozen = |end: &End| end.statistic("cause") == "frozen";
    rig.until("a signal that stands still makes the device stale", |rig| {
        rig.controller.tick();
        rig.device.tick().code == Code::Stale && frozen(&rig.device)
    });
    assert_eq!(rig.device.get("speed"), -1.0, "its fail-safe value");
    assert!(rig.device.statistic("reason").contains("\"speed\""));
    // The data need not become fresh at once: if a program in between has its own time, the heartbeat may be late by
    // more than 100 ms of this clock.
    rig.until("the heartbeat goes on", |rig| {
        rig.controller.tick();
        rig.device.tick();
        !frozen(&rig.controller)
    });
    rig.until("it is fresh as soon as the signal changes", |rig| {
        change(rig);
        is_good(rig)
    });
    rig.until("a simulation that does not tick has no heartbeat", |rig| {
        change(rig);
        rig.controller.tick().code == Code::Stale && frozen(&rig.controller)
    });
    rig.until("it ticks again", |rig| {
        change(rig);
        is_good(rig)
    });
}

/// Closing ends every thread even if the clock does not advance.
pub fn closes_while_its_peer_is_silent(bus: &impl Bus) {
    let clock = Manual::new();
    let config =
        Config::parse("driver.cfg", &config(bus, "device", ""), bus.kinds()).expect("a right file");
    Driver::open(config, clock).expect("opens").close();
}

/// Instantiates the suite, given a name and an expression that makes a new bus.
#[macro_export]
macro_rules! conformance {
    ($name:ident, $bus:expr) => {
        mod $name {
            $crate::conformance!(@tests $bus;
                opens_and_exchanges_both_ways exchanges_whole_images_only keeps_edges_both_ways
                answers_within_the_tick keeps_events_in_order is_stale_without_its_peer_and_recovers
                the_watchdog_bites_when_the_simulation_stops sees_through_a_peer_that_lies
                leaves_the_fail_safe_values_behind sends_fail_safe_values_while_it_is_blind opens_closes_and_opens_again closes_while_its_peer_is_silent closes_while_busy
                refuses_bad_configuration is_stale_while_a_signal_that_has_to_change_does_not
            );

            #[test]
            fn keeps_several_instances_apart() {
                $crate::keeps_several_instances_apart(&$bus, &$bus);
            }

            #[test]
            fn survives_200_peers() {
                let test = concat!(module_path!(), "::survives_200_peers");
                $crate::survives_200_peers(&$bus, test);
            }
        }
    };
    (@tests $bus:expr; $($test:ident)*) => {
        $(
            #[test]
            fn $test() {
                $crate::$test(&$bus);
            }
        )*
    };
}
