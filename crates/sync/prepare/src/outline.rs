//! The declarations of a source in Structured Text, with their positions: program organisation units, types, and the
//! configuration.

use std::ops::Range;

use super::code::Code;
use super::lexer::{Kind, Token};
use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;

/// The parts of one source. Numbers and ranges count the tokens of its [`Code`].
#[derive(Debug, Default)]
pub(crate) struct Outline {
    pub(crate) units: Vec<Unit>,
    pub(crate) types: Vec<Range<usize>>,
    /// Lists of global variables outside a configuration.
    pub(crate) globals: Vec<Section>,
    pub(crate) configurations: Vec<Configuration>,
}

impl Outline {
    /// The unit that holds a byte of its code's text.
    pub(crate) fn unit_at(&self, code: &Code<'_>, byte: usize) -> Option<&Unit> {
        let byte = code.base + byte;
        self.units
            .iter()
            .find(|unit| (code.start(unit.name)..code.start(unit.body.end)).contains(&byte))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnitKind {
    Program,
    Block,
    Function,
}

/// A program, function block or function.
#[derive(Debug)]
pub(crate) struct Unit {
    pub(crate) kind: UnitKind,
    pub(crate) name: usize,
    /// The words of a function's type.
    pub(crate) returns: Range<usize>,
    pub(crate) sections: Vec<Section>,
    pub(crate) body: Range<usize>,
}

/// Variables from `VAR` to `END_VAR`.
#[derive(Debug)]
pub(crate) struct Section {
    /// The tokens in between.
    pub(crate) inner: Range<usize>,
}

#[derive(Debug)]
pub(crate) struct Configuration {
    /// `CONFIGURATION`.
    pub(crate) start: usize,
    pub(crate) name: usize,
    pub(crate) globals: Vec<Section>,
    /// The keyword `RESOURCE` of each resource.
    pub(crate) resources: Vec<usize>,
    pub(crate) tasks: Vec<Task>,
    pub(crate) instances: Vec<Instance>,
}

/// `TASK name(INTERVAL := T#10ms, PRIORITY := 1);`
#[derive(Debug)]
pub(crate) struct Task {
    pub(crate) name: usize,
    /// The whole statement.
    pub(crate) whole: Range<usize>,
    pub(crate) interval: Option<usize>,
    pub(crate) single: Option<usize>,
    pub(crate) priority: Option<usize>,
}

/// `PROGRAM name WITH task : program;`
#[derive(Debug)]
pub(crate) struct Instance {
    /// `PROGRAM`.
    pub(crate) start: usize,
    pub(crate) name: usize,
    pub(crate) task: Option<usize>,
    pub(crate) program: usize,
}

/// The declarations of a section or a `TYPE`.
#[derive(Debug, Default)]
pub(crate) struct Declared {
    pub(crate) names: Vec<usize>,
    /// The names of types.
    pub(crate) types: Vec<usize>,
}

/// Reads the outline.
///
/// # Errors
///
/// The byte offset of the first unreadable place, and the mistake.
pub(crate) fn outline(code: &Code<'_>) -> Result<Outline, (usize, Mistake)> {
    let mut reader = Reader { code, at: 0 };
    if let Some(token) = endless(code) {
        let right = "end it; a text in quotes ends in its line";
        return Err((
            token.start,
            Mistake::new("what begins here has no end", right),
        ));
    }
    let mut found = Outline::default();
    while reader.at < code.tokens.len() {
        match reader.code.capitals(reader.at).as_str() {
            "PROGRAM" => found
                .units
                .push(reader.unit(UnitKind::Program, "END_PROGRAM")?),
            "FUNCTION_BLOCK" => found
                .units
                .push(reader.unit(UnitKind::Block, "END_FUNCTION_BLOCK")?),
            "FUNCTION" => found
                .units
                .push(reader.unit(UnitKind::Function, "END_FUNCTION")?),
            "TYPE" => {
                let inner = reader.until("END_TYPE")?;
                found.types.push(inner);
            }
            "VAR_GLOBAL" => found.globals.push(reader.section()?),
            "CONFIGURATION" => found.configurations.push(reader.configuration()?),
            _ => return Err(reader.unknown()),
        }
    }
    Ok(found)
}

/// The comment, pragma or text that has no end.
pub(crate) fn endless<'c>(code: &'c Code<'_>) -> Option<&'c Token> {
    code.all.iter().find(|token| token.kind == Kind::Endless)
}

struct Reader<'c, 't> {
    code: &'c Code<'t>,
    at: usize,
}

impl Reader<'_, '_> {
    fn wrong<T>(&self, at: usize, what: String, right: &str) -> Result<T, (usize, Mistake)> {
        Err((self.code.start(at), Mistake::new(what, right)))
    }

    fn unknown(&self) -> (usize, Mistake) {
        let what = format!("unexpected \"{}\"", shown(self.code.word(self.at)));
        let right = "PROGRAM, FUNCTION_BLOCK, FUNCTION, TYPE, VAR_GLOBAL and CONFIGURATION of IEC 61131-3 are read; SCL of \
            TIA Portal is prepared by hand, and methods and classes are not prepared";
        (self.code.start(self.at), Mistake::new(what, right))
    }

    /// Moves from the current keyword past `end`; returns the tokens in between.
    fn until(&mut self, end: &str) -> Result<Range<usize>, (usize, Mistake)> {
        let start = self.at;
        let found = (start..self.code.tokens.len()).find(|at| self.code.is(*at, end));
        let Some(found) = found else {
            let what = format!("this {} has no {end}", shown(self.code.word(start)));
            return self.wrong(start, what, "end it");
        };
        self.at = found + 1;
        Ok(start + 1..found)
    }

    fn name(&self, at: usize) -> Result<usize, (usize, Mistake)> {
        if self.code.is_word(at) {
            return Ok(at);
        }
        let what = format!("expected a name, found \"{}\"", shown(self.code.word(at)));
        self.wrong(at, what, "write the name before it")
    }

    fn section(&mut self) -> Result<Section, (usize, Mistake)> {
        let inner = self.until("END_VAR")?;
        Ok(Section { inner })
    }

    fn is_section(&self) -> bool {
        self.code.is_any(self.at, SECTIONS)
    }

    /// Reports parts of a class, or of another unit whose end is missing.
    fn check_body(&self, body: &Range<usize>) -> Result<(), (usize, Mistake)> {
        let code = self.code;
        // EXTENDS is no statement, and neither is a name before another one.
        if code.is_any(body.start, OF_CLASSES) && code.is_word(body.start + 1) {
            return self.class(body.start);
        }
        for at in body.clone() {
            let begins = at == body.start || matches!(code.word(at - 1), ";" | "END_METHOD");
            let is_method = code.is_any(at, &["METHOD", "PROPERTY"]) && code.is_word(at + 1);
            if (begins && is_method) || code.is_any(at, &["END_METHOD", "END_PROPERTY"]) {
                return self.class(at);
            }
            let is_section = code.is_any(at, SECTIONS) && code.word(at - 1) != ".";
            if is_section || code.is(at, "END_VAR") {
                let what = format!("{} stands among statements", shown(code.word(at)));
                let right = "declare variables before the first statement";
                return self.wrong(at, what, right);
            }
        }
        Ok(())
    }

    fn class<T>(&self, at: usize) -> Result<T, (usize, Mistake)> {
        let what = format!("{} belongs to a class", shown(self.code.word(at)));
        let right =
            "methods, properties and inheritance are not prepared: write a plain function block";
        self.wrong(at, what, right)
    }

    fn unit(&mut self, kind: UnitKind, end: &str) -> Result<Unit, (usize, Mistake)> {
        let start = self.at;
        let name = self.name(start + 1)?;
        self.at = name + 1;
        let is_name = self.code.is_word(self.at) && !self.is_section();
        if self.code.is_any(name, OF_CLASSES) && is_name {
            return self.class(name);
        }
        let mut returns = self.at..self.at;
        if kind == UnitKind::Function && self.code.is(self.at, ":") {
            let mut end = self.name(self.at + 1)? + 1;
            if matches!(self.code.word(end), "(" | "[") {
                end = self.code.closing(end, self.code.tokens.len()) + 1;
            }
            returns = self.at + 1..end;
            self.at = end;
        }
        let mut sections = Vec::new();
        while self.is_section() {
            sections.push(self.section()?);
        }
        // The word before the body counts as the keyword.
        self.at -= 1;
        let mut body = self.until(end).or_else(|_| {
            let what = format!("{} has no {end}", shown(self.code.word(name)));
            self.wrong(start, what, "end it")
        })?;
        body.start = body.start.min(body.end);
        self.check_body(&body)?;
        Ok(Unit {
            kind,
            name,
            returns,
            sections,
            body,
        })
    }

    fn configuration(&mut self) -> Result<Configuration, (usize, Mistake)> {
        let start = self.at;
        let mut found = Configuration {
            start,
            name: self.name(start + 1)?,
            globals: Vec::new(),
            resources: Vec::new(),
            tasks: Vec::new(),
            instances: Vec::new(),
        };
        self.at = start + 2;
        loop {
            match self.code.capitals(self.at).as_str() {
                "RESOURCE" => {
                    found.resources.push(self.at);
                    // RESOURCE name ON type
                    self.name(self.at + 1)?;
                    self.at += if self.code.is(self.at + 2, "ON") {
                        4
                    } else {
                        2
                    };
                }
                "TASK" => {
                    let task = self.task()?;
                    found.tasks.push(task);
                }
                "PROGRAM" => {
                    let instance = self.instance()?;
                    found.instances.push(instance);
                }
                "END_RESOURCE" => self.at += 1,
                "END_CONFIGURATION" => {
                    self.at += 1;
                    return Ok(found);
                }
                _ if self.is_section() => found.globals.push(self.section()?),
                "" => {
                    let what = format!("{} has no END_CONFIGURATION", self.code.word(found.name));
                    return self.wrong(start, what, "end it");
                }
                _ => return Err(self.unknown()),
            }
        }
    }

    fn task(&mut self) -> Result<Task, (usize, Mistake)> {
        let start = self.at;
        let inner = self.until(";")?;
        let value = |key: &str| {
            let mut keys = inner.clone();
            let found = keys.find(|at| self.code.is(*at, key) && self.code.is(at + 1, ":="));
            found.map(|at| at + 2)
        };
        Ok(Task {
            name: self.name(start + 1)?,
            whole: start..self.at,
            interval: value("INTERVAL"),
            single: value("SINGLE"),
            priority: value("PRIORITY"),
        })
    }

    fn instance(&mut self) -> Result<Instance, (usize, Mistake)> {
        let start = self.at;
        self.until(";")?;
        let mut name = start + 1;
        if self.code.is_any(name, &["RETAIN", "NON_RETAIN"]) {
            name += 1;
        }
        self.name(name)?;
        let mut colon = name + 1;
        let mut task = None;
        if self.code.is(colon, "WITH") {
            task = Some(self.name(colon + 1)?);
            colon += 2;
        }
        if !self.code.is(colon, ":") {
            let what = format!("unexpected \"{}\"", shown(self.code.word(colon)));
            return self.wrong(colon, what, "write PROGRAM name WITH task : program;");
        }
        let program = self.name(colon + 1)?;
        if let Some(with) = (program..self.at).find(|at| self.code.is(*at, "WITH")) {
            let what = "a block of this program runs in a task of its own".to_owned();
            return self.wrong(with, what, "call the block from the program instead");
        }
        Ok(Instance {
            start,
            name,
            task,
            program,
        })
    }
}

/// The names and types in a section or a `TYPE`.
pub(crate) fn declared(code: &Code<'_>, inner: Range<usize>) -> Declared {
    let mut found = Declared::default();
    let mut pending = Vec::new();
    let mut at = inner.start;
    // Members of a structure are not names of the section.
    let mut depth = 0_usize;
    while at < inner.end {
        match code.word(at) {
            "(" | "[" => at = code.closing(at, inner.end),
            ":" => {
                // TYPE name EXTENDS base : STRUCT
                let extends = pending.iter().position(|at| code.is(*at, "EXTENDS"));
                if let Some(extends) = extends {
                    found.types.extend(pending.drain(extends..).skip(1));
                }
                if depth == 0 {
                    found.names.append(&mut pending);
                }
                pending.clear();
                at += 1;
                // The type, up to its initial value or the end of the declaration; a STRUCT has its own declarations.
                while at < inner.end && !matches!(code.word(at), ":=" | ";") {
                    if matches!(code.word(at), "(" | "[") {
                        at = code.closing(at, inner.end);
                    } else if code.is_any(at, &["STRUCT", "UNION"]) {
                        depth += 1;
                        break;
                    } else if code.is_any(at, &["END_STRUCT", "END_UNION"]) {
                        depth = depth.saturating_sub(1);
                    } else if code.is_word(at) && !code.is_any(at, IN_TYPES) {
                        found.types.push(at);
                    }
                    at += 1;
                }
                while at < inner.end && code.word(at) == ":=" {
                    while at < inner.end && code.word(at) != ";" {
                        at += 1;
                    }
                }
            }
            ";" => pending.clear(),
            _ if code.is_any(at, &["END_STRUCT", "END_UNION"]) => depth = depth.saturating_sub(1),
            _ if code.is_word(at) && !code.is_any(at, BESIDE_NAMES) => pending.push(at),
            _ => {}
        }
        at += 1;
    }
    found
}

/// Words in the type of a declaration that are no type names.
const IN_TYPES: &[&str] = &[
    "ARRAY",
    "OF",
    "REF_TO",
    "POINTER",
    "TO",
    "REFERENCE",
    "R_EDGE",
    "F_EDGE",
    "AT",
];

/// Words beside the names of a declaration.
const BESIDE_NAMES: &[&str] = &[
    "AT",
    "CONSTANT",
    "RETAIN",
    "NON_RETAIN",
    "PERSISTENT",
    "STRUCT",
    "UNION",
    "R_EDGE",
    "F_EDGE",
];

/// Words that begin a section of variables.
const SECTIONS: &[&str] = &[
    "VAR",
    "VAR_INPUT",
    "VAR_OUTPUT",
    "VAR_IN_OUT",
    "VAR_EXTERNAL",
    "VAR_GLOBAL",
    "VAR_TEMP",
    "VAR_STAT",
    "VAR_INST",
    "VAR_CONFIG",
    "VAR_ACCESS",
];

/// Words of classes beside the name of a block.
const OF_CLASSES: &[&str] = &[
    "EXTENDS",
    "IMPLEMENTS",
    "PUBLIC",
    "PRIVATE",
    "PROTECTED",
    "INTERNAL",
    "FINAL",
    "ABSTRACT",
];
