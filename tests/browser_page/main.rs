//! The served pages in a browser: the patch bay shows and patches the laboratory; the live page (`live`) shows a
//! driver, a run (`run`), or a recording (`show`).
//!
//! Not part of a plain `cargo test`, because it needs Chromium and chromedriver:
//! `cargo test --features page --test browser_page` runs it.
#![cfg(unix)]

#[path = "../browser/webdriver.rs"]
#[allow(dead_code, reason = "the report's tests use the rest")]
mod webdriver;

mod board;
#[path = "../peers/commands.rs"]
mod commands;
#[path = "../peers/edited.rs"]
mod edited;
mod live;
mod room;
mod run;
mod show;
mod studio;
#[cfg(feature = "opcua")]
mod studio_tags;
mod taken;

use std::io::{BufRead as _, BufReader, Lines, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};

use serde_json::json;
use webdriver::{Browser, shoot};

/// The folder for screenshots that people look at; `None` unless they ask for them.
fn screenshots() -> Option<PathBuf> {
    std::env::var_os("TICKBUS_SCREENSHOTS").map(PathBuf::from)
}

/// A dispatcher with its page, as a process.
struct Lab {
    child: Child,
    address: String,
    url: String,
    folder: tempfile::TempDir,
}

fn start(patch: &Path, listen: &str, page: &str) -> (Child, String, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["dispatch", "--listen", listen, "--page", page, "--patch"])
        .arg(patch)
        .stdout(Stdio::piped())
        .spawn()
        .expect("the tickbus program runs");
    let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
    let mut after = |words: &str| find(&mut lines, words);
    let address = after("dispatch: listening on ");
    let url = after("dispatch: page at ");
    (child, address, url)
}

fn find(lines: &mut Lines<BufReader<ChildStdout>>, words: &str) -> String {
    loop {
        let line = lines.next().expect("a further line").expect("text");
        if let Some(rest) = line.strip_prefix(words) {
            return rest.to_owned();
        }
    }
}

impl Lab {
    fn new() -> Self {
        Self::at("127.0.0.1:0")
    }

    /// With its page at this address.
    fn at(page: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let patch = folder.path().join("patch.toml");
        let (child, address, url) = start(&patch, "127.0.0.1:0", page);
        Self {
            child,
            address,
            url,
            folder,
        }
    }

    /// The page's address, without the token.
    fn plain(&self) -> &str {
        self.url.split_once('#').expect("it has a token").0
    }

    fn join(&self, line: &str) -> Client {
        let stream = TcpStream::connect(&self.address).expect("it listens");
        let lines = BufReader::new(stream.try_clone().expect("a descriptor")).lines();
        let mut client = Client { stream, lines };
        client.say(&format!("{line} V=2"));
        while !client.hear().starts_with("END") {}
        client
    }

    fn kill(&mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it ends");
    }

    /// Ends it as Ctrl-C does, so that it keeps everything.
    fn child_ends(&mut self) {
        let pid = i32::try_from(self.child.id()).expect("a process");
        let pid = rustix::process::Pid::from_raw(pid).expect("a process");
        rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("it runs");
        self.child.wait().expect("it ends");
    }

    /// Restarts it at the same addresses, with another token.
    fn restart(&mut self) {
        let patch = self.folder.path().join("patch.toml");
        let page = self
            .plain()
            .trim_start_matches("http://")
            .trim_end_matches('/')
            .to_owned();
        let (child, _, url) = start(&patch, &self.address, &page);
        (self.child, self.url) = (child, url);
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

struct Client {
    stream: TcpStream,
    lines: Lines<BufReader<TcpStream>>,
}

impl Client {
    fn say(&mut self, line: &str) {
        self.stream
            .write_all(format!("{line}\r\n").as_bytes())
            .expect("it reads");
    }

    fn hear(&mut self) -> String {
        self.lines.next().expect("a further line").expect("text")
    }
}

/// The middle of an element, as the pointer reaches it.
fn middle(browser: &Browser, selector: &str) -> (i64, i64) {
    let script = format!(
        "const it = document.querySelector(`{selector}`); it.scrollIntoView({{ block: 'center', behavior: 'instant' }}); \
         const box = it.getBoundingClientRect(); \
         return [Math.round(box.left + box.width / 2), Math.round(box.top + box.height / 2)];"
    );
    let found = browser.run(&script);
    let number = |at: usize| found[at].as_i64().expect("a place");
    (number(0), number(1))
}

fn pin(name: &str) -> String {
    format!("[data-pin=\"{name}\"]")
}

fn jack(name: &str) -> String {
    format!("[data-pin=\"{name}\"] .jack")
}

fn drag(browser: &Browser, kind: &str, from: &str, to: &str) {
    // Both are brought into view, around the middle of the space that the tray leaves free.
    let places = browser.run(&format!(
        "const at = () => [`{}`, `{}`].flatMap((it) => {{ \
           const box = document.querySelector(it).getBoundingClientRect(); \
           return [Math.round(box.left + box.width / 2), Math.round(box.top + box.height / 2)]; }}); \
         const [, y1, , y2] = at(); \
         const free = document.getElementById('tray').getBoundingClientRect().top; \
         scrollBy({{ top: (y1 + y2 - free) / 2, behavior: 'instant' }}); \
         return at();",
        jack(from),
        jack(to)
    ));
    browser.act(&json!([{"type": "pointer", "id": kind, "parameters": {"pointerType": kind}, "actions": [
        {"type": "pointerMove", "x": places[0], "y": places[1], "duration": 0}, {"type": "pointerDown", "button": 0},
        {"type": "pointerMove", "x": places[2], "y": places[3], "duration": 60}, {"type": "pointerUp", "button": 0},
    ]}]));
}

fn click(browser: &Browser, selector: &str) {
    let (x, y) = middle(browser, selector);
    browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [
        {"type": "pointerMove", "x": x, "y": y, "duration": 0}, {"type": "pointerDown", "button": 0},
        {"type": "pointerUp", "button": 0},
    ]}]));
}

/// Clicks on the middle of a cable.
fn click_cable(browser: &Browser, input: &str) {
    let place = browser.run(&format!(
        "const path = document.querySelector(`g[data-input=\"{input}\"] .grip`); \
         path.scrollIntoView({{ block: 'center', behavior: 'instant' }}); \
         const at = path.getPointAtLength(path.getTotalLength() / 2).matrixTransform(path.getScreenCTM()); \
         return [Math.round(at.x), Math.round(at.y)];"
    ));
    browser.act(&json!([{"type": "pointer", "id": "mouse", "actions": [
        {"type": "pointerMove", "x": place[0], "y": place[1], "duration": 0}, {"type": "pointerDown", "button": 0},
        {"type": "pointerUp", "button": 0},
    ]}]));
}

fn wait_value(browser: &Browser, name: &str, value: &str) {
    browser.wait(&format!(
        "document.querySelector(`{} .value`)?.textContent === '{value}'",
        pin(name)
    ));
}

fn wait_said(browser: &Browser, words: &str) {
    browser.wait(&format!(
        "document.getElementById('status').textContent.includes({})",
        json!(words)
    ));
}

fn wait_cables(browser: &Browser, count: usize) {
    browser.wait(&format!(
        "document.querySelectorAll('g.cable').length === {count}"
    ));
}

fn open(lab: &Lab, width: u32, height: u32) -> Browser {
    let browser = Browser::start(width, height);
    browser.go(&lab.url);
    browser.wait("document.getElementById('access').textContent === 'may change'");
    browser
}

fn assert_fits(browser: &Browser) {
    let widths = browser.run("return [document.documentElement.scrollWidth, innerWidth]");
    assert!(widths[0].as_f64() <= widths[1].as_f64(), "{widths}");
}

#[track_caller]
fn assert_quiet(browser: &Browser) {
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn two_clients_are_patched_by_a_drag_and_cut_by_a_click() {
    let lab = Lab::new();
    let (mut pump, mut logo) = (
        lab.join("VP PUMP Q02 I02 AQ01"),
        lab.join("VR LOGO Q02 I02"),
    );
    let browser = open(&lab, 1200, 800);
    assert_eq!(
        browser.run("return [location.hash, document.title]"),
        json!(["", "Patch bay"]),
        "the token leaves the address"
    );
    pump.say("P Q1=24");
    wait_value(&browser, "PUMP:Q1", "24");
    drag(&browser, "mouse", "PUMP:Q1", "LOGO:I1");
    assert_eq!(logo.hear(), "P I1=24", "the value arrives");
    wait_value(&browser, "LOGO:I1", "24");
    wait_cables(&browser, 1);
    pump.say("P Q1=20.5");
    wait_value(&browser, "LOGO:I1", "20.5");
    assert_eq!(logo.hear(), "P I1=20.5");
    // From the input to the output, by touch.
    drag(&browser, "touch", "PUMP:I2", "LOGO:Q2");
    wait_cables(&browser, 2);
    // A wrong connection gets a message with the reason.
    drag(&browser, "mouse", "PUMP:Q2", "LOGO:I1");
    wait_said(&browser, "ERR 409 LOGO:I1 is connected to PUMP:Q1 already");
    drag(&browser, "mouse", "PUMP:AQ1", "LOGO:I2");
    wait_said(&browser, "ERR 422 ");
    wait_cables(&browser, 2);
    click_cable(&browser, "LOGO:I1");
    wait_said(&browser, "Cut the cable from PUMP:Q1 to LOGO:I1");
    assert_eq!(logo.hear(), "P I1=0", "fail-safe");
    wait_value(&browser, "LOGO:I1", "0");
    wait_cables(&browser, 1);
    // A client goes, and its cable waits for it.
    drop(pump);
    browser.wait("document.querySelector('g.cable.asleep') && document.querySelector('.client.away[data-name=PUMP]')");
    let _pump = lab.join("VP PUMP Q02 I02");
    browser.wait(
        "document.querySelector('g.cable:not(.asleep)') && !document.querySelector('.client.away')",
    );
}

#[test]
fn everything_is_done_from_the_keyboard_and_announced() {
    const ENTER: &str = "\u{e007}";
    const TAB: &str = "\u{e004}";
    const DELETE: &str = "\u{e017}";

    let lab = Lab::new();
    let (mut pump, mut logo) = (lab.join("VP PUMP Q01"), lab.join("VR LOGO I01"));
    pump.say("P Q1=24");
    let browser = open(&lab, 1200, 800);
    wait_value(&browser, "PUMP:Q1", "24");
    browser.run("document.activeElement.blur()");
    browser.keys(TAB);
    assert_eq!(browser.run("return document.activeElement.id"), "as-boxes");
    browser.run("document.getElementById('search').focus()");
    browser.keys(TAB);
    assert_eq!(
        browser.run("return document.activeElement.textContent"),
        "PUMP"
    );
    browser.keys(TAB);
    assert_eq!(
        browser.run("return document.activeElement.getAttribute('aria-label')"),
        "Q1 24, digital output of PUMP"
    );
    browser.keys(ENTER);
    wait_said(
        &browser,
        "PUMP:Q1 is chosen. Choose an input to connect it.",
    );
    browser.keys(TAB);
    browser.keys(TAB);
    browser.keys(ENTER);
    wait_said(&browser, "Connected PUMP:Q1 with LOGO:I1.");
    assert_eq!(logo.hear(), "P I1=24");
    assert_eq!(
        browser.run("return document.getElementById('status').ariaLive"),
        "polite"
    );
    // The forced value of the pin that has the focus.
    browser.keys("f");
    browser.wait("document.activeElement.id === 'force-value'");
    browser.keys("x");
    browser.keys(ENTER);
    wait_said(&browser, "is not a number");
    browser.run("document.getElementById('force-value').select()");
    browser.keys("7.5");
    browser.keys(ENTER);
    assert_eq!(logo.hear(), "P I1=7.5");
    wait_value(&browser, "LOGO:I1", "7.5 forced");
    pump.say("P Q1=20");
    wait_value(&browser, "PUMP:Q1", "20");
    browser.wait("!document.getElementById('release').disabled");
    browser.run("document.getElementById('release').focus()");
    browser.keys(ENTER);
    assert_eq!(logo.hear(), "P I1=20");
    wait_value(&browser, "LOGO:I1", "20");
    // Escape cancels the drag; the cable is behind the pins.
    browser.keys("\u{e00c}");
    browser.run("document.querySelector('[data-pin=\"LOGO:I1\"]').focus()");
    browser.keys(TAB);
    assert_eq!(
        browser.run("return document.activeElement.getAttribute('aria-label')"),
        "Cable from PUMP:Q1 to LOGO:I1; Delete cuts it"
    );
    browser.keys(DELETE);
    assert_eq!(logo.hear(), "P I1=0");
    wait_cables(&browser, 0);
}

#[test]
fn a_channel_that_was_forced_is_not_the_end_of_a_cable() {
    let lab = Lab::new();
    let (pump, mut logo) = (lab.join("VP PUMP Q01"), lab.join("VR LOGO I01"));
    let browser = open(&lab, 1200, 800);
    click(&browser, &pin("PUMP:Q1"));
    browser.run("document.getElementById('force-value').select()");
    browser.keys("7,5\u{e007}");
    wait_value(&browser, "PUMP:Q1", "7.5 forced");
    click(&browser, &pin("LOGO:I1"));
    wait_said(&browser, "LOGO:I1 is chosen.");
    wait_cables(&browser, 0);
    // Now it is.
    click(&browser, &pin("PUMP:Q1"));
    wait_cables(&browser, 1);
    assert_eq!(logo.hear(), "P I1=7.5");
    // The button that can no longer be pressed passes the focus on.
    click(&browser, &pin("PUMP:Q1"));
    browser.wait("!document.getElementById('release').disabled");
    browser.run("document.getElementById('release').focus()");
    browser.keys("\u{e007}");
    browser.wait("document.activeElement.dataset.pin === 'PUMP:Q1'");
    // A cable that is cut leaves the focus to its input.
    browser.run("document.querySelector('g.cable').focus()");
    browser.keys(" ");
    browser.wait("document.activeElement.dataset.pin === 'LOGO:I1'");
    wait_cables(&browser, 0);
    // A drag ends when its client leaves, and the choice is cleared.
    let (x, y) = middle(&browser, &jack("PUMP:Q1"));
    browser.act(
        &json!([{"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": [
            {"type": "pointerMove", "x": x, "y": y, "duration": 0}, {"type": "pointerDown", "button": 0},
            {"type": "pointerMove", "x": x + 40, "y": y + 40, "duration": 60},
        ]}]),
    );
    browser.wait("document.querySelector('.pending')");
    drop(pump);
    browser.wait("!document.querySelector('.pending')");
    wait_said(&browser, "PUMP:Q1 has gone.");
}

#[test]
fn without_the_token_the_page_only_shows() {
    let lab = Lab::new();
    let (mut pump, mut logo) = (lab.join("VP PUMP Q01"), lab.join("VR LOGO I01"));
    logo.say("CONNECT I1:PUMP:Q1");
    assert_eq!(logo.hear(), "OK CONNECT");
    let browser = Browser::start(1200, 800);
    browser.go(lab.plain());
    browser.wait("document.getElementById('access').textContent === 'read-only'");
    wait_said(&browser, "Read-only");
    pump.say("P Q1=24");
    wait_value(&browser, "LOGO:I1", "24");
    click_cable(&browser, "LOGO:I1");
    wait_said(&browser, "Read-only: nothing was cut.");
    click(&browser, &pin("PUMP:Q1"));
    wait_said(&browser, "PUMP:Q1: 24.");
    assert_eq!(
        browser.run("return document.getElementById('chosen-tools').hidden"),
        true
    );
    wait_cables(&browser, 1);
    assert_quiet(&browser);
    browser.go(&format!("{}#token=00", lab.plain()));
    wait_said(&browser, "Read-only: the token is not this room's");
    browser.go(&lab.url);
    browser.wait("document.getElementById('access').textContent === 'may change'");
    assert_eq!(browser.run("return location.hash"), "");
}

#[test]
fn the_page_says_when_it_is_old_and_comes_back() {
    let mut lab = Lab::new();
    let mut pump = lab.join("VP PUMP Q01");
    pump.say("P Q1=24");
    let browser = open(&lab, 1200, 800);
    wait_value(&browser, "PUMP:Q1", "24");
    lab.kill();
    browser.wait("/What is shown is \\d+ s old/.test(document.getElementById('age').textContent)");
    browser.wait("document.body.classList.contains('is-old')");
    lab.restart();
    let _logo = lab.join("VR LOGO I01");
    browser.wait(
        "!document.body.classList.contains('is-old') && document.getElementById('age').hidden",
    );
    browser.wait("document.querySelector('.client[data-name=LOGO]') && !document.querySelector('.client[data-name=PUMP]')");
    // A different dispatcher, with another token.
    browser.wait("document.getElementById('access').textContent === 'read-only'");
}

#[test]
fn names_are_shown_and_a_board_with_many_fits_every_screen() {
    let folder = screenshots();
    let lab = Lab::new();
    let mut tank = lab.join("VP TANK Q04 I03 AQ01");
    let mut board = lab.join("VP SWITCHES Q04 I04");
    let mut one = lab.join("VR LOGO1 Q04 I04 AI01");
    let mut two = lab.join("VR LOGO2 Q02 I04");
    let fan = lab.join("VP FAN Q01 I01");
    for (client, line) in [
        (
            &mut one,
            "CONNECT I1:SWITCHES:Q1 I2:SWITCHES:Q2 I3:TANK:Q1 Q1:TANK:I1 AI1:TANK:AQ1 Q2:FAN:I1",
        ),
        (
            &mut two,
            "CONNECT I1:LOGO1:Q3 I2:TANK:Q2 Q1:SWITCHES:I1 Q2:SWITCHES:I2",
        ),
    ] {
        client.say(line);
        while client.hear() != "OK CONNECT" {}
    }
    drop(fan);
    tank.say("P Q1=24 Q2=0 AQ1=7.25");
    board.say("P Q1=24 Q2=0");
    one.say("P Q1=24 Q3=24");
    two.say("P Q1=24 Q2=0");
    let browser = Browser::start(1280, 900);
    for (name, width, height, scheme) in [
        ("wide", 1180, 800, "light"),
        ("wide-dark", 1180, 800, "dark"),
        ("phone", 390, 844, "light"),
        ("phone-dark", 390, 844, "dark"),
    ] {
        browser.resize(width, height);
        let media = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        browser.devtools("Emulation.setEmulatedMedia", &media);
        browser.go(&lab.url);
        browser.wait("document.getElementById('access').textContent === 'may change'");
        wait_cables(&browser, 10);
        wait_value(&browser, "LOGO1:AI1", "7.25");
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
        if width < 640 {
            // Touch targets have their minimum size on a phone.
            let height = browser
                .run("return document.querySelector('.jack').getBoundingClientRect().height");
            assert!(height.as_f64() >= Some(40.0), "{height}");
            drag(&browser, "touch", "TANK:Q3", "SWITCHES:I4");
            wait_cables(&browser, 11);
            shoot(
                &browser,
                folder.as_deref(),
                &format!("{name}-top.png"),
                false,
            );
            click(&browser, &pin("SWITCHES:I4"));
            click(&browser, "#cut");
            wait_cables(&browser, 10);
        }
        if name == "wide" {
            click(&browser, &pin("TANK:Q4"));
            browser.keys("f");
            browser.run("document.getElementById('force-value').select()");
            browser.keys("24\u{e007}");
            wait_value(&browser, "TANK:Q4", "24 forced");
        }
        shoot(
            &browser,
            folder.as_deref(),
            &format!("{name}.png"),
            name.starts_with("phone"),
        );
        if name == "wide" {
            click(&browser, "#release");
            wait_value(&browser, "TANK:Q4", "–");
        }
        assert_quiet(&browser);
    }
}

#[test]
fn channels_are_found_by_what_their_client_calls_them() {
    let lab = Lab::new();
    let mut adam = lab.join("VP ADAM Q02 AQ01");
    let _logo = lab.join("VR LOGO I02");
    adam.say("NAME AQ1 Level <b>\"A\"</b>");
    adam.say(&format!("NAME Q1 {}", "Druck im Kessel ".repeat(7)));
    let browser = open(&lab, 390, 844);
    let shown = "document.querySelector('[data-pin=\"ADAM:AQ1\"] .called')?.textContent === 'Level <b>\"A\"</b>'";
    browser.wait(shown);
    browser.wait("document.querySelector('[data-pin=\"ADAM:Q1\"] .called')");
    assert_fits(&browser);
    let find = |text: &str| {
        browser.run(&format!(
            "const field = document.getElementById('search'); field.value = '{text}'; \
             field.dispatchEvent(new Event('input')); return null"
        ));
    };
    let seen = |said: &str, pins: usize| {
        browser.wait(&format!(
            "document.getElementById('found').textContent === '{said}' && \
             document.querySelectorAll('.pin:not(.beside)').length === {pins}"
        ));
    };
    seen("", 6);
    find("LEVEL adam");
    seen("1 channel", 1);
    browser.run("document.getElementById('search').focus()");
    browser.keys("\u{e007}");
    seen("1 of 1: ADAM:AQ1 Level <b>\"A\"</b>", 1);
    browser.keys("\u{e015}");
    browser.wait("document.activeElement.dataset.pin === 'ADAM:AQ1'");
    find("i1");
    seen("1 channel", 1);
    find("no such");
    seen("0 channels", 0);
    find(" ");
    seen("", 6);
}
