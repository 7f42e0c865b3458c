//! The process image by name: axes with their blocks, and single signals.

use super::report::PeelerCounters;
use tickbus_axis::{AxisKind, Field, Motion};
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Area, Plan, SignalTable, Slot};
use tickbus_plc::blocks::{AxisCommand, AxisControl, AxisInputs, Execute};
use tickbus_plc::{ProgramError, Scan};

/// The decoded images, and the axes in them.
#[derive(Debug)]
pub(crate) struct Io {
    decode: Plan,
    encode: Plan,
    slots: Vec<Slot>,
    pub(super) input_bytes: usize,
    pub(super) output_bytes: usize,
    pub(super) axes: Vec<Axis>,
}

/// One axis: its block, its feedback, and the indices of its fields in the slots.
#[derive(Debug)]
pub(super) struct Axis {
    pub(super) control: AxisControl,
    pub(super) inputs: AxisInputs,
    /// The last command that the program requested.
    wanted: Option<AxisCommand>,
    fields: [usize; Field::COUNT],
}

/// The index of an optional field that an axis does not have.
const NOWHERE: usize = usize::MAX;

/// A signal of the table.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SignalIndex(usize);

/// The fields that every axis must have.
const NEEDED: [Field; 13] = [
    Field::Execute,
    Field::Tracking,
    Field::TorqueControl,
    Field::SpeedControl,
    Field::Enable,
    Field::TargetPosition,
    Field::Speed,
    Field::Acceleration,
    Field::Deceleration,
    Field::Torque,
    Field::Healthy,
    Field::InPosition,
    Field::ActualPosition,
];

impl Io {
    /// Finds the axes with these names and kinds; `hold` is how long `Execute` stays on if there is no
    /// acknowledge.
    pub(super) fn new(
        program: &str,
        table: &SignalTable,
        axes: &[(&str, AxisKind)],
        hold: Option<Nanos>,
    ) -> Result<Self, ProgramError> {
        let axis = |&(name, kind)| {
            let mut fields = [NOWHERE; Field::COUNT];
            for field in Field::ALL {
                let signal = format!("{name}.{}", field.name(kind));
                match table.position(&signal) {
                    Some(place) => fields[field.index()] = place,
                    None if NEEDED.contains(&field) => return Err(missing(program, &signal)),
                    None => {}
                }
            }
            let execute = match hold {
                Some(hold) => Execute::Hold(hold),
                None if fields[Field::Acknowledge.index()] == NOWHERE => {
                    return Err(missing(program, &format!("{name}.Acknowledge")));
                }
                None => Execute::Acknowledge,
            };
            Ok(Axis {
                control: AxisControl::new(execute),
                inputs: AxisInputs::default(),
                wanted: None,
                fields,
            })
        };
        let axes: Result<Vec<Axis>, ProgramError> = axes.iter().map(axis).collect();
        let size = |area| table.stations[0].bytes(area);
        Ok(Self {
            decode: Plan::new(table, 0, Area::Input),
            encode: Plan::new(table, 0, Area::Output),
            slots: vec![Slot::default(); table.signals.len()],
            input_bytes: size(Area::Input),
            output_bytes: size(Area::Output),
            axes: axes?,
        })
    }

    /// Takes over the inputs; false if the images do not match the table.
    pub(super) fn begin(&mut self, scan: &Scan<'_>) -> bool {
        if scan.inputs.len() < self.input_bytes || scan.outputs.len() < self.output_bytes {
            return false;
        }
        self.decode
            .decode(&scan.inputs[..self.input_bytes], &mut self.slots);
        for axis in &mut self.axes {
            let value = |field: Field| {
                let place = axis.fields[field.index()];
                self.slots.get(place).map_or(0.0, |slot| slot.real())
            };
            axis.inputs = AxisInputs {
                healthy: value(Field::Healthy) != 0.0,
                in_position: value(Field::InPosition) != 0.0,
                acknowledge: value(Field::Acknowledge) != 0.0,
                position: value(Field::ActualPosition),
                speed: value(Field::ActualSpeed),
            };
        }
        true
    }

    /// Calls the blocks of all axes and writes the outputs to the image.
    pub(super) fn end(&mut self, scan: &mut Scan<'_>, enable: bool, counters: &PeelerCounters) {
        for (axis, counters) in self.axes.iter_mut().zip(counters.axes()) {
            let commands = axis.control.commands();
            axis.control.call(scan.now, &axis.inputs, enable);
            if axis.control.commands() > commands {
                counters.count(scan.now);
            }
            let demand = &axis.control.demand;
            let Motion {
                position,
                speed,
                acceleration,
                deceleration,
                torque,
            } = demand.motion;
            let bit = |on: bool| f64::from(u8::from(on));
            for (field, value) in [
                (Field::Execute, bit(demand.execute)),
                (Field::Tracking, bit(demand.tracking)),
                (Field::TorqueControl, bit(demand.torque_control)),
                (Field::SpeedControl, bit(demand.speed_control)),
                (Field::Enable, bit(demand.enable)),
                (Field::TargetPosition, position),
                (Field::Speed, speed),
                (Field::Acceleration, acceleration),
                (Field::Deceleration, deceleration),
                (Field::Torque, torque),
                (Field::CommandNumber, f64::from(axis.control.number)),
                (Field::Jerk, demand.jerk),
            ] {
                if let Some(slot) = self.slots.get_mut(axis.fields[field.index()]) {
                    *slot = Slot::from_real(value);
                }
            }
        }
        self.encode
            .encode(&self.slots, &mut scan.outputs[..self.output_bytes]);
    }

    /// The index of a signal.
    pub(super) fn place(
        program: &str,
        table: &SignalTable,
        name: &str,
    ) -> Result<SignalIndex, ProgramError> {
        table
            .position(name)
            .map(SignalIndex)
            .ok_or_else(|| missing(program, name))
    }

    /// The value of a signal.
    pub(super) fn value(&self, place: SignalIndex) -> f64 {
        self.slots[place.0].real()
    }

    /// True if a signal is on.
    pub(super) fn is_on(&self, place: SignalIndex) -> bool {
        self.value(place) != 0.0
    }

    /// Sets a BOOL signal.
    pub(super) fn switch(&mut self, place: SignalIndex, on: bool) {
        self.slots[place.0] = Slot::from_real(f64::from(u8::from(on)));
    }

    /// The axes with a fault, a bit for each in the program's own order.
    pub(super) fn unhealthy(&self) -> u64 {
        let axes = self.axes.iter().enumerate();
        let ill = axes.filter(|(_, axis)| !axis.inputs.healthy);
        ill.fold(0, |all, (index, _)| all | 1 << index)
    }

    /// Discards all commands.
    pub(super) fn forget(&mut self) {
        for axis in &mut self.axes {
            axis.wanted = None;
        }
    }
}

impl Axis {
    /// Requests `command`, unless it equals the last one.
    pub(super) fn want(&mut self, command: AxisCommand) {
        if self.wanted != Some(command) {
            self.wanted = Some(command);
            self.control.give(command);
        }
    }

    /// Requests the same command again.
    pub(super) fn repeat(&mut self, command: AxisCommand) {
        self.wanted = None;
        self.want(command);
    }

    /// Ends a continuous command.
    pub(super) fn release(&mut self) {
        self.wanted = None;
        self.control.release();
    }

    /// True if the axis has completed the last request.
    pub(super) fn is_done(&self) -> bool {
        self.control.is_done(&self.inputs)
    }

    /// True if the machine has accepted the last command, and the axis has stopped.
    pub(super) fn stands(&self) -> bool {
        self.control.is_taken() && self.inputs.speed.abs() < 0.5
    }
}

fn missing(program: &str, signal: &str) -> ProgramError {
    ProgramError::Unfit {
        program: program.to_owned(),
        mistake: Mistake::new(
            format!("finds no signal \"{signal}\""),
            if signal.ends_with(".Acknowledge") {
                "write acknowledge = true at its [[axis]], or give the option hold, such as hold=500ms"
                    .to_owned()
            } else {
                format!("add it to driver.cfg, or copy plc/peeler/{program}.cfg")
            },
        ),
    }
}
