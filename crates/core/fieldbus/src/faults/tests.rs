//! Faults of signals, tick by tick.
#![allow(clippy::float_cmp, reason = "the values are small whole numbers")]

use std::sync::Arc;

use proptest::prelude::*;

use super::*;
use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Area, DataType, Latch, Scale, Signal, SignalTable, Slot};

/// The signals of a machine, which writes `run` and `level` and reads the others.
pub(super) fn table() -> SignalTable {
    let signal = Signal::new;
    let signals = vec![
        signal("run", Area::Input, 0, DataType::Bool),
        Signal {
            scale: Scale::through([0.0, 27_648.0], [0.0, 250.0]),
            unit: Some("mm".to_owned()),
            ..signal("level", Area::Input, 2, DataType::Int)
        },
        Signal {
            latch: Some(Latch::Rising),
            ..signal("a = b > c", Area::Output, 0, DataType::Bool)
        },
        signal("whole", Area::Output, 8, DataType::Lint),
        signal("word", Area::Output, 2, DataType::Word),
    ];
    SignalTable::of_one_station(4, 16, signals)
}

const SIGNALS: usize = 5;

/// A machine's end of the line; the test sets the values that the peer sends.
struct End {
    table: SignalTable,
    faults: Faults,
    board: Arc<FaultBoard>,
    tick: u64,
    /// The tick at which the simulation's time is zero.
    zero: u64,
    /// One per signal, and one for the edges of the latched signal.
    slots: [Slot; SIGNALS + 1],
}

impl End {
    fn new() -> Self {
        let board = Arc::<FaultBoard>::default();
        Self {
            table: table(),
            faults: Faults::new(Arc::clone(&board)),
            board,
            tick: 0,
            zero: 1,
            slots: [Slot::default(); SIGNALS + 1],
        }
    }

    #[track_caller]
    fn inject(&mut self, text: &str) -> u32 {
        let fault = read_one(text, &self.table).unwrap_or_else(|why| panic!("{why}"));
        let edges = [None, None, Some(SIGNALS), None, None];
        let slots = Slots {
            table: &self.table,
            writes: Area::Input,
            edges: &edges,
        };
        self.faults.add(&fault, slots).expect("there is room")
    }

    /// One tick of 10 ms; returns the sent values of the signals that this end writes. `arrives` puts received values
    /// into the slots, if any arrive.
    fn tick(&mut self, arrives: impl FnOnce(&mut [Slot])) -> [f64; 2] {
        self.tick += 1;
        let moment = TickTime {
            time: Nanos::from_millis(10 * i64::try_from(self.tick - self.zero).expect("few")),
            tick: self.tick,
        };
        self.faults.begin_tick(moment, &mut self.slots);
        let own = [self.slots[0], self.slots[1]];
        self.faults.sending(&mut self.slots);
        let sent = [self.slots[0].real(), self.slots[1].real()];
        self.faults.sent(&mut self.slots);
        assert_eq!(own, [self.slots[0], self.slots[1]], "its own again");
        arrives(&mut self.slots);
        self.faults.received(&mut self.slots);
        sent
    }

    /// The simulation's time is zero again at the next tick.
    fn restart(&mut self) {
        self.zero = self.tick + 1;
    }

    fn set(&mut self, index: usize, value: f64) {
        self.slots[index] = Slot::from_real(value);
    }
}

fn nothing(_: &mut [Slot]) {}

#[test]
fn a_ramp_goes_evenly_to_its_end_whatever_the_type() {
    let ramp = |index, from, to| Fault {
        name: "ramp".to_owned(),
        effect: Effect::Signal(
            index,
            SignalEffect::Ramp {
                from,
                to,
                within: Nanos::from_millis(40),
            },
        ),
        begin: Begin::AtOnce,
        lasts: Lasts::UntilEnded,
        times: 1,
        seed: 1,
    };
    let mut end = End::new();
    let edges = [None, None, Some(SIGNALS), None, None];
    let table = table();
    let slots = Slots {
        table: &table,
        writes: Area::Input,
        edges: &edges,
    };
    let real = Slot::from_real;
    let whole = Slot::from_signed;
    for fault in [
        // From the value that the simulation has, in its unit.
        ramp(1, None, real(60.0)),
        // Digits that a double does not have.
        ramp(3, Some(whole(i64::MAX - 8)), whole(i64::MAX)),
        ramp(4, Some(real(10.0)), real(3.0)),
    ] {
        let what = fault.what(&table);
        let id = end.faults.add(&fault, slots).expect("there is room");
        assert_eq!(end.board.ramp_value(id), None, "{what}");
    }
    end.set(1, 100.0);
    let seen = [(); 6].map(|()| {
        // The simulation writes other values meanwhile, which change nothing.
        let sent = end.tick(nothing)[1];
        end.set(1, 7.0);
        (sent, i64::MAX - end.slots[3].signed(), end.slots[4].real())
    });
    let right = [
        (100.0, 8, 10.0),
        (90.0, 6, 8.0),
        (80.0, 4, 7.0),
        (70.0, 2, 5.0),
        (60.0, 0, 3.0),
        (60.0, 0, 3.0),
    ];
    assert_eq!(seen, right);
    assert_eq!(end.board.ramp_value(1), Some(real(60.0)));
}

#[test]
fn values_are_changed_only_while_a_fault_of_a_signal_is_active() {
    for (kind, is_of_signal) in [("invert\"\nsignal = \"run", true), ("link-down", false)] {
        let mut end = End::new();
        end.inject(&format!("kind = \"{kind}\"\ntick = 3\nticks = 2"));
        let seen = [(); 6].map(|()| {
            end.tick(nothing);
            end.faults.change_values()
        });
        let active = [false, false, is_of_signal, is_of_signal, false, false];
        assert_eq!(seen, active, "{kind}");
    }
    let mut end = End::new();
    end.inject("kind = \"invert\"\nsignal = \"run\"");
    end.tick(nothing);
    end.faults.restart();
    assert!(!end.faults.change_values());
}

#[test]
fn what_is_written_is_bent_on_its_way_out_only() {
    for (text, sent) in [
        ("kind = \"stuck\"\nsignal = \"level\"\nvalue = 7.5", 7.5),
        (
            "kind = \"stuck\"\nsignal = \"level\"\nvalue = \"7.5 mm\"",
            7.5,
        ),
        ("kind = \"stuck\"\nsignal = \"level\"", 100.0),
        ("kind = \"offset\"\nsignal = \"level\"\nby = -10", 90.0),
        (
            "kind = \"offset\"\nsignal = \"level\"\nby = \"2.5 mm\"",
            102.5,
        ),
    ] {
        let mut end = End::new();
        end.set(1, 100.0);
        assert_eq!(end.tick(nothing), [0.0, 100.0]);
        let id = end.inject(text);
        for _ in 0..3 {
            assert_eq!(end.tick(nothing), [0.0, sent], "{text}");
        }
        end.set(1, 200.0);
        let moved = if text.contains("offset") {
            sent + 100.0
        } else {
            sent
        };
        assert_eq!(end.tick(nothing), [0.0, moved], "{text}");
        assert!(end.faults.end(id));
        assert_eq!(end.tick(nothing), [0.0, 200.0], "{text}");
    }
}

#[test]
fn what_is_read_is_bent_for_the_reader_and_true_again_at_once() {
    let mut end = End::new();
    end.tick(|slots| {
        slots[2] = Slot::from_real(1.0);
        slots[3] = Slot::from_signed(40);
        slots[4] = Slot::from_real(3.0);
    });
    let ids = [
        end.inject("kind = \"invert\"\nsignal = \"a = b > c\""),
        end.inject("kind = \"offset\"\nsignal = \"whole\"\nby = 2"),
        end.inject("kind = \"invert\"\nsignal = \"word\""),
    ];
    // Nothing new arrives, yet offsets must not accumulate.
    for _ in 0..3 {
        end.tick(nothing);
        assert_eq!(end.slots[2].real(), 0.0);
        assert_eq!(end.slots[3].signed(), 42);
        assert_eq!(end.slots[4].real(), f64::from(0xFFFC));
    }
    end.tick(|slots| slots[3] = Slot::from_signed(i64::MAX));
    assert_eq!(end.slots[3].signed(), i64::MAX, "saturates");
    for id in ids {
        assert!(end.faults.end(id));
    }
    end.tick(nothing);
    assert_eq!(end.slots[2].real(), 1.0);
    assert_eq!(end.slots[3].signed(), i64::MAX);
    assert_eq!(end.slots[4].real(), 3.0);
}

#[test]
fn edges_are_counted_as_they_are_seen() {
    let mut end = End::new();
    let id = end.inject("kind = \"stuck\"\nsignal = \"a = b > c\"\nvalue = false");
    let pulse = |slots: &mut [Slot]| {
        slots[2] = Slot::from_real(1.0);
        slots[SIGNALS] = Slot::from_real(3.0);
    };
    end.tick(pulse);
    assert_eq!((end.slots[2].real(), end.slots[SIGNALS].real()), (0.0, 0.0));
    assert!(end.faults.end(id));
    end.tick(nothing);
    assert_eq!(
        (end.slots[2].real(), end.slots[SIGNALS].real()),
        (1.0, 3.0),
        "the truth"
    );
    end.inject("kind = \"invert\"\nsignal = \"a = b > c\"");
    end.tick(nothing);
    assert_eq!((end.slots[2].real(), end.slots[SIGNALS].real()), (0.0, 0.0));
    end.tick(|slots| slots[2] = Slot::from_real(0.0));
    assert_eq!((end.slots[2].real(), end.slots[SIGNALS].real()), (1.0, 1.0));
    end.tick(nothing);
    assert_eq!((end.slots[2].real(), end.slots[SIGNALS].real()), (1.0, 0.0));
}

#[test]
fn faults_go_on_when_the_time_of_the_simulation_jumps_back() {
    let mut end = End::new();
    let once = "kind = \"stuck\"\nsignal = \"level\"\nvalue = 9\nat = \"20ms\"\nfor = \"30ms\"\n";
    end.inject(once);
    end.set(1, 1.0);
    let sent = |end: &mut End| end.tick(nothing)[1];
    assert_eq!([(); 3].map(|()| sent(&mut end)), [1.0, 1.0, 9.0]);
    // The model restarts.
    end.restart();
    assert_eq!([(); 4].map(|()| sent(&mut end)), [9.0, 9.0, 9.0, 1.0]);
}

#[test]
fn after_a_restart_of_the_simulation_faults_draw_the_same_numbers_again() {
    let mut end = End::new();
    let noise = "kind = \"noise\"\nsignal = \"level\"\namplitude = 90\nseed = 3\n";
    let episode = |end: &mut End| {
        let ids = [(); 2].map(|()| end.inject(noise));
        let drawn = [(); 20].map(|()| {
            end.set(1, 100.0);
            end.tick(nothing)[1]
        });
        end.faults.restart();
        end.restart();
        (ids, drawn)
    };
    let (ids, first) = episode(&mut end);
    assert_eq!(ids, [1, 2]);
    assert_eq!(episode(&mut end), ([3, 4], first));
    assert_eq!(episode(&mut end), ([5, 6], first));
}

/// The numbers of a generator of Knuth's.
fn random(state: &mut u64, below: u64) -> u64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) % below
}

#[test]
fn the_edges_of_a_bent_signal_are_those_of_the_levels_that_are_shown() {
    for latch in [Latch::Rising, Latch::Falling, Latch::Both] {
        let mut end = End::new();
        end.table.signals[2].latch = Some(latch);
        let (mut state, mut counted) = (1, 0.0);
        let (mut shown, mut truth) = (false, (false, 0.0));
        // The change of the level, and the number of the fault.
        let mut fault: Option<(Option<bool>, u32)> = None;
        for step in 0..5_000 {
            match (&fault, random(&mut state, 6)) {
                (Some((_, id)), 0) => {
                    assert!(end.faults.end(*id));
                    fault = None;
                }
                (None, 0) => {
                    let (stuck, text) = match random(&mut state, 3) {
                        0 => (None, "kind = \"invert\""),
                        1 => (Some(false), "kind = \"stuck\"\nvalue = false"),
                        _ => (Some(true), "kind = \"stuck\"\nvalue = true"),
                    };
                    let id = end.inject(&format!("{text}\nsignal = \"a = b > c\""));
                    fault = Some((stuck, id));
                }
                _ => {}
            }
            if random(&mut state, 2) == 0 {
                let count = u8::try_from(random(&mut state, 4)).expect("small");
                truth = (random(&mut state, 2) == 0, f64::from(count));
            }
            end.tick(|slots| {
                slots[2] = Slot::from_real(f64::from(u8::from(truth.0)));
                slots[SIGNALS] = Slot::from_real(truth.1);
            });
            let (level, edges) = match &fault {
                None => truth,
                Some((stuck, _)) => {
                    let level = stuck.unwrap_or(!truth.0);
                    let is_edge = level != shown
                        && match latch {
                            Latch::Rising => level,
                            Latch::Falling => !level,
                            Latch::Both => true,
                        };
                    (level, f64::from(u8::from(is_edge)))
                }
            };
            let found = (end.slots[2].real() != 0.0, end.slots[SIGNALS].real());
            assert_eq!(found, (level, edges), "{latch:?} step {step}");
            shown = level;
            counted += f64::from(u8::from(fault.is_some())) * edges;
        }
        assert!(counted > 200.0, "{latch:?}: {counted}");
    }
}

#[test]
fn faults_of_one_signal_follow_each_other() {
    let mut end = End::new();
    end.inject("kind = \"stuck\"\nsignal = \"level\"\nvalue = 10");
    end.inject("kind = \"offset\"\nsignal = \"level\"\nby = 5");
    assert_eq!(end.tick(nothing), [0.0, 15.0]);
    assert_eq!(end.slots[1].real(), 0.0);
}

#[test]
fn a_condition_sees_the_truth() {
    let mut end = End::new();
    end.inject("kind = \"stuck\"\nsignal = \"run\"\nvalue = true");
    end.inject("kind = \"offset\"\nsignal = \"level\"\nby = 5\nwhile = \"run\"");
    assert_eq!(end.tick(nothing), [1.0, 0.0], "it only looks as if it ran");
    end.set(0, 1.0);
    assert_eq!(end.tick(nothing), [1.0, 5.0]);
    end.set(0, 0.0);
    assert_eq!(end.tick(nothing), [1.0, 0.0]);
}

#[test]
fn the_board_tells_what_is_active_and_how_often_it_began() {
    let mut end = End::new();
    let mut statistics = Statistics::default();
    end.board.write(&mut statistics);
    assert_eq!(statistics.to_string(), "", "no fault, no word");
    end.inject(
        "kind = \"invert\"\nname = \"jam\"\nsignal = \"run\"\nwhen = \"run\"\nticks = 2\ntimes = 2",
    );
    end.inject("kind = \"link-down\"\ntick = 2");
    for level in [1.0, 1.0, 0.0, 1.0, 0.0] {
        end.set(0, level);
        end.tick(nothing);
    }
    end.board.write(&mut statistics);
    assert_eq!(
        statistics.to_string(),
        "fault.active=jam, link-down\nfault.begun=3\nfault.dropped=0\nfault.duplicated=0\n\
         fault.hurried=0\nfault.answers=0\nfault.1.name=jam\nfault.1.kind=invert\nfault.1.what=\"run\" is inverted\n\
         fault.1.state=active\nfault.1.begun=2\nfault.1.since=30ms\nfault.1.tick=4\n\
         fault.2.name=link-down\nfault.2.kind=link-down\nfault.2.what=the link is down\n\
         fault.2.state=active\nfault.2.begun=1\nfault.2.since=10ms\nfault.2.tick=2\n"
    );
}

#[test]
fn those_that_are_over_make_room_and_those_that_wait_do_not() {
    let mut end = End::new();
    for _ in 0..LIMIT {
        end.inject("kind = \"invert\"\nsignal = \"run\"\nticks = 1");
    }
    let fault = read_one("kind = \"link-down\"", &end.table).expect("right");
    let table = end.table.clone();
    let slots = Slots {
        table: &table,
        writes: Area::Input,
        edges: &[],
    };
    let refused = end.faults.add(&fault, slots).expect_err("no room");
    assert!(
        refused.what.contains("64 faults wait or are active"),
        "{refused}"
    );
    end.tick(nothing);
    end.tick(nothing);
    assert_eq!(end.faults.add(&fault, slots), Ok(65));
    assert_eq!(end.board.list().len(), LIMIT);
    assert!(!end.faults.end(1), "forgotten");
}

#[test]
fn a_fault_prepared_by_another_thread_begins_when_a_tick_adopts_it() {
    let mut end = End::new();
    let fault = read_one(
        "kind = \"stuck\"\nsignal = \"level\"\nvalue = 7.5",
        &end.table,
    );
    let fault = fault.expect("right");
    let prepare = |end: &End| {
        let (table, board) = (end.table.clone(), Arc::clone(&end.board));
        let fault = fault.clone();
        let other = std::thread::spawn(move || {
            let slots = Slots {
                table: &table,
                writes: Area::Input,
                edges: &[],
            };
            Prepared::new(&fault, slots, &board)
        });
        other.join().expect("no panic")
    };
    let phases = |end: &End| -> Vec<Phase> {
        let faults = end.board.list();
        faults.iter().map(|fault| fault.phase).collect()
    };
    end.set(1, 100.0);
    let (first, cancelled) = (prepare(&end), prepare(&end));
    let (first, cancelled) = (first.expect("room"), cancelled.expect("room"));
    assert_eq!((first.id(), cancelled.id()), (1, 2));
    assert_eq!(end.tick(nothing)[1], 100.0, "no tick knows of them");
    cancelled.cancel();
    assert_eq!(phases(&end), [Phase::Waiting, Phase::Over]);
    assert!(end.faults.adopt(first).is_none());
    assert_eq!(end.tick(nothing)[1], 7.5);
    assert_eq!(phases(&end), [Phase::Active, Phase::Over]);
    assert!(!end.faults.is_idle());
    end.faults.end(1);
    assert_eq!(end.tick(nothing)[1], 100.0);
    assert!(end.faults.is_idle());
    // The memory of a fault that is over is handed back, to be freed elsewhere.
    let mut retired = 0;
    for _ in 0..LIMIT {
        let next = prepare(&end).expect("those that are over make room");
        end.faults.end(next.id() - 1);
        retired += usize::from(end.faults.adopt(next).is_some());
        end.tick(nothing);
    }
    assert_eq!(end.board.list().len(), LIMIT);
    // The cancelled fault had left nothing.
    assert_eq!(retired, 1);
}

proptest! {
    #[test]
    fn noise_stays_within_its_amplitude_and_the_same_seed_makes_the_same(
        seed in any::<u64>(), amplitude in 0.1..200.0_f64, chance in 0.05..0.95_f64,
    ) {
        let run = || {
            let mut end = End::new();
            end.inject(&format!(
                "kind = \"noise\"\nsignal = \"level\"\namplitude = {amplitude}\nseed = {}", seed >> 1
            ));
            end.inject(&format!(
                "kind = \"noise\"\nsignal = \"run\"\nchance = {chance}\nseed = {}", seed >> 1
            ));
            end.set(1, 50.0);
            (0..400).map(|_| end.tick(nothing)).collect::<Vec<_>>()
        };
        let first = run();
        prop_assert_eq!(&first, &run());
        prop_assert!(first.iter().all(|sent| (sent[1] - 50.0).abs() <= amplitude));
        prop_assert!(first.iter().any(|sent| (sent[1] - 50.0).abs() > amplitude / 2.0));
        prop_assert!(first.iter().any(|sent| sent[0] == 1.0));
        prop_assert!(first.iter().any(|sent| sent[0] == 0.0));
    }

    /// No sequence of faults changes the simulation's own values, and read values are true as soon as all faults are
    /// over.
    #[test]
    fn nothing_is_left_behind(
        steps in prop::collection::vec((0..8_usize, -100.0..100.0_f64, any::<bool>()), 1..80),
    ) {
        const TEXTS: [&str; 6] = [
            "kind = \"invert\"\nsignal = \"a = b > c\"\nticks = 3",
            "kind = \"stuck\"\nsignal = \"word\"\nvalue = 9\nticks = 5",
            "kind = \"offset\"\nsignal = \"word\"\nby = 3\nticks = 4",
            "kind = \"noise\"\nsignal = \"level\"\namplitude = 9\nticks = 2",
            "kind = \"noise\"\nsignal = \"a = b > c\"\nchance = 0.5\nticks = 2",
            "kind = \"stuck\"\nsignal = \"a = b > c\"\nwhen = \"run\"\nticks = 2",
        ];
        let mut end = End::new();
        let mut truth = [Slot::default(); SIGNALS + 1];
        for (what, value, arrives) in steps {
            if let Some(text) = TEXTS.get(what) {
                end.inject(text);
            }
            end.set(0, f64::from(u8::from(value > 0.0)));
            end.set(1, value);
            end.tick(|slots| {
                if arrives {
                    slots[2] = Slot::from_real(f64::from(u8::from(value < 0.0)));
                    slots[4] = Slot::from_real(value.abs().round());
                }
                truth.copy_from_slice(slots);
            });
        }
        let ids: Vec<u32> = end.board.list().iter().map(|fault| fault.id).collect();
        for id in ids {
            end.faults.end(id);
        }
        end.tick(nothing);
        prop_assert_eq!(end.slots, truth);
    }
}
