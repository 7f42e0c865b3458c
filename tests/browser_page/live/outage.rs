//! The outage as a picture: which box is broken, what to do, and the last events.

use std::io::{BufRead as _, BufReader};
use std::net::TcpListener;
use std::process::{Command, Stdio};
use std::sync::Arc;

use serde_json::json;

use super::{Machine, TANK, force, open};
use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, find};

const TOLD: &str = "document.querySelector('.told').textContent";

/// The looks of the boxes, from the PLC to the machine.
fn looks(browser: &Browser) -> String {
    let looks =
        browser.run("return [...document.querySelectorAll('.way li')].map((it) => it.className)");
    let looks: Vec<&str> = looks
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|it| it.as_str())
        .collect();
    looks.join(" ")
}

/// The names of the events, the newest first.
fn events(browser: &Browser) -> Vec<String> {
    let names = browser
        .run("return [...document.querySelectorAll('.events strong')].map((it) => it.textContent)");
    let names = names.as_array().expect("a list").iter();
    names
        .filter_map(|it| it.as_str().map(str::to_owned))
        .collect()
}

#[test]
fn a_plc_that_dies_and_comes_back_is_marked_told_once_and_listed() {
    let machine = Machine::rig();
    let browser = open(&machine, 1280, 1000);
    // Nobody has come: the page says what to enter in the PLC.
    browser.wait(&format!(
        "{TOLD}.startsWith('No PLC has connected to port')"
    ));
    assert!(
        browser
            .run(&format!(
                "return {TOLD}.includes('Enter 127.0.0.1 and port')"
            ))
            .as_bool()
            .expect("a truth")
    );
    assert_eq!(looks(&browser), "bad unknown good good");
    shoot(
        &browser,
        crate::screenshots().as_deref(),
        "outage-never.png",
        false,
    );
    let mut plc = machine.plc();
    browser.wait("document.querySelector('.told').hidden");
    browser.wait("document.querySelectorAll('.way .good').length === 4");
    shoot(
        &browser,
        crate::screenshots().as_deref(),
        "outage-healthy.png",
        false,
    );
    // A screen reader gets the sentence once, not at each attempt.
    browser.run(
        "window.told = []; new MutationObserver(() => window.told.push(document.querySelector('.told').textContent)) \
         .observe(document.querySelector('.told'), { childList: true, characterData: true, subtree: true })",
    );
    plc.kill();
    browser.wait("document.querySelector('.way .bad .mark')?.textContent === '✕'");
    browser.wait("[...document.querySelectorAll('.events strong')].some((it) => /lost|silent/.test(it.textContent))");
    browser.wait("/since \\d\\d:\\d\\d:\\d\\d/.test(document.querySelector('.told').textContent)");
    browser.run("await new Promise((go) => setTimeout(go, 2500))");
    let told = browser.run("return window.told.length");
    assert!(told.as_u64().is_some_and(|told| told <= 3), "{told}");
    shoot(
        &browser,
        crate::screenshots().as_deref(),
        "outage-broken.png",
        false,
    );
    let dark = json!({"features": [{"name": "prefers-color-scheme", "value": "dark"}]});
    browser.devtools("Emulation.setEmulatedMedia", &dark);
    browser.run("document.querySelector('.told').scrollIntoView({ behavior: 'instant' })");
    shoot(
        &browser,
        crate::screenshots().as_deref(),
        "outage-dark.png",
        false,
    );
    let _plc = machine.plc();
    browser.wait("document.querySelectorAll('.way .good').length === 4");
    let names = events(&browser);
    assert_eq!(names[0], "connected", "{names:?}");
    assert!(names[1..].contains(&"connected".to_owned()), "{names:?}");
    assert!(names.len() <= 10);
    // A force does not push the events of the outage out of the list.
    force(&browser, "Start button", "TRUE");
    browser.wait("!document.getElementById('forced').hidden");
    browser.run("document.getElementById('release-all').click()");
    browser.wait("document.getElementById('forced').hidden");
    assert_eq!(events(&browser), names);
    // The bar of time shows the outage as it was.
    browser.run("await bar.jump(false)");
    browser.wait("bar.moment && document.querySelector('.way .bad')");
    browser.wait("/since [\\d.]+ s/.test(document.querySelector('.told').textContent)");
    browser.run("bar.live()");
    browser.wait("!bar.moment && document.querySelectorAll('.way .good').length === 4");
    assert_quiet(&browser);
}

#[test]
fn a_plc_that_does_not_answer_is_tried_again_with_a_countdown() {
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let bus = free.local_addr().expect("its address").to_string();
    drop(free);
    let folder = tempfile::tempdir().expect("a folder");
    let text = format!(
        "[driver]\nid = 7\nname = \"Tank\"\n[fieldbus]\nkind = \"modbus-client\"\naddress = \"{bus}\"\n[page]\nlisten = \
         \"127.0.0.1:0\"\n{TANK}"
    );
    let file = folder.path().join("tank.cfg");
    std::fs::write(&file, text).expect("there is room");
    let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("mirror")
        .arg(&file)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the tickbus program runs");
    let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
    let url = find(&mut lines, "mirror: page at ");
    std::thread::spawn(move || lines.count());
    let machine = Machine {
        child,
        bus: bus.clone(),
        url,
        folder: Arc::new(folder),
    };
    let browser = open(&machine, 390, 800);
    let nothing = json!(format!("Nothing answers at {bus}, since "));
    browser.wait(&format!("{TOLD}.startsWith({nothing})"));
    assert_eq!(looks(&browser), "bad unknown good good");
    // The page counts down to the next attempt, and joins the failed attempts into one event.
    let next = "document.querySelector('.next')";
    browser.wait(&format!("/^Next try in 2 s$/.test({next}.textContent)"));
    browser.wait(&format!("/^Next try in 1 s$/.test({next}.textContent)"));
    browser.wait("[...document.querySelectorAll('.events strong')].some((it) => /^\\d tries failed$/.test(it.textContent))");
    assert_fits(&browser);
    shoot(
        &browser,
        crate::screenshots().as_deref(),
        "outage-phone.png",
        false,
    );
    assert_quiet(&browser);
}
