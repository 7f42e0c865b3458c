//! The views of the page, and the page on a phone: one thing at a time, by a thumb, and for a screen reader.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::{Machine, TANK, force, open, wait_marked};
use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, wait_said};

/// Drawn smaller than a thumb.
const PICTURE: &str = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 200"><title>The tank</title>
<g data-tb-press="Level low"><rect x="20" y="150" width="30" height="20"/><text x="20" y="160">Low</text></g>
<g data-tb-show="Valve"><rect x="150" y="20" width="30" height="30" data-tb-fill="Valve: off -> gray, on -> lime"/></g>
<text x="150" y="120" data-tb-text="Set point"/>
</svg>"#;

const SIZES: [(u32, u32); 2] = [(390, 844), (360, 640)];

fn tank() -> Machine {
    Machine::with(
        "modbus-server",
        "picture = \"tank.svg\"\n",
        TANK,
        &[("tank.svg", PICTURE)],
    )
}

/// A browser that has a touch screen.
fn phone(machine: &Machine, width: u32, height: u32) -> Browser {
    let browser = Browser::start(width, height);
    let touch = json!({"enabled": true, "maxTouchPoints": 2});
    browser.devtools("Emulation.setTouchEmulationEnabled", &touch);
    browser.go(&machine.url);
    browser.wait("document.getElementById('access').textContent === 'may force'");
    browser.wait("views.isPhone && document.body.dataset.view === 'machine'");
    browser.wait("document.querySelector('.picture > div > div')?.shadowRoot");
    browser
}

fn turn(browser: &Browser, width: u32, height: u32) {
    let metrics = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": true});
    browser.devtools("Emulation.setDeviceMetricsOverride", &metrics);
}

fn show(browser: &Browser, view: &str) {
    let fragment = format!("#{view}").replace("#overview", "");
    let tab = format!("document.querySelector('#tabs [href=\"/{fragment}\"]')");
    browser.wait(&tab);
    browser.run(&format!("{tab}.click()"));
    browser.wait(&format!("document.body.dataset.view === '{view}'"));
}

/// Puts a finger on an element, or lifts it.
fn finger(browser: &Browser, what: &str, selector: Option<&str>) {
    let points = match selector {
        Some(selector) => browser.run(&format!(
            "const box = document.querySelector(`{selector}`).getBoundingClientRect(); \
             return [{{ x: box.left + box.width / 2, y: box.top + box.height / 2 }}]"
        )),
        None => json!([]),
    };
    browser.devtools(
        "Input.dispatchTouchEvent",
        &json!({"type": what, "touchPoints": points}),
    );
}

#[test]
fn a_phone_shows_one_thing_at_a_time_and_all_of_it_above_the_thumb() {
    let machine = tank();
    for (width, height) in SIZES {
        let browser = phone(&machine, width, height);
        // One force, and one outage: no PLC has come.
        force(&browser, "Level", "125.5");
        browser.wait("!document.getElementById('forced').hidden");
        browser.wait("!document.getElementById('failsafe').hidden");
        // Within the window, above the bar of time, and not covered.
        let seen = |selector: &str| {
            let seen = browser.run(&format!(
                "const free = document.getElementById('foot').getBoundingClientRect().top; \
                 return Array.from(document.querySelectorAll(`{selector}`)).filter((it) => {{ \
                   const {{ top, bottom, left, height }} = it.getBoundingClientRect(); \
                   return height > 0 && top >= 0 && bottom <= free + 1 && it.contains(document.elementFromPoint(left + 9, (top + bottom) / 2)); \
                 }}).length"
            ));
            seen.as_u64().expect("a number")
        };
        let (pad, row) = (".pad", "#pad-forced li");
        assert_eq!([seen(".picture > div"), seen(pad), seen(row)], [1, 1, 1]);
        let high = browser
            .run("return document.querySelector('.picture > div').getBoundingClientRect().height");
        assert!(high.as_f64() >= Some(120.0), "the picture: {high}");
        for (view, selector, least) in [
            ("signals", ".row.signal", 3),
            ("line", ".way", 1),
            ("line", ".told", 1),
            ("recording", "#no-tracks", 1),
            ("machine", ".picture > div", 1),
        ] {
            show(&browser, view);
            browser.run("await new Promise((go) => setTimeout(go, 100))");
            let count = seen(selector);
            assert!(count >= least, "{view}, {width}: {count} of {selector}");
            let shown = browser.run(
                "return ['#machine', '#signals', '#line', '#analyser, #no-tracks'].filter((it) => \
                 Array.from(document.querySelectorAll(it)).some((it) => it.checkVisibility())).length",
            );
            assert_eq!(shown, 1, "{view}");
            let narrow = browser.run(
                "return Array.from(document.querySelectorAll('button, summary, select, nav a, input')).filter((it) => it.checkVisibility()) \
                 .map((it) => [it.id || it.textContent, it.getBoundingClientRect()]) \
                 .filter(([, { width, height }]) => width < 43.5 || height < 43.5).map(([name]) => name)",
            );
            assert_eq!(narrow, json!([]), "too small for a thumb: {view}");
            assert_fits(&browser);
            let name = format!("phone-{width}-{view}.png");
            shoot(&browser, crate::screenshots().as_deref(), &name, false);
        }
        assert_quiet(&browser);
    }
}

#[test]
fn a_large_button_holds_its_signal_while_a_finger_is_on_it_and_does_not_move() {
    let machine = tank();
    let browser = phone(&machine, 390, 844);
    browser.wait("document.querySelector('.pad')?.checkVisibility()");
    let place = || browser.run("return document.querySelector('.pad').getBoundingClientRect().top");
    browser.run("window.menus = []; window.addEventListener('contextmenu', (event) => menus.push(event.defaultPrevented))");
    let before = place();
    finger(&browser, "touchStart", Some(".pad"));
    browser.wait("document.querySelector('.pad').getAttribute('aria-pressed') === 'true'");
    browser.wait("!document.getElementById('forced').hidden");
    assert_eq!(machine.read("1", "0"), 1, "the PLC sees it");
    // Longer than the time after which a browser opens its menu.
    browser.run("await new Promise((go) => setTimeout(go, 900))");
    assert_eq!(place(), before);
    assert_eq!(machine.read("1", "0"), 1, "still held");
    finger(&browser, "touchEnd", None);
    browser.wait("document.querySelector('.pad').getAttribute('aria-pressed') === 'false'");
    browser.wait("document.getElementById('forced').hidden");
    assert_eq!(browser.run("return menus.includes(false)"), false);
    // A screen reader clicks without a pointer.
    browser.run(
        "const { change } = room; \
         window.sent = []; \
         room.change = (method, ...rest) => { sent.push(method); return change(method, ...rest); }; \
         document.querySelector('.pad').click()",
    );
    browser.wait("sent.join() === 'PUT,DELETE'");
    // A forced signal has a button that releases it, and the focus stays on the page.
    force(&browser, "Level", "20");
    browser.wait("document.querySelector('#pad-forced button')");
    browser.run("document.querySelector('#pad-forced button').focus()");
    browser.keys(super::ENTER);
    wait_said(&browser, "Level is released.");
    browser.wait("!document.querySelector('#pad-forced button')");
    assert_ne!(browser.run("return document.activeElement.tagName"), "BODY");
    assert_quiet(&browser);
}

#[test]
fn a_large_switch_is_turned_twice_at_the_same_place() {
    let picture = PICTURE.replace("data-tb-press", "data-tb-switch");
    let machine = Machine::with(
        "modbus-server",
        "picture = \"tank.svg\"\n",
        TANK,
        &[("tank.svg", &picture)],
    );
    let browser = phone(&machine, 390, 844);
    browser.wait("document.querySelector('.pad')?.checkVisibility()");
    let places = || {
        browser.run(
            "return ['.pad', '#pause'].map((it) => document.querySelector(it).getBoundingClientRect().top)",
        )
    };
    let before = places();
    for hidden in [false, true] {
        finger(&browser, "touchStart", Some(".pad"));
        finger(&browser, "touchEnd", None);
        browser.wait(&format!(
            "document.getElementById('forced').hidden === {hidden}"
        ));
        // Longer than the answer takes.
        browser.run("await room.ask('/access')");
        assert_eq!(places(), before);
    }
    assert_quiet(&browser);
}

#[test]
fn a_phone_that_is_turned_keeps_the_moment_and_the_view() {
    let machine = tank();
    let browser = phone(&machine, 390, 844);
    browser.wait("plant.drivers[0].past.tick > 100");
    finger(&browser, "touchStart", Some("#pause"));
    finger(&browser, "touchEnd", None);
    browser.wait("bar.moment");
    finger(&browser, "touchStart", Some("#step-back"));
    finger(&browser, "touchEnd", None);
    // Along the bar, to its middle.
    finger(&browser, "touchStart", Some("#scrub"));
    finger(&browser, "touchEnd", None);
    browser.wait("Math.abs(bar.moment.ms / plant.drivers[0].past.last - 0.5) < 0.3");
    show(&browser, "line");
    let moment = browser.run("return bar.moment.tick");
    turn(&browser, 844, 390);
    browser.wait("innerWidth === 844");
    let now = "return [bar.moment.tick, document.body.dataset.view, location.hash]";
    assert_eq!(browser.run(now), json!([moment, "line", "#line"]));
    browser.wait("document.querySelector('.way').getBoundingClientRect().bottom < document.getElementById('foot').getBoundingClientRect().top");
    turn(&browser, 390, 844);
    browser.wait("innerWidth === 390");
    assert_eq!(browser.run(now), json!([moment, "line", "#line"]));
    assert_quiet(&browser);
}

#[test]
fn each_view_has_an_address_and_no_change_of_view_loses_the_focus() {
    let machine = tank();
    let browser = open(&machine, 1440, 900);
    let view = "[document.body.dataset.view, location.hash]";
    assert_eq!(
        browser.run(&format!("return {view}")),
        json!(["overview", ""])
    );
    // By a click, by the address, and back.
    browser.wait("document.querySelector('#tabs [href=\"/#machine\"]')");
    browser.run("document.querySelector('#tabs [href=\"/#machine\"]').focus()");
    browser.keys(super::ENTER);
    browser.wait("document.body.dataset.view === 'machine'");
    let focus = "return document.activeElement.hash?.slice(1) ?? document.activeElement.id";
    assert_eq!(browser.run(focus), "machine");
    let share = browser.run("return document.querySelector('.picture').shadowRoot === null && document.querySelector('.picture > div').clientWidth / innerWidth");
    assert!(share.as_f64() > Some(0.9), "the whole width: {share}");
    browser.run("location.hash = '#signals'");
    browser.wait("document.body.dataset.view === 'signals'");
    browser.run("document.getElementById('list').focus()");
    browser.run("history.back()");
    browser.wait("document.body.dataset.view === 'machine'");
    assert_eq!(browser.run(focus), "machine", "the list is hidden");
    // What is not a view is left to others, and a token is taken.
    browser.run("location.hash = '#list'");
    browser.run(&format!(
        "location.hash = '#{}'",
        machine.url.split('#').nth(1).expect("a token")
    ));
    browser.wait("location.hash === ''");
    browser.wait("document.getElementById('access').textContent === 'may force'");
    assert_eq!(browser.run("return document.body.dataset.view"), "machine");
    // A link to a view, with the analyser on the whole height.
    browser.run("for (const signal of plant.signals) analyser.add(signal)");
    show(&browser, "recording");
    browser.wait("document.getElementById('plot').clientHeight > 400");
    show(&browser, "overview");
    browser.wait("document.getElementById('plot').clientHeight < 400");
    // The signals that are forced are shown from any view.
    force(&browser, "Level", "20");
    show(&browser, "line");
    browser.wait("!document.getElementById('forced').hidden");
    browser.run("document.getElementById('show-forced').click()");
    browser.wait("document.body.dataset.view === 'signals'");
    wait_marked(&browser, "Level", "forced");
    assert_quiet(&browser);
}

/// The page as a screen reader reads it: roles and names, with figures as `0`.
fn tree(browser: &Browser) -> String {
    const PASSED: [&str; 9] = [
        "generic",
        "none",
        "StaticText",
        "InlineTextBox",
        "paragraph",
        "LineBreak",
        "strong",
        "Canvas",
        "SvgRoot",
    ];
    browser.devtools("Accessibility.enable", &json!({}));
    let found = browser.devtools("Accessibility.getFullAXTree", &json!({}));
    let nodes = found["nodes"].as_array().expect("a tree");
    let by_id = |id: &Value| nodes.iter().find(|node| node["nodeId"] == *id);
    let mut text = String::new();
    let mut waiting = vec![(&nodes[0], 0)];
    while let Some((node, depth)) = waiting.pop() {
        let role = node["role"]["value"].as_str().unwrap_or_default();
        let is_read = node["ignored"] != true && !PASSED.contains(&role);
        if is_read {
            let name = node["name"]["value"].as_str().unwrap_or_default();
            let mut plain = String::new();
            for it in name.chars() {
                match it {
                    '0'..='9' if plain.ends_with('0') => {}
                    '0'..='9' => plain.push('0'),
                    _ => plain.push(it),
                }
            }
            writeln!(text, "{:depth$}{role} {plain}", "").expect("room");
        }
        let children = node["childIds"].as_array().into_iter().flatten();
        let children: Vec<_> = children.filter_map(by_id).collect();
        let depth = depth + usize::from(is_read);
        waiting.extend(children.into_iter().rev().map(|child| (child, depth)));
    }
    text
}

#[test]
fn a_screen_reader_reads_the_main_states_in_order() {
    let machine = tank();
    let browser = phone(&machine, 390, 844);
    force(&browser, "Level", "125.5");
    browser.wait("document.querySelector('#pad-forced button')");
    browser.wait("!document.getElementById('failsafe').hidden");
    let machine_view = tree(&browser);
    show(&browser, "line");
    // The forced signal comes with the next state of the line.
    browser.wait("document.querySelector('.faults li')?.checkVisibility()");
    let line_view = tree(&browser);
    show(&browser, "signals");
    browser.run("list.select(plant.signals[0])");
    browser.wait("!document.getElementById('chosen').hidden");
    let signals_view = tree(&browser);
    for (name, tree) in [
        ("machine", machine_view),
        ("line", line_view),
        ("signals", signals_view),
    ] {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join(format!("tests/browser_page/live/tree-{name}.txt"));
        if std::env::var_os("BLESS").is_some() {
            std::fs::write(&file, &tree).expect("there is room");
        }
        let right = std::fs::read_to_string(&file).unwrap_or_default();
        assert_eq!(tree, right, "{name}; BLESS=1 renews the file");
    }
}

#[test]
fn nothing_is_read_aloud_again_and_again() {
    let mut machine = tank();
    let browser = open(&machine, 1280, 800);
    browser.wait("plant.drivers[0].past.tick > 100");
    // What a screen reader hears: changes of text within live regions.
    browser.run(
        "window.heard = []; \
         const isLive = (it) => { \
           const own = it.closest('[aria-live], [role=status], [role=alert], [role=timer], output'); \
           return own && !it.closest('[aria-hidden=true]') && own.role !== 'timer' && own.ariaLive !== 'off'; \
         }; \
         new MutationObserver((changes) => { \
           for (const { target } of changes) { \
             const it = target instanceof Element ? target : target.parentElement; \
             if (it && isLive(it)) heard.push(it.id || it.className); \
           } \
         }).observe(document.body, { subtree: true, childList: true, characterData: true })",
    );
    for value in ["1000", "2000", "3000", "4000"] {
        machine.write("4", "1", value);
        browser.run("await new Promise((go) => setTimeout(go, 300))");
    }
    browser.run("document.getElementById('pause').click()");
    browser.wait("bar.moment");
    browser.run("await new Promise((go) => setTimeout(go, 1500)); document.getElementById('to-live').click()");
    browser.wait("!bar.moment");
    // The page is paused, and is live again.
    let heard =
        browser.run("return heard.filter((it) => !/^link$/.test(it) && !it.startsWith('told'))");
    assert_eq!(heard, json!([]));
    browser.run("heard.length = 0");
    machine.kill();
    browser.wait("document.body.classList.contains('is-old')");
    browser.run("await new Promise((go) => setTimeout(go, 2500))");
    let alerts = browser.run("return heard.filter((it) => it.startsWith('age')).length");
    assert_eq!(
        alerts, 0,
        "the alert is shown, and its seconds are not read"
    );
}
