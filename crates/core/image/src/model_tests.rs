//! The hand-over against a model: slow, one bit at a time, and sharing no code with the hand-over.

use super::*;
use crate::signal::Latch;
use tickbus_base::time::Nanos;

/// One latched bit, from the end that writes it to the end that reads it.
#[derive(Clone, Debug)]
struct Bit {
    latch: Latch,
    hold: i64,
    /// At the writing end: the level, and the edges so far.
    level: bool,
    edges: u32,
    /// The state that the reader took over last.
    taken: (bool, u32),
    /// The reader's last view, and its next one if the exchange completes.
    seen: Reading,
    next: Reading,
    counted: u32,
    /// Totals: edges that were shown as edges, and edges that were reported as counts.
    shown: u32,
    reported: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    level: bool,
    is_waiting: bool,
    held_until: i64,
}

impl Bit {
    fn new(latch: Latch, hold: i64, level: bool) -> Self {
        let seen = Reading {
            level,
            is_waiting: false,
            held_until: i64::MIN,
        };
        Self {
            latch,
            hold,
            level,
            edges: 0,
            taken: (level, 0),
            seen,
            next: seen,
            counted: 0,
            shown: 0,
            reported: 0,
        }
    }

    fn is_edge(&self, from: bool, to: bool) -> bool {
        from != to
            && match self.latch {
                Latch::Rising => to,
                Latch::Falling => !to,
                Latch::Both => true,
            }
    }

    fn write(&mut self, level: bool, counts: bool) {
        self.edges += u32::from(counts && self.is_edge(self.level, level));
        self.level = level;
    }

    fn take_over(&mut self) {
        self.taken = (self.level, self.edges);
    }

    /// The level in the reader's next view, and the number of new edges.
    fn read(&mut self, now: i64) -> (bool, u32) {
        let (level, edges) = self.taken;
        let news = edges - self.counted;
        self.counted = edges;
        self.reported += news;
        self.seen.is_waiting |= news > 0;
        let Reading {
            level: seen,
            is_waiting,
            held_until,
        } = self.seen;
        let next = match (now < held_until, is_waiting) {
            (true, _) => seen,
            (false, true) => !seen,
            (false, false) => level,
        };
        let shows = is_waiting && self.is_edge(seen, next);
        self.next = Reading {
            level: next,
            is_waiting: is_waiting && !shows,
            held_until: if shows && self.hold > 0 {
                now + self.hold
            } else {
                held_until
            },
        };
        (next, news)
    }

    fn pass_instead(&mut self, level: bool) {
        self.next = Reading { level, ..self.seen };
    }

    fn confirm(&mut self) {
        self.shown += u32::from(self.is_edge(self.seen.level, self.next.level));
        self.seen = self.next;
    }
}

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
}

const FAIL_SAFE: [u8; 2] = [0x81, 0x02];
const STATIONS: usize = 3;
const STEPS: usize = if cfg!(miri) { 200 } else { 20_000 };
const MAX_AGE: i64 = 40;
const WATCHDOG: i64 = 14;

/// Latched bits of a station of two bytes.
fn latched(random: &mut Random) -> Vec<LatchedBit> {
    let places = [(0, 0), (0, 3), (1, 1), (1, 7)];
    let bits = places.iter().enumerate().map(|(signal, (byte, bit))| {
        let latches = [Latch::Rising, Latch::Falling, Latch::Both];
        // The longest outlives a pause in which fail-safe bytes are sent.
        let holds = [0, 3, 11, 60];
        LatchedBit {
            signal,
            byte: *byte,
            mask: 1 << bit,
            latch: latches[usize::try_from(random.below(3)).expect("small")],
            hold: Nanos(holds[usize::try_from(random.below(4)).expect("small")]),
        }
    });
    bits.collect()
}

fn models(latched: &[LatchedBit], fail_safe: [u8; 2]) -> Vec<Bit> {
    let bits = latched.iter().map(|bit| {
        let level = fail_safe[bit.byte] & bit.mask != 0;
        Bit::new(bit.latch, bit.hold.0, level)
    });
    bits.collect()
}

/// `raw`, with these levels of the latched bits.
fn with_levels(raw: [u8; 2], latched: &[LatchedBit], levels: &[bool]) -> [u8; 2] {
    let mut bytes = raw;
    for (bit, level) in latched.iter().zip(levels) {
        bytes[bit.byte] = bytes[bit.byte] & !bit.mask | if *level { bit.mask } else { 0 };
    }
    bytes
}

fn is_on(bytes: [u8; 2], bit: &LatchedBit) -> bool {
    bytes[bit.byte] & bit.mask != 0
}

struct Shown {
    bytes: [u8; 2],
    edges: [u32; 4],
}

impl Receiver for Shown {
    fn levels(&mut self, bytes: &[u8]) {
        self.bytes.copy_from_slice(bytes);
    }

    fn edges(&mut self, signal: usize, count: u32) {
        self.edges[signal] = count;
    }
}

/// The data of a station's peer, as the model has it.
#[derive(Clone, Copy, Debug)]
struct Peer {
    bytes: [u8; 2],
    heard: Option<i64>,
    is_valid: bool,
}

#[test]
fn what_the_tick_sees_is_what_the_model_says() {
    for seed in 1..=if cfg!(miri) { 1 } else { 8 } {
        received(Random(seed));
    }
}

fn received(mut random: Random) {
    let bits: Vec<_> = (0..STATIONS).map(|_| latched(&mut random)).collect();
    let streams = bits.iter().map(|bits| StationStreams {
        tx_fail_safe: Box::new([]),
        tx_latched: Box::new([]),
        tx_counted: Box::default(),
        rx_counted: Box::default(),
        rx_fail_safe: Box::new(FAIL_SAFE),
        rx_latched: bits.clone().into(),
    });
    let (mut tick, mut bus) = image(streams.collect());
    let mut models: Vec<_> = bits.iter().map(|bits| models(bits, FAIL_SAFE)).collect();
    let first = Peer {
        bytes: FAIL_SAFE,
        heard: None,
        is_valid: true,
    };
    // The staged values, the values handed over, and the tick's values.
    let (mut staged, mut handed) = ([first; STATIONS], [first; STATIONS]);
    let mut shown = [(); STATIONS].map(|()| Shown {
        bytes: FAIL_SAFE,
        edges: [0; 4],
    });
    let (mut now, mut codes) = (0, [0_usize; 3]);
    let mut handed_models = models.clone();
    for _ in 0..STEPS {
        now += i64::try_from(random.below(6) * random.below(4)).expect("small");
        let station = usize::try_from(random.below(3)).expect("small");
        match random.below(9) {
            0..=2 => {
                let bytes = [0, 1].map(|_| random.below(256).to_le_bytes()[0]);
                let is_valid = random.below(5) != 0;
                bus.received(station, Nanos(now), &bytes, is_valid);
                staged[station] = Peer {
                    bytes,
                    heard: Some(now),
                    is_valid,
                };
                for (model, bit) in models[station].iter_mut().zip(&bits[station]) {
                    model.write(is_on(bytes, bit), is_valid);
                }
            }
            3 => {
                bus.touch(station, Nanos(now));
                staged[station].heard = Some(now);
            }
            4 => {
                let is_valid = random.below(3) != 0;
                bus.set_valid(station, is_valid);
                staged[station].is_valid = is_valid;
            }
            5 | 6 => {
                bus.hand_over();
                handed = staged;
                for (handed, model) in handed_models
                    .iter_mut()
                    .flatten()
                    .zip(models.iter().flatten())
                {
                    (handed.level, handed.edges) = (model.level, model.edges);
                }
            }
            _ => {
                tick.update();
                let taken = handed;
                handed_models.iter_mut().flatten().for_each(Bit::take_over);
                for station in 0..STATIONS {
                    let peer = taken[station];
                    let judged = (&mut handed_models[station][..], &bits[station][..]);
                    let code = look(&mut tick, (station, now), peer, judged, &mut shown[station]);
                    codes[code] += 1;
                    if code != STALE && random.below(8) == 0 {
                        // As by a recording: the next tick shows the frame again.
                        tick.overridden(station);
                        shown[station] = Shown {
                            bytes: peer.bytes.map(|byte| !byte),
                            edges: [7; 4],
                        };
                    }
                }
            }
        }
    }
    assert!(codes.iter().all(|count| *count > STEPS / 100), "{codes:?}");
    for model in handed_models.iter().flatten() {
        assert_eq!(model.reported, model.counted, "each edge is reported once");
        assert!(
            model.shown > 0 && model.shown <= model.edges + 1,
            "{model:?}"
        );
    }
}

const STALE: usize = 1;

/// Lets a tick look at a station, and compares with the model; 0 if it finds a new frame, 2 if it finds nothing.
fn look(
    tick: &mut TickEnd,
    (station, now): (usize, i64),
    peer: Peer,
    (models, bits): (&mut [Bit], &[LatchedBit]),
    shown: &mut Shown,
) -> usize {
    let age = peer.heard.map_or(Nanos::MAX, |heard| Nanos(now - heard));
    let is_stale = !peer.is_valid || age.0 > MAX_AGE;
    // If `unchanged` says so, the same must have been shown already.
    let unchanged = tick.unchanged(station, Nanos(now));
    assert!(unchanged.is_none_or(|told| told == (age, peer.is_valid)));
    if unchanged.is_some() && !is_stale {
        assert_seen(models, now, bits, (peer.bytes, shown));
        return 2;
    }
    let arrival = tick.read(station, (Nanos(now), Nanos(MAX_AGE)), shown);
    assert_eq!((arrival.age, arrival.stale), (age, is_stale), "at {now}");
    if is_stale {
        tick.shown_instead(station, shown);
        shown.bytes = FAIL_SAFE;
        assert_eq!(shown.edges, [0; 4], "at {now}");
        return STALE;
    }
    assert_seen(models, now, bits, (peer.bytes, shown));
    if arrival.fresh { 0 } else { 2 }
}

/// Lets the model read and confirm, and compares with the tick's view.
fn assert_seen(models: &mut [Bit], now: i64, bits: &[LatchedBit], (raw, shown): ([u8; 2], &Shown)) {
    let expected: Vec<_> = models.iter_mut().map(|model| model.read(now)).collect();
    models.iter_mut().for_each(Bit::confirm);
    let levels: Vec<bool> = expected.iter().map(|(level, _)| *level).collect();
    let counts: Vec<u32> = expected.iter().map(|(_, count)| *count).collect();
    assert_eq!(shown.bytes, with_levels(raw, bits, &levels), "at {now}");
    assert_eq!(shown.edges, *counts, "at {now}");
}

#[test]
fn what_the_peer_gets_is_what_the_model_says() {
    for seed in 1..=if cfg!(miri) { 1 } else { 8 } {
        sent(Random(100 + seed), STATIONS);
        // A frame of one word is handed over as a number.
        sent(Random(200 + seed), 1);
    }
}

fn next_written(before: [u8; 2], random: &mut Random) -> [u8; 2] {
    match random.below(6) {
        0..=2 => before,
        // Back to the start.
        3 => FAIL_SAFE,
        _ => [0, 1].map(|_| random.below(256).to_le_bytes()[0]),
    }
}

/// Writes these bytes of all stations in one of the possible ways.
fn write_somehow(tick: &mut TickEnd, now: Nanos, bytes: &[[u8; 2]], way: u64) {
    let word = |index: usize| u64::from(u16::from_le_bytes(bytes[index]));
    match way {
        0 if bytes.len() == 1 => assert!(tick.write_word(now, Some(word(0)))),
        0 | 1 => assert!(tick.write_words(now, |index| Some(word(index)))),
        _ => {
            // The last station has no word.
            let is_last = |index: usize| index + 1 == bytes.len();
            assert!(!tick.write_words(now, |index| (!is_last(index)).then(|| word(index))));
            tick.write(now, |index, frame| frame.copy_from_slice(&bytes[index]));
        }
    }
}

fn sent(mut random: Random, stations: usize) {
    let bits: Vec<_> = (0..stations).map(|_| latched(&mut random)).collect();
    let streams = bits.iter().map(|bits| StationStreams {
        tx_fail_safe: Box::new(FAIL_SAFE),
        tx_latched: bits.clone().into(),
        tx_counted: Box::default(),
        rx_counted: Box::default(),
        rx_fail_safe: Box::new([]),
        rx_latched: Box::new([]),
    });
    let (mut tick, mut bus) = image(streams.collect());
    let mut models: Vec<_> = bits.iter().map(|bits| models(bits, FAIL_SAFE)).collect();
    let (mut written, mut taken) = (vec![FAIL_SAFE; stations], vec![FAIL_SAFE; stations]);
    let (mut now, mut ticked, mut is_dead) = (0, None, false);
    let mut given = [0; 3];
    for step in 0..STEPS {
        now += i64::try_from(random.below(5) * random.below(4)).expect("small");
        let station = usize::try_from(random.below(3)).expect("small") % stations;
        let (bits, models) = (&bits, &mut models);
        match random.below(8) {
            0..=2 => {
                let drawn: Vec<_> = written
                    .iter()
                    .map(|bytes| next_written(*bytes, &mut random))
                    .collect();
                for (index, bytes) in written.iter().enumerate() {
                    let word = u64::from(u16::from_le_bytes(*bytes));
                    assert_eq!(tick.published_word(index), word, "step {step}");
                }
                write_somehow(&mut tick, Nanos(now), &drawn, random.below(3));
                (written, ticked) = (drawn, Some(now));
                for (index, bytes) in written.iter().enumerate() {
                    for (model, bit) in models[index].iter_mut().zip(&bits[index]) {
                        model.write(is_on(*bytes, bit), true);
                    }
                }
            }
            3 | 4 => {
                bus.attend(Nanos(now), Some(Nanos(WATCHDOG)));
                taken.clone_from(&written);
                is_dead = ticked.is_none_or(|ticked| now - ticked > WATCHDOG);
                models.iter_mut().flatten().for_each(Bit::take_over);
            }
            5 | 6 => {
                let models = &mut models[station];
                let bytes = if is_dead {
                    for (model, bit) in models.iter_mut().zip(&bits[station]) {
                        model.pass_instead(is_on(FAIL_SAFE, bit));
                    }
                    FAIL_SAFE
                } else {
                    let levels: Vec<bool> =
                        models.iter_mut().map(|model| model.read(now).0).collect();
                    with_levels(taken[station], &bits[station], &levels)
                };
                given[usize::from(is_dead)] += 1;
                assert_eq!(
                    bus.outgoing(station, Nanos(now)),
                    bytes,
                    "step {step} at {now}"
                );
                match random.below(4) {
                    // The exchange fails.
                    0 => {}
                    1 => {
                        // The peer reads some of the bits.
                        let (one, other) = (random.below(17), random.below(17));
                        let read = usize::try_from(one.min(other)).expect("small")
                            ..usize::try_from(one.max(other)).expect("small");
                        bus.sent_bits(station, &read);
                        for (model, bit) in models.iter_mut().zip(&bits[station]) {
                            let place = 8 * bit.byte + bit.mask.trailing_zeros() as usize;
                            if read.contains(&place) {
                                model.confirm();
                            }
                        }
                        given[2] += 1;
                    }
                    _ => {
                        bus.sent(station);
                        models.iter_mut().for_each(Bit::confirm);
                    }
                }
            }
            _ => assert_eq!(
                bus.tick_age(Nanos(now)),
                ticked.map_or(Nanos::MAX, |ticked| Nanos(now - ticked))
            ),
        }
    }
    assert!(given.iter().all(|count| *count > STEPS / 100), "{given:?}");
    for model in models.iter().flatten() {
        assert_eq!(model.reported, model.counted);
        assert!(model.shown > 0, "{model:?}");
    }
}
