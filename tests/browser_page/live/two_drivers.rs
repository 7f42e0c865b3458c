//! Two drivers of one process on one page, with ticks of their own.

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
    fn start(page: &LivePage, id: i32, name: &str, tick: Nanos) -> Self {
        let gate = if name == "Fast" { "Gate" } else { "hold" };
        let text = format!(
            "[driver]\nid = {id}\nname = \"{name}\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
             scan = \"1ms\"\ncycle = \"1ms\"\n[page]\n[[signal]]\nname = \"{name} level\"\naddress = \"%ID0\"\n\
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
            lists: None,
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

/// Two drivers on a page, and a browser. The bar shows the time of the slow one.
fn opened() -> (LivePage, [Ticking; 2], Serving, Browser) {
    let page = LivePage::open(Monotonic::shared()).expect("a thread");
    let room = Room::bind(&Address::local(0), Limits::default()).expect("a port");
    let address = room.address();
    let serving = room.serve(
        tickbus_web::Pages::of("Live page", page.site()),
        Monotonic::shared(),
    );
    let drivers = [
        Ticking::start(&page, 1, "Slow", Nanos::from_millis(97)),
        Ticking::start(&page, 2, "Fast", Nanos::from_millis(11)),
    ];
    let browser = Browser::start(1280, 900);
    browser.go(&format!("http://{address}/"));
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
    browser.wait(&format!("bar.moment && {level} === limit + 1"));
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
