//! A program with its process image, and one scan of it.

use std::sync::Arc;

use crate::Code;
use crate::frames::{area_bytes, directions};
use crate::heartbeat::FrameBeats;
use crate::recording::ScanRecorder;
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_image::signal::Area;
use tickbus_image::{BusEnd, Receiver, TickEnd, TickStation, image};
use tickbus_plc::{Program, Scan};

use super::ScanCounters;
use super::faults::FrameFaults;

/// A program with the tick's end of its process image: a PLC without its bus.
pub(super) struct Cpu {
    pub(super) program: Box<dyn Program>,
    tick: TickEnd,
    pub(super) inputs: Inputs,
    outputs: Box<[u8]>,
    outputs_before: Box<[u8]>,
    max_age: Nanos,
    /// The areas that it writes and reads.
    pub(super) areas: (Area, Area),
    pub(super) tally: Arc<ScanCounters>,
    /// The faults injected at this end.
    pub(super) faults: Option<FrameFaults>,
    pub(super) tape: Option<ScanRecorder>,
    beats: FrameBeats,
    /// The other stations, each with its own instance of the program.
    others: Vec<Other>,
}

/// A further station of a driver: the program and its process image.
struct Other {
    program: Box<dyn Program>,
    station: usize,
    inputs: Inputs,
    outputs: Box<[u8]>,
    outputs_before: Box<[u8]>,
    beats: FrameBeats,
}

impl Other {
    fn new(program: Box<dyn Program>, config: &Config, role: Role, station: usize) -> Self {
        let (writes, reads) = role.areas();
        let outputs = frame(config, station, writes);
        Self {
            program,
            station,
            inputs: Inputs::new(frame(config, station, reads)),
            outputs_before: outputs.clone(),
            outputs,
            beats: FrameBeats::new(config, role, station),
        }
    }

    /// One scan; returns the age of its data, and whether they are valid.
    fn scan(
        &mut self,
        (now, max_age): (Nanos, Nanos),
        image: &mut TickStation,
        tally: &ScanCounters,
        (writes, reads): (Area, Area),
    ) -> (Nanos, bool) {
        let Self {
            program,
            station,
            inputs,
            outputs,
            outputs_before,
            beats,
        } = self;
        tally.keep((*station, reads), &mut inputs.before, &inputs.bytes);
        let valid = image.is_valid();
        let arrival = image.read(now, &mut Taking { inputs, tape: None });
        tally.count((*station, reads), &inputs.before, &inputs.bytes);
        // The PLC may have stopped between the check and the read, and the frame may be from after that:
        // checked again.
        let alive = valid && image.is_valid() && arrival.age <= max_age;
        tally.keep((*station, writes), outputs_before, outputs);
        program.scan(&mut Scan {
            now,
            alive,
            cycle: arrival.sequence,
            inputs: &inputs.bytes,
            outputs,
        });
        beats.beat(now, outputs);
        tally.count((*station, writes), outputs_before, outputs);
        image.write(now, |frame| frame.copy_from_slice(outputs));
        (arrival.age, alive)
    }
}

fn frame(config: &Config, station: usize, area: Area) -> Box<[u8]> {
    vec![0; area_bytes(&config.table, station, area)].into()
}

/// The inputs as the program sees them, and as it saw them in the previous scan.
pub(super) struct Inputs {
    pub(super) bytes: Box<[u8]>,
    before: Box<[u8]>,
}

impl Inputs {
    fn new(bytes: Box<[u8]>) -> Self {
        Self {
            before: bytes.clone(),
            bytes,
        }
    }
}

/// Takes over the inputs, and their edges if they are recorded.
struct Taking<'a> {
    inputs: &'a mut Inputs,
    tape: Option<&'a mut ScanRecorder>,
}

impl Receiver for Taking<'_> {
    fn levels(&mut self, bytes: &[u8]) {
        self.inputs.bytes.copy_from_slice(bytes);
    }

    fn edges(&mut self, signal: usize, count: u32) {
        if let Some(tape) = &mut self.tape {
            tape.edges(signal, count);
        }
    }
}

impl Cpu {
    /// Inputs, program, outputs: one scan at `now`. `in_time` is false when it comes so late that the peer
    /// has received fail-safe values in the meantime: the program must then start over as after a broken
    /// line.
    pub(super) fn scan(&mut self, now: Nanos, in_time: bool) {
        let Self {
            program,
            tick,
            inputs,
            outputs,
            outputs_before,
            max_age,
            areas: (writes, reads),
            tally,
            faults,
            tape,
            beats,
            others,
        } = self;
        let (station, further) = tick.stations.split_first_mut().expect("at least one");
        tally.keep((0, *reads), &mut inputs.before, &inputs.bytes);
        if let Some(faults) = faults {
            faults.begin_scan(now, &mut inputs.bytes, outputs);
        }
        let valid = station.is_valid();
        let arrival = station.read(
            now,
            &mut Taking {
                inputs,
                tape: tape.as_mut(),
            },
        );
        if let Some(faults) = faults {
            faults.received(&mut inputs.bytes);
        }
        tally.count((0, *reads), &inputs.before, &inputs.bytes);
        // Checked twice as for the other stations, see `scan` above.
        let alive = in_time && valid && station.is_valid() && arrival.age <= *max_age;
        tally.keep((0, *writes), outputs_before, outputs);
        program.scan(&mut Scan {
            now,
            alive,
            cycle: arrival.sequence,
            inputs: &inputs.bytes,
            outputs,
        });
        beats.beat(now, outputs);
        tally.count((0, *writes), outputs_before, outputs);
        station.write(now, |frame| {
            frame.copy_from_slice(outputs);
            if let Some(faults) = faults {
                faults.sending(frame);
            }
        });
        let (mut age, mut all_alive) = (arrival.age, alive);
        for (other, image) in others.iter_mut().zip(further) {
            let found = other.scan((now, *max_age), image, tally, (*writes, *reads));
            age = age.max(found.0);
            all_alive &= found.1;
        }
        tally.scanned(age, all_alive);
        if let Some(tape) = tape {
            let code = match arrival.fresh {
                _ if !alive => Code::Stale,
                true => Code::Fresh,
                false => Code::Unchanged,
            };
            tape.scan(now, code, &inputs.bytes, outputs);
        }
    }
}

/// Creates the program's half of a line: the CPU, the bus's end of its image, its tally. A program that can
/// serve several stations serves all of them.
pub(super) fn half(program: Box<dyn Program>, config: &Config, role: Role) -> (Cpu, BusEnd) {
    let table = &config.table;
    let tally = Arc::new(ScanCounters::new(table));
    let (tick, bus) = image(directions(table, role));
    let (writes, reads) = role.areas();
    let (inputs, outputs) = (frame(config, 0, reads), frame(config, 0, writes));
    let others = (1..table.stations.len())
        .filter_map(|station| {
            Some(Other::new(
                program.for_another_station()?,
                config,
                role,
                station,
            ))
        })
        .collect();
    let cpu = Cpu {
        program,
        tick,
        inputs: Inputs::new(inputs),
        outputs_before: outputs.clone(),
        outputs,
        max_age: config.timing.max_age,
        areas: (writes, reads),
        tally,
        faults: None,
        tape: None,
        beats: FrameBeats::new(config, role, 0),
        others,
    };
    (cpu, bus)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use tickbus_plc::Program;

    /// Records what each scan is told.
    struct Witness(Arc<Mutex<Vec<bool>>>);

    impl Program for Witness {
        fn name(&self) -> &'static str {
            "witness"
        }

        fn input_bytes(&self) -> usize {
            1
        }

        fn output_bytes(&self) -> usize {
            1
        }

        fn scan(&mut self, scan: &mut Scan<'_>) {
            self.0.lock().expect("no panic").push(scan.alive);
        }
    }

    #[test]
    fn a_scan_that_comes_too_late_is_told_that_the_line_was_broken() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"x\"\n\
                    [[signal]]\nname = \"in\"\naddress = \"%IB0\"\n[[signal]]\nname = \"out\"\naddress = \"%QB0\"\n";
        let config = tickbus_driver_cfg::Config::parse("driver.cfg", text).expect("right");
        let told = Arc::new(Mutex::new(Vec::new()));
        let program = Box::new(Witness(Arc::clone(&told)));
        let (mut cpu, mut bus) = half(program, &config, Role::Controller);
        for (millis, in_time) in [(10, true), (500, false), (510, true)] {
            let now = Nanos::from_millis(millis);
            // The peer is faster than the delayed scan.
            bus.stations[0].received(now, &[1]);
            cpu.scan(now, in_time);
        }
        assert_eq!(*told.lock().expect("no panic"), [true, false, true]);
    }

    #[test]
    fn a_mirror_serves_each_station_by_itself() {
        use crate::Driver;
        use tickbus_base::time::Manual;

        let signal = |name: &str, address: &str, station: &str| {
            format!(
                "[[signal]]\nname = \"{name}\"\naddress = \"{address}\"\nstation = \"{station}\"\n"
            )
        };
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\n\
                    program = \"mirror\"\nscan = \"1ms\"\n[[station]]\nname = \"A\"\n[[station]]\nname = \"B\"\n"
            .to_owned()
            + &signal("A to", "%IB0", "A")
            + &signal("B to", "%IB2", "B")
            + &signal("A from", "%QB0", "A")
            + &signal("B from", "%QB2", "B");
        let config = tickbus_driver_cfg::Config::parse("driver.cfg", &text);
        let config = config.unwrap_or_else(|wrong| panic!("{wrong}"));
        let mut driver = Driver::open(config, Manual::new()).expect("opens");
        let mut slots = driver.initial_slots();
        for (slot, value) in [(0, 5.0), (1, 7.0)] {
            slots[slot] = tickbus_image::signal::Slot::from_real(value);
        }
        let mut seen = Vec::new();
        for tick in 1..=3 {
            driver.exchange(Nanos::from_millis(tick), &mut slots);
            seen = slots[2..4].iter().map(|slot| slot.real()).collect();
        }
        assert_eq!(seen, [5.0, 7.0]);
    }
}
