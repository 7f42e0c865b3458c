//! Tests of the counting of swallowed changes, against an oracle that remembers every change.

use super::*;
use crate::signal::{Area, DataType, Latch, Signal, SignalTable, Station};
use tickbus_base::time::Nanos;

const STEPS: u32 = if cfg!(miri) { 500 } else { 1_000_000 };

/// The stations, and the bytes of each in both directions.
const SIZES: [usize; 3] = [1, 2, 11];

struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).expect("31 bits") % limit
    }
}

/// Ignores what it receives.
struct Nobody;

impl Receiver for Nobody {
    fn levels(&mut self, _: &[u8]) {}
    fn edges(&mut self, _: usize, _: u32) {}
}

fn bit(station: usize, area: Area, place: usize) -> Signal {
    Signal {
        station,
        bit: (place % 8).to_le_bytes()[0],
        ..Signal::new("", area, place / 8, DataType::Bool)
    }
}

/// Half of all bits of these stations, in both directions, as signals.
fn table() -> SignalTable {
    let mut signals = Vec::new();
    for (station, size) in SIZES.into_iter().enumerate() {
        for area in [Area::Input, Area::Output] {
            signals.extend(
                (0..size * 8)
                    .step_by(2)
                    .map(|place| bit(station, area, place)),
            );
        }
    }
    let stations = SIZES.map(|size| Station {
        name: String::new(),
        input_bytes: size,
        output_bytes: size,
        observed_bytes: 0,
    });
    SignalTable {
        stations: stations.into(),
        signals,
        structures: Vec::new(),
    }
}

fn streams(table: &SignalTable) -> Vec<StationStreams> {
    let streams = table.stations.iter().enumerate();
    let streams = streams.map(|(station, size)| StationStreams {
        tx_fail_safe: vec![0; size.input_bytes].into(),
        tx_latched: latched_bits(table, station, Area::Input),
        tx_counted: counted_signals(table, station, Area::Input),
        rx_fail_safe: vec![0; size.output_bytes].into(),
        rx_latched: latched_bits(table, station, Area::Output),
        rx_counted: counted_signals(table, station, Area::Output),
    });
    streams.collect()
}

/// The oracle's knowledge of one bit: its changes so far where it is written, where it is handed over, and in the frame
/// that the other side has.
#[derive(Clone, Copy, Default)]
struct Changes {
    written: u64,
    handed: u64,
    taken: u64,
    swallowed: u64,
    /// True if it has changed in this step.
    now: bool,
}

impl Changes {
    fn take(&mut self) {
        self.swallowed += (self.handed - self.taken) / 2;
        self.taken = self.handed;
    }
}

/// Both directions of a station.
struct Oracle {
    bytes: [Vec<u8>; 2],
    changes: [Vec<Changes>; 2],
}

impl Oracle {
    fn new(size: usize) -> Self {
        Self {
            bytes: [(); 2].map(|()| vec![0; size]),
            changes: [(); 2].map(|()| vec![Changes::default(); size * 8]),
        }
    }

    /// Some bits of a direction change, or none.
    fn change(&mut self, direction: usize, random: &mut Random) {
        // One change of a bit at a time: nobody could see two.
        for _ in 0..random.below(4) {
            let place = random.below(self.changes[direction].len());
            if self.changes[direction][place].now {
                continue;
            }
            self.changes[direction][place].now = true;
            self.bytes[direction][place / 8] ^= 1 << (place % 8);
            self.changes[direction][place].written += 1;
        }
        self.changes[direction]
            .iter_mut()
            .for_each(|one| one.now = false);
    }

    fn hand_over(&mut self, direction: usize) {
        let changes = self.changes[direction].iter_mut();
        changes.for_each(|one| one.handed = one.written);
    }

    fn take(&mut self, direction: usize, bits: std::ops::Range<usize>) {
        self.changes[direction][bits]
            .iter_mut()
            .for_each(Changes::take);
    }
}

/// Machine and PLC write and take at random moments, single stations and parts of them too.
#[test]
fn swallowed_changes_are_those_of_an_oracle_in_a_million_random_steps() {
    let table = table();
    let (mut tick, mut bus) = image(streams(&table));
    let mut oracles = SIZES.map(Oracle::new);
    let mut random = Random(7);
    let (now, sums) = (Nanos(1), &mut [0; 2]);
    // Both sides are there.
    tick.write(now, |_, _| {});
    (0..SIZES.len()).for_each(|station| {
        bus.outgoing(station, now);
        bus.sent(station);
    });
    for step in 1..=STEPS {
        let station = random.below(SIZES.len());
        match random.below(8) {
            0..=2 => {
                for one in &mut oracles {
                    one.change(0, &mut random);
                }
                tick.write(now, |station, bytes| {
                    bytes.copy_from_slice(&oracles[station].bytes[0]);
                });
            }
            3 => {
                bus.attend(now, None);
                for one in &mut oracles {
                    one.hand_over(0);
                }
            }
            4 => {
                let is_sent = random.below(3);
                bus.outgoing(station, now);
                let all = SIZES[station] * 8;
                if is_sent == 1 {
                    bus.sent(station);
                    oracles[station].take(0, 0..all);
                } else if is_sent == 2 {
                    let begin = random.below(all);
                    let bits = begin..begin + random.below(all - begin + 1);
                    bus.sent_bits(station, &bits);
                    oracles[station].take(0, bits);
                }
            }
            5 => {
                oracles[station].change(1, &mut random);
                bus.received(station, now, &oracles[station].bytes[1], true);
            }
            6 => {
                bus.hand_over();
                for one in &mut oracles {
                    one.hand_over(1);
                }
            }
            _ => {
                tick.update();
                for one in &mut oracles {
                    let all = 0..one.changes[1].len();
                    one.take(1, all);
                }
            }
        }
        if step % 5_000 == 0 || step == STEPS {
            bus.attend(now, None);
            bus.hand_over();
            tick.update();
            for (station, oracle) in oracles.iter_mut().enumerate() {
                bus.outgoing(station, now);
                bus.sent(station);
                for direction in 0..2 {
                    oracle.hand_over(direction);
                    let all = 0..oracle.changes[direction].len();
                    oracle.take(direction, all);
                }
            }
            *sums = [0; 2];
            for (index, signal) in table.signals.iter().enumerate() {
                let direction = usize::from(signal.area == Area::Output);
                let place = signal.address().bits().start;
                let expected = oracles[signal.station].changes[direction][place].swallowed;
                let found = tick.swallowed.of(index);
                assert_eq!(found, expected, "signal {index} at step {step}");
                sums[direction] += expected;
            }
        }
    }
    assert!(
        cfg!(miri) || sums.iter().all(|sum| *sum > 2_000),
        "{sums:?}"
    );
}

/// The tick writes while the bus takes on another thread: what was changed is what was seen, and twice what was swallowed.
#[test]
fn no_change_is_lost_between_threads_that_is_neither_seen_nor_counted() {
    let changes: u64 = if cfg!(miri) { 100 } else { 200_000 };
    let mut table = table();
    table.stations.truncate(1);
    table.signals.retain(|signal| signal.station == 0);
    let (mut tick, mut bus) = image(streams(&table));
    let now = Nanos(1);
    tick.write_word(now, Some(0));
    bus.outgoing(0, now);
    bus.sent(0);
    let swallowed = tick.swallowed.clone();
    let ticking = std::thread::spawn(move || {
        for change in 1..=changes {
            tick.write_word(now, Some(change & 1));
        }
    });
    let (mut seen, mut level) = (0, 0);
    let mut look = || {
        bus.attend(now, None);
        let new = bus.outgoing(0, now)[0];
        bus.sent(0);
        seen += u64::from(new != level);
        level = new;
    };
    while !ticking.is_finished() {
        look();
    }
    look();
    ticking.join().expect("no panic");
    assert_eq!(seen + 2 * swallowed.of(0), changes);
}

/// One station of eight bytes that the machine writes, and one that reads them at once, of these signals.
fn direct(signals: Vec<Signal>) -> (DirectStream, Swallowed) {
    let table = SignalTable {
        stations: vec![Station {
            name: String::new(),
            input_bytes: 12,
            output_bytes: 0,
            observed_bytes: 0,
        }],
        signals,
        structures: Vec::new(),
    };
    let swallowed = Swallowed::new(table.signals.len());
    let counted = counted_signals(&table, 0, Area::Input);
    let stream = DirectStream::new(vec![0; 12].into(), Box::default());
    (stream.with_counted(&counted, &swallowed), swallowed)
}

#[test]
fn a_number_is_counted_if_it_says_so_and_a_latched_bool_is_not() {
    let number = |byte, count| Signal {
        count_swallowed: count,
        ..Signal::new("", Area::Input, byte, DataType::Lint)
    };
    let latched = Signal {
        latch: Some(Latch::Rising),
        ..bit(0, Area::Input, 1)
    };
    let silent = Signal {
        count_swallowed: Some(false),
        ..bit(0, Area::Input, 2)
    };
    // The number lies across two words of the frame.
    let signals = vec![
        number(4, Some(true)),
        number(4, None),
        latched,
        silent,
        bit(0, Area::Input, 3),
    ];
    let (mut stream, swallowed) = direct(signals);
    stream.read(Nanos(0));
    for number in [1_u64 << 40, 3, 0, 1 << 40, 0, 5] {
        stream.write(|bytes| bytes[4..].copy_from_slice(&number.to_le_bytes()));
    }
    for levels in [0x0e, 0, 0x0e] {
        stream.write(|bytes| bytes[0] = levels);
    }
    assert_eq!(swallowed.iter().collect::<Vec<_>>(), [(0, 2), (4, 1)]);
    stream.read(Nanos(0));
    stream.write(|bytes| bytes[0] = 0);
    assert_eq!(swallowed.of(4), 1, "this one is seen");
}

#[test]
fn nothing_is_swallowed_before_the_other_side_is_there_or_while_it_is_gone() {
    let table = table();
    let (mut tick, mut bus) = image(streams(&table));
    let now = Nanos(1);
    let total = |tick: &TickEnd| tick.swallowed.iter().map(|(_, count)| count).sum::<u64>();
    let pulse = |tick: &mut TickEnd| {
        for level in [1, 0] {
            tick.write(now, |_, bytes| bytes[0] = level);
        }
    };
    // The PLC pulses before the first tick, the machine before the first request.
    for level in [1, 0] {
        bus.received(0, now, &[level], true);
        bus.hand_over();
    }
    pulse(&mut tick);
    bus.attend(now, None);
    assert_eq!(total(&tick), 0);
    bus.outgoing(0, now);
    bus.sent(0);
    pulse(&mut tick);
    assert_eq!(total(&tick), 1, "the other stations were never asked");
    bus.peer_left(1);
    pulse(&mut tick);
    assert_eq!(total(&tick), 2, "another station's peer is gone");
    bus.peer_left(0);
    pulse(&mut tick);
    assert_eq!(total(&tick), 2);
    // Values of a PLC in STOP are no values.
    tick.update();
    tick.read(0, (now, Nanos::MAX), &mut Nobody);
    for level in [1, 0] {
        bus.received(0, now, &[level], false);
    }
    bus.hand_over();
    assert_eq!(total(&tick), 2);
    for level in [1, 0] {
        bus.received(0, now, &[level], true);
        bus.hand_over();
    }
    assert_eq!(total(&tick), 3);
}
