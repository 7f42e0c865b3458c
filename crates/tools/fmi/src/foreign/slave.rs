//! A running FMU: inputs, a step, outputs.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::library::Instance;
use crate::value::{Status, Value, ValueType, Version};

/// The settings with which a run of an FMU begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Setup {
    /// The FMU's name in messages.
    pub file: String,
    /// The instance's name.
    pub name: String,
    /// The token that the library expects.
    pub token: String,
    /// True for FMI 3.0, false for 2.0.
    pub is_three: bool,
    /// The path of the library.
    pub library: PathBuf,
    /// The path of the resources.
    pub resources: PathBuf,
    /// The time at which the run begins, in seconds.
    pub start: f64,
    /// The relative tolerance for the solver, if one is set.
    pub tolerance: Option<f64>,
    /// The time at which the run ends, in seconds, if known.
    pub stop: Option<f64>,
    /// The values to set before the run: type, value reference, value.
    pub parameters: Vec<(ValueType, u32, Value)>,
    /// The texts to set before the run: value reference, text.
    pub texts: Vec<(u32, String)>,
    /// The variables to set before every step.
    pub inputs: Vec<(ValueType, u32)>,
    /// The variables to read after every step.
    pub outputs: Vec<(ValueType, u32)>,
}

/// The result of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stepped {
    /// The step was done.
    Done,
    /// The step was done, and the FMU asks to end the run here.
    Ended,
}

/// Says in one line why an FMU does not continue.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{0}")]
pub struct Failure(pub String);

/// A running FMU. Dropping it ends the run.
pub(super) trait Slave: std::fmt::Debug {
    /// Sets the inputs, lets `length` seconds pass from `from` on, and reads the outputs.
    ///
    /// # Errors
    ///
    /// The FMU does not continue.
    fn step(
        &mut self,
        inputs: &[Value],
        from: f64,
        length: f64,
        outputs: &mut [Value],
    ) -> Result<Stepped, Failure>;

    /// Sets a variable between two steps, and returns the value that it had.
    ///
    /// # Errors
    ///
    /// The FMU does not continue.
    fn change(&mut self, variable: (ValueType, u32), value: Value) -> Result<Value, Failure>;

    /// Ends the run properly.
    ///
    /// # Errors
    ///
    /// The FMU failed to end its run.
    fn end(&mut self) -> Result<(), Failure>;
}

/// Variables of one type, handled in one call.
#[derive(Debug)]
struct Group {
    kind: ValueType,
    references: Vec<u32>,
    /// The indices of the variables among all inputs or outputs.
    at: Vec<usize>,
    values: Vec<Value>,
}

fn groups(variables: &[(ValueType, u32)]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (at, &(kind, reference)) in variables.iter().enumerate() {
        let index = groups.iter().position(|group| group.kind == kind);
        let index = index.unwrap_or_else(|| {
            groups.push(Group {
                kind,
                references: Vec::new(),
                at: Vec::new(),
                values: Vec::new(),
            });
            groups.len() - 1
        });
        let group = &mut groups[index];
        group.references.push(reference);
        group.at.push(at);
        group.values.push(Value::Real(0.0));
    }
    groups
}

/// An FMU in this process.
#[derive(Debug)]
pub(super) struct Direct {
    instance: Instance,
    file: String,
    inputs: Vec<Group>,
    outputs: Vec<Group>,
    /// True if the FMU has failed, or has ended.
    is_over: bool,
}

impl Direct {
    /// Begins a run, and reads the first outputs.
    pub(super) fn open(
        setup: &Setup,
        inputs: &[Value],
        outputs: &mut [Value],
    ) -> Result<Self, Failure> {
        let version = if setup.is_three {
            Version::Three
        } else {
            Version::Two
        };
        let names = (&*setup.file, &*setup.name, &*setup.token);
        let instance = Instance::new(names, version, &setup.library, &setup.resources);
        let instance = instance.map_err(|why| Failure(format!("{}: {why}", setup.file)))?;
        let mut slave = Self {
            instance,
            file: setup.file.clone(),
            inputs: groups(&setup.inputs),
            outputs: groups(&setup.outputs),
            is_over: false,
        };
        for &(kind, reference, value) in &setup.parameters {
            let status = slave.instance.set(kind, &[reference], &[value]);
            slave.check(status, "setting a parameter")?;
        }
        for (reference, text) in &setup.texts {
            let status = slave.instance.set_text(*reference, text);
            let status = status.map_err(|why| Failure(format!("{}: {why}", setup.file)))?;
            slave.check(status, "setting a parameter")?;
        }
        let status = slave
            .instance
            .enter(setup.start, setup.tolerance, setup.stop);
        slave.check(status, "entering the initialisation")?;
        slave.set(inputs)?;
        let status = slave.instance.exit();
        slave.check(status, "its initialisation")?;
        slave.get(outputs)?;
        Ok(slave)
    }

    fn failure(&mut self, what: &str) -> Failure {
        self.is_over = true;
        Failure(format!("{}: {}", self.file, self.instance.said(what)))
    }

    /// Checks a status; continues after a good one.
    fn check(&mut self, status: Status, what: &str) -> Result<(), Failure> {
        match status {
            Status::Ok | Status::Warning => Ok(()),
            Status::Discard => Err(self.failure(&format!("it discards {what}"))),
            Status::Error => Err(self.failure(&format!("{what} failed"))),
            Status::Fatal => Err(self.failure(&format!("{what} failed for good (fatal)"))),
        }
    }

    fn set(&mut self, values: &[Value]) -> Result<(), Failure> {
        for index in 0..self.inputs.len() {
            let group = &mut self.inputs[index];
            for (value, at) in group.values.iter_mut().zip(&group.at) {
                *value = values[*at];
            }
            let status = self
                .instance
                .set(group.kind, &group.references, &group.values);
            self.check(status, "setting its inputs")?;
        }
        Ok(())
    }

    fn get(&mut self, values: &mut [Value]) -> Result<(), Failure> {
        for index in 0..self.outputs.len() {
            let group = &mut self.outputs[index];
            let status = self
                .instance
                .get(group.kind, &group.references, &mut group.values);
            for (value, at) in group.values.iter().zip(&group.at) {
                values[*at] = *value;
            }
            self.check(status, "reading its outputs")?;
        }
        Ok(())
    }
}

impl Slave for Direct {
    fn step(
        &mut self,
        inputs: &[Value],
        from: f64,
        length: f64,
        outputs: &mut [Value],
    ) -> Result<Stepped, Failure> {
        self.set(inputs)?;
        let end = self.instance.step(from, length);
        // FMI 2.0 requests the end of a run this way, which is no failure.
        let has_ended =
            end.terminate && matches!(end.status, Status::Ok | Status::Warning | Status::Discard);
        if !has_ended {
            if end.status == Status::Discard {
                let reached = end
                    .reached
                    .map_or(String::new(), |time| format!(", and got to {time} s"));
                let what = format!(
                    "it discards the step of {length} s at {from} s{reached}: give it shorter ones (--step, or step in a test file)"
                );
                return Err(self.failure(&what));
            }
            self.check(end.status, &format!("the step of {length} s at {from} s"))?;
        }
        self.get(outputs)?;
        Ok(if has_ended {
            Stepped::Ended
        } else {
            Stepped::Done
        })
    }

    fn change(
        &mut self,
        (kind, reference): (ValueType, u32),
        value: Value,
    ) -> Result<Value, Failure> {
        let mut before = [value];
        let status = self.instance.get(kind, &[reference], &mut before);
        self.check(status, "reading a variable before its fault")?;
        let status = self.instance.set(kind, &[reference], &[value]);
        self.check(status, "setting a variable for its fault")?;
        Ok(before[0])
    }

    fn end(&mut self) -> Result<(), Failure> {
        if std::mem::replace(&mut self.is_over, true) {
            return Ok(());
        }
        let status = self.instance.terminate();
        self.check(status, "its end")
    }
}

impl Drop for Direct {
    fn drop(&mut self) {
        // An error at the end is of no use any more.
        let _ = self.end();
    }
}
