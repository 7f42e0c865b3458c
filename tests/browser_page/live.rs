//! The live page: it shows a driver's signals, forces them, and reports when it cannot.

mod analyser;
mod large;
mod lists;
mod outage;
mod past;
mod phone;
mod replaced;
mod sparks;
mod touch;
mod two_drivers;

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};

use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, click, find, wait_said};

const ENTER: &str = "\u{e007}";
const DELETE: &str = "\u{e017}";
const END: &str = "\u{e010}";

/// A machine without a simulator, and its page: every `%Q` byte comes back on the `%I` byte of the same offset.
struct Machine {
    child: Child,
    /// The addresses for the PLC and for the page.
    bus: String,
    url: String,
    folder: Arc<tempfile::TempDir>,
}

const TANK: &str = r#"
[[signal]]
name = "Valve"
address = "%QX0.0"
latch = "rising"
[[signal]]
name = "Level low"
address = "%IX0.0"
[[signal]]
name = "Set point"
address = "%QW2"
type = "INT"
unit = "mm"
scale = { raw = [0, 27648], value = [0.0, 500.0] }
[[signal]]
name = "Level"
address = "%IW2"
type = "INT"
unit = "mm"
scale = { raw = [0, 27648], value = [0.0, 500.0] }
"#;

impl Machine {
    fn new(kind: &str, page: &str, signals: &str) -> Self {
        Self::with(kind, page, signals, &[])
    }

    /// Like [`new`](Self::new), with these files beside its driver.cfg.
    fn with(kind: &str, page: &str, signals: &str, files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            fs::write(folder.path().join(name), text).expect("there is room");
        }
        let text = format!(
            "[driver]\nid = 7\nname = \"Tank\"\n[fieldbus]\nkind = \"{kind}\"\naddress = \"127.0.0.1:0\"\n[page]\nlisten = \
             \"127.0.0.1:0\"\n{page}\n{signals}"
        );
        fs::write(folder.path().join("tank.cfg"), text).expect("there is room");
        Self::start(Arc::new(folder))
    }

    /// The machine of a Modbus PLC, with a tank.
    fn tank() -> Self {
        Self::new("modbus-server", "", TANK)
    }

    /// The rig of the demo, with its picture.
    fn rig() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let config = include_str!("../../driver.cfg").replace("127.0.0.1:20030", "127.0.0.1:0");
        let text = format!("{config}\n[page]\nlisten = \"127.0.0.1:0\"\npicture = \"rig.svg\"\n");
        fs::write(folder.path().join("tank.cfg"), text)
            .and_then(|()| {
                fs::write(
                    folder.path().join("rig.svg"),
                    include_str!("../../java/machines/rig.svg"),
                )
            })
            .expect("there is room");
        Self::start(Arc::new(folder))
    }

    fn start(folder: Arc<tempfile::TempDir>) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .arg("mirror")
            .arg(folder.path().join("tank.cfg"))
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the tickbus program runs");
        let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
        let url = find(&mut lines, "mirror: page at ");
        let bus = find(&mut lines, "mirror: opening: listening on ");
        // Nobody reads later output; it must not block the program.
        std::thread::spawn(move || lines.count());
        Self {
            child,
            bus,
            url,
            folder,
        }
    }

    fn kill(&mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it ends");
    }

    /// The host and port of its page.
    fn page(&self) -> &str {
        let page = self.url.split('#').next().expect("an address");
        page.trim_start_matches("http://").trim_end_matches('/')
    }

    /// Restarts it, with the page at the same address but with another token.
    fn restart(&mut self) {
        self.kill();
        let page = self.page();
        let file = self.folder.path().join("tank.cfg");
        let text = fs::read_to_string(&file).expect("its file");
        let text = text.replacen(
            "listen = \"127.0.0.1:0\"",
            &format!("listen = \"{page}\""),
            1,
        );
        fs::write(&file, text).expect("there is room");
        *self = Self::start(Arc::clone(&self.folder));
    }

    /// The PLC of the rig, which meets it on its bus.
    fn plc(&self) -> Plc {
        let file = self.folder.path().join("plc.cfg");
        let config = include_str!("../../driver.cfg").replace("127.0.0.1:20030", &self.bus);
        fs::write(&file, config).expect("there is room");
        let plc = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .args(["plc", "rig", "--config"])
            .arg(file)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        Plc(plc.expect("the tickbus program runs"))
    }

    /// Runs mbpoll, which is libmodbus, and returns its output.
    fn mbpoll(&self, arguments: &[&str]) -> String {
        let (host, port) = self.bus.rsplit_once(':').expect("a port");
        let output = Command::new("mbpoll")
            .args(["-1", "-q", "-0", "-p", port])
            .args(arguments)
            .arg(host)
            .output()
            .expect("mbpoll is there (apt-get install mbpoll)");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Reads one value with mbpoll: of type 1 a discrete input, of type 3 an input register.
    fn read(&self, kind: &str, reference: &str) -> i64 {
        let said = self.mbpoll(&["-t", kind, "-r", reference]);
        let (_, value) = said
            .split_once("]:")
            .unwrap_or_else(|| panic!("a value in {said}"));
        let value = value.split_whitespace().next().expect("a value");
        value.parse().expect("a number")
    }

    /// Writes with mbpoll: to type 0 a coil, to type 4 a holding register.
    fn write(&self, kind: &str, reference: &str, value: &str) {
        self.write_many(kind, reference, &[value.to_owned()]);
    }

    /// Writes neighbouring holding registers with one request.
    fn write_all(&self, reference: &str, values: &[String]) {
        self.write_many("4", reference, values);
    }

    fn write_many(&self, kind: &str, reference: &str, values: &[String]) {
        let (host, port) = self.bus.rsplit_once(':').expect("a port");
        let status = Command::new("mbpoll")
            .args([
                "-1", "-q", "-0", "-p", port, "-t", kind, "-r", reference, host,
            ])
            .args(values)
            .stdout(Stdio::null())
            .status()
            .expect("mbpoll is there (apt-get install mbpoll)");
        assert!(status.success(), "{reference} := {values:?}");
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A PLC that runs the rig's program, as a process.
struct Plc(Child);

impl Plc {
    fn kill(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Plc {
    fn drop(&mut self) {
        self.kill();
    }
}

fn open(machine: &Machine, width: u32, height: u32) -> Browser {
    let browser = Browser::start(width, height);
    browser.go(&machine.url);
    // The tabs arrive with the first event, and push the content below them down.
    browser.wait("document.getElementById('tabs')?.hidden === false");
    browser.wait("document.getElementById('access').textContent === 'may force'");
    browser.wait("document.querySelector('.row.signal')");
    browser
}

/// The row of a signal, if it is visible.
fn row(name: &str) -> String {
    format!(
        "Array.from(document.querySelectorAll('.row.signal')).find((it) => !it.hidden && it.parts.name.textContent === {})",
        json!(name)
    )
}

/// Waits until the row of a signal shows a value, as it is read aloud.
fn wait_shown(browser: &Browser, name: &str, value: &str) {
    browser.wait(&format!(
        "{}?.querySelector('.value').textContent === {}",
        row(name),
        json!(value)
    ));
}

fn wait_marked(browser: &Browser, name: &str, mark: &str) {
    browser.wait(&format!(
        "{}?.parts.mark.textContent === {}",
        row(name),
        json!(mark)
    ));
}

/// Clicks on the row of a signal.
fn choose(browser: &Browser, name: &str) {
    // Only rows that are in view are in the document.
    browser.run(&format!(
        "list.find(plant.signals.find((signal) => signal.name === {}))",
        json!(name)
    ));
    browser.wait(&row(name));
    browser.run(&format!("{}.parts.name.click()", row(name)));
    browser.wait(&format!(
        "document.getElementById('chosen-name').textContent === {}",
        json!(name)
    ));
}

#[test]
fn values_arrive_and_a_force_reaches_the_modbus_plc_until_it_is_released() {
    let machine = Machine::tank();
    let browser = open(&machine, 1280, 800);
    assert_eq!(
        browser.run("return [location.hash, document.title]"),
        json!(["", "Tank – tickbus"])
    );
    // Values change, in the unit and raw, and edges are counted.
    machine.write("0", "0", "1");
    wait_shown(&browser, "Valve", "TRUE");
    wait_shown(&browser, "Level low", "TRUE");
    browser.wait(&format!("{}.parts.edges.textContent === '1'", row("Valve")));
    machine.write("4", "1", "13824");
    wait_shown(&browser, "Set point", "250.00mm");
    wait_shown(&browser, "Level", "250.00mm");
    browser.wait(&format!(
        "{}.parts.raw.textContent === '16#3600'",
        row("Level")
    ));
    // Forced by the pointer.
    choose(&browser, "Level low");
    click(&browser, "#force-false");
    wait_said(&browser, "Level low is forced to FALSE.");
    wait_shown(&browser, "Level low", "FALSE");
    wait_marked(&browser, "Level low", "forced");
    assert_eq!(machine.read("1", "0"), 0, "the PLC sees what is forced");
    browser.wait("document.getElementById('forced-text').textContent === '1 signal is forced: Level low to FALSE'");
    browser.wait(
        "document.querySelector('.faults').textContent.includes('\"Level low\" is stuck at ')",
    );
    // By the keyboard, in its unit.
    choose(&browser, "Level");
    browser.run("document.getElementById('list').focus()");
    browser.keys("f");
    browser.wait("document.activeElement.id === 'force-value'");
    browser.keys(&format!("125,5{ENTER}"));
    wait_said(&browser, "Level is forced to 125.5 mm.");
    assert_eq!(
        machine.read("3", "1"),
        6940,
        "27648 * 125.5 / 500, to the nearest"
    );
    wait_marked(&browser, "Level", "forced");
    // A wrong value gets a message with the remedy, and changes nothing.
    browser.run("document.getElementById('force-value').select()");
    browser.keys(&format!("much{ENTER}"));
    browser.wait("document.getElementById('status').classList.contains('bad')");
    assert_eq!(machine.read("3", "1"), 6940);
    // The message concerns that signal alone.
    choose(&browser, "Level low");
    browser.wait("document.getElementById('status').textContent === ''");
    browser.wait("!document.getElementById('status').classList.contains('bad')");
    choose(&browser, "Level");
    // Released one by one, and all at once.
    browser.run("document.getElementById('list').focus()");
    browser.keys(DELETE);
    wait_said(&browser, "Level is released.");
    wait_shown(&browser, "Level", "250.00mm");
    assert_eq!(machine.read("3", "1"), 13824);
    click(&browser, "#release-all");
    wait_said(&browser, "All signals are released.");
    wait_marked(&browser, "Level low", "");
    browser.wait("document.getElementById('forced').hidden");
    assert_eq!(machine.read("1", "0"), 1);
    assert_quiet_but(&browser, "/force/");
}

/// Requests that were refused on purpose are in the browser's log; nothing else is.
#[track_caller]
fn assert_quiet_but(browser: &Browser, refused: &str) {
    let complaints = browser.complaints();
    assert!(
        complaints.iter().all(|text| text.contains(refused)),
        "{complaints:?}"
    );
}

#[test]
fn a_killed_plc_is_told_within_a_second_with_its_reason() {
    let machine = Machine::rig();
    let mut plc = machine.plc();
    let browser = open(&machine, 1280, 800);
    browser.wait("document.querySelector('.driver .tag').textContent === 'running'");
    browser.wait("document.getElementById('failsafe').hidden");
    let killed = Instant::now();
    plc.kill();
    // On a busy computer a PLC may already be too late to send when it is killed.
    browser.wait("/broke|left|closed|silent|complete/.test(document.querySelector('.driver .reason').textContent)");
    browser.wait("!document.getElementById('failsafe').hidden");
    let took = killed.elapsed();
    println!("a killed PLC was told after {} ms", took.as_millis());
    assert!(
        browser
            .run("return document.querySelector('.driver .since').textContent")
            .to_string()
            .contains("for ")
    );
    assert_quiet(&browser);
}

#[test]
fn the_bottle_in_the_picture_moves_with_the_lift() {
    let machine = Machine::rig();
    let _plc = machine.plc();
    let browser = open(&machine, 1280, 800);
    browser.wait("document.querySelector('.picture > div > div')?.shadowRoot");
    let told = browser.run("return document.querySelectorAll('.picture details').length");
    assert_eq!(
        told, 0,
        "nothing is left out of our own picture, and no binding is wrong"
    );
    let bottle = "document.querySelector('.picture > div > div').shadowRoot.querySelector('#low1 ~ g [data-tb*=\"show\"]')";
    force(&browser, "SC1", "TRUE");
    browser.wait(&format!("getComputedStyle({bottle}).display !== 'none'"));
    force(&browser, "LA1 position", "0");
    // The position in the drawing, wherever that is on the page.
    let svg = "document.querySelector('.picture > div > div').shadowRoot.firstElementChild";
    let place = format!(
        "(({bottle}.getBoundingClientRect().top - {svg}.getBoundingClientRect().top) / {svg}.getScreenCTM().d)"
    );
    browser.wait(&format!("{svg}.textContent.includes('lift 1 at 0 mm')"));
    let low = browser.run(&format!("return {place}"));
    force(&browser, "LA1 position", "100");
    // 106 units of the drawing for 100 mm; the raw value has steps of a hundredth of a millimetre.
    browser.wait(&format!("Math.abs({place} - ({low} - 106)) < 0.5"));
    browser.wait(&format!("{svg}.textContent.includes('lift 1 at 100 mm')"));
    browser.run("document.getElementById('release-all').click()");
    browser.wait("document.getElementById('forced').hidden");
    assert_quiet(&browser);
}

/// Forces a signal as the page does.
fn force(browser: &Browser, name: &str, value: &str) {
    let answer: Value = browser.run(&format!(
        "const id = plant.drivers[0].id; return await room.change('PUT', `/force/${{id}}/${{encodeURIComponent({})}}`, {})",
        json!(name),
        json!(value)
    ));
    assert_eq!(answer["ok"], json!(true), "{name}: {answer}");
}

#[test]
fn a_picture_that_would_do_harm_does_none_and_says_what_was_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = format!(
        "[driver]\nid = 7\nname = \"Tank\"\n[fieldbus]\nkind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\n[page]\nlisten = \
         \"127.0.0.1:0\"\npicture = \"tank.svg\"\n{TANK}"
    );
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 100 100\" onload=\"window.harm = 1\">\
        <script>window.harm = 2</script>\n<image href=\"http://127.0.0.1:9/x.png\" onerror=\"window.harm = 3\"/>\
        <rect id=\"level\" x=\"10\" y=\"10\" width=\"80\" height=\"80\" data-tb-height=\"Level: 0..500\" data-tb-fill=\"Valve: off -> #111111, on -> #222222\"/>\
        <style>:host { position: fixed !important; inset: 0; z-index: 99; background: red } svg { position: fixed; inset: 0; \
        width: 100vw !important; height: 100vh !important; max-height: none !important }</style>\
        <text y=\"99\" data-tb-text=\"Levl: {0}\">?</text></svg>";
    fs::write(folder.path().join("tank.cfg"), text)
        .and_then(|()| fs::write(folder.path().join("tank.svg"), svg))
        .expect("there is room");
    let machine = Machine::start(Arc::new(folder));
    let browser = open(&machine, 1280, 800);
    browser.wait("document.querySelector('.picture details.warn')");
    let told = browser
        .run("return document.querySelector('.picture').textContent")
        .to_string();
    for words in [
        "there is no signal",
        "Levl",
        "did you mean",
        "the event handler onload",
        "<script>",
        "a reference to http://127.0.0.1:9/x.png",
    ] {
        assert!(told.contains(words), "{words}: {told}");
    }
    let level = "document.querySelector('.picture > div > div').shadowRoot.getElementById('level')";
    machine.write("4", "1", "13824");
    machine.write("0", "0", "1");
    // Half full: from the bottom, half as high.
    browser.wait(&format!(
        "getComputedStyle({level}).fill === 'rgb(34, 34, 34)'"
    ));
    browser.wait(&format!(
        "Math.abs({level}.getCTM().d * 80 / {level}.ownerSVGElement.getCTM().d - 40) < 0.1"
    ));
    assert_eq!(browser.run("return window.harm ?? 0"), 0);
    // Styles that would cover the whole page stay within the frame.
    let covered = "return ['#filter', '#title', '.driver .reason', '.picture summary'].filter((it) => { \
         const found = document.querySelector(it), box = found.getBoundingClientRect(); \
         const top = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2); \
         return top !== found && !found.contains(top); })";
    assert_eq!(browser.run(covered), json!([]), "the picture covers them");
    browser.run("document.querySelector('.picture > div').style.contain = 'none'");
    let without = browser.run(covered);
    assert_ne!(without, json!([]), "without it, it would cover them");
    assert_quiet(&browser);
}

#[test]
fn two_viewers_see_the_same_and_without_the_token_a_page_only_shows() {
    let machine = Machine::tank();
    let one = open(&machine, 1280, 800);
    let two = Browser::start(1280, 800);
    two.go(machine.url.split('#').next().expect("an address"));
    two.wait("document.getElementById('access').textContent === 'read-only'");
    two.wait("document.querySelector('.row.signal')");
    force(&one, "Level", "100");
    for browser in [&one, &two] {
        wait_shown(browser, "Level", "100.00mm");
        wait_marked(browser, "Level", "forced");
    }
    choose(&two, "Level");
    assert_eq!(two.run("return document.getElementById('chosen-tools').hidden && document.getElementById('release-all').hidden"), true);
    two.run("document.getElementById('list').focus()");
    two.keys("f");
    wait_said(&two, "Read-only: open the address that was printed");
    two.keys(DELETE);
    let refused = two
        .run("const answer = await room.change('PUT', '/force/7/Level', '1'); return answer.code");
    assert_eq!(refused, 401);
    wait_marked(&two, "Level", "forced");
    assert_quiet_but(&two, "/force/");
    assert_quiet(&one);
}

#[test]
fn seven_tabs_can_force_and_release() {
    let machine = Machine::tank();
    let browser = open(&machine, 1280, 800);
    // A browser has six connections to one host.
    for _ in 2..=7 {
        browser.new_tab();
        browser.go(&machine.url);
        browser.wait("document.getElementById('access').textContent === 'may force'");
        browser.wait("document.querySelector('.row.signal')");
    }
    choose(&browser, "Level low");
    click(&browser, "#force-true");
    wait_said(&browser, "Level low is forced to TRUE.");
    browser.first_tab();
    wait_marked(&browser, "Level low", "forced");
    click(&browser, "#release-all");
    wait_said(&browser, "All signals are released.");
    wait_marked(&browser, "Level low", "");
    assert_quiet(&browser);
}

#[test]
fn what_came_before_the_page_is_there_and_a_constant_has_no_edge() {
    let machine = Machine::tank();
    // Faster than anybody could look: every change is there.
    for value in ["1", "0", "1", "0", "1"] {
        machine.write("0", "0", value);
    }
    let browser = open(&machine, 1280, 800);
    wait_shown(&browser, "Valve", "TRUE");
    browser.run("list.toggle(plant.signals.find((it) => it.name === 'Level low'))");
    let trend = "plant.signals.find((it) => it.name === 'Level low').trend";
    browser.wait(&format!("{trend}?.values.join() === '0,1,0,1,0,1'"));
    let equal =
        format!("return {trend}.values.some((it, i, all) => i && Object.is(it, all[i - 1]))");
    assert_eq!(browser.run(&equal), false);
}

#[test]
fn an_outage_draws_no_edge_of_a_bool() {
    let machine = Machine::tank();
    let browser = open(&machine, 1280, 800);
    // Both ways of drawing: each value, and each pixel.
    let edges = browser.run(
        "let edges = 0; \
         const ctx = { fillRect(x, y, width, height) { if (width < 2 && height > 10) edges += 1; } }; \
         run.end = 100; \
         const counts = [[1, NaN, 1], [NaN, 1, 0, NaN, 0, 1]].flatMap((values) => [400, 8].map((width) => { \
           edges = 0; \
           const times = values.map((_, i) => i * 100 / values.length); \
           paintBool({ ctx, colours: {}, left: 0, width, from: 0, to: 100 }, { times, values }, 0, 10); \
           return edges; \
         })); \
         return counts;",
    );
    assert_eq!(edges, json!([0, 0, 2, 2]));
}

#[test]
fn a_plc_that_is_gone_is_not_shown_as_one_that_is_there() {
    let mut machine = Machine::rig();
    let browser = open(&machine, 1280, 900);
    let overlay = "document.querySelector('.picture').classList.contains('is-stale')";
    // Before the first contact the values are unknown, but for those that the machine has instead.
    browser.wait(overlay);
    browser.wait("plant.signals.every((it) => it.direction !== 'Q' || (it.value === null) !== it.isFailSafe)");
    browser.wait("plant.signals.some((it) => it.value === null)");
    let mut plc = machine.plc();
    browser.wait(&format!("!{overlay}"));
    browser.wait("plant.signals.every((it) => !it.isStale)");
    browser.run("list.toggle(plant.signals.find((it) => it.direction === 'Q'))");
    plc.kill();
    browser.wait(overlay);
    browser.wait("plant.signals.every((it) => it.direction !== 'Q' || it.isStale)");
    browser.wait("Number.isNaN(plant.signals.find((it) => it.isOpen).trend?.values.at(-1))");
    machine.kill();
}

#[test]
fn the_page_says_when_it_is_old_and_comes_back_after_a_restart() {
    let mut machine = Machine::tank();
    let browser = open(&machine, 1280, 800);
    choose(&browser, "Level");
    browser.run("document.getElementById('trend').click()");
    browser.wait("document.querySelector('.row.trend:not([hidden]) canvas')");
    machine.restart();
    browser.wait("!document.body.classList.contains('is-old') && document.getElementById('access').textContent === 'read-only'");
    machine.write("4", "1", "27648");
    wait_shown(&browser, "Level", "500.00mm");
    browser.wait("document.getElementById('chosen-name').textContent === 'Level'");
    browser.wait("document.querySelector('.row.trend:not([hidden]) canvas')");
    machine.kill();
    browser.wait("/What is shown is \\d+ s old/.test(document.getElementById('age').textContent)");
    browser.wait("document.body.classList.contains('is-old') && document.getElementById('link').textContent === 'no connection'");
}

#[test]
fn an_open_page_can_force_after_a_restart_that_keeps_its_token() {
    let mut machine = Machine::new("modbus-server", "token_file = \"page.token\"", TANK);
    let browser = open(&machine, 1280, 800);
    machine.restart();
    force(&browser, "Level low", "TRUE");
    browser.wait("document.getElementById('access').textContent === 'may force'");
    wait_marked(&browser, "Level low", "forced");
    machine.kill();
}

#[test]
fn the_page_fits_every_screen_in_the_light_and_in_the_dark() {
    let folder = crate::screenshots();
    let machine = Machine::rig();
    let browser = Browser::start(1280, 900);
    for (name, width, height, scheme) in [
        ("live-wide", 1280, 860, "light"),
        ("live-wide-dark", 1280, 860, "dark"),
        ("live-phone", 390, 844, "light"),
        ("live-phone-dark", 390, 844, "dark"),
    ] {
        browser.resize(width, height);
        let media = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        browser.devtools("Emulation.setEmulatedMedia", &media);
        browser.go(&machine.url);
        browser.wait("document.getElementById('access').textContent === 'may force'");
        browser.wait("document.querySelector('.picture > div > div')?.shadowRoot");
        assert_fits(&browser);
        let background = if scheme == "dark" {
            "rgb(20, 23, 26)"
        } else {
            "rgb(255, 255, 255)"
        };
        assert_eq!(
            browser.run("return getComputedStyle(document.body).backgroundColor"),
            background
        );
        force(&browser, "LA1 position", "120");
        // A phone begins with the picture.
        browser.run("views.reveal('signals')");
        wait_marked_or_scroll(&browser, "LA1 position");
        choose(&browser, "LA1 position");
        browser.run("document.getElementById('trend').click()");
        browser.wait("document.querySelector('.row.trend:not([hidden]) canvas')");
        assert_fits(&browser);
        if width < 640 {
            // Touch targets have their minimum size on a phone, and what must not be overlooked is still visible.
            let sizes = browser.run(
                "return [document.querySelector('.row.signal:not([hidden]) .open').getBoundingClientRect().height, document.getElementById('forced').getBoundingClientRect().bottom]",
            );
            assert!(sizes[0].as_f64() >= Some(40.0), "{sizes}");
            assert!(
                sizes[1].as_f64().is_some_and(|bottom| bottom > 20.0),
                "{sizes}"
            );
        }
        shoot(&browser, folder.as_deref(), &format!("{name}.png"), false);
        let landmarks = browser.run("return ['header', 'main', 'aside'].map((it) => document.querySelectorAll(`body > ${it}`).length)");
        assert_eq!(landmarks, json!([1, 1, 1]));
        assert_quiet(&browser);
    }
}

#[test]
fn a_number_is_written_out_as_far_as_it_has_digits() {
    let machine = Machine::tank();
    let browser = open(&machine, 1280, 800);
    for (value, unit, data_type, text) in [
        ("12345678", "mm", "UDINT", "12345678"),
        ("4294967295", "mm", "UDINT", "4294967295"),
        ("-12345678.25", "Pa", "DINT", "−12345678"),
        ("12345678", "", "DINT", "12345678"),
        ("12345678", "Pa", "REAL", "1.235e+7"),
        ("1e300", "", "LREAL", "1.000e+300"),
        ("12.5", "mm", "INT", "12.50"),
    ] {
        let told = browser.run(&format!(
            "return words.number({value}, {{ unit: '{unit}', type: '{data_type}' }})"
        ));
        assert_eq!(told, text, "{value} {unit}, {data_type}");
    }
}

/// Brings a signal's row into view, and waits until it is marked as forced.
fn wait_marked_or_scroll(browser: &Browser, name: &str) {
    browser.run(&format!(
        "const filter = document.getElementById('filter'); filter.value = {}; filter.dispatchEvent(new Event('input')); \
         document.getElementById('signals').scrollIntoView({{ behavior: 'instant' }})",
        json!(name)
    ));
    wait_marked(browser, name, "forced");
}
