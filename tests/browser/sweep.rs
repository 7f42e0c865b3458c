//! The page of a sweep in a browser: legible with 100 signals and 20 moments, and operated by keys.

use std::path::PathBuf;

use serde_json::json;
use tickbus::report::{Sweeps, Swept, SweptRow, SweptRun, write_sweeps_file};

use crate::samples::Random;
use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet};

/// 100 signals with two kinds of faults, and the line, at 20 moments.
fn sweeps() -> Sweeps {
    let mut random = Random(3);
    let moments: Vec<String> = (0..20)
        .map(|step| match step {
            7 => "LA1 position > 170 and not LA1 bottom".to_owned(),
            step => format!("Step {step}"),
        })
        .collect();
    let mut run = |name: String| {
        let (word, mark, what) = match random.below(12) {
            0 => (
                "differs",
                "differs",
                "continues differently: \"Step\" is 4 after 20ms already, without the fault after 640ms",
            ),
            1 => (
                "still",
                "still",
                "stands still: \"Step\" stays 4, 5 without the fault",
            ),
            2 => (
                "never",
                "never",
                "breaks a \"never\": \"wheel 1 turns into lift 1\" after 20ms",
            ),
            3..6 => ("told", "1510ms", "told after 1510ms"),
            _ => ("right", "ok", "continues as without the fault"),
        };
        let is_right = matches!(word, "told" | "right");
        let passes = is_right || random.below(3) > 0;
        let mark = if passes {
            mark.to_owned()
        } else {
            mark.to_uppercase()
        };
        SweptRun {
            report: (!passes && random.below(4) == 0).then(|| "kept/a%20run.html".to_owned()),
            is_accepted: passes && !is_right,
            name,
            mark,
            word,
            what: what.to_owned(),
            passes,
        }
    };
    let kinds = ["stuck-on", "stuck-off"];
    let signals = kinds.into_iter().flat_map(|kind| {
        (0..100).map(move |number| {
            (
                kind,
                format!("Station {} limit switch {number}", number / 10),
            )
        })
    });
    let rows = signals.chain([("line-down", String::new())]);
    let rows = rows.map(|(kind, subject)| SweptRow {
        kind: kind.to_owned(),
        why: if subject.ends_with('3') {
            "An operator would.".to_owned()
        } else {
            String::new()
        },
        runs: moments
            .iter()
            .map(|moment| {
                Some(run(format!("{subject} {kind} @ {moment}")
                    .trim()
                    .to_owned()))
            })
            .collect(),
        subject,
    });
    Sweeps {
        title: "Sweep of examples/line/line.toml".to_owned(),
        hash: "7978281a07d8ca4d".to_owned(),
        files: vec![Swept {
            file: "examples/line/line.toml".to_owned(),
            again: "tickbus test examples/line/line.toml --only \"{}\"".to_owned(),
            rows: rows.collect(),
            moments,
        }],
    }
}

#[test]
fn the_page_of_a_sweep_is_legible_and_operated_by_keys() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("sweep.html");
    write_sweeps_file(&sweeps(), &page).expect("the page");
    let shots = std::env::var_os("TICKBUS_SCREENSHOTS").map(PathBuf::from);
    let page = std::env::var_os("TICKBUS_SWEEP").map_or(page, PathBuf::from);
    let browser = Browser::start(1280, 900);
    for (name, width, height, scheme) in [
        ("sweep-phone", 390, 844, "light"),
        ("sweep-dark", 1280, 900, "dark"),
        ("sweep", 1280, 900, "light"),
    ] {
        browser.resize(width, height);
        let scheme = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        browser.devtools("Emulation.setEmulatedMedia", &scheme);
        browser.open(&page);
        assert_fits(&browser);
        assert_quiet(&browser);
        shoot(
            &browser,
            shots.as_deref(),
            &format!("{name}-top.png"),
            false,
        );
        browser.run("document.querySelector('.matrix').scrollIntoView({behavior: 'instant'}); document.querySelector('.run[tabindex=\"0\"]').focus()");
        shoot(
            &browser,
            shots.as_deref(),
            &format!("{name}-matrix.png"),
            false,
        );
    }
    if std::env::var_os("TICKBUS_SWEEP").is_some() {
        return;
    }

    let number = |body: &str| browser.run(body).as_u64().expect("a number");
    assert_eq!(
        number("return document.querySelectorAll('.run').length"),
        4020
    );
    // Tab reaches one run of each table, the arrow keys the others.
    assert_eq!(
        number("return document.querySelectorAll('.run[tabindex=\"0\"]').length"),
        3
    );
    browser.keys("\u{e015}\u{e014}\u{e014}");
    let chosen = browser.run("return [document.activeElement.dataset.name, document.querySelector('.panel').textContent]");
    assert_eq!(chosen[0], "Station 0 limit switch 1 stuck-on @ Step 2");
    let panel = chosen[1].as_str().expect("a text");
    let again = "tickbus test examples/line/line.toml --only \"Station 0 limit switch 1 stuck-on @ Step 2\"";
    assert!(panel.contains(again), "{panel}");
    browser.keys("\u{e00c}");
    assert_eq!(
        browser.run("return document.querySelector('.panel').hidden"),
        true
    );

    // The filter: by verdict, by name, and to what is to be looked at.
    let shown = "return document.querySelectorAll('td:not(.dim) > .run').length";
    let marked = "return document.querySelectorAll('.run.red').length";
    browser.run("document.getElementById('red').click()");
    assert_eq!(number(shown), number(marked));
    browser.run("document.getElementById('red').click(); document.querySelector('.legend input[value=told]').click()");
    let told = number("return document.querySelectorAll('.run[data-word=told]').length");
    assert_eq!(number(shown), 4020 - told);
    assert_eq!(
        browser.run("return document.getElementById('count').textContent"),
        format!("{} of 4020 runs", 4020 - told)
    );
    browser.run("document.getElementById('signal').focus()");
    browser.keys("switch 42");
    assert_eq!(
        number("return document.querySelectorAll('tbody tr:not([hidden]) .run').length"),
        40
    );
    assert_eq!(
        number(
            "return [...document.querySelectorAll('.kind')].filter((kind) => !kind.hidden).length"
        ),
        2
    );

    // Texts can be read on their colours, in light and in dark.
    for scheme in ["light", "dark"] {
        let scheme = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        browser.devtools("Emulation.setEmulatedMedia", &scheme);
        browser.open(&page);
        let worst = browser.run(
            "const light = (text) => {
               const [r, g, b] = text.match(/[\\d.]+/g).map(Number).map((c) => c / 255).map((c) => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
               return 0.2126 * r + 0.7152 * g + 0.0722 * b;
             };
             return Math.min(...['right', 'accepted', 'red'].map((state) => {
               const style = getComputedStyle(document.querySelector(`.run.${state}`));
               const [a, b] = [light(style.color), light(style.backgroundColor)].sort((a, b) => b - a);
               return (a + 0.05) / (b + 0.05);
             }))",
        );
        assert!(
            worst.as_f64().is_some_and(|ratio| ratio >= 4.5),
            "{scheme}: {worst}"
        );
    }
    assert_quiet(&browser);
}
