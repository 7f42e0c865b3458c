//! The studio of a driver that runs.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::{Value as Json, json};
use tickbus_base::time::Monotonic;
use tickbus_driver::Driver;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_live_page::LivePage;
use tickbus_web::{Change, Verb};

use crate::running::Running;
use crate::site::Studio;

const FILE: &str = "# The rig.\n[driver]\nid = 7\nname = \"Rig\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"first\" # here\n\
                    [[signal]]\nname = \"Lamp\"\naddress = \"%IX0.0\"\n[[signal]]\nname = \"Valve\"\naddress = \"%QB0\"\n";

/// A driver with its studio.
struct Fixture {
    folder: tempfile::TempDir,
    driver: Option<Driver>,
    studio: Option<Studio>,
    _page: LivePage,
}

impl Fixture {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("there is room");
        let path = folder.path().join("driver.cfg");
        fs::write(&path, text).expect("there is room");
        let read = move || {
            let read = Config::load(&path, &Kinds::LOOPBACK);
            read.map_err(|mistakes| mistakes.to_string())
        };
        let config = read().expect("no mistakes");
        let driver = Driver::open(config, Monotonic::shared()).expect("opens");
        let running = Running {
            id: 7,
            config: Arc::clone(driver.config()),
            kinds: &Kinds::LOOPBACK,
            line: driver.line(),
            read: Box::new(read),
        };
        let page = LivePage::open(Monotonic::shared()).expect("a thread");
        let studio = Studio::of_running(running).expect("it can be read");
        Self {
            folder,
            driver: Some(driver),
            studio: Some(studio),
            _page: page,
        }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("driver.cfg")
    }

    fn line(&self) -> Json {
        let studio = self.studio.as_ref().expect("open");
        let state: Json = serde_json::from_str(&studio.state("0")).expect("JSON");
        state["line"].clone()
    }

    fn put(&self, path: &str, body: &str) -> Result<(), (u16, String)> {
        let studio = self.studio.as_ref().expect("open");
        studio.change(&Change {
            verb: Verb::Put,
            path: format!("/{path}"),
            body: body.to_owned(),
        })
    }

    /// Edits one cell.
    fn set(&self, at: &Json, was: &str, to: &str) {
        let edit = json!({ "set": { "at": at, "was": was, "to": to } });
        self.put("edit", &edit.to_string()).expect("an edit");
    }

    /// The link that the driver is on.
    fn present(&self) -> String {
        let line = self.driver.as_ref().and_then(Driver::line);
        let config = line.and_then(|line| line.config()).expect("open");
        let text = fs::read_to_string(self.path()).expect("it is there");
        let of_file = Config::parse("driver.cfg", &text, &Kinds::LOOPBACK);
        let is_file = of_file.is_ok_and(|file| config.has_line_of(&file));
        if is_file { "the file's" } else { "another" }.to_owned()
    }
}

#[test]
fn an_edit_is_taken_by_the_line_that_runs_and_keeps_comments() {
    let fixture = Fixture::new(FILE);
    let line = fixture.line();
    assert_eq!(line["runs"], json!(true));
    assert_eq!(line["isOld"], json!(false));
    assert_eq!(line["owner"]["name"], json!("Rig"));
    fixture.set(&json!(["fieldbus", "link"]), "first", "second");
    assert_eq!(fixture.line()["isOld"], json!(true));
    assert_eq!(fixture.present(), "another");
    assert_eq!(fixture.put("line", "take"), Ok(()));
    assert_eq!(fixture.present(), "the file's");
    assert_eq!(fixture.line()["isOld"], json!(false));
    let text = fs::read_to_string(fixture.path()).expect("it is there");
    assert_eq!(text, FILE.replace("\"first\"", "\"second\""));
}

#[test]
fn what_needs_a_restart_is_said_before_and_refused() {
    let fixture = Fixture::new(FILE);
    fixture.set(&json!(["signal", 1, "type"]), "", "SINT");
    let told = json!(["signal 2 \"Valve\" has another type"]);
    assert_eq!(fixture.line()["owner"]["restart"], told);
    let (status, why) = fixture.put("line", "take").expect_err("another type");
    assert_eq!(
        (status, &*why),
        (
            409,
            "signal 2 \"Valve\" has another type; restart the simulation for that"
        )
    );
    assert_eq!(fixture.line()["refused"], json!(why));
    // As a file with mistakes, whose first one is told with its place.
    fixture.set(&json!(["fieldbus", "max_age"]), "", "soon");
    let (_, why) = fixture.put("line", "take").expect_err("a mistake");
    assert!(why.contains("driver.cfg:") && why.contains("soon"), "{why}");
    assert_eq!(fixture.line()["isOld"], json!(false), "mistakes are marked");
}

#[test]
fn the_simulation_owns_the_line() {
    let mut fixture = Fixture::new(FILE);
    for what in ["start", "stop"] {
        let (status, why) = fixture.put("line", what).expect_err(what);
        assert!(status == 409 && why.contains("owns this line"), "{why}");
    }
    fixture.driver.take().expect("open").close();
    fixture.set(&json!(["fieldbus", "link"]), "first", "third");
    let (_, why) = fixture.put("line", "take").expect_err("closed");
    assert!(why.contains("has closed this driver"), "{why}");
    assert!(fixture.studio.take().and_then(Studio::close).is_none());
}

#[test]
fn a_bus_in_step_with_the_simulation_takes_nothing() {
    let text = FILE.replace("link = \"first\"", "mode = \"stepped\"\nlink = \"step\"");
    let fixture = Fixture::new(&text);
    assert_eq!(fixture.line()["owner"]["restart"], json!([]));
    fixture.set(&json!(["fieldbus", "link"]), "step", "other");
    let told = json!(["the bus runs in step with the simulation"]);
    assert_eq!(fixture.line()["owner"]["restart"], told);
    let (_, why) = fixture.put("line", "take").expect_err("in step");
    assert!(why.contains("restart the simulation"), "{why}");
}

#[test]
fn what_another_door_gives_the_line_is_seen() {
    let fixture = Fixture::new(FILE);
    fixture.set(&json!(["fieldbus", "link"]), "first", "second");
    let studio = fixture.studio.as_ref().expect("open");
    let state: Json = serde_json::from_str(&studio.state("0")).expect("JSON");
    assert_eq!(state["line"]["isOld"], json!(true));
    // As tickbus_reload of the C interface does.
    let line = fixture.driver.as_ref().and_then(Driver::line);
    let next = Config::load(&fixture.path(), &Kinds::LOOPBACK).expect("no mistakes");
    assert!(line.expect("free").take(next).expect("it can"));
    let seen = state["state"].as_str().expect("a text");
    let state: Json = serde_json::from_str(&studio.state(seen)).expect("JSON");
    assert_eq!(state["line"]["isOld"], json!(false), "{state}");
}

#[test]
fn a_page_does_not_take_the_file_of_another_studio_for_its_own() {
    let (one, other) = (
        Fixture::new(FILE),
        Fixture::new(&FILE.replace("Lamp", "Light")),
    );
    let studio = |of: &Fixture, seen: &str| -> Json {
        let studio = of.studio.as_ref().expect("open");
        serde_json::from_str(&studio.state(seen)).expect("JSON")
    };
    let seen = studio(&one, "0");
    let there = studio(&other, seen["state"].as_str().expect("a text"));
    assert_eq!(there["sheet"]["signals"][0]["name"], json!("Light"));
    // The text that the page has is not written over the other file.
    let text = json!({ "text": { "was": seen["version"], "to": seen["text"] } });
    let (status, _) = other
        .put("edit", &text.to_string())
        .expect_err("not its text");
    assert_eq!(status, 409);
    let exact = 1_u64 << 53;
    assert!(
        seen["version"].as_u64().expect("a number") < exact,
        "as JavaScript has it"
    );
}
