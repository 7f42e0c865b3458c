//! The live page of a recording: it opens, and goes to any moment.

use std::fmt::Write as _;
use std::fs;

use serde_json::json;

use crate::commands::Running;
use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, click};

const PICTURE: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 200 120\">\
    <rect x=\"20\" y=\"10\" width=\"60\" height=\"100\" fill=\"none\" stroke=\"#808080\"/>\
    <rect data-tb-height=\"Level: 0..100\" x=\"22\" y=\"12\" width=\"56\" height=\"96\" fill=\"#3a7ca5\"/>\
    <text data-tb-text=\"Level\" x=\"100\" y=\"60\" fill=\"#808080\">0</text></svg>";

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
    let screenshots = crate::screenshots();
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("run.csv"), recording()).expect("there is room");
    fs::write(folder.path().join("tank.svg"), PICTURE).expect("there is room");
    let file = |name: &str| folder.path().join(name).display().to_string();
    let (run, picture) = (file("run.csv"), file("tank.svg"));
    let mut show = Running::of("show", &[&run, "--picture", &picture, "--fault", "Valve"]);
    let url = show.after("show: page at ");
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
    let told = format!("a recording, {run}: 1000 ticks in 9990ms, from 10ms to 10s");
    assert_eq!(head, json!(["recording", [true, true], told, 0]));
    // The picture follows, tick by tick and from place to place.
    let drawn = |level: &str| {
        browser.wait(&format!(
            "document.querySelector('.picture > div > div')?.shadowRoot?.querySelector('text').textContent === '{level}'"
        ));
    };
    drawn("0.00");
    click(&browser, "#step-back");
    moment("9.990 s of 10.000 s · tick 999");
    assert_eq!(browser.run("return tickbusPage.value('Level')"), json!(1));
    drawn("1.00");
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
    browser.run("list.toggle(plant.signals.find((it) => it.name === 'Level'))");
    browser.wait("document.querySelector('.row.trend:not([hidden]) canvas')?.getAttribute('aria-label') === 'Trend of Level'");
    shoot(&browser, screenshots.as_deref(), "show", false);
    assert_fits(&browser);
    // Jumps to conditions, without a signal on the axis: by the field, its key and the bar.
    browser.run("location.hash = '#recording'; document.getElementById('trigger-text').value = 'Level >= 40 and Valve == 1'");
    let when = |id: &str| {
        browser.run(&format!("document.getElementById('{id}').click()"));
    };
    when("last-when");
    moment("2.000 s of 10.000 s · tick 200");
    when("last-when");
    browser.wait("document.getElementById('status').textContent === 'There is no earlier beginning of “Level >= 40 and Valve == 1” in the recorded time.'");
    browser.run("const it = document.getElementById('trigger-text'); it.value = 'Level changes'; it.focus()");
    browser.keys("\u{e007}");
    moment("2.050 s of 10.000 s · tick 205");
    browser.run("document.getElementById('trigger-text').value = 'Level < 100'; document.getElementById('goal').value = 'when'");
    when("next-goal");
    moment("5.050 s of 10.000 s · tick 505");
    // Data are stale from tick 600 to tick 699.
    when("next-goal");
    moment("7.000 s of 10.000 s · tick 700");
    browser.run("document.getElementById('trigger-text').value = 'Levle < 60'");
    when("next-goal");
    browser.wait("document.getElementById('trigger-told').textContent === 'there is no signal \"Levle\"; did you mean \"Level\"?'");
    assert_eq!(
        browser.run("return [bar.moment.tick, document.getElementById('arm').hidden]"),
        json!([700, true])
    );
    assert_fits(&browser);
    assert_quiet(&browser);
}

/// A clock that changes every nanosecond, as of a simulator of hardware.
#[test]
fn a_recording_of_nanoseconds_has_an_axis_and_edges() {
    let screenshots = crate::screenshots();
    let folder = tempfile::tempdir().expect("a folder");
    let mut vcd = String::from(
        "$timescale 1ns $end\n$scope module top $end\n$var wire 1 ! clk $end\n$upscope $end\n$enddefinitions $end\n",
    );
    for at in 0..=20 {
        writeln!(vcd, "#{at}\n{}!", at % 2).expect("there is room");
    }
    let file = folder.path().join("clock.vcd");
    fs::write(&file, vcd).expect("there is room");
    let mut show = Running::of("show", &[&file.display().to_string()]);
    let url = show.after("show: page at ");
    let browser = Browser::start(1280, 800);
    browser.go(&url);
    let moment = |text: &str| {
        browser.wait(&format!(
            "document.getElementById('moment').textContent === '{text}'"
        ));
    };
    moment("0.000000020 s of 0.000000020 s · tick 21");
    browser.run("analyser.add(plant.signals[0])");
    browser.wait("analyser.tracks[0].times.length === 21");
    let view = browser.run("const { begin, end } = analyser.view; return [begin, end]");
    let nanos = |at: usize| (view[at].as_f64().expect("a time") * 1e6).round();
    assert_eq!([nanos(0), nanos(1)], [0.0, 20.0], "all of it");
    // The second cursor at the last tick has a value, too.
    browser.run("document.getElementById('cursor-2').click()");
    browser.wait(
        "analyser.second.tick === 21 && analyser.tracks[0].parts.then.textContent === 'FALSE'",
    );
    browser.run("document.getElementById('drop-cursor').click()");
    for at in [19, 18, 17] {
        browser.run("analyser.toEdge(-1)");
        moment(&format!(
            "0.0000000{at} s of 0.000000020 s · tick {}",
            at + 1
        ));
    }
    browser.run("analyser.toEdge(1)");
    moment("0.000000018 s of 0.000000020 s · tick 19");
    shoot(&browser, screenshots.as_deref(), "show-nanoseconds", false);
    assert_fits(&browser);
    assert_quiet(&browser);
}
