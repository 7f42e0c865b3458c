//! The loopback: the conformance suite, and specific tests.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use tickbus_conformance as conformance;
use tickbus_conformance::conformance;

use conformance::rig::{Bus, End, Liar, Rig, await_that, config};
use tickbus::driver::Code;
use tickbus::time::{Clock as _, Manual, Monotonic, Nanos};

/// A link name used by one test only.
struct Link(String);

impl Link {
    fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        Self(format!("test-{}", NEXT.fetch_add(1, Ordering::Relaxed)))
    }
}

impl Bus for Link {
    fn kinds(&self) -> &'static tickbus::driver_cfg::Kinds {
        &tickbus::KINDS
    }

    fn fieldbus(&self, _role: &str) -> String {
        format!("kind = \"loopback\"\nlink = \"{}\"", self.0)
    }

    /// A controller whose image has another size.
    fn liar(&self, clock: &Arc<Manual>) -> Liar {
        let longer = "[[signal]]\nname = \"more\"\naddress = \"%QD8\"\n";
        let controller = End::open(
            &(config(self, "controller", "") + longer),
            clock,
            &tickbus::KINDS,
        );
        await_that("it is on the link", || {
            controller.statistic("reason").contains("waiting")
        });
        Liar {
            peer: Box::new(controller),
            cause: "refused",
            words: "this end sends and receives [(6, 6)] bytes per station, the other end expects [(6, 12)]",
        }
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("kind = \"loopback\"", "program = \"rig\""),
            ("kind = \"loopback\"\nlink = \"\"", "name the link"),
            ("kind = \"loopback\"\nlnik = \"a\"", "link"),
            (
                "kind = \"loopback\"\nlink = \"a\"\nmode = \"fast\"",
                "modes are free, stepped",
            ),
            (
                "kind = \"loopback\"\nprogram = \"rig\"",
                "complete the signal table",
            ),
        ]
    }
}

conformance!(free, crate::loopback::Link::new());

/// A link with faults that never begin.
struct Spared(Link);

impl Bus for Spared {
    fn kinds(&self) -> &'static tickbus::driver_cfg::Kinds {
        &tickbus::KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        self.0.fieldbus(role)
    }

    fn liar(&self, clock: &Arc<Manual>) -> Liar {
        self.0.liar(clock)
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        self.0.wrong()
    }

    fn faults(&self) -> &'static str {
        "[[fault]]\nkind = \"link-down\"\nat = \"1000h\"\n\
         [[fault]]\nkind = \"delay\"\nby = \"1s\"\nat = \"1000h\"\n\
         [[fault]]\nkind = \"values-late\"\nby = \"1s\"\nat = \"1000h\"\n\
         [[fault]]\nkind = \"drop\"\nchance = 1\nat = \"1000h\"\n\
         [[fault]]\nkind = \"stuck\"\nsignal = \"speed\"\nvalue = 9\nat = \"1000h\"\n"
    }
}

conformance!(
    with_faults_that_never_begin,
    crate::loopback::Spared(crate::loopback::Link::new())
);

#[test]
fn a_second_device_on_one_link_is_told_so() {
    let (link, clock) = (Link::new(), Manual::new());
    let first = End::open(&config(&link, "device", ""), &clock, &tickbus::KINDS);
    await_that("the first is on the link", || {
        first.statistic("reason").contains("waiting")
    });
    let mut second = End::open(&config(&link, "device", ""), &clock, &tickbus::KINDS);
    await_that("the second is told", || {
        second.statistic("reason").contains("already has a device")
    });
    assert_eq!(second.tick().code, Code::Stale);
    first.driver.close();
    await_that("the second takes the place", || {
        clock.advance(Nanos::from_millis(1));
        second.statistic("reason").contains("waiting")
    });
}

#[test]
fn stepped_ends_exchange_on_their_own_ticks() {
    let mut rig = Rig::with(&Link::new(), "mode = \"stepped\"");
    assert_eq!(rig.device.tick().code, Code::Stale);
    rig.controller.set("speed", 3.0);
    rig.controller.tick();
    assert_eq!(rig.device.tick().code, Code::Fresh);
    assert_eq!(rig.device.get("speed"), 3.0);
    assert_eq!(rig.device.tick().code, Code::Unchanged);
    rig.device.set("position", 4.0);
    rig.device.tick();
    rig.controller.tick();
    assert_eq!(rig.controller.get("position"), 4.0);
}

#[test]
fn what_a_former_peer_left_is_not_news_to_the_next() {
    let (link, clock) = (Link::new(), Manual::new());
    let open = |role| {
        End::open(
            &config(&link, role, "mode = \"stepped\""),
            &clock,
            &tickbus::KINDS,
        )
    };
    let (mut device, mut controller) = (open("device"), open("controller"));
    for _ in 0..2 {
        device.tick();
        controller.tick();
    }
    device.set("position", 4.0);
    device.tick();
    controller.driver.close();
    device.tick();
    let mut next = open("controller");
    assert_eq!(next.tick().code, Code::Stale, "the device has not ticked");
    device.tick();
    assert_eq!(next.tick().code, Code::Fresh);
    assert_eq!(next.get("position"), 4.0);
}

/// A hosted program behind the link, scanned by the tick.
fn mirror(mode: &str, clock: &Arc<Manual>) -> End {
    let fieldbus = format!(
        "kind = \"loopback\"\nprogram = \"mirror\"\nscan = \"10ms\"\ncycle = \"1ms\"\nmode = \"{mode}\"",
    );
    let text = format!(
        "[driver]\nid = 1\nname = \"mirror\"\n[fieldbus]\n{fieldbus}\n\
         [[signal]]\nname = \"out\"\naddress = \"%QX0.0\"\nlatch = \"rising\"\n\
         [[signal]]\nname = \"in\"\naddress = \"%IX0.0\"\nlatch = \"rising\"\n",
    );
    End::open(&text, clock, &tickbus::KINDS)
}

#[test]
fn a_stepped_program_scans_on_simulation_time() {
    let mut end = mirror("stepped", &Manual::new());
    let mut seen = String::new();
    for tick in 0..30 {
        // A pulse of one tick, between two scans.
        end.set("in", if tick == 13 { 1.0 } else { 0.0 });
        let exchange = end
            .driver
            .exchange(Nanos::from_millis(tick), &mut end.slots);
        assert_eq!(exchange.code, Code::Fresh);
        assert_eq!(exchange.granted, Nanos::from_millis((tick / 10 + 1) * 10));
        seen.push(if end.get("out") == 1.0 { '1' } else { '0' });
    }
    assert_eq!(
        seen, "000000000000000000001111111111",
        "held until a scan has seen it"
    );
    assert_eq!(end.statistic("plc.scans"), "3");
    assert_eq!(end.statistic("plc.rises.in"), "1");
    assert_eq!(end.statistic("plc.rises.out"), "1");
}

#[test]
fn a_free_program_scans_on_the_clock() {
    let clock = Manual::new();
    let mut end = mirror("free", &clock);
    for pulses in 1..=5_u32 {
        end.set("in", 1.0);
        end.tick();
        end.set("in", 0.0);
        end.tick();
        let mut edges = 0.0;
        await_that("the pulse comes back and goes", || {
            clock.advance(Nanos::from_millis(1));
            end.tick();
            edges += end.edges("out");
            edges > 0.0 && end.get("out") == 0.0
        });
        assert_eq!(end.statistic("plc.rises.in"), pulses.to_string());
        assert_eq!(end.statistic("plc.rises.out"), pulses.to_string());
    }
}

#[test]
fn a_jump_of_simulation_time_is_refused_and_the_next_tick_goes_on() {
    let mut end = mirror("stepped", &Manual::new());
    end.tick();
    let jumped = end.driver.exchange(Nanos::MAX, &mut end.slots);
    assert_eq!(jumped.code, Code::BusFailed);
    assert!(end.statistic("reason").contains("simulation time jumped"));
    let mut end = mirror("stepped", &Manual::new());
    end.tick();
    end.driver.exchange(Nanos::from_secs(2_000), &mut end.slots);
    let after = end.driver.exchange(Nanos::from_secs(2_001), &mut end.slots);
    assert_eq!(after.code, Code::Fresh);
}

#[test]
fn simulation_time_that_goes_back_is_refused_and_goes_on_from_where_it_was() {
    let mut end = mirror("stepped", &Manual::new());
    for tick in 0..1_000 {
        let time = Nanos::from_millis(10 * tick);
        assert_eq!(end.driver.exchange(time, &mut end.slots).code, Code::Fresh);
    }
    for half in [false, true] {
        let begun_anew = if half {
            end.driver.receive(Nanos::ZERO, &mut end.slots)
        } else {
            end.driver.exchange(Nanos::ZERO, &mut end.slots)
        };
        assert_eq!(begun_anew.code, Code::BusFailed);
        assert_eq!(begun_anew.granted, Nanos::from_millis(9_990));
    }
    let reason = end.statistic("reason");
    assert!(
        reason.contains("went back from 9990ms to 0s")
            && reason.contains("reset the driver when it begins again"),
        "{reason}"
    );
    assert_eq!(end.statistic("cause"), "refused");
    assert_eq!(end.statistic("plc.scans"), "1000");
    let on = Nanos::from_secs(10);
    assert_eq!(end.driver.exchange(on, &mut end.slots).code, Code::Fresh);
    assert_eq!(end.statistic("plc.scans"), "1001");
    assert_eq!(end.statistic("state"), "running");
}

#[test]
fn at_the_end_of_all_time_every_exchange_still_returns() {
    let mut end = mirror("stepped", &Manual::new());
    let exchange = |end: &mut End| end.driver.exchange(Nanos::MAX, &mut end.slots);
    end.tick();
    assert_eq!(exchange(&mut end).code, Code::BusFailed, "a jump");
    for _ in 0..3 {
        assert_eq!(exchange(&mut end).code, Code::Fresh);
    }
    assert_eq!(end.statistic("plc.scans"), "4");
}

#[test]
fn without_simulation_time_a_stepped_program_is_scanned_once_in_each_tick() {
    let mut end = mirror("stepped", &Manual::new());
    for tick in 1..=5 {
        assert_eq!(end.tick().granted, Nanos::from_millis(10 * tick));
    }
    assert_eq!(end.statistic("plc.scans"), "5");
    // Once a time was set, it is kept.
    end.driver.exchange(Nanos::from_millis(60), &mut end.slots);
    end.tick();
    assert_eq!(end.statistic("plc.scans"), "7");
}

#[test]
fn a_stepped_program_scans_between_two_ticks_of_halves() {
    let mut end = mirror("stepped", &Manual::new());
    let (mut seen, mut edges) = (String::new(), 0.0);
    for tick in 0..30 {
        let found = end.driver.receive(Nanos::from_millis(tick), &mut end.slots);
        assert_eq!((found.code, found.age), (Code::Fresh, Nanos::ZERO));
        assert_eq!(found.granted, Nanos::from_millis((tick / 10 + 1) * 10));
        edges += end.edges("out");
        seen.push(if end.get("out") == 1.0 { '1' } else { '0' });
        // A pulse of one tick, between two scans.
        end.set("in", if tick == 13 { 1.0 } else { 0.0 });
        assert_eq!(end.send(), found);
    }
    assert_eq!(seen, "000000000000000000001111111111");
    assert_eq!(edges, 1.0);
    assert_eq!(end.statistic("plc.scans"), "3");
    assert_eq!(end.statistic("ticks"), "30");
}

#[test]
fn a_machine_that_steps_in_large_steps_is_there_all_along() {
    let mut end = mirror("stepped", &Manual::new());
    for tick in 0..5 {
        end.driver.receive(Nanos::from_secs(tick), &mut end.slots);
        end.set("in", 1.0);
        end.send();
    }
    assert_eq!(end.get("out"), 1.0);
    // Before the first data there was nothing to see.
    assert_eq!(end.statistic("plc.stale"), "1");
    assert_eq!(end.statistic("plc.scans"), "401");
}

#[test]
fn stepped_ends_of_halves_see_each_other_within_the_tick() {
    let mut rig = Rig::with(&Link::new(), "mode = \"stepped\"");
    rig.device.send();
    rig.controller.set("speed", 3.0);
    rig.controller.tick();
    assert_eq!(rig.device.receive().code, Code::Fresh);
    assert_eq!(rig.device.get("speed"), 3.0);
    rig.device.set("position", 3.0);
    rig.device.send();
    rig.controller.tick();
    assert_eq!(rig.controller.get("position"), 3.0);
}

#[test]
fn where_receive_failed_no_send_of_that_tick_sends() {
    let mut rig = Rig::with(&Link::new(), "mode = \"stepped\"");
    let device = &mut rig.device;
    let mut tick = |millis, position| {
        let found = device
            .driver
            .receive(Nanos::from_millis(millis), &mut device.slots);
        device.set("position", position);
        assert_eq!(device.send().code, found.code);
        assert_eq!(device.send().code, found.code);
        rig.controller.tick();
        (found.code, rig.controller.get("position"))
    };
    tick(5, 3.0);
    assert_eq!(tick(10, 3.0).1, 3.0);
    assert_eq!(tick(0, 4.0), (Code::BusFailed, 3.0));
    assert_eq!(tick(20, 5.0).1, 5.0);
}

#[test]
fn a_tick_is_a_receive_and_the_first_send_after_it() {
    let mut end = mirror("stepped", &Manual::new());
    assert_eq!(end.send().code, Code::Stale, "nothing was received yet");
    assert_eq!(end.statistic("ticks"), "0");
    end.receive();
    end.send();
    end.send();
    assert_eq!(end.statistic("ticks"), "1");
    end.receive();
    end.receive();
    end.send();
    end.tick();
    assert_eq!(end.statistic("ticks"), "4");
    assert_eq!(end.statistic("fresh"), "4");
}

/// The clock is read in the tick itself. A time kept in memory by another thread would lag by as long as that
/// thread is not scheduled.
#[test]
fn age_is_never_understated_however_busy_the_machine_is() {
    let (link, clock) = (Link::new(), Monotonic::shared());
    let mut device = End::open(&config(&link, "device", ""), &clock, &tickbus::KINDS);
    let mut controller = End::open(&config(&link, "controller", ""), &clock, &tickbus::KINDS);
    await_that("the peer was there", || {
        controller.tick();
        device.tick().code == Code::Fresh
    });
    controller.driver.close();
    let link_is_lost = || device.statistic("cause") == "left";
    await_that("it is gone", link_is_lost);
    // The latest time at which it was last heard from.
    let first = device.tick();
    let heard = clock.now() - first.age;
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        for _ in 0..2_000 {
            let before = clock.now();
            let age = device.tick().age;
            assert!(before - heard <= age, "{before} {heard} {age}");
        }
        over.store(true, Ordering::Relaxed);
    });
}
