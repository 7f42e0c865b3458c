//! The marks of faults.

use tickbus_image::signal::{DataType, Signal, Slot};
use tickbus_record::{Column, Columns};

use super::*;
use crate::forcing::Way;
use tickbus_fieldbus::Cause;
use tickbus_record::TrendPoint;

/// An archive of twenty ticks, one each millisecond, with one signal.
fn archive() -> Archive {
    let table = SignalTable {
        signals: vec![Signal::new("a", Area::Output, 0, DataType::Byte)],
        ..SignalTable::default()
    };
    let columns = Columns {
        driver: "x".to_owned(),
        role: "device".to_owned(),
        stations: Vec::new(),
        columns: vec![Column::plain("a".to_owned(), DataType::Byte, String::new())],
    };
    let history = History::new(columns.clone(), 1 << 20);
    for number in 1..=20 {
        let time = Nanos::from_millis(i64::try_from(number).expect("few"));
        history.push(&Tick {
            number,
            time,
            ..Tick::new(&columns)
        });
    }
    let facts = Facts {
        table,
        reads: Some(Area::Input),
        is_fail_safe: false,
        is_sampled: false,
        has_bits: true,
    };
    Archive::new(Arc::new(history), facts)
}

fn forced(id: u32, phase: Phase, begun: u64, tick: u64) -> FaultStatus {
    FaultStatus {
        id,
        name: "forced: a".to_owned(),
        kind: "stuck",
        what: "\"a\" is stuck at 5".to_owned(),
        phase,
        begun,
        since: Nanos::ZERO,
        tick,
    }
}

/// The ticks of the marks that the bar of time shows, with their times and whether the fault begins.
fn marks(archive: &Archive) -> Vec<(u64, f64, bool)> {
    let overview: serde_json::Value = serde_json::from_str(&archive.overview()).expect("right");
    let marks = overview["marks"].as_array().expect("a list");
    let mark = |mark: &serde_json::Value| {
        let (tick, ms) = (mark["tick"].as_u64(), mark["ms"].as_f64());
        let begins = mark["begins"].as_bool();
        Some((tick?, ms?, begins?))
    };
    marks
        .iter()
        .map(|it| mark(it).expect("as documented"))
        .collect()
}

#[test]
fn a_fault_after_a_reset_is_where_the_history_has_it() {
    let archive = archive();
    archive.note_faults(&[forced(1, Phase::Active, 1, 3)], 0, 20);
    // A reset after the tenth tick ends the force, in no tick, and the ticks count from 1 again.
    let over = forced(1, Phase::Over, 1, 0);
    archive.note_faults(&[over.clone(), forced(2, Phase::Waiting, 0, 0)], 10, 20);
    archive.note_faults(&[over, forced(2, Phase::Active, 1, 4)], 10, 20);
    let expected = [(3, 3.0, true), (11, 11.0, false), (14, 14.0, true)];
    assert_eq!(marks(&archive), expected);
    let is_forced = |tick: u64| !archive.faults_at(tick).is_empty();
    assert_eq!(
        [2, 3, 4, 10, 11, 13, 14, 20].map(is_forced),
        [false, true, true, true, false, false, true, true]
    );
}

#[test]
fn a_force_that_a_reset_ends_was_on_until_then() {
    let archive = archive();
    archive.note_faults(&[forced(1, Phase::Active, 1, 3)], 0, 20);
    // The page looks before the first tick after the reset.
    archive.note_faults(&[forced(1, Phase::Over, 1, 0)], 0, 20);
    let is_forced = |tick: u64| !archive.faults_at(tick).is_empty();
    assert_eq!([2, 3, 20, 21].map(is_forced), [false, true, true, false]);
}

#[test]
fn a_fault_that_is_over_before_the_page_looks_is_marked_and_found() {
    let archive = archive();
    archive.note_faults(&[forced(1, Phase::Waiting, 0, 0)], 0, 20);
    archive.note_faults(&[forced(1, Phase::Over, 1, 7)], 0, 20);
    archive.note_faults(&[forced(1, Phase::Over, 1, 7)], 0, 20);
    assert_eq!(marks(&archive), [(7, 7.0, true), (7, 7.0, false)]);
    let found = archive.jump("fault", true, 1).expect("known");
    assert!(found.contains("\"tick\":7"), "{found}");
    assert!(archive.faults_at(7).is_empty());
}

#[test]
fn a_mark_keeps_its_time() {
    let archive = archive();
    archive.note_faults(&[forced(1, Phase::Active, 1, 5)], 0, 20);
    // The recorder may not have the tick yet.
    archive.note_faults(&[forced(2, Phase::Active, 1, 21)], 0, 20);
    assert_eq!(marks(&archive), [(5, 5.0, true)]);
    let times = |archive: &Archive| -> Vec<Option<Nanos>> {
        archive.notes().marks.iter().map(|mark| mark.at).collect()
    };
    assert_eq!(times(&archive), [Some(Nanos::from_millis(5)), None]);
}

#[test]
fn a_forced_value_takes_the_place_of_the_one_that_the_simulation_wrote() {
    let archive = archive();
    let slot = Slot::from_real;
    let ms = Nanos::from_millis;
    let trend = |from, to| {
        let own = archive.history.trend(0, None, (ms(from), ms(to)));
        archive.with_forces(0, own, ms(to))
    };
    let own = archive.history.trend(0, None, (ms(0), ms(30)));
    assert_eq!(trend(0, 30), own);
    let first = own[0];
    archive.note_force(1, Way::Hold.force(0, slot(5.0), None));
    archive.note_force(2, Way::Hold.force(0, slot(6.0), None));
    archive.note_faults(&[forced(1, Phase::Active, 1, 3)], 0, 20);
    let to_six = FaultStatus {
        what: "\"a\" is stuck at 6".to_owned(),
        ..forced(2, Phase::Active, 1, 8)
    };
    // The second takes the place of the first in one tick.
    archive.note_faults(&[forced(1, Phase::Over, 1, 8), to_six.clone()], 0, 20);
    let over = FaultStatus {
        phase: Phase::Over,
        tick: 12,
        ..to_six
    };
    archive.note_faults(&[over], 0, 20);
    let (five, six) = (Some(slot(5.0)), Some(slot(6.0)));
    let whole = [first, (ms(3), five), (ms(8), six), (ms(12), first.1)];
    assert_eq!(trend(0, 30), whole);
    assert_eq!(trend(5, 10), [(ms(5), five), (ms(8), six)]);
    assert_eq!(trend(15, 30), [(ms(15), first.1)]);
    let value = |tick: u64| {
        let state = archive.state(Moment::Tick(tick), None).expect("a tick");
        let state: serde_json::Value = serde_json::from_str(&state).expect("right");
        state["values"][0][1].as_f64()
    };
    assert_eq!([2, 3, 8, 12].map(value), [0.0, 5.0, 6.0, 0.0].map(Some));
}

#[test]
fn a_ramp_goes_evenly_and_one_tick_is_one_tick_however_rarely_the_page_looks() {
    let archive = archive();
    let ms = Nanos::from_millis;
    let real = |points: Vec<TrendPoint>| -> Vec<(i64, f64)> {
        let points = points.into_iter();
        points
            .map(|(at, value)| (at.0, value.expect("a value").real()))
            .collect()
    };
    let trend = |from, to| {
        let own = archive.history.trend(0, None, (ms(from), ms(to)));
        real(archive.with_forces(0, own, ms(to)))
    };
    let up = Way::Ramp(ms(10)).force(0, Slot::from_real(100.0), None);
    archive.note_force(1, up);
    archive.note_faults(&[forced(1, Phase::Active, 1, 3)], 0, 20);
    let points = trend(0, 30);
    assert_eq!(points.len(), 101, "{points:?}");
    assert!(points.contains(&(8_000_000, 50.0)), "{points:?}");
    assert_eq!(points.last(), Some(&(13_000_000, 100.0)));
    let value = |tick: u64| {
        let state = archive.state(Moment::Tick(tick), None).expect("a tick");
        let state: serde_json::Value = serde_json::from_str(&state).expect("right");
        state["values"][0][1].as_f64()
    };
    assert_eq!(
        [2, 3, 8, 13, 15].map(value),
        [0.0, 0.0, 50.0, 100.0, 100.0].map(Some)
    );
    // A request that begins after the ramp began.
    assert_eq!(trend(8, 30)[0], (8_000_000, 50.0));
    // Released on its way.
    archive.note_faults(&[forced(1, Phase::Over, 1, 8)], 0, 20);
    assert_eq!(trend(0, 30).last(), Some(&(8_000_000, 0.0)));
    archive.note_force(2, Way::Once.force(0, Slot::from_real(7.0), None));
    archive.note_faults(&[forced(2, Phase::Over, 1, 16)], 0, 20);
    assert_eq!(
        trend(14, 30),
        [(14_000_000, 0.0), (15_000_000, 7.0), (16_000_000, 0.0)]
    );
    // A pulse that begins and ends between two looks.
    archive.note_force(3, Way::Pulse(ms(2)).force(0, Slot::from_real(9.0), None));
    archive.note_faults(&[forced(3, Phase::Over, 1, 19)], 0, 20);
    assert_eq!(
        trend(16, 30),
        [(16_000_000, 0.0), (17_000_000, 9.0), (19_000_000, 0.0)]
    );
    assert_eq!([16, 17, 18, 19].map(value), [0.0, 9.0, 9.0, 0.0].map(Some));
}

#[test]
fn a_moment_has_the_line_and_the_events_before_it() {
    let archive = archive();
    let link = |state, cause, reason: &str, since| Link {
        state,
        cause,
        reason: reason.to_owned(),
        since: Nanos::from_millis(since),
    };
    let now = Nanos::from_millis(20);
    archive.note_line(
        &link(LinkState::Opening, Cause::Waiting, "listening", 5),
        now,
    );
    archive.note_line(&link(LinkState::Running, Cause::Running, "here", 10), now);
    archive.note_line(&link(LinkState::Failed, Cause::Link, "broken", 15), now);
    archive.note_line(
        &link(LinkState::Failed, Cause::Link, "still broken", 15),
        now,
    );
    let leak = FaultStatus {
        name: "leak".to_owned(),
        ..forced(1, Phase::Active, 12, 12)
    };
    // A push-button that is held is no event of the line.
    archive.note_faults(&[leak, forced(2, Phase::Active, 13, 13)], 0, 20);
    let kinds = |millis| {
        let tick = u64::try_from(millis).expect("a tick a millisecond");
        let line = archive.line_at((tick, Nanos::from_millis(millis)))?;
        let events = line["events"].as_array()?.iter();
        let kinds: Vec<_> = events.filter_map(|it| it["kind"].as_str()).collect();
        let kinds = kinds.join(" ");
        Some((kinds, line["has_run"] == true, line["since_ms"].as_f64()?))
    };
    assert_eq!(kinds(4), None);
    assert_eq!(kinds(9), Some(("opening".to_owned(), false, 4.0)));
    assert_eq!(
        kinds(13),
        Some(("opening running fault".to_owned(), true, 3.0))
    );
    let all = "opening running fault failed";
    assert_eq!(kinds(20), Some((all.to_owned(), true, 5.0)));
    assert_eq!(archive.fault_events(Nanos::ZERO)[0].ago_ms, 8);
    // The simulation has not ticked since then, and the time continues.
    let later = archive.fault_events(Nanos::from_millis(1_500));
    assert_eq!(later[0].ago_ms, 1_508);
}
