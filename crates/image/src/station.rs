//! The two ends of one station.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};

use super::{
    EdgeCounter, Frame, LatchedBit, PulseShaper, Reader, Writer, copy_frame, triple_buffer,
};
use tickbus_base::time::Nanos;

/// The frames of one station's two streams; tx and rx are as seen from the tick.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StationStreams {
    /// The tx frame before the first tick, and again after the tick has stopped.
    pub tx_fail_safe: Box<[u8]>,
    /// The latched signals of the tx frames.
    pub tx_latched: Box<[LatchedBit]>,
    /// The rx frame before the first bus cycle.
    pub rx_fail_safe: Box<[u8]>,
    /// The latched signals of the rx frames.
    pub rx_latched: Box<[LatchedBit]>,
}

/// Never: earlier than any time of a clock.
const NEVER: i64 = i64::MIN;

/// Bytes of a frame that are fewer than what a comparison of memory begins to pay for.
const SMALL: usize = 8;

/// What both ends tell each other beside the frames.
#[derive(Debug)]
struct Beside {
    /// When the peer was last heard from.
    peer_alive: AtomicI64,
    /// When the simulation last ticked.
    tick_alive: AtomicI64,
    /// Bus cycles received.
    cycles: AtomicU64,
    /// The peer declares its data invalid, or a signal that should change does not.
    invalid: AtomicBool,
}

/// The tick's end of a station.
#[derive(Debug)]
pub struct TickStation {
    tx: Writer<Frame>,
    tx_edges: EdgeCounter,
    /// The signals of the bits whose edges are counted there.
    tx_signals: Box<[usize]>,
    tx_sequence: u64,
    /// The bytes published last, up to eight, as a number whose least significant byte comes first.
    published_word: u64,
    rx: Reader<Frame>,
    /// Of the frame shown last.
    rx_sequence: u64,
    rx_shaper: PulseShaper,
    shaped: Box<[u8]>,
    /// Whether `shaped` holds what was shown last, rather than the frame.
    forced: bool,
    beside: Arc<Beside>,
}

/// Receives what [`TickStation::read`] shows.
pub trait Receiver {
    /// The frame's bytes, with every edge made visible; called when they may have changed.
    fn levels(&mut self, bytes: &[u8]);

    /// How many edges of the latched signal with this index in the signal table have arrived since the last
    /// read; called for every latched signal whenever any count may have changed.
    fn edges(&mut self, signal: usize, count: u32);
}

/// The result of [`TickStation::read`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// A whole new bus cycle has arrived since the last read.
    pub fresh: bool,
    /// The bytes to show differ, or may differ, from those shown last.
    pub changed: bool,
    /// Time since the peer was last heard from; [`Nanos::MAX`] if it never was.
    pub age: Nanos,
    /// Sequence number of the frame shown.
    pub sequence: u64,
}

/// The bus's end of a station.
#[derive(Debug)]
pub struct BusStation {
    rx: Writer<Frame>,
    rx_edges: EdgeCounter,
    rx_sequence: u64,
    rx_len: usize,
    tx: Reader<Frame>,
    tx_shaper: PulseShaper,
    tx_fail_safe: Box<[u8]>,
    /// The frame with its pulses shaped, if they need it.
    shaped: Box<[u8]>,
    last_outgoing: Outgoing,
    beside: Arc<Beside>,
}

/// Which bytes are sent.
#[derive(Clone, Copy, Debug)]
enum Outgoing {
    /// Those of the frame, which needs no shaping.
    Frame,
    /// The shaped ones.
    Shaped,
    /// The fail-safe ones.
    FailSafe,
}

/// Creates the two ends of one station.
pub fn station(directions: StationStreams) -> (TickStation, BusStation) {
    let StationStreams {
        tx_fail_safe,
        tx_latched,
        rx_fail_safe,
        rx_latched,
    } = directions;
    let frame = |bytes: &[u8], latched: &[LatchedBit]| Frame {
        bytes: bytes.into(),
        edges: vec![0; latched.len()].into(),
        sequence: 0,
    };
    let (tx_writer, tx_reader) = triple_buffer(&frame(&tx_fail_safe, &tx_latched));
    let (rx_writer, rx_reader) = triple_buffer(&frame(&rx_fail_safe, &rx_latched));
    let beside = Arc::new(Beside {
        peer_alive: AtomicI64::new(NEVER),
        tick_alive: AtomicI64::new(NEVER),
        cycles: AtomicU64::new(0),
        invalid: AtomicBool::new(false),
    });
    let tick = TickStation {
        tx: tx_writer,
        tx_edges: EdgeCounter::new(&tx_latched, &tx_fail_safe),
        tx_signals: tx_latched.iter().map(|bit| bit.signal).collect(),
        tx_sequence: 0,
        published_word: as_word(&tx_fail_safe),
        rx: rx_reader,
        rx_sequence: 0,
        rx_shaper: PulseShaper::new(rx_latched.clone(), &rx_fail_safe),
        shaped: rx_fail_safe.clone(),
        forced: false,
        beside: Arc::clone(&beside),
    };
    let bus = BusStation {
        rx: rx_writer,
        rx_edges: EdgeCounter::new(&rx_latched, &rx_fail_safe),
        rx_sequence: 0,
        rx_len: rx_fail_safe.len(),
        tx: tx_reader,
        tx_shaper: PulseShaper::new(tx_latched, &tx_fail_safe),
        shaped: tx_fail_safe.clone(),
        tx_fail_safe,
        last_outgoing: Outgoing::FailSafe,
        beside,
    };
    (tick, bus)
}

/// `now - then`, for a `then` that may be [`NEVER`].
#[inline]
fn age(now: Nanos, then: i64) -> Nanos {
    if then == NEVER {
        Nanos::MAX
    } else {
        (now - Nanos(then)).max(Nanos::ZERO)
    }
}

/// The first eight bytes, or as many as there are, as a number whose least significant byte comes first.
fn as_word(bytes: &[u8]) -> u64 {
    let mut word = [0; size_of::<u64>()];
    for (to, from) in word.iter_mut().zip(bytes) {
        *to = *from;
    }
    u64::from_le_bytes(word)
}

/// Whether two frames differ. Small ones were written byte by byte a moment ago: compared as words, they would be waited
/// for.
#[inline]
fn differ(one: &[u8], other: &[u8]) -> bool {
    if one.len() == other.len() && one.len() <= SMALL {
        return one.iter().zip(other).any(|(one, other)| one != other);
    }
    one != other
}

impl TickStation {
    /// Lets `encode` write the whole tx frame; if that changed it, counts its edges and publishes it to the
    /// bus. Most ticks change nothing, and need no hand-over.
    #[inline]
    pub fn write<R>(&mut self, now: Nanos, encode: impl FnOnce(&mut [u8]) -> R) -> R {
        let (edges, sequence) = (&mut self.tx_edges, self.tx_sequence + 1);
        let (word, result) = self.tx.with_last(|frame, last| {
            let result = encode(&mut frame.bytes);
            let changed = differ(&frame.bytes, &last.bytes).then(|| {
                edges.count(&frame.bytes, &mut frame.edges);
                frame.sequence = sequence;
                as_word(&frame.bytes)
            });
            (changed, result)
        });
        if let Some(word) = word {
            self.publish(word);
        }
        self.beside.tick_alive.store(now.0, Ordering::Relaxed);
        result
    }

    /// As [`write`](Self::write), of a frame of up to eight bytes that are at hand as a number, the least significant byte
    /// first: a tick that changes nothing then touches no frame.
    #[inline]
    pub fn write_word(&mut self, now: Nanos, word: u64) {
        if word != self.published_word {
            self.publish_word(word);
        }
        self.beside.tick_alive.store(now.0, Ordering::Relaxed);
    }

    /// Publishes another frame than the last one.
    #[inline(never)]
    fn publish_word(&mut self, word: u64) {
        let (edges, sequence) = (&mut self.tx_edges, self.tx_sequence + 1);
        self.tx.with_buffer(|frame| {
            for (to, from) in frame.bytes.iter_mut().zip(word.to_le_bytes()) {
                *to = from;
            }
            edges.count(&frame.bytes, &mut frame.edges);
            frame.sequence = sequence;
        });
        self.publish(word);
    }

    /// Hands the frame over, whose first bytes are these.
    #[inline]
    fn publish(&mut self, word: u64) {
        self.published_word = word;
        self.tx_sequence += 1;
        self.tx.publish();
    }

    /// The age of the peer and the sequence number of the frame shown, if [`read`](Self::read) would find nothing to show.
    #[inline]
    pub fn unchanged(&self, now: Nanos) -> Option<(Nanos, u64)> {
        if self.forced || self.rx_shaper.is_busy() || self.rx.has_news() {
            return None;
        }
        Some((self.peer_age(now), self.rx_sequence))
    }

    /// Takes over the newest rx frame and shows it to `receiver`, if there is anything new to show.
    #[inline]
    pub fn read(&mut self, now: Nanos, receiver: &mut impl Receiver) -> Arrival {
        let fresh = self.rx.update();
        let age = age(now, self.beside.peer_alive.load(Ordering::Relaxed));
        // The most common tick finds nothing: the simulation ticks faster than the bus.
        let changed = fresh || self.forced || self.rx_shaper.is_busy();
        if changed {
            self.show(now, receiver);
        }
        Arrival {
            fresh,
            changed,
            age,
            sequence: self.rx_sequence,
        }
    }

    /// Shows the frame taken over last to `receiver`.
    #[inline(never)]
    fn show(&mut self, now: Nanos, receiver: &mut impl Receiver) {
        let (shaper, shaped, forced) = (&mut self.rx_shaper, &mut self.shaped, &mut self.forced);
        self.rx.with(|frame| {
            self.rx_sequence = frame.sequence;
            let shapes = shaper.needs_shaping(&frame.edges);
            if shapes {
                for (bit, count) in shaper.bits().iter().zip(shaper.new_edges(&frame.edges)) {
                    receiver.edges(bit.signal, count);
                }
                shaped.copy_from_slice(&frame.bytes);
                shaper.shape(&frame.edges, now, shaped);
                shaper.confirm();
                receiver.levels(shaped);
            } else {
                if *forced {
                    // No edge now, but there were some at the last read.
                    shaper
                        .bits()
                        .iter()
                        .for_each(|bit| receiver.edges(bit.signal, 0));
                }
                shaper.pass(&frame.bytes);
                shaper.confirm();
                receiver.levels(&frame.bytes);
            }
            *forced = shapes;
        });
    }

    /// Records that the simulation sees levels other than the frame's (fail-safe values), so that the next
    /// [`read`](Self::read) shows the frame again.
    ///
    /// The shaper continues from what the peer showed last: if a level is on by its fail-safe value, and the
    /// peer switches it on when it returns, it must not drop in between to show that edge.
    pub fn shown_instead(&mut self) {
        self.forced = true;
    }

    /// Time since the peer was last heard from; [`Nanos::MAX`] if it never was.
    #[inline]
    pub fn peer_age(&self, now: Nanos) -> Nanos {
        age(now, self.beside.peer_alive.load(Ordering::Relaxed))
    }

    /// Whether the data of the peer are valid. Ask before [`read`](Self::read) and again after it: if both
    /// answers are yes, the frame that was read is not from an invalid period.
    #[inline]
    pub fn is_valid(&self) -> bool {
        !self.beside.invalid.load(Ordering::Acquire)
    }

    /// Tells of every latched signal, by its index in the signal table, how many edges there were so far, of both
    /// directions; the counts wrap.
    pub fn edges(&self, mut tell: impl FnMut(usize, u32)) {
        for (signal, count) in self.tx_signals.iter().zip(self.tx_edges.counts()) {
            tell(*signal, *count);
        }
        self.rx.with(|frame| {
            for (bit, count) in self.rx_shaper.bits().iter().zip(&frame.edges) {
                tell(bit.signal, *count);
            }
        });
    }

    /// Whole bus cycles received so far.
    pub fn cycles(&self) -> u64 {
        self.beside.cycles.load(Ordering::Relaxed)
    }
}

impl BusStation {
    /// The bytes to send in an exchange at `now`: the latest tx frame with its pulses shaped, or the
    /// fail-safe bytes if the simulation has not ticked for longer than `watchdog`, or never.
    ///
    /// A pulse counts as sent only when [`sent`](Self::sent) is called.
    pub fn outgoing(&mut self, now: Nanos, watchdog: Option<Nanos>) -> &[u8] {
        self.tx.update();
        self.last_outgoing = if watchdog.is_some_and(|limit| self.tick_age(now) > limit) {
            self.tx_shaper.pass_instead(&self.tx_fail_safe);
            Outgoing::FailSafe
        } else {
            let (shaper, shaped, frame) = (&mut self.tx_shaper, &mut self.shaped, self.tx.value());
            if shaper.needs_shaping(&frame.edges) {
                shaped.copy_from_slice(&frame.bytes);
                shaper.shape(&frame.edges, now, shaped);
                Outgoing::Shaped
            } else {
                shaper.pass(&frame.bytes);
                Outgoing::Frame
            }
        };
        self.last_outgoing()
    }

    /// The exchange that carried the bytes of [`outgoing`](Self::outgoing) was completed.
    #[inline]
    pub fn sent(&mut self) {
        self.tx_shaper.confirm();
    }

    /// The exchange carried only these bits of [`outgoing`](Self::outgoing) and was completed; bit n of byte
    /// k is 8k + n.
    pub fn sent_bits(&mut self, bits: &Range<usize>) {
        self.tx_shaper.confirm_bits(bits);
    }

    /// Time since the last tick of the simulation; [`Nanos::MAX`] before the first one.
    #[inline]
    pub fn tick_age(&self, now: Nanos) -> Nanos {
        age(now, self.beside.tick_alive.load(Ordering::Relaxed))
    }

    /// Time since the peer was last heard from; [`Nanos::MAX`] if it never was.
    #[inline]
    pub fn peer_age(&self, now: Nanos) -> Nanos {
        age(now, self.beside.peer_alive.load(Ordering::Relaxed))
    }

    /// A whole bus cycle has arrived: counts its edges and publishes it to the tick.
    ///
    /// # Panics
    ///
    /// When `bytes` is not exactly as long as the station's rx frame: wire code must check lengths.
    pub fn received(&mut self, now: Nanos, bytes: &[u8]) {
        assert_eq!(
            bytes.len(),
            self.rx_len,
            "a received frame must have the station's size"
        );
        let (edges, sequence) = (&mut self.rx_edges, self.rx_sequence + 1);
        self.rx.with_buffer(|frame| {
            copy_frame(&mut frame.bytes, bytes);
            edges.count(bytes, &mut frame.edges);
            frame.sequence = sequence;
        });
        self.rx_sequence = sequence;
        // The time first, so that no reader of the frame thinks it old.
        self.touch(now);
        self.rx.publish();
        // Nobody else counts.
        let cycles = self.beside.cycles.load(Ordering::Relaxed);
        self.beside.cycles.store(cycles + 1, Ordering::Relaxed);
    }

    /// The peer is alive, though it sent no new data.
    #[inline]
    pub fn touch(&mut self, now: Nanos) {
        self.beside.peer_alive.store(now.0, Ordering::Relaxed);
    }

    /// Sets whether the peer's data are valid. When they become valid again, hand them in before this call.
    pub fn set_valid(&mut self, valid: bool) {
        // Released after the frame: a tick that sees the flag also sees the frame.
        self.beside.invalid.store(!valid, Ordering::Release);
    }

    /// The bytes sent last, or about to be sent.
    #[inline]
    pub fn last_outgoing(&self) -> &[u8] {
        match self.last_outgoing {
            Outgoing::Frame => &self.tx.value().bytes,
            Outgoing::Shaped => &self.shaped,
            Outgoing::FailSafe => &self.tx_fail_safe,
        }
    }

    /// The latched bits of outgoing frames.
    pub fn tx_latched(&self) -> &[LatchedBit] {
        self.tx_shaper.bits()
    }

    /// Size of incoming frames, in bytes.
    pub fn rx_len(&self) -> usize {
        self.rx_len
    }

    /// Size of outgoing frames, in bytes.
    pub fn tx_len(&self) -> usize {
        self.shaped.len()
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use crate::signal::Latch;

    fn one_latched_byte() -> (TickStation, BusStation) {
        let latched: Box<[LatchedBit]> = Box::new([LatchedBit {
            signal: 7,
            byte: 0,
            mask: 1,
            latch: Latch::Rising,
            hold: Nanos::ZERO,
        }]);
        station(StationStreams {
            tx_fail_safe: Box::new([0x80]),
            tx_latched: latched.clone(),
            rx_fail_safe: Box::new([0]),
            rx_latched: latched,
        })
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

    fn read(tick: &mut TickStation, now: i64) -> (Arrival, Option<u8>, Vec<(usize, u32)>) {
        let mut seen = Seen::default();
        let arrival = tick.read(Nanos(now), &mut seen);
        (arrival, seen.level, seen.edges)
    }

    #[test]
    fn a_pulse_between_two_ticks_is_seen_for_one_tick_and_counted() {
        let (mut tick, mut bus) = one_latched_byte();
        assert_eq!(
            read(&mut tick, 0),
            (
                Arrival {
                    fresh: false,
                    changed: false,
                    age: Nanos::MAX,
                    sequence: 0
                },
                None,
                vec![],
            )
        );
        for bytes in [[1], [0], [1], [0]] {
            bus.received(Nanos(5), &bytes);
        }
        let (arrival, shown, edges) = read(&mut tick, 8);
        assert!(arrival.fresh);
        assert_eq!((arrival.age, arrival.sequence), (Nanos(3), 4));
        assert_eq!((shown, edges), (Some(1), vec![(7, 2)]));
        let (arrival, shown, edges) = read(&mut tick, 9);
        assert!(!arrival.fresh && arrival.changed);
        assert_eq!((shown, edges), (Some(0), vec![(7, 0)]));
        read(&mut tick, 10);
        assert_eq!(read(&mut tick, 11).1, None);
    }

    #[test]
    fn a_frame_at_hand_as_a_word_is_written_like_any_other() {
        let (mut tick, mut bus) = one_latched_byte();
        for level in [0x80, 1, 0, 0] {
            tick.write_word(Nanos(1), level);
        }
        assert_eq!(bus.outgoing(Nanos(2), None), [1], "the pulse is not lost");
        bus.sent();
        assert_eq!(bus.outgoing(Nanos(2), None), [0]);
        tick.write(Nanos(5), |bytes| bytes[0] = 6);
        tick.write_word(Nanos(7), 6);
        assert_eq!(bus.tick_age(Nanos(8)), Nanos(1), "alive, though unchanged");
        assert_eq!(bus.outgoing(Nanos(8), None), [6]);
        tick.write_word(Nanos(8), 2);
        assert_eq!(bus.outgoing(Nanos(8), None), [2]);
    }

    #[test]
    fn a_tick_without_news_has_nothing_to_read() {
        let (mut tick, mut bus) = one_latched_byte();
        assert_eq!(tick.unchanged(Nanos(1)), Some((Nanos::MAX, 0)));
        bus.received(Nanos(5), &[1]);
        bus.received(Nanos(5), &[0]);
        assert_eq!(tick.unchanged(Nanos(8)), None, "a frame");
        read(&mut tick, 8);
        assert_eq!(tick.unchanged(Nanos(9)), None, "the pulse is still shown");
        read(&mut tick, 9);
        assert_eq!(tick.unchanged(Nanos(9)), None, "and its end once more");
        read(&mut tick, 10);
        assert_eq!(tick.unchanged(Nanos(10)), Some((Nanos(5), 2)));
        tick.shown_instead();
        assert_eq!(
            tick.unchanged(Nanos(10)),
            None,
            "the levels are to be shown"
        );
    }

    #[test]
    fn a_pulse_between_two_exchanges_is_sent_until_one_was_completed() {
        let (mut tick, mut bus) = one_latched_byte();
        for level in [0, 1, 0] {
            tick.write(Nanos(1), |bytes| bytes[0] = level);
        }
        assert_eq!(bus.outgoing(Nanos(2), None), [1]);
        assert_eq!(bus.outgoing(Nanos(3), None), [1]);
        bus.sent();
        assert_eq!(bus.outgoing(Nanos(4), None), [0]);
        bus.sent();
        assert_eq!(bus.outgoing(Nanos(5), None), [0]);
    }

    #[test]
    fn when_the_simulation_stops_the_peer_gets_the_fail_safe_bytes() {
        let (mut tick, mut bus) = one_latched_byte();
        let watchdog = Some(Nanos(10));
        assert_eq!(
            bus.outgoing(Nanos(0), watchdog),
            [0x80],
            "before the first tick"
        );
        tick.write(Nanos(0), |bytes| bytes[0] = 2);
        assert_eq!(bus.outgoing(Nanos(10), watchdog), [2]);
        assert_eq!(bus.outgoing(Nanos(11), watchdog), [0x80]);
        tick.write(Nanos(12), |bytes| bytes[0] = 2);
        assert_eq!(bus.outgoing(Nanos(13), watchdog), [2]);
    }

    #[test]
    fn the_bytes_sent_last_stay_at_hand_however_they_came_about() {
        let (mut tick, mut bus) = one_latched_byte();
        assert_eq!(bus.last_outgoing(), [0x80]);
        for level in [1, 0] {
            tick.write(Nanos(1), |bytes| bytes[0] = level);
        }
        // The pulse, what the tick writes meanwhile, and the fail-safe bytes at the end.
        for (now, expected, next) in [(2, 1, 0x42), (3, 0x42, 0x44), (20, 0x80, 0x46)] {
            assert_eq!(bus.outgoing(Nanos(now), Some(Nanos(10))), [expected]);
            bus.sent();
            tick.write(Nanos(5), |bytes| bytes[0] = next);
            assert_eq!(bus.last_outgoing(), [expected], "at {now}");
        }
    }

    #[test]
    fn a_pulse_that_fail_safe_bytes_overtook_is_sent_after_them() {
        let (mut tick, mut bus) = one_latched_byte();
        let watchdog = Some(Nanos(10));
        for level in [0, 1, 0] {
            tick.write(Nanos(0), |bytes| bytes[0] = level);
        }
        assert_eq!(bus.outgoing(Nanos(1), watchdog), [1], "shown, not sent");
        assert_eq!(bus.outgoing(Nanos(20), watchdog), [0x80]);
        bus.sent();
        tick.write(Nanos(21), |bytes| bytes[0] = 0);
        assert_eq!(bus.outgoing(Nanos(22), watchdog), [1]);
        bus.sent();
        assert_eq!(bus.outgoing(Nanos(23), watchdog), [0]);
    }

    #[test]
    fn a_pulse_is_sent_by_its_own_bit_and_not_by_another_one_of_its_byte() {
        let (mut tick, mut bus) = one_latched_byte();
        for level in [0, 1, 0] {
            tick.write(Nanos(0), |bytes| bytes[0] = level);
        }
        for bits in [1..8, 8..16, 0..0] {
            assert_eq!(bus.outgoing(Nanos(1), None), [1]);
            bus.sent_bits(&bits);
        }
        assert_eq!(bus.outgoing(Nanos(2), None), [1]);
        bus.sent_bits(&(0..1));
        assert_eq!(bus.outgoing(Nanos(3), None), [0]);
    }

    #[test]
    fn a_level_that_is_on_by_its_fail_safe_value_does_not_drop_when_the_peer_switches_it_on() {
        let (mut tick, mut bus) = one_latched_byte();
        bus.received(Nanos(0), &[0]);
        read(&mut tick, 0);
        // The peer is silent, and the simulation is shown the bit on in its place.
        tick.shown_instead();
        bus.received(Nanos(90), &[1]);
        let (_, shown, edges) = read(&mut tick, 90);
        assert_eq!((shown, edges), (Some(1), vec![(7, 1)]));
        assert_eq!(read(&mut tick, 91).1, Some(1), "and stays");
    }

    #[test]
    fn touch_keeps_the_age_down_without_new_data() {
        let (mut tick, mut bus) = one_latched_byte();
        bus.received(Nanos(0), &[0]);
        read(&mut tick, 0);
        bus.touch(Nanos(90));
        let (arrival, _, _) = read(&mut tick, 100);
        assert_eq!((arrival.fresh, arrival.age), (false, Nanos(10)));
    }

    #[test]
    #[should_panic(expected = "must have the station's size")]
    fn a_frame_of_the_wrong_size_never_gets_in() {
        let (_tick, mut bus) = one_latched_byte();
        bus.received(Nanos(0), &[0, 0]);
    }
}
