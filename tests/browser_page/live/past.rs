//! The bar of time: the page shows a moment of the past, and the present goes on.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::{Machine, TANK, choose, open, wait_shown};
use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, click, wait_said};

const LEFT: &str = "\u{e012}";
const RIGHT: &str = "\u{e014}";

const PICTURE: &str = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 200 80'>\
    <rect x='20' y='10' width='30' height='60' fill='#4080c0' data-tb-height='Level: 0..500 -&gt; 0..1'/>\
    <text id='told' x='70' y='45' font-size='20' data-tb-text='Level'>?</text></svg>";

/// The text in the picture.
const TOLD: &str = "pictures.all[0].root.querySelector('#told').textContent";

/// The level that the page shows.
fn level(browser: &Browser) -> Value {
    browser.run("return tickbusPage.value('Level')")
}

/// A tank with a picture, whose level went from 0 to 500 mm, and to 250 mm.
fn filled() -> Machine {
    let files = [("tank.svg", PICTURE)];
    let machine = Machine::with("modbus-server", "picture = \"tank.svg\"", TANK, &files);
    machine.write("4", "1", "0");
    machine.write("4", "1", "27648");
    machine.write("4", "1", "13824");
    machine
}

#[test]
fn the_page_steps_back_to_the_edge_while_the_present_goes_on() {
    let machine = filled();
    let browser = open(&machine, 1280, 800);
    wait_shown(&browser, "Level", "250.00mm");
    browser.wait(&format!("{TOLD} === '250.00 mm'"));
    choose(&browser, "Level");
    browser.run("list.toggle(list.chosen)");
    browser.run("document.getElementById('more-time').open = true");
    browser.run("document.getElementById('goal').value = 'signal'");
    click(&browser, "#last-goal");
    // The tick of the change has the new value, and the one before the old one: list and picture.
    browser.wait("bar.moment && document.getElementById('link').textContent === 'paused'");
    assert_eq!(level(&browser), 250);
    let tick = browser
        .run("return bar.moment.tick")
        .as_u64()
        .expect("a tick");
    browser.run("document.getElementById('scrub').focus()");
    browser.keys(LEFT);
    browser.wait(&format!("bar.moment.tick === {}", tick - 1));
    assert_eq!(level(&browser), 500);
    wait_shown(&browser, "Level", "500.00mm");
    browser.wait(&format!("{TOLD} === '500.00 mm'"));
    // The present goes on underneath.
    machine.write("4", "1", "5530");
    browser.wait("plant.signals.find((it) => it.name === 'Level').live[0] < 101");
    assert_eq!(level(&browser), 500);
    browser.wait("/^Live: \\+/.test(document.getElementById('to-live').textContent)");
    // Forcing would act on another moment than the one that is seen.
    browser.run("document.getElementById('force-value').value = '1'; document.getElementById('chosen').requestSubmit()");
    wait_said(&browser, "You look at the past");
    shoot(&browser, None, "past", false);
    browser.keys(RIGHT);
    browser.wait(&format!("bar.moment.tick === {tick}"));
    assert_eq!(level(&browser), 250);
    // The trend has the exact edges.
    let values = "plant.signals.find((it) => it.name === 'Level').trend.values";
    browser.wait(&format!(
        "{values}.filter((it) => !Number.isNaN(it)).length >= 3"
    ));
    let known = browser.run(&format!(
        "return {values}.filter((it) => !Number.isNaN(it)).slice(0, 3)"
    ));
    assert_eq!(known, json!([0, 500, 250]));
    click(&browser, "#to-live");
    browser.wait("!bar.moment && document.getElementById('link').textContent === 'live'");
    assert_eq!(browser.run("return tickbusPage.value('Level') < 101"), true);
    assert_quiet(&browser);
}

/// Another driver beside the lead, whose answers are made here.
const OTHER: &str = "const lead = plant.drivers[0]; \
    const other = { ...lead, id: 2, name: 'Other', moment: null }; \
    other.signals = lead.signals.map((it) => ({ ...it, driver: other })); \
    plant.drivers.push(other); \
    const real = room.ask; \
    window.asked = []; \
    const found = { tick: 7, ms: 1.5 }; \
    const state = { ...found, status: 0, stations: [], faults: [], line: null, values: [] }; \
    room.ask = async (path) => { \
      if (!path.startsWith('/history/2/')) return real(path); \
      window.asked.push(path.replace(/last\\/0\\/.*/, 'last/0')); \
      return { ok: true, json: async () => (path.includes('/last/') ? found : state) }; }; \
    bar.begin({ say() {}, shown() {}, chosen: () => other.signals[0] });";

#[test]
fn a_jump_to_a_change_of_another_driver_shows_the_very_tick_of_it() {
    let machine = filled();
    let browser = open(&machine, 1280, 800);
    wait_shown(&browser, "Level", "250.00mm");
    browser.run(OTHER);
    browser.run("document.getElementById('goal').value = 'signal'; await bar.jump(false)");
    browser.wait("plant.drivers[1].moment?.tick === 7");
    // The lead's tick at that time may be an earlier one.
    let asked = json!(["/history/2/last/0", "/history/2/tick/7"]);
    assert_eq!(browser.run("return asked"), asked);
    browser.run("await bar.jump(false)");
    let again = browser.run("return asked[3]");
    assert_eq!(again, "/history/2/tick/7/since/7");
}

#[test]
fn a_moment_that_leaves_the_memory_gives_way_to_the_oldest_one() {
    let machine = filled();
    let browser = open(&machine, 1280, 800);
    wait_shown(&browser, "Level", "250.00mm");
    browser.run("await bar.show('tick/7')");
    browser.wait("bar.moment?.tick === 7");
    // Nothing is saved from before the oldest tick; and the memory has lost this one tick.
    let said = browser.run(
        "const { past } = plant.drivers[0]; const { first } = past; \
         Object.defineProperty(past, 'first', { get: () => (bar.moment?.tick === 7 ? bar.moment.ms + 1 : first), set() {} }); \
         document.querySelector('#save [data-ending=vcd]').click(); \
         return document.getElementById('status').textContent",
    );
    assert_eq!(
        said,
        "The moment that is shown has left the memory, so that nothing before it can be saved."
    );
    wait_said(&browser, "the page shows the oldest that is left");
    browser.wait("bar.moment.tick < 7 && document.getElementById('moment').textContent.endsWith(`tick ${bar.moment.tick}`)");
}

#[test]
fn drivers_that_have_left_take_the_past_with_them() {
    let machine = filled();
    let browser = open(&machine, 1280, 800);
    wait_shown(&browser, "Level", "250.00mm");
    browser.run("document.getElementById('pause').click()");
    browser.wait("bar.moment && document.body.classList.contains('is-past')");
    browser.run(
        "const empty = { layout: -1, full: true, time_ms: 0, past: {}, signals: { drivers: [] }, line: { drivers: [] } }; \
         plant.hear(JSON.stringify(empty)); bar.redraw()",
    );
    browser.wait("!document.body.classList.contains('is-past')");
    assert_eq!(
        browser.run("return document.getElementById('link').textContent"),
        "live"
    );
}

#[test]
fn an_outage_is_found_and_the_time_before_it_is_saved() {
    let mut machine = Machine::rig();
    let mut plc = machine.plc();
    let browser = open(&machine, 1280, 900);
    browser.wait("plant.signals.every((it) => !it.isStale)");
    browser
        .wait("plant.drivers[0].line.state === 'running' && plant.drivers[0].line.since_ms > 1500");
    plc.kill();
    browser.wait("plant.signals.some((it) => it.isStale)");
    browser.run("document.getElementById('more-time').open = true");
    click(&browser, "#last-goal");
    browser.wait("bar.moment");
    let stale = "plant.signals.filter((it) => it.direction === 'Q').every((it) => it.isStale)";
    assert_eq!(browser.run(&format!("return {stale}")), true);
    assert_eq!(
        browser.run("return document.querySelector('.picture').classList.contains('is-stale')"),
        true
    );
    browser.run("bar.step(-1)");
    browser.wait(&format!("!({stale})"));
    browser.wait("!document.querySelector('.picture').classList.contains('is-stale')");
    // The line broke before the data were too old.
    browser.run("bar.show(`at/${bar.moment.ms - 1000}`)");
    browser.wait("document.querySelector('.driver .tag').textContent === 'running'");
    browser.run("const real = URL.createObjectURL; URL.createObjectURL = (it) => { window.saved = it; return real(it); }");
    for (ending, begin) in [
        ("vcd", "$version tickbus"),
        ("csv", "bus.tick,"),
        ("html", "<!DOCTYPE html>"),
    ] {
        browser.run("window.saved = null");
        click(&browser, &format!("#save [data-ending={ending}]"));
        browser.wait("window.saved");
        let text = browser.run("return (await window.saved.text()).slice(0, 40)");
        assert!(
            text.as_str().is_some_and(|text| text.starts_with(begin)),
            "{text}"
        );
    }
    wait_said(&browser, "Saved: ");
    browser.run("document.getElementById('goal').value = 'fault'");
    click(&browser, "#last-goal");
    wait_said(&browser, "There is no earlier fault in the recorded time.");
    assert_quiet(&browser);
    // A restart begins another past.
    machine.restart();
    browser.wait("!bar.moment && document.getElementById('link').textContent === 'live'");
    // And the bar goes on after this connection, which has the same drivers.
    browser.wait("plant.drivers[0].past?.tick > 0");
    click(&browser, "#pause");
    browser.wait("bar.moment");
    click(&browser, "#to-live");
    browser.wait("!bar.moment");
}

#[test]
fn a_new_connection_with_the_same_run_leaves_the_moment_that_is_shown() {
    let machine = Machine::rig();
    let browser = open(&machine, 1280, 900);
    browser.wait("bar.lead?.past.tick > 0");
    browser.run(
        "window.full = 0; window.lead = bar.lead; const hear = plant.hear; \
         plant.hear = (text) => { window.full += JSON.parse(text).full ? 1 : 0; return hear(text); }",
    );
    click(&browser, "#pause");
    browser.wait("bar.moment");
    let tick = browser.run("return bar.moment.tick");
    // As when the reader comes back from another tab.
    browser.run("document.dispatchEvent(new Event('visibilitychange'))");
    browser.wait("window.full > 0");
    assert_eq!(
        browser.run("await new Promise(requestAnimationFrame); return bar.moment?.tick"),
        tick
    );
    assert_eq!(browser.run("return bar.lead === window.lead"), true);
    click(&browser, "#to-live");
    browser.wait("!bar.moment && plant.signals.every((it) => it.value === it.live[0])");
    assert_quiet(&browser);
}

#[test]
fn a_thousand_signals_are_scrubbed() {
    let mut signals = String::new();
    for n in 0..500 {
        let _ = writeln!(
            signals,
            "[[signal]]\nname = \"In {n}\"\naddress = \"%IW{}\"\ntype = \"INT\"\n[[signal]]\nname = \"Out {n}\"\naddress = \"%QW{}\"\ntype = \"INT\"",
            2 * n,
            2 * n
        );
    }
    let machine = Machine::new("modbus-server", "", &signals);
    let browser = open(&machine, 1280, 800);
    for value in 1..=8 {
        for block in 0..5 {
            let values = vec![value.to_string(); 100];
            machine.write_all(&(100 * block).to_string(), &values);
        }
    }
    browser.wait("tickbusPage.value('In 499') === 8");
    // From one end of the bar to the other, twice, by as many moves as a hand makes.
    browser.run(
        "const range = document.getElementById('scrub'); bar.frames.length = 0; \
         for (let i = 0; i <= 240; i++) { \
           const at = Math.abs((i % 120) / 60 - 1); \
           range.value = Number(range.min) + (range.max - range.min) * at; \
           range.dispatchEvent(new Event('input')); \
           await new Promise((go) => requestAnimationFrame(go)); }",
    );
    let figures = browser.run("const all = [...bar.frames].sort((a, b) => a - b); return [all.length, all[all.length >> 1], all[Math.floor(all.length * 0.99)], all.at(-1)]");
    println!("scrubbing 1,000 signals: frames, p50, p99, longest in ms: {figures}");
    assert!(figures[0].as_i64() > Some(20), "{figures}");
    browser.run("bar.show(`at/${document.getElementById('scrub').min}`)");
    browser.wait("tickbusPage.value('In 499') !== 8");
    assert_quiet(&browser);
}

#[test]
fn the_bar_fits_every_screen_in_the_light_and_in_the_dark() {
    let machine = filled();
    let shots = std::env::var_os("TICKBUS_SHOTS").map(std::path::PathBuf::from);
    let browser = open(&machine, 1280, 800);
    wait_shown(&browser, "Level", "250.00mm");
    for scheme in ["light", "dark"] {
        browser.devtools(
            "Emulation.setEmulatedMedia",
            &json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]}),
        );
        for (width, height) in [(1440, 900), (390, 844)] {
            browser.devtools(
                "Emulation.setDeviceMetricsOverride",
                &json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}),
            );
            browser.run("bar.live()");
            browser.run("if (!plant.signals[3].isOpen) list.toggle(plant.signals[3])");
            browser.run("list.select(plant.signals[3])");
            browser.wait("plant.signals[3].trend?.values.length >= 3");
            browser.run("document.getElementById('more-time').open = false; for (let i = 0; i < 30; i++) await new Promise((go) => requestAnimationFrame(go))");
            assert_fits(&browser);
            shoot(
                &browser,
                shots.as_deref(),
                &format!("live-{scheme}-{width}.png"),
                false,
            );
            browser.run("document.getElementById('goal').value = 'signal'; document.getElementById('more-time').open = true; await bar.jump(false); bar.step(-1); for (let i = 0; i < 30; i++) await new Promise((go) => requestAnimationFrame(go))");
            assert_fits(&browser);
            shoot(
                &browser,
                shots.as_deref(),
                &format!("past-{scheme}-{width}.png"),
                false,
            );
        }
    }
    assert_quiet(&browser);
}
