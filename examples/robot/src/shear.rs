//! A shear that cuts a moving sheet at its marks, and its PLC: an experiment that shows what slow sampling loses.
//!
//! The example is that of H. Carlsson, B. Svensson, F. Danielsson and B. Lennartson ("Methods for Reliable
//! Simulation-Based PLC Code Verification", 2012): two actuators, two sensors, and a PLC that samples every 50 or 100 ms.
//! Each sensor is on for 30 ms. A PLC with scans of 10 ms never misses it, unless the link in between does.

use std::sync::Arc;

use tickbus_base::statistics::entries;
use tickbus_base::time::{Clock, Nanos};
use tickbus_driver::Driver;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_image::signal::Slot;
use tickbus_plc::{Program, Programs, Scan};

/// The time of a tick, in which the sheet moves by a millimetre.
pub const TICK: Nanos = Nanos::from_millis(1);

/// How many marks pass in a run, and the distance from one to the next: not a multiple of any interval.
pub const MARKS: u64 = 20;
const DISTANCE: u64 = 430;

/// How long a sensor is on.
const PULSE: u64 = 30;

/// How long the knife takes for a turn, and when in it the sensor at its lowest point is on.
const TURN: u64 = 200;
const LOWEST: u64 = 85;

const SENSORS: [&str; 2] = ["Mark seen", "Knife down"];

static KINDS: Kinds = Kinds::LOOPBACK.with_programs(Programs::new(&["shear"], |_, _| {
    Ok(Box::new(Control::default()))
}));

/// The connection between the machine and its PLC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// The PLC is scanned on the machine's time.
    LockStep,
    /// Both run on the clock, and a bus hands over at this interval, in milliseconds.
    FreeWheeling(i64),
}

/// The program: a cut for each mark. The knife makes one turn, as it is let go once it is down.
#[derive(Debug, Default)]
struct Control {
    /// The sensors in the previous scan.
    before: u8,
}

impl Program for Control {
    fn name(&self) -> &'static str {
        "shear"
    }

    fn input_bytes(&self) -> usize {
        1
    }

    fn output_bytes(&self) -> usize {
        1
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        const FEED: u8 = 1;
        const CUT: u8 = 2;
        let sensors = scan.inputs[0];
        let rises = sensors & !self.before;
        self.before = sensors;
        let outputs = &mut scan.outputs[0];
        *outputs |= FEED;
        if rises & 1 != 0 {
            *outputs |= CUT;
        }
        if rises & 2 != 0 {
            *outputs &= !CUT;
        }
    }
}

/// The machine.
#[derive(Debug, Default)]
struct Machine {
    /// How far the sheet has moved, in mm.
    sheet: u64,
    /// How far the knife is in its turn, in ms; 0 is at the top, where it stops.
    knife: u64,
    /// How often each sensor went on; for the knife these are cuts.
    pulses: [u64; 2],
    sensors: [bool; 2],
}

impl Machine {
    /// A tick with these commands.
    fn step(&mut self, [feed, cut]: [bool; 2]) {
        self.sheet += u64::from(feed);
        if cut || self.knife > 0 {
            self.knife = (self.knife + 1) % TURN;
        }
        let mark = self.sheet % DISTANCE;
        let lowest = LOWEST..LOWEST + PULSE;
        let sensors = [
            self.sheet >= DISTANCE && mark < PULSE,
            lowest.contains(&self.knife),
        ];
        for ((pulses, is_on), was_on) in self.pulses.iter_mut().zip(sensors).zip(self.sensors) {
            *pulses += u64::from(is_on && !was_on);
        }
        self.sensors = sensors;
    }
}

/// The result of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Marks that passed the sensor.
    pub marks: u64,
    /// Cuts that were made.
    pub cuts: u64,
    /// Pulses of each sensor that the program saw.
    pub seen: [u64; 2],
    /// Swallowed pulses of each sensor.
    pub swallowed: [u64; 2],
    /// A sentence of tickbus about each sensor with swallowed pulses.
    pub named: Vec<String>,
}

impl Outcome {
    /// Pulses that were swallowed.
    pub fn missed(&self) -> u64 {
        self.swallowed.iter().sum()
    }
}

/// Runs until all marks have passed. `pause` waits for the time of the next tick since the run began.
///
/// # Errors
///
/// The driver cannot be opened.
pub fn run(
    link: Link,
    clock: Arc<dyn Clock>,
    mut pause: impl FnMut(Nanos),
) -> Result<Outcome, String> {
    let (mode, cycle) = match link {
        Link::LockStep => ("stepped", 10),
        Link::FreeWheeling(cycle) => ("free", cycle),
    };
    let text = format!(
        "[driver]\nid = 1\nname = \"Shear\"\n\
         [fieldbus]\nkind = \"loopback\"\nprogram = \"shear\"\nscan = \"10ms\"\nmode = \"{mode}\"\ncycle = \"{cycle}ms\"\n\
         [[signal]]\nname = \"{}\"\naddress = \"%IX0.0\"\n\
         [[signal]]\nname = \"{}\"\naddress = \"%IX0.1\"\n\
         [[signal]]\nname = \"Feed\"\naddress = \"%QX0.0\"\n\
         [[signal]]\nname = \"Cut\"\naddress = \"%QX0.1\"\n",
        SENSORS[0], SENSORS[1]
    );
    let config = Config::parse("shear.cfg", &text, &KINDS).map_err(|wrong| wrong.to_string())?;
    let mut driver = Driver::open(config, clock).map_err(|error| error.to_string())?;
    let mut slots = driver.initial_slots();
    let mut machine = Machine::default();
    let mut time = Nanos::ZERO;
    // The last mark passes the sensor, and is cut.
    while machine.sheet < MARKS * DISTANCE + 2 * TURN {
        time += TICK;
        pause(time);
        machine.step([2, 3].map(|signal| slots[signal].real() != 0.0));
        for (slot, is_on) in slots.iter_mut().zip(machine.sensors) {
            *slot = Slot::from_real(f64::from(u8::from(is_on)));
        }
        driver.exchange(time, &mut slots);
    }
    let statistics = driver.statistics();
    let number = |key: String| {
        let mut found = entries(&statistics).filter(|(name, _)| *name == key);
        found.find_map(|(_, value)| value.parse().ok()).unwrap_or(0)
    };
    let sentences = driver.swallowed().sentences().into_iter();
    let outcome = Outcome {
        marks: machine.pulses[0],
        cuts: machine.pulses[1],
        seen: SENSORS.map(|sensor| number(format!("plc.rises.{sensor}"))),
        swallowed: SENSORS.map(|sensor| number(format!("swallowed.{sensor}"))),
        named: sentences.map(|(_, sentence)| sentence).collect(),
    };
    driver.close();
    Ok(outcome)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Manual;

    /// Runs on a clock of its own, whose time passes when all threads wait.
    fn outcome(link: Link) -> Outcome {
        let clock = Manual::new();
        let settled = || {
            while !clock.is_settled(3) {
                std::thread::yield_now();
            }
        };
        let pause = |_| {
            if link != Link::LockStep {
                settled();
                clock.advance(TICK);
                settled();
            }
        };
        run(link, Arc::clone(&clock) as _, pause).expect("it runs")
    }

    #[test]
    fn in_lock_step_each_mark_is_seen_and_cut_once() {
        let Outcome {
            marks,
            cuts,
            seen,
            swallowed,
            named,
        } = outcome(Link::LockStep);
        assert_eq!((marks, cuts), (MARKS, MARKS));
        assert_eq!((seen, swallowed), ([MARKS; 2], [0; 2]));
        assert!(named.is_empty(), "{named:?}");
    }

    #[test]
    fn free_wheeling_a_sensor_is_missed_and_named() {
        for cycle in [50, 100] {
            let found = outcome(Link::FreeWheeling(cycle));
            let [mark, knife] = found.swallowed;
            assert!(mark > 0, "{cycle} ms: {found:?}");
            // Each pulse was seen or is counted; the last one may be under way.
            for (pulses, told) in [
                (found.marks, found.seen[0] + mark),
                (found.cuts, found.seen[1] + knife),
            ] {
                assert!(told <= pulses && pulses <= told + 1, "{found:?}");
            }
            let words = format!(
                "\"Mark seen\" changed and changed back {mark} times between two bus cycles of {cycle}ms"
            );
            assert!(found.named[0].starts_with(&words), "{found:?}");
        }
    }
}
