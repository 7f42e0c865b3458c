//! Projects in `PLCopen` XML as Structured Text, in the form that an editor passes to its compiler.

use std::fmt::Write as _;

use crate::plcopen::Element;

/// The whole project: blocks, programs and the configuration.
pub fn structured_text(xml: &str) -> String {
    let project = Element::of_document(xml);
    let mut text = String::new();
    for unit in project.all("pou") {
        let kind = match unit.attribute("pouType") {
            "functionBlock" => "FUNCTION_BLOCK",
            _ => "PROGRAM",
        };
        let name = unit.attribute("name");
        let sections: String = unit
            .child("interface")
            .children
            .iter()
            .map(section)
            .collect();
        let body = &unit.child("body").child("ST").child("xhtml").text;
        write!(text, "{kind} {name}\n{sections}{body}\nEND_{kind}\n\n")
            .expect("a String takes all");
    }
    let configuration = project.all("configuration")[0];
    let resource = configuration.child("resource");
    writeln!(text, "CONFIGURATION {}", configuration.attribute("name"))
        .expect("a String takes all");
    writeln!(text, "RESOURCE {} ON PLC", resource.attribute("name")).expect("a String takes all");
    text.extend(
        resource
            .children
            .iter()
            .filter(|child| child.name == "globalVars")
            .map(section),
    );
    let tasks = resource.all("task");
    for task in &tasks {
        let [name, interval, priority] =
            ["name", "interval", "priority"].map(|key| task.attribute(key));
        writeln!(
            text,
            "TASK {name}(INTERVAL := {interval}, PRIORITY := {priority});"
        )
        .expect("a String takes all");
    }
    for task in &tasks {
        for program in task.all("pouInstance") {
            let [name, kind] = ["name", "typeName"].map(|key| program.attribute(key));
            writeln!(
                text,
                "PROGRAM {name} WITH {} : {kind};",
                task.attribute("name")
            )
            .expect("a String takes all");
        }
    }
    text + "END_RESOURCE\nEND_CONFIGURATION\n"
}

fn section(section: &Element) -> String {
    let keyword = match section.name.as_str() {
        "inputVars" => "VAR_INPUT",
        "outputVars" => "VAR_OUTPUT",
        "externalVars" => "VAR_EXTERNAL",
        "globalVars" => "VAR_GLOBAL",
        _ => "VAR",
    };
    let mut text = format!("{keyword}\n");
    for variable in &section.children {
        let kind = &variable.child("type").children[0];
        let kind = match kind.name.as_str() {
            "derived" => kind.attribute("name"),
            basic => basic,
        };
        let address = variable.attributes.iter().find(|(key, _)| key == "address");
        let address = address.map_or(String::new(), |(_, address)| format!(" AT {address}"));
        let value = variable.all("simpleValue");
        let value = value.first().map_or(String::new(), |value| {
            format!(" := {}", value.attribute("value"))
        });
        writeln!(
            text,
            "{}{address} : {kind}{value};",
            variable.attribute("name")
        )
        .expect("a String takes all");
    }
    text + "END_VAR\n"
}
