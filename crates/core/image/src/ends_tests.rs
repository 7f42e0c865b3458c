//! Tests of the two ends together.

use super::*;
use crate::signal::Latch;
use tickbus_base::time::Nanos;

/// Longer than any test.
const ANY_AGE: Nanos = Nanos::MAX;

/// Stations of one byte each, whose bit 0 is latched: signal 7 of station 0, 8 of station 1 and so on.
fn latched_bytes(stations: usize) -> (TickEnd, BusEnd) {
    let streams = (0..stations).map(|station| {
        let latched: Box<[LatchedBit]> = Box::new([LatchedBit {
            signal: 7 + station,
            byte: 0,
            mask: 1,
            latch: Latch::Rising,
            hold: Nanos::ZERO,
        }]);
        StationStreams {
            tx_fail_safe: Box::new([0x80]),
            tx_latched: latched.clone(),
            tx_counted: Box::default(),
            rx_counted: Box::default(),
            rx_fail_safe: Box::new([0]),
            rx_latched: latched,
        }
    });
    image(streams.collect())
}

fn one_latched_byte() -> (TickEnd, BusEnd) {
    latched_bytes(1)
}

#[derive(Default)]
struct Seen {
    level: Option<u8>,
    edges: Vec<(usize, u32)>,
}

impl Receiver for Seen {
    fn levels(&mut self, bytes: &[u8]) {
        self.level = Some(bytes[0]);
    }

    fn edges(&mut self, signal: usize, count: u32) {
        self.edges.push((signal, count));
    }
}

fn read_within(
    tick: &mut TickEnd,
    now: i64,
    max_age: Nanos,
) -> (Arrival, Option<u8>, Vec<(usize, u32)>) {
    let mut seen = Seen::default();
    tick.update();
    let arrival = tick.read(0, (Nanos(now), max_age), &mut seen);
    (arrival, seen.level, seen.edges)
}

fn read(tick: &mut TickEnd, now: i64) -> (Arrival, Option<u8>, Vec<(usize, u32)>) {
    read_within(tick, now, ANY_AGE)
}

fn write(tick: &mut TickEnd, now: i64, level: u8) {
    tick.write(Nanos(now), |_, bytes| bytes[0] = level);
}

fn receive(bus: &mut BusEnd, now: i64, level: u8) {
    bus.received(0, Nanos(now), &[level], true);
    bus.hand_over();
}

fn outgoing(bus: &mut BusEnd, now: i64, watchdog: Option<Nanos>) -> u8 {
    bus.attend(Nanos(now), watchdog);
    bus.outgoing(0, Nanos(now))[0]
}

#[test]
fn a_pulse_between_two_ticks_is_seen_for_one_tick_and_counted() {
    let (mut tick, mut bus) = one_latched_byte();
    let (arrival, shown, edges) = read_within(&mut tick, 0, Nanos(1_000));
    assert!(arrival.stale && !arrival.fresh);
    assert_eq!((arrival.age, arrival.sequence), (Nanos::MAX, 0));
    assert_eq!((shown, edges), (None, vec![]));
    for level in [1, 0, 1, 0] {
        receive(&mut bus, 5, level);
    }
    let (arrival, shown, edges) = read(&mut tick, 8);
    assert!(arrival.fresh);
    assert_eq!((arrival.age, arrival.sequence), (Nanos(3), 4));
    assert_eq!((shown, edges), (Some(1), vec![(7, 2)]));
    let (arrival, shown, edges) = read(&mut tick, 9);
    assert!(!arrival.fresh);
    assert_eq!((shown, edges), (Some(0), vec![(7, 0)]));
    read(&mut tick, 10);
    assert_eq!(read(&mut tick, 11).1, None);
}

#[test]
fn a_level_that_returns_to_its_first_value_is_sent_again() {
    let (mut tick, mut bus) = one_latched_byte();
    for (level, expected) in [
        (0x80, 0x80),
        (0x42, 0x42),
        (0x80, 0x80),
        (0, 0),
        (0x80, 0x80),
    ] {
        for is_word in [false, true, false] {
            // Something else in between, in the other way.
            for (is_word, level) in [(!is_word, 0x24), (is_word, level)] {
                if is_word {
                    assert!(tick.write_words(Nanos(1), |_| Some(level.into())));
                } else {
                    write(&mut tick, 1, level);
                }
            }
            assert_eq!(outgoing(&mut bus, 1, None), expected, "a word: {is_word}");
            bus.sent(0);
        }
    }
}

#[test]
fn a_tick_that_writes_nothing_new_is_alive() {
    let (mut tick, mut bus) = one_latched_byte();
    write(&mut tick, 5, 6);
    tick.ticks(Nanos(7));
    assert_eq!(bus.tick_age(Nanos(8)), Nanos(1));
    assert_eq!(outgoing(&mut bus, 8, Some(Nanos(1))), 6);
}

#[test]
fn a_pulse_between_two_exchanges_is_sent_until_one_was_completed() {
    let (mut tick, mut bus) = one_latched_byte();
    for level in [0, 1, 0] {
        write(&mut tick, 1, level);
    }
    assert_eq!(outgoing(&mut bus, 2, None), 1);
    assert_eq!(outgoing(&mut bus, 3, None), 1);
    bus.sent(0);
    assert_eq!(outgoing(&mut bus, 4, None), 0);
    bus.sent(0);
    assert_eq!(outgoing(&mut bus, 5, None), 0);
}

#[test]
fn when_the_simulation_stops_the_peer_gets_the_fail_safe_bytes() {
    let (mut tick, mut bus) = one_latched_byte();
    let watchdog = Some(Nanos(10));
    assert_eq!(
        outgoing(&mut bus, 0, watchdog),
        0x80,
        "before the first tick"
    );
    write(&mut tick, 0, 2);
    assert_eq!(outgoing(&mut bus, 10, watchdog), 2);
    assert_eq!(outgoing(&mut bus, 11, watchdog), 0x80);
    write(&mut tick, 12, 2);
    assert_eq!(outgoing(&mut bus, 13, watchdog), 2);
}

#[test]
fn the_bytes_sent_last_stay_at_hand_however_they_came_about() {
    let (mut tick, mut bus) = one_latched_byte();
    assert_eq!(bus.last_outgoing(0), [0x80]);
    for level in [1, 0] {
        write(&mut tick, 1, level);
    }
    // The pulse, later writes of the tick, and the fail-safe bytes at the end.
    for (now, expected, next) in [(2, 1, 0x42), (3, 0x42, 0x44), (20, 0x80, 0x46)] {
        assert_eq!(outgoing(&mut bus, now, Some(Nanos(10))), expected);
        bus.sent(0);
        write(&mut tick, 5, next);
        bus.attend(Nanos(now), None);
        assert_eq!(bus.last_outgoing(0), [expected], "at {now}");
    }
}

#[test]
fn a_pulse_that_fail_safe_bytes_overtook_is_sent_after_them() {
    let (mut tick, mut bus) = one_latched_byte();
    let watchdog = Some(Nanos(10));
    for level in [0, 1, 0] {
        write(&mut tick, 0, level);
    }
    assert_eq!(outgoing(&mut bus, 1, watchdog), 1, "shown, not sent");
    assert_eq!(outgoing(&mut bus, 20, watchdog), 0x80);
    bus.sent(0);
    write(&mut tick, 21, 0);
    assert_eq!(outgoing(&mut bus, 22, watchdog), 1);
    bus.sent(0);
    assert_eq!(outgoing(&mut bus, 23, watchdog), 0);
}

#[test]
fn a_pulse_is_sent_by_its_own_bit_and_not_by_another_one_of_its_byte() {
    let (mut tick, mut bus) = one_latched_byte();
    for level in [0, 1, 0] {
        write(&mut tick, 0, level);
    }
    for bits in [1..8, 8..16, 0..0] {
        assert_eq!(outgoing(&mut bus, 1, None), 1);
        bus.sent_bits(0, &bits);
    }
    assert_eq!(outgoing(&mut bus, 2, None), 1);
    bus.sent_bits(0, &(0..1));
    assert_eq!(outgoing(&mut bus, 3, None), 0);
}

#[test]
fn a_level_that_is_on_by_its_fail_safe_value_does_not_drop_when_the_peer_switches_it_on() {
    let (mut tick, mut bus) = one_latched_byte();
    receive(&mut bus, 0, 0);
    read(&mut tick, 0);
    // The peer is silent, and the simulation sees the bit on instead.
    tick.shown_instead(0, &mut Seen::default());
    receive(&mut bus, 90, 1);
    let (_, shown, edges) = read(&mut tick, 90);
    assert_eq!((shown, edges), (Some(1), vec![(7, 1)]));
    assert_eq!(read(&mut tick, 91).1, Some(1), "and stays");
}

#[test]
fn a_stale_tick_has_no_edges_and_the_pulse_that_came_before_it_is_shown_when_data_count_again() {
    let (mut tick, mut bus) = one_latched_byte();
    receive(&mut bus, 0, 0);
    read_within(&mut tick, 0, Nanos(20));
    receive(&mut bus, 10, 1);
    receive(&mut bus, 10, 0);
    let (arrival, shown, edges) = read_within(&mut tick, 31, Nanos(20));
    assert!(arrival.stale && arrival.age == Nanos(21));
    assert_eq!((shown, edges), (None, vec![]));
    let mut instead = Seen::default();
    tick.shown_instead(0, &mut instead);
    assert_eq!(instead.edges, [(7, 0)]);
    receive(&mut bus, 40, 0);
    let (arrival, shown, edges) = read_within(&mut tick, 41, Nanos(20));
    assert!(arrival.fresh && !arrival.stale);
    assert_eq!((shown, edges), (Some(1), vec![(7, 1)]));
    assert_eq!(read_within(&mut tick, 42, Nanos(20)).1, Some(0));
}

#[test]
fn edges_of_data_that_are_not_valid_never_count() {
    let (mut tick, mut bus) = one_latched_byte();
    receive(&mut bus, 0, 1);
    read(&mut tick, 0);
    for level in [0, 1, 0] {
        bus.received(0, Nanos(1), &[level], false);
    }
    bus.hand_over();
    let (arrival, shown, edges) = read(&mut tick, 1);
    assert!(arrival.stale, "however young");
    assert_eq!((shown, edges), (None, vec![]));
    receive(&mut bus, 2, 0);
    assert_eq!(read(&mut tick, 2).1, Some(0));
    // Between two ticks, too.
    for level in [1, 0] {
        bus.received(0, Nanos(3), &[level], false);
    }
    receive(&mut bus, 3, 0);
    let (_, shown, edges) = read(&mut tick, 3);
    assert_eq!((shown, edges), (Some(0), vec![(7, 0)]));
}

#[test]
fn touch_keeps_the_age_down_without_new_data() {
    let (mut tick, mut bus) = one_latched_byte();
    receive(&mut bus, 0, 0);
    read(&mut tick, 0);
    bus.touch(0, Nanos(90));
    assert_eq!(
        read(&mut tick, 100).0.age,
        Nanos(100),
        "not handed over yet"
    );
    bus.hand_over();
    let (arrival, shown, _) = read(&mut tick, 100);
    assert_eq!(
        (arrival.fresh, arrival.age, shown),
        (false, Nanos(10), None)
    );
    assert_eq!(tick.peers.age(0, Nanos(101)), Nanos(11));
}

#[test]
fn one_message_of_several_stations_is_one_cycle_and_is_seen_whole() {
    let (mut tick, mut bus) = latched_bytes(3);
    for station in 0..3 {
        bus.received(station, Nanos(1), &[5], true);
        tick.update();
        assert_eq!((tick.cycles(), tick.latest(0)), (0, &[0][..]));
    }
    bus.hand_over();
    tick.update();
    assert_eq!(tick.cycles(), 1);
    for station in 0..3 {
        assert_eq!(tick.latest(station), [5]);
        let arrival = tick.read(station, (Nanos(1), ANY_AGE), &mut Seen::default());
        assert_eq!((arrival.fresh, arrival.sequence), (true, 1));
        assert_eq!(tick.peers.received(station), 1);
    }
    // A change of one station leaves the others unchanged.
    bus.received(1, Nanos(2), &[6], true);
    bus.hand_over();
    tick.update();
    let told = [0, 1, 2].map(|station| {
        let arrival = tick.read(station, (Nanos(2), ANY_AGE), &mut Seen::default());
        (arrival.fresh, arrival.age, tick.latest(station)[0])
    });
    let old = (false, Nanos(1), 5);
    assert_eq!(told, [old, (true, Nanos(0), 6), old]);
    bus.hand_over();
    assert_eq!(tick.cycles(), 2, "nothing new is no cycle");
}

#[test]
fn all_stations_send_what_one_tick_wrote() {
    let (mut tick, mut bus) = latched_bytes(3);
    for level in [2, 4] {
        tick.write(Nanos(1), |station, bytes| {
            bytes[0] = level + u8::try_from(station).expect("few");
        });
        if level == 2 {
            bus.attend(Nanos(1), None);
        }
        let sent = [0, 1, 2].map(|station| bus.outgoing(station, Nanos(1))[0]);
        assert_eq!(sent, [2, 3, 4], "of the tick that was taken over");
    }
}

#[test]
#[should_panic(expected = "must have the station's size")]
fn a_frame_of_the_wrong_size_never_gets_in() {
    let (_tick, mut bus) = one_latched_byte();
    bus.received(0, Nanos(0), &[0, 0], true);
}

/// The stations' counters agree at every look, in both directions, between two threads that never wait.
#[test]
fn nothing_is_torn_or_young_again_between_threads() {
    const LAST: u32 = if cfg!(miri) { 100 } else { 20_000 };
    for stations in [1, 2, 8] {
        let (mut tick, mut bus) = latched_bytes(stations);
        let bus_thread = std::thread::spawn(move || {
            let mut newest = 0;
            for cycle in 1..=LAST {
                let now = Nanos(i64::from(cycle) * 10);
                let level = cycle.to_le_bytes()[0];
                for station in 0..stations {
                    bus.received(station, now, &[level], true);
                }
                bus.hand_over();
                bus.attend(now, None);
                let sent = (0..stations).map(|station| {
                    let byte = bus.outgoing(station, now)[0];
                    // Bit 0 is shaped, station by station.
                    byte >> 1
                });
                let sent: Vec<u8> = sent.collect();
                assert!(sent.iter().all(|byte| *byte == sent[0]), "torn: {sent:?}");
                newest = newest.max(sent[0]);
            }
            newest
        });
        let (mut now, mut counter) = (0, 0_u8);
        while now < i64::from(LAST) * 10 {
            counter = counter.wrapping_add(1);
            tick.write(Nanos(now), |_, bytes| bytes[0] = counter);
            tick.update();
            let cycle = tick.cycles();
            for station in 0..stations {
                let arrival = tick.read(
                    station,
                    (Nanos(i64::from(LAST) * 10), ANY_AGE),
                    &mut Seen::default(),
                );
                assert_eq!(arrival.sequence, cycle, "of one cycle");
                assert_eq!(tick.latest(station)[0], cycle.to_le_bytes()[0]);
                let heard = i64::from(LAST) * 10 - arrival.age.0;
                if cycle > 0 {
                    assert_eq!(
                        heard,
                        i64::try_from(cycle).expect("few") * 10,
                        "its own time"
                    );
                }
                now = now.max(if cycle > 0 { heard } else { 0 });
            }
        }
        assert!(bus_thread.join().expect("no panic") > 0 || cfg!(miri));
    }
}

#[test]
fn a_simulation_that_restarts_sees_the_newest_levels_again_and_no_edge_of_before() {
    let (mut tick, mut bus) = one_latched_byte();
    receive(&mut bus, 1, 1);
    read(&mut tick, 2);
    for level in [0, 1] {
        receive(&mut bus, 3, level);
        bus.events.push(Event::default());
    }
    tick.restart();
    assert_eq!(tick.events.pop(), None);
    let (arrival, shown, edges) = read(&mut tick, 4);
    assert_eq!((arrival.fresh, shown, edges), (true, Some(1), vec![(7, 0)]));
    assert_eq!(read(&mut tick, 5).1, None);
    tick.restart();
    let (arrival, shown, edges) = read(&mut tick, 6);
    assert_eq!(
        (arrival.fresh, shown, edges),
        (false, Some(1), vec![(7, 0)])
    );
    for level in [0, 1] {
        receive(&mut bus, 7, level);
    }
    assert_eq!(read(&mut tick, 8).2, [(7, 1)]);
}
