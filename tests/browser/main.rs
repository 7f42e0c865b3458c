//! The report in a browser: checks that it shows the recorded data, and can be operated.
//!
//! Not part of a plain `cargo test`, because it needs Chromium and chromedriver: `cargo test --test browser`
//! runs it, and so does `make test` if both are installed.

mod samples;
mod sweep;
#[allow(dead_code, reason = "the live page's tests use the rest")]
mod webdriver;

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;

use serde_json::json;
use tickbus::report::{self, Contents, MarkKind, Run, RunStatistics, SignalKind};
use tickbus::time::Nanos;
use webdriver::{Browser, save, shoot};

struct Page {
    folder: tempfile::TempDir,
}

impl Page {
    fn of(contents: &Contents<'_>) -> Self {
        let folder = tempfile::tempdir().expect("there is room for a page");
        let page = Self { folder };
        let mut file = BufWriter::new(File::create(page.path()).expect("there is room for a page"));
        report::write(contents, &mut file).expect("there is room for a page");
        page
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("a report.html")
    }
}

fn contents(run: &Run) -> Contents<'_> {
    Contents {
        title: "Test",
        source: "run.vcd",
        run,
        steps: run.signal("Step"),
        faults: &[],
        statistics: None,
        texts: &[],
        tables: &[],
    }
}

/// Opens a report and waits until all signals are unpacked.
fn open(browser: &Browser, page: &Page) {
    browser.open(&page.path());
    browser.wait("window.tickbusReport.isIdle()");
}

fn view(browser: &Browser) -> (f64, f64) {
    let view = browser.run("return tickbusReport.view()");
    let number = |key: &str| view[key].as_f64().expect("a view has two numbers");
    (number("from"), number("to"))
}

#[track_caller]
fn assert_quiet(browser: &Browser) {
    assert_eq!(browser.complaints(), Vec::<String>::new());
    let loaded =
        browser.run("return performance.getEntriesByType('resource').map((entry) => entry.name)");
    assert_eq!(loaded, json!([]), "the page loads nothing");
}

/// Compares everything that a page knows about a run with the run.
#[track_caller]
fn assert_same(browser: &Browser, run: &Run) {
    for (number, signal) in run.signals().iter().enumerate() {
        let found = browser.run(&format!(
            "const {{ times, values }} = await tickbusReport.changes({number});
             return [tickbusReport.signals[{number}], times, values.map((value) => Object.is(value, -0) ? '-0' : String(value))];"
        ));
        assert_eq!(found[0], *signal.name);
        let list = |place: usize| {
            found[place]
                .as_array()
                .expect("a list")
                .iter()
                .map(|v| v.as_str().expect("a text"))
        };
        let times: Vec<i64> = list(1).map(|time| time.parse().expect("a time")).collect();
        let values: Vec<u64> = list(2)
            .map(|v| bits(v.replace("Infinity", "inf").parse().expect("a number")))
            .collect();
        let changes = signal.changes();
        assert_eq!(
            times,
            changes.iter().map(|change| change.at.0).collect::<Vec<_>>(),
            "{}",
            signal.name
        );
        assert_eq!(
            values,
            changes
                .iter()
                .map(|change| bits(change.value))
                .collect::<Vec<_>>(),
            "{}",
            signal.name
        );
    }
}

/// A number bit by bit; NaN is NaN.
fn bits(value: f64) -> u64 {
    if value.is_nan() {
        f64::NAN.to_bits()
    } else {
        value.to_bits()
    }
}

#[test]
fn what_the_page_has_is_what_was_recorded_whatever_the_values() {
    let mut run = samples::machine(3_000, 1_000_000);
    let mut random = samples::Random(7);
    let odd = run.add_signal("odd values", SignalKind::Real, "");
    for (at, value) in [
        0.0,
        -0.0,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1e308,
        5e-324,
        0.1,
    ]
    .into_iter()
    .enumerate()
    {
        run.change(odd, Nanos(i64::try_from(at).expect("few") * 17), value);
    }
    let late = run.add_signal("first known late", SignalKind::Bool, "");
    run.change(late, Nanos::from_millis(1_500), 1.0);
    run.change(late, Nanos::from_millis(1_600), f64::NAN);
    run.change(late, Nanos::from_millis(1_700), 1.0);
    run.add_signal("never known", SignalKind::Real, "V");
    let real = run.add_signal("REAL, every value another", SignalKind::Real, "");
    let long = run.add_signal("LREAL, every value another", SignalKind::Real, "");
    for at in 0..3_000 {
        let raw = u32::try_from(random.below(1 << 30)).expect("it is below");
        run.change(real, Nanos::from_millis(at), f64::from(f32::from_bits(raw)));
        run.change(long, Nanos::from_millis(at), f64::from(raw).sqrt());
    }
    let page = Page::of(&contents(&run));
    let browser = Browser::start(1200, 900);
    open(&browser, &page);
    assert_same(&browser, &run);
    assert_quiet(&browser);
}

#[test]
fn a_run_that_begins_before_zero_or_late_and_lasts_long_keeps_its_times() {
    let browser = Browser::start(1200, 900);
    let day = 86_400_000_000_000;
    for begin in [-1_500_000_001, 90 * day + 1] {
        let mut run = Run::new(1000);
        let signal = run.add_signal("x", SignalKind::Bool, "");
        for (place, at) in [0, 1, 999, 3 * day].into_iter().enumerate() {
            run.tick(Nanos(begin + at));
            run.change(
                signal,
                Nanos(begin + at),
                f64::from(u8::from(place % 2 == 0)),
            );
        }
        let page = Page::of(&contents(&run));
        open(&browser, &page);
        assert_same(&browser, &run);
        assert_quiet(&browser);
    }
}

#[test]
fn names_and_texts_are_shown_and_never_run() {
    let attack =
        "</script><script>window.hacked = 1</script><img src=x onerror=\"window.hacked = 1\">";
    let names = [
        attack.to_owned(),
        "a & b < c > d \" ' \\ \u{2028}".to_owned(),
        "n".repeat(5_000),
        "<!--".to_owned(),
        String::new(),
    ];
    let mut run = Run::new(1000);
    for name in &names {
        let signal = run.add_signal(name, SignalKind::Bool, attack);
        run.change(signal, Nanos(0), 0.0);
        run.change(signal, Nanos(9), 1.0);
    }
    run.tick(Nanos(20));
    for kind in [
        MarkKind::Link,
        MarkKind::Fault,
        MarkKind::Step,
        MarkKind::Note,
    ] {
        run.mark(samples::mark(0, None, kind, attack));
    }
    let statistics = RunStatistics::read(&format!(
        "state=running\nreason={attack}\nplc.rises.{}=1",
        attack.replace('=', "-")
    ));
    let texts = [(attack.to_owned(), attack.to_owned())];
    let page = Page::of(&Contents {
        title: attack,
        source: attack,
        statistics: Some(&statistics),
        texts: &texts,
        ..contents(&run)
    });
    let browser = Browser::start(1200, 900);
    open(&browser, &page);
    assert_eq!(
        browser.run("return [typeof window.hacked, document.querySelectorAll('img').length]"),
        json!(["undefined", 0])
    );
    assert_eq!(browser.run("return tickbusReport.signals"), json!(names));
    assert_eq!(
        browser.run("return document.querySelector('h1').textContent"),
        attack
    );
    assert_eq!(
        browser.run("return document.querySelector('pre').textContent"),
        attack
    );
    assert_fits(&browser);
    assert_quiet(&browser);
}

/// Nothing is wider than the window.
#[track_caller]
fn assert_fits(browser: &Browser) {
    let widths = browser.run("return [document.documentElement.scrollWidth, innerWidth]");
    assert!(widths[0].as_f64() <= widths[1].as_f64(), "{widths}");
}

#[test]
fn an_empty_recording_and_a_single_tick_open() {
    let browser = Browser::start(1200, 900);
    let empty = Run::new(10);
    open(&browser, &Page::of(&contents(&empty)));
    assert_eq!(
        browser.run("return document.getElementById('empty').textContent"),
        "The recording has no signals."
    );
    assert_quiet(&browser);
    let mut single = Run::new(10);
    let signal = single.add_signal("x", SignalKind::Bool, "");
    single.tick(Nanos::from_millis(5));
    single.change(signal, Nanos::from_millis(5), 1.0);
    open(&browser, &Page::of(&contents(&single)));
    assert_same(&browser, &single);
    browser.run("document.getElementById('lanes').focus()");
    browser.keys("++--0np");
    assert_quiet(&browser);
}

#[test]
fn thousands_of_signals_are_scrolled_and_filtered() {
    let mut run = Run::new(1_000_000);
    for number in 0..5_000 {
        let signal = run.add_signal(&format!("Sensor {number}"), SignalKind::Bool, "");
        run.change(signal, Nanos(0), 0.0);
        if number % 2 == 1 {
            run.change(signal, Nanos(number), 1.0);
        }
    }
    let page = Page::of(&contents(&run));
    let browser = Browser::start(1200, 900);
    open(&browser, &page);
    browser.run("document.getElementById('lanes').scrollTop = 1e9");
    browser.wait("tickbusReport.isIdle()");
    let last = browser.run("return (await tickbusReport.changes(4999)).times");
    assert_eq!(last, json!(["0", "4999"]));
    browser.run("const filter = document.getElementById('filter'); filter.value = 'sensor 499'; filter.dispatchEvent(new Event('input'))");
    let rows = "return Math.round(parseFloat(document.getElementById('room').style.height) / 36)";
    assert_eq!(browser.run(rows), 15);
    browser.run("document.getElementById('active').click()");
    assert_eq!(browser.run(rows), 10);
    assert_quiet(&browser);
}

#[test]
fn the_chart_is_zoomed_and_moved_by_keys_wheel_mouse_and_links() {
    let run = samples::machine(10_000, 1_000_000);
    let page = Page::of(&contents(&run));
    let browser = Browser::start(1200, 900);
    open(&browser, &page);
    let (from, to) = view(&browser);
    assert!(
        from.abs() < 1e-9 && (to - 9_999.0).abs() < 1e-9,
        "{from} {to}"
    );
    browser.run("document.getElementById('lanes').focus()");
    browser.keys("++");
    let (from, to) = view(&browser);
    assert!(((to - from) - 9_999.0 / 4.0).abs() < 1e-6, "{from} {to}");
    browser.keys("\u{e014}"); // to the right
    assert!(view(&browser).0 > from);
    browser.keys("\u{e010}"); // the end
    assert!((view(&browser).1 - 9_999.0).abs() < 1e-9);
    browser.keys("0\u{e015}\u{e015}\u{e015}\u{e015}\u{e015}n"); // down to the first signal, to its first change
    let said = browser.run("await new Promise((go) => setTimeout(go, 600)); return document.getElementById('said').textContent");
    assert!(
        said.as_str().expect("a text").contains("Valve 0 open: "),
        "{said}"
    );
    // The mouse: Ctrl and the wheel zoom at the pointer, a drag pans.
    browser.run("document.getElementById('signals').scrollIntoView({ behavior: 'instant' })");
    let at = json!({"type": "pointer", "id": "mouse", "actions": [{"type": "pointerMove", "x": 700, "y": 300, "duration": 0}]});
    browser.act(&json!([at]));
    browser.act(&json!([
        {"type": "key", "id": "keys", "actions": [{"type": "keyDown", "value": "\u{e009}"}, {"type": "pause"}, {"type": "keyUp", "value": "\u{e009}"}]},
        {"type": "wheel", "id": "wheel", "actions": [{"type": "pause"}, {"type": "scroll", "x": 700, "y": 300, "deltaX": 0, "deltaY": -240, "duration": 0}]},
    ]));
    browser.wait("tickbusReport.view().to - tickbusReport.view().from < 5000");
    let before = view(&browser);
    browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [
        {"type": "pointerMove", "x": 700, "y": 300, "duration": 0}, {"type": "pointerDown", "button": 0},
        {"type": "pointerMove", "x": 600, "y": 300, "duration": 50}, {"type": "pointerUp", "button": 0},
    ]}]));
    browser.wait(&format!("tickbusReport.view().from > {}", before.0));
    // A time in a table links to its place in the chart.
    browser.run("document.querySelector('#faults a[data-from]').click()");
    let (from, to) = view(&browser);
    assert!(
        from < 5_000.0 && to > 5_500.0 && to - from < 1_000.0,
        "{from} {to}"
    );
    assert_quiet(&browser);
}

#[test]
fn two_fingers_zoom() {
    let run = samples::machine(10_000, 1_000_000);
    let page = Page::of(&contents(&run));
    let browser = Browser::start(390, 844);
    browser.devtools(
        "Emulation.setTouchEmulationEnabled",
        &json!({"enabled": true, "maxTouchPoints": 2}),
    );
    open(&browser, &page);
    browser.run("document.getElementById('lanes').scrollIntoView({ behavior: 'instant' })");
    let finger = |id: &str, from: i32, to: i32| {
        json!({"type": "pointer", "id": id, "parameters": {"pointerType": "touch"}, "actions": [
            {"type": "pointerMove", "x": from, "y": 200, "duration": 0}, {"type": "pointerDown", "button": 0},
            {"type": "pointerMove", "x": to, "y": 200, "duration": 100}, {"type": "pointerUp", "button": 0},
        ]})
    };
    browser.act(&json!([finger("one", 180, 80), finger("two", 210, 310)]));
    browser.wait("tickbusReport.view().to - tickbusReport.view().from < 3000");
    assert_fits(&browser);
    assert_quiet(&browser);
}

#[test]
fn edges_are_drawn_where_they_happened() {
    let mut run = Run::new(1000);
    let signal = run.add_signal("pulse", SignalKind::Bool, "");
    for (at, value) in [(0, 0.0), (500, 1.0), (600, 0.0)] {
        run.change(signal, Nanos::from_millis(at), value);
    }
    run.tick(Nanos::from_millis(1_000));
    let page = Page::of(&contents(&run));
    let browser = Browser::start(1200, 900);
    open(&browser, &page);
    // Where anything is painted along the middle of the only row, as fractions of the trace's width.
    // Comparing two rows above each other removes the grid.
    let found = browser.run(
        "const canvas = document.getElementById('canvas');
         const { left, width } = painting(null);
         const row = canvas.getContext('2d').getImageData(0, 18, canvas.width, 1).data;
         const above = canvas.getContext('2d').getImageData(0, 2, canvas.width, 1).data;
         const on = [];
         for (let x = Math.ceil(left); x < left + width; x++) {
           if (row[4 * x + 3] !== above[4 * x + 3]) on.push((x - left) / width);
         }
         return [Math.min(...on), Math.max(...on), on.length / width];",
    );
    let share = |place: usize| found[place].as_f64().expect("a number");
    assert!(
        (share(0) - 0.5).abs() < 0.005 && (share(1) - 0.6).abs() < 0.005,
        "{found}"
    );
    assert!((share(2) - 0.1).abs() < 0.01, "{found}");
}

#[test]
fn an_old_browser_is_told_and_has_all_but_the_chart() {
    let run = samples::machine(5_000, 1_000_000);
    let page = Page::of(&contents(&run));
    let browser = Browser::start(1200, 900);
    let old = json!({"source": "delete window.DecompressionStream; delete Uint8Array.fromBase64"});
    browser.devtools("Page.addScriptToEvaluateOnNewDocument", &old);
    browser.open(&page.path());
    let text = browser.run("return document.querySelector('#signals').innerText");
    assert!(text.as_str().expect("a text").contains("too old"), "{text}");
    assert!(
        browser
            .run("return document.querySelectorAll('#steps tbody tr').length")
            .as_u64()
            > Some(5)
    );
    assert_quiet(&browser);
}

#[test]
fn base64_is_read_without_the_newest_functions() {
    let run = samples::machine(1_000, 1_000_000);
    let page = Page::of(&contents(&run));
    let browser = Browser::start(1200, 900);
    browser.devtools(
        "Page.addScriptToEvaluateOnNewDocument",
        &json!({"source": "delete Uint8Array.fromBase64"}),
    );
    open(&browser, &page);
    assert_same(&browser, &run);
}

#[test]
fn paper_gets_every_row_in_light_colours() {
    let run = samples::machine(1_000, 1_000_000);
    let page = Page::of(&contents(&run));
    let browser = Browser::start(1200, 900);
    browser.devtools(
        "Emulation.setEmulatedMedia",
        &json!({"features": [{"name": "prefers-color-scheme", "value": "dark"}]}),
    );
    open(&browser, &page);
    assert_eq!(
        browser.run("return getComputedStyle(document.body).backgroundColor"),
        "rgb(20, 23, 26)"
    );
    let found = browser.run(
        "window.dispatchEvent(new Event('beforeprint'));
         const sheets = [...document.querySelectorAll('#paper canvas')];
         const text = getComputedStyle(document.getElementById('paper')).getPropertyValue('--text');
         const painted = sheets.every((sheet) => sheet.getContext('2d').getImageData(0, 0, sheet.width, sheet.height).data.some(Boolean));
         const height = sheets.reduce((sum, sheet) => sum + sheet.height / 2 - 26, 0);
         window.dispatchEvent(new Event('afterprint'));
         return [height, text.trim(), painted, document.querySelectorAll('#paper canvas').length];",
    );
    // 32 signals, and the bands of the line, faults, gaps and steps.
    assert_eq!(found, json!([32 * 36 + 4 * 30, "#1a1d21", true, 0]));
    let pdf = browser.devtools("Page.printToPDF", &json!({}));
    assert!(pdf["data"].as_str().is_some_and(|data| data.len() > 20_000));
    assert_quiet(&browser);
}

/// Screenshots for people, in the folder named by `TICKBUS_SCREENSHOTS`; of the page named by
/// `TICKBUS_REPORT`, or of a sample.
#[test]
fn screenshots_are_taken_at_every_size() {
    let folder = std::env::var_os("TICKBUS_SCREENSHOTS").map(PathBuf::from);
    let run = samples::machine(20_000, 1_000_000);
    let statistics = RunStatistics::read(include_str!("statistics.txt"));
    let texts = [(
        "A text".to_owned(),
        "demo: ok cycles=3\n  as it is".to_owned(),
    )];
    let page = Page::of(&Contents {
        statistics: Some(&statistics),
        texts: &texts,
        title: "Test rig",
        ..contents(&run)
    });
    let path = std::env::var_os("TICKBUS_REPORT").map_or_else(|| page.path(), PathBuf::from);
    let browser = Browser::start(1280, 900);
    for (name, width, height, scheme) in [
        ("desktop", 1280, 900, "light"),
        ("dark", 1280, 900, "dark"),
        ("phone", 390, 844, "light"),
        ("phone-dark", 390, 844, "dark"),
    ] {
        browser.resize(width, height);
        let scheme = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        browser.devtools("Emulation.setEmulatedMedia", &scheme);
        browser.open(&path);
        browser.wait("tickbusReport.isIdle()");
        assert_fits(&browser);
        assert_quiet(&browser);
        shoot(
            &browser,
            folder.as_deref(),
            &format!("{name}-top.png"),
            false,
        );
        browser.run("document.getElementById('lanes').focus(); document.getElementById('signals').scrollIntoView({behavior: 'instant'})");
        browser.keys("+++++\u{e015}\u{e015}\u{e015}\u{e015}\u{e015}\u{e015}nmnn");
        browser.wait("tickbusReport.isIdle()");
        shoot(
            &browser,
            folder.as_deref(),
            &format!("{name}-zoomed.png"),
            false,
        );
        shoot(
            &browser,
            folder.as_deref(),
            &format!("{name}-whole.png"),
            true,
        );
        browser.run("document.getElementById('lanes').scrollTop = 1e9; document.getElementById('lanes').focus()");
        browser.keys("0+");
        browser.wait("tickbusReport.isIdle()");
        shoot(
            &browser,
            folder.as_deref(),
            &format!("{name}-numbers.png"),
            false,
        );
        let pdf = browser.devtools(
            "Page.printToPDF",
            &json!({"preferCSSPageSize": false, "printBackground": false}),
        );
        if name == "dark" {
            save(folder.as_deref(), "print.pdf", &pdf["data"]);
        }
    }
}
