//! The live page in Chromium: how long from asking for it until its first signals are painted, of 5,000.
//!
//! Prints one `rust NAME VALUE` per line, or says what is missing.
#![allow(missing_docs, reason = "a bench")]

#[path = "../tests/browser/webdriver.rs"]
#[allow(dead_code, reason = "the tests use the rest")]
mod webdriver;

use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use webdriver::Browser;

const SIGNALS: usize = 5_000;

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    if Command::new("chromedriver")
        .arg("--version")
        .output()
        .is_err()
    {
        println!(
            "first_paint: skipped, there is no chromedriver (apt-get install chromium-driver)"
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("many.cfg");
    let mut text = "[driver]\nid = 1\nname = \"Many\"\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n\
         [page]\nlisten = \"127.0.0.1:0\"\n"
        .to_owned();
    for n in 0..SIGNALS {
        let _ = writeln!(
            text,
            "[[signal]]\nname = \"Word {n}\"\naddress = \"%IW{}\"\ntype = \"INT\"\nunit = \"mm\"",
            2 * n
        );
    }
    std::fs::write(&file, text).expect("there is room");
    let mut machine = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("mirror")
        .arg(&file)
        .stdout(Stdio::piped())
        .spawn()
        .expect("the tickbus program runs");
    let lines = BufReader::new(machine.stdout.take().expect("it is piped")).lines();
    let mut lines = lines.map_while(Result::ok);
    let url = lines.find_map(|line| line.strip_prefix("mirror: page at ").map(str::to_owned));
    let url = url.expect("it tells its page");
    let mut times: Vec<f64> = (0..if measured { 9 } else { 1 })
        .map(|_| first_paint(&url))
        .collect();
    times.sort_by(f64::total_cmp);
    println!("rust page.first_paint_ms {:.0}", times[times.len() / 2]);
    // The process has no data to save.
    let _ = machine.kill();
    let _ = machine.wait();
}

/// How long the page took in a browser that has never seen it, in milliseconds. The start of the browser is not part of it:
/// that is over once the browser has drawn for half a second without a frame that came late.
fn first_paint(url: &str) -> f64 {
    let browser = Browser::start(1280, 860);
    browser.run(
        "let [calm, before] = [0, 0]; \
         while (calm < 30) { \
             const now = await new Promise(requestAnimationFrame); \
             calm = now - before < 20 ? calm + 1 : 0; \
             before = now; \
         }",
    );
    browser.go(url);
    browser.wait("window.tickbusPage?.painted");
    let painted = browser.run("return tickbusPage.painted");
    painted.as_f64().expect("a time")
}
