//! Random runs over a line on which everything possible happens: recorded, and replayed value by value.

use std::fmt::Write as _;

use super::*;
use crate::bus_handle::{BusHandle, SteppedBus};
use crate::{Driver, Exchange};
use tickbus_base::time::Manual;
use tickbus_fieldbus::PlcState;
use tickbus_record::Tick;

/// The number of ticks in a run.
const TICKS: usize = 1_500;

/// Knuth's generator: produces the same numbers on every machine.
#[derive(Clone)]
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }

    fn byte(&mut self) -> u8 {
        self.below(256).to_le_bytes()[0]
    }
}

/// A peer that sends, falls silent, stops its program or hangs, and whose line fails.
struct Peer {
    random: Random,
    stations: [Mood; 2],
    life: u8,
}

#[derive(Clone, Copy, PartialEq)]
enum Mood {
    Runs,
    /// The peer sends, but its life sign does not change.
    Hangs,
    /// The peer sends, but reports that its data are not valid.
    Stopped,
    Silent,
}

impl Peer {
    fn frame(&mut self, len: usize, lives: bool) -> Vec<u8> {
        let mut frame: Vec<u8> = (0..len).map(|_| self.random.byte()).collect();
        if self.random.below(3) > 0 {
            // Few edges, and all values at rest.
            frame = vec![0; len];
            frame[0] = 1 << self.random.below(8);
        }
        match self.random.below(8) {
            0 => frame[4..8].copy_from_slice(&f32::NAN.to_le_bytes()),
            1 => frame[4..8].copy_from_slice(&f32::NEG_INFINITY.to_le_bytes()),
            _ => {}
        }
        self.life = self.life.wrapping_add(u8::from(lives));
        frame[2] = self.life;
        frame
    }
}

impl Stepped for Peer {
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let receipt = port.take_all(now).map(|frames| frames.receipt());
        if let Some(receipt) = receipt.filter(|_| self.random.below(2) == 0) {
            port.sent(&receipt);
        }
        Ok(())
    }

    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        port.running("it runs");
        for station in 0..port.stations() {
            if self.random.below(12) == 0 {
                let moods = [Mood::Runs, Mood::Hangs, Mood::Stopped, Mood::Silent];
                self.stations[station] = moods[usize::try_from(self.random.below(4)).expect("few")];
            }
            let mood = self.stations[station];
            if mood == Mood::Silent {
                continue;
            }
            for _ in 0..[0, 0, 1, 1, 2, 5][usize::try_from(self.random.below(6)).expect("few")] {
                let (_, len) = port.sizes(station);
                let frame = self.frame(len, mood != Mood::Hangs);
                port.received(station, now, &frame);
            }
            let state = match mood {
                Mood::Stopped => PlcState::Stop,
                _ => PlcState::Run,
            };
            port.plc_state(station, now, state);
            if self.random.below(3) == 0 {
                port.touch(station, now);
            }
        }
        if self.random.below(60) == 0 {
            return Err(BusError::Link("the line failed".to_owned()));
        }
        Ok(now)
    }
}

/// Returns a driver.cfg with latched signals of all kinds in `stations` stations, and numbers.
fn config(folder: &Path, stations: usize, fieldbus: &str, record: &str) -> Config {
    let mut text = format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\n{fieldbus}\nmax_age = \"60ms\"\n\
         alive = {{ signal = \"A life\", within = \"40ms\" }}\n[record]\nfile = \"{record}\"\n"
    );
    for station in ["A", "B"].into_iter().take(stations) {
        writeln!(text, "[[station]]\nname = \"{station}\"").expect("it takes all");
    }
    for station in ["A", "B"].into_iter().take(stations) {
        let mut signal = |name: &str, address: &str, more: &str| {
            let name = format!("name = \"{station} {name}\"\naddress = \"%{address}\"");
            writeln!(text, "[[signal]]\n{name}\nstation = \"{station}\"\n{more}")
                .expect("it takes all");
        };
        for bit in 0..10 {
            let latch = ["rising", "falling", "both"][bit % 3];
            let more = match bit {
                9 => String::new(),
                3 | 4 => format!("latch = \"{latch}\"\nfail_safe = true"),
                _ => format!("latch = \"{latch}\""),
            };
            let address = format!("QX{}.{}", bit / 8, bit % 8);
            signal(&format!("q{bit}"), &address, &more);
            if bit < 8 {
                let hold = ["", "\nhold = \"12ms\""][bit / 6];
                signal(&format!("i{bit}"), &format!("IX0.{bit}"), &(more + hold));
            }
        }
        signal("life", "QB2", "");
        signal("real", "QD4", "type = \"REAL\"\nfail_safe = 2.5");
        signal("long", "QL8", "type = \"LINT\"\nfail_safe = -7");
        signal("word", "IW2", "type = \"INT\"\nfail_safe = 3");
        let scale = "type = \"INT\"\nscale = { raw = [-27648, 27648], value = [-500, 500] }";
        signal("scaled", "IW4", scale);
        signal("out", "ID8", "type = \"REAL\"\nfail_safe = 1.5");
    }
    let path = folder.join("driver.cfg");
    Config::parse(path.to_str().expect("UTF-8"), &text, &crate::KINDS)
        .unwrap_or_else(|why| panic!("{why}"))
}

/// Runs the same ticks of a machine, as exchanges or as halves. Returns what each tick showed.
fn run(driver: &mut Driver, seed: u64, halves: bool) -> Vec<(Exchange, Vec<Slot>)> {
    let mut random = Random(seed);
    let mut slots = driver.initial_slots();
    let signals = driver.config().table.signals.clone();
    let mut time = Nanos::from_millis(5);
    (0..TICKS)
        .map(|_| {
            for (slot, signal) in slots.iter_mut().zip(&signals) {
                if signal.area == driver.config().role.areas().0 && random.below(4) == 0 {
                    let value = match random.below(20) {
                        0 => f64::NAN,
                        1 => 1e300,
                        2 => 0.3 - 7e5,
                        _ => [0.0, 1.0, 250.1][usize::try_from(random.below(3)).expect("few")],
                    };
                    *slot = Slot::from_real(value);
                }
            }
            time += Nanos::from_millis(match random.below(40) {
                0 => 90,
                1..5 => 20,
                5..15 => 3,
                _ => 1,
            });
            let found = if halves {
                let found = driver.receive(time, &mut slots);
                let sent = driver.send(&mut slots);
                assert_eq!(found.code, sent.code);
                found
            } else {
                driver.exchange(time, &mut slots)
            };
            (found, slots.clone())
        })
        .collect()
}

/// Compares two values; NaN equals NaN, since a recording keeps no payload.
fn same(was: Slot, is: Slot) -> bool {
    was == is || was.real().is_nan() && is.real().is_nan()
}

fn rows(path: &Path, config: &Config) -> Vec<Tick> {
    let mut recording = Recording::open(path, Some(&config.table)).expect("a recording");
    let mut tick = Tick::new(recording.columns());
    let mut rows = Vec::new();
    while recording.next(&mut tick).expect("a tick") {
        rows.push(tick.clone());
    }
    rows
}

#[test]
fn a_replay_is_the_recording_in_every_tick_whatever_happened_on_the_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let mut seen = [0; 4];
    for seed in 0..8 {
        let (stations, halves) = (1 + seed % 2, seed % 4 > 1);
        let file = ["run.csv", "run.vcd"][seed / 4];
        let stepped = "program = \"mirror\"\nmode = \"stepped\"";
        let mut driver = Driver::open(config(folder, stations, stepped, file), Manual::new())
            .unwrap_or_else(|why| panic!("{why}"));
        let BusHandle::Stepped { bus, .. } = &mut driver.line else {
            panic!("it is stepped");
        };
        *bus = SteppedBus::Any(Box::new(Peer {
            random: Random(seed as u64),
            stations: [Mood::Runs; 2],
            life: 0,
        }));
        let recorded = run(&mut driver, seed as u64, halves);
        driver.close();
        let replay = config(
            folder,
            stations,
            &format!("replay = \"{file}\""),
            "again.csv",
        );
        let mut driver = Driver::open(replay.clone(), Manual::new()).expect("opens");
        let replayed = run(&mut driver, seed as u64, halves);
        let statistics = driver.statistics();
        assert!(
            statistics.contains("replay.differences=0\n"),
            "seed {seed}: {statistics}"
        );
        driver.close();
        for (tick, (was, is)) in recorded.iter().zip(&replayed).enumerate() {
            let at = format!("seed {seed}, tick {}", tick + 1);
            assert_eq!(was.0.code, is.0.code, "{at}");
            let differs = was.1.iter().zip(&is.1);
            let differs = differs
                .enumerate()
                .find(|(_, (was, is))| !same(**was, **is));
            assert_eq!(differs, None, "{at}: {:?}", was.0.code);
            seen[usize::try_from(was.0.code.code()).unwrap_or(3)] += 1;
        }
        let [was, is] = [file, "again.csv"].map(|file| rows(&folder.join(file), &replay));
        assert_eq!(was.len(), TICKS);
        for (was, is) in was.iter().zip(&is) {
            let equal = was.values.iter().zip(&is.values);
            assert!(equal.into_iter().all(|(was, is)| same(*was, *is)));
            assert_eq!(
                (was.number, was.time, was.status),
                (is.number, is.time, is.status)
            );
            // When an exchange failed, the recording may contain only the overall failure, not that of each station.
            assert!(
                was.status < 0 || was.stations == is.stations,
                "{was:?} {is:?}"
            );
        }
    }
    // Every case occurred often enough.
    assert!(seen.iter().all(|count| *count > 100), "{seen:?}");
}

#[test]
fn pulses_of_several_recorded_ticks_are_seen_and_counted_in_the_one_that_they_fall_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rows =
        "bus.tick,bus.time_ns,bus.status,bus.dropped,rise,both,later,rise.edges,both.edges\n"
            .to_owned();
    // A pulse and an edge between two ticks of the replay; a pulse of a signal that was not latched.
    for (tick, row) in [
        "0,0,0,0,0",
        "1,0,1,1,0",
        "0,1,0,0,1",
        "0,0,0,0,1",
        "0,0,0,0,0",
    ]
    .iter()
    .enumerate()
    {
        writeln!(rows, "{},{}000000,0,0,{row}", tick + 1, tick).expect("it takes all");
    }
    std::fs::write(folder.path().join("run.csv"), rows).expect("written");
    let mut text =
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nreplay = \"run.csv\"\n"
            .to_owned();
    for (bit, (name, latch)) in [("rise", "rising"), ("both", "both"), ("later", "both")]
        .iter()
        .enumerate()
    {
        let signal = format!("name = \"{name}\"\naddress = \"%QX0.{bit}\"\nlatch = \"{latch}\"");
        writeln!(text, "[[signal]]\n{signal}").expect("it takes all");
    }
    let path = folder.path().join("driver.cfg");
    let config = Config::parse(path.to_str().expect("UTF-8"), &text, &crate::KINDS).expect("right");
    let mut driver = Driver::open(config, Manual::new()).expect("opens");
    let mut slots = driver.initial_slots();
    let seen: Vec<Vec<f64>> = [0, 2, 4, 5]
        .map(|tick| {
            driver.exchange(Nanos::from_millis(tick), &mut slots);
            slots.iter().map(|slot| slot.real()).collect()
        })
        .into();
    assert_eq!(
        seen,
        [
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [1.0, 1.0, 1.0, 1.0, 1.0, 2.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        ]
    );
}
