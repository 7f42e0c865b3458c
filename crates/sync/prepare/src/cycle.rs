//! Blocks that take the time between two calls as their input `CYCLE`, such as the `PID` of `iec2c`'s library.
//!
//! A prepared program calls them once in each step of its task, so they need no replacement. A `PID` without `CYCLE` is
//! that of CODESYS, which reads a clock.

use std::collections::HashSet;
use std::ops::Range;

use super::code::Code;
use super::duration;
use super::interface::declarations;
use super::outline::Outline;

/// The blocks that have a clock in some libraries, and `CYCLE` in others.
pub(crate) fn may_have_cycle(kind: &str) -> bool {
    kind.eq_ignore_ascii_case("PID")
}

/// The types, as tokens, of variables whose calls all set `CYCLE`.
pub(crate) fn types(code: &Code<'_>, outline: &Outline) -> HashSet<usize> {
    let mut found = HashSet::new();
    for unit in &outline.units {
        for section in &unit.sections {
            for declared in declarations(code, section.inner.clone()) {
                let kind = declared.kind.start;
                let is_cycled = |at: &usize| is_cycled(code, &unit.body, code.word(*at));
                if declared.kind.len() == 1
                    && may_have_cycle(code.word(kind))
                    && declared.names.iter().all(is_cycled)
                {
                    found.insert(kind);
                }
            }
        }
    }
    found
}

/// True if all calls of an instance in these statements set `CYCLE`, and there is one.
pub(crate) fn is_cycled(code: &Code<'_>, body: &Range<usize>, instance: &str) -> bool {
    let calls = body.clone().filter(|at| {
        code.is(*at, instance) && code.word(at + 1) == "(" && code.word(at.wrapping_sub(1)) != "."
    });
    let mut calls = calls
        .map(|at| at + 1..code.closing(at + 1, body.end))
        .peekable();
    let sets =
        |mut inner: Range<usize>| inner.any(|at| code.is(at, "CYCLE") && code.word(at + 1) == ":=");
    calls.peek().is_some() && calls.all(sets)
}

/// A literal for `CYCLE` that differs from the interval, in milliseconds, at which these statements run: its position and
/// a remark.
pub(crate) fn differing(
    code: &Code<'_>,
    body: &Range<usize>,
    interval: u32,
) -> Vec<(usize, String)> {
    let set = body
        .clone()
        .filter(|at| code.is(*at, "CYCLE") && code.word(at + 1) == ":=");
    set.filter_map(|at| {
        let literal = code.word(at + 2);
        let is_alone = matches!(code.word(at + 3), "," | ")");
        let cycle = duration::milliseconds(literal).ok().filter(|_| is_alone)?;
        (cycle != interval).then(|| {
            let remark = format!(
                "CYCLE is {literal}, and the task of this program runs it every {interval} ms: the block counts another time, \
                 with the original too"
            );
            (code.start(at), remark)
        })
    })
    .collect()
}
