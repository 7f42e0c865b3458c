//! The past of drivers that tick: states, jumps, trends and files.

use std::time::Duration;

use serde_json::Value;

use super::{EVER, Page, Simulation, eventually};

/// The ticks in the history of driver 1.
fn reach(page: &Page) -> (u64, u64) {
    let history = page.get("/history/1");
    let tick = |key: &str| history[key].as_u64().unwrap_or_default();
    (tick("from_tick"), tick("to_tick"))
}

#[test]
fn every_tick_of_the_past_can_be_asked_for() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", EVER);
    simulation.pass(5);
    for value in [7.0, 8.0, 9.0] {
        simulation.slots(0, value);
        simulation.pass(3);
    }
    eventually("the recorder has taken them", || {
        page.get("/trend/1/1")["values"].as_array().map(Vec::len) == Some(4)
    });
    let (_, last) = reach(&page);
    // Back from change to change, each of one tick.
    let mut from = last + 1;
    for value in [9, 8, 7] {
        let found = page.get(&format!("/history/1/last/1/{from}"));
        from = found["tick"].as_u64().expect("a change");
        let state = page.get(&format!("/history/1/tick/{from}"));
        assert_eq!(
            (&state["tick"], &state["ms"]),
            (&found["tick"], &found["ms"])
        );
        assert_eq!(state["full"], true);
        assert_eq!(state["values"][1], serde_json::json!([1, value]));
        let before = page.get(&format!("/history/1/tick/{}", from - 1));
        assert_eq!(
            before["values"][1][1],
            if value == 7 { 0 } else { value - 1 }
        );
        // The differences alone.
        let differs = page.get(&format!("/history/1/tick/{}/since/{from}", from - 1));
        assert_eq!(differs["full"], false);
        let indices: Vec<&Value> = differs["values"]
            .as_array()
            .expect("rows")
            .iter()
            .map(|row| &row[0])
            .collect();
        assert!(indices.contains(&&Value::from(1)), "{differs}");
        assert!(!indices.contains(&&Value::from(4)), "{differs}");
        let at = page.get(&format!("/history/1/at/{}", found["ms"]));
        assert_eq!(at["tick"], found["tick"]);
        let after = page.get(&format!("/history/1/after/{}", from - 1));
        assert_eq!(after["tick"], found["tick"]);
    }
    assert_eq!(
        page.get(&format!("/history/1/last/1/{from}"))["tick"],
        Value::Null
    );
    // A moment before everything is the first one, and one after everything the last.
    assert_eq!(page.get("/history/1/at/-1e9")["tick"], 1);
    assert!(page.get("/history/1/at/1e12")["tick"].as_u64() >= Some(last));
    for wrong in [
        "/history/2",
        "/history/1/at/x",
        "/history/1/at/NaN",
        "/history/1/tick/-1",
        "/history/1/next/9/1",
        "/history/1/next/outages/1",
        "/history/1/save/0/1.exe",
        "/history/1/save/0",
        "/history/x",
        "/history/",
        "/trend/1/0,9/0/1",
        "/trend/1/0/0",
        "/trend/1/",
        "/trend/1/1/0/1e9/4",
        "/trend/1/1/0/1e9/40001",
        "/trend/1/1/0/1e9/-5",
        "/trend/1/1/0/1e9/x",
        "/trend/1/1/0/1e9/",
        "/trend/1/1/0/1e9/5/5",
        "/history/1/tick/1/since/x",
    ] {
        assert_eq!(page.ask(&format!("GET {wrong}"), "", "").0, 404, "{wrong}");
    }
}

#[test]
fn a_trend_of_few_points_has_the_extremes() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", EVER);
    simulation.pass(5);
    for value in 1..=60 {
        // One tick stands out.
        let value = if value == 31 { 200 } else { value };
        simulation.slots(0, f64::from(value));
    }
    simulation.pass(2);
    let trend = |path: &str| page.get(&format!("/trend/1/{path}"))["signals"].take();
    let values = |of: &Value| of["values"].as_array().cloned().unwrap_or_default();
    eventually("the recorder has taken them", || {
        values(&trend("1/0/1e12")["1"]).last() == Some(&60.0.into())
    });
    let all = trend("1/0/1e12/61");
    assert_eq!(
        (values(&all["1"]).len(), &all["1"]["is_thin"]),
        (61, &Value::Null)
    );
    let few = trend("1,4/0/1e12/20");
    assert_eq!(few["1"]["is_thin"], true);
    let kept = values(&few["1"]);
    assert!(
        kept.len() <= 25,
        "four spans, and what is at their end: {kept:?}"
    );
    for value in [0.0, 200.0, 60.0] {
        assert!(kept.contains(&value.into()), "{kept:?}");
    }
    assert_eq!(values(&few["4"]).len(), 1);
}

#[test]
fn a_force_is_known_in_the_past_and_found() {
    let page = Page::open();
    let simulation = Simulation::start(&page, 1, "Cell", EVER);
    simulation.pass(5);
    assert_eq!(page.change("PUT /force/1/in", "5").0, 200);
    eventually("it comes back", || simulation.slots(0, 9.0)[1] == 5.0);
    assert_eq!(page.change("DELETE /force/1/in", "").0, 200);
    eventually("it is released", || simulation.slots(0, 9.0)[1] == 9.0);
    let marks = || {
        page.get("/history/1")["marks"]
            .as_array()
            .cloned()
            .unwrap_or_default()
    };
    eventually("both are noted", || marks().len() == 2);
    let found = page.get(&format!("/history/1/last/fault/{}", reach(&page).1));
    let tick = found["tick"].as_u64().expect("a fault");
    assert_eq!(marks()[0]["tick"], found["tick"]);
    let flags = |tick: u64| page.get(&format!("/history/1/tick/{tick}"))["values"][0][4].clone();
    assert_eq!(flags(tick), 2, "forced");
    assert_eq!(flags(tick - 1), Value::Null);
    // The PLC got the forced value, whatever the simulation wrote.
    let value = |tick: u64| page.get(&format!("/history/1/tick/{tick}"))["values"][0][1].clone();
    assert_eq!(value(tick), 5);
    let trend = page.get("/trend/1/0")["values"].clone();
    assert!(
        trend.as_array().expect("a trend").contains(&5.0.into()),
        "{trend}"
    );
    let state = page.get(&format!("/history/1/tick/{tick}"));
    assert!(
        state["faults"][0].as_str().expect("a text").contains("in"),
        "{state}"
    );
    let over = marks()[1]["tick"].as_u64().expect("a tick");
    assert_eq!(flags(over), Value::Null);
}

#[test]
fn what_is_saved_is_what_a_recorder_writes_of_that_time() {
    use tickbus_record::{Format, Recording, Tick};

    let folder = std::env::temp_dir().join(format!("tickbus-page-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let file = folder.join("run.vcd");
    let page = Page::open();
    let keys = format!("[record]\nfile = {:?}\n", file.display().to_string());
    let pause = Duration::from_millis(1);
    let simulation = Simulation::start_with(&keys, pause, &page, (1, "Cell"), EVER);
    for value in 0..20 {
        simulation.slots(2, f64::from(value % 2));
        simulation.slots(0, f64::from(value));
    }
    simulation.pass(20);
    let (first, last) = reach(&page);
    assert_eq!(first, 1);
    let ms = |tick: u64| page.get(&format!("/history/1/tick/{tick}"))["ms"].clone();
    let (from, to) = (last / 3, last * 2 / 3);
    let path = format!("/history/1/save/{}/{}", ms(from), ms(to));
    let mut saved = Vec::new();
    for ending in ["vcd", "csv", "html"] {
        let (status, body) = page.ask(&format!("GET {path}.{ending}"), "", "");
        assert_eq!(status, 200);
        saved.push(body);
    }
    assert!(saved[2].contains("<!DOCTYPE html>") && saved[2].contains("bit back"));
    drop(simulation);
    let ticks = |mut recording: Recording| {
        let mut tick = Tick::new(recording.columns());
        let mut ticks = Vec::new();
        while recording.next(&mut tick).expect("whole") {
            ticks.push(tick.clone());
        }
        ticks
    };
    let recorded = Recording::open(&file, None).expect("a recording");
    let columns = recorded.columns().clone();
    let recorded = ticks(recorded);
    let window: Vec<_> = recorded
        .iter()
        .filter(|tick| (from..=to).contains(&tick.number))
        .cloned()
        .collect();
    assert!(window.len() > 10);
    let vcd = std::io::Cursor::new(saved[0].clone().into_bytes());
    let vcd = Recording::read("saved.vcd", Format::Vcd, Box::new(vcd), None).expect("a recording");
    assert_eq!(vcd.columns(), &columns);
    assert_eq!(ticks(vcd), window);
    assert_eq!(saved[1].lines().count(), window.len() + 1);
    std::fs::remove_dir_all(&folder).expect("removed");
}

#[test]
fn a_page_without_a_history_says_so_by_having_none() {
    let page = Page::open();
    let pause = Duration::from_millis(1);
    let simulation = Simulation::start_with("history = 0", pause, &page, (1, "Cell"), EVER);
    simulation.pass(5);
    assert_eq!(page.view().event()["past"], serde_json::json!({}));
    for path in ["/history/1", "/trend/1/0", "/history/1/save/0/1.vcd"] {
        assert_eq!(page.ask(&format!("GET {path}"), "", "").0, 404, "{path}");
    }
}
