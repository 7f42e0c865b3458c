//! Reads `modelDescription.xml` of a foreign FMU.

use std::collections::HashMap;

use roxmltree::{Document, Node};

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Mistakes, shown};

use super::model::{Causality, Clock, Declared, Dimension, ForeignVariable, Model, Timing};
use crate::value::{ValueType, Version};

impl Model {
    /// Returns the position of the variable with this name.
    pub fn position(&self, name: &str) -> Option<usize> {
        let is_alias = |one: &ForeignVariable| one.aliases.iter().any(|alias| alias == name);
        let mut variables = self.variables.iter();
        variables.position(|one| one.name == name || is_alias(one))
    }

    /// Reads a model description; mistakes call it `file`.
    ///
    /// # Errors
    ///
    /// Returns every mistake, with its line and column.
    pub fn parse(file: &str, text: &str) -> Result<Self, Mistakes> {
        let document = Document::parse(text).map_err(|error| {
            let at = error.pos();
            let place = Some((at.row as usize, at.col as usize));
            let mistake = Mistake::new(
                format!("this is no XML: {error}"),
                "get the FMU anew; it may be cut",
            );
            Mistakes::of_list(
                file,
                vec![tickbus_base::toml_text::PlacedMistake { place, mistake }],
            )
        })?;
        let collector = Collector::new(file, text);
        let model = read(document.root_element(), &collector);
        match (collector.finish(), model) {
            (None, Some(model)) => Ok(model),
            (Some(mistakes), _) => Err(mistakes),
            (None, None) => unreachable!("what is not read has a mistake"),
        }
    }
}

fn wrong(
    collector: &Collector<'_>,
    node: Node<'_, '_>,
    what: impl Into<String>,
    right: impl Into<String>,
) {
    collector.report(node.range().start, what, right);
}

/// Returns a required attribute.
fn required<'a>(collector: &Collector<'_>, node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let value = node.attribute(name);
    if value.is_none() {
        let element = node.tag_name().name();
        wrong(
            collector,
            node,
            format!("<{element}> has no \"{name}\""),
            "export the FMU again, or tell the maker of the tool that has made it",
        );
    }
    value
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(name))
}

fn read(root: Node<'_, '_>, collector: &Collector<'_>) -> Option<Model> {
    if !root.has_tag_name("fmiModelDescription") {
        wrong(
            collector,
            root,
            format!("the root is <{}>", shown(root.tag_name().name())),
            "expected <fmiModelDescription>: name an FMU",
        );
        return None;
    }
    let number = required(collector, root, "fmiVersion")?;
    let version = match number {
        "2.0" => Version::Two,
        number if number == "3.0" || number.starts_with("3.0.") => Version::Three,
        other => {
            wrong(
                collector,
                root,
                format!("this is FMI {}", shown(other)),
                "export the FMU for FMI 2.0 or 3.0, co-simulation",
            );
            return None;
        }
    };
    let name = root.attribute("modelName").unwrap_or("FMU").to_owned();
    let token = match version {
        Version::Two => "guid",
        Version::Three => "instantiationToken",
    };
    let token = required(collector, root, token);
    let Some(kind) = child(root, "CoSimulation") else {
        let others = ["ModelExchange", "ScheduledExecution"];
        let other = others.into_iter().find(|name| child(root, name).is_some());
        let what = match other {
            Some("ModelExchange") => {
                "this FMU is for model exchange alone: it needs a solver for its states and events"
            }
            Some(_) => {
                "this FMU is for scheduled execution alone: it needs a scheduler for its clocks"
            }
            None => "this FMU has no <CoSimulation>",
        };
        wrong(
            collector,
            root,
            what,
            "export it for co-simulation, with its solver inside",
        );
        return None;
    };
    let identifier = required(collector, kind, "modelIdentifier");
    if let Some(identifier) = identifier
        && identifier.contains(['/', '\\', ':'])
    {
        wrong(
            collector,
            kind,
            format!("the modelIdentifier \"{}\" is a path", shown(identifier)),
            "do not use this FMU; ask whoever made it",
        );
    }
    let experiment = child(root, "DefaultExperiment");
    let number = |name: &str| experiment.and_then(|node| node.attribute(name)?.parse::<f64>().ok());
    let variables = child(root, "ModelVariables");
    let variables = variables.into_iter().flat_map(|node| node.children());
    let types = child(root, "TypeDefinitions").map_or_else(HashMap::new, enumerations);
    let variables: Vec<_> = variables.filter(Node::is_element).collect();
    let clocks = variables.iter().filter(|node| node.has_tag_name("Clock"));
    let (clocks, own_clocks) = clocks_of(clocks.copied());
    let declared: Vec<_> = variables
        .into_iter()
        .filter_map(|node| match version {
            Version::Two => variable_of_two(node, &types, collector),
            Version::Three => variable_of_three(node, &types, collector),
        })
        .collect();
    let mut model = Model {
        version,
        name,
        identifier: identifier?.to_owned(),
        token: token?.to_owned(),
        step: number("stepSize").filter(|step| *step > 0.0 && step.is_finite()),
        start: number("startTime")
            .filter(|start| start.is_finite())
            .unwrap_or(0.0),
        tolerance: number("tolerance")
            .filter(|tolerance| *tolerance > 0.0 && tolerance.is_finite()),
        needs_tool: matches!(kind.attribute("needsExecutionTool"), Some("true" | "1")),
        has_event_mode: matches!(kind.attribute("hasEventMode"), Some("true" | "1")),
        clocks,
        own_clocks,
        variables: Vec::new(),
        arrays: Vec::new(),
        declared,
    };
    model.resize(&[]);
    Some(model)
}

/// The clocks that the importer lets tick at times of its own reckoning, and those of the FMU. A triggered input is
/// neither: nothing triggers it.
fn clocks_of<'a, 'i: 'a>(nodes: impl Iterator<Item = Node<'a, 'i>>) -> (Vec<Clock>, Vec<u32>) {
    let (mut clocks, mut own) = (Vec::new(), Vec::new());
    for node in nodes {
        let Some(reference) = node
            .attribute("valueReference")
            .and_then(|text| text.parse().ok())
        else {
            continue;
        };
        let number = |name| node.attribute(name)?.parse::<f64>().ok();
        let resolution = number("resolution").filter(|resolution| *resolution > 0.0);
        let seconds = |decimal, counter| {
            let counted = || Some(number(counter)? / resolution?);
            number(decimal).or_else(counted)
        };
        let interval = seconds("intervalDecimal", "intervalCounter");
        let interval = interval.filter(|interval| interval.is_finite() && *interval > 0.0);
        let shift = seconds("shiftDecimal", "shiftCounter");
        let timing = match (node.attribute("intervalVariability"), interval) {
            (Some("constant" | "fixed"), Some(interval)) => Timing::Periodic {
                interval,
                shift: shift.unwrap_or(0.0),
            },
            (Some("countdown"), _) => Timing::Countdown,
            (Some("triggered"), _) => {
                if node.attribute("causality") != Some("input") {
                    own.push(reference);
                }
                continue;
            }
            _ => Timing::Asked { shift },
        };
        match node.attribute("causality") {
            Some("input") => clocks.push(Clock { reference, timing }),
            _ => own.push(reference),
        }
    }
    (clocks, own)
}

/// The items of an enumeration, by name.
type Items = Vec<(String, i64)>;

/// The enumerations of a `<TypeDefinitions>` of either version, by the names of their types.
fn enumerations<'a>(node: Node<'a, '_>) -> HashMap<&'a str, Items> {
    let types = node.children().filter_map(|one| {
        let inner = match one.tag_name().name() {
            "SimpleType" => child(one, "Enumeration")?,
            "EnumerationType" => one,
            _ => return None,
        };
        let items = inner.children().filter(|item| item.has_tag_name("Item"));
        let items = items.filter_map(|item| {
            let value = item.attribute("value")?.parse().ok()?;
            Some((item.attribute("name")?.to_owned(), value))
        });
        Some((one.attribute("name")?, items.collect()))
    });
    types.collect()
}

/// The parts that both versions write in the same way.
fn common(
    node: Node<'_, '_>,
    collector: &Collector<'_>,
    (value_type, type_name): (Option<ValueType>, &str),
    unit: Option<&str>,
) -> Option<ForeignVariable> {
    let name = required(collector, node, "name");
    let reference = required(collector, node, "valueReference").and_then(|text| {
        let number = text.parse();
        if number.is_err() {
            wrong(
                collector,
                node,
                format!("the valueReference is \"{}\"", shown(text)),
                "expected a number of 32 bits",
            );
        }
        number.ok()
    });
    Some(ForeignVariable {
        name: name?.to_owned(),
        reference: reference?,
        value_type,
        type_name: type_name.to_owned(),
        causality: match node.attribute("causality") {
            Some("input") => Causality::Input,
            Some("output") => Causality::Output,
            Some("parameter" | "structuralParameter") => Causality::Parameter,
            _ => Causality::Local,
        },
        is_changeable: match node.attribute("causality") {
            Some("input") => true,
            Some("parameter") => node.attribute("variability") == Some("tunable"),
            _ => false,
        },
        is_structural: node.attribute("causality") == Some("structuralParameter"),
        items: Vec::new(),
        clocks: (node
            .attribute("clocks")
            .unwrap_or_default()
            .split_whitespace())
        .filter_map(|clock| clock.parse().ok())
        .collect(),
        element: None,
        unit: unit.map(str::to_owned),
        aliases: node
            .children()
            .filter(|child| child.has_tag_name("Alias"))
            .filter_map(|alias| alias.attribute("name").map(str::to_owned))
            .collect(),
    })
}

fn unknown_type(collector: &Collector<'_>, node: Node<'_, '_>, name: &str) {
    wrong(
        collector,
        node,
        format!(
            "there is no type \"{}\" in this version of FMI",
            shown(name)
        ),
        "export the FMU again, or tell the maker of the tool that has made it",
    );
}

fn variable_of_two(
    node: Node<'_, '_>,
    enumerations: &HashMap<&str, Items>,
    collector: &Collector<'_>,
) -> Option<Declared> {
    if !node.has_tag_name("ScalarVariable") {
        let name = node.tag_name().name();
        wrong(
            collector,
            node,
            format!("<{}> among the variables", shown(name)),
            "expected <ScalarVariable>",
        );
        return None;
    }
    let types = ["Real", "Integer", "Enumeration", "Boolean", "String"];
    let inner = node.children().find(Node::is_element);
    let Some(inner) = inner else {
        wrong(
            collector,
            node,
            "a variable without a type",
            "expected <Real>, <Integer>, <Boolean>, <Enumeration> or <String> inside",
        );
        return None;
    };
    let name = inner.tag_name().name();
    let value_type = match name {
        "Real" => Some(ValueType::Float64),
        "Integer" | "Enumeration" => Some(ValueType::Int32),
        "Boolean" => Some(ValueType::Boolean),
        "String" => None,
        other => {
            debug_assert!(!types.contains(&other), "{other} is a type");
            unknown_type(collector, inner, other);
            return None;
        }
    };
    let mut variable = common(node, collector, (value_type, name), inner.attribute("unit"))?;
    variable.items = items(inner, enumerations);
    Some(Declared {
        variable,
        dimensions: Vec::new(),
        size: None,
    })
}

/// The items of the type that an enumeration has declared.
fn items(node: Node<'_, '_>, types: &HashMap<&str, Items>) -> Items {
    let declared = node.attribute("declaredType");
    let found = declared.filter(|_| node.has_tag_name("Enumeration"));
    let found = found.and_then(|name| types.get(name));
    found.cloned().unwrap_or_default()
}

/// One `<Dimension>`.
fn dimension(node: Node<'_, '_>, collector: &Collector<'_>) -> Option<Dimension> {
    let number = |name| node.attribute(name)?.parse::<u64>().ok();
    let found = match (number("start"), number("valueReference")) {
        (Some(size), None) => Some(Dimension::Fixed(size)),
        (None, Some(reference)) => u32::try_from(reference).ok().map(Dimension::Structural),
        _ => None,
    };
    if found.is_none() {
        wrong(
            collector,
            node,
            "a <Dimension> without a size",
            "expected one of start and valueReference, a whole number",
        );
    }
    found
}

fn variable_of_three(
    node: Node<'_, '_>,
    enumerations: &HashMap<&str, Items>,
    collector: &Collector<'_>,
) -> Option<Declared> {
    use ValueType as T;

    let name = node.tag_name().name();
    let value_type = match name {
        "Float32" => Some(T::Float32),
        "Float64" => Some(T::Float64),
        "Int8" => Some(T::Int8),
        "UInt8" => Some(T::UInt8),
        "Int16" => Some(T::Int16),
        "UInt16" => Some(T::UInt16),
        "Int32" => Some(T::Int32),
        "UInt32" => Some(T::UInt32),
        "Int64" | "Enumeration" => Some(T::Int64),
        "UInt64" => Some(T::UInt64),
        "Boolean" => Some(T::Boolean),
        "String" | "Binary" | "Clock" => None,
        other => {
            unknown_type(collector, node, other);
            return None;
        }
    };
    let mut variable = common(node, collector, (value_type, name), node.attribute("unit"))?;
    variable.items = items(node, enumerations);
    let dimensions = node.children().filter(|one| one.has_tag_name("Dimension"));
    let dimensions: Option<_> = dimensions.map(|one| dimension(one, collector)).collect();
    Some(Declared {
        variable,
        dimensions: dimensions?,
        size: node.attribute("start").and_then(|text| text.parse().ok()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> String {
        Model::parse("m.xml", text).expect_err("wrong").to_string()
    }

    #[test]
    fn every_mistake_has_its_place() {
        let text = "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"x\" instantiationToken=\"1\">\n\
                    <CoSimulation/>\n<ModelVariables>\n  <Float128 name=\"a\" valueReference=\"1\"/>\n\
                    <Float64 name=\"b\" valueReference=\"-1\"/>\n <Boolean valueReference=\"2\"/>\n\
                    </ModelVariables></fmiModelDescription>";
        let told = told(text);
        let lines: Vec<&str> = told.lines().collect();
        assert_eq!(lines.len(), 4, "{told}");
        assert!(
            lines[0].starts_with("m.xml:2:1: <CoSimulation> has no \"modelIdentifier\""),
            "{told}"
        );
        assert!(
            lines[1].starts_with("m.xml:4:3: there is no type \"Float128\""),
            "{told}"
        );
        assert!(
            lines[2].starts_with("m.xml:5:1: the valueReference is \"-1\""),
            "{told}"
        );
        assert!(
            lines[3].starts_with("m.xml:6:2: <Boolean> has no \"name\""),
            "{told}"
        );
    }

    #[test]
    fn what_needs_a_solver_or_another_version_says_so() {
        let head = |version: &str, inside: &str| {
            format!(
                "<fmiModelDescription fmiVersion=\"{version}\" modelName=\"x\" guid=\"1\">{inside}</fmiModelDescription>"
            )
        };
        let exchange = told(&head("2.0", "<ModelExchange modelIdentifier=\"x\"/>"));
        assert!(
            exchange
                .contains("needs a solver for its states and events; export it for co-simulation"),
            "{exchange}"
        );
        assert!(
            told(&head("1.0", "")).contains("this is FMI 1.0; export the FMU for FMI 2.0 or 3.0")
        );
        assert!(told("<a/>").contains("the root is <a>; expected <fmiModelDescription>"));
        assert!(
            told(&head("2.0", "<CoSimulation modelIdentifier=\"../x\"/>")).contains("is a path")
        );
        assert!(told("<fmiModelDescription").contains("m.xml:1:"));
    }

    #[test]
    fn variables_of_both_versions_are_read() {
        let two = "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"x\" guid=\"g\">\
                   <CoSimulation modelIdentifier=\"x\"/><DefaultExperiment stepSize=\"0.5\"/><ModelVariables>\
                   <ScalarVariable name=\"a\" valueReference=\"7\" causality=\"input\"><Real unit=\"m\"/></ScalarVariable>\
                   <ScalarVariable name=\"s\" valueReference=\"7\"><String/></ScalarVariable>\
                   </ModelVariables></fmiModelDescription>";
        let model = Model::parse("m.xml", two).expect("right");
        assert_eq!((model.step, model.variables.len()), (Some(0.5), 2));
        let first = &model.variables[0];
        assert_eq!(
            (first.value_type, first.unit.as_deref()),
            (Some(ValueType::Float64), Some("m"))
        );
        assert_eq!(model.variables[1].value_type, None);
        let three = "<fmiModelDescription fmiVersion=\"3.0.1\" modelName=\"x\" instantiationToken=\"g\">\
                     <CoSimulation modelIdentifier=\"x\"/><ModelVariables>\
                     <Float64 name=\"v\" valueReference=\"1\" causality=\"output\"><Dimension start=\"3\"/></Float64>\
                     <Enumeration name=\"e\" valueReference=\"2\" causality=\"output\"><Alias name=\"f\"/></Enumeration></ModelVariables></fmiModelDescription>";
        let model = Model::parse("m.xml", three).expect("right");
        assert_eq!(model.variables[2].name, "v[3]");
        assert_eq!(model.variables[2].value_type, Some(ValueType::Float64));
        assert_eq!(model.position("f"), Some(3));
        assert_eq!(model.variables[3].value_type, Some(ValueType::Int64));
    }
}
