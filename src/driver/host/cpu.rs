//! A program with its process image, and one scan of it.

use std::sync::Arc;

use crate::driver::Code;
use crate::driver::Config;
use crate::driver::faults::FrameFaults;
use crate::driver::frames::{area_bytes, directions};
use crate::driver::heartbeat::FrameBeats;
use crate::driver::tape::Tape;
use crate::fieldbus::Role;
use crate::image::{BusEnd, Receiver, TickEnd, image};
use crate::plc::{Program, Scan};
use crate::signal::Area;
use crate::time::Nanos;

use super::Tally;

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
    pub(super) tally: Arc<Tally>,
    /// The faults to inject at this end.
    pub(super) faults: Option<FrameFaults>,
    pub(super) tape: Option<Tape>,
    beats: FrameBeats,
}

/// The inputs as the program sees them, and as it saw them a scan before.
pub(super) struct Inputs {
    pub(super) bytes: Box<[u8]>,
    before: Box<[u8]>,
}

/// Takes the inputs over, and their edges where they are recorded.
struct Taking<'a> {
    inputs: &'a mut Inputs,
    tape: Option<&'a mut Tape>,
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
    /// Inputs, program, outputs: one scan at `now`. `in_time` is false when it comes so late that the peer has
    /// been given fail-safe values: then the program has to begin as after a broken line.
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
        } = self;
        let station = &mut tick.stations[0];
        inputs.before.copy_from_slice(&inputs.bytes);
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
        tally.count(*reads, &inputs.before, &inputs.bytes);
        let alive = in_time && valid && arrival.age <= *max_age;
        outputs_before.copy_from_slice(outputs);
        program.scan(&mut Scan {
            now,
            alive,
            cycle: arrival.sequence,
            inputs: &inputs.bytes,
            outputs,
        });
        beats.beat(now, outputs);
        tally.count(*writes, outputs_before, outputs);
        station.write(now, |frame| {
            frame.copy_from_slice(outputs);
            if let Some(faults) = faults {
                faults.sending(frame);
            }
        });
        tally.scanned(arrival.age, alive);
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

/// Makes the half of a line that has the program: its processor, the bus's end of its image, its tally.
pub(super) fn half(program: Box<dyn Program>, config: &Config, role: Role) -> (Cpu, BusEnd) {
    let table = &config.table;
    let tally = Arc::new(Tally::new(table));
    let (tick, bus) = image(directions(table, role));
    let (writes, reads) = role.areas();
    let frame = |area| vec![0; area_bytes(table, 0, area)].into_boxed_slice();
    let (inputs, outputs) = (frame(reads), frame(writes));
    let cpu = Cpu {
        program,
        tick,
        inputs: Inputs {
            before: inputs.clone(),
            bytes: inputs,
        },
        outputs_before: outputs.clone(),
        outputs,
        max_age: config.timing.max_age,
        areas: (writes, reads),
        tally,
        faults: None,
        tape: None,
        beats: FrameBeats::new(config, role),
    };
    (cpu, bus)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plc::Program;
    use std::sync::Mutex;

    /// Takes down what each scan is told.
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
        let config = crate::driver::Config::parse("driver.cfg", text).expect("right");
        let told = Arc::new(Mutex::new(Vec::new()));
        let program = Box::new(Witness(Arc::clone(&told)));
        let (mut cpu, mut bus) = half(program, &config, Role::Controller);
        for (millis, in_time) in [(10, true), (500, false), (510, true)] {
            let now = Nanos::from_millis(millis);
            // The peer is quicker than the scan that was held up.
            bus.stations[0].received(now, &[1]);
            cpu.scan(now, in_time);
        }
        assert_eq!(*told.lock().expect("no panic"), [true, false, true]);
    }
}
