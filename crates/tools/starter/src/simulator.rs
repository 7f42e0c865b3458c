//! The simulator in its language: the signals by name, a loop, and a model to begin with.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use tickbus_image::signal::{Area, Signal};

use super::answers::Language;

/// Signals beyond these are looked up by their names where they are needed.
const MOST: usize = 400;

/// The parts of a language that a template needs.
struct Parts {
    file: &'static str,
    template: &'static str,
    comment: &'static str,
    indent: &'static str,
    /// Looks a signal up: `NAME` is the variable, `TEXT` its name in quotes.
    lookup: &'static str,
    /// The model of the tank.
    tank: &'static str,
    tank_before: &'static str,
    tank_shown: &'static str,
    shown: &'static str,
}

const JAVA: Parts = Parts {
    file: "Machine.java",
    template: include_str!("texts/Machine.java"),
    comment: "//",
    indent: "            ",
    lookup: "var NAME = plc.signal(TEXT);",
    tank_before: "            double mm = 100;\n",
    tank: "                mm = Math.max(0, Math.min(500, mm + (valve.getBoolean() ? 1.0 : -0.5)));     // your model\n                \
           levelLow.setBoolean(mm < 150);\n                level.set(mm);\n",
    tank_shown: "\"level \" + Math.round(mm) + \" mm, valve \" + valve.getBoolean() + \", status \" + status",
    shown: "\"status \" + status",
};

const PYTHON: Parts = Parts {
    file: "machine.py",
    template: include_str!("texts/machine.py"),
    comment: "#",
    indent: "    ",
    lookup: "NAME = plc[TEXT]",
    tank_before: "    mm = 100.0\n",
    tank: "        mm = max(0.0, min(500.0, mm + (1.0 if valve.value else -0.5)))  # your model\n        level_low.value = mm < 150\n        level.value = mm\n",
    tank_shown: "f\"level {mm:.0f} mm, valve {valve.value}, status {status.name}\"",
    shown: "f\"status {status.name}\"",
};

const C: Parts = Parts {
    file: "machine.c",
    template: include_str!("texts/machine.c"),
    comment: "//",
    indent: "    ",
    lookup: "tb_signal NAME;\n    if (tb_find(plc, TEXT, &NAME) < 0) return failed();",
    tank_before: "    double mm = 100;\n",
    tank: "        mm += tb_get_bool(values, &valve) ? 1.0 : -0.5; /* your model */\n        mm = mm < 0 ? 0 : mm > 500 ? 500 : mm;\n        \
           tb_set(values, &level_low, mm < 150);\n        tb_set(values, &level, mm);\n",
    tank_shown: "\"level %.0f mm, valve %d, status %d\\n\", mm, tb_get_bool(values, &valve), status",
    shown: "\"status %d\\n\", status",
};

/// The name and the text of the simulator's file; `None` for a machine of replies.
pub(super) fn simulator(
    language: Language,
    name: &str,
    signals: &[Signal],
    is_tank: bool,
) -> Option<(&'static str, String)> {
    let parts = match language {
        Language::Java => &JAVA,
        Language::Python => &PYTHON,
        Language::C => &C,
        Language::Replies => return None,
    };
    let mut lines = lookups(parts, language, signals);
    if is_tank {
        lines += parts.tank_before;
    }
    let inner = format!("{}    ", parts.indent);
    let (model, shown) = if is_tank {
        (parts.tank.to_owned(), parts.tank_shown)
    } else {
        let words = "your model: read what the PLC has set, and set what it reads";
        (format!("{inner}{} {words}\n", parts.comment), parts.shown)
    };
    let text = parts
        .template
        .replace("{{name}}", &remark(name))
        .replace("{{signals}}", &lines)
        .replace("{{model}}", &model)
        .replace("{{shown}}", shown);
    Some((parts.file, text))
}

fn lookups(parts: &Parts, language: Language, signals: &[Signal]) -> String {
    let mut taken: BTreeSet<String> = RESERVED.iter().map(|word| (*word).to_owned()).collect();
    let mut lines = String::new();
    for (area, words) in [
        (Area::Output, "outputs of the PLC, which the machine reads"),
        (Area::Input, "inputs of the PLC, which the machine writes"),
    ] {
        // Writing to a text cannot fail.
        let _ = writeln!(lines, "{}{} {words}", parts.indent, parts.comment);
        let here = signals.iter().filter(|signal| signal.area == area);
        for signal in here.take(MOST) {
            let variable = variable(&signal.name, language, &mut taken);
            let text = literal(&signal.name);
            // A variable such as aTEXT is no place for the text.
            let around = parts.lookup.split("TEXT");
            let around = around.map(|part| part.replace("NAME", &variable));
            let line = around.collect::<Vec<_>>().join(&text);
            let _ = writeln!(lines, "{}{line}", parts.indent);
        }
    }
    lines
}

/// A text in quotes, as all three languages read it: UTF-8 as it is, quotes and backslashes escaped.
fn literal(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// A text within a comment of Java or C and a docstring of Python: nothing in it ends or escapes.
fn remark(text: &str) -> String {
    let plain = text.replace('\\', "/").replace('"', "'");
    plain.replace("*/", "* /").replace("/*", "/ *")
}

/// Words that no variable can have: of the three languages, and of the templates.
const RESERVED: &[&str] = &[
    "abstract",
    "alignas",
    "alignof",
    "and",
    "args",
    "as",
    "asm",
    "assert",
    "async",
    "auto",
    "await",
    "bitand",
    "bitor",
    "bool",
    "boolean",
    "break",
    "byte",
    "case",
    "catch",
    "char",
    "class",
    "compl",
    "const",
    "constexpr",
    "continue",
    "def",
    "default",
    "del",
    "delete",
    "do",
    "double",
    "elif",
    "else",
    "enum",
    "enumerate",
    "except",
    "explicit",
    "export",
    "extends",
    "extern",
    "failed",
    "false",
    "fflush",
    "final",
    "finally",
    "float",
    "for",
    "fprintf",
    "friend",
    "from",
    "global",
    "goto",
    "if",
    "implements",
    "import",
    "in",
    "inline",
    "instanceof",
    "int",
    "interface",
    "is",
    "lambda",
    "linux",
    "long",
    "main",
    "match",
    "mm",
    "mutable",
    "namespace",
    "native",
    "new",
    "noexcept",
    "nonlocal",
    "not",
    "null",
    "nullptr",
    "number",
    "operator",
    "or",
    "pace",
    "package",
    "pass",
    "plc",
    "print",
    "printf",
    "private",
    "protected",
    "public",
    "raise",
    "record",
    "register",
    "restrict",
    "return",
    "short",
    "signal",
    "signed",
    "sizeof",
    "static",
    "status",
    "stderr",
    "stdin",
    "stdout",
    "stop",
    "stopped",
    "strictfp",
    "struct",
    "super",
    "switch",
    "synchronized",
    "template",
    "this",
    "thread_local",
    "throw",
    "throws",
    "tickbus",
    "transient",
    "true",
    "try",
    "turn",
    "typedef",
    "typeid",
    "typename",
    "typeof",
    "union",
    "unix",
    "unsigned",
    "using",
    "values",
    "var",
    "virtual",
    "void",
    "volatile",
    "wchar_t",
    "while",
    "with",
    "xor",
    "yield",
];

/// A variable that reads like the signal's name: `levelLow` in Java, `level_low` elsewhere.
fn variable(name: &str, language: Language, taken: &mut BTreeSet<String>) -> String {
    let words = name.split(|letter: char| !letter.is_ascii_alphanumeric());
    let words = words
        .filter(|word| !word.is_empty())
        .map(str::to_ascii_lowercase);
    let words: Vec<String> = words.collect();
    let mut variable = if language == Language::Java {
        let rest = words.iter().skip(1).map(|word| {
            let (first, rest) = word.split_at(1);
            first.to_ascii_uppercase() + rest
        });
        words.first().cloned().unwrap_or_default() + rest.collect::<String>().as_str()
    } else {
        words.join("_")
    };
    if !variable.starts_with(|letter: char| letter.is_ascii_alphabetic()) {
        variable.insert_str(0, "signal");
    }
    let mut unique = variable.clone();
    let mut number = 2;
    while !taken.insert(unique.clone()) {
        unique = format!("{variable}{number}");
        number += 1;
    }
    unique
}
