//! `tickbus report` as users run it, and checks of a page that need no browser.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tickbus::report::{self, Contents, Run, SignalKind};
use tickbus::time::Nanos;

const RECORDING: &str = "bus.tick,bus.time_ns,bus.status,bus.dropped,Lamp,Height,Step,Lamp.edges\n\
    1,0,0,0,0,1.5,0,0\n2,1000000,1,0,1,1.5,1,1\n3,2000000,2,0,1,2.5,1,0\n7,6000000,0,3,0,2.5,2,2\n";

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self {
            folder: tempfile::tempdir().expect("there is room"),
        };
        bench.file("run.csv", RECORDING);
        bench
    }

    fn file(&self, name: &str, text: &str) -> PathBuf {
        let path = self.folder.path().join(name);
        fs::write(&path, text).expect("there is room");
        path
    }

    fn report(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
        command
            .arg("report")
            .args(arguments)
            .current_dir(self.folder.path());
        command.output().expect("the command is there")
    }

    fn page(&self, name: &str) -> String {
        fs::read_to_string(self.folder.path().join(name)).expect("the page is there")
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_owned()).expect("it is UTF-8")
}

#[test]
fn a_page_stands_beside_its_recording_and_has_all_that_was_asked_for() {
    let bench = Bench::new();
    bench.file("stats.txt", "plc: running: well\nstate=running\nage.count=1\nage.p50_us=1\nage.p90_us=1\nage.p99_us=1\nage.max_us=2\nage.mean_us=1\n");
    bench.file("demo.txt", "demo: ok <cycles=3>\n");
    let output = bench.report(&[
        "run.csv",
        "--steps",
        "Step",
        "--fault",
        "Lamp",
        "--stats",
        "stats.txt",
        "--text",
        "demo.txt",
        "--title",
        "A & B",
    ]);
    let told = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(
        told.starts_with("report: ok signals=3 ticks=4 bytes=")
            && told.ends_with(" file=run.html\n"),
        "{told}"
    );
    let page = bench.page("run.html");
    for part in [
        "<title>A &amp; B</title>",
        "demo: ok &lt;cycles=3&gt;",
        "3 ticks were dropped",
        "2 steps, one after another",
        "<th scope=\"row\" class=\"name\">age</th>",
        "class=\"tag fault\"",
        "class=\"tag stale\"",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert_eq!(
        told.split("bytes=")
            .nth(1)
            .and_then(|rest| rest.split(' ').next()),
        Some(&*page.len().to_string())
    );
}

#[test]
fn the_same_recording_gives_the_same_bytes() {
    let bench = Bench::new();
    assert!(
        bench
            .report(&["run.csv", "--out", "a.html"])
            .status
            .success()
    );
    assert!(
        bench
            .report(&["run.csv", "--out", "b.html"])
            .status
            .success()
    );
    assert_eq!(bench.page("a.html"), bench.page("b.html"));
}

#[test]
fn mistakes_come_all_at_once_with_what_would_be_right() {
    let bench = Bench::new();
    let output = bench.report(&[
        "run.csv", "--steps", "Stap", "--fault", "Klaxon", "--stats", "no.txt", "--text", "no.txt",
    ]);
    assert_eq!(output.status.code(), Some(1));
    let told = text(&output.stderr);
    for part in [
        "did you mean \"Step\"?",
        "no signal \"Klaxon\"",
        "no.txt: this text cannot be read",
        "report: failed mistakes=4",
    ] {
        assert!(told.contains(part), "{told}");
    }
    assert!(!bench.folder.path().join("run.html").exists());
    let output = bench.report(&["elsewhere.vcd"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stderr).contains("elsewhere.vcd: "),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn of_a_damaged_recording_the_whole_part_is_shown_and_the_command_fails() {
    let bench = Bench::new();
    bench.file("run.csv", &RECORDING.replace("6000000", "later"));
    let output = bench.report(&["run.csv"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stderr).contains("run.csv:5: "),
        "{}",
        text(&output.stderr)
    );
    assert!(bench.page("run.html").contains("the recording breaks off"));
}

#[test]
fn a_page_that_cannot_be_written_leaves_nothing_behind() {
    let bench = Bench::new();
    let output = bench.report(&["run.csv", "--out", "nowhere/run.html"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("choose another place with --out"));
    assert_eq!(
        fs::read_dir(bench.folder.path())
            .expect("it is there")
            .count(),
        1
    );
}

/// A page of a run.
fn page(run: &Run) -> String {
    let mut out = Vec::new();
    let contents = Contents {
        title: "t",
        source: "s",
        run,
        steps: None,
        faults: &[],
        statistics: None,
        texts: &[],
        tables: &[],
    };
    report::write(&contents, &mut out).expect("memory takes all");
    text(&out)
}

#[test]
fn a_page_has_no_address_to_load_anything_from() {
    let mut run = Run::new(100);
    let signal = run.add_signal("x", SignalKind::Real, "");
    run.change(signal, Nanos(1), 2.0);
    let page = page(&run);
    for word in [
        "http:",
        "https:",
        "src=",
        "@import",
        "url(",
        "fetch(",
        "XMLHttpRequest",
        "import(",
    ] {
        assert!(!page.contains(word), "{word}");
    }
    assert!(page.contains("default-src 'none'"));
}

#[test]
fn a_million_changes_that_follow_a_rule_take_little_room() {
    let mut run = Run::new(2_000_000);
    let ramp = run.add_signal("ramp", SignalKind::Real, "mm");
    let pulse = run.add_signal("pulse", SignalKind::Bool, "");
    for tick in 0..500_000_i32 {
        let now = Nanos::from_millis(i64::from(tick));
        run.tick(now);
        run.change(ramp, now, f64::from(tick % 1_000) * 0.01);
        run.change(pulse, now, f64::from(tick % 2));
    }
    let size = page(&run).len();
    assert!(size < 200_000, "{size} bytes");
}

/// The colours of the style sheet, by name, for light and for dark mode.
fn colours() -> [Vec<(String, [f64; 3])>; 2] {
    let style = fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/tools/report/src/style.css"),
    );
    let style = style.expect("the style sheet is there");
    let (light, dark) = style
        .split_once("prefers-color-scheme: dark")
        .expect("it has both");
    [light, dark].map(|part| {
        let lines = part
            .lines()
            .filter_map(|line| line.trim().strip_prefix("--")?.split_once(": #"));
        let byte = |hex: &str, at: usize| {
            f64::from(u8::from_str_radix(&hex[at..at + 2], 16).expect("hexadecimal")) / 255.0
        };
        lines
            .filter(|(_, hex)| hex.len() == 7)
            .map(|(name, hex)| (name.to_owned(), [byte(hex, 0), byte(hex, 2), byte(hex, 4)]))
            .collect()
    })
}

/// The contrast of two colours as defined in the W3C's accessibility guidelines.
fn contrast(a: [f64; 3], b: [f64; 3]) -> f64 {
    let light = |colour: [f64; 3]| {
        let [r, g, b] = colour.map(|c| {
            if c <= 0.040_45 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        });
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let (a, b) = (light(a), light(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

#[test]
fn all_colours_can_be_told_from_what_lies_behind_them() {
    for colours in colours() {
        let colour = |name: &str| {
            colours
                .iter()
                .find(|(known, _)| known == name)
                .unwrap_or_else(|| panic!("no {name}"))
                .1
        };
        let pairs = [
            ("text", "page", 7.0),
            ("text", "card", 7.0),
            ("text", "chosen", 7.0),
            ("soft", "page", 4.5),
            ("soft", "card", 4.5),
            ("link", "page", 4.5),
            ("good-text", "good", 4.5),
            ("stale-text", "stale", 4.5),
            ("bad-text", "bad", 4.5),
            ("idle-text", "idle", 4.5),
            ("gap-text", "gap", 4.5),
            ("step-text", "step", 4.5),
            ("trace", "page", 3.0),
            ("trace", "chosen", 3.0),
            ("analog", "page", 3.0),
            ("bad", "page", 3.0),
            ("gap", "page", 3.0),
            ("mark", "page", 3.0),
            ("cursor", "page", 3.0),
        ];
        for (front, back, least) in pairs {
            let found = contrast(colour(front), colour(back));
            assert!(
                found >= least,
                "{front} on {back}: {found:.2}, the least is {least}"
            );
        }
    }
}
