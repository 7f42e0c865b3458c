//! The report of a long run: how long it takes to write, its size, and its performance in Chromium, if that
//! and chromedriver are installed.
//!
//! 1,000,000 ticks of 32 signals, 7 of them numbers that change in every tick. In the browser: the time from
//! the start of loading to the first chart, the time until all signals are unpacked, and the longest time
//! between two frames while keys zoom in as far as possible and out again. Prints one `rust NAME VALUE` per
//! line on stdout.
#![allow(missing_docs, reason = "a bench")]

#[path = "../tests/browser/samples.rs"]
mod samples;
#[allow(dead_code, reason = "the tests use all of it")]
#[path = "../tests/browser/webdriver.rs"]
mod webdriver;

use std::fs::File;
use std::io::BufWriter;
use std::process::Command;
use std::time::Instant;

use tickbus::report::{self, Contents, DEFAULT_BUDGET};
use webdriver::Browser;

const ZOOM: &str = "
    const lanes = document.getElementById('lanes');
    lanes.scrollTop = 1e9;
    lanes.focus();
    const press = (key) => lanes.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }));
    const picture = () => new Promise((go) => requestAnimationFrame(go));
    await picture();
    let longest = 0;
    let last = performance.now();
    for (const key of '+'.repeat(25) + '-'.repeat(25) + '+++' + '>'.repeat(40)) {
      press(key === '>' ? 'ArrowRight' : key);
      await picture();
      const now = performance.now();
      longest = Math.max(longest, now - last);
      last = now;
    }
    return [longest, tickbusReport.drawn().longest];";

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let ticks = if measured { 1_000_000 } else { 1_000 };
    let begun = Instant::now();
    let run = samples::machine(ticks, DEFAULT_BUDGET);
    let read = begun.elapsed();
    assert!(
        run.signals()
            .iter()
            .all(|signal| signal.resolution().0 == 0),
        "none was thinned"
    );
    let folder = tempfile::tempdir().expect("there is room for a page");
    let path = folder.path().join("report.html");
    let begun = Instant::now();
    let mut file = BufWriter::new(File::create(&path).expect("there is room for a page"));
    let contents = Contents {
        title: "Bench",
        source: "",
        run: &run,
        steps: run.signal("Step"),
        faults: &[],
        statistics: None,
        texts: &[],
        tables: &[],
    };
    report::write(&contents, &mut file).expect("there is room for a page");
    let bytes = file.get_ref().metadata().expect("it is there").len();
    println!("rust report.take_s {:.2}", read.as_secs_f64());
    println!("rust report.write_s {:.2}", begun.elapsed().as_secs_f64());
    println!("rust report.bytes {bytes}");
    drop(file);
    if !measured
        || Command::new("chromedriver")
            .arg("--version")
            .output()
            .is_err()
    {
        eprintln!("not measured in a browser: chromedriver is not here, or this is a trial");
        return;
    }
    let browser = Browser::start(1280, 900);
    browser.open(&path);
    browser.wait("window.tickbusReport && tickbusReport.isIdle()");
    let times = browser.run("return [tickbusReport.drawn().first, performance.now()]");
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    println!("rust report.first_chart_ms {:.0}", number(&times[0]));
    println!("rust report.all_unpacked_ms {:.0}", number(&times[1]));
    let zoom = browser.run(ZOOM);
    println!("rust report.longest_picture_ms {:.1}", number(&zoom[0]));
    println!("rust report.longest_draw_ms {:.1}", number(&zoom[1]));
}
