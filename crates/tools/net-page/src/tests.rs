use std::sync::Arc;

use serde_json::{Value as Json, json};
use tickbus_base::time::{Manual, Monotonic, Nanos};
use tickbus_web::Site;

use crate::page::Hall;
use crate::{NetPage, Wanted};

const SVG: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"net\" width=\"9\" height=\"9\" viewBox=\"0 0 9 9\"><g class=\"net-place\" \
     data-place=\"0\"><title>a &lt;b&gt;</title><circle r=\"3\"/><g class=\"net-tokens\"/></g></svg>";

fn layout(svg: &str) -> String {
    let part = json!({ "text": "Guard is on", "input": "Guard" });
    json!({
        "dots": [[], [0, 0]],
        "nets": [{
            "name": "press <1>",
            "svg": svg,
            "places": ["a <b>"],
            "transitions": [{ "name": "start", "parts": [part] }],
            "inputs": ["Guard"],
        }],
    })
    .to_string()
}

fn state() -> Json {
    json!({
        "scans": 7, "us": 5_000_000, "tokens": [1], "phases": "2", "failed": { "0": 0 }, "fired": [3],
        "last": [4_000_000], "in": [0],
    })
}

fn states(state: &Json) -> String {
    json!({ "nets": [state] }).to_string()
}

fn page() -> (NetPage, Arc<Manual>) {
    let clock = Manual::new();
    clock.advance(Nanos::from_secs(100));
    (NetPage::new(Arc::<Manual>::clone(&clock)), clock)
}

impl NetPage {
    fn seen(&self) -> Json {
        serde_json::from_str(&Hall::look(&self.0)()).expect("JSON")
    }
}

#[test]
fn a_state_is_wanted_only_while_somebody_looks_and_at_most_thirty_times_a_second() {
    let (page, clock) = page();
    let nets = page.join("The press");
    nets.draw(&layout(SVG)).expect("a drawing");
    assert_eq!(nets.wanted(Nanos::ZERO), Wanted::No, "nobody looks");
    page.seen();
    let mut count = 0;
    for _ in 0..1000 {
        clock.advance(Nanos::from_millis(1));
        page.seen();
        if nets.wanted(Nanos::ZERO) == Wanted::Yes {
            nets.put(&states(&state())).expect("a state");
            count += 1;
        }
    }
    assert!((28..=31).contains(&count), "{count}");
    clock.advance(Nanos::from_secs(3));
    assert_eq!(nets.wanted(Nanos::ZERO), Wanted::No, "the viewer has gone");
}

#[test]
fn viewers_get_the_newest_state_and_none_from_before_they_came() {
    let (page, clock) = page();
    let nets = page.join("The press");
    assert_eq!(
        page.seen()["sets"],
        json!([{ "id": 1, "title": "The press", "drawn": false, "age": 0, "nets": null }])
    );
    nets.draw(&layout(SVG)).expect("a drawing");
    // A line end in an event would break it.
    nets.put(&format!("\n{:#}\n", json!({ "nets": [state()] })))
        .expect("a state");
    let json = Hall::look(&page.0)();
    assert!(!json.contains('\n'), "{json}");
    let seen = page.seen();
    assert_eq!(seen["sets"][0]["nets"][0]["scans"], 7);
    assert_eq!(seen["sets"][0]["drawn"], true);
    clock.advance(Nanos::from_millis(1900));
    assert_eq!(page.seen()["sets"][0]["age"], 1, "in whole seconds");
    clock.advance(Nanos::from_secs(3600));
    assert_eq!(page.seen()["sets"][0]["nets"], Json::Null);
    assert_eq!(nets.wanted(Nanos::ZERO), Wanted::Yes);
}

#[test]
fn programs_come_and_go_and_each_has_its_own_layout() {
    let (page, _) = page();
    let (one, two) = (page.join("One"), page.join("Two"));
    two.draw(&layout(SVG)).expect("a drawing");
    assert!(page.0.layout(1).is_none() && page.0.layout(2).is_some());
    drop(one);
    let three = page.join("Three");
    let ids: Vec<Json> = page.seen()["sets"]
        .as_array()
        .expect("sets")
        .iter()
        .map(|set| set["id"].clone())
        .collect();
    assert_eq!(ids, [2, 3], "no number is given twice");
    two.leave();
    assert_eq!(two.wanted(Nanos::from_secs(60)), Wanted::Over);
    assert!(
        two.put(&states(&state()))
            .is_err_and(|why| why.contains("open them again"))
    );
    drop(three);
    assert_eq!(page.seen()["sets"], json!([]));
}

#[test]
fn a_program_that_waits_for_viewers_learns_of_them_and_of_its_end() {
    let page = NetPage::new(Monotonic::shared());
    let nets = page.join("The press");
    std::thread::scope(|scope| {
        let waiting = scope.spawn(|| nets.wanted(Nanos::from_secs(60)));
        while !waiting.is_finished() {
            page.seen();
            std::thread::yield_now();
        }
        assert_eq!(waiting.join().expect("no panic"), Wanted::Yes);
    });
    let other = page.join("Other");
    std::thread::scope(|scope| {
        nets.draw(&layout(SVG)).expect("a drawing");
        let waiting = scope.spawn(|| other.wanted(Nanos::from_secs(60)));
        other.leave();
        assert_ne!(waiting.join().expect("no panic"), Wanted::No);
    });
}

#[test]
fn only_shapes_and_texts_are_drawings() {
    let (page, _) = page();
    let inside = |text: &str| SVG.replace("<title>", &format!("{text}<title>"));
    for (svg, what) in [
        (
            inside("<script>alert(1)</script>"),
            "has the element <script>",
        ),
        (
            inside("<style>body{display:none}</style>"),
            "has the element <style>",
        ),
        (
            inside("<foreignObject/>"),
            "has the element <foreignObject>",
        ),
        (
            inside("<image href=\"http://evil.example\"/>"),
            "has the element <image>",
        ),
        (
            inside("<p xmlns=\"http://www.w3.org/1999/xhtml\"/>"),
            "has the element <p>",
        ),
        (
            inside("<rect xmlns=\"http://www.w3.org/1999/xhtml\"/>"),
            "has the element <rect>",
        ),
        (
            inside("<rect onclick=\"alert(1)\"/>"),
            "has the attribute onclick of <rect>",
        ),
        (
            inside("<rect style=\"position:fixed\"/>"),
            "has the attribute style of <rect>",
        ),
        (
            inside("<rect id=\"link\"/>"),
            "has the attribute id of <rect>",
        ),
        (
            SVG.replace("data-place=\"0\"", "data-place=\"1\""),
            "data-place=\"1\"; expected a number below 1",
        ),
        (
            SVG.replace("data-place=\"0\"", "data-transition=\"-1\""),
            "data-transition=\"-1\"",
        ),
        (SVG.replace("</svg>", ""), "is not SVG"),
        (
            format!("<!DOCTYPE svg [<!ENTITY a \"b\">]>{SVG}"),
            "is not SVG",
        ),
        ("<p/>".to_owned(), "begins with <p>; expected <svg>"),
    ] {
        let why = page.join("t").draw(&layout(&svg)).expect_err(&svg);
        assert!(
            why.contains("\"press <1>\"") && why.contains(what),
            "{svg}: {why}"
        );
    }
}

#[test]
fn json_that_does_not_fit_is_refused_and_says_where() {
    let (page, _) = page();
    let nets = page.join("The press");
    let refused = |outcome: Result<(), String>, what: &str| {
        let why = outcome.expect_err(what);
        assert!(why.contains(what), "{what}: {why}");
    };
    refused(nets.put(&states(&state())), "not drawn yet");
    refused(nets.draw("{\"nets\":[{]}"), "column 11");
    refused(
        nets.draw("{\"nets\":[],\"evil\":1}"),
        "unknown field `evil`",
    );
    refused(
        nets.draw(&" ".repeat(33 << 20)),
        "bytes, and the most is 33554432",
    );
    let nets = page.join("The press");
    nets.draw(&layout(SVG)).expect("a drawing");
    refused(nets.draw(&layout(SVG)), "drawn already");
    refused(nets.put("{\"nets\":[]}"), "there are 0; expected 1");
    refused(nets.put("[]"), "docs/petri.md");
    refused(
        nets.put(&"[".repeat(5 << 20)),
        "bytes, and the most is 4194304",
    );
    for (key, value, what) in [
        ("tokens", json!([1, 2]), "has 2 \"tokens\"; expected 1"),
        ("tokens", json!([-1]), "invalid value"),
        ("phases", json!(""), "has 0 \"phases\""),
        ("phases", json!("4"), "other phases"),
        ("fired", json!([]), "has 0 \"fired\""),
        ("last", json!([1, 2]), "has 2 \"last\""),
        ("in", json!([]), "has 0 \"in\""),
        ("out", json!([1]), "has 1 \"out\"; expected 0"),
        ("young", json!({ "1": 1 }), "the number 1 in \"young\""),
        ("due", json!({ "1": 1 }), "the number 1 in \"due\""),
        ("failed", json!({ "7": 1 }), "the number 7 in \"failed\""),
    ] {
        let mut state = state();
        state[key] = value;
        refused(nets.put(&states(&state)), what);
    }
    nets.put("{\"nets\":[null]}")
        .expect("a net that was not scanned");
}

#[test]
fn the_page_has_its_files_and_they_are_small() {
    let (page, _) = page();
    let site: Arc<dyn Site> = page.site();
    let html = site.assets()[0].text;
    for asset in &site.assets()[1..] {
        let is_named = html.contains(&format!("\"{}\"", asset.path));
        assert!(is_named, "{} is not in the page", asset.path);
    }
    let size: usize = site.assets().iter().map(|asset| asset.text.len()).sum();
    assert!(size <= 60_000, "{size} bytes");
}
