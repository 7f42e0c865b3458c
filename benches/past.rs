//! The time machine in Chromium: a recording of ten minutes, every 10 ms, in which 1,000 signals change in every tick.
//!
//! How long `tickbus show` takes to open it and how much memory it has, how long from a move of the bar of time to the picture
//! of that moment, and from picture to picture while the analyser with 24 signals is panned and zoomed. Prints one
//! `rust NAME VALUE` per line, or says what is missing.
#![allow(missing_docs, reason = "a bench")]

#[path = "../tests/browser/webdriver.rs"]
#[allow(dead_code, reason = "the tests use the rest")]
mod webdriver;

use std::fs::File;
use std::io::{BufRead as _, BufReader, BufWriter, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::Value;
use webdriver::Browser;

const SIGNALS: u64 = 1_000;

/// Frames of 5 s at 60 a second: one script has 120 s, which a slow machine needs for them.
const FRAMES: usize = 300;

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let found = Command::new("chromedriver").arg("--version").output();
    if found.is_err() {
        println!("past: skipped, there is no chromedriver (apt-get install chromium-driver)");
        return;
    }
    let (ticks, frames) = if measured {
        (60_000, FRAMES)
    } else {
        (600, 30)
    };
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.csv");
    write(&file, ticks).expect("there is room");
    let begun = Instant::now();
    let mut show = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["show", "--memory", "4096"])
        .arg(&file)
        .stdout(Stdio::piped())
        .spawn()
        .expect("the tickbus program runs");
    let lines = BufReader::new(show.stdout.take().expect("it is piped")).lines();
    let mut lines = lines.map_while(Result::ok);
    let url = lines.find_map(|line| line.strip_prefix("show: page at ").map(str::to_owned));
    let url = url.expect("it tells its page");
    println!("rust past.open_s {:.2}", begun.elapsed().as_secs_f64());
    if let Some(peak) = peak_of(show.id()) {
        println!("rust past.open_mb {peak:.0}");
    }
    let browser = Browser::start(1280, 860);
    browser.go(&url);
    browser.wait("window.tickbusPage?.painted && bar.moment");
    // By as many moves as a hand makes, from one end of the bar to the other and back.
    browser.run(&format!(
        "const range = document.getElementById('scrub'); bar.frames.length = 0; window.gaps = []; let last; \
         for (let i = 0; i < {frames}; i++) {{ \
           range.value = Number(range.min) + (range.max - range.min) * Math.abs((i % 240) / 120 - 1); \
           range.dispatchEvent(new Event('input')); \
           const now = await new Promise(requestAnimationFrame); \
           if (last) gaps.push(now - last); last = now; }}"
    ));
    quantiles("scrub", &browser.run("return bar.frames"));
    quantiles("scrub.frame", &browser.run("return gaps"));
    browser.run("for (const signal of plant.signals.slice(0, 24)) analyser.add(signal); bar.show('at/300000')");
    browser.wait(
        "analyser.tracks.length === 24 && analyser.tracks.every((it) => it.times.length > 100)",
    );
    for (name, action) in [
        ("pan", "analyser.pan(i % 60 < 30 ? 0.02 : -0.02)"),
        ("zoom", "analyser.zoom(i % 120 < 60 ? 1.05 : 1 / 1.05)"),
    ] {
        browser.run(&format!(
            "window.gaps = []; let last; for (let i = 0; i < {frames}; i++) {{ {action}; \
               const now = await new Promise(requestAnimationFrame); if (last) gaps.push(now - last); last = now; }}"
        ));
        quantiles(name, &browser.run("return gaps"));
    }
    let begun = Instant::now();
    browser.run("analyser.all()");
    browser.wait("analyser.tracks.every(({ from, until, signal: { driver: { past } } }) => from <= past.first && until >= past.last)");
    println!("rust past.all_ms {}", begun.elapsed().as_millis());
    // The process has no data to save.
    let _ = show.kill();
    let _ = show.wait();
}

/// Writes a recording: 1,000 signals that all change in every tick.
fn write(file: &Path, ticks: u64) -> std::io::Result<()> {
    let mut out = BufWriter::new(File::create(file)?);
    write!(out, "bus.tick,bus.time_ns,bus.status,bus.dropped")?;
    for signal in 0..SIGNALS {
        write!(out, ",Signal {signal}")?;
    }
    for tick in 1..=ticks {
        write!(out, "\n{tick},{tick}0000000,0,0")?;
        for signal in 0..SIGNALS {
            write!(out, ",{}", (tick * 7 + signal * 13) % 997)?;
        }
    }
    writeln!(out)?;
    out.flush()
}

/// The most memory that a process has had, in megabytes; `None` where the system does not say.
fn peak_of(process: u32) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1024.0)
}

/// Prints the median, 99 % and the longest of times in milliseconds.
fn quantiles(name: &str, times: &Value) {
    let times = times.as_array().expect("a list").iter();
    let mut times: Vec<f64> = times.filter_map(Value::as_f64).collect();
    times.sort_by(f64::total_cmp);
    let last = times.len() - 1;
    println!("rust past.{name}_count {}", times.len());
    println!("rust past.{name}_p50_ms {:.1}", times[last / 2]);
    println!("rust past.{name}_p99_ms {:.1}", times[last * 99 / 100]);
    println!("rust past.{name}_max_ms {:.1}", times[last]);
}
