//! The `[[reply]]` sections of a driver.cfg, and the `[[machine.reply]]` sections of a test file.

mod drives;
mod keys;
mod kinds;
mod reader;
mod rule;
mod signals;

use std::collections::{HashMap, HashSet};

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Table, TableKind, Value, shown};
use tickbus_image::signal::section::NAME_LIMIT;
use tickbus_image::signal::{Area, SignalTable};

pub use self::drives::{Drive, drives};
pub use self::keys::{REPLY_KEYS, REPLY_KINDS};
pub use self::kinds::{OneOf, one_of};
use self::reader::Reader;
pub use self::rule::read_rule;
pub use self::signals::{Signals, texts};
use super::behaviour::{RULE, Reply};
use super::order::order;

/// The maximum number of replies of one machine.
pub const LIMIT: usize = 2000;

/// The machine for which replies are read.
#[derive(Clone, Copy, Debug)]
pub struct Scope<'a> {
    /// The signals.
    pub table: &'a SignalTable,
    /// The area that the machine writes.
    pub writes: Area,
    /// The length of a tick, where it is known: no time of a reply is shorter.
    pub tick: Option<Nanos>,
    /// The signals that something else makes, by index, and what that is.
    pub taken: &'a [(usize, String)],
    /// The replies that the machine has already, from another file.
    pub earlier: &'a [Reply],
}

/// One section, read, and its places in the file.
struct Read<'a> {
    reply: Reply,
    kind: Value<'a>,
    outputs: Vec<(usize, Value<'a>)>,
}

/// Reads the sections and reports their mistakes. Returns all replies of the machine, the earlier ones among them, in an
/// order in which each comes after those whose signals it reads.
pub fn read_sections(sections: Vec<Table<'_>>, scope: Scope<'_>) -> Vec<Reply> {
    let count = scope.earlier.len() + sections.len();
    if let (Some(last), true) = (sections.last(), count > LIMIT) {
        last.wrong(
            format!("there are {count} replies"),
            format!("a machine has at most {LIMIT}"),
        );
        return Vec::new();
    }
    let read = sections.into_iter().filter_map(|table| read(table, scope));
    let read: Vec<Read<'_>> = read.collect();
    check_writers(&read, scope);
    let read_here = read.iter().map(|read| &read.reply);
    let replies: Vec<&Reply> = scope.earlier.iter().chain(read_here).collect();
    let mut circle = match order(&replies) {
        Ok(order) => {
            return order
                .into_iter()
                .map(|place| replies[place].clone())
                .collect();
        }
        Err(circle) => circle,
    };
    // The earlier replies alone are no circle, so one that was read here takes part.
    let here = circle
        .iter()
        .position(|place| *place >= scope.earlier.len());
    circle.rotate_left(here.unwrap_or_default());
    let first = circle[0];
    circle.push(first);
    let names = circle
        .iter()
        .map(|place| format!("\"{}\"", shown(&replies[*place].name)));
    let names: Vec<String> = names.collect();
    read[first - scope.earlier.len()].kind.wrong(
        format!(
            "replies read each other in a circle: {}",
            names.join(" reads ")
        ),
        "let one of them read a signal of the PLC, or of the simulation",
    );
    Vec::new()
}

/// Reports signals that two make, unless both are rules.
fn check_writers(read: &[Read<'_>], scope: Scope<'_>) {
    let mut first: HashMap<usize, (&Value<'_>, bool)> = HashMap::new();
    let outputs = read.iter().flat_map(|read| {
        let is_rule = read.reply.kind == RULE;
        read.outputs
            .iter()
            .map(move |(signal, value)| (signal, value, is_rule))
    });
    for (signal, value, is_rule) in outputs {
        let name = shown(&scope.table.signals[*signal].name);
        if let Some((_, what)) = scope.taken.iter().find(|(taken, _)| taken == signal) {
            value.wrong(
                format!("\"{name}\" is made by {what}"),
                "name another signal; each has one writer",
            );
        } else if let Some((before, was_rule)) = first.insert(*signal, (value, is_rule))
            // Rules share signals: one sets what another one clears.
            && !(was_rule && is_rule)
        {
            value.wrong(
                format!(
                    "\"{name}\" is made by the reply on line {}, too",
                    before.line()
                ),
                "name another signal; each has one writer",
            );
        }
    }
}

/// Reads one section.
fn read<'a>(mut section: Table<'a>, scope: Scope<'a>) -> Option<Read<'a>> {
    let values = REPLY_KEYS.iter().filter_map(|key| {
        let value = section.take(key.name)?;
        Some((key.name, value))
    });
    let values: Vec<(&str, Value<'a>)> = values.collect();
    section.require(
        "kind",
        "write the kind of reply, such as kind = \"follows\"",
    );
    let reader = Reader::new(values, scope);
    let kinds = REPLY_KINDS.map(|kind| (kind.name, kind));
    let kind = reader.get("kind");
    let known = kind.and_then(|value| value.choice("kinds of replies", &kinds));
    if let Some(known) = known {
        for key in known.required {
            section.require(key.name, key.right);
        }
        for (one_of, right) in one_of(known.name) {
            section.require_one_of(one_of, *right);
        }
        check_keys(&known, &reader);
    }
    let is_whole = section.is_whole();
    section.finish();
    let name = reader.read("name", |value| {
        value.label(NAME_LIMIT, "give the reply a name, or leave it out")
    });
    let (known, kind) = (known?, kind?.clone());
    let behaviour = kinds::read(known.name, &reader);
    let (behaviour, name) = (behaviour.filter(|_| is_whole)?, name?);
    let (inputs, outputs, shortest) = reader.finish();
    let made = outputs.first().map(|(signal, _)| *signal);
    let name = name.map_or_else(
        || {
            let made = made.map_or("", |signal| scope.table.signals[signal].name.as_str());
            format!("{} {made}", known.name)
        },
        str::to_owned,
    );
    Some(Read {
        reply: Reply {
            name,
            kind: known.name,
            inputs,
            outputs: distinct(outputs.iter().map(|(signal, _)| *signal)),
            shortest,
            behaviour,
        },
        kind,
        outputs,
    })
}

/// The elements in order, each once.
fn distinct(signals: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut seen = HashSet::new();
    signals.filter(|signal| seen.insert(*signal)).collect()
}

/// Reports keys that do not belong to replies of this kind.
fn check_keys(kind: &TableKind, reader: &Reader<'_>) {
    for (key, value) in reader.all() {
        if ["kind", "name"].contains(key) || kind.keys().any(|own| own == *key) {
            continue;
        }
        let owners = REPLY_KINDS
            .iter()
            .filter(|kind| kind.keys().any(|own| own == *key));
        let owners: Vec<&str> = owners.map(|kind| kind.name).collect();
        value.wrong(
            format!("a reply of kind \"{}\" has no \"{key}\"", kind.name),
            format!("remove it; it is for {}", owners.join(", ")),
        );
    }
}
