//! The studio: from an empty folder to a line that a foreign PLC meets, by keyboard and mouse.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};

use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, click, find};

pub(crate) const ENTER: &str = "\u{e007}";
const TAB: &str = "\u{e004}";
const DELETE: &str = "\u{e017}";
const CONTROL: &str = "\u{e009}";

/// A studio as a process.
pub(crate) struct Studio {
    child: Child,
    url: String,
    pub(crate) folder: tempfile::TempDir,
}

impl Studio {
    /// Opens the studio on a file with this text; without one, on a file that is not there.
    pub(crate) fn new(text: Option<&str>) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("driver.cfg");
        if let Some(text) = text {
            fs::write(&file, text).expect("there is room");
        }
        let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args(["studio", "--page", "127.0.0.1:0"])
            .arg(&file)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the tickbus program runs");
        let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
        let line = find(&mut lines, "studio: ");
        std::thread::spawn(move || lines.count());
        let (_, url) = line.rsplit_once(" at ").expect("it has an address");
        Self {
            child,
            url: url.to_owned(),
            folder,
        }
    }

    pub(crate) fn file(&self) -> PathBuf {
        self.folder.path().join("driver.cfg")
    }

    pub(crate) fn text(&self) -> String {
        fs::read_to_string(self.file()).expect("it is there")
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub(crate) fn open(studio: &Studio, width: u32, height: u32) -> Browser {
    let browser = Browser::start(width, height);
    browser.go(&studio.url);
    browser.wait(READY);
    browser
}

/// The file is shown.
pub(crate) const READY: &str = "document.querySelector('#settings select') !== null";

/// Types into a cell, by keys alone.
pub(crate) fn fill(browser: &Browser, row: usize, key: &str, text: &str) {
    browser.run(&format!("cells.go({row}, {})", json!(key)));
    browser.keys(&format!("{ENTER}{text}{ENTER}"));
    wait_cell(browser, row, key, text);
}

/// Waits until the file has this text in a cell.
fn wait_cell(browser: &Browser, row: usize, key: &str, text: &str) {
    let (key, text) = (json!(key), json!(text));
    browser.wait(&format!(
        "tickbusStudio.file?.sheet?.signals[{row}]?.[{key}] === {text} && !tickbusStudio.isBusy"
    ));
}

/// Types into a setting of the bus or the driver.
pub(crate) fn set(browser: &Browser, id: &str, text: &str) {
    browser.run(&format!(
        "const f = document.getElementById({}); f.focus(); f.select();",
        json!(id)
    ));
    browser.keys(&format!("{text}{TAB}"));
    let key = id.split('-').skip(1).collect::<Vec<_>>();
    let (table, key) = (json!(key[0]), json!(key[1]));
    browser.wait(&format!(
        "tickbusStudio.file?.sheet?.[{table}][{key}] === {} && !tickbusStudio.isBusy",
        json!(text)
    ));
}

fn choose_kind(browser: &Browser, kind: &str) {
    browser.run(&format!(
        "const s = document.getElementById('kind'); s.value = {}; s.dispatchEvent(new Event('change'));",
        json!(kind)
    ));
    browser.wait(&format!(
        "tickbusStudio.file.sheet.kind === {}",
        json!(kind)
    ));
}

pub(crate) fn wait_line(browser: &Browser, words: &str) -> String {
    browser.wait(&format!(
        "`${{document.getElementById('line-state').textContent}} ${{document.getElementById('line-reason').textContent}}`.includes({})",
        json!(words)
    ));
    let reason = browser.run("return document.getElementById('line-reason').textContent");
    reason.as_str().expect("a text").to_owned()
}

fn mbpoll(address: &str, arguments: &[&str]) -> String {
    let (host, port) = address.rsplit_once(':').expect("an address");
    let output = Command::new("mbpoll")
        .args(["-1", "-q", "-0", "-p", port])
        .args(&arguments[..arguments.len().min(4)])
        .arg(host)
        .args(&arguments[arguments.len().min(4)..])
        .output()
        .expect("mbpoll is installed");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn an_empty_folder_becomes_a_rig_that_a_modbus_plc_meets() {
    let studio = Studio::new(None);
    let browser = open(&studio, 1400, 900);
    choose_kind(&browser, "modbus-server");
    set(&browser, "key-fieldbus-address", "127.0.0.1:0");
    set(&browser, "key-driver-name", "Tank");
    click(&browser, "#add-output");
    browser.wait("cells.isEditing");
    browser.keys(&format!("Valve{ENTER}"));
    wait_cell(&browser, 0, "name", "Valve");
    click(&browser, "#add-input");
    browser.wait("cells.isEditing");
    browser.keys(&format!("Level low{ENTER}"));
    wait_cell(&browser, 1, "name", "Level low");
    // A wrong address, with the checker's words at the cell, corrected there.
    fill(&browser, 1, "address", "%IX0.9");
    browser.run("cells.go(1, 'address')");
    let told = browser.run("return document.getElementById('cell-told').textContent");
    assert!(told.as_str().expect("a text").contains("%IX0.9"), "{told}");
    assert_eq!(
        browser.run("return document.getElementById('start').disabled"),
        json!(true)
    );
    let folder = crate::screenshots();
    shoot(&browser, folder.as_deref(), "studio_mistake.png", false);
    fill(&browser, 1, "address", "%IX0.0");
    assert_eq!(
        studio.text(),
        "[driver]\nid   = 1\nname = \"Tank\"\n\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n\n\
         [[signal]]\nname    = \"Valve\"\naddress = \"%QX0.0\"\n\n[[signal]]\nname    = \"Level low\"\naddress = \"%IX0.0\"\n"
    );
    click(&browser, "#start");
    let reason = wait_line(&browser, "listening on ");
    let address = reason.rsplit_once("listening on ").expect("an address").1;
    let address = address.split_whitespace().next().expect("an address");
    // The machine copies each byte of %Q to %I until there is a simulator.
    mbpoll(address, &["-t", "0", "-r", "0", "1"]);
    wait_line(&browser, "running");
    browser.wait(
        "[...document.querySelectorAll('#rows .c-value')].every((it) => it.textContent === 'TRUE')",
    );
    shoot(&browser, folder.as_deref(), "studio_running.png", false);
    let read = mbpoll(address, &["-t", "1", "-r", "0"]);
    assert!(read.contains("[0]:") && read.contains('1'), "{read}");
    // What is forced on the live page is seen here.
    browser.run("await room.change('PUT', '/force/1/Level%20low', 'FALSE')");
    browser.wait("[...document.querySelectorAll('#rows .c-value')][1].textContent === 'FALSE'");
    click(&browser, "#stop");
    wait_line(&browser, "stopped");
    assert_quiet(&browser);
}

/// Two editors of one file: each sees what the other does, and the same cell is a conflict.
#[test]
fn two_editors_and_an_editor_of_text_lose_nothing() {
    let text = "[driver]\nid = 1\nname = \"T\"\n\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\n[[signal]]\nname = \"A\" # first\naddress = \"%QX0.0\"\n";
    let studio = Studio::new(Some(text));
    let browser = open(&studio, 1200, 800);
    fill(&browser, 0, "name", "Pump");
    let named = text.replace("\"A\"", "\"Pump\"");
    assert_eq!(studio.text(), named);
    browser.new_tab();
    browser.go(&studio.url);
    browser.wait(READY);
    fill(&browser, 0, "address", "%QX0.5");
    browser.first_tab();
    wait_cell(&browser, 0, "address", "%QX0.5");
    // Another program writes the file: shown here, and not overwritten by the next edit.
    let theirs = studio.text().replace("# first", "# theirs");
    fs::write(studio.file(), &theirs).expect("there is room");
    fill(&browser, 0, "unit", "bar");
    let both = theirs.replace("\"%QX0.5\"\n", "\"%QX0.5\"\nunit = \"bar\"\n");
    assert_eq!(studio.text(), both);
    browser.run("document.getElementById('grid').focus()");
    browser.act(&json!([{"type": "key", "id": "keys", "actions": [
        {"type": "keyDown", "value": CONTROL}, {"type": "keyDown", "value": "z"},
        {"type": "keyUp", "value": "z"}, {"type": "keyUp", "value": CONTROL},
    ]}]));
    browser.wait("tickbusStudio.file.redo !== null");
    assert_eq!(studio.text(), theirs);
    assert_quiet(&browser);
}

/// Text that is typed while another program changes the file stays, and goes to the signal that it was typed for.
#[test]
fn what_is_typed_is_kept_and_reaches_no_other_signal() {
    let signal = |name: &str, bit: u8| {
        format!("\n[[signal]]\nname = \"{name}\"\naddress = \"%QX0.{bit}\"\n")
    };
    let head = "[driver]\nid = 1\nname = \"T\"\n\n[fieldbus]\nkind = \"modbus-client\"\naddress = \"127.0.0.1:1502\"\n\n\
                [fieldbus.at]\nA = \"coil:1\"\n";
    let text = [
        head,
        &signal("A", 0),
        &signal("constructor", 1),
        &signal("C", 2),
    ]
    .concat();
    let studio = Studio::new(Some(&text));
    let browser = open(&studio, 1400, 900);
    browser.wait("document.querySelectorAll('#rows .row').length === 3");
    let place = browser.run("return document.getElementById('cell-1-at').textContent");
    assert_eq!(
        place,
        json!(""),
        "every object of JavaScript has a constructor"
    );
    // A text that was not applied yet, while the file changes.
    browser.run("document.getElementById('text-box').open = true");
    browser.wait("document.getElementById('text').value !== ''");
    browser.run("document.getElementById('text').value += '# mine\\n'");
    let theirs = format!("# theirs\n{text}");
    fs::write(studio.file(), &theirs).expect("there is room");
    browser.wait("tickbusStudio.file.text.startsWith('# theirs') && !tickbusStudio.isBusy");
    let typed = "document.getElementById('text').value.endsWith('# mine\\n')";
    assert_eq!(browser.run(&format!("return {typed}")), json!(true));
    click(&browser, "#apply");
    browser.wait("document.getElementById('told').textContent.includes('apply it again')");
    assert_eq!(browser.run(&format!("return {typed}")), json!(true));
    assert_eq!(studio.text(), theirs);
    click(&browser, "#apply");
    browser.wait("tickbusStudio.file.text.endsWith('# mine\\n') && !tickbusStudio.isBusy");
    assert_eq!(studio.text(), format!("{text}# mine\n"));
    // A cell is open when its row goes to another signal.
    browser.run("cells.go(1, 'unit')");
    browser.keys("bar");
    browser.wait("cells.isEditing");
    let without_first = text.replace(&signal("A", 0), "");
    fs::write(studio.file(), &without_first).expect("there is room");
    browser.keys(ENTER);
    browser.wait("document.getElementById('told').textContent.includes('not at its place')");
    assert_eq!(studio.text(), without_first);
    // A signal without a name can be removed as every other.
    browser.wait("document.querySelectorAll('#rows .row').length === 2");
    browser.run("cells.go(1, 'name')");
    browser.keys(DELETE);
    browser.wait("tickbusStudio.file.sheet.signals[1].name === undefined && !tickbusStudio.isBusy");
    click(&browser, "#remove");
    browser.wait("tickbusStudio.file.sheet.signals.length === 1 && !tickbusStudio.isBusy");
    assert!(!studio.text().contains("%QX0.2"), "{}", studio.text());
    // Half of a setting is typed when the form is made again.
    browser.run("const f = document.getElementById('key-driver-name'); f.focus(); f.select();");
    browser.keys("Half");
    let moved = studio.text().replace("127.0.0.1:1502", "127.0.0.1:1503");
    fs::write(studio.file(), &moved).expect("there is room");
    browser.wait("document.getElementById('key-fieldbus-address').value.endsWith('1503')");
    assert_eq!(studio.text(), moved);
    browser.keys(TAB);
    browser.wait("tickbusStudio.file.sheet.driver.name === 'Half' && !tickbusStudio.isBusy");
}

/// The key that is typed next goes into the column of the deleted text, also in a file that has no such text any more.
#[test]
fn a_deleted_comment_leaves_the_cursor_in_its_column() {
    let text = "[driver]\nid = 1\nname = \"T\"\n\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\n\
                [[signal]]\nname = \"A\"\naddress = \"%IX0.0\"\ncomment = \"old\"\nfolder = \"IO\"\n";
    let studio = Studio::new(Some(text));
    let browser = open(&studio, 1200, 800);
    browser.run("cells.go(0, 'comment')");
    browser.keys(DELETE);
    browser
        .wait("tickbusStudio.file.sheet.signals[0].comment === undefined && !tickbusStudio.isBusy");
    browser.keys(&format!("new{ENTER}"));
    wait_cell(&browser, 0, "comment", "new");
    assert!(
        studio.text().contains("folder = \"IO\""),
        "{}",
        studio.text()
    );
    // A row is as wide as its cells.
    let over = "return [...document.querySelectorAll('#grid .row')].map((it) => it.scrollWidth - it.clientWidth)";
    assert_eq!(browser.run(over), json!([0, 0]));
    // The chosen cell is seen.
    browser.run("document.getElementById('grid').scrollLeft = 0; cells.go(0, 'folder')");
    let right = "return document.querySelector('#rows [aria-selected=true]').getBoundingClientRect().right <= document.getElementById('grid').getBoundingClientRect().right";
    assert_eq!(browser.run(right), json!(true));
    // A column before the chosen one appears.
    browser.run("cells.go(0, 'comment')");
    let placed = format!("{}\n[fieldbus.at]\nA = \"there\"\n", studio.text());
    fs::write(studio.file(), placed).expect("there is room");
    browser.wait("document.querySelector('#head .c-at') !== null");
    let chosen = "return document.querySelector('#rows [aria-selected=true]').dataset.key";
    assert_eq!(browser.run(chosen), json!("comment"));
}

/// Why the line did not start is told until the file is another.
#[test]
fn a_corrected_mistake_is_no_reason_any_more() {
    let text = "[driver]\nid = 1\nname = \"T\"\n\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\n[[signal]]\nname = \"A\"\naddress = \"%IX0.9\"\n";
    let studio = Studio::new(Some(text));
    let browser = open(&studio, 1200, 800);
    browser.run("await room.change('PUT', '/studio/line', 'start')");
    wait_line(&browser, "the file has mistakes (1)");
    fs::write(studio.file(), text.replace("0.9", "0.1")).expect("there is room");
    browser.wait("tickbusStudio.file.checked.mistakes.length === 0");
    assert_eq!(wait_line(&browser, "stopped"), "");
}

/// Values change up to 60 times a second, and the file does not: the page asks for it at its own pace.
#[test]
fn a_line_that_changes_all_the_time_makes_no_more_questions_about_the_file() {
    let text = "[driver]\nid = 1\nname = \"T\"\n\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\n[[signal]]\nname = \"A\"\naddress = \"%IX0.0\"\n";
    let studio = Studio::new(Some(text));
    let browser = open(&studio, 1200, 800);
    click(&browser, "#start");
    wait_line(&browser, "listening on ");
    let counts = browser.run(
        "performance.setResourceTimingBufferSize(10000); performance.clearResourceTimings(); \
         const end = performance.now() + 3000; let forced = 0; \
         while (performance.now() < end) await room.change('PUT', '/force/1/A', forced++ % 2 ? 'TRUE' : 'FALSE'); \
         const asked = performance.getEntriesByType('resource').filter(({ name }) => name.includes('/studio/state/')); \
         return [forced, asked.length];",
    );
    let count = |at: usize| counts[at].as_u64().expect("a count");
    assert!(count(0) > 30, "{counts}");
    assert!(count(1) <= 8, "{counts}");
    assert_quiet(&browser);
}

#[test]
fn without_its_token_the_studio_shows_nothing() {
    let studio = Studio::new(Some("[driver]\nid = 1\nname = \"Secret plant\"\n"));
    let browser = Browser::start(1200, 800);
    let (plain, _) = studio.url.split_once('#').expect("it has a token");
    browser.go(plain);
    browser.wait("!document.getElementById('told').hidden");
    let state = browser.run(
        "const answer = await fetch('/studio/state/0'); return [answer.status, await answer.text()];",
    );
    assert_eq!(state[0], json!(401));
    let shown = browser.run("return document.body.innerText");
    let is_shown = |words: &str, text: &Value| text.as_str().expect("a text").contains(words);
    assert!(!is_shown("Secret plant", &state[1]) && !is_shown("Secret plant", &shown));
    let edited =
        browser.run("return (await fetch('/studio/edit', {method: 'PUT', body: '{}'})).status");
    assert_eq!(edited, json!(401));
}

/// A name from a file is text, whatever it looks like.
#[test]
fn the_studio_fits_a_phone_and_shows_names_as_text() {
    let text = "[driver]\nid = 1\nname = \"T\"\n[fieldbus]\nkind = \"socket\"\n[[signal]]\nname = \"<img src=x onerror=alert(1)>\"\naddress = \"%QX0.0\"\n";
    let studio = Studio::new(Some(text));
    let browser = open(&studio, 390, 844);
    browser.wait("document.querySelectorAll('#rows .row').length === 1");
    assert_fits(&browser);
    assert_eq!(browser.run("return document.images.length"), json!(0));
    let name = browser.run("return document.querySelector('#rows .c-name').textContent");
    assert_eq!(name, json!("<img src=x onerror=alert(1)>"));
    let folder = crate::screenshots();
    shoot(&browser, folder.as_deref(), "studio_phone.png", true);
    assert_quiet(&browser);
}

/// Lists are read one after the other, and a file that goes is told until the next edit writes it again.
#[test]
fn several_lists_are_dropped_at_once_and_a_deleted_file_is_told() {
    let text = "[driver]\nid = 1\nname = \"T\"\n\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\n[[signal]]\nname = \"A\"\naddress = \"%QX0.0\"\n";
    let studio = Studio::new(Some(text));
    let browser = open(&studio, 1200, 800);
    browser.run(
        "const given = new DataTransfer(); \
         for (const [file, name, place] of [['a.csv', 'Valve', '%Q0.5'], ['b.csv', 'Pump', '%Q0.6'], ['c.csv', 'nonsense', '']]) { \
           const list = place ? `Name;Path;Data Type;Logical Address\\n${name};T;Bool;${place}\\n` : name; \
           given.items.add(new File([list], file)); } \
         window.dispatchEvent(new DragEvent('drop', { dataTransfer: given, cancelable: true }));",
    );
    browser.wait("tickbusStudio.file.sheet.signals.length === 3 && document.getElementById('told').textContent.includes('c.csv')");
    let told = browser.run("return document.getElementById('told').textContent");
    let told = told.as_str().expect("a text");
    assert!(
        told.contains("imported 1 signals of a.csv") && told.contains("of b.csv"),
        "{told}"
    );
    browser.wait("!tickbusStudio.isBusy");
    fs::remove_file(studio.file()).expect("it is there");
    browser.wait("document.getElementById('saved').textContent === 'gone'");
    browser.wait(
        "document.getElementById('told').textContent.includes('the next edit writes it again')",
    );
    assert!(!studio.file().exists());
    fill(&browser, 0, "unit", "bar");
    browser.wait("document.getElementById('saved').textContent === 'saved'");
    assert!(
        studio.text().contains("unit = \"bar\"\n"),
        "{}",
        studio.text()
    );
}

/// A line to nobody: the page says why it is not up, finds the device, takes its address over, and is then content.
#[test]
fn a_line_is_examined_and_a_found_device_taken_over() {
    let device = tempfile::tempdir().expect("a folder");
    let file = device.path().join("device.cfg");
    let text = "[driver]\nid = 2\nname = \"Press\"\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n[[signal]]\nname = \"A\"\naddress = \"%QX0.0\"\n[[signal]]\nname = \"B\"\naddress = \"%IX0.0\"\n";
    fs::write(&file, text).expect("there is room");
    let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .arg("mirror")
        .arg(&file)
        .stdout(Stdio::piped())
        .spawn()
        .expect("the tickbus program runs");
    let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
    let address = find(&mut lines, "mirror: opening: listening on ");
    std::thread::spawn(move || lines.count());
    let nobody = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let closed = nobody.local_addr().expect("an address");
    drop(nobody);
    let studio = Studio::new(Some(&format!(
        "[driver]\nid = 1\nname = \"T\"\n\n[fieldbus]\nkind    = \"modbus-client\"\naddress = \"{closed}\" # the press\n\n[fieldbus.at]\n\"A\" = \"coil:1\"\n\n[[signal]]\nname = \"A\"\naddress = \"%QX0.0\"\n"
    )));
    let browser = open(&studio, 1200, 900);
    let step = |name: &str, verdict: &str| {
        browser.wait(&format!(
            "document.getElementById('busy').textContent === '' && [...document.querySelectorAll('#steps li')].some((it) => \
             it.className === {} && it.textContent.includes({}))",
            json!(verdict),
            json!(name)
        ));
    };
    click(&browser, "#examine");
    step("port", "fail");
    browser.run(&format!(
        "document.getElementById('search').open = true; document.getElementById('targets').value = {}",
        json!(address)
    ));
    click(&browser, "#find");
    browser.wait("document.querySelector('#devices button') !== null");
    let folder = crate::screenshots();
    shoot(&browser, folder.as_deref(), "studio_examined.png", false);
    click(&browser, "#devices button");
    browser.wait(&format!(
        "tickbusStudio.file.sheet.fieldbus.address === {}",
        json!(address)
    ));
    let line = format!("address = \"{address}\" # the press\n");
    assert!(studio.text().contains(&line), "{}", studio.text());
    click(&browser, "#examine");
    step("port", "ok");
    step("addresses", "ok");
    assert_quiet(&browser);
    child.kill().expect("it runs");
    child.wait().expect("it ends");
}
