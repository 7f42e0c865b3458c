//! The live page of a run on virtual time: it shows clients and variables, and forces none.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};
use std::thread;

use serde_json::json;
use tickbus::signal::DataType;
use tickbus::virtual_time::{Declaration, Participant, Step, Variable, tcp};

use crate::webdriver::{Browser, shoot};
use crate::{assert_fits, assert_quiet, find, wait_said};

/// A run in real time, of a robot and its PLC.
struct Run {
    child: Child,
    url: String,
}

impl Run {
    fn start() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("cell.toml");
        let text = "[sync]\nlisten = \"127.0.0.1:0\"\nstep = \"10ms\"\npace = 1\nclients = [\"plc\", \"robot\"]\n";
        std::fs::write(&file, text).expect("there is room");
        let mut child = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .arg("sync")
            .arg(file)
            .args(["--page", "127.0.0.1:0"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the tickbus program runs");
        let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
        let url = find(&mut lines, "sync: page at ");
        let address = find(&mut lines, "sync: listening on ");
        let address: tickbus::net::Address = address.parse().expect("an address");
        // Nobody reads later output; it must not block the program.
        thread::spawn(move || lines.count());
        for mut client in [Client::plc(), Client::robot()] {
            let address = address.clone();
            // The client ends with the server.
            thread::spawn(move || tcp::join(&address, &mut client).is_ok());
        }
        Self { child, url }
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A client whose variables follow the time.
struct Client {
    declaration: Declaration,
    write: fn(Step, &mut [u64]),
}

impl Client {
    fn plc() -> Self {
        let mut declaration = Declaration::new("plc");
        declaration.multiple = 2.try_into().expect("not 0");
        declaration.reads = vec!["axis 1 position".to_owned()];
        declaration.writes = vec![
            Variable::new("gripper closed", DataType::Bool),
            Variable::new("cycles", DataType::Udint),
            // A name is never markup.
            Variable::new("<img src=x onerror='window.harm = 1'>", DataType::Int),
        ];
        Self {
            declaration,
            write: |step, writes| {
                let cycles = step.sequence / 100;
                writes.copy_from_slice(&[cycles % 2, cycles, 7]);
            },
        }
    }

    fn robot() -> Self {
        let mut declaration = Declaration::new("robot");
        declaration.reads = vec!["gripper closed".to_owned()];
        let axes =
            (1..=6).map(|axis| Variable::new(format!("axis {axis} position"), DataType::Lreal));
        declaration.writes = axes.collect();
        Self {
            declaration,
            write: |step, writes| {
                for (write, axis) in writes.iter_mut().zip(1_i32..) {
                    let seconds = step.time.as_micros() / 1e6;
                    *write = (90.0 * (seconds / f64::from(axis)).sin()).to_bits();
                }
            },
        }
    }
}

impl Participant for Client {
    fn declare(&self) -> Declaration {
        self.declaration.clone()
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, step: Step, _: &[u64], writes: &mut [u64]) -> Result<(), String> {
        (self.write)(step, writes);
        Ok(())
    }
}

#[test]
fn a_run_shows_its_clients_and_their_variables_on_every_screen() {
    let folder = crate::screenshots();
    let run = Run::start();
    let browser = Browser::start(1280, 900);
    for (name, width, height) in [("run-wide", 1280, 720), ("run-phone", 390, 844)] {
        browser.resize(width, height);
        browser.go(&run.url);
        browser.wait("document.getElementById('found').textContent === '9 signals'");
        browser.wait("document.querySelectorAll('.row.station:not([hidden])').length === 2");
        let head = browser.run(
            "return [document.title, document.querySelector('.driver .reason').textContent, \
             [...document.querySelectorAll('.row.station:not([hidden]) b')].map((it) => it.textContent), \
             [...document.querySelectorAll('.stations tbody th')].map((it) => it.textContent)]",
        );
        let expected = json!([
            "cell – tickbus",
            "the clients run in real time",
            ["plc", "robot"],
            ["plc", "robot"]
        ]);
        assert_eq!(head, expected);
        // The run continues, in the list and above it.
        for what in [
            "[...document.querySelectorAll('.facts dd')][1].textContent",
            "tickbusPage.value('axis 1 position')",
        ] {
            let before = browser.run(&format!("return {what}"));
            browser.wait(&format!("{what} !== {before}"));
        }
        // Found by the client that writes it, drawn, and not forced.
        browser.run("const it = document.getElementById('filter'); it.value = 'robot'; it.dispatchEvent(new Event('input'))");
        browser.wait("document.getElementById('found').textContent === '6 of 9 signals'");
        browser.run("const it = document.getElementById('list'); it.focus(); it.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowDown', bubbles: true }))");
        browser.wait(
            "document.getElementById('chosen-facts').textContent === 'LREAL · written by robot'",
        );
        browser.keys("f");
        wait_said(&browser, "axis 1 position cannot be forced");
        browser.run("document.getElementById('trend').click()");
        browser.wait("document.querySelector('.row.trend:not([hidden]) canvas')");
        assert_fits(&browser);
        shoot(&browser, folder.as_deref(), &format!("{name}.png"), false);
        assert_eq!(browser.run("return window.harm ?? 0"), 0);
        assert_quiet(&browser);
    }
}
