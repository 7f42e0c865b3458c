//! The matrix of a sweep as text: for each kind of fault a table of signals and moments.

use std::fmt::Write as _;

use super::judgement::Judgement;
use super::plan::Plan;
use tickbus_base::time::Nanos;

/// The width of a page, in characters.
const WIDTH: usize = 80;

/// The width of a column, without the blank before it.
const COLUMN: usize = 7;

/// The longest name of a row.
const LONGEST: usize = 32;

/// The text of a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Told or right.
    Right(String),
    /// Neither, and accepted.
    Accepted(String),
    /// To be looked at.
    Red(String),
}

impl Mark {
    /// The mark of a verdict, which passes or does not; without a verdict the run could not be judged.
    pub fn of(judgement: Option<&Judgement>, passes: bool) -> Self {
        let Some(judgement) = judgement else {
            return Self::Red("WRONG".to_owned());
        };
        let text = match judgement {
            Judgement::Told(after) => short(*after),
            Judgement::Right(_) => "ok".to_owned(),
            other => other.word().to_owned(),
        };
        match (passes, judgement.is_right()) {
            (true, true) => Self::Right(text),
            (true, false) => Self::Accepted(text),
            (false, true) => Self::Red(format!("{text}!")),
            (false, false) => Self::Red(text.to_uppercase()),
        }
    }

    /// The text without its column.
    pub(super) fn as_text(&self) -> &str {
        match self {
            Self::Right(text) | Self::Accepted(text) | Self::Red(text) => text,
        }
    }

    /// The text in its column; with `colour`, for a terminal.
    fn text(&self, colour: bool) -> String {
        let (text, code) = match self {
            Self::Right(text) => (text, 32),
            Self::Accepted(text) => (text, 33),
            Self::Red(text) => (text, 31),
        };
        let padded = column(text);
        if colour {
            format!("\x1b[{code}m{padded}\x1b[0m")
        } else {
            padded
        }
    }
}

/// A text in its column.
fn column(text: &str) -> String {
    format!(" {text:<COLUMN$}")
}

/// A time in at most six characters.
fn short(time: Nanos) -> String {
    if time < Nanos::from_secs(10) {
        return time.rounded().to_string();
    }
    format!("{}s", time.0 / Nanos::from_secs(1).0)
}

/// The matrix of a sweep, with a mark for each cell that was run, in the order of the plan's cells.
pub fn matrix(plan: &Plan, marks: &[Option<Mark>], colour: bool) -> String {
    let columns = plan.moments.len().max(1);
    let rows: Vec<(&str, &str, &[Option<Mark>])> = plan
        .sweep
        .rows
        .iter()
        .zip(marks.chunks(columns))
        .filter(|(_, marks)| marks.iter().any(Option::is_some))
        .map(|(row, marks)| {
            let subject = match row.subject.as_str() {
                "" => "the line",
                subject => subject,
            };
            (row.kind.as_str(), subject, marks)
        })
        .collect();
    let names = rows.iter().flat_map(|(kind, subject, _)| [kind, subject]);
    let longest = names.map(|name| name.chars().count()).max();
    let name_width = longest.unwrap_or_default().min(LONGEST);
    let per_block = ((WIDTH - name_width) / (COLUMN + 1)).max(1);

    let mut text = String::new();
    let mut labels = Vec::new();
    for (number, name) in plan.moment_names().enumerate() {
        if name.chars().count() <= COLUMN {
            labels.push(name.to_owned());
        } else {
            let label = format!("#{}", number + 1);
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{label} = {name}");
            labels.push(label);
        }
    }
    for of_kind in rows.chunk_by(|one, next| one.0 == next.0) {
        for first in (0..columns).step_by(per_block) {
            let block = first..(first + per_block).min(columns);
            let is_run = |row: &(&str, &str, &[Option<Mark>])| {
                row.2[block.clone()].iter().any(Option::is_some)
            };
            if !of_kind.iter().any(is_run) {
                continue;
            }
            let heads = labels[block.clone()].iter().map(|label| column(label));
            let heads: String = heads.collect();
            let kind: String = of_kind[0].0.chars().take(LONGEST).collect();
            let head = format!("{kind:<name_width$}{heads}");
            let _ = writeln!(text, "\n{}", head.trim_end());
            for (_, subject, marks) in of_kind {
                let subject: String = subject.chars().take(LONGEST).collect();
                let cells = marks[block.clone()].iter().map(|mark| match mark {
                    Some(mark) => mark.text(colour),
                    None => " ".repeat(COLUMN + 1),
                });
                let line = format!("{subject:<name_width$}{}", cells.collect::<String>());
                let _ = writeln!(text, "{}", line.trim_end());
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_says_what_was_accepted_and_what_is_to_be_looked_at() {
        let told = Judgement::Told(Nanos::from_millis(1502));
        let still = Judgement::Still(String::new());
        for (mark, expected) in [
            (Mark::of(Some(&told), true), " 1502ms "),
            (Mark::of(Some(&told), false), " 1502ms!"),
            (Mark::of(Some(&still), true), " still  "),
            (Mark::of(Some(&still), false), " STILL  "),
            (Mark::of(None, false), " WRONG  "),
        ] {
            assert_eq!(mark.text(false), expected);
        }
        let right = Judgement::Right(Nanos::ZERO);
        let coloured = Mark::of(Some(&right), true).text(true);
        assert_eq!(coloured, "\x1b[32m ok     \x1b[0m");
        assert_eq!(short(Nanos::from_millis(83_210)), "83s");
    }
}
