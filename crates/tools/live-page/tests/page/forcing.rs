//! The ways to force: held, for one tick, for a time, along a ramp, and several together.

use super::{EVER, Page, Simulation, eventually};

/// The changes of the signal with this index, tick by tick: times in milliseconds, and values.
fn turns(page: &Page, index: usize) -> (Vec<f64>, Vec<f64>) {
    let trend = page.get(&format!("/trend/1/{index}"));
    let numbers = |key: &str| {
        let list = trend[key].as_array().expect("a list").iter();
        list.filter_map(serde_json::Value::as_f64).collect()
    };
    (numbers("ms"), numbers("values"))
}

/// Waits until the last values of "out" are these, and returns their times.
#[track_caller]
fn wait(page: &Page, values: &[f64]) -> Vec<f64> {
    let mut times = Vec::new();
    eventually(&format!("the values {values:?}"), || {
        let (ms, seen) = turns(page, 1);
        times = ms[ms.len().saturating_sub(values.len())..].to_vec();
        seen.ends_with(values)
    });
    times
}

fn started(page: &Page) -> Simulation {
    let simulation = Simulation::start(page, 1, "Cell", EVER);
    simulation.pass(5);
    simulation
}

#[test]
fn a_value_written_once_is_there_for_one_tick() {
    let page = Page::open();
    let _simulation = started(&page);
    assert_eq!(page.change("PUT /force/1/out", "9 once").0, 200);
    let times = wait(&page, &[0.0, 9.0, 0.0]);
    assert_eq!(times[2] - times[1], 1.0);
    eventually("it is no longer forced", || {
        page.get("/signals")["drivers"][0]["signals"][1]["forced"].is_null()
    });
}

#[test]
fn a_pulse_lasts_its_time_and_nobody_has_to_end_it() {
    let page = Page::open();
    let _simulation = started(&page);
    assert_eq!(page.change("PUT /force/1/out", "9 for 40ms").0, 200);
    let times = wait(&page, &[0.0, 9.0, 0.0]);
    assert_eq!(times[2] - times[1], 40.0);
    // The total counts the fault, and the fault has no series of its own.
    let metrics = page.ask("GET /metrics", "", "").1;
    assert!(
        metrics.contains("tickbus_faults_begun_total{") && !metrics.contains("key=\"fault.1."),
        "{metrics}"
    );
}

#[test]
fn a_ramp_goes_evenly_from_the_present_value_and_is_held() {
    let page = Page::open();
    let simulation = started(&page);
    assert_eq!(page.change("PUT /force/1/out", "100 within 50ms").0, 200);
    let up: Vec<f64> = (0..=50).map(|step| f64::from(2 * step)).collect();
    let times = wait(&page, &up);
    assert_eq!(times[50] - times[1], 49.0);
    // From where it is, and not from what the PLC sends.
    assert_eq!(page.change("PUT /force/1/out", "50 within 10ms").0, 200);
    let down = (1..=10).map(|step| f64::from(100 - 5 * step));
    let whole: Vec<f64> = up.into_iter().chain(down).collect();
    wait(&page, &whole);
    let forced = page.get("/signals")["drivers"][0]["signals"][1]["forced"].clone();
    assert_eq!(forced, 50);
    assert_eq!(page.change("DELETE /force/1/out", "").0, 200);
    wait(&page, &[50.0, 0.0]);
    // An input as well: the PLC, which mirrors it, gets the ramp, and the page shows it.
    assert_eq!(page.change("PUT /force/1/in", "10 within 10ms").0, 200);
    let up: Vec<f64> = (0..=10).map(f64::from).collect();
    wait(&page, &up);
    eventually("the page shows what was reached", || {
        page.get("/signals")["drivers"][0]["signals"][0]["value"] == 10
    });
    assert_eq!(
        simulation.slots(4, 0.0)[0],
        0.0,
        "the simulation's own value stays"
    );
}

#[test]
fn a_ramp_that_has_not_begun_is_where_the_signal_is() {
    let page = Page::open();
    // Between two ticks there is time for two requests.
    let pause = std::time::Duration::from_millis(300);
    let simulation = Simulation::start_in(pause, &page, 1, "Cell", EVER);
    simulation.pass(2);
    assert_eq!(page.change("PUT /force/1/out", "100 within 4ms").0, 200);
    let out = page.get("/signals")["drivers"][0]["signals"][1].clone();
    assert_eq!((&out["forced"], &out["value"]), (&0.into(), &0.into()));
    assert_eq!(page.change("PUT /force/1/out", "40 within 4ms").0, 200);
    wait(&page, &[0.0, 10.0, 20.0, 30.0, 40.0]);
}

#[test]
fn several_are_forced_and_released_in_one_tick_or_not_at_all() {
    let page = Page::open();
    let _simulation = started(&page);
    for (body, status, told) in [
        (
            r#"[["out", "7"], ["bit back", "2"]]"#,
            400,
            "a BOOL takes TRUE or FALSE",
        ),
        (
            r#"[["out", "7"], ["bit bakc", "1"]]"#,
            404,
            r#"did you mean \"bit back\"?"#,
        ),
        (r#"[["out", "7 for 0s"]]"#, 400, "write a time above 0"),
        (
            r#"{"out": "7"}"#,
            400,
            "the body does not name the signals; send [[",
        ),
    ] {
        let (code, text) = page.change("PUT /force/1", body);
        assert_eq!(code, status, "{text}");
        assert!(text.contains(told), "{text}");
    }
    assert_eq!(page.change("DELETE /force/1", r#"["no"]"#).0, 404);
    let both = r#"[["out", "7"], ["bit back", "TRUE"]]"#;
    assert_eq!(page.change("PUT /force/1", both).0, 200);
    wait(&page, &[0.0, 7.0]);
    let names = r#"["out", "bit back"]"#;
    assert_eq!(page.change("DELETE /force/1", names).0, 200);
    let times = wait(&page, &[0.0, 7.0, 0.0]);
    let (ms, values) = turns(&page, 3);
    assert_eq!(values[values.len() - 3..], [0.0, 1.0, 0.0]);
    assert_eq!(ms[ms.len() - 2..], times[1..], "in the same ticks");
}

#[test]
fn a_ramp_is_released_when_nobody_is_there() {
    let page = Page::open();
    let grace = Some(tickbus_base::time::Nanos::from_millis(300));
    let simulation = Simulation::start(&page, 1, "Cell", grace);
    simulation.pass(5);
    assert_eq!(page.change("PUT /force/1/out", "100 within 20ms").0, 200);
    eventually("it is released", || {
        turns(&page, 1).1.ends_with(&[100.0, 0.0])
    });
}
