//! One end of a run on virtual time: ticks, and what they show.

use tickbus_base::time::Nanos;
use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Slot;

use super::course::What;
use super::{ATTEMPTS, NAMES, SERVER, Shared, Told};
use crate::broken::Broken;
use crate::clock::SimulatedClock;
use crate::plan::FAIL_SAFE;
use crate::random::{Random, scramble};
use crate::scheduler;
use crate::stamp::{Stamp, level};

/// Whether a pulse is written in a tick.
const fn is_pulse(tick: u64) -> bool {
    tick % 3 == 2
}

/// The slots of a station in one direction.
struct Places {
    stamp: usize,
    pulse: usize,
    edges: Option<usize>,
    level: usize,
}

/// One end, tick by tick.
#[expect(
    clippy::too_many_lines,
    reason = "one tick after the other, and what it has to show"
)]
pub(super) fn live(shared: &Shared, end: usize) {
    let course = &shared.course;
    let config = Config::parse("driver.cfg", &course.driver_cfg(end))
        .unwrap_or_else(|why| panic!("a run that tickbus refuses:\n{why}"));
    let mut driver = Driver::open(config, SimulatedClock::shared())
        .unwrap_or_else(|why| panic!("a driver that does not open: {why}"));
    let mut slots = driver.initial_slots();
    let places = |area: char| -> Vec<Places> {
        let signals = &driver.config().table.signals;
        let place = |name: String| {
            let place = signals.iter().position(|signal| signal.name == name);
            place.expect("it is in the file")
        };
        let of_station = |station: u64| {
            let pulse = place(format!("pulse{area}{station}"));
            Places {
                stamp: place(format!("stamp{area}{station}")),
                pulse,
                edges: driver.slots().edges[pulse],
                level: place(format!("level{area}{station}")),
            }
        };
        (0..course.stations).map(of_station).collect()
    };
    let (writes, reads) = (places(['I', 'Q'][end]), places(['Q', 'I'][end]));
    let write = |slots: &mut [Slot], tick: u64| {
        for (station, places) in (0..).zip(&writes) {
            let stamp = stamp(end, station, tick);
            slots[places.stamp] = Slot::from_unsigned(stamp);
            slots[places.pulse] = Slot::from_real(f64::from(is_pulse(tick)));
            slots[places.level] = Slot::from_real(f64::from(level(stamp)));
        }
    };
    let mut random = Random::new(scramble(end as u64 ^ course.steps));
    let (mut ticks, mut attempts) = (0, 0);
    loop {
        match shared.orders[end].take() {
            Some(What::Pause(_, span)) => scheduler::sleep(span),
            Some(_) => {
                shared.is_gone[end].set(true);
                break driver.close();
            }
            None => {}
        }
        let found = if course.ends[end].halves {
            let found = driver.receive(None, &mut slots);
            write(&mut slots, ticks + 1);
            driver.send(&mut slots);
            found
        } else {
            write(&mut slots, ticks + 1);
            driver.exchange(None, &mut slots)
        };
        if shared.is_gone[end].get() {
            // What a process that was killed finds, nobody sees.
            break driver.close();
        }
        let (now, code) = (scheduler::now().0, found.code);
        shared.note(format!(
            "{now} {} tick {} {} sequence {}",
            NAMES[end],
            ticks + 1,
            code.name(),
            found.sequence
        ));
        let shown = |places: &Places| (slots[places.stamp].unsigned(), slots[places.level].real());
        if code == Code::Fresh {
            ticks += 1;
            let expected = course.expected(end, ticks);
            let before = if ticks > 1 {
                course.expected(end, ticks - 1)
            } else {
                0
            };
            // A reader with longer steps may miss what was written between two of them.
            let edges = u8::from(is_pulse(expected) && expected != before);
            let counts = course.ends[end].multiple <= course.ends[1 - end].multiple;
            for (station, places) in (0..).zip(&reads) {
                let stamp = stamp(1 - end, station, expected);
                let right = (stamp, f64::from(level(stamp)));
                let seen = places.edges.map_or(0.0, |place| slots[place].real());
                if shown(places) != right && !(expected == 0 && shared.is_retried.get()) {
                    let what = format!(
                        "tick {ticks} of \"{}\" shows {:?} of station {station}, and not tick {expected} of its peer",
                        NAMES[end],
                        shown(places)
                    );
                    return shared.fail(Broken {
                        promise: "lock-step",
                        what,
                    });
                }
                if counts && seen.total_cmp(&f64::from(edges)).is_ne() && !shared.is_retried.get() {
                    let what = format!(
                        "tick {ticks} of \"{}\" has {seen} edges of station {station}, and not {edges}",
                        NAMES[end]
                    );
                    return shared.fail(Broken {
                        promise: "pulses",
                        what,
                    });
                }
            }
            if found.age != Nanos::ZERO || found.sequence != ticks {
                let what = format!(
                    "tick {ticks} has age {} and sequence {}",
                    found.age, found.sequence
                );
                return shared.fail(Broken {
                    promise: "fresh",
                    what,
                });
            }
        } else if ticks == 0
            && code == Code::BusFailed
            && attempts < ATTEMPTS
            && !shared.is_done[SERVER].get()
        {
            // Before the start, each tick tries again.
            attempts += 1;
            shared.is_retried.set(true);
        } else {
            let is_safe = reads.iter().all(|places| shown(places) == (FAIL_SAFE, 0.0));
            let again = driver.exchange(None, &mut slots).code;
            if !is_safe || again != code || !matches!(code, Code::Stale | Code::BusFailed) {
                let what = format!(
                    "behind the end, \"{}\" has {code} and then {again}; fail-safe values are shown: {is_safe}",
                    NAMES[end]
                );
                return shared.fail(Broken {
                    promise: "end",
                    what,
                });
            }
            shared.note(format!("{}: {}", NAMES[end], driver.link().reason));
            shared.told[end].set(Some(Told { ticks, code }));
            break driver.close();
        }
        scheduler::sleep(Nanos(random.within(0, 3_000_000)));
    }
}

/// What an end writes in a tick; before the first one, variables are 0.
fn stamp(end: usize, station: u64, tick: u64) -> u64 {
    match tick {
        0 => 0,
        _ => Stamp {
            life: 1,
            area: end as u64,
            station,
            tick,
        }
        .number(),
    }
}
