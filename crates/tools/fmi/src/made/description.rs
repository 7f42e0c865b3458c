//! Writes `modelDescription.xml` of the FMU made from a driver.cfg.
//!
//! The text follows the schemas of both standards, which define the order of the elements. Inputs and outputs are
//! discrete. Outputs depend on nothing within a step, since values are exchanged only by a step.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use quick_xml::escape::escape;

use tickbus_driver_cfg::Config;

use super::exposed::Exposed;
use super::own::cycle;
use super::variables::{Enumeration, Start, Use, Variable, seconds};
use crate::value::{Value, ValueType, Version};

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
    let events = if is_two {
        ""
    } else {
        " mightReturnEarlyFromDoStep=\"true\" hasEventMode=\"true\""
    };
    let _ = writeln!(
        text,
        "  <CoSimulation modelIdentifier=\"{}\" canHandleVariableCommunicationStepSize=\"true\"{events}/>",
        identifier(config)
    );
    units(&mut text, &exposed);
    enumerations(&mut text, &exposed);
    text.push_str("  <LogCategories>\n");
    for (name, about) in CATEGORIES {
        let _ = writeln!(
            text,
            "    <Category name=\"{name}\" description=\"{about}\"/>"
        );
    }
    text.push_str("  </LogCategories>\n");
    let step = seconds(cycle(config));
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

/// Writes the types of the variables that are enumerations; version 2.0 has none.
fn enumerations(text: &mut String, exposed: &Exposed) {
    let types = exposed.variables.iter().filter_map(|one| one.enumeration);
    let types: Vec<&Enumeration> = types.collect();
    if types.is_empty() {
        return;
    }
    text.push_str("  <TypeDefinitions>\n");
    for one in types {
        let _ = writeln!(text, "    <EnumerationType name=\"{}\">", one.name);
        for (value, item) in one.items.iter().enumerate() {
            let _ = writeln!(text, "      <Item name=\"{item}\" value=\"{value}\"/>");
        }
        text.push_str("    </EnumerationType>\n");
    }
    text.push_str("  </TypeDefinitions>\n");
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
        Use::Clock => {
            "causality=\"output\" variability=\"discrete\" intervalVariability=\"triggered\""
        }
    }
}

fn start(variable: &Variable) -> Option<String> {
    match &variable.start {
        Start::None => None,
        Start::Text(text) => Some(escape(text.as_str()).into_owned()),
        Start::Numbers(values) => {
            let values = values.iter();
            let values: Vec<_> = values
                .map(|value| number(variable.value_type, *value))
                .collect();
            Some(values.join(" "))
        }
    }
}

fn number(value_type: ValueType, value: Value) -> String {
    match (value_type, value) {
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
    }
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
    let element = variable.element();
    let _ = write!(
        text,
        "    <{element} name=\"{}\" valueReference=\"{}\" {} description=\"{}\"{}",
        escape(variable.name.as_str()),
        variable.reference,
        usage(variable),
        escape(variable.description.as_str()),
        unit(variable),
    );
    if let Some(declared) = variable.enumeration {
        let _ = write!(text, " declaredType=\"{}\"", declared.name);
    }
    let start = start(variable);
    let mut inner = String::new();
    for size in &variable.sizes {
        let _ = write!(inner, "<Dimension start=\"{size}\"/>");
    }
    if variable.value_type == ValueType::String
        && let Some(start) = &start
    {
        let _ = write!(inner, "<Start value=\"{start}\"/>");
    } else if let Some(start) = start {
        let _ = write!(text, " start=\"{start}\"");
    }
    let _ = if inner.is_empty() {
        writeln!(text, "/>")
    } else {
        writeln!(text, ">{inner}</{element}>")
    };
}

fn structure(text: &mut String, exposed: &Exposed, version: Version) {
    let outputs = exposed.variables.iter().enumerate();
    let outputs = outputs.filter(|(_, one)| matches!(one.usage, Use::Output | Use::Clock));
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
    // An output without a start value.
    for clock in (exposed.variables.iter()).filter(|one| one.usage == Use::Clock) {
        let reference = clock.reference;
        let _ = writeln!(
            text,
            "    <InitialUnknown valueReference=\"{reference}\" dependencies=\"\"/>"
        );
    }
    text.push_str("  </ModelStructure>\n");
}
