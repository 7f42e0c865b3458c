//! The studio beside the live page of a machine that runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use serde_json::json;
use tickbus::time::Monotonic;
use tickbus_conformance::rig::End;

use crate::edited::Edited;
use crate::studio::{READY, set, wait_line};
use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, click};

const SIGNALS: &str = "\n[[signal]]\nname = \"Lamp\"\naddress = \"%IX0.0\"\n\n\
                       [[signal]]\nname = \"Speed\"\naddress = \"%QW2\"\ntype = \"INT\"\n";

/// A PLC that has one speed, until it is dropped.
struct Plc {
    address: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Plc {
    fn new(speed: f64) -> Self {
        let text = format!(
            "[driver]\nid = 1\nname = \"PLC\"\n[fieldbus]\nkind = \"modbus-server\"\nrole = \"controller\"\n\
             address = \"127.0.0.1:0\"\n{SIGNALS}"
        );
        let mut plc = End::open(&text, &Monotonic::shared(), &tickbus::KINDS);
        plc.set("Speed", speed);
        let (address, stop) = (plc.address().to_string(), Arc::<AtomicBool>::default());
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            while !stopped.load(Ordering::Relaxed) {
                plc.tick();
                std::thread::sleep(Duration::from_millis(5));
            }
        });
        Self {
            address,
            stop,
            thread: Some(thread),
        }
    }
}

impl Drop for Plc {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn wait_speed(browser: &Browser, speed: &str) {
    browser.wait(&format!(
        "[...document.querySelectorAll('#rows .c-value')][1]?.textContent === {}",
        json!(speed)
    ));
}

fn wait_taken(browser: &Browser, words: &str) {
    browser.wait(&format!(
        "document.getElementById('taken').textContent.includes({})",
        json!(words)
    ));
}

#[test]
fn the_address_of_a_plc_is_changed_on_the_page_of_a_running_machine() {
    let (first, second) = (Plc::new(11.0), Plc::new(22.0));
    let text = format!(
        "[driver]\nid = 7\nname = \"Cell\"\n\n[fieldbus]\nkind = \"modbus-client\"\naddress = \"{}\" # hall 3\n{SIGNALS}",
        first.address
    );
    let machine = Edited::start(&text, &["--edit"]);
    let browser = Browser::start(1400, 900);
    browser.go(&format!("http://{}/#token={}", machine.page, machine.token));
    // The live page has the studio as a tab.
    browser.wait("document.querySelector('#tabs a:last-child')?.pathname.startsWith('/studio')");
    let folder = crate::screenshots();
    shoot(&browser, folder.as_deref(), "taken_live.png", false);
    click(&browser, "#tabs a:last-child");
    browser.wait(READY);
    wait_line(&browser, "running");
    wait_speed(&browser, "11");
    wait_taken(&browser, "has the settings of the file");
    let hidden = "return ['start', 'stop', 'examine'].every((id) => getComputedStyle(document.getElementById(id)).display === 'none')";
    assert_eq!(browser.run(hidden), json!(true));
    assert_eq!(
        browser.run("return document.getElementById('take').disabled"),
        json!(true)
    );

    set(&browser, "key-fieldbus-address", &second.address);
    wait_taken(&browser, "other settings than the line");
    wait_speed(&browser, "11");
    shoot(&browser, folder.as_deref(), "taken_before.png", false);
    click(&browser, "#take");
    wait_speed(&browser, "22");
    wait_taken(&browser, "has the settings of the file");
    assert_eq!(
        machine.text(),
        text.replace(&first.address, &second.address)
    );

    // What needs a restart is said before, and the button is off.
    set(&browser, "key-driver-name", "Press");
    wait_taken(&browser, "must be restarted");
    let told = browser.run("return document.getElementById('restart').textContent");
    assert_eq!(told, json!("[driver] has another \"name\""));
    assert_eq!(
        browser.run("return document.getElementById('take').disabled"),
        json!(true)
    );
    shoot(&browser, folder.as_deref(), "taken_restart.png", false);
    assert_fits(&browser);
    wait_speed(&browser, "22");
    click(&browser, "#tabs a:first-child");
    browser.wait("document.querySelector('#list') !== null && plant.drivers.length === 1");
    browser.wait("[...document.querySelectorAll('.events strong')].some((it) => it.textContent === 'changed settings')");
    assert_quiet(&browser);
}
