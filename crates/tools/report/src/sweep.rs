//! The page of a sweep: which fault at which moment a program copes with.

use std::io::{self, Write};

use maud::{Markup, html};

use super::html::{count, counted};
use super::page::{fact, fill, write_markup};

const STYLE: &str = include_str!("sweep.css");
const SCRIPT: &str = include_str!("sweep.js");

/// The most runs in the list of those to look at. The tables have all.
const MOST_LISTED: usize = 500;

/// The verdicts, each with a sample of its cell and its meaning.
const LEGEND: [(&str, &str, &str); 6] = [
    (
        "told",
        "20ms",
        "the program tells the fault after this time",
    ),
    ("right", "ok", "the program continues as without the fault"),
    (
        "differs",
        "DIFFERS",
        "it continues in another way, or tells the fault too late",
    ),
    ("still", "STILL", "it stands still, without a word"),
    ("never", "NEVER", "it lets something happen that never may"),
    ("wrong", "WRONG", "the run could not be judged"),
];

/// The sweeps of one call.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sweeps {
    /// The heading.
    pub title: String,
    /// The hash over all verdicts, as the last line of `tickbus test` has it.
    pub hash: String,
    /// One sweep for each file.
    pub files: Vec<Swept>,
}

/// The sweep of one file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Swept {
    /// The test file, or what takes its place.
    pub file: String,
    /// The command that repeats a run, with `{}` in the place of its name.
    pub again: String,
    /// The names of the moments: the columns.
    pub moments: Vec<String>,
    /// The faults, in the order of the list; those of one kind follow each other.
    pub rows: Vec<SweptRow>,
}

/// One fault at all moments.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SweptRow {
    /// The kind of fault.
    pub kind: String,
    /// The signal or station; the line has none.
    pub subject: String,
    /// Why the verdicts were accepted; empty if nobody has said it.
    pub why: String,
    /// A run for each moment; `None` if it was not made.
    pub runs: Vec<Option<SweptRun>>,
}

/// One run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SweptRun {
    /// The name: `Level stuck-on @ Step 3`.
    pub name: String,
    /// The text of its cell, as in the matrix of `tickbus test`.
    pub mark: String,
    /// The verdict in one word, as in `accepted.toml`; or `wrong`.
    pub word: &'static str,
    /// The verdict as a sentence.
    pub what: String,
    /// True if the verdict is right, or accepted.
    pub passes: bool,
    /// True if the verdict is neither told nor right, and passes.
    pub is_accepted: bool,
    /// The address of the report about the recording of this run, as seen from the page.
    pub report: Option<String>,
}

impl Sweeps {
    fn runs(&self) -> impl Iterator<Item = (&Swept, &SweptRow, &SweptRun)> {
        self.files.iter().flat_map(|file| {
            let of_row = move |row| runs_of(row).map(move |run| (file, row, run));
            file.rows.iter().flat_map(of_row)
        })
    }
}

fn runs_of(row: &SweptRow) -> impl Iterator<Item = &SweptRun> {
    row.runs.iter().flatten()
}

/// Writes the page.
///
/// # Errors
///
/// Errors of `out`.
pub fn write_sweeps(sweeps: &Sweeps, out: &mut dyn Write) -> io::Result<()> {
    let size = |file: &Swept| {
        let faults = counted(file.rows.len() as u64, "fault", "faults");
        let moments = counted(file.moments.len() as u64, "moment", "moments");
        format!("{}: {faults} at {moments}", file.file)
    };
    let sizes: Vec<String> = sweeps.files.iter().map(size).collect();
    fill(out, |name, out| match name {
        "title" => write_markup(html! { (sweeps.title) }, out),
        "source" => write_markup(html! { (sizes.join(" · ")) }, out),
        "style" => out.write_all(STYLE.as_bytes()),
        "facts" => write_markup(facts(sweeps), out),
        "sections" => {
            write_markup(tools(sweeps), out)?;
            for file in &sweeps.files {
                write_markup(tables(file), out)?;
            }
            write_markup(to_look_at(sweeps), out)?;
            write_markup(accepted(sweeps), out)
        }
        "script" => out.write_all(SCRIPT.as_bytes()),
        _ => Ok(()),
    })
}

fn facts(sweeps: &Sweeps) -> Markup {
    let number = |wanted: &dyn Fn(&SweptRow, &SweptRun) -> bool| {
        let found = sweeps.runs().filter(|(_, row, run)| wanted(row, run));
        found.count() as u64
    };
    let failed = number(&|_, run| !run.passes);
    let without_why = number(&|row, run| run.is_accepted && row.why.is_empty());
    let accepted = count(number(&|_, run| run.is_accepted));
    let accepted = match without_why {
        0 => accepted,
        some => format!("{accepted}, {} without a reason", count(some)),
    };
    html! {
        (fact("Runs", &count(number(&|_, _| true)), ""))
        @for (word, _, _) in LEGEND {
            @let runs = number(&|_, run| run.word == word);
            @if runs > 0 || word != "wrong" { (fact(word, &count(runs), "")) }
        }
        (fact("accepted", &accepted, if without_why > 0 { "warn" } else { "" }))
        (fact("To look at", &count(failed), if failed > 0 { "bad" } else { "good" }))
        (fact("Hash", &sweeps.hash, ""))
    }
}

/// The legend, which is the filter as well.
fn tools(sweeps: &Sweeps) -> Markup {
    let is_there = |word: &str| sweeps.runs().any(|(_, _, run)| run.word == word);
    html! {
        section id="filter" {
            h2 { "Verdicts" }
            fieldset.legend {
                legend { "Show the runs in which" }
                @for (word, sample, meaning) in LEGEND {
                    @if word != "wrong" || is_there(word) {
                        label.check {
                            input type="checkbox" checked value=(word);
                            span class={ "sample " (if word == "told" || word == "right" { "right" } else { "red" }) } { (sample) }
                            span { (meaning) }
                        }
                    }
                }
            }
            p.note {
                "Capital letters, or a “!” after what is right: the verdict is not the accepted one. "
                span."sample accepted" { "differs" }
                " Small letters: the verdict was accepted."
            }
            div.tools role="toolbar" aria-label="Filter" {
                input type="search" id="signal" placeholder="Filter signals" aria-label="Filter signals by name" autocomplete="off" spellcheck="false";
                label.check { input type="checkbox" id="red"; " only those to look at" }
                output id="count" {}
            }
            noscript { p.note { "The filter needs JavaScript; all else on this page does not." } }
        }
    }
}

fn tables(file: &Swept) -> Markup {
    html! {
        section.sweep data-again=(file.again) {
            h2 { (file.file) }
            @for rows in file.rows.chunk_by(|one, next| one.kind == next.kind) {
                (table(file, rows))
            }
        }
    }
}

/// The table of one kind of fault; empty if none of its runs was made.
fn table(file: &Swept, rows: &[SweptRow]) -> Markup {
    let is_run = |row: &&SweptRow| runs_of(row).next().is_some();
    let rows: Vec<&SweptRow> = rows.iter().filter(is_run).collect();
    let kind = rows.first().map_or("", |row| row.kind.as_str());
    html! {
        @if !rows.is_empty() {
            div.kind {
                h3 { (kind) }
                div."wide matrix" {
                    table {
                        caption.visually-hidden { (kind) " of each signal, at each moment" }
                        thead {
                            tr {
                                th scope="col" { "Signal" }
                                @for moment in &file.moments { th scope="col" { (moment) } }
                            }
                        }
                        tbody {
                            @for row in rows {
                                tr data-why=[(!row.why.is_empty()).then_some(&row.why)] {
                                    th scope="row" { @if row.subject.is_empty() { "the line" } @else { (row.subject) } }
                                    @for run in &row.runs { (cell(run.as_ref())) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn cell(run: Option<&SweptRun>) -> Markup {
    let Some(run) = run else {
        return html! { td {} };
    };
    let state = if run.is_accepted {
        "accepted"
    } else if run.passes {
        "right"
    } else {
        "red"
    };
    let class = format!("run {state}");
    html! {
        td {
            @if let Some(report) = &run.report {
                a class=(class) href=(report) title=(run.what) data-word=(run.word) data-name=(run.name) { (run.mark) }
            } @else {
                button type="button" class=(class) title=(run.what) data-word=(run.word) data-name=(run.name) { (run.mark) }
            }
        }
    }
}

fn to_look_at(sweeps: &Sweeps) -> Markup {
    let failed = || sweeps.runs().filter(|(_, _, run)| !run.passes);
    let more = failed().count().saturating_sub(MOST_LISTED);
    html! {
        section id="look" {
            h2 { "To look at" }
            @if failed().next().is_none() { p { "All verdicts are right or accepted." } }
            @else {
                div.wide {
                    table {
                        thead { tr { th scope="col" { "Run" } th scope="col" { "The program" } th scope="col" { "Again" } } }
                        tbody {
                            @for (file, _, run) in failed().take(MOST_LISTED) {
                                tr {
                                    th.name scope="row" {
                                        @if let Some(report) = &run.report { a href=(report) { (run.name) } }
                                        @else { (run.name) }
                                    }
                                    td { (run.what) }
                                    td { code { (file.again.replace("{}", &run.name)) } }
                                }
                            }
                        }
                    }
                }
                @if more > 0 { p.note { (counted(more as u64, "more run is", "more runs are")) " in the tables." } }
            }
        }
    }
}

fn accepted(sweeps: &Sweeps) -> Markup {
    let rows = sweeps.files.iter().flat_map(|file| &file.rows);
    let rows = rows.filter(|row| runs_of(row).any(|run| run.is_accepted));
    let rows: Vec<&SweptRow> = rows.collect();
    html! {
        @if !rows.is_empty() {
            section id="accepted" {
                h2 { "Accepted, and why" }
                div.wide {
                    table {
                        thead { tr { th scope="col" { "Fault" } th scope="col" { "Why" } } }
                        tbody {
                            @for row in rows {
                                tr {
                                    th.name scope="row" { (row.subject) " " (row.kind) }
                                    td { @if row.why.is_empty() { "no reason is written" } @else { (row.why) } }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(name: &str, mark: &str, word: &'static str, passes: bool) -> SweptRun {
        SweptRun {
            name: name.to_owned(),
            mark: mark.to_owned(),
            word,
            what: format!("what <{name}> does"),
            passes,
            is_accepted: passes && !matches!(word, "told" | "right"),
            report: (mark == "NEVER").then(|| "kept/a%20run.html".to_owned()),
        }
    }

    fn page() -> String {
        let row = |subject: &str, why: &str, runs| SweptRow {
            kind: "stuck-on".to_owned(),
            subject: subject.to_owned(),
            why: why.to_owned(),
            runs,
        };
        let told = run("A & B stuck-on @ S > 1", "20ms", "told", true);
        let never = run("A & B stuck-on @ end", "NEVER", "never", false);
        let still = run("stuck-on @ S > 1", "still", "still", true);
        let sweeps = Sweeps {
            title: "Sweep".to_owned(),
            hash: "00ff".to_owned(),
            files: vec![Swept {
                file: "a.toml".to_owned(),
                again: "tickbus test a.toml --only \"{}\"".to_owned(),
                moments: vec!["S > 1".to_owned(), "end".to_owned()],
                rows: vec![
                    row("A & B", "", vec![Some(told), Some(never)]),
                    row("", "it is slow", vec![Some(still), None]),
                ],
            }],
        };
        let mut page = Vec::new();
        write_sweeps(&sweeps, &mut page).expect("memory");
        String::from_utf8(page).expect("text")
    }

    #[test]
    fn a_cell_has_its_words_and_opens_its_report() {
        let page = page();
        for part in [
            "<a class=\"run red\" href=\"kept/a%20run.html\" title=\"what &lt;A &amp; B stuck-on @ end&gt; does\" data-word=\"never\"",
            "<button type=\"button\" class=\"run right\" title=\"what",
            "data-word=\"told\" data-name=\"A &amp; B stuck-on @ S &gt; 1\">20ms</button>",
            "<button type=\"button\" class=\"run accepted\"",
            "<th scope=\"row\">the line</th>",
            "<td></td>",
            "<code>tickbus test a.toml --only &quot;A &amp; B stuck-on @ end&quot;</code>",
            "<td>it is slow</td>",
        ] {
            assert!(page.contains(part), "{part}\n{page}");
        }
        assert!(!page.contains("{{"), "every part of the page is filled");
    }

    #[test]
    fn the_head_counts() {
        let page = page();
        for (name, value) in [
            ("Runs", "3"),
            ("told", "1"),
            ("right", "0"),
            ("never", "1"),
            ("accepted", "1"),
            ("To look at", "1"),
            ("Hash", "00ff"),
        ] {
            let fact = format!("<dt>{name}</dt><dd>{value}</dd>");
            assert!(page.contains(&fact), "{fact}");
        }
        assert!(!page.contains("<dt>wrong</dt>"), "nothing was wrong");
    }
}
