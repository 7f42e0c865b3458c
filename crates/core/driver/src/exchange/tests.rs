use super::*;
use crate::frames::directions;
use std::sync::Arc;
use std::time::Duration;
use tickbus_base::time::{Clock, Manual, Stop};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::loopback::End;
use tickbus_fieldbus::{LinkStatus, Port, Role};
use tickbus_image::{TickEnd, image};

/// A driver on a free loopback; the test drives the other end by hand.
struct Rig {
    driver: Driver,
    clock: Arc<Manual>,
    slots: Vec<Slot>,
    peer: (TickEnd, Port, End),
}

impl Rig {
    fn new(link: &str) -> Self {
        let mut text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"{link}\"\n\
             cycle = \"1ms\"\nmax_age = \"20ms\"\n"
        );
        for (area, bit) in ["I", "Q"]
            .map(|area| (0..16).map(move |bit| (area, bit)))
            .into_iter()
            .flatten()
        {
            let place = format!("{area}X{}.{}", bit / 8, bit % 8);
            let signal = format!("name = \"{place}\"\naddress = \"%{place}\"");
            text.extend(["[[signal]]\n", &signal, "\nlatch = \"both\"\n"]);
        }
        let config =
            Config::parse("driver.cfg", &text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
        let clock = Manual::new();
        let shared = || Arc::clone(&clock) as Arc<dyn Clock>;
        let (tick, bus) = image(directions(&config.table, Role::Controller));
        let status = LinkStatus::new("peer", config.timing.max_age);
        let port = Port::new(bus, shared(), Role::Controller, None, status);
        let end = End::join(link, &port).expect("its place is free");
        let driver = Driver::open(config, shared()).expect("opens");
        let slots = driver.initial_slots();
        Self {
            driver,
            clock,
            slots,
            peer: (tick, port, end),
        }
    }

    /// Lets `pause` pass while the other end sends `sent`, if anything; waits until the bus has nothing left to do.
    fn pass(&mut self, pause: Nanos, sent: Option<u8>) {
        let now = self.clock.now();
        let (tick, port, end) = &mut self.peer;
        if let Some(sent) = sent {
            tick.write(now, |_, bytes| bytes.copy_from_slice(&[sent, !sent]));
            end.cycle(now, port);
        }
        self.clock.advance(pause);
        while !self.clock.is_settled(1) {
            std::thread::yield_now();
        }
    }

    /// Returns what the other end received last: the bytes, and the number of edges of all signals.
    fn arrived(&mut self) -> (Vec<u8>, Vec<u32>) {
        let (tick, ..) = &mut self.peer;
        tick.update();
        let mut edges = Vec::new();
        tick.edges(0, |_, count| edges.push(count));
        (tick.latest(0).to_vec(), edges)
    }
}

/// A clock that is 1 ms later at each look.
#[derive(Debug)]
struct Looked(Arc<Manual>);

impl Clock for Looked {
    fn now(&self) -> Nanos {
        self.0.advance(Nanos::from_millis(1));
        self.0.now()
    }

    fn wait_until(&self, deadline: Nanos, stop: &Stop) {
        self.0.wait_until(deadline, stop);
    }

    fn wait_with(&self, deadline: Nanos, stop: &Stop, sleep: &mut dyn FnMut(Option<Duration>)) {
        self.0.wait_with(deadline, stop, sleep);
    }
}

#[test]
fn the_time_of_a_whole_tick_is_measured_also_in_halves() {
    for halves in [false, true] {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"timed {halves}\"\n\
             [[signal]]\nname = \"a\"\naddress = \"%IB0\"\n"
        );
        let config =
            Config::parse("driver.cfg", &text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
        let clock = Arc::new(Looked(Manual::new()));
        let mut driver = Driver::open(config, clock).expect("opens");
        let mut slots = driver.initial_slots();
        for _ in 0..1_000 {
            if halves {
                driver.receive(None, &mut slots);
                driver.send(&mut slots);
            } else {
                driver.exchange(None, &mut slots);
            }
        }
        let shortest = driver.statistics().lines().find_map(|line| {
            let text = line.strip_prefix("exchange.min_us=")?;
            text.parse::<f64>().ok()
        });
        // The bus thread looks at the clock, too, but not during each tick.
        let expected = if halves { 2_000.0 } else { 1_000.0 };
        assert_eq!(shortest, Some(expected), "in halves: {halves}");
    }
}

#[test]
fn a_time_that_is_refused_is_not_the_one_before_which_no_other_counts() {
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\n\
                program = \"mirror\"\nscan = \"1ms\"\n[[signal]]\nname = \"a\"\naddress = \"%IB0\"\n";
    let config =
        Config::parse("driver.cfg", text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
    let mut driver = Driver::open(config, Manual::new()).expect("opens");
    let mut slots = driver.initial_slots();
    let mut codes = [3, 1_000_000_000_000, 4, 5].map(|millis| {
        let time = Nanos::from_millis(millis);
        driver.exchange(time, &mut slots).code
    });
    assert_eq!(codes[1], Code::BusFailed);
    codes[1] = Code::Fresh;
    assert_eq!(codes, [Code::Fresh; 4]);
}

#[test]
fn an_exchange_with_nothing_else_to_do_comes_to_the_same_as_any_other() {
    let mut rigs = ["exchanges simply", "exchanges otherwise"].map(Rig::new);
    // Per kind of call, how often each status was found.
    let (mut codes, mut random) = ([[0; 3]; 3], 1_u64);
    for step in 0..1_000 {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let draw =
            |shift: u32, below: u64| usize::try_from((random >> shift) % below).expect("small");
        let (bit, level) = (draw(20, 16), [0.0, 1.0, 1.0, f64::NAN][draw(24, 4)]);
        // Without a time before the first given one, and in some ticks after it.
        let time = (step >= 200 && draw(28, 4) != 0).then_some(Nanos::from_millis(step));
        // Sometimes longer than data stay valid.
        let pause = Nanos::from_millis([0, 0, 1, 1, 1, 30][draw(30, 6)]);
        let sent = (draw(34, 2) == 0).then_some(draw(36, 256).to_le_bytes()[0]);
        let (is_halved, answers) = (draw(44, 3) != 0, draw(47, 3));
        let seen = [0, 1].map(|index| {
            let rig = &mut rigs[index];
            rig.pass(pause, sent);
            let arrived = rig.arrived();
            let Rig { driver, slots, .. } = rig;
            let is_plain = step == 0 || driver.shape == Shape::Plain;
            assert!(is_plain || index == 1, "else nothing is compared");
            if index == 1 {
                driver.shape = Shape::Extended;
            }
            slots[bit] = Slot::from_real(level);
            let found = if is_halved {
                let received = driver.receive(time, slots);
                // Further answers in the same tick send other values.
                let sent = (0..answers).map(|_| {
                    slots[bit] = Slot::from_real(1.0 - slots[bit].real());
                    driver.send(slots)
                });
                sent.last().unwrap_or(received)
            } else {
                driver.exchange(time, slots)
            };
            let slots: Vec<_> = slots.iter().map(|slot| slot.0).collect();
            (found, slots, arrived)
        });
        assert_eq!(seen[0], seen[1], "step {step}");
        let [one, other] = [0, 1].map(|index: usize| rigs[index].driver.counters);
        assert_eq!(one, other, "step {step}");
        let open = u64::from(is_halved && answers == 0);
        assert_eq!(
            one.fresh + one.unchanged + one.stale + open,
            one.ticks,
            "each tick is counted when it ends"
        );
        let kind = if is_halved { answers.min(1) } else { 2 };
        codes[kind][usize::try_from(seen[0].0.code.code()).expect("no error")] += 1;
    }
    assert!(
        codes.as_flattened().iter().all(|count| *count > 20),
        "all kinds of ticks: {codes:?}"
    );
    // The bus thread decides when to look at its line.
    let is_of_ticks = |line: &&str| {
        !["link.", "cause", "state", "reason", "log."]
            .iter()
            .any(|start| line.starts_with(start))
    };
    let [one, other] = rigs.map(|rig| {
        let all = rig.driver.statistics();
        all.lines()
            .filter(is_of_ticks)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    });
    assert_eq!(one, other);
    assert!(one.contains(&"ticks=1000".to_owned()), "{one:?}");
    assert!(one.iter().any(|line| line.starts_with("age")), "{one:?}");
}

#[test]
fn a_send_that_fails_does_not_forbid_the_next_one() {
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\n\
                link = \"a send that fails\"\n[[signal]]\nname = \"a\"\naddress = \"%IB0\"\n";
    let open = || {
        let config =
            Config::parse("driver.cfg", text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
        Driver::open(config, Manual::new()).expect("opens")
    };
    let (mut first, mut second) = (open(), open());
    let mut slots = second.initial_slots();
    assert_ne!(first.exchange(Nanos(1), &mut slots).code, Code::BusFailed);
    let found = second.send(&mut slots).code;
    assert_eq!(found, Code::BusFailed, "its place on the link is taken");
    first.close();
    assert_ne!(second.send(&mut slots).code, Code::BusFailed);
}
