//! The marks of faults.

use std::ops::RangeInclusive;

use tickbus_image::signal::{DataType, Latch, Signal, Slot};
use tickbus_record::{Column, Columns};

use super::*;
use crate::forcing::Way;
use crate::trends;
use tickbus_fieldbus::Cause;
use tickbus_record::TrendPoint;

/// An archive of twenty ticks, one each millisecond, with one signal.
fn archive() -> Archive {
    archive_within(1 << 20, 20)
}

/// An archive of this many ticks, whose history may take `limit` bytes.
fn archive_within(limit: usize, ticks: u64) -> Archive {
    let table = SignalTable {
        signals: vec![Signal {
            latch: Some(Latch::Rising),
            ..Signal::new("a", Area::Output, 0, DataType::Byte)
        }],
        ..SignalTable::default()
    };
    let columns = Columns {
        driver: "x".to_owned(),
        role: "device".to_owned(),
        stations: Vec::new(),
        columns: vec![Column::plain("a".to_owned(), DataType::Byte, String::new())],
    };
    let history = History::new(columns, limit);
    push_ticks(&history, 1..=ticks);
    let facts = Facts {
        table,
        reads: Some(Area::Input),
        fail_safe: FailSafeValues::All,
        is_sampled: false,
        has_bits: true,
    };
    Archive::new(Arc::new(history), facts)
}

fn push_ticks(history: &History, numbers: RangeInclusive<u64>) {
    for number in numbers {
        let time = Nanos::from_millis(i64::try_from(number).expect("few"));
        history.push(&Tick {
            number,
            time,
            ..Tick::new(history.columns())
        });
    }
}

/// The state at a tick, or at the oldest one.
fn state(archive: &Archive, tick: u64) -> serde_json::Value {
    let state = archive.state(Moment::Tick(tick), None).expect("a tick");
    serde_json::from_str(&state).expect("right")
}

/// The value at a tick.
fn value(archive: &Archive, tick: u64) -> Option<f64> {
    state(archive, tick)["values"][0][1].as_f64()
}

/// The tick to which a jump leads.
fn jump(archive: &Archive, what: &str, is_forward: bool, from: u64) -> Option<u64> {
    let found = archive.jump(what, is_forward, from).expect("known");
    let found: serde_json::Value = serde_json::from_str(&found).expect("right");
    found["tick"].as_u64()
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
    assert_eq!(jump(&archive, "fault", true, 1), Some(7));
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
    let value = |tick: u64| value(&archive, tick);
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
    let value = |tick: u64| value(&archive, tick);
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

#[test]
fn a_trend_ends_where_the_forces_are_known() {
    let archive = archive();
    let trend = |path: &str| -> serde_json::Value {
        let trend = trends::document(&archive, path).expect("a trend");
        serde_json::from_str(&trend).expect("right")
    };
    assert_eq!(trend("0/0/30")["to_ms"], 20.0);
    archive.note_faults(&[], 0, 10);
    assert_eq!(trend("0/0/30")["to_ms"], 10.0);
    // This trend begins after the last tick whose forces are known.
    assert_eq!(trend("0/12/30")["to_ms"], 10.0);
    archive.note_force(1, Way::Once.force(0, Slot::from_real(7.0), None));
    archive.note_faults(&[forced(1, Phase::Over, 1, 16)], 0, 20);
    let rest = trend("0/10/30");
    assert_eq!(rest["to_ms"], 20.0);
    assert_eq!(rest["signals"]["0"]["ms"], json!([10.0, 15.0, 16.0]));
}

#[test]
fn a_force_stays_known_however_many_faults_come_after_it() {
    let archive = archive();
    archive.note_force(1, Way::Hold.force(0, Slot::from_real(5.0), None));
    let hold = forced(1, Phase::Active, 1, 3);
    let most = u32::try_from(MOST).expect("few");
    for id in 2..most + 2 {
        archive.note_force(id, Way::Once.force(0, Slot::from_real(6.0), None));
        let leak = FaultStatus {
            name: "leak".to_owned(),
            ..forced(id, Phase::Over, 1, 10)
        };
        archive.note_faults(&[hold.clone(), leak], 0, 20);
    }
    assert!(archive.notes().marks.len() <= MOST);
    assert_eq!(archive.notes().forces.len(), 2);
    assert_eq!(
        [2, 3, 20].map(|tick| value(&archive, tick)),
        [0.0, 5.0, 5.0].map(Some)
    );
    archive.note_faults(&[forced(1, Phase::Over, 1, 15)], 0, 20);
    assert_eq!(
        [14, 15].map(|tick| value(&archive, tick)),
        [5.0, 0.0].map(Some)
    );
}

#[test]
fn a_recording_has_many_faults_and_its_bar_some_of_them() {
    let archive = archive();
    for pulse in 0..30_000 {
        let tick = 1 + pulse * 19 / 30_000;
        let at = Nanos::from_millis(i64::try_from(tick).expect("few"));
        archive.note_turn((tick, at), "leak", true);
        archive.note_turn((tick, at), "leak", false);
    }
    assert_eq!(jump(&archive, "fault", true, 0), Some(1));
    let shown = marks(&archive);
    assert!((19..=MOST).contains(&shown.len()), "{}", shown.len());
    assert_eq!((shown[0].0, shown[shown.len() - 1].0), (1, 19));
}

#[test]
fn a_ramp_goes_on_after_its_beginning_has_left_the_memory() {
    let up = Way::Ramp(Nanos::from_millis(10)).force(0, Slot::from_real(100.0), None);
    let ramp = forced(1, Phase::Active, 1, 3);
    let looked_before = archive_within(8 << 10, 20);
    let looked_after = archive_within(8 << 10, 20_000);
    for (archive, known) in [(&looked_before, 20), (&looked_after, 20_000)] {
        archive.note_force(1, up);
        archive.note_faults(std::slice::from_ref(&ramp), 0, known);
    }
    push_ticks(&looked_before.history, 21..=20_000);
    for archive in [&looked_before, &looked_after] {
        let (first, begin) = archive.history.span().expect("ticks").first;
        assert!(first > 1_000, "{first}");
        assert_eq!(value(archive, 0), Some(100.0));
        let own = archive
            .history
            .trend(0, None, (begin, Nanos::from_secs(20)));
        let points = archive.with_forces(0, own, Nanos::from_secs(20));
        assert_eq!(points, [(begin, Some(Slot::from_real(100.0)))]);
        let found = archive.when("a%20%3C%2099", true, 0);
        assert!(found.contains("\"tick\":null"), "{found}");
        assert_eq!(jump(archive, "fault", false, 20_000), None);
    }
}

#[test]
fn a_jump_to_a_change_sees_what_is_forced() {
    let archive = archive();
    archive.note_force(1, Way::Hold.force(0, Slot::from_real(5.0), None));
    archive.note_faults(&[forced(1, Phase::Active, 1, 8)], 0, 20);
    archive.note_faults(&[forced(1, Phase::Over, 1, 12)], 0, 20);
    let next = |from| jump(&archive, "0", true, from);
    assert_eq!([3, 8, 12].map(next), [Some(8), Some(12), None]);
    let last = |from| jump(&archive, "0", false, from);
    assert_eq!([20, 12, 8].map(last), [Some(12), Some(8), None]);
}

#[test]
fn edges_that_the_history_lacks_are_unknown() {
    let archive = archive();
    let change = &state(&archive, 5)["values"][0];
    assert_eq!(change.get(3), None, "{change}");
}

#[test]
fn a_stale_value_is_marked_as_fail_safe_if_it_is() {
    let mut archive = archive();
    archive.facts.reads = Some(Area::Output);
    archive.history.push(&Tick {
        number: 21,
        time: Nanos::from_millis(21),
        status: 2,
        ..Tick::new(archive.history.columns())
    });
    let flags = |archive: &Archive| state(archive, 21)["values"][0][4].as_u64();
    assert_eq!(flags(&archive), Some(u64::from(STALE | FAIL_SAFE)));
    archive.facts.fail_safe = FailSafeValues::Stated;
    assert_eq!(flags(&archive), Some(u64::from(STALE)));
    archive.facts.table.signals[0].states_fail_safe = true;
    assert_eq!(flags(&archive), Some(u64::from(STALE | FAIL_SAFE)));
}
