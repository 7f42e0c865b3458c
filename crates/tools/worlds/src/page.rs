//! The page of a run: its figures, the features that have met, and the findings.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use tickbus_report::still_head;

use crate::pairs::{never_meet, possible};
use crate::plan::all_features;
use crate::run::{Finding, Run};

const OWN_STYLE: &str = include_str!("page.css");

/// The number of findings that the page shows. Otherwise a defect that breaks every world would fill it.
const SHOWN: usize = 200;

/// A run and its circumstances.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// The run.
    pub run: &'a Run,
    /// The number of the first seed.
    pub first: u64,
    /// The duration of the run, in seconds.
    pub seconds: f64,
    /// The number of threads.
    pub processors: usize,
    /// The commit that was run, if known.
    pub commit: Option<&'a str>,
}

impl Page<'_> {
    /// The page as HTML. The page loads nothing.
    #[must_use]
    pub fn html(&self) -> String {
        let title = "Simulated worlds";
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                (PreEscaped(still_head(title, OWN_STYLE)))
                body {
                    header {
                        h1 { (title) }
                        p.source {
                            "Each world is two drivers and the line between them, drawn from a seed and judged against the promises of \
                             docs/testing-tickbus.md."
                        }
                        dl.facts { (self.facts()) }
                    }
                    main {
                        section id="findings" { h2 { "Broken promises" } (self.findings()) }
                        section id="pairs" { h2 { "Features that have met" } (self.pairs()) }
                    }
                    footer { p { "This file is complete: it loads nothing, and sends nothing." } }
                }
            }
        };
        printable(page)
    }

    fn facts(&self) -> Markup {
        let Self { run, .. } = *self;
        let failed = run.findings.len();
        let verdict = if failed == 0 { "good" } else { "bad" };
        #[expect(clippy::cast_precision_loss, reason = "a rate for people")]
        let rate = run.worlds as f64 / self.seconds;
        html! {
            div class=(verdict) { dt { "Broken promises" } dd { (grouped(failed as u64)) } }
            div { dt { "Worlds" } dd { (grouped(run.worlds)) } }
            div { dt { "Worlds per second" } dd { (format!("{rate:.0}")) } }
            div { dt { "Seconds" } dd { (format!("{:.0}", self.seconds)) } }
            div { dt { "Processors" } dd { (self.processors) } }
            div { dt { "First seed" } dd { (self.first) } }
            @if let Some(commit) = self.commit { div { dt { "Commit" } dd { (commit) } } }
            div { dt { "Pairs that met" } dd { (grouped(run.pairs.met() as u64)) " of " (grouped(possible() as u64)) } }
        }
    }

    fn findings(&self) -> Markup {
        let findings = &self.run.findings;
        let hidden = findings.len().saturating_sub(SHOWN);
        html! {
            @if findings.is_empty() { p { "None." } }
            @for found in findings.iter().take(SHOWN) { (finding(found)) }
            @if hidden > 0 { p { "The output of the run has " (grouped(hidden as u64)) " more." } }
        }
    }

    fn pairs(&self) -> Markup {
        let features = all_features();
        let strangers = self.run.pairs.strangers();
        html! {
            p.note {
                "Each cell is the number of worlds that had the feature of its row and that of its column. Columns are named on the diagonal. \
                 The tooltip of a cell has both names and the exact count."
            }
            ul.key {
                @for (level, least) in LEVELS.iter().enumerate() {
                    li { span class=(format!("h{}", level + 1)) { (short(*least)) } "or more" }
                }
                li { span.never { "0" } "can meet and have not" }
                li { span.no { "·" } "no world has both" }
            }
            div.pairs tabindex="0" role="region" aria-label="Pairs of features" {
                table {
                    tbody {
                        @for (row, name) in features.iter().enumerate() {
                            tr {
                                th scope="row" { (name) }
                                @for other in &features[..row] { (self.cell(other, name)) }
                                td.name colspan=(features.len() - row) aria-hidden="true" { (name) }
                            }
                        }
                    }
                }
            }
            @if !strangers.is_empty() {
                details {
                    summary { (grouped(strangers.len() as u64)) " pairs can meet and have not" }
                    ul.list { @for [one, other] in strangers { li { (one) " + " (other) } } }
                }
            }
        }
    }

    fn cell(&self, one: &str, other: &str) -> Markup {
        let count = self.run.pairs.count(one, other);
        let title = format!("{one} + {other}: ");
        match never_meet(one, other) {
            Some(why) if count == 0 => html! { td.no title={ (title) "never, " (why) } { "·" } },
            _ if count == 0 => html! { td.never title={ (title) "0" } { "0" } },
            _ => {
                html! { td class=(level(count)) title={ (title) (grouped(count)) } { (short(count)) } }
            }
        }
    }
}

fn finding(found: &Finding) -> Markup {
    html! {
        article.finding {
            h3 { (found.broken.promise) }
            p { (found.broken.what) }
            dl {
                dt { "Seed" } dd { (found.seed.to_string()) }
                dt { "Smaller" } dd { (found.small.to_string()) }
                dt { "Features" } dd { (found.features.join(", ")) }
            }
            pre { "cargo run --release -p tickbus-worlds -- " (found.small.to_string()) }
        }
    }
}

/// The counts at which a cell gets the next colour.
const LEVELS: [u64; 5] = [1, 10, 100, 1_000, 10_000];

/// The class of a cell with a count that is not 0.
fn level(count: u64) -> String {
    format!("h{}", LEVELS.partition_point(|least| *least <= count))
}

/// A count in at most four characters, rounded down.
fn short(count: u64) -> String {
    match count {
        0..1_000 => count.to_string(),
        1_000..1_000_000 => format!("{}k", count / 1_000),
        _ => format!("{}M", count / 1_000_000),
    }
}

/// A count with thousands separators.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (at, digit) in digits.char_indices() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// The text of `markup`. HTML permits no control characters, not even escaped.
fn printable(markup: Markup) -> String {
    let is_control = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    markup.into_string().replace(is_control, "\u{fffd}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::broken::Broken;
    use crate::plan::Plan;

    fn page(run: &Run) -> String {
        let page = Page {
            run,
            first: 4711,
            seconds: 10.0,
            processors: 2,
            commit: Some("abc<def"),
        };
        page.html()
    }

    #[test]
    fn what_was_found_is_escaped_and_can_be_repeated() {
        let mut run = Run {
            worlds: 12_340,
            ..Run::default()
        };
        let broken = Broken {
            promise: "torn",
            what: "<script>alert(1)</script> & \u{1b} \"Some(1)\"".to_owned(),
        };
        run.findings.push(Finding {
            broken,
            seed: 4711.into(),
            small: "4711/3:3ff:5".parse().expect("a seed"),
            features: vec!["socket", "killed"],
        });
        let page = page(&run);
        assert!(!page.contains("<script"), "a script");
        for part in [
            "&lt;script&gt;alert(1)&lt;/script&gt; &amp; \u{fffd}",
            "abc&lt;def",
            "<h3>torn</h3>",
            "<dd>4711</dd>",
            "<dd>socket, killed</dd>",
            "<pre>cargo run --release -p tickbus-worlds -- 4711/3:3ff:5</pre>",
            "<dd>12,340</dd>",
            "<dd>1234</dd>",
        ] {
            assert!(page.contains(part), "{part} in {page}");
        }
        assert!(!page.contains("http://") && !page.contains("https://"));
    }

    #[test]
    fn cells_have_counts_and_say_who_cannot_meet() {
        let mut run = Run::default();
        let plan = Plan::draw(4711);
        let features = plan.features();
        for _ in 0..1_234 {
            run.pairs.add(&plan);
        }
        let page = page(&run);
        let count = |part: &str| page.matches(part).count();
        let pairs = features.len() * (features.len() - 1) / 2;
        assert_eq!(count(">1k</td>"), pairs);
        assert_eq!(count(": 1,234\""), pairs);
        assert_eq!(count("<td class=\"never\""), possible() - pairs);
        assert!(page.contains("title=\"loopback + socket: never, a world has one bus\">·"));
    }
}
