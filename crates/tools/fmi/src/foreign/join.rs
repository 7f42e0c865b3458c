//! Joins the variables of an FMU with signals.

use tickbus_base::Mistake;
use tickbus_base::toml_text::nearest;
use tickbus_driver_cfg::Config;

use super::map::{Joined, Map};
use super::model::{Causality, ForeignVariable, Model};
use crate::value::Value;

/// A signal or variable that is not joined: a line for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unjoined(pub String);

/// The result of joining.
#[derive(Clone, Debug, PartialEq)]
pub struct Join {
    /// The values that the FMU receives before each step.
    pub inputs: Vec<Joined>,
    /// The values that the FMU returns after each step.
    pub outputs: Vec<Joined>,
    /// Structural parameters and their values, as in [`Map`].
    pub structural: Vec<(usize, Vec<Value>)>,
    /// Parameters and their values, as in [`Map`].
    pub parameters: Vec<(usize, Vec<Value>)>,
    /// Parameters of type text, and their values.
    pub texts: Vec<(usize, String)>,
    /// The rest: signals that nobody writes, inputs that keep their start values, outputs that nobody reads.
    pub left: Vec<Unjoined>,
}

impl Join {
    /// Joins the signals of `config`, in its role, with the variables of an FMU: by the map, and all others by their
    /// names.
    ///
    /// # Errors
    ///
    /// Nothing could be joined.
    pub fn of(config: &Config, model: &Model, map: &Map) -> Result<Self, Mistake> {
        let (writes, _) = config.role.areas();
        let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
        let mut left = Vec::new();
        for (index, signal) in config.table.signals.iter().enumerate() {
            let is_from_fmu = signal.area == writes;
            let wanted = if is_from_fmu {
                Causality::Output
            } else {
                Causality::Input
            };
            let fits = |one: &&ForeignVariable| one.causality == wanted && one.value_type.is_some();
            let by_map = map.joined.iter().find(|joined| joined.signal == index);
            let same = model.position(&signal.name);
            // An input of the FMU has one source, and the map has priority.
            let taken = map
                .joined
                .iter()
                .find(|joined| !is_from_fmu && Some(joined.variable) == same);
            let by_name = || {
                let variable = same.filter(|_| taken.is_none())?;
                fits(&&model.variables[variable]).then_some(Joined {
                    signal: index,
                    variable,
                    scale: 1.0,
                    offset: 0.0,
                })
            };
            let Some(joined) = by_map.copied().or_else(by_name) else {
                if is_from_fmu && config.reply_of(index).is_some() {
                    continue;
                }
                let (what, kind) = if is_from_fmu {
                    ("keeps its fail-safe value", "output")
                } else {
                    ("is read by nobody", "input")
                };
                let same = same.map(|at| &model.variables[at]);
                let near = nearest(
                    &signal.name,
                    model.variables.iter().filter(fits).map(|one| &*one.name),
                );
                let hint = match (same, near) {
                    (Some(_), _) if taken.is_some() => format!(
                        "the map joins the FMU's variable of that name with \"{}\"",
                        taken.map_or("", |taken| &config.table.signals[taken.signal].name)
                    ),
                    (Some(same), _) => format!(
                        "the FMU's variable of that name is no {kind} that can be a signal ({})",
                        same.type_name
                    ),
                    (None, Some(near)) => format!("the FMU's nearest {kind} is \"{near}\""),
                    (None, None) => format!("the FMU has no {kind} like it"),
                };
                left.push(Unjoined(format!(
                    "signal \"{}\" ({}) {what}: {hint}",
                    signal.name,
                    signal.address()
                )));
                continue;
            };
            if is_from_fmu {
                outputs.push(joined);
            } else {
                inputs.push(joined);
            }
        }
        for (index, variable) in model.variables.iter().enumerate() {
            let used = inputs
                .iter()
                .chain(&outputs)
                .any(|joined| joined.variable == index);
            if !used && variable.causality == Causality::Input {
                left.push(Unjoined(format!(
                    "input \"{}\" of the FMU keeps its start value",
                    variable.name
                )));
            }
        }
        if inputs.is_empty() && outputs.is_empty() {
            return Err(nothing_in_common(config, model));
        }
        Ok(Self {
            inputs,
            outputs,
            structural: map.structural.clone(),
            parameters: map.parameters.clone(),
            texts: map.texts.clone(),
            left,
        })
    }
}

/// Returns the message for the case that no names match.
fn nothing_in_common(config: &Config, model: &Model) -> Mistake {
    let names = |wanted: Causality| {
        let names = model.variables.iter().filter(|one| one.causality == wanted);
        let names: Vec<_> = names
            .take(5)
            .map(|one| {
                let kind = format!(" ({})", one.type_name);
                let kind = if one.value_type.is_none() { &kind } else { "" };
                format!("\"{}\"{kind}", one.name)
            })
            .collect();
        if names.is_empty() {
            "none".to_owned()
        } else {
            names.join(", ")
        }
    };
    Mistake::new(
        format!(
            "no signal of {} has the name of a variable (inputs: {}; outputs: {})",
            config.path.display(),
            names(Causality::Input),
            names(Causality::Output)
        ),
        "write a map: --map map.toml, with [signals] and lines such as \"Level\" = \"tank.level\"",
    )
}

#[cfg(test)]
mod tests {
    use tickbus_driver_cfg::Kinds;

    use super::*;

    static KINDS: Kinds = Kinds::LOOPBACK.with_programs(tickbus_programs::PROGRAMS);

    #[test]
    fn an_input_that_the_map_joins_is_not_joined_by_its_name_too() {
        let text = "[driver]\nid = 1\nname = \"It\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                    [[signal]]\nname = \"Command\"\naddress = \"%QX0.0\"\n[[signal]]\nname = \"valve\"\naddress = \"%QX0.1\"\n";
        let config =
            Config::parse("it.cfg", text, &KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let text = "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"x\" instantiationToken=\"g\">\
                    <CoSimulation modelIdentifier=\"x\"/><ModelVariables>\
                    <Boolean name=\"valve\" valueReference=\"1\" causality=\"input\"/></ModelVariables></fmiModelDescription>";
        let model = Model::parse("m.xml", text).expect("right");
        let command = Joined {
            signal: 0,
            variable: 0,
            scale: 1.0,
            offset: 0.0,
        };
        let map = Map {
            joined: vec![command],
            ..Map::default()
        };
        let join = Join::of(&config, &model, &map).expect("one is joined");
        assert_eq!(join.inputs, [command]);
        assert_eq!(
            join.left,
            [Unjoined(
                "signal \"valve\" (%QX0.1) is read by nobody: the map joins the FMU's variable of that name with \"Command\""
                    .to_owned()
            )]
        );
        let join = Join::of(&config, &model, &Map::default()).expect("one is joined");
        assert_eq!(
            join.inputs,
            [Joined {
                signal: 1,
                ..command
            }]
        );
    }
}
