//! The page as a whole.

use std::fmt::Write as _;
use std::io::{self, Write};

use maud::{Markup, html};

use super::html::{Json, count, counted, digits, printable, span};
use super::spans::{self, Span};
use super::tables::{self, Scale};
use super::{MarkKind, MoreTable, Run, RunStatistics, SignalKind, code, figures, time};
use tickbus_base::time::Nanos;

const TEMPLATE: &str = include_str!("template.html");
const CHART: &str = include_str!("chart.html");
/// The style of the page, for other pages with the same look.
pub const STYLE: &str = include_str!("style.css");

/// Lets a page load nothing.
const ALONE: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";

/// The head of a page without scripts, which loads nothing: with [`STYLE`], and `own_style` after it.
pub fn still_head(title: &'static str, own_style: &'static str) -> String {
    format!(
        "<head><meta charset=\"utf-8\"><meta http-equiv=\"Content-Security-Policy\" content=\"{ALONE}\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><meta name=\"color-scheme\" content=\"light dark\">\
         <link rel=\"icon\" href=\"data:,\"><title>{title}</title><style>{STYLE}{own_style}</style></head>"
    )
}
/// The script that finds values by their time. Its beginning states its needs.
pub const LOOKUP: &str = include_str!("lookup.js");
/// The script that draws signals over time, for scripts that come after [`LOOKUP`].
pub const DRAW: &str = include_str!("draw.js");
const SCRIPT: [&str; 5] = [
    LOOKUP,
    include_str!("data.js"),
    DRAW,
    include_str!("chart.js"),
    include_str!("start.js"),
];

/// The number of bars in the strip that shows where in the run changes occur.
const ACTIVITY: usize = 400;

/// The most spans drawn per band of the chart.
const MOST_SPANS: usize = 20_000;

/// The parts of a page.
#[derive(Clone, Copy, Debug)]
pub struct Contents<'a> {
    /// The heading.
    pub title: &'a str,
    /// The origin, as one line: for example the recording's file name.
    pub source: &'a str,
    /// The run.
    pub run: &'a Run,
    /// The signal whose values are step numbers; 0 means no step.
    pub steps: Option<usize>,
    /// Signals that report a fault while they are on.
    pub faults: &'a [usize],
    /// Statistics of a driver or a PLC program.
    pub statistics: Option<&'a RunStatistics>,
    /// Texts shown verbatim, each under its heading.
    pub texts: &'a [(String, String)],
    /// Tables shown before all others.
    pub tables: &'a [MoreTable],
}

/// States that last, drawn above the signals.
struct Band {
    name: String,
    kind: &'static str,
    spans: Vec<Span>,
}

/// Writes the page.
///
/// # Errors
///
/// Errors of `out`.
pub fn write(contents: &Contents<'_>, out: &mut dyn Write) -> io::Result<()> {
    let run = contents.run;
    let (begin, end) = run.extent();
    let times = run
        .signals()
        .iter()
        .flat_map(|s| s.changes().iter().map(|change| change.at));
    let scale = Scale {
        begin,
        unit: code::common_unit(begin, times.chain([end])),
    };
    let bands = bands(contents);
    fill(out, |name, out| match name {
        "title" => write_markup(html! { (contents.title) }, out),
        "source" => write_markup(html! { (contents.source) }, out),
        "facts" => write_markup(facts(contents, &bands), out),
        "chart" => out.write_all(CHART.as_bytes()),
        "sections" => write_markup(sections(contents, &bands, scale), out),
        "data" => data(contents, &bands, scale, out),
        "script" => SCRIPT
            .iter()
            .try_for_each(|part| out.write_all(part.as_bytes())),
        _ => Ok(()),
    })
}

/// Writes a page of the common form; `part` writes the part with this name.
pub(super) fn fill(
    out: &mut dyn Write,
    mut part: impl FnMut(&str, &mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut rest = TEMPLATE;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").expect("the template is whole");
        out.write_all(before.as_bytes())?;
        rest = after;
        match name {
            "version" => out.write_all(env!("CARGO_PKG_VERSION").as_bytes())?,
            "style" => {
                out.write_all(STYLE.as_bytes())?;
                part(name, out)?;
            }
            name => part(name, out)?,
        }
    }
    out.write_all(rest.as_bytes())
}

pub(super) fn write_markup(markup: Markup, out: &mut dyn Write) -> io::Result<()> {
    out.write_all(printable(markup).as_bytes())
}

fn bands(contents: &Contents<'_>) -> Vec<Band> {
    let run = contents.run;
    let mut bands = Vec::new();
    for of in spans::concerned(run, MarkKind::Link) {
        let name = if of.is_empty() {
            "Data".to_owned()
        } else {
            format!("Data, {of}")
        };
        bands.push(Band {
            name,
            kind: "link",
            spans: spans::states(run, MarkKind::Link, of),
        });
    }
    let mut faults = spans::events(run, MarkKind::Fault);
    faults.extend(
        contents
            .faults
            .iter()
            .flat_map(|signal| spans::while_on(run, *signal)),
    );
    faults.sort_by_key(|fault| fault.from);
    bands.push(Band {
        name: "Faults".to_owned(),
        kind: "fault",
        spans: faults,
    });
    bands.push(Band {
        name: "Not recorded".to_owned(),
        kind: "gap",
        spans: spans::events(run, MarkKind::Gap),
    });
    bands.push(Band {
        name: "Steps".to_owned(),
        kind: "step",
        spans: spans::steps(run, contents.steps),
    });
    bands.push(Band {
        name: "Notes".to_owned(),
        kind: "note",
        spans: spans::events(run, MarkKind::Note),
    });
    bands.retain(|band| !band.spans.is_empty());
    for band in bands
        .iter_mut()
        .filter(|band| band.spans.len() > MOST_SPANS)
    {
        let _ = write!(band.name, ", the first {}", count(MOST_SPANS as u64));
    }
    bands
}

fn of_kind<'b>(bands: &'b [Band], kind: &'b str) -> impl Iterator<Item = &'b Span> {
    bands
        .iter()
        .filter(move |band| band.kind == kind)
        .flat_map(|band| &band.spans)
}

fn facts(contents: &Contents<'_>, bands: &[Band]) -> Markup {
    let run = contents.run;
    let (begin, end) = run.extent();
    let changes: u64 = run
        .signals()
        .iter()
        .map(|signal| signal.seen().saturating_sub(1))
        .sum();
    let steps = of_kind(bands, "step").count();
    let faults = of_kind(bands, "fault").count() as u64;
    let gaps = of_kind(bands, "gap").count() as u64;
    html! {
        (fact("Simulated", &span(end - begin), ""))
        @if run.ticks() > 0 { (fact("Ticks", &count(run.ticks()), "")) }
        (fact("Signals", &count(run.signals().len() as u64), ""))
        (fact("Changes", &count(changes), ""))
        @if steps > 0 { (fact("Steps", &count(steps as u64), "")) }
        @if let Some(share) = share_good(bands) {
            @let text = format!("{} %", digits((share * 1000.0).floor() / 10.0));
            (fact("Data live", &text, if share < 1.0 { "warn" } else { "good" }))
        }
        @if faults == 0 { (fact("Faults", "none", "good")) } @else { (fact("Faults", &count(faults), "bad")) }
        @if gaps == 0 { (fact("Recording", "complete", "good")) }
        @else { (fact("Recording", &counted(gaps, "gap", "gaps"), "warn")) }
    }
}

/// A figure of the page's head.
pub(super) fn fact(name: &str, value: &str, class: &str) -> Markup {
    html! { div class=(class) { dt { (name) } dd { (value) } } }
}

/// The share of the time for which all lines were live; `None` if nothing is known about them.
#[expect(clippy::cast_precision_loss, reason = "a share, for people")]
fn share_good(bands: &[Band]) -> Option<f64> {
    let (mut good, mut all) = (0_i64, 0_i64);
    for state in of_kind(bands, "link") {
        let length = (state.until - state.from).0;
        all = all.saturating_add(length);
        let word = state.text.split(": ").next().unwrap_or_default();
        if spans::state_class(word) == "good" {
            good = good.saturating_add(length);
        }
    }
    (all > 0).then(|| good as f64 / all as f64)
}

fn sections(contents: &Contents<'_>, bands: &[Band], scale: Scale) -> Markup {
    let run = contents.run;
    let of = |kind| of_kind(bands, kind).cloned().collect::<Vec<_>>();
    let steps = of("step");
    let named = |kind, name| of(kind).into_iter().map(move |span| (name, span));
    let mut events: Vec<_> = named("fault", "Fault")
        .chain(named("gap", "Gap"))
        .chain(named("note", "Note"))
        .collect();
    events.sort_by_key(|(_, event)| event.from);
    let states = of("link");
    let distributions = contents.statistics.map(RunStatistics::distributions);
    let distributions = distributions.filter(|distributions| !distributions.is_empty());
    html! {
        @for (place, table) in contents.tables.iter().enumerate() {
            (section(&format!("table{place}"), &table.heading, &table.markup(scale)))
        }
        @if !steps.is_empty() { (section("steps", "Steps", &tables::steps(&steps, scale))) }
        (section("faults", "Faults and gaps", &html! {
            @if events.is_empty() { p { "No faults and no gaps were recorded." } }
            @else { (tables::events(&events, scale)) }
            @if run.marks_left_out() > 0 {
                p.note {
                    (counted(run.marks_left_out(), "more was", "more were"))
                    " recorded, and not taken into this report."
                }
            }
        }))
        (section("link", "State of the line", &html! {
            @if let Some(statistics) = contents.statistics { (line(statistics)) (traffic(statistics)) }
            @if !states.is_empty() { (tables::states(&states, scale)) }
        }))
        (section("timing", "Time", &html! {
            @if let Some(statistics) = contents.statistics {
                (time::table(statistics))
                (swallowed(statistics))
            }
            @if let Some((intervals, shortest, longest)) = run.intervals() {
                h3 { "From one tick to the next, in simulation time" }
                (figures::histogram("interval", intervals, shortest, longest))
            }
            @if let Some(distributions) = &distributions {
                h3 { "Distributions from the statistics" }
                (tables::distributions(distributions))
            }
        }))
        @for (place, (heading, text)) in contents.texts.iter().enumerate() {
            (section(&format!("text{place}"), heading, &html! { pre tabindex="0" { (text.trim_end()) } }))
        }
        (section("figures", "In figures", &figures_of_signals(contents)))
    }
}

/// A section, if there is anything in it.
fn section(id: &str, heading: &str, inner: &Markup) -> Markup {
    html! {
        @if !inner.0.is_empty() { section id=(id) { h2 { (heading) } (inner) } }
    }
}

/// The final state of the line according to the statistics.
fn line(statistics: &RunStatistics) -> Markup {
    let Some(state) = statistics.get("state") else {
        return Markup::default();
    };
    let entered = statistics.all().iter().filter_map(|(key, value)| {
        let state = key.strip_prefix("link.")?;
        (value != "0").then(|| format!("{state} {value}"))
    });
    let entered: Vec<String> = entered.collect();
    html! {
        p {
            "At the end: " (tables::tag(state))
            @if let Some(reason) = statistics.get("reason") { " " (reason) }
            @if let Some(address) = statistics.get("address") { " (" (address) ")" }
        }
        @if !entered.is_empty() { p { "How often each state was entered: " (entered.join(", ")) "." } }
    }
}

/// The load of the cable in both directions, if the bus counts its octets.
fn traffic(statistics: &RunStatistics) -> Markup {
    let part = |way: &str| {
        let of = |key: &str| statistics.get(&format!("line.{key}"));
        let octets = of(&format!("octets_{way}"))?;
        let mut text = format!("{octets} octets {way}");
        for (key, words) in [
            (format!("kbit_{way}_per_s"), "kbit/s on the cable"),
            (format!("efficiency_{way}_percent"), "% of it process data"),
        ] {
            if let Some(number) = of(&key) {
                text = format!("{text}, {number} {words}");
            }
        }
        Some(text)
    };
    let parts: Vec<String> = ["out", "in"].into_iter().filter_map(part).collect();
    html! {
        @if !parts.is_empty() {
            p {
                "Traffic: " (parts.join("; "))
                @if let Some(share) = statistics.get("line.share_percent") { "; " (share) " % of the line's time" }
                "."
            }
        }
    }
}

/// The signals whose changes came and went before the other side took a frame, if there are any.
fn swallowed(statistics: &RunStatistics) -> Markup {
    let signals = statistics.all().iter().filter_map(|(key, value)| {
        let signal = key.strip_prefix("swallowed.")?;
        Some(format!("{signal} {value}"))
    });
    let signals: Vec<String> = signals.collect();
    html! {
        @if !signals.is_empty() {
            p { "Swallowed: changed and changed back before the other side took a frame: " (signals.join(", ")) "." }
        }
    }
}

fn figures_of_signals(contents: &Contents<'_>) -> Markup {
    let run = contents.run;
    html! {
        details {
            summary {
                (counted(run.signals().len() as u64, "signal", "signals"))
                ": changes, least, greatest, last value"
            }
            (tables::signals(run))
        }
        @if let Some(statistics) = contents.statistics.filter(|statistics| !statistics.is_empty()) {
            details {
                summary { "All statistics: " (counted(statistics.all().len() as u64, "line", "lines")) }
                (tables::statistics(statistics))
            }
        }
    }
}

/// The script's data: the run as JSON, and a packed block per signal.
fn data(
    contents: &Contents<'_>,
    bands: &[Band],
    scale: Scale,
    out: &mut dyn Write,
) -> io::Result<()> {
    let run = contents.run;
    let (begin, end) = run.extent();
    let signals = run.signals();
    let mut codings = Vec::with_capacity(signals.len());
    for (number, signal) in signals.iter().enumerate() {
        let (coding, block) = code::block(signal.changes(), begin, scale.unit);
        codings.push(coding);
        writeln!(
            out,
            "<script type=\"text/plain\" id=\"b{number}\">{block}</script>"
        )?;
    }
    write!(
        out,
        "<script type=\"application/json\" id=\"run\">{{\"begin\":\"{}\",\"unit\":{},\"end\":{},\"activity\":{:?},\n\"signals\":[",
        begin.0,
        scale.unit,
        scale.units(end),
        activity(run)
    )?;
    for (number, (signal, coding)) in signals.iter().zip(codings).enumerate() {
        let kind = match signal.kind {
            SignalKind::Bool => "bool",
            SignalKind::Real => "real",
        };
        let comma = if number > 0 { "," } else { "" };
        write!(
            out,
            "{comma}\n{{\"name\":{},\"kind\":\"{kind}\",\"unit\":{},\"count\":{},\"coding\":\"{}\"",
            Json(&signal.name),
            Json(&signal.unit),
            signal.changes().len(),
            coding.name()
        )?;
        // JSON has no infinite numbers, and a chart cannot show them.
        if let Some((low, high)) = signal
            .range()
            .filter(|(low, high)| low.is_finite() && high.is_finite())
        {
            write!(out, ",\"low\":{low:?},\"high\":{high:?}")?;
        }
        if signal.resolution() > Nanos::ZERO {
            write!(out, ",\"resolution\":{}", Json(&span(signal.resolution())))?;
        }
        out.write_all(b"}")?;
    }
    out.write_all(b"],\n\"bands\":[")?;
    for (number, band) in bands.iter().enumerate() {
        let comma = if number > 0 { "," } else { "" };
        write!(
            out,
            "{comma}\n{{\"name\":{},\"kind\":\"{}\",\"spans\":[",
            Json(&band.name),
            band.kind
        )?;
        for (number, span) in band.spans.iter().take(MOST_SPANS).enumerate() {
            let comma = if number > 0 { "," } else { "" };
            let word = span.text.split(": ").next().unwrap_or_default();
            let class = if band.kind == "link" {
                spans::state_class(word)
            } else {
                band.kind
            };
            let (from, until) = (scale.units(span.from), scale.units(span.until));
            let text = if band.kind == "link" {
                word
            } else {
                &span.text
            };
            write!(out, "{comma}[{from},{until},\"{class}\",{}]", Json(text))?;
        }
        out.write_all(b"]}")?;
    }
    out.write_all(b"]}</script>\n")
}

/// The number of changes in each of equal parts of the run.
fn activity(run: &Run) -> Vec<u64> {
    let (begin, end) = run.extent();
    let length = i128::from((end - begin).0) + 1;
    let mut bars = vec![0; ACTIVITY];
    for signal in run.signals() {
        // The first entry is the initial value, not a change.
        for change in signal.changes().iter().skip(1) {
            let bar = i128::from((change.at - begin).0) * ACTIVITY as i128 / length;
            if let Some(bar) = usize::try_from(bar).ok().and_then(|bar| bars.get_mut(bar)) {
                *bar += 1;
            }
        }
    }
    bars
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn traffic_is_told_as_far_as_the_bus_counts_it() {
        let page = |text| traffic(&RunStatistics::read(text)).into_string();
        assert_eq!(page("ticks=9\n"), "");
        let found = page("line.octets_out=36\nline.octets_in=0\n");
        assert!(
            found.contains("Traffic: 36 octets out; 0 octets in."),
            "{found}"
        );
        let found = page(
            "line.octets_out=36\nline.kbit_out_per_s=1.5\nline.efficiency_out_percent=80.0\n\
             line.octets_in=0\nline.share_percent=2.5\n",
        );
        let told = "36 octets out, 1.5 kbit/s on the cable, 80.0 % of it process data; 0 octets in; 2.5 % of the line's time.";
        assert!(found.contains(told), "{found}");
    }

    #[test]
    fn swallowed_signals_are_named_and_nothing_is_said_without_any() {
        let page = |text| swallowed(&RunStatistics::read(text)).into_string();
        assert_eq!(
            page("ticks=9\nswallowed_inputs=0\nswallowed_outputs=0\n"),
            ""
        );
        let found =
            page("swallowed_inputs=5\nswallowed_outputs=2\nswallowed.In=5\nswallowed.Out 2=2\n");
        assert!(found.contains("took a frame: In 5, Out 2 2."), "{found}");
    }
}
