//! The logic analyser: signals on one time axis, cursors, their distance, zoom, and the trigger.

use serde_json::{Value, json};

use super::{Machine, TANK, choose, open, wait_shown};
use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, middle, wait_said};

const SHIFT: &str = "\u{e008}";
const LEFT: &str = "\u{e012}";
const RIGHT: &str = "\u{e014}";

/// A further output, and the input on which it comes back.
const STEP: &str = r#"
[[signal]]
name = "Step wanted"
address = "%QW4"
type = "INT"
[[signal]]
name = "Step"
address = "%IW4"
type = "INT"
"#;

/// The machine after some edges of each signal.
fn worked() -> Machine {
    let machine = Machine::new("modbus-server", "", &format!("{TANK}{STEP}"));
    for (valve, level, step) in [("1", "0", "1"), ("0", "13824", "2"), ("1", "27648", "5")] {
        machine.write("0", "0", valve);
        machine.write("4", "1", level);
        machine.write("4", "2", step);
    }
    machine
}

/// Puts a signal onto the axis by its key.
fn add(browser: &Browser, name: &str) {
    choose(browser, name);
    browser.run("document.getElementById('list').focus()");
    browser.keys("a");
    wait_said(browser, &format!("{name} is on the axis"));
}

/// Three signals on the axis, with all their edges.
fn opened(machine: &Machine, width: u32, height: u32) -> Browser {
    let browser = open(machine, width, height);
    wait_shown(&browser, "Level", "500.00mm");
    for name in ["Level low", "Level", "Step"] {
        add(&browser, name);
    }
    browser.wait("analyser.tracks[2].values.includes(5) && analyser.tracks[0].values.length > 2");
    browser
}

/// The middle of the axis, as the pointer reaches it.
fn axis(browser: &Browser) -> (i64, i64) {
    middle(browser, "#plot")
}

/// The beginning and the length of the time on the axis.
fn shown(browser: &Browser) -> (f64, f64) {
    let view = browser.run("const { begin, end } = analyser.view; return [begin, end - begin]");
    let number = |at: usize| view[at].as_f64().expect("a number");
    (number(0), number(1))
}

fn drag(browser: &Browser, kind: &str, (x, y): (i64, i64), by: i64) {
    browser.act(&json!([{"type": "pointer", "id": kind, "parameters": {"pointerType": kind}, "actions": [
        {"type": "pointerMove", "x": x, "y": y, "duration": 0}, {"type": "pointerDown", "button": 0},
        {"type": "pointerMove", "x": x + by, "y": y, "duration": 60}, {"type": "pointerUp", "button": 0},
    ]}]));
}

/// The place of a signal's name in the list.
fn row_of(browser: &Browser, name: &str) -> (i64, i64) {
    let place = browser.run(&format!(
        "const box = {}.parts.name.getBoundingClientRect(); return [Math.round(box.left + 10), Math.round(box.top + 8)]",
        super::row(name)
    ));
    let number = |at: usize| place[at].as_i64().expect("a place");
    (number(0), number(1))
}

/// Presses a key while Shift is held.
fn shifted(browser: &Browser, key: &str) {
    browser.act(&json!([{"type": "key", "id": "keys", "actions": [
        {"type": "keyDown", "value": SHIFT}, {"type": "keyDown", "value": key},
        {"type": "keyUp", "value": key}, {"type": "keyUp", "value": SHIFT},
    ]}]));
}

fn wheel(browser: &Browser, (x, y): (i64, i64), by: i64) {
    browser.act(&json!([{"type": "wheel", "id": "wheel", "actions": [
        {"type": "scroll", "x": x, "y": y, "deltaX": 0, "deltaY": by, "duration": 0, "origin": "viewport"},
    ]}]));
}

/// Where an edge of a signal on the axis is on the screen, and its time.
fn edge(browser: &Browser, track: usize, value: i64) -> (i64, i64, f64) {
    let found = browser.run(&format!(
        "const {{ times, values }} = analyser.tracks[{track}]; const {{ begin, end }} = analyser.view; \
         const time = times[values.lastIndexOf({value})]; \
         const box = document.getElementById('plot').getBoundingClientRect(); \
         return [Math.round(box.left + (time - begin) / (end - begin) * (box.width - 10)), Math.round(box.top + 52 * {track} + 26), time]"
    ));
    (
        found[0].as_i64().expect("a place"),
        found[1].as_i64().expect("a place"),
        found[2].as_f64().expect("a time"),
    )
}

fn click_at(browser: &Browser, x: i64, y: i64) {
    browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [
        {"type": "pointerMove", "x": x, "y": y, "duration": 0}, {"type": "pointerDown", "button": 0},
        {"type": "pointerUp", "button": 0},
    ]}]));
}

/// The text of a part of each track.
fn read(browser: &Browser, part: &str) -> Value {
    browser.run(&format!(
        "return analyser.tracks.map(({{ parts }}) => parts.{part}.textContent)"
    ))
}

#[test]
fn two_cursors_snap_to_edges_and_tell_the_values_and_the_distance() {
    let machine = worked();
    let browser = opened(&machine, 1280, 900);
    assert_eq!(read(&browser, "now"), json!(["TRUE", "500.00 mm", "5"]));
    // The view must not move under the pointer.
    drag(&browser, "mouse", axis(&browser), 8);
    browser.wait("analyser.view.isHeld");
    browser.run("document.getElementById('zoom-all').click()");
    let (x, y, time) = edge(&browser, 1, 250);
    click_at(&browser, x + 1, y);
    browser.wait(&format!("bar.moment && bar.moment.ms === {time}"));
    browser.wait("document.getElementById('link').textContent === 'paused'");
    assert_eq!(read(&browser, "now"), json!(["FALSE", "250.00 mm", "1"]));
    let first = browser.run("return bar.moment.tick").as_i64();
    browser.run("document.getElementById('cursor-2').click()");
    let (x, y, time) = edge(&browser, 2, 5);
    click_at(&browser, x - 1, y);
    browser.wait(&format!(
        "analyser.second.ms === {time} && analyser.second.tick"
    ));
    browser
        .wait("/distance [\\d,]+ ticks?, /.test(document.getElementById('reading').textContent)");
    assert_eq!(read(&browser, "then"), json!(["TRUE", "500.00 mm", "5"]));
    let told = browser.run("return document.getElementById('reading').textContent");
    let ticks = browser.run("return analyser.second.tick").as_i64();
    let ticks = ticks.expect("a tick") - first.expect("a tick");
    let ms = browser.run("return (analyser.second.ms - bar.moment.ms).toFixed(3)");
    let distance = format!("distance {ticks} ticks, {} ms", ms.as_str().expect("text"));
    assert!(
        told.as_str()
            .expect("text")
            .replace(',', "")
            .ends_with(&distance.replace(',', "")),
        "{told} has {distance}"
    );
    shoot(
        &browser,
        crate::screenshots().as_deref(),
        "analyser.png",
        false,
    );
    // The bar's moment is the first cursor, and its steps move it.
    browser.run("document.getElementById('scrub').focus()");
    browser.keys(LEFT);
    browser.wait(&format!(
        "bar.moment.tick === {} - 1",
        first.expect("a tick")
    ));
    browser.wait("analyser.tracks[1].parts.now.textContent === '0.00 mm'");
    // The cursor follows the pointer, and ends on a tick.
    let (x, y, time) = edge(&browser, 1, 250);
    drag(&browser, "mouse", (x, y), 400);
    browser.wait(&format!("bar.moment.ms > {time}"));
    browser
        .wait("/distance −[\\d,]+ ticks, −/.test(document.getElementById('reading').textContent)");
    browser.run("document.getElementById('to-live').click()");
    browser.wait("!bar.moment && !analyser.view.isHeld");
    assert_quiet(&browser);
}

#[test]
fn the_axis_is_zoomed_and_moved_by_wheel_fingers_and_keys() {
    let machine = worked();
    let browser = opened(&machine, 1280, 900);
    let place = axis(&browser);
    drag(&browser, "mouse", place, 20);
    browser.wait("analyser.view.isHeld");
    let (begin, span) = shown(&browser);
    drag(&browser, "mouse", place, -100);
    browser.wait(&format!("analyser.view.begin > {begin}"));
    let (moved, _) = shown(&browser);
    let wide = browser.run("return document.getElementById('plot').clientWidth");
    let by = 100.0 * span / wide.as_f64().expect("a width");
    assert!((moved - begin - by).abs() < span / 100.0, "{begin} {moved}");
    wheel(&browser, place, -300);
    browser.wait(&format!(
        "analyser.view.end - analyser.view.begin < {span} * 0.8"
    ));
    // Two fingers that move apart show less time.
    let (_, span) = shown(&browser);
    let (x, y) = place;
    let finger = |id: &str, from: i64, to: i64| {
        json!({"type": "pointer", "id": id, "parameters": {"pointerType": "touch"}, "actions": [
            {"type": "pointerMove", "x": x + from, "y": y, "duration": 0}, {"type": "pointerDown", "button": 0},
            {"type": "pointerMove", "x": x + to, "y": y, "duration": 80}, {"type": "pointerUp", "button": 0},
        ]})
    };
    browser.act(&json!([finger("one", -50, -150), finger("two", 50, 150)]));
    browser.wait(&format!(
        "analyser.view.end - analyser.view.begin < {span} * 0.5"
    ));
    assert_eq!(browser.run("return bar.moment"), Value::Null);
    // By key: all of the time, and from edge to edge.
    browser.run("document.getElementById('plot').focus()");
    browser.keys("0");
    let reach = "plant.drivers[0].past.last - plant.drivers[0].past.first";
    browser.wait(&format!(
        "analyser.view.end - analyser.view.begin > ({reach}) * 0.8"
    ));
    browser.run("list.select(plant.signals.find((it) => it.name === 'Step'))");
    browser.run("document.getElementById('plot').focus()");
    shifted(&browser, LEFT);
    browser.wait("bar.moment && tickbusPage.value('Step') === 5");
    shifted(&browser, LEFT);
    browser.wait("tickbusPage.value('Step') === 2");
    browser.keys(LEFT);
    browser.wait("tickbusPage.value('Step') === 1");
    shifted(&browser, RIGHT);
    browser.wait("tickbusPage.value('Step') === 2");
    assert_quiet(&browser);
}

/// Waits for a condition, as with its button.
fn arm(browser: &Browser, condition: &str) {
    browser.run(&format!(
        "document.getElementById('trigger-text').value = {}; document.getElementById('arm').click()",
        json!(condition)
    ));
}

/// Waits until the sentence at the field of the condition begins like this.
fn wait_told(browser: &Browser, words: &str) {
    browser.wait(&format!(
        "document.getElementById('trigger-told').textContent.startsWith({})",
        json!(words)
    ));
}

#[test]
fn the_trigger_waits_on_after_a_restart_whose_time_begins_again() {
    let mut machine = worked();
    let browser = opened(&machine, 1280, 900);
    // Later than the change of the next run.
    browser.wait("bar.lead.past.last > 8000");
    arm(&browser, "Level low rises");
    browser.wait("trigger.isArmed");
    machine.restart();
    browser.wait("bar.lead?.past?.last < 4000 && bar.lead.past.tick > 0");
    assert_eq!(browser.run("return trigger.isArmed"), true);
    machine.write("0", "0", "0");
    machine.write("0", "0", "1");
    wait_said(&browser, "Level low rises: at ");
    browser.wait("bar.moment");
    let fired = browser.run("return bar.moment.ms");
    assert!(
        fired.as_f64().is_some_and(|ms| ms < 8000.0),
        "{fired} is a time of the second run, before the one at which it was armed"
    );
}

#[test]
fn the_trigger_stops_the_view_at_the_tick_of_the_change() {
    let machine = worked();
    let browser = opened(&machine, 1280, 900);
    arm(&browser, "Level > much");
    wait_told(&browser, "\"much\" is no number; ");
    arm(&browser, "Levle > 100 and Level low");
    wait_told(
        &browser,
        "there is no signal \"Levle\"; did you mean \"Level\"?",
    );
    let kept = browser.run(
        "return [document.activeElement.value, document.activeElement.getAttribute('aria-invalid'), trigger.isArmed]",
    );
    assert_eq!(kept, json!(["Levle > 100 and Level low", "true", false]));
    shoot(
        &browser,
        crate::screenshots().as_deref(),
        "condition.png",
        false,
    );
    // No sentence stays after a cancel, or beside a mistake.
    let is_silent = "document.getElementById('status').textContent === ''";
    arm(&browser, "Level low rises");
    wait_said(&browser, "The view stops when it happens.");
    browser.run("document.getElementById('arm').click()");
    browser.wait(is_silent);
    // As the server answers a text of 24 kB, but without an error in the browser's console.
    let refuse = "window.given = () => new Response('', { status: 431 })";
    browser.run(&format!(
        "const ask = room.ask; {refuse}; \
         room.ask = (path, options) => (given && path.includes('/when/') ? Promise.resolve(given()) : ask(path, options))"
    ));
    for way in ["arm", "last-when"] {
        browser.run(&format!(
            "{refuse}; document.getElementById('{way}').click()"
        ));
        wait_said(&browser, "The server refuses the request (status 431)");
        browser.run("given = null");
        arm(&browser, "Levle > 100");
        browser.wait(is_silent);
    }
    // The signal has another name after a restart of the program.
    arm(&browser, "Level low rises");
    browser.wait("trigger.isArmed");
    browser.run("document.activeElement.blur(); given = () => Response.json({ wrong: 'there is no signal \"Level low\"' })");
    wait_said(
        &browser,
        "Nothing is waited for any more: there is no signal \"Level low\"",
    );
    assert_eq!(
        browser.run("given = null; return [trigger.isArmed, document.activeElement.tagName]"),
        json!([false, "BODY"])
    );
    arm(&browser, "Level > 100");
    browser.wait("trigger.isArmed && !document.getElementById('trigger-told').textContent");
    // The signal is above the limit already, so the trigger waits until it has been below.
    machine.write("4", "1", "0");
    machine.write("4", "1", "2765");
    assert_eq!(browser.run("return trigger.isArmed"), true);
    machine.write("4", "1", "13824");
    wait_said(&browser, "Level > 100: at ");
    browser.wait("bar.moment && tickbusPage.value('Level') === 250");
    let tick = browser.run("return bar.moment.tick").as_u64();
    assert_eq!(
        browser.run("return [trigger.isArmed, analyser.view.isHeld]"),
        json!([false, true])
    );
    // At exactly that tick.
    browser.run("document.getElementById('step-back').click()");
    browser.wait(&format!(
        "bar.moment.tick === {}",
        tick.expect("a tick") - 1
    ));
    assert_eq!(browser.run("return tickbusPage.value('Level') < 100"), true);
    // Without its signal on the axis, and with two conditions from the list of those that are offered.
    browser.run("document.getElementById('trigger-text').value = ''; document.querySelector('#tracks .remove').click()");
    choose(&browser, "Level low");
    for offered in ["Level low falls", "Level >"] {
        browser.run(&format!(
            "const insert = document.getElementById('trigger-insert'); \
             [...insert.options].find((it) => it.text === '{offered}').selected = true; \
             insert.dispatchEvent(new Event('change'))"
        ));
    }
    browser.keys("20");
    browser.run("document.getElementById('arm').click()");
    browser.wait("trigger.isArmed && !bar.moment");
    machine.write("0", "0", "0");
    wait_said(&browser, "Level low falls and Level > 20: at ");
    browser
        .wait("bar.moment && !plant.number(plant.signals.find((it) => it.name === 'Level low'))");
    assert_quiet(&browser);
}

#[test]
fn a_signal_is_dropped_and_leaves_and_the_axis_fits_a_phone_in_the_dark() {
    let machine = worked();
    let browser = open(&machine, 1280, 900);
    wait_shown(&browser, "Level", "500.00mm");
    let hidden = "document.getElementById('analyser').hidden";
    assert_eq!(browser.run(&format!("return {hidden}")), true);
    let (x, y) = row_of(&browser, "Step");
    browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [
        {"type": "pointerMove", "x": x, "y": y, "duration": 0}, {"type": "pointerDown", "button": 0},
        {"type": "pointerMove", "x": x, "y": y - 40, "duration": 100}, {"type": "pause", "duration": 200},
        {"type": "pointerMove", "x": 300, "y": 50, "duration": 100}, {"type": "pause", "duration": 200},
        {"type": "pointerMove", "x": 310, "y": 50, "duration": 100}, {"type": "pointerUp", "button": 0},
    ]}]));
    browser.wait(&format!(
        "!{hidden} && analyser.tracks[0].signal.name === 'Step'"
    ));
    browser.wait("analyser.tracks[0].parts.states.title === 'Show Step as a curve'");
    browser.run("document.querySelector('#tracks .remove').click()");
    browser.wait(hidden);
    let dark = json!({"features": [{"name": "prefers-color-scheme", "value": "dark"}]});
    browser.devtools("Emulation.setEmulatedMedia", &dark);
    browser.resize(390, 844);
    browser.go(&machine.url);
    browser.wait("plant.signals.length > 0");
    wait_shown(&browser, "Level", "500.00mm");
    for name in ["Level low", "Level", "Step"] {
        browser.run(&format!(
            "list.select(plant.signals.find((it) => it.name === '{name}')); document.getElementById('analyse').click()"
        ));
        wait_said(&browser, &format!("{name} is on the axis"));
    }
    browser.wait("analyser.tracks.every(({ values }) => values.length > 2)");
    browser.run("views.reveal('recording')");
    browser.wait("document.getElementById('analyser').checkVisibility()");
    assert_fits(&browser);
    shoot(
        &browser,
        crate::screenshots().as_deref(),
        "analyser_phone.png",
        false,
    );
    let small = browser.run(
        "return Array.from(document.querySelectorAll('#analyser button, #analyser select')).filter((it) => it.offsetParent) \
         .filter((it) => !it.getAttribute('aria-label') && !it.textContent.trim() && !it.closest('label')).length",
    );
    assert_eq!(small, 0, "every control has a name");
    browser.run("document.querySelector('#tracks .remove').click()");
    assert_eq!(browser.run("return analyser.tracks.length"), 2);
    browser.run("for (const it of [1, 2]) document.querySelector('#tracks .remove').click()");
    browser.wait(hidden);
    assert_quiet(&browser);
}

#[test]
fn the_axis_is_there_again_after_a_reload() {
    let machine = worked();
    let browser = opened(&machine, 1280, 800);
    browser.run("analyser.tracks[2].parts.states.click(); analyser.zoom(0.5)");
    let axis = "return [analyser.tracks.map(({ signal, states }) => [signal.name, states]), analyser.view.end - analyser.view.begin]";
    let before = browser.run(axis);
    browser.go("about:blank");
    browser.go(&machine.url);
    browser.wait("window.tickbusPage?.painted && analyser.tracks.length === 3 && analyser.tracks[1].times.length > 1");
    let after = browser.run(axis);
    assert_eq!(after[0], before[0]);
    let [before, after] = [&before[1], &after[1]].map(|span| span.as_f64().expect("a time"));
    assert!((before - after).abs() < 1.0, "{before} and {after}");
    assert_quiet(&browser);
}

#[test]
fn a_trigger_that_slept_stops_at_the_first_of_many_changes() {
    let machine = worked();
    let browser = opened(&machine, 1280, 900);
    browser.run(
        "const ask = room.ask; const gate = new Promise((go) => { window.letGo = go; }); \
         room.ask = async (path, options) => { \
           if (trigger.isArmed && path.includes('/when/')) await gate; \
           return ask(path, options); \
         }",
    );
    let lows = "(await (await fetch('/trend/' + plant.drivers[0].id + '/' + plant.signals.find((it) => it.name === 'Level low').index)).json())";
    let known = browser.run(&format!("return {lows}.ms.length"));
    arm(&browser, "Level low rises");
    browser.wait("trigger.isArmed");
    for valve in ["0", "1", "0", "1", "0", "1"] {
        machine.write("0", "0", valve);
        let shown = if valve == "0" { "FALSE" } else { "TRUE" };
        wait_shown(&browser, "Level low", shown);
    }
    browser.run("letGo()");
    wait_said(&browser, "Level low rises: at ");
    let known = known.as_u64().and_then(|known| usize::try_from(known).ok());
    let trend = browser.run(&format!("return {lows}"));
    let rise = &trend["ms"][known.expect("a number") + 1];
    browser.wait(&format!("Math.abs(bar.moment?.ms - {rise}) < 1e-6"));
    assert_quiet(&browser);
}
