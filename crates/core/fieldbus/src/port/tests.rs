//! A port whose line has faults, against a model of the line.

use std::collections::VecDeque;

use tickbus_base::statistics::Statistics;
use tickbus_base::time::Manual;
use tickbus_image::signal::{Area, Latch, SignalTable};
use tickbus_image::{
    Counted, LatchedBit, StationStreams, Swallowed, TickEnd, image, image_counting,
};

use super::*;
use crate::faults::{Begin, Direction, Effect, Fault, Faults, Lasts, LineEffect, Slots, TickTime};

const STATIONS: usize = 2;
const MAX_AGE: i64 = 40;

/// The numbers of a generator of Knuth's.
struct Random(u64);

impl Random {
    fn below(&mut self, below: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % below
    }

    /// Up to 24 ns.
    fn pause(&mut self) -> i64 {
        i64::try_from(self.below(5) * self.below(7)).expect("small")
    }

    fn station(&mut self) -> usize {
        usize::try_from(self.below(2)).expect("small")
    }
}

/// Both ends of an image of stations with one byte each way, and the tick side of the line's faults.
struct Rig {
    tick: TickEnd,
    port: Port,
    faults: Faults,
    ticks: u64,
}

impl Rig {
    fn new() -> Self {
        let station = || StationStreams {
            tx_fail_safe: Box::new([0]),
            tx_latched: Box::new([LatchedBit {
                signal: 0,
                byte: 0,
                mask: 1,
                latch: Latch::Rising,
                hold: Nanos::ZERO,
            }]),
            tx_counted: Box::default(),
            rx_counted: Box::default(),
            rx_fail_safe: Box::new([0]),
            rx_latched: Box::new([]),
        };
        let (tick, bus) = image((0..STATIONS).map(|_| station()).collect());
        let board = Arc::<FaultBoard>::default();
        let status = LinkStatus::new("test", Nanos(MAX_AGE));
        let port = Port::new(bus, Manual::new(), Role::Device, None, status);
        Self {
            tick,
            port: port.with_faults(Arc::clone(&board)),
            faults: Faults::new(board),
            ticks: 0,
        }
    }

    fn inject(&mut self, effect: LineEffect) -> u32 {
        let id = self.add(effect);
        self.begin_tick();
        id
    }

    /// A fault that begins with the next tick.
    fn add(&mut self, effect: LineEffect) -> u32 {
        let fault = Fault {
            name: "x".to_owned(),
            effect: Effect::Line(effect),
            begin: Begin::AtOnce,
            lasts: Lasts::UntilEnded,
            times: 1,
            seed: 1,
        };
        let slots = Slots {
            table: &SignalTable::default(),
            writes: Area::Input,
            edges: &[],
        };
        self.faults.add(&fault, slots).expect("there is room")
    }

    fn end(&mut self, id: u32) {
        assert!(self.faults.end(id));
        self.begin_tick();
    }

    fn begin_tick(&mut self) {
        self.ticks += 1;
        let moment = TickTime {
            time: Nanos::ZERO,
            tick: self.ticks,
        };
        self.faults.begin_tick(moment, &mut []);
    }
}

#[test]
fn only_stations_whose_peer_is_gone_stop_counting_what_is_swallowed() {
    let swallowed = Swallowed::new(STATIONS);
    let streams = (0..STATIONS).map(|signal| StationStreams {
        tx_fail_safe: Box::new([0]),
        tx_latched: Box::default(),
        tx_counted: Box::new([Counted { signal, bits: 0..1 }]),
        rx_counted: Box::default(),
        rx_fail_safe: Box::new([0]),
        rx_latched: Box::default(),
    });
    let (mut tick, bus) = image_counting(streams.collect(), 0, &swallowed);
    let status = LinkStatus::new("test", Nanos(MAX_AGE));
    let mut port = Port::new(bus, Manual::new(), Role::Device, None, status);
    let now = Nanos(1);
    let mut counted = |port: &mut Port, takes: bool| {
        for level in [1, 0] {
            tick.write(now, |_, bytes| bytes[0] = level);
        }
        if takes {
            let mut frames = port.take_all(now).expect("the line is up");
            for station in 0..STATIONS {
                assert_eq!(frames.frame(station), [0]);
            }
            let receipt = frames.receipt();
            port.sent(&receipt);
        }
        [0, 1].map(|station| swallowed.of(station))
    };
    assert_eq!(counted(&mut port, true), [0, 0]);
    assert_eq!(counted(&mut port, false), [1, 1]);
    let gone = BusError::Link("gone".to_owned());
    port.lost_of(1..2, &gone, "waiting");
    assert_eq!(counted(&mut port, false), [2, 1]);
    port.opening_of(0..0, "the other one is missing");
    assert_eq!(counted(&mut port, true), [3, 1]);
    assert_eq!(counted(&mut port, false), [4, 2]);
    port.station_left(0, now, Cause::Left, "released");
    assert_eq!(counted(&mut port, false), [4, 3]);
    port.lost(&gone, "waiting");
    assert_eq!(counted(&mut port, false), [4, 3]);
}

#[test]
fn the_age_of_what_a_bus_takes_is_recorded_at_most_once_in_a_millisecond() {
    let mut rig = Rig::new();
    let mut take = |micros: i64| {
        let now = Nanos::from_micros(micros);
        assert!(rig.port.take_all(now).is_some(), "the line is up");
    };
    take(100);
    rig.tick.write(Nanos::from_micros(1_000), |_, _| {});
    for micros in [4_000, 4_900, 5_000] {
        take(micros);
    }
    let mut statistics = Statistics::default();
    rig.port.image.status.write(Nanos::ZERO, &mut statistics);
    let text = statistics.to_string();
    for line in [
        "sent_age.count=2",
        "sent_age.min_us=3000.0",
        "sent_age.mean_us=3500.0",
    ] {
        assert!(text.contains(line), "{text}");
    }
}

#[test]
fn a_line_is_looked_at_again_when_data_can_be_too_old_and_older_data_come_sooner() {
    let mut rig = Rig::new();
    rig.port.running("it is there");
    let state = |rig: &mut Rig, now| {
        rig.port.observe(Nanos(now));
        rig.port.image.status.state()
    };
    for station in 0..STATIONS {
        rig.port.received(station, Nanos(100), &[0]);
    }
    assert_eq!(state(&mut rig, 100), LinkState::Running);
    for station in 0..STATIONS {
        rig.port.touch(station, Nanos(130));
    }
    assert_eq!(state(&mut rig, 131), LinkState::Running);
    // Found long after the bus looked before.
    rig.port.came_at(Nanos(115));
    rig.port.received(1, Nanos(132), &[0]);
    assert_eq!(state(&mut rig, 115 + MAX_AGE), LinkState::Running);
    assert_eq!(state(&mut rig, 116 + MAX_AGE), LinkState::Stale);
    rig.port.came_at(Nanos(160));
    rig.port.touch(1, Nanos(160));
    assert_eq!(state(&mut rig, 160), LinkState::Running);
}

#[test]
fn a_fault_that_begins_while_stations_are_handed_in_together_meets_none_of_them() {
    let mut rig = Rig::new();
    rig.add(LineEffect::LinkDown);
    let begun = TickTime {
        time: Nanos::ZERO,
        tick: 1,
    };
    rig.port.together(|port| {
        port.received(0, Nanos(1), &[1]);
        rig.faults.begin_tick(begun, &mut []);
        port.received(1, Nanos(1), &[1]);
    });
    rig.tick.update();
    assert_eq!([0, 1].map(|station| rig.tick.latest(station)), [[1], [1]]);
    for station in 0..STATIONS {
        rig.port.received(station, Nanos(2), &[2]);
    }
    rig.tick.update();
    assert_eq!([0, 1].map(|station| rig.tick.latest(station)), [[1], [1]]);
}

#[test]
fn a_fault_that_is_injected_and_begins_while_stations_are_handed_in_together_meets_none_of_them() {
    let mut rig = Rig::new();
    let mut port = std::mem::replace(&mut rig.port, Rig::new().port);
    port.together(|port| {
        port.received(0, Nanos(1), &[1]);
        rig.inject(LineEffect::LinkDown);
        port.received(1, Nanos(1), &[1]);
    });
    rig.tick.update();
    assert_eq!([0, 1].map(|station| rig.tick.latest(station)), [[1], [1]]);
    for station in 0..STATIONS {
        port.received(station, Nanos(2), &[2]);
    }
    rig.tick.update();
    assert_eq!([0, 1].map(|station| rig.tick.latest(station)), [[1], [1]]);
}

/// The incoming data of one station: frames that are held back, with the times of their arrival, and the byte that the
/// tick has.
#[derive(Default)]
struct Incoming {
    held: VecDeque<(i64, u8)>,
    released: i64,
    heard: Option<i64>,
    byte: u8,
}

impl Incoming {
    fn release(&mut self, now: i64, delay: i64) {
        while let Some((came, byte)) = self.held.front().copied()
            && (delay == 0 || came + delay <= now)
        {
            self.held.pop_front();
            // A frame counts from its due time, even if the port looks later, but never from a time before the previous
            // frame.
            let due = (came + delay).max(self.released);
            (self.released, self.heard, self.byte) = (due, Some(due), byte);
        }
    }
}

#[test]
fn the_tick_gets_frames_as_late_as_the_line_is_and_takes_no_data_for_younger_than_they_are() {
    let (mut rig, mut random) = (Rig::new(), Random(1));
    let mut lines = [(); STATIONS].map(|()| Incoming::default());
    let (mut now, mut delay, mut fault) = (0, 0, None);
    let (mut hidden, mut stale) = (0, 0);
    for step in 0..20_000 {
        now += random.pause();
        let station = random.station();
        match random.below(12) {
            0..=3 => {
                let byte = random.below(256).to_le_bytes()[0];
                rig.port.received(station, Nanos(now), &[byte]);
                for line in &mut lines {
                    line.release(now, delay);
                }
                let line = &mut lines[station];
                line.held.push_back((now, byte));
                if delay == 0 {
                    line.release(now, 0);
                }
            }
            4 | 5 => {
                // A sign of life is never younger than the data that it comes with.
                rig.port.touch(station, Nanos(now));
                let line = &mut lines[station];
                if line.held.is_empty() {
                    line.heard = Some(now);
                } else {
                    hidden += 1;
                }
            }
            6 => {
                if let Some(id) = fault.take() {
                    rig.end(id);
                    delay = 0;
                } else {
                    delay = i64::try_from(1 + random.below(50)).expect("small");
                    fault = Some(rig.inject(LineEffect::Delay(Nanos(delay))));
                }
            }
            _ => {}
        }
        if random.below(2) == 0 {
            rig.port.observe(Nanos(now));
            for line in &mut lines {
                line.release(now, delay);
            }
            // Only a port that has looked knows of the fault.
            let fronts = lines.iter().filter_map(|line| line.held.front());
            let due = fronts.map(|(came, _)| Nanos(came + delay)).min();
            assert_eq!(rig.port.due(), due.unwrap_or(Nanos::MAX), "step {step}");
        }
        rig.tick.update();
        for (station, line) in lines.iter().enumerate() {
            let age = line.heard.map_or(Nanos::MAX, |heard| Nanos(now - heard));
            assert_eq!(rig.port.peer_age(station, Nanos(now)), age, "step {step}");
            assert_eq!(rig.tick.latest(station), [line.byte], "step {step}");
            stale += u32::from(age.0 > MAX_AGE);
        }
        // The first moment at which one more station is too old.
        let ends = lines
            .iter()
            .filter_map(|line| Some(line.heard? + MAX_AGE + 1));
        let next = ends.filter(|end| *end > now).min();
        let stale_at = next.map_or(Nanos::MAX, Nanos);
        assert_eq!(rig.port.stale_at(Nanos(now)), stale_at, "step {step}");
    }
    assert!(hidden > 200 && stale > 200, "{hidden} {stale}");
}

#[test]
fn a_pulse_is_sent_until_the_peer_has_it_or_the_line_has_lost_it() {
    let (mut rig, mut random) = (Rig::new(), Random(2));
    // Per station, the level that this end assumes at the peer, and true if a pulse waits.
    let mut models = [(false, false); STATIONS];
    let (mut now, mut fault) = (0, None);
    let (mut lost, mut shown) = (0, 0);
    for step in 0..20_000 {
        now += random.pause();
        match random.below(8) {
            0 | 1 => {
                let pulsing = random.station();
                for level in [1, 0] {
                    rig.tick.write(Nanos(now), |station, bytes| {
                        bytes[0] = if station == pulsing { level } else { 0 };
                    });
                }
                models[pulsing].1 = true;
            }
            2 if random.below(4) == 0 => match fault.take() {
                Some(id) => rig.end(id),
                None => fault = Some(rig.inject(LineEffect::Drop(0.5, Direction::Out))),
            },
            _ => {
                let next = models.map(|(level, waits)| {
                    let next = waits && !level;
                    (next, waits && !next)
                });
                let Some(mut frames) = rig.port.take_all(Nanos(now)) else {
                    assert!(fault.is_some(), "step {step}");
                    lost += u32::from(next.iter().any(|(level, _)| *level));
                    models = next;
                    continue;
                };
                for (station, (level, _)) in next.iter().enumerate() {
                    assert_eq!(frames.frame(station), [u8::from(*level)], "step {step}");
                    shown += u32::from(*level);
                }
                let receipt = frames.receipt();
                if random.below(3) != 0 {
                    rig.port.sent(&receipt);
                    models = next;
                }
            }
        }
    }
    assert!(lost > 200 && shown > 200, "{lost} {shown}");
}

#[test]
fn a_peer_has_the_last_values_when_no_fault_keeps_them_from_it() {
    let send = |rig: &mut Rig, now| {
        let mut frames = rig.port.take_all(Nanos(now)).expect("the line is up");
        let bytes = [0, 1].map(|station| frames.frame(station)[0]);
        let receipt = frames.receipt();
        rig.port.sent(&receipt);
        bytes
    };
    for effect in [
        LineEffect::LateValues(Nanos(20)),
        LineEffect::Duplicate(1.0, Direction::Out),
    ] {
        let mut rig = Rig::new();
        let farewell = rig
            .port
            .farewell(1, &SignalTable::of_one_station(0, 0, Vec::new()));
        rig.tick.write(Nanos(0), |_, bytes| bytes[0] = 2);
        assert_eq!(send(&mut rig, 0), [2, 2]);
        let fault = rig.inject(effect);
        assert!(farewell.begin());
        assert_eq!(send(&mut rig, 1), [2, 2], "{effect:?}");
        assert!(!farewell.wait(&*Manual::new(), Nanos::ZERO), "{effect:?}");
        rig.end(fault);
        assert_eq!(send(&mut rig, 30), [0, 0], "{effect:?}");
        assert!(farewell.wait(&*Manual::new(), Nanos::ZERO), "{effect:?}");
    }
}
