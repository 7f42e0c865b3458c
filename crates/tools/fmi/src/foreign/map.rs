//! The map: joins variables of an FMU with signals where their names differ, and sets parameters.

use std::path::Path;

use tickbus_base::toml_text::{
    Mistakes, Table, Value as TomlValue, did_you_mean, load_text, nearest, parse_text, shown,
};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::unknown;

use super::model::{Causality, ForeignVariable, Model};
use crate::value::{Number, Value, ValueType};

/// A signal and its variable: signal = `scale` × variable + `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joined {
    /// The signal's index in the table.
    pub signal: usize,
    /// The variable's index in the model description.
    pub variable: usize,
    /// The number of signal units per unit of the variable. Not 0.
    pub scale: f64,
    /// The signal's value where the variable is 0.
    pub offset: f64,
}

/// A map, read for one FMU and one driver.cfg.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map {
    /// Signals and their variables.
    pub joined: Vec<Joined>,
    /// Structural parameters, as in `parameters`.
    pub structural: Vec<(usize, Vec<Value>)>,
    /// Parameters, by the positions of their variables, and their values: one, or one for each element of an array that
    /// begins there.
    pub parameters: Vec<(usize, Vec<Value>)>,
    /// Parameters of type text, and their values.
    pub texts: Vec<(usize, String)>,
}

impl Map {
    /// Reads the map at `path`. If it sets sizes of arrays, `model` gets their elements as variables.
    ///
    /// # Errors
    ///
    /// Returns every mistake in the map: names that neither the FMU nor the driver.cfg has, with the nearest ones;
    /// variables that cannot be signals; directions that do not match.
    pub fn load(path: &Path, model: &mut Model, config: &Config) -> Result<Self, Mistakes> {
        let text = load_text(path)?;
        parse_text(&path.display().to_string(), &text, |root| {
            Some(read(root, model, config))
        })
    }
}

fn read(mut root: Table<'_>, model: &mut Model, config: &Config) -> Map {
    let signals = root.take("signals");
    let parameters = root.take("parameters");
    root.require_one_of(
        &["signals", "parameters"],
        "write [signals] with lines such as \"Level\" = \"tank.level\"",
    );
    root.finish();
    let shape = "write lines such as \"tank.area\" = 2.5";
    let parameters = parameters.and_then(|value| value.table("parameters", shape));
    let sizes = parameters.iter().flat_map(Table::all);
    let sizes: Vec<_> = sizes.filter_map(|line| size(line, model)).collect();
    if !sizes.is_empty() {
        model.resize(&sizes);
    }
    let model = &*model;
    let mut map = Map::default();
    let signals = signals.and_then(|value| value.table("[signals]", "write a [signals] table"));
    for (name, value) in signals.iter().flat_map(Table::all) {
        if let Some(joined) = joined(name, &value, model, config) {
            let twin = map
                .joined
                .iter()
                .find(|other| other.variable == joined.variable);
            let is_input = model.variables[joined.variable].causality == Causality::Input;
            if let (Some(twin), true) = (twin, is_input) {
                let twin = &config.table.signals[twin.signal].name;
                value.wrong(
                    format!("\"{twin}\" is joined with this input already"),
                    "an input of the FMU has one source: remove one of the two lines",
                );
            }
            map.joined.push(joined);
        }
    }
    for (name, value) in parameters.iter().flat_map(Table::all) {
        match parameter(name, &value, model) {
            Some((at, Set::Values(values))) if model.variables[at].is_structural => {
                map.structural.push((at, values));
            }
            Some((at, Set::Values(values))) => map.parameters.push((at, values)),
            Some((at, Set::Text(text))) => map.texts.push((at, text)),
            None => {}
        }
    }
    map
}

/// The value that a parameter is set to.
enum Set {
    Values(Vec<Value>),
    Text(String),
}

/// The value reference of a structural parameter, and the size that a line of the map gives it.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number of 64 bits"
)]
fn size((name, value): (&str, TomlValue<'_>), model: &Model) -> Option<(u32, u64)> {
    let variable = &model.variables[model.position(name)?];
    let written = value.written();
    if !variable.is_structural || written.is_empty() {
        return None;
    }
    if let Ok(size) = written.parse() {
        return Some((variable.reference, size));
    }
    // As 3.0 or 0x10.
    let number = value.number("write a whole number")?;
    holds(ValueType::UInt64, number).then_some((variable.reference, number as u64))
}

fn parameter(name: &str, value: &TomlValue<'_>, model: &Model) -> Option<(usize, Set)> {
    if let Some(array) = model.array_of(name) {
        let told = format!(
            "\"{}\" is an array of {}",
            shown(&array.name),
            array.type_name
        );
        let right = match array.count {
            0 => Some("it has no elements: remove the line, or make it larger"),
            _ if array.name != name => Some("write all its elements in one line, in a list"),
            _ => None,
        };
        if let Some(right) = right {
            value.wrong(told, right);
            return None;
        }
        let mut values = Vec::new();
        elements(value, &model.variables[array.first], &mut values)?;
        if values.len() != array.count {
            let right = format!(
                "write {} values: {}, the last index changes first",
                array.count,
                array.told()
            );
            value.wrong(
                format!("{told}, and these are {} values", values.len()),
                right,
            );
            return None;
        }
        return Some((array.first, Set::Values(values)));
    }
    let Some(at) = model.position(name) else {
        let names = model
            .variables
            .iter()
            .filter(|one| one.causality != Causality::Output);
        let near = nearest(name, names.map(|one| &*one.name));
        value.wrong(
            format!("the FMU has no variable \"{}\"", shown(name)),
            near.map_or_else(
                || "name one of its parameters, as its modelDescription.xml has them".to_owned(),
                |near| format!("did you mean \"{near}\"?"),
            ),
        );
        return None;
    };
    let variable = &model.variables[at];
    if variable.type_name == ValueType::String.name() {
        let text = value.text("write a text in quotes")?;
        return Some((at, Set::Text(text.to_owned())));
    }
    Some((at, Set::Values(vec![scalar(value, variable)?])))
}

/// Reads the elements of a list, or of lists in a list.
fn elements(
    value: &TomlValue<'_>,
    variable: &ForeignVariable,
    into: &mut Vec<Value>,
) -> Option<()> {
    for one in value.list("write a list of its elements")? {
        if one.is_list() {
            elements(&one, variable, into)?;
        } else {
            into.push(scalar(&one, variable)?);
        }
    }
    Some(())
}

/// Reads one value of a variable.
fn scalar(value: &TomlValue<'_>, variable: &ForeignVariable) -> Option<Value> {
    let name = shown(&variable.name);
    let Some(kind) = variable.value_type else {
        value.wrong(
            format!("\"{name}\" is of type {}", variable.type_name),
            "only numbers, Booleans and texts can be set",
        );
        return None;
    };
    if kind == ValueType::Boolean && value.is_boolean() {
        return Some(Value::Boolean(value.boolean()?));
    }
    if let (Some(text), false) = (value.as_text(), variable.items.is_empty()) {
        let item = variable.items.iter().find(|(name, _)| name == text);
        if item.is_none() {
            let names: Vec<&str> = variable.items.iter().map(|(name, _)| &**name).collect();
            value.wrong(
                format!(
                    "the enumeration of \"{name}\" has no item \"{}\"",
                    shown(text)
                ),
                did_you_mean(text, "items", &names),
            );
        }
        return item.map(|(_, number)| Value::Signed(*number));
    }
    let number = value.number(if kind == ValueType::Boolean {
        "write true or false"
    } else {
        "write a number"
    })?;
    if !holds(kind, number) {
        value.wrong(
            format!(
                "\"{name}\" is of type {}, which has no such value",
                variable.type_name
            ),
            if kind == ValueType::Boolean {
                "write true or false"
            } else {
                "write a whole number within its range"
            },
        );
        return None;
    }
    Some(Value::Real(number))
}

/// Returns true if a type can represent this number; a floating point type takes its nearest value.
#[expect(clippy::float_cmp, reason = "exactly as written")]
pub(super) fn holds(kind: ValueType, number: f64) -> bool {
    fn nearest<T: Number>(number: f64) -> f64 {
        T::from_real(number).value().real()
    }
    let found = match kind {
        ValueType::Int8 => nearest::<i8>(number),
        ValueType::UInt8 => nearest::<u8>(number),
        ValueType::Int16 => nearest::<i16>(number),
        ValueType::UInt16 => nearest::<u16>(number),
        ValueType::Int32 => nearest::<i32>(number),
        ValueType::UInt32 => nearest::<u32>(number),
        ValueType::Int64 => nearest::<i64>(number),
        ValueType::UInt64 => nearest::<u64>(number),
        ValueType::Boolean => nearest::<bool>(number),
        ValueType::Float32 => return nearest::<f32>(number).is_finite(),
        ValueType::Float64 | ValueType::String => return true,
    };
    found == number
}

fn joined(name: &str, value: &TomlValue<'_>, model: &Model, config: &Config) -> Option<Joined> {
    const SHAPE: &str = "write the variable's name in quotes, or { variable = \"h\", scale = 1000.0, offset = 0.0 }";
    let Some(signal) = config.table.position(name) else {
        value.refuse(unknown(name, &config.table));
        return None;
    };
    let (variable, scale, offset) = if value.is_table() {
        let mut table = value.table("the variable", SHAPE)?;
        let variable = table.require("variable", SHAPE);
        let (scale, offset) = (table.take("scale"), table.take("offset"));
        table.finish();
        let number = |value: Option<TomlValue<'_>>, default| match value {
            None => Some(default),
            Some(value) => value.number("write a number"),
        };
        if let Some(value) = &scale
            && value.number("write a number") == Some(0.0)
        {
            value.wrong(
                "a scale of 0 says nothing of the variable",
                "write how many units of the signal one of the variable is",
            );
            return None;
        }
        (variable?, number(scale, 1.0)?, number(offset, 0.0)?)
    } else {
        (value.clone(), 1.0, 0.0)
    };
    let wanted = variable.text(SHAPE)?;
    let (writes, _) = config.role.areas();
    let is_from_fmu = config.table.signals[signal].area == writes;
    let fits = |causality| {
        if is_from_fmu {
            matches!(causality, Causality::Output | Causality::Local)
        } else {
            causality == Causality::Input
        }
    };
    let Some(at) = model.position(wanted) else {
        let names = model.variables.iter().filter(|one| fits(one.causality));
        let near = nearest(wanted, names.map(|one| &*one.name));
        if let Some(array) = model.array_of(wanted) {
            variable.wrong(
                format!(
                    "\"{}\" is an array of {}",
                    shown(&array.name),
                    array.type_name
                ),
                format!("{}; name one", array.told()),
            );
            return None;
        }
        variable.wrong(
            format!("the FMU has no variable \"{}\"", shown(wanted)),
            near.map_or_else(
                || {
                    format!(
                        "name one of its {}s",
                        if is_from_fmu { "output" } else { "input" }
                    )
                },
                |near| format!("did you mean \"{near}\"?"),
            ),
        );
        return None;
    };
    let found = &model.variables[at];
    if found.value_type.is_none() {
        variable.wrong(
            format!("\"{}\" is of type {}", shown(wanted), found.type_name),
            "only numbers and Booleans can be signals",
        );
        return None;
    }
    if !fits(found.causality) {
        let address = config.table.signals[signal].address();
        let (what, right) = if is_from_fmu {
            (
                "an input",
                "which the FMU has to write: name one of its outputs",
            )
        } else {
            (
                "not an input",
                "which the FMU has to read: name one of its inputs",
            )
        };
        variable.wrong(
            format!("\"{}\" is {what} of the FMU", shown(wanted)),
            format!("\"{name}\" is {address}, {right}; or run it in the other --role"),
        );
        return None;
    }
    Some(Joined {
        signal,
        variable: at,
        scale,
        offset,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_has_the_very_value_that_the_map_says() {
        for (kind, number, right) in [
            (ValueType::UInt8, 255.0, true),
            (ValueType::UInt8, 256.0, false),
            (ValueType::UInt8, -1.0, false),
            (ValueType::Int32, 2.5, false),
            (ValueType::Int64, -3.0, true),
            (ValueType::Boolean, 1.0, true),
            (ValueType::Boolean, 2.0, false),
            (ValueType::Float32, 0.1, true),
            (ValueType::Float32, 1e300, false),
            (ValueType::Float64, 1e300, true),
        ] {
            assert_eq!(holds(kind, number), right, "{number} as {kind:?}");
        }
    }
}
