//! The promises of the hand-over in every interleaving of two threads.

use super::*;
use crate::signal::Latch;
use tickbus_base::time::Nanos;

/// Two stations of one byte, whose bit 0 is latched.
fn two_stations() -> (TickEnd, BusEnd) {
    let streams = |signal| {
        let latched: Box<[LatchedBit]> = Box::new([LatchedBit {
            signal,
            byte: 0,
            mask: 1,
            latch: Latch::Rising,
            hold: Nanos::ZERO,
        }]);
        StationStreams {
            tx_fail_safe: Box::new([0]),
            tx_latched: latched.clone(),
            tx_counted: Box::default(),
            rx_counted: Box::default(),
            rx_fail_safe: Box::new([0]),
            rx_latched: latched,
        }
    };
    image(vec![streams(0), streams(1)])
}

struct Seen {
    levels: Option<u8>,
    edges: u32,
}

impl Receiver for Seen {
    fn levels(&mut self, bytes: &[u8]) {
        self.levels = Some(bytes[0]);
    }

    fn edges(&mut self, _: usize, count: u32) {
        self.edges += count;
    }
}

/// The peer is silent for longer than data count, and returns with another value and a pulse: no tick shows the value
/// from before the outage with the time after it, no tick sees two cycles, and each edge is counted once.
#[test]
fn loom_no_old_data_are_young_no_cycle_is_torn_and_no_edge_is_lost() {
    loom::model(|| {
        let (mut tick, mut bus) = two_stations();
        let hand_in = |bus: &mut BusEnd, now, level| {
            for station in 0..2 {
                bus.received(station, Nanos(now), &[level], true);
            }
            bus.hand_over();
        };
        hand_in(&mut bus, 0, 2);
        let bus_thread = loom::thread::spawn(move || {
            hand_in(&mut bus, 1_000, 5);
            hand_in(&mut bus, 1_001, 4);
            bus.touch(0, Nanos(1_002));
            bus.touch(1, Nanos(1_002));
            bus.hand_over();
        });
        let mut seen = [0, 1].map(|_| Seen {
            levels: None,
            edges: 0,
        });
        let look = |tick: &mut TickEnd, seen: &mut [Seen; 2]| {
            tick.update();
            let arrivals = [0, 1]
                .map(|station| tick.read(station, (Nanos(1_010), Nanos(100)), &mut seen[station]));
            assert_eq!(arrivals[0], arrivals[1], "of one cycle");
            let latest = [0, 1].map(|station| tick.latest(station)[0]);
            assert_eq!(latest[0], latest[1], "of one cycle");
            assert_eq!(latest[0] == 2, arrivals[0].stale, "old data are old");
            let age = 1_010 - arrivals[0].age.0;
            assert!(matches!(
                (latest[0], age),
                (2, 0) | (5, 1_000) | (4, 1_001 | 1_002)
            ));
        };
        look(&mut tick, &mut seen);
        look(&mut tick, &mut seen);
        bus_thread.join().unwrap();
        look(&mut tick, &mut seen);
        assert!(
            seen.iter()
                .all(|seen| seen.edges == 1 && seen.levels.is_some())
        );
    });
}

/// The simulation pauses for longer than the watchdog, and returns: no exchange sends values from before the pause.
#[test]
fn loom_no_exchange_sends_the_values_from_before_a_pause_or_those_of_two_ticks() {
    loom::model(|| {
        let (mut tick, mut bus) = two_stations();
        tick.write(Nanos(0), |_, bytes| bytes[0] = 2);
        let tick_thread = loom::thread::spawn(move || {
            tick.write(Nanos(1_000), |_, bytes| bytes[0] = 5);
            tick.write(Nanos(1_001), |_, bytes| bytes[0] = 4);
        });
        let mut pulses = 0;
        for _ in 0..2 {
            bus.attend(Nanos(1_002), Some(Nanos(100)));
            let sent = [0, 1].map(|station| bus.outgoing(station, Nanos(1_002))[0]);
            assert_eq!(sent[0], sent[1], "of one tick");
            assert_ne!(sent[0], 2, "from before the pause");
            bus.sent(0);
            bus.sent(1);
            pulses += u32::from(sent[0] & 1 != 0);
        }
        tick_thread.join().unwrap();
        for _ in 0..2 {
            bus.attend(Nanos(1_002), Some(Nanos(100)));
            pulses += u32::from(bus.outgoing(0, Nanos(1_002))[0] & 1 != 0);
            bus.sent(0);
        }
        assert!(pulses >= 1, "the pulse is sent");
        assert_eq!(bus.outgoing(0, Nanos(1_002)), [4]);
    });
}
