//! The studio browses the tags of a PLC: an OPC UA server of asyncua, whose tags become signals by mouse and by keys.

use std::io::{BufRead as _, BufReader};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::json;

use crate::studio::{ENTER, Studio, fill, open, wait_line};
use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, click};

const DOWN: &str = "\u{e015}";
const RIGHT: &str = "\u{e014}";

/// An asyncua server as a process.
struct Plc {
    child: Child,
    address: SocketAddr,
}

impl Plc {
    /// `None` without asyncua.
    fn new(security: &str, folder: &Path) -> Option<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let own = root.join("target/peers/main/bin/python");
        let mut found = [own, PathBuf::from("python3")].into_iter();
        let python = found.find(|python| {
            let tried = Command::new(python)
                .args(["-c", "import asyncua"])
                .stderr(Stdio::null())
                .status();
            tried.is_ok_and(|status| status.success())
        });
        let Some(python) = python else {
            eprintln!("skipped: no Python has asyncua; run tools/peers");
            return None;
        };
        let free = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr());
        let address = free.expect("a free port");
        let asked =
            json!({"url": format!("opc.tcp://{address}"), "security": security, "folder": folder});
        let mut child = Command::new(python)
            .arg(root.join("tests/peers/opcua_tags.py"))
            .arg(asked.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("it starts");
        let mut line = String::new();
        let stdout = child.stdout.take().expect("it is piped");
        BufReader::new(stdout)
            .read_line(&mut line)
            .expect("it speaks");
        assert_eq!(line.trim(), "ready");
        Some(Self { child, address })
    }

    fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Plc {
    fn drop(&mut self) {
        self.kill();
    }
}

fn text(address: SocketAddr, security: &str) -> String {
    format!(
        "[driver]\nid = 1\nname = \"T\"\n\n[fieldbus]\nkind = \"opcua-client\"\nurl = \"opc.tcp://{address}\"\nsecurity = \"{security}\"\n"
    )
}

/// The item of the tree with this name, as a script has it.
fn item(name: &str) -> String {
    format!(
        "[...document.querySelectorAll('#tree li')].find((it) => it.querySelector('.tag-name').textContent === {})",
        json!(name)
    )
}

fn browse(browser: &Browser) {
    click(browser, "#browse");
    browser.wait("document.querySelectorAll('#tree li').length > 0");
}

fn open_folder(browser: &Browser, name: &str) {
    browser.run(&format!("{}.click()", item(name)));
    browser.wait(&format!(
        "{}.getAttribute('aria-expanded') === 'true'",
        item(name)
    ));
}

fn told(browser: &Browser, words: &str) {
    browser.wait(&format!(
        "document.getElementById('tags-told').textContent.includes({})",
        json!(words)
    ));
}

/// Drags an item of the tree to an element, as a pointer does.
fn drag(browser: &Browser, name: &str, to: &str) {
    let places = browser.run(&format!(
        "const at = {}; at.scrollIntoView({{block: 'nearest', behavior: 'instant'}}); const to = {to}; \
         return [at, to].flatMap((it) => {{ const box = it.getBoundingClientRect(); \
         return [Math.round(box.left + box.width / 2), Math.round(box.top + box.height / 2)]; }})",
        item(name)
    ));
    let go = |x: usize| json!({"type": "pointerMove", "duration": 80, "x": places[x], "y": places[x + 1]});
    browser.act(&json!([{"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": [
        go(0), {"type": "pointerDown", "button": 0}, go(2), go(2), {"type": "pointerUp", "button": 0},
    ]}]));
}

fn signals(browser: &Browser, condition: &str) {
    browser.wait(&format!(
        "(({{ signals, at }}) => {condition})(tickbusStudio.file.sheet) && !tickbusStudio.isBusy"
    ));
}

#[test]
fn tags_of_an_asyncua_server_are_dragged_into_the_table_and_their_values_move() {
    let folder = tempfile::tempdir().expect("a folder");
    let Some(plc) = Plc::new("None", folder.path()) else {
        return;
    };
    let studio = Studio::new(Some(&text(plc.address, "None")));
    let browser = open(&studio, 1400, 1000);
    browse(&browser);
    open_folder(&browser, "Cell");
    // Marked, and added.
    browser.run(&format!("{}.click()", item("Level")));
    click(&browser, "#add-tags");
    signals(&browser, "signals.length === 1");
    // Dragged into the empty space of the table.
    drag(&browser, "Lamp", "document.getElementById('grid')");
    signals(&browser, "signals.length === 2");
    let wanted = "\n[fieldbus.at]\nLevel = \"nsu=urn:test:signals;s=Cell.Level\"\nLamp = \"nsu=urn:test:signals;s=Cell.Lamp\"\n\n\
                  [[signal]]\nname    = \"Level\"\naddress = \"%QW0\"\ntype    = \"INT\"\ncomment = \"Of the tank, in <b>mm</b>\"\n\n\
                  [[signal]]\nname    = \"Lamp\"\naddress = \"%QX2.0\"\n";
    let whole = studio.text();
    assert!(whole.ends_with(wanted), "{whole}");
    let shots = crate::screenshots();
    shoot(&browser, shots.as_deref(), "studio_tags.png", false);
    click(&browser, "#start");
    wait_line(&browser, "running");
    let value = "document.querySelectorAll('#rows .c-value')[0].textContent";
    browser.wait(&format!("{value} !== ''"));
    browser.run(&format!("window.first = {value}"));
    browser.wait(&format!("{value} !== window.first"));
    shoot(&browser, shots.as_deref(), "studio_tags_running.png", false);
    click(&browser, "#stop");
    // Until nothing moves on the page any more.
    wait_line(&browser, "stopped");
    signals(&browser, "true");
    // On a row: the place of that signal, and one step of undo.
    drag(&browser, "Speed", "document.querySelector('#rows .row')");
    signals(&browser, "at.Level === 'nsu=urn:test:signals;s=Cell.Speed'");
    browser.wait("document.getElementById('told').textContent.includes('The tag is REAL, and the signal INT')");
    click(&browser, "#undo");
    signals(&browser, "at.Level === 'nsu=urn:test:signals;s=Cell.Level'");
    assert_eq!(studio.text(), whole);
    // What cannot be a signal says why, and what looks like markup is text.
    let why = |name: &str| {
        let more = format!(
            "return {}.querySelector('.tag-more').textContent",
            item(name)
        );
        browser.run(&more).as_str().expect("a text").to_owned()
    };
    assert!(why("Text").contains("this is String"), "{}", why("Text"));
    assert!(why("List").contains("this is an array"), "{}", why("List"));
    assert!(
        why("Start").contains("this is a method"),
        "{}",
        why("Start")
    );
    assert!(why("Opaque").contains("GUID"), "{}", why("Opaque"));
    assert!(why("<img src=x onerror=alert(1)>").contains("s=Cell.<img src=x"));
    assert_eq!(browser.run("return document.images.length"), json!(0));
    // A way back leads in no circle, and a name that is taken gets that of its folder.
    open_folder(&browser, "Inner");
    let above = "[...document.querySelectorAll('#tree li')].filter((it) => it.textContent.includes('open above')).length";
    assert_eq!(browser.run(&format!("return {above}")), json!(2));
    browser.run("const inner = [...document.querySelectorAll('#tree li[aria-level=\"3\"]')].find((it) => it.textContent.startsWith('Level')); inner.click()");
    click(&browser, "#add-tags");
    signals(&browser, "signals.length === 3");
    let last = "name    = \"Inner.Level\"\naddress = \"%ID0\"\ntype    = \"UDINT\"\n";
    assert!(studio.text().ends_with(last), "{}", studio.text());
    // Thousands of nodes have an end, and the page says so.
    open_folder(&browser, "Many");
    let note = browser.run(&format!(
        "return {}.querySelector('.tag-note').textContent",
        item("Many")
    ));
    assert!(
        note.as_str()
            .expect("a text")
            .contains("more than 2000 nodes"),
        "{note}"
    );
    assert_quiet(&browser);
}

#[test]
fn tags_become_signals_by_keys_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let Some(plc) = Plc::new("None", folder.path()) else {
        return;
    };
    let signal = "\n[[signal]]\nname = \"Tank\"\naddress = \"%QW0\"\ntype = \"INT\"\n";
    let studio = Studio::new(Some(&format!("{}{signal}", text(plc.address, "None"))));
    let browser = open(&studio, 390, 844);
    browser.run("document.getElementById('browse').focus()");
    browser.keys(ENTER);
    browser.wait("document.querySelectorAll('#tree li').length > 0");
    browser.run("document.querySelector('#tree li[tabindex=\"0\"]').focus()");
    let focus = |name: &str| {
        browser.wait(&format!(
            "document.activeElement.querySelector('.tag-name')?.textContent === {}",
            json!(name)
        ));
    };
    // Aliases and Locations may be there, too.
    while browser.run("return document.activeElement.querySelector('.tag-name').textContent")
        != json!("Cell")
    {
        browser.keys(DOWN);
    }
    browser.keys(RIGHT);
    browser.wait(&format!(
        "{}.getAttribute('aria-expanded') === 'true'",
        item("Cell")
    ));
    browser.keys(RIGHT);
    focus("Level");
    browser.keys(ENTER);
    signals(&browser, "at.Tank === 'nsu=urn:test:signals;s=Cell.Level'");
    browser.keys(DOWN);
    focus("Lamp");
    browser.act(&json!([{"type": "key", "id": "keys", "actions": [
        {"type": "keyDown", "value": "\u{e009}"}, {"type": "keyDown", "value": ENTER},
        {"type": "keyUp", "value": ENTER}, {"type": "keyUp", "value": "\u{e009}"},
    ]}]));
    signals(
        &browser,
        "signals.length === 2 && signals[1].name === 'Lamp'",
    );
    assert_fits(&browser);
    let shots = crate::screenshots();
    shoot(&browser, shots.as_deref(), "studio_tags_phone.png", true);
    // A name follows into the place in the device.
    fill(&browser, 0, "name", "Vessel");
    signals(
        &browser,
        "at.Vessel === 'nsu=urn:test:signals;s=Cell.Level' && at.Tank === undefined",
    );
    browser.wait(
        "document.getElementById('told').textContent.includes('also renamed in fieldbus.at')",
    );
    assert_quiet(&browser);
}

#[test]
fn a_plc_that_is_not_there_dies_or_refuses_says_what_to_do_and_blocks_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let free = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr());
    let studio = Studio::new(Some(&text(free.expect("a free port"), "None")));
    let browser = open(&studio, 1200, 900);
    click(&browser, "#browse");
    told(&browser, "refuses connections");
    told(&browser, "switch on the server in the PLC");
    let Some(plc) = Plc::new("Basic256Sha256", folder.path()) else {
        return;
    };
    // Another security than the server has, and then a certificate that nobody has trusted yet.
    std::fs::write(studio.file(), text(plc.address, "None")).expect("there is room");
    browser.wait(&format!(
        "tickbusStudio.file.sheet.fieldbus.url.endsWith('{}')",
        plc.address.port()
    ));
    click(&browser, "#browse");
    told(&browser, "no endpoint with security = \"None\"");
    std::fs::write(studio.file(), text(plc.address, "Basic256Sha256")).expect("there is room");
    browser.wait("tickbusStudio.file.sheet.fieldbus.security === 'Basic256Sha256'");
    click(&browser, "#browse");
    told(&browser, "is not trusted");
    let shots = crate::screenshots();
    shoot(&browser, shots.as_deref(), "studio_tags_refused.png", false);
    let pki = studio.folder.path().join("pki");
    for file in std::fs::read_dir(pki.join("rejected")).expect("it is there") {
        let file = file.expect("it is there");
        std::fs::rename(file.path(), pki.join("trusted").join(file.file_name()))
            .expect("one folder");
    }
    browse(&browser);
    open_folder(&browser, "Cell");
    // It dies while somebody looks into it: the item says so, and the rest of the page works.
    let mut plc = plc;
    plc.kill();
    browser.run(&format!("{}.click()", item("Inner")));
    browser.wait(&format!(
        "/refuses connections|does not answer/.test({}.querySelector('.tag-note').textContent)",
        item("Inner")
    ));
    click(&browser, "#add-output");
    browser.wait("cells.isEditing");
    click(&browser, "#leave-plc");
    browser.wait("document.querySelectorAll('#tree li').length === 0");
    assert_quiet(&browser);
}
