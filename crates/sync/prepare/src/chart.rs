//! Sequential function charts in text: steps, transitions and actions.

use std::ops::Range;

use super::code::Code;

/// A chart. Numbers and ranges count tokens.
#[derive(Debug, Default)]
pub(crate) struct Chart {
    pub(crate) steps: Vec<usize>,
    /// The action and its qualifier in a step.
    pub(crate) associations: Vec<(usize, Option<usize>)>,
    pub(crate) transitions: Vec<Transition>,
    /// The name of an action, and its statements.
    pub(crate) actions: Vec<(usize, Range<usize>)>,
    /// The first token that belongs to no part of the chart.
    pub(crate) stray: Option<usize>,
}

/// `TRANSITION FROM one TO two := condition; END_TRANSITION`
#[derive(Debug)]
pub(crate) struct Transition {
    /// `TRANSITION`.
    pub(crate) start: usize,
    /// The condition; `None` if it is not in Structured Text.
    pub(crate) condition: Option<Range<usize>>,
}

/// True if a body is a chart.
pub(crate) fn is_chart(code: &Code<'_>, body: &Range<usize>) -> bool {
    is_element(code, body.start, body.end)
}

/// True if a step, transition or action begins here, and not a variable of such a name.
fn is_element(code: &Code<'_>, at: usize, end: usize) -> bool {
    if at >= end {
        return false;
    }
    if code.is(at, "TRANSITION") {
        let is_priority = code.word(at + 1) == "(" && code.is(at + 2, "PRIORITY");
        return is_priority || code.is_word(at + 1);
    }
    code.is_any(at, &["INITIAL_STEP", "STEP", "ACTION"])
        && code.is_word(at + 1)
        && code.word(at + 2) == ":"
}

/// Reads a chart, skipping unreadable text within its parts, which a compiler refuses.
pub(crate) fn chart(code: &Code<'_>, body: &Range<usize>) -> Chart {
    let mut found = Chart::default();
    let mut at = body.start;
    while at < body.end {
        let end = |word: &str| (at..body.end).find(|at| code.is(*at, word));
        if !is_element(code, at, body.end) {
            if code.word(at) != ";" {
                found.stray.get_or_insert(at);
            }
            at += 1;
            continue;
        }
        let next = match code.capitals(at).as_str() {
            "INITIAL_STEP" | "STEP" => {
                let end = end("END_STEP").unwrap_or(body.end);
                found.steps.push(at + 1);
                associations(code, at + 3..end, &mut found.associations);
                end
            }
            "TRANSITION" => {
                let end = end("END_TRANSITION").unwrap_or(body.end);
                let mut inner = at + 1..end;
                // The := of (PRIORITY := 1) is in brackets, and before FROM.
                let from = inner.find(|at| code.is(*at, "FROM")).unwrap_or(end);
                let assign = (from..end).find(|at| code.word(*at) == ":=");
                let condition = assign.map(|assign| assign + 1..end);
                let condition = condition
                    .filter(|condition| condition.len() > 1 && code.word(condition.end - 1) == ";");
                found.transitions.push(Transition {
                    start: at,
                    condition: condition.map(|condition| condition.start..condition.end - 1),
                });
                end
            }
            _ => {
                let end = end("END_ACTION").unwrap_or(body.end);
                found.actions.push((at + 1, (at + 3).min(end)..end));
                end
            }
        };
        at = next + 1;
    }
    found
}

/// `action(N);`, `action(L, T#5s);`, `action;`
fn associations(code: &Code<'_>, inner: Range<usize>, found: &mut Vec<(usize, Option<usize>)>) {
    let mut at = inner.start;
    while at < inner.end {
        if code.is_word(at) {
            let qualifier = (code.word(at + 1) == "(").then_some(at + 2);
            found.push((at, qualifier));
        }
        while at < inner.end && code.word(at) != ";" {
            at += 1;
        }
        at += 1;
    }
}
