//! `accepted.toml`: the verdicts that somebody has accepted, row by row, in version control.

use std::collections::HashMap;
use std::fmt::Write as _;

use tickbus_base::toml_text::{
    Collector, Mistakes, Table, Value, did_you_mean, load_text, nearest, read_text, shown,
};

use super::judgement::Judgement;
use super::plan::{Cell, Plan};

/// How to get rid of a row or a column that the sweep does not have any more.
fn again(plan: &Plan) -> String {
    format!("write the file again by \"{}\"", plan.sweep.accept)
}

/// The accepted verdicts of one sweep.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Accepted {
    rows: HashMap<String, Row>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Row {
    /// The verdicts by the names of their moments.
    verdicts: HashMap<String, &'static str>,
    why: String,
}

impl Accepted {
    /// Reads the file of a sweep in the test file `file`; a file that does not exist has accepted nothing. With
    /// `rewriting`, faults and moments that the sweep does not have any more are no mistake.
    ///
    /// # Errors
    ///
    /// With every mistake in the file.
    pub fn load(file: &str, plan: &Plan, rewriting: bool) -> Result<Self, Mistakes> {
        let path = plan.accepted_file();
        if !path.exists() {
            return Ok(Self::default());
        }
        let text = load_text(path)?;
        let mut collector = Collector::new(&path.display().to_string(), &text);
        let read = read_text(&mut collector, &text, |root| {
            Some(read(root, file_name(file), plan, rewriting))
        });
        match collector.finish() {
            Some(mistakes) => Err(mistakes),
            None => Ok(read.unwrap_or_default()),
        }
    }

    /// The accepted verdict of a run, if there is one.
    pub fn verdict(&self, plan: &Plan, cell: &Cell) -> Option<&'static str> {
        let row = self.rows.get(&plan.row_name(cell))?;
        row.verdicts.get(&plan.moments[cell.moment].name).copied()
    }

    /// True if a run with this verdict passes: as accepted, or right if nothing was accepted.
    pub fn passes(&self, plan: &Plan, cell: &Cell, judgement: &Judgement) -> bool {
        match self.verdict(plan, cell) {
            Some(word) => word == judgement.word(),
            None => judgement.is_right(),
        }
    }

    /// Why the verdicts of a run's row were accepted; empty if nobody has said it.
    pub fn why(&self, plan: &Plan, cell: &Cell) -> &str {
        let row = self.rows.get(&plan.row_name(cell));
        row.map_or("", |row| &row.why)
    }

    /// The text of a file that accepts all these verdicts, in the order of the plan's cells, and keeps each "why".
    pub fn rewritten(&self, file: &str, plan: &Plan, verdicts: &[Judgement]) -> String {
        let mut text = format!(
            "# The accepted verdicts of the sweep in {0}, which \"{3}\" has written.\n\
             # \"why\" is yours: say why a row may have what is neither told nor right. It is kept.\n\n\
             sweep   = {1}\nmoments = [{2}]\n",
            file_name(file),
            quoted(file_name(file)),
            plan.moment_names()
                .map(quoted)
                .collect::<Vec<_>>()
                .join(", "),
            plan.sweep.accept,
        );
        let columns = plan.moments.len().max(1);
        for (cells, verdicts) in plan.cells.chunks(columns).zip(verdicts.chunks(columns)) {
            let words = verdicts
                .iter()
                .map(|verdict| format!("{:<8}", verdict.word()));
            let words: String = words.collect();
            let why = self.why(plan, &cells[0]);
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                "\n[[accept]]\nfault    = {}\nverdicts = \"{}\"\n",
                quoted(&plan.row_name(&cells[0])),
                words.trim_end(),
            );
            if !why.is_empty() || !verdicts.iter().all(Judgement::is_right) {
                let _ = writeln!(text, "why      = {}", quoted(why));
            }
        }
        text
    }
}

/// The name of a file without its folder.
fn file_name(file: &str) -> &str {
    file.rsplit(['/', '\\']).next().unwrap_or(file)
}

/// A text as a TOML string.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            // Writing to a string cannot fail.
            c if c.is_control() => drop(write!(quoted, "\\u{:04x}", u32::from(c))),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

fn read(mut root: Table<'_>, file: &str, plan: &Plan, rewriting: bool) -> Accepted {
    const SWEEP: &str = "write the name of the test file with the sweep";
    let sweep = root.require("sweep", SWEEP);
    let moments = root.require("moments", "write the moments, in the order of the verdicts");
    let rows = root.take("accept");
    root.finish();
    if let Some(value) = sweep
        && let Some(name) = value.text(SWEEP)
        && name != file
    {
        value.wrong(
            format!("these are the verdicts of the sweep in \"{}\"", shown(name)),
            format!("in {file}, name another file by accepted = \"…\""),
        );
    }
    let Some(moments) = moments.and_then(|value| read_moments(&value, plan, rewriting)) else {
        return Accepted::default();
    };
    let mut known: Vec<String> = plan.cells.iter().map(|cell| plan.row_name(cell)).collect();
    known.dedup();
    let mut accepted = Accepted::default();
    for table in rows
        .map(|value| value.tables("[[accept]]"))
        .unwrap_or_default()
    {
        let Some((value, name, row)) = read_row(table, &moments) else {
            continue;
        };
        if !rewriting && !known.contains(&name) {
            let near = nearest(&name, known.iter().map(String::as_str));
            let right =
                near.map_or_else(|| again(plan), |near| format!("did you mean \"{near}\"?"));
            value.wrong(
                format!("the sweep has no fault \"{}\"", shown(&name)),
                right,
            );
        }
        if accepted.rows.insert(name, row).is_some() {
            value.wrong("this fault was accepted above", "remove one of the two");
        }
    }
    accepted
}

fn read_moments(value: &Value<'_>, plan: &Plan, rewriting: bool) -> Option<Vec<String>> {
    const RIGHT: &str = "write the names of the moments in quotes";
    let names: Vec<&str> = plan.moment_names().collect();
    let mut moments = Vec::new();
    for value in value.list(RIGHT)? {
        let name = value.text(RIGHT)?;
        if !rewriting && !names.contains(&name) {
            value.wrong(
                format!("the moment \"{}\" does not come any more", shown(name)),
                again(plan),
            );
        }
        moments.push(name.to_owned());
    }
    Some(moments)
}

fn read_row<'a>(mut table: Table<'a>, moments: &[String]) -> Option<(Value<'a>, String, Row)> {
    let fault = table.require("fault", "write the fault, such as \"Level stuck-on\"");
    let right = "write one word for each of the moments, separated by blanks";
    let verdicts = table.require("verdicts", right);
    let why = table.take("why");
    table.finish();
    let why = match why {
        None => Some(""),
        Some(value) => value.text("say why these verdicts are accepted"),
    };
    let verdicts = verdicts.and_then(|value| {
        let words: Vec<&str> = value.text(right)?.split_whitespace().collect();
        if words.len() != moments.len() {
            let what = format!("{} verdicts for {} moments", words.len(), moments.len());
            value.wrong(what, right);
            return None;
        }
        let mut verdicts = HashMap::new();
        for (word, moment) in words.into_iter().zip(moments) {
            let Some(known) = Judgement::WORDS.iter().find(|known| **known == word) else {
                value.wrong(
                    format!("\"{}\" is no verdict", shown(word)),
                    did_you_mean(word, "verdicts", &Judgement::WORDS),
                );
                return None;
            };
            verdicts.insert(moment.clone(), *known);
        }
        Some(verdicts)
    });
    let value = fault?;
    let name = value
        .text("write the fault, such as \"Level stuck-on\"")?
        .to_owned();
    let row = Row {
        verdicts: verdicts?,
        why: why?.to_owned(),
    };
    Some((value, name, row))
}
