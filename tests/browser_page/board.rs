//! The patch bay as a tool: boxes that are moved, folded, grouped and kept; the path of a channel; the matrix; the history;
//! and the size of the page with many clients.

use serde_json::json;

use super::webdriver::Browser;
use super::{Lab, assert_fits, assert_quiet, click, jack, open, pin, wait_cables, wait_said};

fn title(name: &str) -> String {
    format!(".client[data-name=\"{name}\"] .title")
}

/// Where a box is, in the coordinates of the layout.
fn place(browser: &Browser, name: &str) -> (i64, i64) {
    let found = browser.run(&format!(
        "const {{ x, y }} = lab.places.get('{name}'); return [x, y]"
    ));
    let number = |at: usize| found[at].as_i64().expect("a place");
    (number(0), number(1))
}

fn wait_place(browser: &Browser, name: &str, (x, y): (i64, i64)) {
    browser.wait(&format!(
        "lab.places.get('{name}')?.x === {x} && lab.places.get('{name}').y === {y}"
    ));
}

/// Presses Control and Z together.
fn control_z(browser: &Browser) {
    const CONTROL: &str = "\u{e009}";

    browser.act(&json!([{"type": "key", "id": "keys", "actions": [
        {"type": "keyDown", "value": CONTROL}, {"type": "keyDown", "value": "z"},
        {"type": "keyUp", "value": "z"}, {"type": "keyUp", "value": CONTROL},
    ]}]));
}

/// Drags an element by some pixels.
fn drag_by(browser: &Browser, selector: &str, right: i64, down: i64) {
    let (x, y) = super::middle(browser, selector);
    browser.act(
        &json!([{"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": [
            {"type": "pointerMove", "x": x, "y": y, "duration": 0}, {"type": "pointerDown", "button": 0},
            {"type": "pointerMove", "x": x + right, "y": y + down, "duration": 60}, {"type": "pointerUp", "button": 0},
        ]}]),
    );
}

/// Lines of cables that cross a box, or a name or value in one.
const CROSSINGS: &str = "\
    const boxes = [...document.querySelectorAll('.client')].map((it) => it.getBoundingClientRect()); \
    const found = []; \
    for (const path of document.querySelectorAll('.cable .wire')) { \
      for (let at = 2; at < path.getTotalLength() - 2; at += 3) { \
        const { x, y } = path.getPointAtLength(at).matrixTransform(path.getScreenCTM()); \
        if (boxes.some((box) => x > box.left + 1 && x < box.right - 1 && y > box.top + 1 && y < box.bottom - 1)) { \
          found.push(path.parentNode.dataset.input); break; } } } \
    return found";

#[test]
fn boxes_are_moved_folded_and_grouped_and_stay_so_after_a_restart() {
    const RIGHT: &str = "\u{e014}";

    let mut lab = Lab::new();
    let pump = lab.join("VP PUMP Q02 I02");
    let mut logo = lab.join("VR LOGO Q02 I02");
    logo.say("CONNECT I1:PUMP:Q1 Q1:PUMP:I1");
    assert_eq!(logo.hear(), "OK CONNECT");
    let browser = open(&lab, 1300, 900);
    wait_cables(&browser, 2);
    let (pump_at, logo_at) = (place(&browser, "PUMP"), place(&browser, "LOGO"));
    assert_ne!(pump_at.0, logo_at.0, "beside each other");
    drag_by(&browser, &title("LOGO"), 100, 200);
    wait_said(&browser, "Moved LOGO.");
    // Boxes that are moved come onto a grid of 10 pixels.
    let moved = ((logo_at.0 + 105) / 10 * 10, (logo_at.1 + 205) / 10 * 10);
    wait_place(&browser, "LOGO", moved);
    // Another page sees the same.
    let other = Browser::start(1300, 900);
    other.go(lab.plain());
    wait_place(&other, "LOGO", moved);
    other.wait("document.querySelectorAll('.for-change').length && getComputedStyle(document.getElementById('arrange')).display === 'none'");
    // By keyboard; Enter folds.
    browser.run(&format!(
        "document.querySelector('{}').focus()",
        title("PUMP")
    ));
    browser.keys(RIGHT);
    browser.keys(RIGHT);
    wait_said(&browser, "Moved PUMP.");
    wait_place(&browser, "PUMP", (pump_at.0 + 40, pump_at.1));
    browser.keys("\u{e007}");
    wait_said(&browser, "Folded PUMP.");
    let folded = "document.querySelector('.client.folded[data-name=PUMP] .title')?.getAttribute('aria-expanded') === 'false' \
                  && !document.querySelector('[data-pin=\"PUMP:Q1\"]')";
    browser.wait(folded);
    other.wait(folded);
    browser.wait("document.activeElement.classList.contains('title')");
    // Its cables end at the folded box.
    assert_eq!(browser.run(CROSSINGS), json!([]));
    // Without the token only one's own page unfolds it.
    click(&other, &title("PUMP"));
    other.wait("document.querySelector('[data-pin=\"PUMP:Q1\"]')");
    browser.keys("g");
    browser.run(&format!(
        "document.querySelector('{}').focus()",
        title("LOGO")
    ));
    browser.keys("g");
    wait_said(&browser, "2 boxes are chosen.");
    browser.run("document.getElementById('group-name').focus()");
    browser.keys("Halle \"ä\"\u{e007}");
    let grouped = "document.querySelector('.frame-name')?.textContent === 'Halle \"ä\"'";
    browser.wait(grouped);
    other.wait(grouped);
    assert_eq!(browser.run(CROSSINGS), json!([]));
    assert_quiet(&browser);
    // After a restart everything is as it was, also for a client that is not here yet.
    let file = lab.folder.path().join("patch.layout.toml");
    browser.wait("true");
    drop(pump);
    lab.child_ends();
    let text = std::fs::read_to_string(&file).expect("it is kept");
    assert!(text.contains("group = \"Halle \\\"ä\\\"\""), "{text}");
    lab.restart();
    browser.go(&lab.url);
    wait_place(&browser, "LOGO", moved);
    wait_place(&browser, "PUMP", (pump_at.0 + 40, pump_at.1));
    browser.wait("document.querySelector('.client.away.folded[data-name=PUMP]')");
    browser.wait(grouped);
}

#[test]
fn a_change_is_undone_unless_somebody_else_has_changed_the_same() {
    let lab = Lab::new();
    let (mut pump, mut logo) = (lab.join("VP PUMP Q02 I01"), lab.join("VR LOGO I02"));
    pump.say("P Q1=24");
    let browser = open(&lab, 1300, 900);
    click(&browser, &pin("PUMP:Q1"));
    click(&browser, &pin("LOGO:I1"));
    assert_eq!(logo.hear(), "P I1=24");
    wait_cables(&browser, 1);
    control_z(&browser);
    wait_said(&browser, "Undone: Connected PUMP:Q1 with LOGO:I1.");
    assert_eq!(logo.hear(), "P I1=0");
    click(&browser, "#redo");
    wait_said(&browser, "Repeated: Connected PUMP:Q1 with LOGO:I1.");
    assert_eq!(logo.hear(), "P I1=24");
    // A forced value is undone to the one from before.
    for value in ["7,50", "9"] {
        click(&browser, &pin("LOGO:I1"));
        browser.run("document.getElementById('force-value').select()");
        browser.keys(&format!("{value}\u{e007}"));
        wait_said(&browser, "LOGO:I1 is forced to");
        click(&browser, "#let-go");
    }
    assert_eq!(
        (logo.hear(), logo.hear()),
        ("P I1=7.5".to_owned(), "P I1=9".to_owned())
    );
    click(&browser, "#undo");
    assert_eq!(logo.hear(), "P I1=7.5");
    click(&browser, "#undo");
    assert_eq!(logo.hear(), "P I1=24");
    // The client itself has replaced the cable meanwhile.
    logo.say("DISCONNECT I1\r\nCONNECT I1:PUMP:Q2");
    browser.wait("lab.cables.get('LOGO:I1')?.output === 'PUMP:Q2'");
    click(&browser, "#undo");
    wait_said(
        &browser,
        "Cannot undo \"Connected PUMP:Q1 with LOGO:I1\": LOGO:I1 is connected with PUMP:Q2 now. Nothing was changed.",
    );
    click(&browser, "#undo");
    wait_said(&browser, "Nothing to undo.");
    wait_cables(&browser, 1);
    assert_quiet(&browser);
}

#[test]
fn quick_steps_keep_each_other_and_half_an_undone_step_is_reported() {
    let lab = Lab::new();
    let (_pump, logo) = (lab.join("VP PUMP Q01"), lab.join("VR LOGO I01"));
    let (fan, _proto) = (lab.join("VP FAN I01"), lab.join("VP __proto__ Q01"));
    let browser = open(&lab, 1300, 900);
    browser.wait("lab.places.size === 4");
    // A fold right after a move, and an undo right after an arrow key.
    browser.run(
        "changes.place('Moved PUMP.', [['PUMP', { x: 500, y: 300 }]]); changes.place('Folded PUMP.', [['PUMP', { folded: true }]])",
    );
    browser.wait("document.querySelector('.client.folded[data-name=PUMP]')");
    browser.run(&format!(
        "document.querySelector('{}').focus()",
        title("PUMP")
    ));
    browser.keys("\u{e014}");
    control_z(&browser);
    wait_said(&browser, "Undone: Moved PUMP.");
    browser.run("changes.place('Moved it.', [['__proto__', { x: 900, y: 20 }]])");
    wait_said(&browser, "Moved it.");
    // A client has gone before the cut of its cable is undone.
    browser.run("changes.connect('LOGO:I1', 'PUMP:Q1'); changes.connect('FAN:I1', 'PUMP:Q1')");
    browser.wait("lab.cables.size === 2");
    browser.run("changes.cut([...lab.cables.values()], 'PUMP:Q1', 'Cut all.')");
    browser.wait("lab.cables.size === 0");
    drop(fan);
    browser.wait("!lab.clients.has('FAN')");
    click(&browser, "#undo");
    wait_said(&browser, "Undone: Cut all, but ERR 404 ");
    browser.wait("lab.cables.size === 1");
    // The rest waits for its client.
    browser.run("document.getElementById('status').textContent = ''");
    click(&browser, "#undo");
    wait_said(&browser, "ERR 404 ");
    let _fan = lab.join("VP FAN I01");
    browser.wait("lab.clients.get('FAN')?.isHere");
    click(&browser, "#undo");
    wait_said(&browser, "Undone: Cut all.");
    browser.wait("lab.cables.size === 2");
    click(&browser, "#redo");
    browser.wait("lab.cables.size === 1");
    click(&browser, "#redo");
    wait_said(&browser, "Repeated: Cut all.");
    browser.wait("lab.cables.size === 0");
    // In the matrix, no cell is current after its client has gone.
    click(&browser, "#as-matrix");
    browser.wait("document.querySelector('.cell.current')");
    drop(logo);
    browser.wait("!lab.clients.has('LOGO') && !document.querySelector('.cell.current')");
    // The dispatcher has the same places.
    browser.go(lab.plain());
    wait_place(&browser, "PUMP", (500, 300));
    wait_place(&browser, "__proto__", (900, 20));
    browser.wait("lab.places.get('PUMP').folded");
}

#[test]
fn a_path_is_shown_through_all_cascades() {
    let lab = Lab::new();
    let _clients = [
        "VP SWITCH Q02",
        "VR ONE Q02 I02",
        "VR TWO Q02 I02",
        "VP LAMP I02",
    ]
    .map(|line| lab.join(line));
    let mut other = lab.join("VP OTHER Q01 I01");
    other.say("CONNECT Q1:OTHER:I1");
    let browser = open(&lab, 1300, 900);
    for (input, output) in [
        ("ONE:I1", "SWITCH:Q1"),
        ("TWO:I1", "ONE:Q1"),
        ("LAMP:I1", "TWO:Q1"),
    ] {
        browser.run(&format!("changes.connect('{input}', '{output}')"));
        browser.wait(&format!("lab.cables.get('{input}')"));
    }
    wait_cables(&browser, 4);
    let classes = |name: &str| {
        browser.run(&format!(
            "return [...document.querySelectorAll('g.cable.{name}')].map((it) => it.dataset.input).sort()"
        ))
    };
    let (x, y) = super::middle(&browser, &jack("ONE:Q1"));
    browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [
        {"type": "pointerMove", "x": x, "y": y, "duration": 0},
    ]}]));
    browser.wait("document.getElementById('sheet').classList.contains('tracing')");
    assert_eq!(classes("near"), json!(["TWO:I1"]));
    assert_eq!(classes("far"), json!(["LAMP:I1", "ONE:I1"]));
    browser
        .wait("!document.querySelector('.client[data-name=OTHER]').classList.contains('on-path')");
    browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [
        {"type": "pointerMove", "x": 5, "y": 5, "duration": 0},
    ]}]));
    browser.wait("!document.querySelector('.tracing')");
    // The focus on a cable does the same.
    browser.run("document.querySelector('g[data-input=\"LAMP:I1\"]').focus()");
    browser.wait("document.querySelector('g.near[data-input=\"LAMP:I1\"]') && document.querySelectorAll('g.far').length === 2");
}

#[test]
fn the_matrix_connects_and_cuts_from_the_keyboard() {
    const DOWN: &str = "\u{e015}";
    const RIGHT: &str = "\u{e014}";

    let lab = Lab::new();
    let (mut pump, mut logo) = (
        lab.join("VP PUMP Q02 I01 AQ01"),
        lab.join("VR LOGO Q01 I02"),
    );
    pump.say("P Q2=24");
    let browser = open(&lab, 1300, 900);
    browser.wait("lab.pins.has('LOGO:I2')");
    click(&browser, "#as-matrix");
    browser.wait(
        "document.querySelector('#matrix .cell') && !document.getElementById('board').offsetParent",
    );
    browser.run("document.getElementById('matrix').focus()");
    let current = |name: &str| {
        browser.wait(&format!(
            "document.getElementById(document.getElementById('matrix').getAttribute('aria-activedescendant'))?.getAttribute('aria-label') === '{name}'"
        ));
    };
    current("PUMP:I1 from PUMP:Q1: not connected");
    browser.keys(DOWN);
    browser.keys(RIGHT);
    current("LOGO:I1 from PUMP:Q2: not connected");
    browser.keys(" ");
    current("LOGO:I1 from PUMP:Q2: connected");
    assert_eq!(logo.hear(), "P I1=24");
    browser.keys(" ");
    current("LOGO:I1 from PUMP:Q2: not connected");
    assert_eq!(logo.hear(), "P I1=0");
    click(&browser, "#undo");
    assert_eq!(logo.hear(), "P I1=24");
    // Digital and analog do not fit.
    click(
        &browser,
        "[aria-label=\"LOGO:I2 from PUMP:AQ1: digital and analog\"]",
    );
    wait_said(&browser, "ERR 422");
    click(&browser, "#as-boxes");
    browser.wait("document.getElementById('board').offsetParent");
    wait_cables(&browser, 1);
}

#[test]
fn the_page_stays_small_with_many_clients() {
    // A page of 300 clients had 66,000 pixels and 53,000 elements.
    for (count, pixels, elements) in [(4, 1300, 700), (40, 2500, 1500), (300, 6000, 6000)] {
        let lab = Lab::new();
        let mut clients: Vec<_> = (0..count)
            .map(|at| lab.join(&format!("VP C{at} Q08 I08 AQ02 AI02")))
            .collect();
        for at in (0..count).step_by(4) {
            let (one, two, three) = (at + 1, at + 2, at + 3);
            clients[at].say(&format!(
                "CONNECT I1:C{one}:Q1 I2:C{one}:Q2 Q1:C{two}:I1 Q2:C{three}:I1 AI1:C{three}:AQ1"
            ));
            assert_eq!(clients[at].hear(), "OK CONNECT");
        }
        let browser = open(&lab, 1300, 900);
        wait_cables(&browser, count / 4 * 5);
        browser.wait("[...document.querySelectorAll('.wire')].every((it) => it.getAttribute('d'))");
        // Boxes that came one after another, over seconds, stand where there was room then.
        click(&browser, "#arrange");
        browser.wait("document.getElementById('status').textContent.startsWith('Arranged')");
        browser.wait("[...document.querySelectorAll('.wire')].every((it) => it.getAttribute('d'))");
        assert_fits(&browser);
        let size = browser.run(
            "return [document.documentElement.scrollHeight, document.querySelectorAll('*').length]",
        );
        assert!(size[0].as_i64() < Some(pixels), "{count}: {size}");
        assert!(size[1].as_i64() < Some(elements), "{count}: {size}");
        assert_eq!(browser.run(CROSSINGS), json!([]), "{count}");
        click(&browser, "#as-matrix");
        browser.wait("document.querySelector('#matrix .cell')");
        let cells = browser.run("return document.querySelectorAll('*').length");
        assert!(cells.as_i64() < Some(elements + 2500), "{count}: {cells}");
    }
}
