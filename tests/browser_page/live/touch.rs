//! Touching the picture of the machine, by mouse, finger and keyboard.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};

use super::{Machine, TANK, open, row, wait_marked, wait_shown};
use crate::webdriver::{Browser, shoot};
use crate::{assert_quiet, wait_said};

const ENTER: &str = "\u{e007}";
const TAB: &str = "\u{e004}";

const PICTURE: &str = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 200">
<g id="start" data-tb-press="Level low"><rect x="20" y="120" width="100" height="60" fill="gray" data-tb-fill="Level low: off -> gray, on -> lime" data-tb-stroke="Valve: off -> gray, on -> lime"/><text x="40" y="155">Start</text></g>
<g id="turn" data-tb-switch="Level low"><rect x="150" y="120" width="100" height="60"/></g>
<rect id="level" x="20" y="20" width="100" height="80" fill="blue" data-tb-height="Level: 0..500"/>
<text id="point" x="150" y="60" data-tb-text="Set point"/>
</svg>"#;

fn touched() -> (Machine, Browser) {
    let machine = Machine::with(
        "modbus-server",
        "picture = \"tank.svg\"\n",
        TANK,
        &[("tank.svg", PICTURE)],
    );
    machine.write("4", "1", "13824");
    let browser = open(&machine, 1280, 800);
    browser.wait(&format!("{}?.getAttribute('aria-label')", part("start")));
    wait_shown(&browser, "Level", "250.00mm");
    (machine, browser)
}

fn part(id: &str) -> String {
    format!(
        "document.querySelector('.picture > div > div')?.shadowRoot?.getElementById({})",
        json!(id)
    )
}

/// The middle of a part, on the screen.
fn place(browser: &Browser, id: &str) -> (i64, i64) {
    let found = browser.run(&format!(
        "const box = {}.getBoundingClientRect(); \
         return [Math.round(box.left + box.width / 2), Math.round(box.top + box.height / 2)]",
        part(id)
    ));
    let number = |at: usize| found[at].as_i64().expect("a place");
    (number(0), number(1))
}

/// Moves a pointer to a part, and then does this.
fn point(browser: &Browser, kind: &str, id: &str, then: &[&str]) {
    let (x, y) = place(browser, id);
    let mut actions = vec![json!({"type": "pointerMove", "x": x, "y": y, "duration": 0})];
    actions.extend(
        then.iter()
            .map(|what| json!({"type": what, "button": 0, "duration": 0})),
    );
    browser.act(&json!([{"type": "pointer", "id": kind, "parameters": {"pointerType": kind}, "actions": actions}]));
}

fn key(browser: &Browser, what: &str, key: &str) {
    browser.act(&json!([{"type": "key", "id": "keys", "actions": [{"type": what, "value": key}]}]));
}

const DOWN_UP: [&str; 2] = ["pointerDown", "pointerUp"];

#[test]
fn a_part_tells_its_signal_is_found_in_the_list_and_opens_its_trend() {
    let folder = crate::screenshots();
    let (_machine, browser) = touched();
    let tip = "document.querySelector('.picture .tip:not([hidden])')?.textContent";
    point(&browser, "mouse", "level", &[]);
    browser.wait(&format!("{tip} === 'Level: 250.00 mm'"));
    point(&browser, "mouse", "start", &[]);
    browser.wait(&format!(
        "{tip}?.startsWith('Level low: FALSE · Valve: FALSE') && {tip}.endsWith('hold to press')"
    ));
    // A filter that hides the signal goes.
    browser.run("const it = document.getElementById('filter'); it.value = 'valve'; it.dispatchEvent(new Event('input'))");
    browser.wait(&format!("!({})", row("Level")));
    point(&browser, "mouse", "level", &DOWN_UP);
    browser.wait("document.getElementById('chosen-name').textContent === 'Level'");
    browser.wait(&format!(
        "{}?.getAttribute('aria-selected') === 'true'",
        row("Level")
    ));
    browser.wait("document.querySelectorAll('.picture .marks .chosen:not([hidden])').length === 1");
    // The reverse: what is chosen in the list is marked in the picture.
    super::choose(&browser, "Set point");
    let marked = format!(
        "(() => {{ const a = document.querySelector('.picture .marks .chosen:not([hidden])')?.getBoundingClientRect(); \
         const b = {}.getBoundingClientRect(); \
         return a && Math.abs(a.left + 3 - b.left) < 1 && Math.abs(a.width - 6 - b.width) < 1; }})()",
        part("point")
    );
    browser.wait(&marked);
    // By the keyboard: arrows go from part to part, the trend opens, and it is forced.
    browser.run(&format!("{}.ownerSVGElement.focus()", part("level")));
    key(&browser, "keyDown", "\u{e014}");
    key(&browser, "keyUp", "\u{e014}");
    let focused = |id: &str| {
        browser.wait(&format!(
            "document.querySelector('.picture > div > div').shadowRoot.activeElement === {}",
            part(id)
        ));
    };
    focused("start");
    browser.keys(TAB);
    focused("turn");
    browser.keys("\u{e014}");
    focused("level");
    browser.wait(&format!(
        "{}.getAttribute('aria-label') === 'Level: 250.00 mm'",
        part("level")
    ));
    browser.keys(ENTER);
    browser.wait("document.querySelector('.row.trend:not([hidden]) canvas')?.getAttribute('aria-label') === 'Trend of Level'");
    shoot(&browser, folder.as_deref(), "live-touch.png", false);
    browser.keys("f");
    browser.wait("document.activeElement.id === 'force-value'");
    browser.keys(&format!("100{ENTER}"));
    wait_said(&browser, "Level is forced to 100 mm.");
    // The alarm at the top moves the picture.
    browser.wait("!document.getElementById('forced').hidden");
    point(&browser, "mouse", "level", &[]);
    browser.wait(&format!("{tip}?.startsWith('Level: 100.00 mm, forced')"));
    assert_quiet(&browser);
}

#[test]
fn a_push_button_is_held_as_long_as_pointer_or_key() {
    let (machine, browser) = touched();
    let is_on = |what: bool| {
        wait_shown(&browser, "Level low", if what { "TRUE" } else { "FALSE" });
        wait_marked(&browser, "Level low", if what { "forced" } else { "" });
    };
    let is_held = "document.querySelector('.picture .marks .pressed:not([hidden])')";
    point(&browser, "mouse", "start", &["pointerDown"]);
    is_on(true);
    assert_eq!(machine.read("1", "0"), 1, "the PLC sees it");
    browser.wait(is_held);
    browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [{"type": "pointerUp", "button": 0}]}]));
    is_on(false);
    browser.wait(&format!("!{is_held}"));
    // By a finger, and by one that the browser takes away.
    let (x, y) = place(&browser, "start");
    for end in ["touchEnd", "touchCancel"] {
        let finger = |kind: &str, points: Value| {
            browser.devtools(
                "Input.dispatchTouchEvent",
                &json!({"type": kind, "touchPoints": points}),
            );
        };
        finger("touchStart", json!([{"x": x, "y": y}]));
        is_on(true);
        finger(end, json!([]));
        is_on(false);
    }
    for name in [" ", ENTER] {
        browser.run(&format!("{}.focus()", part("start")));
        key(&browser, "keyDown", name);
        is_on(true);
        key(&browser, "keyUp", name);
        is_on(false);
    }
    // Each of these ends the hold, and the button is let go.
    for end in [
        "document.querySelector('.picture > div > div').shadowRoot.activeElement.blur()",
        "window.dispatchEvent(new Event('blur'))",
        "touch.link(true); touch.link(false)",
        "document.getElementById('pause').click()",
    ] {
        browser.run(&format!("{}.focus()", part("start")));
        key(&browser, "keyDown", " ");
        browser.wait("plant.isForcedNow(plant.signals[1])");
        browser.run(end);
        browser.wait("!plant.isForcedNow(plant.signals[1])");
        key(&browser, "keyUp", " ");
    }
    // In the past nothing is pressed.
    browser.wait("bar.moment");
    point(&browser, "mouse", "start", &DOWN_UP);
    wait_said(
        &browser,
        "You look at the past, and a force acts on the present: press Live first.",
    );
    browser.run("document.getElementById('to-live').click()");
    browser.wait("!bar.moment");
    // A switch stays, until it is turned back.
    point(&browser, "mouse", "turn", &DOWN_UP);
    is_on(true);
    browser.wait(&format!("{}.ariaChecked === 'true'", part("turn")));
    point(&browser, "mouse", "turn", &DOWN_UP);
    is_on(false);
}

#[test]
fn quick_presses_and_another_page_leave_no_button_pressed() {
    let (machine, browser) = touched();
    let is_held = "document.querySelector('.picture .marks .pressed:not([hidden])')";
    let is_forced = "plant.isForcedNow(plant.signals[1])";
    // The second press begins while the first one is being let go, and lasts.
    for _ in 0..5 {
        point(
            &browser,
            "mouse",
            "start",
            &["pointerDown", "pointerUp", "pointerDown"],
        );
        browser.run("await new Promise((go) => setTimeout(go, 600))");
        browser.wait(&format!("{is_held} && {is_forced}"));
        assert_eq!(machine.read("1", "0"), 1, "the PLC sees it");
        browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [{"type": "pointerUp", "button": 0}]}]));
        browser.wait(&format!("!{is_held} && !{is_forced}"));
        assert_eq!(machine.read("1", "0"), 0, "the PLC sees it");
    }
    // Another page releases the signal while this one holds the button.
    point(&browser, "mouse", "start", &["pointerDown"]);
    wait_said(&browser, "Level low is pressed.");
    browser.wait(is_forced);
    browser.run("await room.change('DELETE', '/force/7/Level%20low')");
    wait_said(&browser, "Level low was let go by another page.");
    browser.wait(&format!("!{is_held}"));
    browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [{"type": "pointerUp", "button": 0}]}]));
    browser.wait(&format!("!{is_forced}"));
    assert_quiet(&browser);
}

#[test]
fn a_button_is_let_go_when_its_page_is_left() {
    let (machine, browser) = touched();
    point(&browser, "mouse", "start", &["pointerDown"]);
    wait_marked(&browser, "Level low", "forced");
    browser.go("about:blank");
    let begun = std::time::Instant::now();
    while machine.read("1", "0") == 1 {
        assert!(
            begun.elapsed().as_secs() < 5,
            "long before the grace time of ten seconds"
        );
    }
}

#[test]
fn without_the_token_a_button_says_why_it_is_not_pressed() {
    let (machine, _browser) = touched();
    let browser = Browser::start(1280, 800);
    browser.go(machine.url.split('#').next().expect("an address"));
    browser.wait(&format!("{}?.getAttribute('aria-label')", part("start")));
    browser.wait("document.getElementById('link').textContent === 'live'");
    point(&browser, "touch", "start", &DOWN_UP);
    wait_said(
        &browser,
        "Read-only: open the address that was printed, with its token, to force a signal.",
    );
    assert_eq!(machine.read("1", "0"), 0);
    assert_quiet(&browser);
}

#[test]
fn the_buttons_in_the_drawing_of_a_training_machine_work() {
    let folder = crate::screenshots();
    let temporary = tempfile::tempdir().expect("a folder");
    let config = include_str!("../../../examples/machines/two-tanks/driver.cfg")
        .replacen(
            "\"modbus-server\"",
            "\"modbus-server\"\naddress = \"127.0.0.1:0\"",
            1,
        )
        .replacen("[page]", "[page]\nlisten = \"127.0.0.1:0\"", 1);
    let picture = include_str!("../../../examples/machines/two-tanks/picture.svg");
    std::fs::write(temporary.path().join("tank.cfg"), config)
        .and_then(|()| std::fs::write(temporary.path().join("picture.svg"), picture))
        .expect("there is room");
    let machine = Machine::start(std::sync::Arc::new(temporary));
    // A PLC that stays: it writes the level, again and again.
    let mut plc = TcpStream::connect(&machine.bus).expect("it listens");
    plc.set_read_timeout(Some(Duration::from_secs(5)))
        .expect("a time-out");
    thread::spawn(move || {
        let mut answer = [0; 12];
        while plc
            .write_all(&[0, 1, 0, 0, 0, 6, 1, 6, 0, 1, 2, 128])
            .and_then(|()| plc.read_exact(&mut answer))
            .is_ok()
        {
            thread::sleep(Duration::from_millis(20));
        }
    });
    let browser = open(&machine, 1280, 800);
    let root = "document.querySelector('.picture > div > div')?.shadowRoot";
    for name in ["Start button", "Stop button"] {
        let script = format!(
            "{root}?.querySelector('[aria-label={}]')",
            json!(format!("{name}, push-button"))
        );
        browser.wait(&script);
        // On its caption, which belongs to it.
        let found = browser.run(&format!(
            "const box = {script}.querySelector('text').getBoundingClientRect(); \
             return [Math.round(box.left + box.width / 2), Math.round(box.top + box.height / 2)]"
        ));
        let act = |actions: Value| {
            browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": actions}]));
        };
        act(
            json!([{"type": "pointerMove", "x": found[0], "y": found[1], "duration": 0}, {"type": "pointerDown", "button": 0}]),
        );
        wait_shown(&browser, name, "TRUE");
        wait_marked(&browser, name, "forced");
        browser.wait(
            "document.querySelectorAll('.picture .marks .pressed:not([hidden])').length === 1",
        );
        if name == "Start button" {
            shoot(&browser, folder.as_deref(), "live-page-touch.png", false);
        }
        act(json!([{"type": "pointerUp", "button": 0}]));
        wait_marked(&browser, name, "");
    }
    for name in ["Control switch", "Batch switch"] {
        let script = format!(
            "{root}.querySelector('[role=switch][aria-label={}]')",
            json!(format!("{name}, switch"))
        );
        browser.run(&format!("{script}.focus()"));
        browser.keys(" ");
        wait_marked(&browser, name, "forced");
        browser.wait(&format!("{script}.ariaChecked === 'true'"));
    }
    assert_quiet(&browser);
}

#[test]
fn the_drawings_of_the_demos_have_buttons_and_switches_that_work() {
    let folder = crate::screenshots();
    for (name, config, picture, controls) in [
        (
            "rig",
            include_str!("../../../driver.cfg"),
            include_str!("../../../java/machines/rig.svg"),
            &[
                "Start button, push-button",
                "Stop button, push-button",
                "Reset button, push-button",
            ][..],
        ),
        (
            "bottle-rig",
            include_str!("../../../examples/machines/bottle-rig/driver.cfg"),
            include_str!("../../../examples/machines/bottle-rig/picture.svg"),
            &[
                "Start button, push-button",
                "Stop button, push-button",
                "Reset button, push-button",
            ],
        ),
        (
            "cell",
            include_str!("../../../plc/cell/cell.cfg"),
            include_str!("../../../java/machines/cell.svg"),
            &[
                "S1 rearm, push-button",
                "S1 start, switch",
                "S1 emergency, switch",
            ],
        ),
        (
            "board",
            include_str!("../../../plc/lab/board.cfg"),
            include_str!("../../../java/machines/board.svg"),
            &[
                "switch 1, switch",
                "switch 2, switch",
                "switch 3, switch",
                "switch 4, switch",
            ],
        ),
    ] {
        let temporary = tempfile::tempdir().expect("a folder");
        let signals = config.split_once("[[signal]]").expect("signals").1;
        let signals = signals.split("\n[[reply]]").next().expect("signals");
        let config = format!(
            "[driver]\nid = 1\nname = \"{name}\"\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n\
             [page]\nlisten = \"127.0.0.1:0\"\npicture = \"picture.svg\"\n[[signal]]{signals}"
        );
        // Of the dispatcher alone.
        let config = config.replace("dead_band = 0.1\n", "");
        std::fs::write(temporary.path().join("tank.cfg"), config)
            .and_then(|()| std::fs::write(temporary.path().join("picture.svg"), picture))
            .expect("there is room");
        let machine = Machine::start(std::sync::Arc::new(temporary));
        let browser = open(&machine, 1280, 800);
        let root = "document.querySelector('.picture > div > div')?.shadowRoot";
        for control in controls {
            let (signal, kind) = control.rsplit_once(", ").expect("its kind");
            // The label begins with what is written on the control, if that is something else.
            let script = format!("{root}?.querySelector('[aria-label$={}]')", json!(control));
            browser.wait(&script);
            let found = browser.run(&format!(
                "const box = {script}.querySelector('text').getBoundingClientRect(); \
                 return [Math.round(box.left + box.width / 2), Math.round(box.top + box.height / 2)]"
            ));
            let act = |actions: Value| {
                browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": actions}]));
            };
            let to = json!({"type": "pointerMove", "x": found[0], "y": found[1], "duration": 0});
            act(json!([to, {"type": "pointerDown", "button": 0}]));
            if kind == "push-button" {
                wait_marked(&browser, signal, "forced");
                wait_shown(&browser, signal, "TRUE");
            }
            act(json!([{"type": "pointerUp", "button": 0}]));
            wait_marked(
                &browser,
                signal,
                if kind == "switch" { "forced" } else { "" },
            );
        }
        let told = "return document.querySelectorAll('.picture details').length";
        assert_eq!(browser.run(told), 0, "{name}: nothing is left out or wrong");
        shoot(
            &browser,
            folder.as_deref(),
            &format!("touch-{name}.png"),
            false,
        );
        assert_quiet(&browser);
    }
}
