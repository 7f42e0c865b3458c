//! The small trends in the rows of the list.

use serde_json::json;

use super::{Machine, open, row};
use crate::webdriver::Browser;
use crate::{assert_fits, assert_quiet};

/// The height in pixels of the line in the row of a signal; 0 without a line.
fn height(name: &str) -> String {
    format!(
        "(() => {{ \
           const canvas = {}.parts.spark; \
           const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d'); \
           copy.drawImage(canvas, 0, 0); \
           const {{ data }} = copy.getImageData(0, 0, canvas.width, canvas.height); \
           let [top, bottom] = [Infinity, -1]; \
           for (let i = 0; i < data.length / 4; i++) if (data[4 * i + 3]) {{ \
             const y = Math.floor(i / canvas.width); \
             [top, bottom] = [Math.min(top, y), Math.max(bottom, y)]; }} \
           return Math.max(0, bottom - top + 1); }})()",
        row(name)
    )
}

fn wait_flat(browser: &Browser, name: &str) {
    browser.wait(&format!("{0} > 0 && {0} < 5", height(name)));
}

fn wait_stepped(browser: &Browser, name: &str) {
    browser.wait(&format!("{} > 12", height(name)));
}

fn resize(browser: &Browser, width: u32) {
    browser.devtools(
        "Emulation.setDeviceMetricsOverride",
        &json!({"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}),
    );
}

#[test]
fn a_row_has_a_line_of_the_last_minute_before_the_moment_that_is_shown() {
    let machine = Machine::tank();
    let browser = open(&machine, 1440, 900);
    wait_flat(&browser, "Level");
    // The PLC has never sent it.
    assert_eq!(
        browser.run(&format!("return {}", height("Set point"))),
        json!(0)
    );
    browser.run("window.before = plant.drivers[0].past.last");
    machine.write("4", "1", "27648");
    machine.write("0", "0", "1");
    wait_stepped(&browser, "Level");
    wait_stepped(&browser, "Level low");
    assert_eq!(
        browser.run(&format!(
            "return [{0}.offsetHeight, {0}.parts.spark.ariaHidden]",
            row("Level")
        )),
        json!([34, "true"])
    );
    assert_fits(&browser);
    browser.run("bar.show(`at/${before}`)");
    wait_flat(&browser, "Level");
    browser.wait("!document.querySelector('.is-late')");
    browser.run("bar.live()");
    wait_stepped(&browser, "Level");
    // An open trend shows more of the same.
    browser.run("list.toggle(plant.signals[3])");
    browser.wait(&format!("{} === 0", height("Level")));
    browser.run("list.toggle(plant.signals[3])");
    wait_stepped(&browser, "Level");
    assert_quiet(&browser);
}

#[test]
fn one_slow_answer_does_not_stop_the_lines() {
    let machine = Machine::tank();
    let browser = open(&machine, 1440, 900);
    wait_flat(&browser, "Level");
    browser.run(
        "window.asked = []; const ask = room.ask; \
         room.ask = async (path, options) => { \
           if (path.startsWith('/trend/') && asked.push(performance.now()) === 2) await new Promise((go) => setTimeout(go, 3000)); \
           return ask(path, options); };",
    );
    browser.wait("asked.length > 3");
    let pause = browser.run("return asked[2] - asked[1]");
    assert!(
        pause.as_f64().is_some_and(|pause| pause < 20_000.0),
        "{pause} ms after an answer of 3 s"
    );
    assert_quiet(&browser);
}

#[test]
fn a_list_without_width_for_the_lines_asks_for_none() {
    let machine = Machine::tank();
    let browser = open(&machine, 1440, 900);
    browser.run(
        "window.asked = []; window.at_once = 0; const ask = room.ask; let now = 0; \
         room.ask = async (path, options) => { \
           if (!path.startsWith('/trend/')) return ask(path, options); \
           asked.push(path); at_once = Math.max(at_once, ++now); \
           try { return await ask(path, options); } finally { now--; } };",
    );
    let last = "plant.drivers[0].past.last";
    browser.wait("asked.length > 2");
    assert_eq!(browser.run("return at_once"), json!(1));
    assert_eq!(
        browser.run("return asked.filter((it) => !/^\\/trend\\/7\\/0,1,2,3(\\/-?[\\d.]+){2}\\/\\d+$/.test(it))"),
        json!([])
    );
    let asks_nothing = || {
        browser.wait("document.getElementById('spark').offsetWidth === 0");
        browser.run(&format!(
            "for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame); asked = []; window.from = {last}"
        ));
        browser.wait(&format!("{last} > from + 3000"));
        assert_eq!(browser.run("return asked"), json!([]));
    };
    browser.run("location.hash = '#line'");
    asks_nothing();
    browser.run("location.hash = ''");
    browser.wait("asked.length > 0");
    resize(&browser, 390);
    asks_nothing();
    let style = format!("getComputedStyle({}.parts.spark)", row("Level"));
    assert_eq!(
        browser.run(&format!("return {style}.display")),
        json!("none")
    );
    assert_fits(&browser);
    resize(&browser, 1440);
    browser.wait("asked.length > 0");
    assert_quiet(&browser);
}
