//! Two drivers of one process on one page, with ticks of their own.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use serde_json::json;
use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Clock as _, Monotonic, Nanos, Pace, Stop};
use tickbus_live_page::{LivePage, Member, Options};
use tickbus_net::Address;
use tickbus_web::{Limits, Room, Serving};

use crate::webdriver::Browser;
use crate::{assert_quiet, wait_said};

/// A driver that ticks on a thread, until it is dropped. Its level rises by 1 in every tenth tick.
struct Ticking {
    stop: Arc<Stop>,
    thread: Option<JoinHandle<()>>,
    _member: Member,
}

impl Ticking {
    fn start(page: &LivePage, id: i32, name: &str, tick: Nanos, folder: Option<&Path>) -> Self {
        let history = if name == "Bare" { "history = 0" } else { "" };
        let gate = if name == "Fast" { "Gate" } else { "hold" };
        let text = format!(
            "[driver]\nid = {id}\nname = \"{name}\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
             scan = \"1ms\"\ncycle = \"1ms\"\n[page]\n{history}\n[[signal]]\nname = \"{name} level\"\naddress = \"%ID0\"\n\
             type = \"REAL\"\n[[signal]]\nname = \"{name} back\"\naddress = \"%QD0\"\ntype = \"REAL\"\n\
             [[signal]]\nname = \"Run  and hold\"\naddress = \"%IX4.0\"\ntype = \"BOOL\"\n\
             [[signal]]\nname = \"{gate}\"\naddress = \"%IX4.1\"\ntype = \"BOOL\"\n"
        );
        let config = Config::parse("driver.cfg", &text, &tickbus::KINDS)
            .unwrap_or_else(|why| panic!("{why}"));
        let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
        let options = Options {
            grace: None,
            picture: None,
            lists: folder.map(|folder| folder.join(format!("{name}.lists.toml"))),
        };
        let member = page.join(driver.watch(), options);
        let stop = Arc::new(Stop::new());
        let stopped = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            let mut slots = driver.initial_slots();
            let clock = Monotonic::shared();
            let mut pace = Pace::new(clock.now(), tick);
            let mut ticks = 0_u32;
            while !stopped.is_stopped() {
                clock.wait_until(pace.due(), &stopped);
                if pace.take(clock.now()) {
                    slots[0] = Slot::from_real(f64::from(ticks / 10));
                    driver.exchange(None, &mut slots);
                    ticks += 1;
                }
            }
        });
        Self {
            stop,
            thread: Some(thread),
            _member: member,
        }
    }
}

impl Drop for Ticking {
    fn drop(&mut self) {
        self.stop.stop();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn opened() -> (LivePage, [Ticking; 2], Serving, Browser) {
    opened_beside(None)
}

/// Two drivers on a page, with their lists in this folder, and a browser. The bar shows the time of the slow one.
fn opened_beside(folder: Option<&Path>) -> (LivePage, [Ticking; 2], Serving, Browser) {
    let page = LivePage::open(Monotonic::shared()).expect("a thread");
    let room = Room::bind(&Address::local(0), Limits::default()).expect("a port");
    let url = room.url();
    let serving = room.serve(
        tickbus_web::Pages::of("Live page", page.site()),
        Monotonic::shared(),
    );
    let drivers = [
        Ticking::start(&page, 1, "Slow", Nanos::from_millis(97), folder),
        Ticking::start(&page, 2, "Fast", Nanos::from_millis(11), folder),
    ];
    let browser = Browser::start(1280, 900);
    browser.go(&url);
    browser.wait("bar.lead?.name === 'Slow' && plant.drivers.every(({ past }) => past?.tick > 12)");
    (page, drivers, serving.expect("a thread"), browser)
}

#[test]
fn a_condition_is_about_the_driver_whose_signals_it_names() {
    let (_page, _drivers, _serving, browser) = opened();
    let level = "Number(plant.signals.find((it) => it.name === 'Fast level').value)";
    browser.run(&format!(
        "window.limit = {level} + 3; document.getElementById('trigger-text').value = `Fast level > ${{limit}}`; \
         location.hash = '#recording'; document.getElementById('arm').click()"
    ));
    browser.wait("trigger.isArmed");
    wait_said(&browser, "Fast level > ");
    browser.wait(&format!(
        "plant.drivers.every(({{ moment }}) => moment) && {level} === limit + 1"
    ));
    let told = browser.run("return words.moment(bar.moment.ms)");
    wait_said(
        &browser,
        &format!(": at {};", told.as_str().expect("a time")),
    );
    let fast = browser.run("return plant.drivers[1].moment.tick").as_u64();
    browser.run("document.getElementById('trigger-text').value = 'Fast level changes'; document.getElementById('last-when').click()");
    let before = fast.expect("a tick") - 10;
    browser.wait(&format!(
        "plant.drivers[1].moment.tick === {before} && {level} === limit"
    ));
    browser.run("document.getElementById('trigger-text').value = 'Fast level > 3 and Slow level > 3'; document.getElementById('last-when').click()");
    browser.wait(
        "document.getElementById('trigger-told').textContent.startsWith('there is no signal ')",
    );
    assert_quiet(&browser);
}

#[test]
fn conditions_are_about_the_driver_that_has_all_their_names() {
    let (_page, _drivers, _serving, browser) = opened();
    browser.run("document.getElementById('trigger-text').value = 'Run  and hold and Gate'");
    assert_eq!(browser.run("return trigger.wanted().driver.name"), "Fast");
    browser.run("document.getElementById('trigger-text').value = 'Run  and hold and hold rises'");
    assert_eq!(browser.run("return trigger.wanted().driver.name"), "Slow");
    // A name is inserted with both of its spaces.
    browser.run(
        "document.getElementById('trigger-text').value = ''; \
         list.select(plant.signals.find(({ name }) => name.startsWith('Run'))); \
         const insert = document.getElementById('trigger-insert'); insert.selectedIndex = 3; \
         insert.dispatchEvent(new Event('change'))",
    );
    assert_eq!(
        browser.run("return document.getElementById('trigger-text').value"),
        "Run  and hold rises"
    );
    assert_quiet(&browser);
}

#[test]
fn the_cursor_goes_from_edge_to_edge_of_a_driver_whose_ticks_the_bar_does_not_have() {
    let (_page, _drivers, _serving, browser) = opened();
    for name in ["Slow level", "Fast level"] {
        browser.run(&format!(
            "list.select(plant.signals.find((it) => it.name === {})); analyser.add(list.chosen)",
            json!(name)
        ));
        wait_said(&browser, &format!("{name} is on the axis."));
    }
    browser.wait("analyser.tracks[1].values.length > 6");
    browser.run("document.getElementById('pause').click()");
    browser.wait("bar.moment");
    // The chosen signal is that of the fast driver: its levels one after the other, back and forth.
    let go = |by: i32| {
        browser.run("window.before = bar.moment.ms");
        browser.run(&format!("analyser.toEdge({by})"));
        browser.wait("bar.moment.ms !== window.before");
        let level = browser.run(
            "await new Promise(requestAnimationFrame); await new Promise(requestAnimationFrame); \
             return [Number(analyser.tracks[1].parts.now.textContent), \
             Number(plant.signals.find((it) => it.name === 'Fast level').value)]",
        );
        let level = level.as_array().expect("two values").clone();
        assert_eq!(
            level[0], level[1],
            "the axis and the list have the same value"
        );
        level[0].as_f64().expect("a number")
    };
    let first = go(-1);
    let levels = [-1, -1, 1, 1].map(go);
    assert_eq!(
        levels,
        [first - 1.0, first - 2.0, first - 1.0, first],
        "from {first}"
    );
    assert_quiet(&browser);
}

#[test]
fn a_jump_to_an_outage_is_about_the_driver_of_the_chosen_signal() {
    let (_page, _drivers, _serving, browser) = opened();
    browser.run(
        "const { ask } = room; window.asked = []; \
         room.ask = (path, options) => { asked.push(path.replace(/\\d{3,}$/, '')); return ask(path, options); }; \
         list.select(plant.signals.find(({ name }) => name === 'Fast level'))",
    );
    browser.wait("asked.includes('/history/1') && asked.includes('/history/2')");
    browser.run("await bar.jump(false, 'outage')");
    browser.wait("asked.includes('/history/2/last/outage/')");
    assert_quiet(&browser);
}

#[test]
fn a_driver_without_a_history_has_no_values_in_the_past() {
    let (page, _drivers, _serving, browser) = opened();
    let _bare = Ticking::start(&page, 3, "Bare", Nanos::from_millis(11), None);
    let shown = "words.value(plant.signals.find(({ name }) => name === 'Bare level'))";
    browser.wait(&format!("plant.drivers.length === 3 && {shown} > 3"));
    browser.run("document.getElementById('pause').click()");
    browser.wait(&format!("bar.moment && {shown} === '–'"));
    browser.run("document.getElementById('to-live').click()");
    browser.wait(&format!("!bar.moment && {shown} > 3"));
    assert_quiet(&browser);
}

/// Saves what is shown as a list.
fn save_as(browser: &Browser, name: &str) {
    browser.run(&format!(
        "document.getElementById('watch-new').value = {}; document.getElementById('watch-file').requestSubmit()",
        json!(name)
    ));
}

const LEVELS: &str =
    "for (const signal of plant.signals) if (signal.name.endsWith('level')) watch.pin(signal)";

#[test]
fn a_list_that_is_not_saved_everywhere_is_saved_nowhere() {
    let folder = tempfile::tempdir().expect("a folder");
    let flow = "[[list]]\nname = \"Flow\"\npins = []\n";
    fs::write(folder.path().join("Fast.lists.toml"), flow).expect("there is room");
    let (_page, drivers, _serving, browser) = opened_beside(Some(folder.path()));
    browser.wait(
        "watch.files.size === 2 && document.getElementById('access').textContent === 'may force'",
    );
    browser.run(LEVELS);
    save_as(&browser, "Flow");
    wait_said(
        &browser,
        "There is a list \"Flow\" already, which is not overwritten; take another name.",
    );
    assert!(!folder.path().join("Slow.lists.toml").exists());
    save_as(&browser, "Levels");
    wait_said(&browser, "The list \"Levels\" is saved in ");
    for (name, other) in [("Slow", "Fast"), ("Fast", "Slow")] {
        let file = folder.path().join(format!("{name}.lists.toml"));
        let text = fs::read_to_string(file).expect("it is saved");
        assert!(
            text.contains(&format!("{name} level")) && !text.contains(other),
            "{text}"
        );
    }
    // The pin of a driver that has left waits for it.
    let [_slow, fast] = drivers;
    drop(fast);
    browser.wait("plant.drivers.length === 1 && watch.files.size === 1");
    let told = browser.run(
        "return [watch.pinned().length, document.getElementById('status').textContent.includes('changed')]",
    );
    assert_eq!(told, json!([2, false]));
}
