//! A project in XML as one file of Structured Text, as its editor passes it to `iec2c`.

use std::fmt::Write as _;

use roxmltree::Node;
use tickbus_base::toml_text::shown;

use super::Project;
use super::drawn::drawn;
use super::nodes::{child, named};
use crate::duration;

/// The lists of variables, and their keywords.
const SECTIONS: [(&str, &str); 8] = [
    ("inputVars", "VAR_INPUT"),
    ("outputVars", "VAR_OUTPUT"),
    ("inOutVars", "VAR_IN_OUT"),
    ("localVars", "VAR"),
    ("externalVars", "VAR_EXTERNAL"),
    ("globalVars", "VAR_GLOBAL"),
    ("tempVars", "VAR_TEMP"),
    ("accessVars", "VAR_ACCESS"),
];

/// Types within types, deeper than this: no project has them.
const DEPTH: usize = 50;

impl Project<'_, '_> {
    /// The whole project: types, units and the configuration; incomplete if mistakes were reported.
    pub(super) fn structured_text(&self) -> String {
        let mut text = String::new();
        let types: Vec<Node<'_, '_>> = self.named("dataType").collect();
        if !types.is_empty() {
            text += "TYPE\n";
            for declared in types {
                let name = declared.attribute("name").unwrap_or_default();
                let base = child(declared, "baseType");
                let base = base.map_or_else(String::new, |base| self.kind(base, 0));
                let initial = self.initial(declared, &base);
                let _ = writeln!(text, "  {name} : {base}{initial};");
            }
            text += "END_TYPE\n\n";
        }
        // iec2c reads a function before its callers.
        for wanted in ["function", "functionBlock", "program"] {
            for unit in self.named("pou") {
                if unit.attribute("pouType") == Some(wanted) {
                    self.unit_text(unit, &mut text);
                }
            }
        }
        for configuration in self.named("configuration") {
            self.configuration_text(configuration, &mut text);
        }
        text
    }

    fn unit_text(&self, unit: Node<'_, '_>, text: &mut String) {
        let keyword = match unit.attribute("pouType") {
            Some("function") => "FUNCTION",
            Some("functionBlock") => "FUNCTION_BLOCK",
            _ => "PROGRAM",
        };
        let name = unit.attribute("name").unwrap_or_default();
        let interface = child(unit, "interface");
        let result = interface.and_then(|interface| child(interface, "returnType"));
        let result =
            result.map_or_else(String::new, |result| format!(" : {}", self.kind(result, 0)));
        let _ = writeln!(text, "{keyword} {name}{result}");
        for list in interface.iter().flat_map(Node::children) {
            self.section(list, text);
        }
        let Some(body) = child(unit, "body") else {
            let right = "export the project with the bodies of its units";
            let what = format!("{} has no body", shown(name));
            self.wrong.report(unit.range().start, what, right);
            return;
        };
        if let Some(diagram) = drawn(body) {
            if let Some(written) = self.written(unit, diagram) {
                if !written.variables.is_empty() {
                    *text += "  VAR\n";
                    for (name, kind) in &written.variables {
                        let _ = writeln!(text, "    {name} : {kind};");
                    }
                    *text += "  END_VAR\n";
                }
                *text += "\n";
                *text += &written.statements;
            }
        } else if let Some(statements) = child(body, "ST").or_else(|| child(body, "IL")) {
            let texts = statements.descendants().filter(Node::is_text);
            let statements: String = texts.filter_map(|node| node.text()).collect();
            let _ = writeln!(text, "\n{}", statements.trim_matches(['\n', '\r']));
        } else {
            let what = format!("{} is neither Structured Text nor a diagram", shown(name));
            let right = "write it in Structured Text, LD or FBD, or let its editor write the text";
            self.wrong.report(body.range().start, what, right);
        }
        let _ = writeln!(text, "END_{keyword}\n");
    }

    /// A list of variables; nothing for another element.
    fn section(&self, list: Node<'_, '_>, text: &mut String) {
        let name = list.tag_name().name();
        let Some((_, keyword)) = SECTIONS.iter().find(|(one, _)| *one == name) else {
            return;
        };
        let is = |key: &str| matches!(list.attribute(key), Some("true" | "1"));
        let option = [
            ("constant", " CONSTANT"),
            ("retain", " RETAIN"),
            ("nonretain", " NON_RETAIN"),
        ];
        let option = option.iter().find(|(key, _)| is(key));
        let option = option.map_or("", |(_, option)| option);
        // iec2c keeps variables with addresses in separate lists.
        let variables = || {
            let all = list.children().filter(Node::is_element);
            all.filter(|node| node.tag_name().name() == "variable")
        };
        for is_located in [false, true] {
            let is_located_so = |node: &Node<'_, '_>| {
                let address = node.attribute("address").unwrap_or_default();
                address.is_empty() != is_located
            };
            let mut variables = variables().filter(is_located_so).peekable();
            if variables.peek().is_none() {
                continue;
            }
            let _ = writeln!(text, "  {keyword}{option}");
            for variable in variables {
                let name = variable.attribute("name").unwrap_or_default();
                let address = variable.attribute("address").filter(|_| is_located);
                let address = address.map_or_else(String::new, |address| format!(" AT {address}"));
                let kind = child(variable, "type");
                let kind = kind.map_or_else(String::new, |kind| self.kind(kind, 0));
                let initial = self.initial(variable, &kind);
                let _ = writeln!(text, "    {name}{address} : {kind}{initial};");
            }
            text.push_str("  END_VAR\n");
        }
    }

    /// The type in an element such as `type` or `baseType`.
    fn kind(&self, holder: Node<'_, '_>, depth: usize) -> String {
        let refuse = |what: &str| {
            let right = "declare it in Structured Text";
            self.wrong.report(holder.range().start, what, right);
            String::new()
        };
        let Some(node) = holder.children().find(Node::is_element) else {
            return refuse("there is no type");
        };
        if depth > DEPTH {
            return refuse("this type is too deep");
        }
        let base = || {
            let base = child(node, "baseType");
            base.map_or_else(String::new, |base| self.kind(base, depth + 1))
        };
        let range = |node: Node<'_, '_>| {
            let [lower, upper] =
                ["lower", "upper"].map(|key| node.attribute(key).unwrap_or_default());
            format!("{lower}..{upper}")
        };
        match node.tag_name().name() {
            "derived" => node.attribute("name").unwrap_or_default().to_owned(),
            "string" | "wstring" => {
                let length = node.attribute("length").filter(|length| !length.is_empty());
                let length = length.map_or_else(String::new, |length| format!("[{length}]"));
                node.tag_name().name().to_uppercase() + &length
            }
            "array" => {
                let dimensions = node
                    .children()
                    .filter(|node| node.tag_name().name() == "dimension");
                let dimensions: Vec<String> = dimensions.map(range).collect();
                format!("ARRAY [{}] OF {}", dimensions.join(", "), base())
            }
            "subrangeSigned" | "subrangeUnsigned" => {
                let bounds = child(node, "range").map_or_else(String::new, range);
                format!("{} ({bounds})", base())
            }
            "enum" => {
                let values = named(node, "value").filter_map(|node| node.attribute("name"));
                format!("({})", values.collect::<Vec<&str>>().join(", "))
            }
            "struct" => {
                let mut text = "STRUCT\n".to_owned();
                for member in node
                    .children()
                    .filter(|node| node.tag_name().name() == "variable")
                {
                    let name = member.attribute("name").unwrap_or_default();
                    let kind = child(member, "type");
                    let kind = kind.map_or_else(String::new, |kind| self.kind(kind, depth + 1));
                    let initial = self.initial(member, &kind);
                    let _ = writeln!(text, "    {name} : {kind}{initial};");
                }
                text + "  END_STRUCT"
            }
            "pointer" => format!("REF_TO {}", base()),
            elementary => elementary.to_uppercase(),
        }
    }

    /// The initial value of a variable or type, with the `:=` before it.
    fn initial(&self, holder: Node<'_, '_>, kind: &str) -> String {
        let Some(initial) = child(holder, "initialValue") else {
            return String::new();
        };
        let value = self.value(initial, kind, 0);
        if value.is_empty() {
            value
        } else {
            format!(" := {value}")
        }
    }

    fn value(&self, holder: Node<'_, '_>, kind: &str, depth: usize) -> String {
        if depth > DEPTH {
            let what = "this value is too deep";
            self.wrong
                .report(holder.range().start, what, "assign it in the program");
            return String::new();
        }
        let Some(node) = holder.children().find(Node::is_element) else {
            return String::new();
        };
        let values = || {
            node.children()
                .filter(|node| node.tag_name().name() == "value")
        };
        match node.tag_name().name() {
            "arrayValue" => {
                let items = values().map(|item| {
                    let value = self.value(item, "", depth + 1);
                    match item.attribute("repetitionValue") {
                        None | Some("" | "1") => value,
                        Some(times) => format!("{times}({value})"),
                    }
                });
                format!("[{}]", items.collect::<Vec<String>>().join(", "))
            }
            "structValue" => {
                let items = values().map(|item| {
                    let member = item.attribute("member").unwrap_or_default();
                    format!("{member} := {}", self.value(item, "", depth + 1))
                });
                format!("({})", items.collect::<Vec<String>>().join(", "))
            }
            _ => {
                let value = node.attribute("value").unwrap_or_default();
                // Editors keep texts with and without quotes.
                let quote = if kind.starts_with("STRING") {
                    "'"
                } else if kind.starts_with("WSTRING") {
                    "\""
                } else {
                    ""
                };
                if quote.is_empty() || value.is_empty() || value.starts_with(quote) {
                    value.to_owned()
                } else {
                    format!("{quote}{value}{quote}")
                }
            }
        }
    }

    fn configuration_text(&self, configuration: Node<'_, '_>, text: &mut String) {
        let name = |node: Node<'_, '_>| node.attribute("name").unwrap_or_default().to_owned();
        let _ = writeln!(text, "CONFIGURATION {}", name(configuration));
        let lists = configuration.children().filter(Node::is_element);
        lists.for_each(|list| self.section(list, text));
        for resource in named(configuration, "resource") {
            let _ = writeln!(text, "  RESOURCE {} ON PLC", name(resource));
            resource
                .children()
                .for_each(|list| self.section(list, text));
            let children = |wanted: &'static str| {
                let all = resource.children().filter(Node::is_element);
                all.filter(move |node| node.tag_name().name() == wanted)
            };
            for task in children("task") {
                let single = task.attribute("single").filter(|single| !single.is_empty());
                let single =
                    single.map_or_else(String::new, |single| format!("SINGLE := {single}, "));
                let interval = task.attribute("interval").filter(|text| !text.is_empty());
                let interval = interval.map_or_else(String::new, |interval| {
                    format!("INTERVAL := {}, ", duration_text(interval))
                });
                let priority = task.attribute("priority").unwrap_or("0");
                let _ = writeln!(
                    text,
                    "    TASK {}({single}{interval}PRIORITY := {priority});",
                    name(task)
                );
            }
            let mut instance = |node: Node<'_, '_>, task: &str| {
                let program = super::program(node).text;
                let _ = writeln!(text, "    PROGRAM {}{task} : {program};", name(node));
            };
            for task in children("task") {
                let with = format!(" WITH {}", name(task));
                named(task, "pouInstance").for_each(|node| instance(node, &with));
            }
            children("pouInstance").for_each(|node| instance(node, ""));
            *text += "  END_RESOURCE\n";
        }
        *text += "END_CONFIGURATION\n";
    }
}

/// A duration as a literal: CODESYS writes those of XML.
fn duration_text(text: &str) -> String {
    if text.starts_with('P')
        && let Ok(milliseconds) = duration::milliseconds(text)
    {
        return format!("T#{milliseconds}ms");
    }
    text.to_owned()
}
