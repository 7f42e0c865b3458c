//! Writes `modelDescription.xml` of the FMU made from a driver.cfg.
//!
//! The text follows the schemas of both standards, which define the order of the elements. Inputs and outputs are
//! discrete. Outputs depend on nothing within a step, since values are exchanged only by a step.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use quick_xml::escape::escape;

use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;

use super::variables::{Exposed, Start, Use, Variable};
use crate::value::{Value, ValueType, Version};

/// The proposed step if the driver.cfg names no cycle.
const STEP: Nanos = Nanos::from_millis(10);

/// The length of the proposed run, in seconds.
const STOP: u32 = 10;

/// The categories of log lines: name and description.
pub(super) const CATEGORIES: [(&str, &str); 3] = [
    ("logStatusError", "What ends the run"),
    ("logStatusWarning", "Lines that fail or are stale"),
    ("logEvents", "Every change of the line"),
];

/// Returns the name of the library without its ending, which is also the prefix of its C functions: the driver's name
/// in characters that C allows.
pub(super) fn identifier(config: &Config) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = config.name.chars().take(64).map(plain).collect();
    if name.starts_with(|c: char| c.is_ascii_digit()) {
        return format!("_{name}");
    }
    name
}

/// Returns the text of the model description; `token` is the token of the driver.cfg packed with it.
pub fn model_description(config: &Config, version: Version, token: &str) -> String {
    let exposed = Exposed::of(config, version);
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let is_two = version == Version::Two;
    let token_name = if is_two { "guid" } else { "instantiationToken" };
    let description = format!(
        "Driver {} of tickbus, on its bus \"{}\"",
        config.id,
        config.bus.kind()
    );
    // Writing to a string cannot fail, here and below.
    let _ = writeln!(
        text,
        "<fmiModelDescription fmiVersion=\"{}\" modelName=\"{}\" {token_name}=\"{token}\" description=\"{}\" \
         generationTool=\"tickbus {}\" variableNamingConvention=\"flat\">",
        version.number(),
        escape(config.name.as_str()),
        escape(description.as_str()),
        env!("CARGO_PKG_VERSION"),
    );
    let _ = writeln!(
        text,
        "  <CoSimulation modelIdentifier=\"{}\" canHandleVariableCommunicationStepSize=\"true\"/>",
        identifier(config)
    );
    units(&mut text, &exposed);
    text.push_str("  <LogCategories>\n");
    for (name, about) in CATEGORIES {
        let _ = writeln!(
            text,
            "    <Category name=\"{name}\" description=\"{about}\"/>"
        );
    }
    text.push_str("  </LogCategories>\n");
    let step = config.timing.cycle.or(config.bus.cycle()).unwrap_or(STEP);
    #[expect(clippy::cast_precision_loss, reason = "a cycle is short")]
    let step = step.0 as f64 / 1e9;
    let _ = writeln!(
        text,
        "  <DefaultExperiment startTime=\"0\" stopTime=\"{STOP}\" stepSize=\"{step}\"/>"
    );
    text.push_str("  <ModelVariables>\n");
    for variable in &exposed.variables {
        match version {
            Version::Two => variable_of_two(&mut text, variable),
            Version::Three => variable_of_three(&mut text, variable),
        }
    }
    text.push_str("  </ModelVariables>\n");
    structure(&mut text, &exposed, version);
    text.push_str("</fmiModelDescription>\n");
    text
}

fn units(text: &mut String, exposed: &Exposed) {
    let units = exposed.variables.iter();
    let units: BTreeSet<&str> = units.filter_map(|one| one.unit.as_deref()).collect();
    text.push_str("  <UnitDefinitions>\n");
    for unit in units {
        let _ = match unit {
            // The base unit, by which importing tools can convert.
            "s" => writeln!(text, "    <Unit name=\"s\"><BaseUnit s=\"1\"/></Unit>"),
            unit => writeln!(text, "    <Unit name=\"{}\"/>", escape(unit)),
        };
    }
    text.push_str("  </UnitDefinitions>\n");
}

/// Returns causality, variability, and `initial`.
fn usage(variable: &Variable) -> &'static str {
    let is_float = variable.value_type.is_float();
    match variable.usage {
        Use::Independent => "causality=\"independent\" variability=\"continuous\"",
        Use::Parameter if is_float => {
            "causality=\"parameter\" variability=\"tunable\" initial=\"exact\""
        }
        Use::Parameter => "causality=\"parameter\" variability=\"fixed\" initial=\"exact\"",
        Use::Input => "causality=\"input\" variability=\"discrete\"",
        Use::Output => "causality=\"output\" variability=\"discrete\" initial=\"exact\"",
    }
}

fn start(variable: &Variable) -> Option<String> {
    Some(match &variable.start {
        Start::None => return None,
        Start::Text(text) => escape(text.as_str()).into_owned(),
        Start::Number(value) => match (variable.value_type, *value) {
            (ValueType::Boolean, value) => (value.real() != 0.0).to_string(),
            #[expect(
                clippy::cast_possible_truncation,
                reason = "the value as the variable has it"
            )]
            (ValueType::Float32, value) => format!("{:?}", value.real() as f32),
            (ValueType::Float64, value) => format!("{:?}", value.real()),
            (_, Value::Signed(value)) => value.to_string(),
            (_, Value::Unsigned(value)) => value.to_string(),
            (_, value) => format!("{:.0}", value.real()),
        },
    })
}

fn unit(variable: &Variable) -> String {
    match &variable.unit {
        Some(unit) => format!(" unit=\"{}\"", escape(unit.as_str())),
        None => String::new(),
    }
}

fn variable_of_two(text: &mut String, variable: &Variable) {
    let start = start(variable).map_or_else(String::new, |start| format!(" start=\"{start}\""));
    let _ = writeln!(
        text,
        "    <ScalarVariable name=\"{}\" valueReference=\"{}\" {} description=\"{}\"><{}{}{start}/></ScalarVariable>",
        escape(variable.name.as_str()),
        variable.reference,
        usage(variable),
        escape(variable.description.as_str()),
        variable.value_type.name_in(Version::Two),
        unit(variable),
    );
}

fn variable_of_three(text: &mut String, variable: &Variable) {
    let _ = write!(
        text,
        "    <{0} name=\"{1}\" valueReference=\"{2}\" {3} description=\"{4}\"{5}",
        variable.value_type.name(),
        escape(variable.name.as_str()),
        variable.reference,
        usage(variable),
        escape(variable.description.as_str()),
        unit(variable),
    );
    let _ = match (start(variable), variable.value_type) {
        (None, _) => writeln!(text, "/>"),
        (Some(start), ValueType::String) => {
            writeln!(text, "><Start value=\"{start}\"/></String>")
        }
        (Some(start), _) => writeln!(text, " start=\"{start}\"/>"),
    };
}

fn structure(text: &mut String, exposed: &Exposed, version: Version) {
    let outputs = exposed.variables.iter().enumerate();
    let outputs = outputs.filter(|(_, variable)| variable.usage == Use::Output);
    text.push_str("  <ModelStructure>\n");
    if version == Version::Two {
        text.push_str("    <Outputs>\n");
    }
    for (index, variable) in outputs {
        let _ = match version {
            Version::Two => writeln!(
                text,
                "      <Unknown index=\"{}\" dependencies=\"\"/>",
                index + 1
            ),
            Version::Three => writeln!(
                text,
                "    <Output valueReference=\"{}\" dependencies=\"\"/>",
                variable.reference
            ),
        };
    }
    if version == Version::Two {
        text.push_str("    </Outputs>\n");
    }
    text.push_str("  </ModelStructure>\n");
}
