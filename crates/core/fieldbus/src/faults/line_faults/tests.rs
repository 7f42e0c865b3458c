use proptest::prelude::*;

use super::outgoing::PATIENCE;
use super::*;
use crate::faults::TickTime;
use crate::faults::{Begin, Direction, Effect, Fault, Faults, Lasts, Slots};
use tickbus_image::signal::{Area, SignalTable};

/// A line of one station with one latched byte and one other byte, and the tick that controls its faults.
struct Rig {
    faults: Faults,
    board: Arc<FaultBoard>,
    wires: LineFaults,
    tick: u64,
}

/// A table for the names of two stations.
fn two_stations() -> SignalTable {
    let one = SignalTable::of_one_station(2, 2, Vec::new());
    SignalTable {
        stations: [&one.stations[..], &one.stations].concat(),
        ..one
    }
}

impl Rig {
    fn new() -> Self {
        Self::of_stations(1)
    }

    fn of_stations(count: usize) -> Self {
        Self::taken(count, Taken::At(Nanos::ZERO))
    }

    fn taken(count: usize, taken: Taken) -> Self {
        let board = Arc::<FaultBoard>::default();
        let shape = Shape {
            last_sent: Box::new([0, 0]),
            taken,
            latched: Box::new([0xFF, 0]),
            rx_len: 2,
        };
        Self {
            faults: Faults::new(Arc::clone(&board)),
            wires: LineFaults::new(Arc::clone(&board), std::iter::repeat_n(shape, count)),
            board,
            tick: 0,
        }
    }

    fn add(&mut self, trouble: LineEffect, seed: u64) -> u32 {
        let fault = Fault {
            name: "x".to_owned(),
            effect: Effect::Line(trouble),
            begin: Begin::AtOnce,
            lasts: Lasts::UntilEnded,
            times: 1,
            seed,
        };
        let slots = Slots {
            table: &two_stations(),
            writes: Area::Input,
            edges: &[],
        };
        let id = self.faults.add(&fault, slots).expect("there is room");
        for fault in self.board.take_line_faults() {
            self.wires.adopt(fault);
        }
        self.tick();
        id
    }

    fn end(&mut self, id: u32) {
        assert!(self.faults.end(id));
        self.tick();
    }

    fn tick(&mut self) {
        self.tick += 1;
        let moment = TickTime {
            time: Nanos::ZERO,
            tick: self.tick,
        };
        self.faults.begin_tick(moment, &mut []);
        self.wires.look();
    }

    /// One cycle of sending. Returns the bytes sent, and true if the image may regard them as sent.
    fn send(&mut self, now: i64, image: [u8; 2], taken: bool) -> ([u8; 2], bool) {
        self.send_to(0, now, image, taken)
    }

    fn send_to(
        &mut self,
        station: usize,
        now: i64,
        image: [u8; 2],
        taken: bool,
    ) -> ([u8; 2], bool) {
        let repeats = self.wires.repeats(station, Nanos(now));
        let is_given = !repeats && !self.wires.is_cut(station);
        let mut confirmed = is_given && self.wires.takes(station, Nanos(now), &image);
        let out = self.wires.outgoing(station).try_into().expect("two bytes");
        if taken {
            confirmed |= self.wires.sent(station, None);
        }
        (out, confirmed)
    }

    /// Hands a frame to the line; returns the bytes that are delivered at `now`.
    fn receive(&mut self, now: i64, frame: Option<u8>) -> Vec<u8> {
        let mut come = self.released(now);
        if let Some(frame) = frame
            && let Fate::Passes(times) = self.wires.arrives(0, Nanos(now), &[frame, !frame])
        {
            come.extend(std::iter::repeat_n(
                frame,
                usize::try_from(times).expect("few"),
            ));
        }
        come
    }

    fn released(&mut self, now: i64) -> Vec<u8> {
        let mut come = Vec::new();
        let mut frame = [0; 2];
        while self.wires.release(0, Nanos(now), &mut frame).is_some() {
            assert_eq!(frame[0], !frame[1], "a whole frame");
            come.push(frame[0]);
        }
        come
    }
}

#[test]
fn a_delay_holds_frames_back_and_hands_all_in_when_it_ends() {
    let mut rig = Rig::new();
    assert_eq!(rig.receive(0, Some(1)), [1]);
    let delay = rig.add(LineEffect::Delay(Nanos(20)), 1);
    assert_eq!(rig.receive(10, Some(2)), Vec::<u8>::new());
    assert_eq!(rig.wires.due(), Nanos(30));
    assert!(rig.wires.withholds(0));
    assert_eq!(rig.receive(20, Some(3)), Vec::<u8>::new());
    assert_eq!(rig.receive(30, Some(4)), [2]);
    assert_eq!(rig.receive(41, None), [3]);
    rig.end(delay);
    assert_eq!(rig.receive(42, Some(5)), [4, 5]);
    assert_eq!(rig.wires.due(), Nanos::MAX);
    assert_eq!(rig.receive(43, Some(6)), [6]);
}

#[test]
fn two_delays_add_up_and_the_longer_end_sooner_without_the_other() {
    let mut rig = Rig::new();
    rig.add(LineEffect::Delay(Nanos(10)), 1);
    let second = rig.add(LineEffect::Delay(Nanos(5)), 1);
    assert_eq!(rig.receive(0, Some(1)), Vec::<u8>::new());
    assert_eq!(rig.receive(14, Some(2)), Vec::<u8>::new());
    assert_eq!(rig.receive(15, None), [1]);
    rig.end(second);
    assert_eq!(rig.receive(23, None), Vec::<u8>::new());
    assert_eq!(rig.receive(24, None), [2]);
}

#[test]
fn a_delay_that_holds_more_than_fits_hands_the_oldest_in_early_and_says_so() {
    let mut rig = Rig::new();
    rig.add(LineEffect::Delay(Nanos::from_secs(60)), 1);
    let mut come = Vec::new();
    for now in 0..10_000_i64 {
        come.extend(rig.receive(now, Some(u8::try_from(now % 251).expect("small"))));
    }
    assert!(come.len() > 5_000, "{}", come.len());
    let expected = (0..come.len()).map(|index| u8::try_from(index % 251).expect("small"));
    assert!(come.iter().copied().eq(expected), "none is lost");
    assert!(rig.board.hurried.load(Ordering::Relaxed) > 5_000);
}

#[test]
fn slow_answers_send_what_was_true_before() {
    let mut rig = Rig::new();
    assert_eq!(rig.send(0, [0, 1], true), ([0, 1], true));
    let slow = rig.add(LineEffect::LateValues(Nanos(20)), 1);
    assert_eq!(rig.send(10, [0, 2], true), ([0, 1], true));
    assert_eq!(rig.send(20, [0, 3], true), ([0, 1], true));
    assert_eq!(rig.send(30, [0, 4], true), ([0, 2], true));
    assert_eq!(rig.send(40, [0, 4], true), ([0, 3], true));
    rig.end(slow);
    assert_eq!(rig.send(41, [0, 5], true).0, [0, 5], "true at once");
    assert_eq!(rig.send(42, [0, 6], true), ([0, 6], true));
}

#[test]
fn what_waited_for_a_link_is_not_held_back_again_and_nothing_of_before_is_repeated() {
    let mut rig = Rig::new();
    rig.add(LineEffect::LateValues(Nanos(20)), 1);
    assert_eq!(rig.send(0, [0, 1], true).0, [0, 0]);
    assert_eq!(rig.send(20, [0, 2], true).0, [0, 1]);
    let down = rig.add(LineEffect::LinkDown, 1);
    rig.end(down);
    assert_eq!(rig.send(1_000, [0, 50], true).0, [0, 50]);
    assert_eq!(rig.send(1_001, [0, 51], true).0, [0, 50]);
    assert_eq!(rig.send(1_021, [0, 52], true).0, [0, 51]);
    let later = 1_022 + PATIENCE.0;
    assert_eq!(rig.send(later, [0, 80], true).0, [0, 80]);
    assert_eq!(rig.send(later + 1, [0, 81], true).0, [0, 80]);

    let mut rig = Rig::new();
    rig.add(LineEffect::LateValues(Nanos(20)), 1);
    rig.send(0, [1, 1], true);
    rig.send(1, [0, 2], true);
    let down = rig.add(LineEffect::LinkDown, 1);
    rig.end(down);
    assert_eq!(rig.send(1_000, [0, 50], true).0, [1, 50], "the pulse");
    assert_eq!(rig.send(1_001, [0, 51], true).0, [0, 50], "and its end");
    assert_eq!(rig.send(1_021, [0, 52], true).0, [0, 51]);

    let mut rig = Rig::new();
    rig.add(LineEffect::Duplicate(1.0, Direction::Out), 1);
    rig.send(0, [0, 1], true);
    let down = rig.add(LineEffect::LinkDown, 1);
    rig.end(down);
    assert_eq!(rig.send(1_000, [0, 50], true).0, [0, 50]);
    assert_eq!(rig.send(1_001, [0, 51], true).0, [0, 50], "twice again");
    let later = 1_002 + PATIENCE.0;
    assert_eq!(
        rig.send(later, [0, 80], true).0,
        [0, 80],
        "not after a pause"
    );
}

#[test]
fn the_first_fault_repeats_nothing_of_before_the_line_was_opened_and_nothing_that_is_old() {
    let first = |taken| {
        let mut rig = Rig::taken(1, taken);
        rig.add(LineEffect::LateValues(Nanos(20)), 1);
        rig.send(2 * PATIENCE.0, [0, 9], true).0
    };
    assert_eq!(first(Taken::Before), [0, 9]);
    assert_eq!(first(Taken::At(Nanos::ZERO)), [0, 9]);
    assert_eq!(first(Taken::At(PATIENCE)), [0, 0]);
    assert_eq!(first(Taken::Never), [0, 0]);
    let mut taken = Taken::Never;
    taken.reopen();
    assert_eq!(taken, Taken::Never, "nothing was sent before");
}

#[test]
fn latched_bits_of_after_an_outage_are_as_young_as_the_values() {
    let mut rig = Rig::new();
    rig.add(LineEffect::LateValues(Nanos(20_000)), 1);
    rig.send(0, [0, 1], true);
    rig.send(1, [0, 2], true);
    let down = rig.add(LineEffect::LinkDown, 1);
    rig.end(down);
    assert_eq!(rig.send(1_000, [1, 50], true).0, [1, 50]);
}

#[test]
fn a_held_pulse_outlives_a_station_that_is_cut_off() {
    let mut rig = Rig::new();
    let slow = rig.add(LineEffect::LateValues(Nanos(10)), 1);
    rig.send(0, [1, 1], false);
    rig.send(1, [0, 2], false);
    assert_eq!(rig.send(20, [0, 2], false).0, [1, 1]);
    let down = rig.add(LineEffect::StationDown(0), 1);
    rig.send(21, [0, 2], true);
    rig.end(down);
    rig.end(slow);
    assert_eq!(rig.send(22, [0, 2], true).0, [1, 2], "the pulse");
    assert_eq!(rig.send(23, [0, 2], true).0, [0, 2]);
}

#[test]
fn a_station_that_is_cut_off_repeats_nothing_of_before_and_keeps_no_other_from_it() {
    let mut rig = Rig::taken(2, Taken::Never);
    for station in 0..2 {
        rig.send_to(station, 0, [0, 1], true);
    }
    let down = rig.add(LineEffect::StationDown(0), 1);
    rig.add(LineEffect::Duplicate(1.0, Direction::Out), 1);
    for cycle in 1..5 {
        let now = cycle * PATIENCE.0 / 2;
        rig.send_to(0, now, [0, 2], true);
        assert_eq!(rig.send_to(1, now, [0, 2], true).0, [0, 1], "{cycle}");
    }
    assert_eq!(rig.board.duplicated.load(Ordering::Relaxed), 4);
    rig.end(down);
    let now = 3 * PATIENCE.0;
    assert_eq!(rig.send_to(0, now, [0, 3], true).0, [0, 3]);
}

#[test]
fn cycles_without_a_pause_are_repeated_for_as_long_as_the_fault_lasts() {
    let mut rig = Rig::new();
    rig.send(0, [0, 1], true);
    rig.add(LineEffect::Duplicate(1.0, Direction::Out), 1);
    let step = PATIENCE.0 / 2;
    for cycle in 1..6 {
        assert_eq!(rig.send(cycle * step, [0, 2], true).0, [0, 1], "{cycle}");
    }
}

#[test]
fn a_pulse_that_waits_is_sent_though_its_fault_ends_and_values_are_true_at_once() {
    let mut rig = Rig::new();
    let slow = rig.add(LineEffect::LateValues(Nanos(20)), 1);
    for (now, level) in [(0, 1), (1, 0), (2, 1), (3, 0)] {
        assert_eq!(rig.send(now, [level, 7], true).0, [0, 0]);
    }
    rig.end(slow);
    let sent: Vec<[u8; 2]> = (4..10).map(|now| rig.send(now, [0, 9], true).0).collect();
    assert_eq!(sent, [[1, 9], [0, 9], [1, 9], [0, 9], [0, 9], [0, 9]]);
}

#[test]
fn values_do_not_go_back_when_the_next_fault_begins_before_all_edges_were_shown() {
    let mut rig = Rig::new();
    let slow = rig.add(LineEffect::LateValues(Nanos(20)), 1);
    for now in 0..6_u8 {
        rig.send(now.into(), [now & 1, 1 + now], true);
    }
    rig.end(slow);
    assert_eq!(rig.send(6, [0, 7], true).0, [1, 7]);
    rig.add(LineEffect::LateValues(Nanos(20)), 1);
    let sent = (7..60).map(|now: u8| rig.send(now.into(), [0, 1 + now], true).0);
    let sent: Vec<[u8; 2]> = sent.collect();
    assert!(sent.is_sorted_by_key(|bytes| bytes[1]), "{sent:?}");
    let edges = sent.windows(2).filter(|pair| pair[0][0] < pair[1][0]);
    assert_eq!(edges.count(), 2, "no edge is lost: {sent:?}");
    assert_eq!(sent.last(), Some(&[0, 40]));
}

#[test]
fn a_frame_that_the_peer_has_not_taken_keeps_its_pulse() {
    let mut rig = Rig::new();
    rig.add(LineEffect::LateValues(Nanos(10)), 1);
    rig.send(0, [1, 0], false);
    rig.send(1, [0, 0], false);
    for now in 20..25 {
        assert_eq!(rig.send(now, [0, 0], false).0, [1, 0], "not taken yet");
    }
    assert_eq!(rig.send(25, [0, 0], true).0, [1, 0]);
    assert_eq!(rig.send(26, [0, 0], true).0, [0, 0]);
}

#[test]
fn a_pulse_waits_for_the_peer_that_reads_other_bits_only() {
    let mut rig = Rig::new();
    rig.add(LineEffect::LateValues(Nanos(10)), 1);
    rig.send(0, [1, 5], false);
    rig.send(1, [0, 6], false);
    for bits in [8..16, 1..8] {
        assert_eq!(rig.send(20, [0, 6], false).0, [1, 5], "{bits:?}");
        rig.wires.sent(0, Some(&bits));
    }
    assert_eq!(rig.send(21, [0, 6], false).0, [1, 5]);
    rig.wires.sent(0, Some(&(0..1)));
    assert_eq!(rig.send(22, [0, 6], false).0, [0, 6]);
}

#[test]
fn a_pulse_that_the_peer_never_reads_holds_up_what_it_reads_once_and_not_for_ever() {
    let mut rig = Rig::new();
    let slow = rig.add(LineEffect::LateValues(Nanos(10)), 1);
    rig.send(0, [1, 5], false);
    rig.send(1, [0, 6], false);
    assert_eq!(rig.send(20, [0, 6], false).0, [1, 5]);
    // A peer that stopped polling gets current values when it comes back.
    let long = PATIENCE.0 * 5;
    assert_eq!(rig.send(long, [0, 6], false).0, [1, 6]);
    rig.wires.sent(0, Some(&(8..16)));
    assert_eq!(rig.send(long + 1, [0, 6], false).0, [1, 6]);
    let after = long + 1 + PATIENCE.0;
    assert_eq!(rig.send(after, [1, 7], false).0, [0, 6]);
    assert_eq!(rig.board.hurried.load(Ordering::Relaxed), 1);
    rig.send(after + 1, [0, 8], false);
    assert_eq!(rig.send(after + 20, [0, 8], false).0, [0, 8]);
    rig.end(slow);
    assert_eq!(rig.send(after + 21, [1, 9], false), ([1, 9], false));
    // Once the peer has read the bit, pulses of that bit wait for the peer again.
    rig.wires.sent(0, Some(&(0..1)));
    rig.add(LineEffect::LateValues(Nanos(10)), 1);
    rig.send(after + 30, [0, 0], false);
    rig.send(after + 31, [1, 0], false);
    assert_eq!(rig.send(after + 50, [1, 0], false).0, [0, 0]);
}

#[test]
fn a_link_that_is_down_takes_nothing_and_gives_nothing_back() {
    let mut rig = Rig::new();
    rig.send(0, [1, 2], true);
    let down = rig.add(LineEffect::LinkDown, 1);
    assert!(rig.wires.is_down() && rig.wires.is_cut(0));
    assert_eq!(rig.receive(1, Some(1)), Vec::<u8>::new());
    assert!(!rig.wires.repeats(0, Nanos(1)));
    assert_eq!(rig.wires.frozen(0), [1, 2]);
    assert!(!rig.wires.sent(0, None), "nothing counts as sent");
    rig.end(down);
    assert!(!rig.wires.is_down());
    assert_eq!(rig.receive(2, Some(2)), [2]);
    assert_eq!(rig.send(3, [5, 6], true), ([5, 6], true));
}

#[test]
fn a_station_whose_neighbour_is_silent_has_its_own_chances_and_keeps_nothing_of_a_fault_that_is_over()
 {
    let mut rig = Rig::of_stations(2);
    let comes = |rig: &mut Rig| rig.wires.arrives(1, Nanos::ZERO, &[1, 2]);
    let lost = rig.add(LineEffect::Drop(1.0, Direction::In), 1);
    for _ in 0..10 {
        assert_eq!(comes(&mut rig), Fate::Lost);
        assert!(rig.wires.withholds(1) && !rig.wires.withholds(0));
    }
    rig.end(lost);
    assert_eq!(comes(&mut rig), Fate::Passes(1));
    assert!(!rig.wires.withholds(1), "nothing is left of the fault");
    let repeated = rig.add(LineEffect::Duplicate(1.0, Direction::Both), 1);
    assert!(rig.wires.repeats(1, Nanos::ZERO));
    assert_eq!(comes(&mut rig), Fate::Passes(2));
    rig.end(repeated);
    assert!(!rig.wires.repeats(1, Nanos::ZERO));
    assert_eq!(comes(&mut rig), Fate::Passes(1));

    rig.add(LineEffect::Drop(0.25, Direction::In), 1);
    let lost = (0..1000).filter(|_| comes(&mut rig) == Fate::Lost).count();
    assert!((200..300).contains(&lost), "{lost}");
}

#[test]
fn the_stations_of_one_cycle_share_its_fate() {
    let mut rig = Rig::of_stations(3);
    rig.add(LineEffect::Drop(0.5, Direction::In), 1);
    rig.add(LineEffect::Duplicate(0.5, Direction::Out), 1);
    let (mut lost, mut repeated) = (0, 0);
    for now in 0..100 {
        let fates = [0, 1, 2].map(|station| rig.wires.arrives(station, Nanos(now), &[1, 2]));
        assert!(fates.iter().all(|fate| *fate == fates[0]), "{fates:?}");
        lost += usize::from(fates[0] == Fate::Lost);
        let repeats = [0, 1, 2].map(|station| rig.wires.repeats(station, Nanos::ZERO));
        assert!(repeats.iter().all(|one| *one == repeats[0]), "{repeats:?}");
        repeated += usize::from(repeats[0]);
    }
    assert!((30..70).contains(&lost) && (30..70).contains(&repeated));
    assert_eq!(rig.board.dropped.load(Ordering::Relaxed), lost as u64);
}

#[test]
fn frames_are_lost_and_doubled_as_often_as_asked() {
    let count = |trouble| {
        let mut rig = Rig::new();
        rig.add(trouble, 1);
        (0..1000)
            .map(|now| rig.receive(now, Some(1)).len())
            .sum::<usize>()
    };
    assert_eq!(count(LineEffect::Drop(1.0, Direction::In)), 0);
    assert_eq!(count(LineEffect::Drop(1.0, Direction::Out)), 1000);
    assert!((700..800).contains(&count(LineEffect::Drop(0.25, Direction::Both))));
    assert_eq!(count(LineEffect::Duplicate(1.0, Direction::In)), 2000);
    assert!((1200..1300).contains(&count(LineEffect::Duplicate(0.25, Direction::Both))));

    let mut rig = Rig::new();
    assert!(!rig.wires.loses_cycle());
    rig.add(LineEffect::Drop(0.25, Direction::Out), 1);
    let lost = (0..1000).filter(|_| rig.wires.loses_cycle()).count();
    assert!((200..300).contains(&lost), "{lost}");
    let mut rig = Rig::new();
    rig.send(0, [0, 1], true);
    rig.add(LineEffect::Duplicate(1.0, Direction::Out), 1);
    assert_eq!(rig.send(1, [0, 2], true).0, [0, 1]);
}

proptest! {
    #[test]
    fn delays_that_come_and_go_lose_nothing_and_keep_the_order(
        steps in prop::collection::vec((0..30_i64, any::<bool>(), 0..10_u8), 1..200),
    ) {
        let mut rig = Rig::new();
        let (mut now, mut sent, mut come) = (0, Vec::new(), Vec::new());
        let mut active = Vec::new();
        for (pause, arrives, what) in steps {
            now += pause;
            match what {
                0 | 1 => active.push(rig.add(LineEffect::Delay(Nanos(i64::from(what) * 40 + 10)), 1)),
                2 if !active.is_empty() => rig.end(active.remove(0)),
                _ => {}
            }
            let frame = arrives.then(|| u8::try_from(sent.len() % 256).expect("a byte"));
            sent.extend(frame);
            come.extend(rig.receive(now, frame));
            prop_assert!(sent.starts_with(&come));
        }
        for id in active {
            rig.end(id);
        }
        come.extend(rig.released(now));
        prop_assert_eq!(sent, come);
    }

    #[test]
    fn slow_answers_that_come_and_go_lose_no_edge(
        levels in prop::collection::vec((0..30_i64, 0..2_u8, any::<bool>(), 0..12_u8), 1..200),
    ) {
        let mut rig = Rig::new();
        let mut now = 0;
        let (mut confirmed, mut seen) = (vec![0], vec![0]);
        let mut slow = None;
        // An image shows a level until it may regard it as sent.
        let mut pending: Option<u8> = None;
        for (pause, level, taken, what) in levels {
            now += pause;
            match (what, slow) {
                (0, None) => slow = Some(rig.add(LineEffect::LateValues(Nanos(50)), 1)),
                (1, Some(id)) => {
                    rig.end(id);
                    slow = None;
                }
                _ => {}
            }
            let level = *pending.get_or_insert(level);
            let (out, sure) = rig.send(now, [level, 0], taken);
            if sure {
                confirmed.push(level);
                pending = None;
            }
            if taken {
                seen.push(out[0]);
            }
        }
        if let Some(id) = slow {
            rig.end(id);
        }
        let last = *confirmed.last().expect("one at least");
        for _ in 0..400 {
            seen.push(rig.send(now, [last, 0], true).0[0]);
        }
        confirmed.dedup();
        seen.dedup();
        prop_assert_eq!(confirmed, seen);
    }

    #[test]
    fn the_same_seed_gives_the_same_run(seed in any::<u64>(), chance in 0.01..1.0_f64) {
        let run = |seed| {
            let mut rig = Rig::new();
            rig.add(LineEffect::Drop(chance, Direction::Both), seed);
            rig.add(LineEffect::Duplicate(chance, Direction::Both), seed);
            (0..300)
                .map(|now| {
                    let lost = rig.wires.loses_cycle();
                    (lost, rig.receive(now, Some(1)).len())
                })
                .collect::<Vec<_>>()
        };
        prop_assert_eq!(run(seed), run(seed));
    }
}
