//! The branches in the statements of a block, and the text that counts them.

use std::fmt::Write as _;
use std::ops::Range;

use super::code::Code;
use super::lexer::Kind;

/// One way through a decision: a part of `IF` or `CASE`, also the one that is not written, or the inside of a loop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Branch {
    /// The line in the source, from 1.
    pub line: usize,
    /// The keyword at which the branch begins: `IF`, `ELSIF`, `ELSE`, `CASE 1, 2`, `FOR`, `WHILE`; `END_IF without ELSE`
    /// and `END_CASE without ELSE` if the source does not have it.
    pub label: String,
    /// The byte offset at which the branch begins.
    at: usize,
    /// True if an `ELSE` has to be written first.
    is_silent: bool,
}

/// An open statement.
enum Open {
    /// `IF` or `CASE`; true if it has an `ELSE`.
    Decision(bool),
    Loop,
}

/// The branches of the statements in `body`. Loops are counted once, when they are entered.
pub(crate) fn branches(code: &Code<'_>, body: &Range<usize>) -> Vec<Branch> {
    let mut found: Vec<Branch> = Vec::new();
    // With the token at which the next value of a CASE can begin.
    let mut open: Vec<(Open, Option<usize>)> = Vec::new();
    let mut keyword = body.start;
    let mut add = |token: usize, label: String, at: usize, is_silent: bool| {
        let line = code.text[..code.start(token)].matches('\n').count() + 1;
        found.push(Branch {
            line,
            label,
            at,
            is_silent,
        });
    };
    for at in body.clone() {
        let word = code.capitals(at);
        match code.kind(at) {
            Some(Kind::Word) => {}
            Some(Kind::Symbol) => {
                let Some((Open::Decision(_), Some(first))) = open.last_mut() else {
                    continue;
                };
                if word == ":" {
                    let values: Vec<&str> = (*first..at).map(|at| code.word(at)).collect();
                    let values = values.join(" ").replace(" ,", ",").replace(" .. ", "..");
                    add(*first, format!("CASE {values}"), code.end(at), false);
                } else if word == ";" {
                    *first = at + 1;
                }
                continue;
            }
            _ => continue,
        }
        match word.as_str() {
            "IF" => {
                open.push((Open::Decision(false), None));
                keyword = at;
            }
            "CASE" => open.push((Open::Decision(false), None)),
            "FOR" | "WHILE" | "REPEAT" => {
                open.push((Open::Loop, None));
                keyword = at;
            }
            "ELSIF" => keyword = at,
            "OF" => {
                if let Some((_, first)) = open.last_mut() {
                    *first = Some(at + 1);
                }
            }
            "THEN" | "DO" => add(keyword, code.capitals(keyword), code.end(at), false),
            "ELSE" => {
                if let Some((Open::Decision(has_else), _)) = open.last_mut() {
                    *has_else = true;
                }
                add(at, word, code.end(at), false);
            }
            "END_IF" | "END_CASE" => {
                if let Some((Open::Decision(false), _)) = open.pop() {
                    add(at, format!("{word} without ELSE"), code.start(at), true);
                }
            }
            "END_FOR" | "END_WHILE" | "END_REPEAT" => drop(open.pop()),
            _ => {}
        }
    }
    found
}

/// The branches that one counter has, a located variable of 32 bits.
pub(crate) const BITS: usize = 32;

/// The text with a pragma in each branch that sets its bit in one of the counters, which have these addresses; lines stay
/// where they are.
pub(crate) fn counted(text: &str, branches: &[Branch], counters: &[String]) -> String {
    let mut order: Vec<(usize, &Branch)> = branches.iter().enumerate().collect();
    order.sort_by_key(|(_, branch)| branch.at);
    let (mut made, mut copied) = (String::with_capacity(text.len() * 2), 0);
    for (number, branch) in order {
        // iec2c gives the variable at %QD4 the name __QD4.
        let counter = counters[number / BITS].replace('%', "__");
        let mask = 1_u64 << (number % BITS);
        let silent = if branch.is_silent { "ELSE " } else { "" };
        made.push_str(&text[copied..branch.at]);
        let _ = write!(
            made,
            " {silent}{{extern unsigned int *{counter}; *{counter} |= {mask}u}} "
        );
        copied = branch.at;
    }
    made.push_str(&text[copied..]);
    made
}
