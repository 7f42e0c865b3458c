//! A running FMU: inputs, a step, outputs.

use std::collections::HashMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::events::{EventSetup, Events};
use super::library::{Instance, StepEnd};
use super::target::Target;
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
    /// The values to set in the configuration mode: type, value reference, and one value, or those of a whole array.
    pub structural: Vec<(ValueType, u32, Vec<Value>)>,
    /// The values to set before the run, in the same form.
    pub parameters: Vec<(ValueType, u32, Vec<Value>)>,
    /// The texts to set before the run: value reference, text.
    pub texts: Vec<(u32, String)>,
    /// The variables to set before every step.
    pub inputs: Vec<Target>,
    /// The variables to read after every step.
    pub outputs: Vec<Target>,
    /// The clocks of an FMU that is run with its event mode.
    pub events: Option<EventSetup>,
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
    fn change(&mut self, variable: Target, value: Value) -> Result<Value, Failure>;

    /// Ends the run properly.
    ///
    /// # Errors
    ///
    /// The FMU failed to end its run.
    fn end(&mut self) -> Result<(), Failure>;
}

/// Variables of one type, handled in one call. An array is one variable with a value for each element.
#[derive(Debug)]
struct Group {
    kind: ValueType,
    references: Vec<u32>,
    values: Vec<Value>,
    /// The index of each value, and the place of its variable among all inputs or outputs.
    joined: Vec<(usize, usize)>,
}

fn groups(variables: &[(usize, Target)]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    // The group and the first value of each array.
    let mut arrays: HashMap<u32, (usize, usize)> = HashMap::new();
    for &(place, target) in variables {
        let index = groups.iter().position(|group| group.kind == target.kind);
        let index = index.unwrap_or_else(|| {
            groups.push(Group {
                kind: target.kind,
                references: Vec::new(),
                values: Vec::new(),
                joined: Vec::new(),
            });
            groups.len() - 1
        });
        let group = &mut groups[index];
        let first = group.values.len();
        let known =
            (target.of > 1).then(|| *arrays.entry(target.reference).or_insert((index, first)));
        let first = match known {
            Some((of, known)) if (of, known) != (index, first) => known,
            _ => {
                group.references.push(target.reference);
                let values = first + target.of;
                group.values.resize(values, Value::Real(0.0));
                first
            }
        };
        group.joined.push((first + target.at, place));
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
    events: Option<Events>,
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
        let version = (version, setup.events.is_some());
        let instance = Instance::new(names, version, &setup.library, &setup.resources);
        let instance = instance.map_err(|why| Failure(format!("{}: {why}", setup.file)))?;
        let clocked = |inputs: bool| {
            let events = setup.events.as_ref();
            events.map_or(
                &[][..],
                |one| if inputs { &one.inputs } else { &one.outputs },
            )
        };
        let mut slave = Self {
            instance,
            file: setup.file.clone(),
            inputs: groups(&EventSetup::unclocked(&setup.inputs, clocked(true))),
            outputs: groups(&EventSetup::unclocked(&setup.outputs, clocked(false))),
            events: (setup.events.as_ref()).map(|events| Events::of(events, setup.start)),
            is_over: false,
        };
        if !setup.structural.is_empty() {
            let status = slave.instance.configure(true);
            slave.configured(status, "entering the configuration")?;
            slave.set_parameters(&setup.structural)?;
            let status = slave.instance.configure(false);
            slave.configured(status, "its configuration")?;
        }
        slave.set_parameters(&setup.parameters)?;
        for (reference, text) in &setup.texts {
            let status = slave.instance.set_text(*reference, text);
            let status = status.map_err(|why| Failure(format!("{}: {why}", setup.file)))?;
            slave.check(status, "setting a parameter")?;
        }
        let status = slave
            .instance
            .enter(setup.start, setup.tolerance, setup.stop);
        slave.check(status, "entering the initialisation")?;
        slave.get_unjoined()?;
        slave.set(inputs)?;
        let status = slave.instance.exit();
        slave.check(status, "its initialisation")?;
        if let Some(events) = &mut slave.events {
            // An end that is asked for so early comes with the first step.
            let begun = events.begin(&mut slave.instance);
            begun.or_else(|(status, what)| slave.check(status, what).map(|()| false))?;
        }
        slave.get(outputs)?;
        Ok(slave)
    }

    fn configured(&mut self, status: Result<Status, String>, what: &str) -> Result<(), Failure> {
        let status = status.map_err(|why| Failure(format!("{}: {why}", self.file)))?;
        self.check(status, what)
    }

    fn set_parameters(&mut self, list: &[(ValueType, u32, Vec<Value>)]) -> Result<(), Failure> {
        for (kind, reference, values) in list {
            let status = self.instance.set(*kind, &[*reference], values);
            self.check(status, "setting a parameter")?;
        }
        Ok(())
    }

    /// Reads the start values of arrays among the inputs: an array is set as a whole, and not each element has a signal.
    fn get_unjoined(&mut self) -> Result<(), Failure> {
        for index in 0..self.inputs.len() {
            let group = &mut self.inputs[index];
            if group.joined.len() == group.values.len() {
                continue;
            }
            let status = self
                .instance
                .get(group.kind, &group.references, &mut group.values);
            self.check(status, "reading the start values of its inputs")?;
        }
        Ok(())
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
        let status = set_all(&mut self.inputs, values, &mut self.instance);
        self.check(status, "setting its inputs")
    }

    /// Does one step; with an event mode, in parts.
    fn pass(&mut self, inputs: &[Value], from: f64, length: f64) -> Result<StepEnd, Failure> {
        let Some(events) = &mut self.events else {
            self.set(inputs)?;
            return Ok(self.instance.step(from, length));
        };
        let groups = &mut self.inputs;
        let mut set = |instance: &mut Instance| set_all(groups, inputs, instance);
        let end = events.step(&mut self.instance, inputs, (from, length), &mut set);
        end.map_err(|(status, what)| {
            let failed = self.check(status, what);
            failed.err().unwrap_or_else(|| self.failure(what))
        })
    }

    fn get(&mut self, values: &mut [Value]) -> Result<(), Failure> {
        for index in 0..self.outputs.len() {
            let group = &mut self.outputs[index];
            let status = self
                .instance
                .get(group.kind, &group.references, &mut group.values);
            for &(at, place) in &group.joined {
                values[place] = group.values[at];
            }
            self.check(status, "reading its outputs")?;
        }
        for clocked in self.events.iter().flat_map(|events| &events.outputs) {
            values[clocked.place] = clocked.value;
        }
        Ok(())
    }
}

/// Sets the inputs of all groups, up to the first that is refused.
fn set_all(groups: &mut [Group], values: &[Value], instance: &mut Instance) -> Status {
    for group in groups {
        for &(at, place) in &group.joined {
            group.values[at] = values[place];
        }
        let status = instance.set(group.kind, &group.references, &group.values);
        if !matches!(status, Status::Ok | Status::Warning) {
            return status;
        }
    }
    Status::Ok
}

impl Slave for Direct {
    fn step(
        &mut self,
        inputs: &[Value],
        from: f64,
        length: f64,
        outputs: &mut [Value],
    ) -> Result<Stepped, Failure> {
        let end = self.pass(inputs, from, length)?;
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

    fn change(&mut self, variable: Target, value: Value) -> Result<Value, Failure> {
        let (status, before) = variable.get(&mut self.instance);
        self.check(status, "reading a variable before its fault")?;
        let status = variable.set(&mut self.instance, value);
        self.check(status, "setting a variable for its fault")?;
        Ok(before)
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
