//! Lists of signals: pins, order, groups and formats, kept in a file beside the driver.cfg; ways to force, and stored sets.

use std::fs;

use serde_json::json;

use super::{ENTER, Machine, TANK, assert_quiet_but, choose, open, row, wait_marked, wait_shown};
use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, click, wait_said};

/// An oven with two zones.
fn oven() -> String {
    let mut text = TANK.to_owned();
    for zone in 1..=2 {
        for (at, name) in ["temperature", "set point", "heater"].iter().enumerate() {
            text += &format!(
                "[[signal]]\nname = \"Oven zone {zone} {name}\"\naddress = \"%IW{}\"\ntype = \"WORD\"\n",
                10 * zone + 2 * at
            );
        }
    }
    text
}

/// The rows as they are shown: names of signals, and heads with their numbers of signals.
fn rows(browser: &Browser) -> serde_json::Value {
    browser.run(
        "document.getElementById('list').scrollIntoView({ behavior: 'instant' }); \
         await new Promise(requestAnimationFrame); await new Promise(requestAnimationFrame); \
         const top = (it) => it.getBoundingClientRect().top; \
         return Array.from(document.querySelectorAll('#window > .row')).filter((it) => !it.hidden).sort((a, b) => top(a) - top(b)) \
         .map((it) => it.dataset.kind === 'station' ? `${it.parts.name.textContent}: ${it.parts.facts.textContent.split(' ')[0]}` : it.parts.name.textContent)",
    )
}

fn set(browser: &Browser, id: &str, value: &str) {
    browser.run(&format!(
        "const it = document.getElementById('{id}'); it.value = {}; it.dispatchEvent(new Event('change'))",
        json!(value)
    ));
}

/// Presses a key with Alt in the list.
fn with_alt(browser: &Browser, key: &str) {
    browser.run(&format!(
        "document.getElementById('list').dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}', altKey: true, bubbles: true }}))"
    ));
}

#[test]
fn a_list_is_made_by_hand_saved_beside_the_driver_and_shared_by_its_link() {
    let screenshots = crate::screenshots();
    let machine = Machine::new("modbus-server", "", &oven());
    let file = machine.folder.path().join("tank.lists.toml");
    let browser = open(&machine, 1440, 900);
    browser.wait("watch.files.size === 1");
    // Pinned by the keyboard and by the pointer, moved by the keyboard and by a drag.
    choose(&browser, "Level");
    browser.run("document.getElementById('list').focus()");
    browser.keys("w");
    wait_said(&browser, "Level is pinned to the top.");
    browser.run(&format!("{}.parts.pin.click()", row("Valve")));
    wait_said(&browser, "Valve is pinned to the top.");
    browser.run(&format!("{}.parts.pin.click()", row("Oven zone 2 heater")));
    with_alt(&browser, "ArrowDown");
    wait_said(&browser, "Level is number 2 of 3.");
    browser.run(&format!(
        "const data = new DataTransfer(); const drag = (row, kind) => row.parts.name.dispatchEvent(new DragEvent(kind, {{ bubbles: true, cancelable: true, dataTransfer: data }})); \
         drag({}, 'dragstart'); drag({1}, 'dragover'); drag({1}, 'drop'); document.dispatchEvent(new DragEvent('dragend'))",
        row("Oven zone 2 heater"),
        row("Valve")
    ));
    wait_said(&browser, "Oven zone 2 heater is number 1 of 3.");
    set(&browser, "watch-group", "prefix");
    assert_eq!(
        rows(&browser),
        json!([
            "Pinned: 3",
            "Oven zone 2 heater",
            "Valve",
            "Level",
            "Oven zone 1: 3",
            "Oven zone 1 temperature",
            "Oven zone 1 set point",
            "Oven zone 1 heater",
            "Oven zone 2: 2",
            "Oven zone 2 temperature",
            "Oven zone 2 set point",
            "Others: 2",
            "Level low",
            "Set point",
        ])
    );
    // A group is folded by the keyboard as well.
    browser.run("Array.from(document.querySelectorAll('.fold')).find((it) => !it.closest('.row').hidden && it.getAttribute('aria-label') === 'Oven zone 1').focus()");
    browser.keys(ENTER);
    browser.wait("document.activeElement.getAttribute('aria-expanded') === 'false'");
    assert_eq!(rows(&browser)[5], "Oven zone 2: 2");
    choose(&browser, "Oven zone 2 heater");
    set(&browser, "format", "binary");
    wait_shown(&browser, "Oven zone 2 heater", "2#0000_0000_0000_0000");
    shoot(&browser, screenshots.as_deref(), "live-lists", false);
    // Nothing is written until it is saved.
    assert!(!file.exists());
    browser.run("document.getElementById('watch-new').focus()");
    browser.keys(&format!("Level control{ENTER}"));
    wait_said(
        &browser,
        "The list \"Level control\" is saved in tank.lists.toml.",
    );
    let text = fs::read_to_string(&file).expect("the file");
    let right = "[[list]]\nname = \"Level control\"\ngroup = \"prefix\"\norder = \"file\"\npins = [\n    \"Oven zone 2 heater\",\n    \
                 \"Valve\",\n    \"Level\",\n]\n\n[list.formats]\n\"Oven zone 2 heater\" = \"binary\"\n";
    assert!(text.ends_with(right), "{text}");
    assert_eq!(browser.run("return location.hash"), "#list=Level%20control");
    // The view and the list have their places in the address, and Back leads to the view with its list.
    click(&browser, "#tabs [href=\"/#signals\"]");
    browser.wait("document.body.dataset.view === 'signals'");
    let address = "return [document.body.dataset.view, location.hash, watch.name]";
    let both = json!(["signals", "#signals&list=Level%20control", "Level control"]);
    assert_eq!(browser.run(address), both);
    click(&browser, "#tabs [href=\"/#line\"]");
    browser.wait("document.body.dataset.view === 'line'");
    browser.run("history.back()");
    browser.wait("document.body.dataset.view === 'signals'");
    assert_eq!(browser.run(address), both);
    browser.run("history.back()");
    browser.wait(
        "document.body.dataset.view === 'overview' && location.hash === '#list=Level%20control'",
    );
    let page = machine
        .url
        .split('#')
        .next()
        .expect("an address")
        .to_owned();
    // A change that is not saved stays when the page is loaded again.
    set(&browser, "watch-order", "changed");
    browser.go("about:blank");
    browser.go(&format!("{page}#list=Level%20control"));
    browser
        .wait("watch.files.size === 1 && watch.order === 'changed' && watch.pinned().length === 3");
    browser.wait("document.getElementById('watch-state').textContent === 'changed, not saved'");
    click(&browser, "#watch-revert");
    browser.wait(
        "watch.order === 'file' && document.getElementById('watch-state').textContent === ''",
    );
    // The list without a name stays one when it is saved as a second list.
    set(&browser, "watch-name", "");
    browser.run("document.getElementById('watch-new').focus()");
    browser.keys(&format!("second{ENTER}"));
    wait_said(&browser, "The list \"second\" is saved in tank.lists.toml.");
    set(&browser, "watch-name", "");
    assert_eq!(browser.run("return watch.name"), "");
    let text = fs::read_to_string(&file).expect("the file");
    assert_quiet(&browser);
    // A viewer without the token opens the link, and changes only this tab.
    let viewer = Browser::start(390, 844);
    viewer.go(&format!("{page}#list=Level%20control"));
    viewer.wait("watch.name === 'Level control' && list.kind === 'pinned'");
    assert_eq!(
        rows(&viewer),
        json!(["Level control: 3", "Oven zone 2 heater", "Valve", "Level"])
    );
    assert_fits(&viewer);
    choose(&viewer, "Valve");
    click(&viewer, "#pin-up");
    wait_said(&viewer, "Valve is number 1 of 3.");
    viewer.wait("document.getElementById('watch-file').hidden");
    shoot(&viewer, screenshots.as_deref(), "live-lists-phone", false);
    assert_eq!(fs::read_to_string(&file).expect("the file"), text);
    viewer.go(&format!("{page}#list=Levle"));
    assert_quiet(&viewer);
}

#[test]
fn a_comment_is_shown_and_found_and_signals_are_grouped_by_folder() {
    let screenshots = crate::screenshots();
    let commented = TANK
        .replacen(
            "latch =",
            "comment = \"Inlet valve Y17, beside the pump\"\nfolder = \"Outputs\"\nlatch =",
            1,
        )
        .replacen(
            "\"%IW2\"",
            "\"%IW2\"\ncomment = \"Radar in the lid\"\nfolder = \"Inputs\"",
            1,
        );
    let machine = Machine::new("modbus-server", "", &commented);
    let browser = open(&machine, 1440, 900);
    browser.wait("watch.files.size === 1");
    assert_eq!(
        browser.run("return document.getElementById('watch-folder').hidden"),
        false
    );
    set(&browser, "watch-group", "folder");
    let right = json!([
        "Outputs: 1",
        "Valve",
        "Inputs: 1",
        "Level",
        "No folder: 2",
        "Level low",
        "Set point",
    ]);
    assert_eq!(rows(&browser), right);
    // The row that has no comment has no element for one.
    let comments = "return Array.from(document.querySelectorAll('#window .comment')).map((it) => [it.textContent, it.clientWidth > 80])";
    assert_eq!(
        browser.run(comments),
        json!([
            ["Inlet valve Y17, beside the pump", true],
            ["Radar in the lid", true]
        ])
    );
    let title = format!("return {}.title", row("Level"));
    assert_eq!(browser.run(&title), "Level, INT at %IW2: Radar in the lid");
    choose(&browser, "Level");
    browser.wait(
        "document.getElementById('chosen-facts').textContent.startsWith('Radar in the lid · %IW2')",
    );
    shoot(&browser, screenshots.as_deref(), "live-comments", false);
    // A word of a comment is found; the row that had one before, and is used again, shows none.
    let filter = |words: &str| {
        browser.run(&format!(
            "const it = document.getElementById('filter'); it.value = {}; it.dispatchEvent(new Event('input'))",
            json!(words)
        ));
    };
    filter("RADAR");
    assert_eq!(rows(&browser), json!(["Inputs: 1", "Level"]));
    filter("set point");
    assert_eq!(rows(&browser), json!(["No folder: 1", "Set point"]));
    let left = format!(
        "return {}.parts.comment?.textContent ?? ''",
        row("Set point")
    );
    assert_eq!(browser.run(&left), "");
    filter("");
    browser.run("document.getElementById('watch-new').focus()");
    browser.keys(&format!("by folder{ENTER}"));
    wait_said(
        &browser,
        "The list \"by folder\" is saved in tank.lists.toml.",
    );
    let text = fs::read_to_string(machine.folder.path().join("tank.lists.toml"));
    assert!(text.expect("the file").contains("group = \"folder\""));
    assert_quiet(&browser);
    let phone = Browser::start(390, 844);
    phone.go(&machine.url);
    phone.wait("document.querySelectorAll('#window .comment').length === 2");
    assert_fits(&phone);
    shoot(&phone, screenshots.as_deref(), "live-comments-phone", false);
    assert_eq!(
        phone.run("return getComputedStyle(document.querySelector('#window .comment')).display"),
        "none"
    );
}

#[test]
fn a_file_that_somebody_edits_is_shown_and_not_overwritten() {
    let list = "[[list]]\nname = \"a\"\npins = [\"Level\", \"Levle\"]   # to be mended\n";
    let machine = Machine::with("modbus-server", "", TANK, &[("tank.lists.toml", list)]);
    let file = machine.folder.path().join("tank.lists.toml");
    let browser = open(&machine, 1440, 900);
    browser.wait("document.getElementById('watch-name').options.length === 2");
    set(&browser, "watch-name", "a");
    // A name without a signal is told, and stays.
    browser.wait("document.getElementById('watch-told').textContent === 'tank.lists.toml: line 3: the list \"a\" has \"Levle\", and there is no such signal; did you mean \"Level\"?'");
    assert_eq!(rows(&browser), json!(["a: 2", "Level", "Levle"]));
    // By hand, while the page has no change of its own: it follows.
    let text = list.replace("\"Levle\"", "\"Valve\"");
    fs::write(&file, &text).expect("there is room");
    wait_said(
        &browser,
        "The list \"a\" has been changed in the file, and is shown so.",
    );
    assert_eq!(rows(&browser), json!(["a: 2", "Level", "Valve"]));
    // By hand, while the page has one: neither is lost.
    set(&browser, "watch-order", "changed");
    browser.wait("document.getElementById('watch-state').textContent === 'changed, not saved'");
    let theirs = text.replace("\"Level\"", "\"Set point\"");
    fs::write(&file, &theirs).expect("there is room");
    wait_said(&browser, "and here as well: Revert shows that of the file.");
    click(&browser, "#watch-save");
    wait_said(
        &browser,
        "\"a\" has been changed in tank.lists.toml meanwhile, and is not overwritten",
    );
    assert_eq!(fs::read_to_string(&file).expect("the file"), theirs);
    click(&browser, "#watch-revert");
    browser.wait("document.getElementById('watch-state').textContent === ''");
    set(&browser, "watch-order", "changed");
    click(&browser, "#watch-save");
    wait_said(&browser, "The list \"a\" is saved");
    let text = fs::read_to_string(&file).expect("the file");
    assert!(
        text.contains("# to be mended") && text.contains("order = \"changed\""),
        "{text}"
    );
    // With mistakes it is told by line, and never written.
    let wrong = text.replace("order = \"changed\"", "order = \"chnged\"");
    fs::write(&file, &wrong).expect("there is room");
    browser.wait(
        "document.getElementById('watch-told').textContent.includes('did you mean \"changed\"?')",
    );
    browser.run("document.getElementById('watch-new').focus()");
    browser.keys(&format!("b{ENTER}"));
    wait_said(
        &browser,
        "nothing is saved until that is corrected, by hand",
    );
    assert_eq!(fs::read_to_string(&file).expect("the file"), wrong);
    assert_quiet_but(&browser, "/lists/");
}

#[test]
fn signals_are_written_once_pulsed_ramped_and_forced_in_sets() {
    let screenshots = crate::screenshots();
    let machine = Machine::tank();
    let browser = open(&machine, 1440, 900);
    browser.wait("watch.files.size === 1");
    machine.write("4", "1", "13824");
    choose(&browser, "Level");
    let enter = |value: &str| {
        browser.run("document.getElementById('force-value').focus(); document.getElementById('force-value').select()");
        browser.keys(&format!("{value}{ENTER}"));
    };
    set(&browser, "force-way", "once");
    enter("100");
    wait_said(&browser, "Level was 100 mm for one tick.");
    wait_shown(&browser, "Level", "250.00mm");
    set(&browser, "force-way", "ramp");
    set(&browser, "force-time", "0s");
    enter("100");
    wait_said(
        &browser,
        "write a time above 0 and up to 1h, such as 500ms or 10s",
    );
    set(&browser, "force-time", "1s");
    enter("100");
    wait_said(
        &browser,
        "Level goes to 100 mm within 1s, and is held there.",
    );
    wait_marked(&browser, "Level", "forced");
    browser.wait("tickbusPage.value('Level') < 240 && tickbusPage.value('Level') > 110");
    wait_shown(&browser, "Level", "100.00mm");
    assert_eq!(
        machine.read("3", "1"),
        5530,
        "27648 * 100 / 500, to the nearest"
    );
    // A BOOL has no ramp; its pulse ends by itself.
    choose(&browser, "Level low");
    browser.wait("document.getElementById('force-way').value === 'hold' && document.getElementById('force-ramp').disabled");
    set(&browser, "force-way", "pulse");
    set(&browser, "force-time", "3s");
    click(&browser, "#force-true");
    wait_said(&browser, "Level low is forced to TRUE for 3s.");
    wait_shown(&browser, "Level low", "TRUE");
    wait_shown(&browser, "Level low", "FALSE");
    wait_marked(&browser, "Level low", "");
    // What is forced is stored as a set, and comes back by one press.
    set(&browser, "force-way", "hold");
    click(&browser, "#force-true");
    wait_marked(&browser, "Level low", "forced");
    browser.run(
        "document.getElementById('sets').open = true; document.getElementById('sets-name').focus()",
    );
    browser.keys(&format!("start position{ENTER}"));
    wait_said(
        &browser,
        "The set \"start position\" is stored, with 2 signals.",
    );
    shoot(&browser, screenshots.as_deref(), "live-sets", false);
    let file = machine.folder.path().join("tank.lists.toml");
    let text = fs::read_to_string(&file).expect("the file");
    assert!(text.ends_with("[[set]]\nname = \"start position\"\n\n[set.values]\n\"Level low\" = true\nLevel = 100\n"), "{text}");
    let press = |name: &str| {
        browser.run(&format!(
            "document.querySelector('#sets-list button[aria-label=\"{name}\"]').click()"
        ));
    };
    press("Release the set start position");
    wait_said(&browser, "The set \"start position\" is released.");
    wait_marked(&browser, "Level", "");
    wait_marked(&browser, "Level low", "");
    press("Force the set start position");
    wait_said(&browser, "The set \"start position\" is forced.");
    wait_marked(&browser, "Level", "forced");
    wait_shown(&browser, "Level low", "TRUE");
    press("Remove the set start position");
    wait_said(
        &browser,
        "The set \"start position\" is removed from the file.",
    );
    assert!(
        !fs::read_to_string(&file)
            .expect("the file")
            .contains("[[set]]")
    );
    assert_quiet_but(&browser, "/force/");
}
