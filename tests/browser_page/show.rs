//! The live page of a recording: it opens, and goes to any moment.

use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use serde_json::json;

use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, click, find};

const PICTURE: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 200 120\">\
    <rect x=\"20\" y=\"10\" width=\"60\" height=\"100\" fill=\"none\" stroke=\"#808080\"/>\
    <rect data-tb-height=\"Level: 0..100\" x=\"22\" y=\"12\" width=\"56\" height=\"96\" fill=\"#3a7ca5\"/>\
    <text data-tb-text=\"Level\" x=\"100\" y=\"60\" fill=\"#808080\">0</text></svg>";

struct Show(Child);

impl Drop for Show {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Ten seconds of a tank, with an outage from second 6 to second 7.
fn recording() -> String {
    let mut text = String::from("bus.tick,bus.time_ns,bus.status,bus.dropped,Valve,Level\n");
    for tick in 1..=1000 {
        let level = if tick < 500 { tick / 5 } else { 200 - tick / 5 };
        let status = if (600..700).contains(&tick) { 2 } else { 0 };
        let valve = u8::from(tick < 500);
        writeln!(text, "{tick},{tick}0000000,{status},0,{valve},{level}").expect("there is room");
    }
    text
}

#[test]
fn a_recording_opens_at_its_end_and_goes_to_any_moment() {
    let screenshots = std::env::var_os("TICKBUS_SCREENSHOTS").map(PathBuf::from);
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("run.csv"), recording()).expect("there is room");
    fs::write(folder.path().join("tank.svg"), PICTURE).expect("there is room");
    let child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args([
            "show",
            "run.csv",
            "--picture",
            "tank.svg",
            "--fault",
            "Valve",
        ])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .spawn();
    let mut show = Show(child.expect("the tickbus program runs"));
    let mut lines = BufReader::new(show.0.stdout.take().expect("it is piped")).lines();
    let url = find(&mut lines, "show: page at ");
    let browser = Browser::start(1280, 800);
    browser.go(&url);
    let moment = |text: &str| {
        browser.wait(&format!(
            "document.getElementById('moment').textContent === '{text}'"
        ));
    };
    moment("10.000 s of 10.000 s · tick 1,000");
    let head = browser.run(
        "return [document.getElementById('link').textContent, \
         ['pause', 'to-live'].map((id) => document.getElementById(id).hidden), \
         document.querySelector('.driver .reason').textContent.split(';')[0], tickbusPage.value('Level')]",
    );
    let told = "a recording, run.csv: 1000 ticks in 9990ms, from 10ms to 10s";
    assert_eq!(head, json!(["recording", [true, true], told, 0]));
    // The picture follows, tick by tick and from place to place.
    browser.wait("document.querySelector('#pictures svg text, .picture > div')");
    click(&browser, "#step-back");
    moment("9.990 s of 10.000 s · tick 999");
    assert_eq!(browser.run("return tickbusPage.value('Level')"), json!(1));
    click(&browser, "#step-forth");
    moment("10.000 s of 10.000 s · tick 1,000");
    browser.run("document.getElementById('more-time').open = true");
    click(&browser, "#last-goal");
    moment("6.000 s of 10.000 s · tick 600");
    browser.run("const it = document.getElementById('goal'); it.value = 'fault'");
    click(&browser, "#last-goal");
    moment("0.010 s of 10.000 s · tick 1");
    browser.run("const it = document.getElementById('scrub'); it.value = 4000; it.dispatchEvent(new Event('input'))");
    moment("4.000 s of 10.000 s · tick 400");
    assert_eq!(browser.run("return tickbusPage.value('Level')"), json!(80));
    // Back to the end, which is no present.
    browser.run(
        "document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'p', bubbles: true }))",
    );
    moment("10.000 s of 10.000 s · tick 1,000");
    browser.run("const it = document.getElementById('scrub'); it.value = 6500; it.dispatchEvent(new Event('input'))");
    moment("6.500 s of 10.000 s · tick 650");
    browser.run("document.querySelectorAll('.row.signal .do button, .row .do button')[1]?.click()");
    shoot(&browser, screenshots.as_deref(), "show", false);
    assert_fits(&browser);
    assert_quiet(&browser);
}
