//! The result of a comparison as text and as JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::super::columns::aligned;
use super::Done;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::printable;
use tickbus_compare::{BoolResult, Edge, Fitted, Outcome, SignalResult, Steps, short, tables};
use tickbus_report::Cell;
use tickbus_testing::FitFile;

/// The most missing and extra edges that the text lists; page and JSON have more.
const MOST_LISTED: usize = 20;

/// The text for people: tables, and a last line for scripts.
pub(super) fn text(done: &Done) -> String {
    let compared = &done.compared;
    let mut text = String::new();
    for table in tables(compared, MOST_LISTED) {
        let cell = |cell: &Cell| match cell {
            Cell::Text(text) | Cell::Number(text) | Cell::Chart(_, _, text) => printable(text),
        };
        let row = |row: &Vec<Cell>| row.iter().map(cell).collect();
        let rows: Vec<Vec<String>> = table.rows.iter().map(row).collect();
        let headings = table.headings.iter();
        let headings: Vec<&str> = headings
            .map(|heading| heading.trim_start_matches('>'))
            .collect();
        let caption = printable(&table.caption);
        let _ = writeln!(
            text,
            "{}: {caption}\n{}",
            table.heading,
            aligned(&headings, &rows)
        );
    }
    for (names, whose) in [
        (&compared.only_real, "real"),
        (&compared.only_simulated, "simulated"),
    ] {
        if !names.is_empty() {
            let names = printable(&names.join(", "));
            let _ = writeln!(text, "only in the {whose} recording: {names}");
        }
    }
    for note in &compared.notes {
        let _ = writeln!(text, "{}", printable(note));
    }
    if let Some((file, fitted)) = &done.fitted {
        fit(&mut text, file, fitted);
    }
    let is_ok = done.breaches.is_empty();
    let changed = compared.signals.iter();
    let _ = write!(
        text,
        "compare: {} likeness={:.4} signals={} changed={}",
        if is_ok { "ok" } else { "failed" },
        compared.likeness,
        compared.signals.len(),
        changed.filter(|one| one.likeness.is_some()).count()
    );
    if !is_ok {
        let _ = write!(text, " limits={}", done.breaches.len());
    }
    if let Some(page) = &done.page {
        let _ = write!(text, " page={}", page.display());
    }
    text.push('\n');
    text
}

/// The result of a fit, for people.
fn fit(text: &mut String, file: &FitFile, fitted: &Fitted) {
    let parameters = file.parameters.iter().enumerate();
    let rows = parameters.map(|(index, parameter)| {
        vec![
            printable(&parameter.name),
            short(parameter.was),
            short(fitted.values[index]),
            printable(&parameter.unit),
        ]
    });
    let headings = ["Parameter", "Was", "Is", "Unit"];
    text.push_str(&aligned(&headings, &rows.collect::<Vec<_>>()));
    for line in remarks(file, fitted) {
        let _ = writeln!(text, "{line}");
    }
    let (before, now) = (fitted.before, fitted.compared.likeness);
    let _ = writeln!(text, "fit: likeness {before:.4} before, {now:.4} now\n");
}

/// The cautions that belong to the values.
fn remarks(file: &FitFile, fitted: &Fitted) -> Vec<String> {
    let name = |index: usize| printable(&file.parameters[index].name);
    let flat = fitted.flat.iter().map(|index| {
        let name = name(*index);
        format!("\"{name}\" has no influence on the compared signals; its value was left as it is")
    });
    let bounds = file
        .parameters
        .iter()
        .zip(&fitted.values)
        .filter_map(|(parameter, value)| {
            let near = (parameter.to - parameter.from) * 1e-3;
            let is_at =
                (value - parameter.from).abs() < near || (value - parameter.to).abs() < near;
            let name = printable(&parameter.name);
            is_at.then(|| format!("\"{name}\" is at its bound; the right value may be beyond it"))
        });
    let (failed, why) = &fitted.failed;
    let failed =
        (*failed > 0).then(|| format!("{failed} runs failed, such as with: {}", printable(why)));
    flat.chain(bounds).chain(failed).collect()
}

/// The document of `--json`.
pub(super) fn document(done: &Done) -> Value {
    let compared = &done.compared;
    let signals: Vec<Value> = compared.signals.iter().map(signal).collect();
    let breaches = done.breaches.iter().map(|breach| {
        json!({ "file": breach.file, "line": breach.place.0, "column": breach.place.1, "what": breach.what })
    });
    let mut document = json!({
        "ok": done.breaches.is_empty(),
        "likeness": compared.likeness,
        "window_ns": done.options.window.0,
        "shift_ns": done.options.moved.0,
        "signals": signals,
        "only_real": compared.only_real,
        "only_simulated": compared.only_simulated,
        "notes": compared.notes,
        "exceeded": breaches.collect::<Vec<_>>(),
        "steps": compared.steps.as_ref().map(steps),
        "page": done.page.as_ref().map(|page| page.display().to_string()),
    });
    if let Some((file, fitted)) = &done.fitted {
        let parameters = file
            .parameters
            .iter()
            .enumerate()
            .map(|(index, parameter)| {
                json!({
                    "name": parameter.name,
                    "unit": parameter.unit,
                    "was": parameter.was,
                    "value": fitted.values[index],
                })
            });
        document["fit"] = json!({
            "likeness_before": fitted.before,
            "parameters": parameters.collect::<Vec<_>>(),
            "remarks": remarks(file, fitted),
        });
    }
    document
}

fn signal(signal: &SignalResult) -> Value {
    let edges = |edges: &[Edge]| -> Vec<Value> {
        let edge = |edge: &Edge| json!({ "at_ns": edge.at.0, "rises": edge.rises });
        edges.iter().map(edge).collect()
    };
    let mut value = match &signal.outcome {
        Outcome::Bool(found) => json!({
            "kind": "bool",
            "rises": differences(found, true),
            "falls": differences(found, false),
            "missing": edges(&found.missing),
            "extra": edges(&found.extra),
        }),
        Outcome::Number(found) => json!({
            "kind": "number",
            "shift_ns": found.shift.0,
            "rms": found.rms,
            "greatest": found.greatest,
            "greatest_at_ns": found.at.0,
            "range": found.range,
        }),
    };
    value["name"] = json!(signal.name);
    value["unit"] = json!(signal.unit);
    value["likeness"] = json!(signal.likeness);
    value
}

fn differences(found: &BoolResult, rises: bool) -> Option<Value> {
    let found = found.differences(rises)?;
    Some(json!({
        "pairs": found.pairs,
        "median_ns": found.median.0,
        "spread_ns": found.spread.0,
        "worst_ns": found.worst.0.0,
        "worst_at_ns": found.worst.1.0,
    }))
}

fn steps(steps: &Steps) -> Value {
    let time = |time: Option<Nanos>| time.map(|time| time.0);
    let rows = steps.rows.iter().map(|row| {
        json!({
            "number": row.number,
            "real": row.real.0,
            "real_ns": time(row.real.1),
            "simulated": row.simulated.0,
            "simulated_ns": time(row.simulated.1),
            "difference_ns": time(row.difference()),
        })
    });
    json!({ "signal": steps.signal, "rows": rows.collect::<Vec<_>>() })
}
