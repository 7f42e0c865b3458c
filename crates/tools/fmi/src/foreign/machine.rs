//! A running foreign FMU: carries values between its variables and the slots of a driver.

use tickbus_base::time::Nanos;
use tickbus_binding::SlotKind;
use tickbus_driver::Driver;
use tickbus_image::signal::{DataType, SignalTable, Slot};

use super::archive::Unpacked;
use super::events::EventSetup;
use super::faults::Changeable;
use super::join::Join;
use super::map::Joined;
use super::slave::{Direct, Failure, Setup, Slave, Stepped};
use super::target::Target;
use crate::made::kind_of;
use crate::value::{Value, Version};

/// The settings for running an FMU.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MachineOptions {
    /// Runs the FMU in a helper process, which it can crash without harm.
    pub isolated: bool,
    /// The relative tolerance for the FMU's solver, in place of the proposed one.
    pub tolerance: Option<f64>,
    /// The length of the run, if known.
    pub duration: Option<Nanos>,
}

/// A signal's slot, and its conversion to the variable.
#[derive(Clone, Copy, Debug)]
struct Way {
    slot: usize,
    kind: SlotKind,
    is_bool: bool,
    scale: f64,
    offset: f64,
}

impl Way {
    fn of(joined: &Joined, table: &SignalTable) -> Self {
        let signal = &table.signals[joined.signal];
        Self {
            slot: joined.signal,
            kind: kind_of(signal),
            is_bool: signal.data_type == DataType::Bool,
            scale: joined.scale,
            offset: joined.offset,
        }
    }

    /// Converts the signal's value to the variable's. Integers pass unchanged if there is nothing to compute.
    #[expect(clippy::float_cmp, reason = "exactly as written, or not at all")]
    fn variable(self, slots: &[Slot]) -> Value {
        let value = Value::of(slots[self.slot], self.kind);
        if self.scale == 1.0 && self.offset == 0.0 {
            return value;
        }
        Value::Real((value.real() - self.offset) / self.scale)
    }

    #[expect(clippy::float_cmp, reason = "as above")]
    fn signal(self, value: Value, slots: &mut [Slot]) {
        let value = if self.scale == 1.0 && self.offset == 0.0 {
            value
        } else {
            Value::Real(value.real() * self.scale + self.offset)
        };
        slots[self.slot] = if self.is_bool {
            Slot::from_real(f64::from(u8::from(value.real() != 0.0)))
        } else {
            value.slot(self.kind)
        };
    }
}

/// A running FMU.
#[derive(Debug)]
pub struct Machine {
    slave: Box<dyn Slave>,
    start: f64,
    inputs: Vec<Way>,
    outputs: Vec<Way>,
    sent: Vec<Value>,
    got: Vec<Value>,
    /// The variables that a fault can change, in the order of [`Model::fault_names`](super::Model::fault_names).
    changeable: Vec<Changeable>,
}

impl Machine {
    /// Begins a run of the FMU. `slots` contains the values before the run, and receives the FMU's first values.
    ///
    /// # Errors
    ///
    /// Returns why the FMU does not begin.
    pub fn open(
        fmu: &Unpacked,
        join: &Join,
        table: &SignalTable,
        options: MachineOptions,
        slots: &mut [Slot],
    ) -> Result<Self, Failure> {
        let model = &fmu.model;
        let variable = |joined: &Joined| {
            let target = Target::of(&model.variables[joined.variable]);
            target.expect("what is joined can be a signal")
        };
        let parameters = |list: &[(usize, Vec<Value>)]| {
            let list = list.iter().filter_map(|(at, values)| {
                let found = &model.variables[*at];
                Some((found.value_type?, found.reference, values.clone()))
            });
            list.collect()
        };
        let positions =
            |list: &[Joined]| -> Vec<usize> { list.iter().map(|joined| joined.variable).collect() };
        let texts = join.texts.iter();
        let texts = texts.map(|(at, text)| (model.variables[*at].reference, text.clone()));
        let setup = Setup {
            file: fmu.file.clone(),
            name: model.name.clone(),
            token: model.token.clone(),
            is_three: model.version == Version::Three,
            library: fmu.library().to_owned(),
            resources: fmu.resources(),
            start: model.start,
            tolerance: options.tolerance.or(model.tolerance),
            stop: options.duration.map(|end| model.start + seconds(end)),
            structural: parameters(&join.structural),
            parameters: parameters(&join.parameters),
            texts: texts.collect(),
            inputs: join.inputs.iter().map(variable).collect(),
            outputs: join.outputs.iter().map(variable).collect(),
            events: EventSetup::of(model, &positions(&join.inputs), &positions(&join.outputs)),
        };
        let way = |joined: &Joined| Way::of(joined, table);
        let inputs: Vec<Way> = join.inputs.iter().map(way).collect();
        let outputs: Vec<Way> = join.outputs.iter().map(way).collect();
        let sent: Vec<Value> = inputs.iter().map(|way| way.variable(slots)).collect();
        let mut got = vec![Value::Real(0.0); outputs.len()];
        let slave = open(&setup, options, &sent, &mut got)?;
        let mut machine = Self {
            slave,
            start: model.start,
            inputs,
            outputs,
            sent,
            got,
            changeable: Changeable::all(model, join),
        };
        machine.show(slots);
        Ok(machine)
    }

    /// Does one step: takes the PLC's commands from `slots`, lets time pass from `from` on, and puts the sensors'
    /// values into `slots`. If the FMU is the PLC, the directions are swapped.
    ///
    /// # Errors
    ///
    /// Returns why the FMU does not continue.
    pub fn step(
        &mut self,
        from: Nanos,
        length: Nanos,
        slots: &mut [Slot],
    ) -> Result<Stepped, Failure> {
        for (value, way) in self.sent.iter_mut().zip(&self.inputs) {
            *value = way.variable(slots);
        }
        for fault in &self.changeable {
            fault.apply_to(&mut self.sent);
        }
        let from = self.start + seconds(from);
        let stepped = self
            .slave
            .step(&self.sent, from, seconds(length), &mut self.got)?;
        self.show(slots);
        Ok(stepped)
    }

    /// Takes the faults of the model that have begun or ended in a driver which has declared the names of
    /// [`Model::fault_names`](super::Model::fault_names). From the next step on a variable has the value of its fault,
    /// and after the fault the value that it had before.
    ///
    /// # Errors
    ///
    /// Returns why the FMU does not continue.
    pub fn take_faults(&mut self, driver: &mut Driver) -> Result<(), Failure> {
        while let Some((place, value)) = driver.next_model_change() {
            if let Some(variable) = self.changeable.get_mut(place) {
                variable.set(value, &mut *self.slave)?;
            }
        }
        Ok(())
    }

    fn show(&mut self, slots: &mut [Slot]) {
        for (value, way) in self.got.iter().zip(&self.outputs) {
            way.signal(*value, slots);
        }
    }

    /// Ends the run properly.
    ///
    /// # Errors
    ///
    /// The FMU failed to end its run.
    pub fn end(mut self) -> Result<(), Failure> {
        self.slave.end()
    }
}

#[expect(clippy::cast_precision_loss, reason = "exact for 100 days")]
fn seconds(time: Nanos) -> f64 {
    time.0 as f64 / 1e9
}

fn open(
    setup: &Setup,
    options: MachineOptions,
    inputs: &[Value],
    outputs: &mut [Value],
) -> Result<Box<dyn Slave>, Failure> {
    if !options.isolated {
        return Ok(Box::new(Direct::open(setup, inputs, outputs)?));
    }
    Ok(Box::new(super::isolated::Isolated::open(
        setup, inputs, outputs,
    )?))
}
