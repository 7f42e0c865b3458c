//! Tables of inputs and outputs: a row for each scan, a column for each signal.
//!
//! A table is written as engineers draw truth tables and timing tables, and becomes steps: a row sets the signals of its
//! columns that the PLC reads, lets one tick pass, and expects the values of the others.

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Value, read_text, shown};
use tickbus_fieldbus::faults::unknown;
use tickbus_image::signal::section::slot_of;
use tickbus_image::signal::{DataType, Signal, Slot};
use tickbus_reply::{Condition, Demand};

use super::sections::Reader;
use super::test::{Passage, Step, TextPosition};

const SHAPE: &str = "write a table as text: a line with the names of signals, then a line for each scan, cells separated \
                     by | and all in \"\"\"...\"\"\"";
const WHEN: &str = "write such as 3 or 3..10 below \"scan\", and 20ms or 20ms..90ms below \"time\", later than in the row before";

/// The meaning of a column.
enum Column {
    /// The number of a tick in this table, from 1.
    Tick,
    /// The time since the first tick of this table.
    Time,
    Set(usize),
    Expect(usize),
}

/// A cell: its place in the file, and its text.
type Cell<'a> = (TextPosition, &'a str);

impl Reader<'_> {
    /// The rows of a table, as steps.
    pub(super) fn table_steps(
        &self,
        value: &Value<'_>,
        collector: &Collector<'_>,
    ) -> Option<Vec<Step>> {
        value.text(SHAPE)?;
        let Some(lines) = value.text_lines() else {
            value.wrong("a table has no backslash", SHAPE);
            return None;
        };
        let refuse = |at: usize, mistake: Mistake| collector.collect(at, mistake);
        let mut lines = lines.into_iter().filter(|(_, line)| {
            let line = line.trim();
            // A ruler below the names, as in Markdown, and comments.
            !line.is_empty() && !line.starts_with('#') && !line.contains("---")
        });
        let Some(head) = lines.next().map(cells) else {
            value.wrong("a table without a line", SHAPE);
            return None;
        };
        let mut columns = Vec::new();
        for (at, name) in &head {
            match self.column(name, columns.is_empty()) {
                Ok(column) => columns.push(column),
                Err(mistake) => refuse(*at, mistake),
            }
        }
        if columns.len() < head.len() {
            return None;
        }
        if !columns
            .iter()
            .any(|column| matches!(column, Column::Expect(_)))
        {
            let what = "no column of this table is written by the PLC: it checks nothing";
            refuse(
                head[0].0,
                Mistake::new(what, "add the signals that are expected"),
            );
            return None;
        }
        let (mut steps, mut next, mut right) = (Vec::new(), 0, true);
        for (number, line) in lines.enumerate() {
            let row = cells(line);
            if row.len() != columns.len() {
                let what = format!(
                    "this row has {} cells, and the table {} columns",
                    row.len(),
                    columns.len()
                );
                let start = row.first().map_or(line.0, |(at, _)| *at);
                refuse(
                    start,
                    Mistake::new(what, "write - in a cell without a value"),
                );
                right = false;
                continue;
            }
            let place = |at: usize| collector.place(at);
            let mut step = Step {
                place: place(row[0].0),
                row: Some(number + 1),
                passage: Some(Passage::Ticks(1)),
                ..Step::default()
            };
            let (mut ticks, mut is_timed) = ((next, next), true);
            for (column, (at, text)) in columns.iter().zip(&row) {
                let cell = (place(*at), *text);
                let read = self.cell(column, cell, next, &mut ticks, &mut step);
                if let Err(mistake) = read {
                    refuse(*at, mistake);
                    right = false;
                    is_timed &= matches!(column, Column::Set(_) | Column::Expect(_));
                }
            }
            if !is_timed {
                continue;
            }
            if ticks.0 > next {
                steps.push(Step {
                    place: step.place,
                    passage: Some(Passage::Ticks(ticks.0 - next)),
                    ..Step::default()
                });
            }
            step.during = ticks.1 - ticks.0;
            next = ticks.1 + 1;
            steps.push(step);
        }
        if steps.is_empty() && right {
            value.wrong("a table without a row proves nothing", SHAPE);
        }
        (right && !steps.is_empty()).then_some(steps)
    }

    fn column(&self, name: &str, is_first: bool) -> Result<Column, Mistake> {
        match self.table.position(name) {
            Some(signal) if self.table.signals[signal].area == self.own() => {
                Ok(Column::Set(signal))
            }
            Some(signal) => Ok(Column::Expect(signal)),
            None if is_first && matches!(name, "scan" | "tick") => Ok(Column::Tick),
            None if is_first && name == "time" => Ok(Column::Time),
            None if matches!(name, "scan" | "tick" | "time") => Err(Mistake::new(
                format!("\"{name}\" is not the first column"),
                "write it once, before the signals",
            )),
            None => Err(unknown(name, self.table)),
        }
    }

    fn cell(
        &self,
        column: &Column,
        (place, text): Cell<'_>,
        next: u64,
        ticks: &mut (u64, u64),
        step: &mut Step,
    ) -> Result<(), Mistake> {
        if matches!(text, "" | "-") {
            return Ok(());
        }
        match column {
            Column::Tick | Column::Time => {
                let (from, to) = text.split_once("..").unwrap_or((text, text));
                let read = |text: &str| match column {
                    Column::Tick => text.trim().parse::<u64>().ok()?.checked_sub(1),
                    _ => self.tick_at(text.trim()),
                };
                let wrong = || {
                    let what = format!("\"{}\" is no time for this row", shown(text));
                    Mistake::new(what, WHEN)
                };
                let (from, to) = (read(from).ok_or_else(wrong)?, read(to).ok_or_else(wrong)?);
                if from < next || to < from || to > 1_000_000_000 {
                    return Err(wrong());
                }
                *ticks = (from, to);
            }
            Column::Set(signal) => {
                let slot = slot_of_text(text, &self.table.signals[*signal])?;
                step.set.push((*signal, slot));
            }
            Column::Expect(signal) => {
                let condition = self.demand(*signal, text)?;
                step.expect.push((condition, place));
            }
        }
        Ok(())
    }

    /// The tick that ends one step after this time, from 0.
    fn tick_at(&self, text: &str) -> Option<u64> {
        let time: Nanos = text
            .parse()
            .ok()
            .or_else(|| (text == "0").then_some(Nanos::ZERO))?;
        let whole = time.0 >= 0 && time.0 % self.step.0 == 0;
        u64::try_from(time.0 / self.step.0).ok().filter(|_| whole)
    }

    /// A value, or a comparison without its left side: `> 3`, `12.5 ± 0.1`.
    fn demand(&self, signal: usize, text: &str) -> Result<Condition, Mistake> {
        let known = &self.table.signals[signal];
        let compares = text.starts_with(['<', '>', '=', '!']);
        if compares || text.contains('±') || text.contains("+-") {
            let sign = if compares { "" } else { "== " };
            return Condition::parse(&format!("{} {sign}{text}", known.name), self.table);
        }
        let slot = slot_of_text(text, known)?;
        let demand = match known.data_type {
            // A REAL has seven digits.
            DataType::Real => Demand::Near(slot.real(), slot.real().abs() * 1e-6),
            _ => Demand::equal(slot, known),
        };
        Ok(Condition { signal, demand })
    }
}

/// The cells of a line between its bars, with their places. Two bars are one.
fn cells((mut at, line): (usize, &str)) -> Vec<(usize, &str)> {
    let begun = line.trim_start();
    let inner = begun.strip_prefix('|').unwrap_or(begun);
    at += line.len() - inner.len();
    let inner = inner.trim_end();
    let mut rest = Some(inner.strip_suffix('|').unwrap_or(inner));
    let mut found = Vec::new();
    while let Some(text) = rest {
        let (cell, next) = text.split_once('|').map_or((text, None), |(cell, next)| {
            (cell, Some(next.strip_prefix('|').unwrap_or(next)))
        });
        let blanks = cell.len() - cell.trim_start().len();
        found.push((at + blanks, cell.trim()));
        at += text.len() - next.map_or(0, str::len);
        rest = next;
    }
    found
}

/// The value in a cell, read as in the rest of the file; `on` and `off` are values of a BOOL.
fn slot_of_text(text: &str, signal: &Signal) -> Result<Slot, Mistake> {
    let lower = text.to_ascii_lowercase();
    let word = match lower.as_str() {
        "on" => "true",
        "off" => "false",
        other => other,
    };
    let no_value = || {
        let what = format!("\"{}\" is no value of \"{}\"", shown(text), signal.name);
        Mistake::new(what, "write 0 or 1, a number, or - for none")
    };
    if !matches!(word, "true" | "false") && word.parse::<f64>().is_err() {
        return Err(no_value());
    }
    let line = format!("value = {word}");
    let mut collector = Collector::new("", &line);
    let read = read_text(&mut collector, &line, |mut root| {
        let value = root.take("value")?;
        slot_of(&value, signal, "the value")
    });
    match collector.finish() {
        None => read.ok_or_else(no_value),
        Some(mistakes) => {
            let first = mistakes.iter().next();
            let Mistake { what, right } = first.ok_or_else(no_value)?.mistake.clone();
            Err(Mistake::new(what.replace("\"value\"", "the value"), right))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_cut_at_bars_and_keep_their_places() {
        assert_eq!(
            cells((5, "a | b c || d")),
            [(5, "a"), (9, "b c"), (16, "d")]
        );
        assert_eq!(cells((0, " | a |b| ")), [(3, "a"), (6, "b")]);
        assert_eq!(cells((0, "a||")), [(0, "a"), (2, "")]);
    }
}
