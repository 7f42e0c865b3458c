//! The plant and the PLC as participants of a common virtual time.

use std::num::NonZeroU32;

use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;
use tickbus_virtual_time::{Declaration, Participant, Step, Variable};

use crate::controller::{CYCLE_MILLIS, command};
use crate::metrics::Run;
use crate::path::{Path, Point};
use crate::plant::{Plant, STEP_MILLIS};

/// The number of steps of a run, which ends 0.5 s after the end of the path.
pub const STEPS: usize = 4702;

/// The step of the virtual time.
pub const STEP: Nanos = Nanos::from_millis(STEP_MILLIS);

/// The position of the tool, in mm: the plant writes it, and the PLC reads it.
const POSITION: [&str; 2] = ["position_x", "position_z"];
/// The commanded speeds, in mm/s: the PLC writes them, and the plant reads them.
const COMMAND: [&str; 2] = ["speed_x", "speed_z"];

fn declaration(name: &str, multiple: i64, writes: [&str; 2], reads: [&str; 2]) -> Declaration {
    let multiple = u32::try_from(multiple).ok().and_then(NonZeroU32::new);
    Declaration {
        name: name.to_owned(),
        multiple: multiple.expect("a step is a multiple of the server's"),
        interval: None,
        writes: writes
            .map(|name| Variable::new(name, DataType::Lreal))
            .to_vec(),
        reads: reads.map(str::to_owned).to_vec(),
    }
}

fn read(slots: &[u64]) -> Point {
    [0, 1].map(|axis| f64::from_bits(slots[axis]))
}

fn write(slots: &mut [u64], values: Point) {
    slots.copy_from_slice(&values.map(f64::to_bits));
}

/// The plant, which runs at every step, with its positions so far.
#[derive(Clone, Debug)]
pub struct Machine {
    plant: Plant,
    run: Run,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            plant: Plant::default(),
            run: Run::with_capacity(STEPS),
        }
    }
}

impl Machine {
    /// Returns the positions after each step.
    pub fn into_run(self) -> Run {
        self.run
    }
}

impl Participant for Machine {
    fn declare(&self) -> Declaration {
        declaration("plant", 1, POSITION, COMMAND)
    }

    fn initial(&mut self, writes: &mut [u64]) {
        write(writes, self.plant.position());
    }

    fn run(&mut self, _step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.plant.step(read(reads));
        self.run.push(self.plant.position());
        write(writes, self.plant.position());
        Ok(())
    }
}

/// The PLC, which runs at every tenth step.
#[derive(Clone, Debug, Default)]
pub struct Program {
    path: Path,
}

impl Participant for Program {
    fn declare(&self) -> Declaration {
        declaration("plc", CYCLE_MILLIS / STEP_MILLIS, COMMAND, POSITION)
    }

    fn initial(&mut self, writes: &mut [u64]) {
        write(writes, [0.0, 0.0]);
    }

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        write(writes, command(&self.path, step.time, read(reads)));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::LOCK_STEP_ERROR;
    use crate::metrics::error;
    use crate::path::distance;

    #[test]
    fn a_run_ends_half_a_second_after_the_path() {
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let last = (STEPS - 1) as f64 / 1e3;
        let end = Path::default().duration() + 0.5;
        assert!(last <= end && end < last + 1e-3);
    }

    /// The barrier in ten lines: both sides read what was committed before the step.
    #[test]
    fn both_on_the_snapshot_of_each_step_give_the_error_of_an_independent_program() {
        let (mut plant, mut plc) = (Machine::default(), Program::default());
        let (mut position, mut speed) = ([0; 2], [0; 2]);
        plant.initial(&mut position);
        plc.initial(&mut speed);
        for sequence in 0..STEPS {
            let time = STEP.times(i64::try_from(sequence).expect("few"));
            let step = Step {
                sequence: sequence as u64 + 1,
                time,
            };
            let snapshot = (position, speed);
            if sequence.is_multiple_of(10) {
                plc.run(step, &snapshot.0, &mut speed).expect("it runs");
            }
            plant
                .run(step, &snapshot.1, &mut position)
                .expect("it runs");
        }
        let run = plant.into_run();
        let error = error(&run);
        assert!((error - LOCK_STEP_ERROR).abs() < 1e-9);
        assert_eq!(format!("{error:.7}"), "0.3464117");
        let [x, z] = run[STEPS - 1];
        assert_eq!(format!("{x:.6} {z:.7}"), "500.000000 0.0000359");
        assert!(distance([x, z], [499.999_999_999_999_9, 3.586_203_937_847_591e-5]) < 1e-9);
    }
}
