//! Prepares projects as `PLCopen` XML whose statements are in Structured Text.

mod cycle;
mod declared;
mod drawn;
mod mask;
mod nodes;
#[cfg(test)]
mod tests;
mod text;

use std::collections::{BTreeSet, HashSet};
use std::ops::Range;

use drawn::drawn;
use mask::mask;
use nodes::{child, first_tag, inner, named, named_attribute, program, signal, variable_names};
use roxmltree::{Document, Node, ParsingOptions};

use super::addresses;
use super::check::{
    World, check_addresses, check_callers, check_name, check_pragma, check_statements, check_type,
    check_words,
};
use super::code::{Code, line_end};
use super::diagram::{Library, Written};
use super::edit::{Edits, Marks};
use super::lexer::{Comments, Kind};
use super::library::{self, SCHEDULE, TASK};
use super::outline;
use super::plan::{self, Named, Plan};
use super::pragma;
use super::structured_text::header_and_footer;
use super::words;
use super::{Settings, plcopen};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, shown};

/// Files with more nodes than this are refused: no project is this large.
const NODES: u32 = 10_000_000;

/// True if a source is XML.
pub(crate) fn is_xml(text: &str) -> bool {
    text.trim_start_matches('\u{FEFF}')
        .trim_start()
        .starts_with('<')
}

/// The prepared project and remarks; `None` if mistakes were reported.
pub(crate) fn prepare(
    text: &str,
    settings: &Settings,
    wrong: &Collector<'_>,
) -> Option<(String, Vec<String>)> {
    with_project(text, wrong, |project| {
        let mut world = project.world();
        world.vouch(&settings.no_clock);
        project.check_types(&world);
        let mut shared = project.check_addresses(settings);
        let bodies = project.bodies(&world, settings, &mut shared);
        let (plan, note) = project.plan(&world)?;
        if !wrong.is_empty() {
            return None;
        }
        shared.extend(project.cycles(&plan, &bodies));
        let made = project.edited(&world, &plan, settings, &bodies)?;
        Some((made, note.into_iter().chain(shared).collect()))
    })
}

/// A project as one file of Structured Text; `None` if mistakes were reported.
pub(crate) fn structured_text(text: &str, wrong: &Collector<'_>) -> Option<String> {
    let made = with_project(text, wrong, |project| Some(project.structured_text()))?;
    wrong.is_empty().then_some(made)
}

fn with_project<T>(
    text: &str,
    wrong: &Collector<'_>,
    then: impl FnOnce(&Project<'_, '_>) -> Option<T>,
) -> Option<T> {
    let options = ParsingOptions {
        nodes_limit: NODES,
        ..ParsingOptions::default()
    };
    let document = match Document::parse_with_options(text, options) {
        Ok(document) => document,
        Err(error) => {
            let what = format!("this XML cannot be read: {error}");
            wrong.report(0, what, "export it again from the PLC's editor");
            return None;
        }
    };
    let root = document.root_element();
    if !text[root.range()].starts_with("<project") {
        let what = "this is not a PLCopen project";
        wrong.report(
            root.range().start,
            what,
            "export the project as PLCopen XML",
        );
        return None;
    }
    let library = declared::library(root);
    then(&Project {
        text,
        root,
        wrong,
        library,
    })
}

struct Project<'a, 'i> {
    text: &'i str,
    root: Node<'a, 'i>,
    wrong: &'a Collector<'i>,
    library: Library,
}

/// The statements of a program.
struct Body<'a, 'i> {
    unit: Node<'a, 'i>,
    form: Form<'a, 'i>,
}

/// The form in which statements are kept.
enum Form<'a, 'i> {
    /// Text at these bytes of the file.
    Text(Range<usize>),
    /// A diagram, and its statements as text.
    Drawn(Node<'a, 'i>, Written),
    /// The pragma at these bytes of the file reads a clock; its replacement.
    Clock(Range<usize>, String),
}

impl<'a, 'i> Project<'a, 'i> {
    fn named(&self, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> + use<'a, 'i> {
        named(self.root, name)
    }

    fn world(&self) -> World {
        let mut world = World::default();
        for element in ["pou", "dataType"] {
            let names = self
                .named(element)
                .filter_map(|node| node.attribute("name"));
            world.types.extend(names.map(str::to_uppercase));
        }
        for list in self.named("globalVars") {
            world.globals.extend(variable_names(list));
            // CODESYS refers to its lists by their names.
            world
                .globals
                .extend(list.attribute("name").map(str::to_uppercase));
        }
        world
    }

    fn check_types(&self, world: &World) {
        for node in self.named("derived") {
            let name = node.attribute("name").unwrap_or_default();
            if self.is_cycled(node) && !world.types.contains(&name.to_uppercase()) {
                continue;
            }
            check_type(name, node.range().start, world, self.wrong);
        }
        for element in ["pou", "dataType"] {
            for node in self.named(element) {
                let name = node.attribute("name").unwrap_or_default();
                check_name(name, node.range().start, self.wrong);
            }
        }
        for node in self.named("variable") {
            let name = node.attribute("name").unwrap_or_default();
            if words::is_put_in(name) {
                let what = format!("the name {} is reserved by tickbus", shown(name));
                let right = "a program that was synchronised by hand needs no preparing; otherwise choose another name";
                self.wrong.report(node.range().start, what, right);
            }
        }
        for (element, what, right) in [
            (
                "InterfaceAsPlainText",
                "this declaration is kept as plain text, too",
                "export without the option for declarations as plain text: else the editor takes these",
            ),
            (
                "Method",
                "this is a method",
                "methods are not prepared: make it a function block",
            ),
            (
                "Extends",
                "this block extends another one",
                "inheritance is not prepared: write a plain function block",
            ),
            (
                "Implements",
                "this block implements an interface",
                "inheritance is not prepared: write a plain function block",
            ),
        ] {
            for node in self.named(element) {
                self.wrong.report(node.range().start, what, right);
            }
        }
    }

    /// The bodies of programs, checked like all others.
    fn bodies(
        &self,
        world: &World,
        settings: &Settings,
        shared: &mut BTreeSet<String>,
    ) -> Vec<Body<'a, 'i>> {
        let mut found = Vec::new();
        let run: HashSet<String> = (self.named("pouInstance"))
            .map(|node| program(node).text.to_uppercase())
            .collect();
        for unit in self.named("pou") {
            let mut known: HashSet<String> = HashSet::new();
            known.extend(
                child(unit, "interface")
                    .into_iter()
                    .flat_map(variable_names),
            );
            let actions = named(unit, "action").filter_map(|node| node.attribute("name"));
            known.extend(actions.map(str::to_uppercase));
            for body in named(unit, "body") {
                for language in ["IL", "SFC"] {
                    if let Some(node) = child(body, language) {
                        let what = format!("these statements are in {language}");
                        let right = "write them in Structured Text, LD or FBD, or export the project as text";
                        self.wrong.report(node.range().start, what, right);
                    }
                }
                if let Some(diagram) = drawn(body) {
                    self.check_drawn(diagram, &known, world, &|name| run.contains(name));
                    let is_program = body.parent() == Some(unit) && is_run(unit, &run);
                    if is_program && let Some(written) = self.written(unit, diagram) {
                        let form = Form::Drawn(diagram, written);
                        found.push(Body { unit, form });
                    }
                    continue;
                }
                let Some(statements) = child(body, "ST") else {
                    continue;
                };
                let Some((masked, start)) = self.masked(statements) else {
                    continue;
                };
                let code = Code::with(&masked, start, settings.comments);
                if let Some(token) = outline::endless(&code) {
                    let what = "the comment or text that begins here has no end";
                    self.wrong.report(start + token.start, what, "end it");
                    continue;
                }
                check_words(&code, self.wrong);
                let name = unit.attribute("name").unwrap_or_default();
                if code.comments == Comments::Nested && settings.comments.is_none() {
                    let remark = format!(
                        "{name} has a comment within a comment: compile with the option for that (-n of iec2c)"
                    );
                    shared.insert(super::placed_remark(self.wrong, start, &remark));
                }
                for pragma in code.all.iter().filter(|token| token.kind == Kind::Pragma) {
                    let text = &masked[pragma.range()];
                    let at = start + pragma.start;
                    if let Some(ours) = pragma::on_virtual_time(name, text) {
                        let form = Form::Clock(at..at + text.len(), ours);
                        found.push(Body { unit, form });
                    } else {
                        check_pragma(text, at, Some(name), world, self.wrong);
                    }
                }
                shared.extend(check_addresses(&code, &settings.addresses, self.wrong));
                let all = 0..code.tokens.len();
                check_statements(&code, &all, &known, world, self.wrong);
                check_callers(&code, &all, &known, |name| run.contains(name), self.wrong);
                if let (true, Some(bytes)) = (body.parent() == Some(unit), code.bytes(&all)) {
                    let form = Form::Text(bytes);
                    found.push(Body { unit, form });
                }
            }
        }
        found
    }

    /// The text of statements with blanks in place of markup, so that each byte keeps its position; and the start of
    /// that text.
    fn masked(&self, statements: Node<'_, '_>) -> Option<(String, usize)> {
        let texts = || statements.descendants().filter(Node::is_text);
        let holders: BTreeSet<_> = texts()
            .filter(|node| !node.text().unwrap_or_default().trim().is_empty())
            .filter_map(|node| node.parent())
            .map(|node| node.range().start)
            .collect();
        let start = holders.first()?;
        let mut all = statements.descendants();
        let holder = all.find(|node| node.is_element() && node.range().start == *start)?;
        if holders.len() > 1 || !holder.children().all(|node| node.is_text()) {
            let what = "these statements hold other elements";
            self.wrong
                .report(*start, what, "export them as plain Structured Text");
            return None;
        }
        let inner = inner(self.text, holder)?;
        match mask(&self.text[inner.clone()]) {
            Ok(masked) => Some((masked, inner.start)),
            Err(at) => {
                let right = "write the character itself: in these statements, references are read for quotes, &, < and > only";
                let what = "this is a reference to an ordinary character";
                self.wrong.report(inner.start + at, what, right);
                None
            }
        }
    }

    fn check_addresses(&self, settings: &Settings) -> BTreeSet<String> {
        let located = self.named("variable").filter_map(|node| {
            let own = node.attribute("address")?;
            addresses::check(own, node.range().start, &settings.addresses, self.wrong)
        });
        located.collect()
    }

    fn plan(&self, world: &World) -> Option<(Plan, Option<String>)> {
        let mut resources = self.named("resource");
        let Some(resource) = resources.next() else {
            let right =
                "add it in the editor and export the project again: intervals are taken from there";
            let at = self.root.range().start;
            self.wrong
                .report(at, "there is no resource with tasks", right);
            return None;
        };
        if let Some(second) = resources.next() {
            (self.wrong).collect(second.range().start, plan::second_resource());
        }
        let mut tasks = Vec::new();
        let mut instances = Vec::new();
        for node in resource.children().filter(Node::is_element) {
            match node.tag_name().name() {
                "task" => {
                    let name = named_attribute(node, "name");
                    instances.extend(named(node, "pouInstance").map(|node| plan::Instance {
                        task: name.clone(),
                        program: program(node),
                    }));
                    tasks.push(plan::Task {
                        name: name.unwrap_or_else(|| Named {
                            text: String::new(),
                            at: node.range().start,
                        }),
                        interval: named_attribute(node, "interval"),
                        single: named_attribute(node, "single").map(|single| single.at),
                        priority: node
                            .attribute("priority")
                            .and_then(|text| text.parse().ok()),
                    });
                }
                "pouInstance" => instances.push(plan::Instance {
                    task: None,
                    program: program(node),
                }),
                _ => {}
            }
        }
        for instance in &instances {
            let program = &instance.program;
            if !world.types.contains(&program.text.to_uppercase()) {
                let what = format!(
                    "the program {} is not in this project",
                    shown(&program.text)
                );
                self.wrong
                    .report(program.at, what, "export the whole project");
            }
        }
        Some(plan::plan(
            resource.range().start,
            &tasks,
            &instances,
            self.wrong,
        ))
    }

    fn edited(
        &self,
        world: &World,
        plan: &Plan,
        settings: &Settings,
        bodies: &[Body<'a, 'i>],
    ) -> Option<String> {
        let mut edits = Edits::default();
        let mut timers = BTreeSet::new();
        for node in self.named("derived") {
            let name = node.attribute("name").unwrap_or_default();
            if world.is_timer(name) {
                timers.insert(name.to_uppercase());
                let tag = first_tag(self.text, node);
                let rest = &self.text[tag.end..node.range().end];
                let new = self.timer(node, "name")? + rest;
                edits.replace(node.range(), new, Marks::Xml);
            }
        }
        for body in bodies {
            if let Form::Clock(bytes, ours) = &body.form {
                edits.replace(bytes.clone(), ours, Marks::StructuredText);
            } else {
                self.control(body, plan, &mut edits)?;
            }
        }
        for block in self.named("block") {
            let name = block.attribute("typeName").unwrap_or_default();
            let is_replaced = bodies.iter().any(|body| match &body.form {
                Form::Drawn(diagram, _) => diagram.range().contains(&block.range().start),
                Form::Text(_) | Form::Clock(..) => false,
            });
            if world.is_timer(name) && !is_replaced {
                edits.replace(
                    first_tag(self.text, block),
                    self.timer(block, "typeName")?,
                    Marks::Xml,
                );
            }
        }
        let timers: Vec<&str> = timers.iter().map(String::as_str).collect();
        let blocks = library::text(&timers, &plan.signals, &settings.addresses);
        let blocks = plcopen::pous(&blocks);
        let unit = bodies.iter().find(|body| signal(body.unit, plan).is_some());
        let holder = unit.and_then(|body| body.unit.parent());
        if let Some(data) = holder.filter(|holder| holder.tag_name().name() == "data") {
            // CODESYS keeps each unit in a separate extension, among those of an application.
            let start = &self.text[data.range().start..];
            let tag = &start[..start.find("<pou")?];
            let blocks = blocks
                .replace("<pou ", &format!("{tag}<pou "))
                .replace("</pou>", "</pou></data>");
            edits.insert(data.range().end, self.lines(&blocks), Marks::Xml);
        } else {
            self.insert_first(self.named("pous").next()?, &blocks, &mut edits)?;
        }
        self.configure(plan, &mut edits)?;
        Some(edits.apply(self.text))
    }

    /// Wraps the statements of a program that a task runs in an execution controller.
    fn control(&self, body: &Body<'a, 'i>, plan: &Plan, edits: &mut Edits) -> Option<()> {
        let unit = body.unit;
        let Some(signal) = signal(unit, plan) else {
            return Some(());
        };
        let external = [
            ("tickbus_simulated", None, "BOOL", None),
            (signal.as_str(), None, "BOOL", None),
        ];
        let mut external = plcopen::variables("externalVars", &external);
        match &body.form {
            Form::Text(bytes) => {
                let (header, footer) = header_and_footer(self.text, bytes, signal);
                edits.insert(bytes.start, header, Marks::StructuredText);
                edits.insert(bytes.end, footer, Marks::StructuredText);
            }
            Form::Clock(..) => return Some(()),
            Form::Drawn(_, written) if written.statements.is_empty() => return Some(()),
            Form::Drawn(diagram, written) => {
                let statements = format!(
                    "IF {} THEN\n{}END_IF;",
                    library::condition(signal),
                    written.statements
                );
                let statements = self.lines(&plcopen::statements(&statements));
                edits.replace(diagram.range(), statements, Marks::Xml);
                let own: Vec<plcopen::Variable<'_>> = (written.variables.iter())
                    .map(|(name, kind)| (name.as_str(), None, kind.as_str(), None))
                    .collect();
                if !own.is_empty() {
                    external.extend(["\n", &plcopen::variables("localVars", &own)]);
                }
            }
        }
        if let Some(interface) = child(unit, "interface") {
            return self.insert_first(interface, &external, edits);
        }
        let interface = format!("<interface>\n{external}\n</interface>");
        self.insert_first(unit, &interface, edits)
    }

    fn configure(&self, plan: &Plan, edits: &mut Edits) -> Option<()> {
        let resource = self.named("resource").next()?;
        let is = |name: &'static str| {
            let children = resource.children().filter(Node::is_element);
            children.filter(move |node| node.tag_name().name() == name)
        };
        let (tasks, alone): (Vec<_>, Vec<_>) = (is("task").collect(), is("pouInstance").collect());
        // Durations are written in the project's notation.
        let first = tasks.first().and_then(|task| task.attribute("interval"));
        let interval = if first.is_some_and(|interval| interval.starts_with('P')) {
            format!("PT{}.{:03}S", plan.cycle / 1000, plan.cycle % 1000)
        } else {
            format!("T#{}ms", plan.cycle)
        };
        let mut instances = named(resource, "pouInstance");
        let is_typed = |node: Node<'_, '_>| {
            node.attribute("typeName")
                .is_some_and(|name| !name.is_empty())
        };
        let (name, kind) = if instances.any(is_typed) {
            ("tickbus_first", SCHEDULE)
        } else {
            (SCHEDULE, "")
        };
        let mut task = format!(
            "<task name=\"{TASK}\" interval=\"{interval}\" priority=\"1\">\n  <pouInstance name=\"{name}\" typeName=\"{kind}\"/>\n"
        );
        let inner = tasks.iter().flat_map(|task| named(*task, "pouInstance"));
        for instance in inner.chain(alone.iter().copied()) {
            task.extend(["  ", &self.text[instance.range()], "\n"]);
        }
        task += "</task>";
        let globals = library::globals(&plan.signals);
        let globals: Vec<plcopen::Variable<'_>> = (globals.iter())
            .map(|(name, kind, value)| {
                let value = (!value.is_empty()).then_some(*value);
                (name.as_str(), None, *kind, value)
            })
            .collect();
        let globals = plcopen::variables("globalVars", &globals);
        let task = self.lines(&task);
        let globals = self.lines(&globals);
        if let (Some(first), Some(last)) = (tasks.first(), tasks.last()) {
            edits.replace(first.range(), task, Marks::Xml);
            for other in &tasks[1..] {
                edits.replace(other.range(), "", Marks::Xml);
            }
            edits.insert(last.range().end, globals, Marks::Xml);
        } else {
            self.insert_first(resource, &(task + &globals), edits)?;
        }
        for instance in alone {
            edits.replace(instance.range(), "", Marks::Xml);
        }
        Some(())
    }

    /// The first tag of an element, with the replacement of the timer in its attribute `name`.
    fn timer(&self, node: Node<'a, 'i>, name: &str) -> Option<String> {
        let value = node.attribute_node(name)?;
        let tag = first_tag(self.text, node);
        let place = value.range_value();
        Some(format!(
            "{}{}{}{}",
            &self.text[tag.start..place.start],
            words::PREFIX,
            value.value().to_uppercase(),
            &self.text[place.end..tag.end]
        ))
    }

    fn lines(&self, text: &str) -> String {
        text.replace('\n', line_end(self.text))
    }

    /// Inserts XML as the first content of an element.
    fn insert_first(&self, node: Node<'a, 'i>, new: &str, edits: &mut Edits) -> Option<()> {
        let end = line_end(self.text);
        let new = format!("{end}{}{end}", self.lines(new));
        if let Some(inner) = inner(self.text, node) {
            edits.insert(inner.start, new, Marks::Xml);
        } else {
            let whole = node.range();
            let start = self.text[whole.clone()].trim_end_matches("/>").to_owned();
            let name = start[1..].split_whitespace().next()?;
            edits.replace(whole, format!("{start}>{new}</{name}>"), Marks::Xml);
        }
        Some(())
    }
}

/// True if a task runs a unit.
fn is_run(unit: Node<'_, '_>, run: &HashSet<String>) -> bool {
    let name = unit.attribute("name").unwrap_or_default();
    unit.attribute("pouType") == Some("program") && run.contains(&name.to_uppercase())
}

/// A file in XML together with other files.
pub(crate) fn not_alone() -> Mistake {
    let right = "prepare a project in XML by itself";
    Mistake::new("this is XML beside other sources", right)
}
