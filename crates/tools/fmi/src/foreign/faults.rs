//! Faults of an FMU: a variable that can be changed while it runs has another value for a time.

use std::collections::HashSet;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{nearest, short_number, shown};

use super::join::Join;
use super::map::holds;
use super::model::{Causality, ForeignVariable, Model};
use super::slave::{Failure, Slave};
use super::target::Target;
use crate::value::{Value, ValueType};

/// A variable that a fault can change.
#[derive(Debug)]
pub(super) struct Changeable {
    variable: Target,
    /// The place among the joined inputs, which are set before each step.
    input: Option<usize>,
    /// The value of the fault that the variable has.
    fault: Option<Value>,
    /// The value before the fault.
    before: Option<Value>,
}

impl Changeable {
    /// The variables of an FMU that can be changed while it runs.
    pub(super) fn all(model: &Model, join: &Join) -> Vec<Self> {
        let of = |(index, one): (usize, &ForeignVariable)| {
            let mut inputs = join.inputs.iter();
            Some(Self {
                variable: Target::of(one)?,
                input: inputs.position(|joined| joined.variable == index),
                fault: None,
                before: None,
            })
        };
        changeable(model).filter_map(of).collect()
    }

    /// Puts the fault's value in the place of the signal's, if the variable is a joined input.
    pub(super) fn apply_to(&self, inputs: &mut [Value]) {
        if let (Some(input), Some(value)) = (self.input, self.fault) {
            inputs[input] = value;
        }
    }

    /// Begins a fault, changes its value, or ends it.
    pub(super) fn set(&mut self, value: Option<f64>, slave: &mut dyn Slave) -> Result<(), Failure> {
        self.fault = value.map(Value::Real);
        if self.input.is_some() {
            return Ok(());
        }
        match self.fault.or_else(|| self.before.take()) {
            None => {}
            Some(value) => {
                let former = slave.change(self.variable, value)?;
                if self.fault.is_some() {
                    self.before.get_or_insert(former);
                }
            }
        }
        Ok(())
    }
}

fn can_have_a_fault(variable: &ForeignVariable) -> bool {
    variable.is_changeable && variable.value_type.is_some()
}

/// The variables that can have a fault; of an FMU that breaks the standard without those whose name is no name, or is
/// there already.
fn changeable(model: &Model) -> impl Iterator<Item = (usize, &ForeignVariable)> {
    let mut seen = HashSet::new();
    let variables = model.variables.iter().enumerate();
    variables.filter(move |(_, one)| {
        let is_name = !one.name.is_empty() && !one.name.chars().any(char::is_control);
        can_have_a_fault(one) && is_name && seen.insert(one.name.as_str())
    })
}

impl Model {
    /// The names by which a fault of the kind "model" can change a variable while the FMU runs: those of its inputs and
    /// of its tunable parameters, in the order of the model description.
    pub fn fault_names(&self) -> Vec<String> {
        changeable(self).map(|(_, one)| one.name.clone()).collect()
    }

    /// Those of the [`fault_names`](Self::fault_names) that are Booleans and not joined with a signal: faults that are on
    /// or off.
    pub fn fault_switches(&self, join: &Join) -> Vec<String> {
        let is_joined = |index| join.inputs.iter().any(|joined| joined.variable == index);
        let switches = changeable(self).filter(|(index, one)| {
            one.value_type == Some(ValueType::Boolean) && !is_joined(*index)
        });
        switches.map(|(_, one)| one.name.clone()).collect()
    }

    /// Checks a fault of the kind "model".
    ///
    /// # Errors
    ///
    /// The FMU has no variable of this name, it cannot be changed while the FMU runs, or it cannot have this value.
    pub fn check_fault(&self, name: &str, value: f64) -> Result<(), Mistake> {
        let names = || self.variables.iter().filter(|one| can_have_a_fault(one));
        let found = self.variables.iter().find(|one| one.name == name);
        let Some(variable) = found.filter(|one| can_have_a_fault(one)) else {
            let what = match found {
                None => format!("the FMU has no variable \"{}\"", shown(name)),
                Some(found) => format!("\"{name}\" is {}", why_not(found)),
            };
            let right = match nearest(name, names().map(|one| &*one.name)) {
                Some(near) => format!("did you mean \"{near}\"?"),
                None if names().next().is_none() => {
                    "the FMU has none that can: export it with tunable parameters".to_owned()
                }
                None => "name one of its inputs or tunable parameters".to_owned(),
            };
            return Err(Mistake::new(what, right));
        };
        let is_held = variable.value_type.is_some_and(|kind| holds(kind, value));
        if is_held {
            return Ok(());
        }
        Err(Mistake::new(
            format!(
                "\"{name}\" is of type {}, which has no value {}",
                variable.type_name,
                short_number(value)
            ),
            "write a value of that type; 1 is on, and 0 is off",
        ))
    }
}

/// Why a variable cannot have a fault.
fn why_not(variable: &ForeignVariable) -> String {
    if variable.value_type.is_none() {
        return format!(
            "of type {}, and only numbers and Booleans can have faults",
            variable.type_name
        );
    }
    let what = match variable.causality {
        Causality::Parameter => "a fixed parameter",
        Causality::Output => "an output",
        Causality::Input | Causality::Local => "a local variable",
    };
    format!("{what} of the FMU, which cannot be changed while it runs")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_can_be_changed_while_the_fmu_runs_can_have_a_fault() {
        let text = "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"x\" guid=\"g\">\
                    <CoSimulation modelIdentifier=\"x\"/><ModelVariables>\
                    <ScalarVariable name=\"valve\" valueReference=\"0\" causality=\"input\"><Boolean/></ScalarVariable>\
                    <ScalarVariable name=\"level\" valueReference=\"1\" causality=\"output\"><Real/></ScalarVariable>\
                    <ScalarVariable name=\"hose.leak\" valueReference=\"2\" causality=\"parameter\" variability=\"tunable\">\
                    <Real/></ScalarVariable>\
                    <ScalarVariable name=\"area\" valueReference=\"3\" causality=\"parameter\" variability=\"fixed\">\
                    <Real/></ScalarVariable>\
                    <ScalarVariable name=\"file\" valueReference=\"4\" causality=\"parameter\" variability=\"tunable\">\
                    <String/></ScalarVariable>\
                    <ScalarVariable name=\"v\" valueReference=\"5\"><Real/></ScalarVariable>\
                    </ModelVariables></fmiModelDescription>";
        let model = Model::parse("m.xml", text).expect("right");
        assert_eq!(model.fault_names(), ["valve", "hose.leak"]);
        assert_eq!(model.check_fault("hose.leak", 0.4), Ok(()));
        assert_eq!(model.check_fault("valve", 0.0), Ok(()));
        for (name, value, told) in [
            (
                "hose.leek",
                0.4,
                "the FMU has no variable \"hose.leek\"; did you mean \"hose.leak\"?",
            ),
            (
                "area",
                1.0,
                "\"area\" is a fixed parameter of the FMU, which cannot be changed while it runs; name one of its inputs or \
                 tunable parameters",
            ),
            (
                "level",
                1.0,
                "\"level\" is an output of the FMU, which cannot be changed while it runs; name one of its inputs or \
                 tunable parameters",
            ),
            (
                "v",
                1.0,
                "\"v\" is a local variable of the FMU, which cannot be changed while it runs; name one of its inputs or \
                 tunable parameters",
            ),
            (
                "file",
                1.0,
                "\"file\" is of type String, and only numbers and Booleans can have faults; name one of its inputs or \
                 tunable parameters",
            ),
            (
                "valve",
                0.4,
                "\"valve\" is of type Boolean, which has no value 0.4; write a value of that type; 1 is on, and 0 is off",
            ),
        ] {
            let mistake = model.check_fault(name, value).expect_err(name);
            assert_eq!(mistake.to_string(), told);
        }
    }
}
