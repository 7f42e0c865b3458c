//! A history has what a file of the same run has, at every tick, within its memory.

use proptest::prelude::*;

use super::*;
use crate::tests::{columns, open, read, table, ticks, written};

/// True for the second of two ticks that is a goal.
type IsGoal<'a> = &'a dyn Fn(&[Tick]) -> bool;

/// The ticks between two times.
fn between(history: &History, from: Nanos, to: Nanos) -> Vec<Tick> {
    let mut found = Vec::new();
    history.ticks((from, to), |tick| {
        found.push(tick.clone());
        true
    });
    found
}

fn all(history: &History) -> Vec<Tick> {
    between(history, Nanos(i64::MIN), Nanos::MAX)
}

/// A tick without its counts of edges, which are sums at a moment.
fn without_edges(mut tick: Tick, columns: &Columns) -> Tick {
    for (value, column) in tick.values.iter_mut().zip(&columns.columns) {
        if column.is_edges {
            *value = Slot::default();
        }
    }
    tick
}

proptest! {
    #[test]
    fn a_history_has_every_value_of_every_tick_of_the_file(
        words in prop::collection::vec(any::<(u64, u64)>(), 1..60),
        stations in 1_usize..3,
        blocks in 0_usize..3,
    ) {
        let names = &["North", "South"][..stations];
        let table = table(names);
        let columns = columns(&table);
        let ticks = ticks(&columns, &words);
        // Blocks of one tick, of some ticks, or one for all.
        let history = History {
            block: [1, 200, 1 << 20][blocks],
            ..History::new(columns.clone(), 1 << 30)
        };
        for tick in &ticks {
            history.push(tick);
        }
        let (file, _) = written(Format::Vcd, &columns, &ticks);
        let (from_file, ended) = read(open(Format::Vcd, &file, &table).expect("a recording"));
        prop_assert_eq!(ended, Ok(false));
        prop_assert_eq!(&all(&history), &from_file);
        // The file of a window is that of its ticks alone.
        let (from, to) = (ticks[ticks.len() / 3].time, ticks[ticks.len() * 2 / 3].time);
        let window: Vec<Tick> = ticks.iter().filter(|tick| (from..=to).contains(&tick.time)).cloned().collect();
        prop_assert_eq!(&between(&history, from, to), &window);
        for format in [Format::Vcd, Format::Csv] {
            let made = history.file(format, (from, to), usize::MAX).expect("there is room");
            let (again, _) = read(open(format, &made, &table).expect("a recording"));
            prop_assert_eq!(&again, &window);
        }
        let mut sums = vec![0.0; columns.columns.len()];
        for (index, tick) in ticks.iter().enumerate() {
            let at = history.at(Moment::Tick(tick.number)).expect("a tick");
            for ((sum, value), column) in sums.iter_mut().zip(&tick.values).zip(&columns.columns) {
                *sum += value.real();
                let place = columns.position(&column.name, true);
                if let (true, Some(place)) = (column.is_edges, place) {
                    prop_assert_eq!(at.values[place].real(), *sum);
                }
            }
            prop_assert_eq!(without_edges(at, &columns), without_edges(tick.clone(), &columns));
            let later = ticks.get(index + 1);
            let after = history.at(Moment::After(tick.number)).expect("a tick");
            prop_assert_eq!(after.number, later.unwrap_or(tick).number);
            if later.is_none_or(|later| later.time > tick.time) {
                let then = history.at(Moment::Time(tick.time)).expect("a tick");
                prop_assert_eq!(then.number, tick.number);
            }
        }
    }

    #[test]
    fn searches_and_trends_find_what_the_ticks_have(
        words in prop::collection::vec(any::<(u64, u64)>(), 2..60),
        blocks in 0_usize..3,
    ) {
        let table = table(&["North", "South"]);
        let columns = columns(&table);
        let mut ticks = ticks(&columns, &words);
        for (index, tick) in ticks.iter_mut().enumerate() {
            tick.time = Nanos(1000 * index as i64);
        }
        let history = History {
            block: [1, 200, 1 << 20][blocks],
            ..History::new(columns.clone(), 1 << 30)
        };
        for tick in &ticks {
            history.push(tick);
        }
        let column = words[0].1 as usize % table.signals.len();
        let station = table.signals[column].station;
        let is_changed = |pair: &[Tick]| pair[0].values[column] != pair[1].values[column];
        let goes_stale = |pair: &[Tick]| {
            let all = |tick: &Tick| [tick.status, tick.stations[0], tick.stations[1]];
            all(&pair[0]).into_iter().zip(all(&pair[1])).any(|(a, b)| !is_stale(a) && is_stale(b))
        };
        let goals: [(Goal, IsGoal<'_>); 2] =
            [(Goal::Change(column), &is_changed), (Goal::Outage, &goes_stale)];
        for (goal, is_goal) in goals {
            let hits: Vec<u64> = ticks.windows(2).filter(|pair| is_goal(pair)).map(|pair| pair[1].number).collect();
            for tick in &ticks {
                let next = hits.iter().find(|hit| **hit > tick.number).copied();
                let last = hits.iter().rfind(|hit| **hit < tick.number).copied();
                let found = |is_forward| history.search(tick.number, is_forward, goal).map(|(number, _)| number);
                prop_assert_eq!(found(true), next);
                prop_assert_eq!(found(false), last);
            }
        }
        let (from, to) = (ticks[ticks.len() / 3].time + Nanos(500), ticks[ticks.len() - 1].time);
        let mut expected: Vec<TrendPoint> = Vec::new();
        for tick in &ticks {
            let value = (!is_stale(tick.stations[station])).then(|| tick.values[column]);
            if tick.time <= from {
                expected = vec![(from, value)];
            } else if expected.last().is_none_or(|(_, last)| *last != value) {
                expected.push((tick.time, value));
            }
        }
        prop_assert_eq!(history.trend(column, Some(station), (from, to)), expected);
        // By their numbers: every tick in which it changes, or every one.
        let from = ticks[ticks.len() / 3].number;
        for is_every in [false, true] {
            let mut expected: Vec<(u64, Option<Slot>)> = Vec::new();
            for tick in &ticks {
                let value = (!is_stale(tick.stations[station])).then(|| tick.values[column]);
                if tick.number <= from {
                    expected = vec![(tick.number, value)];
                } else if is_every || expected.last().is_none_or(|(_, last)| *last != value) {
                    expected.push((tick.number, value));
                }
            }
            let mut found = Vec::new();
            history.follow(&[(column, Some(station))], (from, is_every), |(number, _), values| {
                found.push((number, values[0]));
                true
            });
            // The first value may come from any tick of a block in which nothing changes.
            let skip = usize::from(!is_every);
            prop_assert_eq!(&found[skip..], &expected[skip..]);
            prop_assert_eq!(found[0].1, expected[0].1);
        }
    }

    #[test]
    fn a_full_history_drops_its_oldest_ticks_and_says_how_far_it_reaches(
        words in prop::collection::vec(any::<(u64, u64)>(), 100..600),
    ) {
        let columns = columns(&table(&["North"]));
        let ticks = ticks(&columns, &words);
        let limit = 4 << 10;
        let history = History::new(columns, limit);
        let mut is_cut = false;
        for (index, tick) in ticks.iter().enumerate() {
            history.push(tick);
            let span = history.span().expect("a tick");
            prop_assert!(span.bytes <= limit, "{span:?}");
            prop_assert_eq!(span.last, (tick.number, tick.time));
            is_cut |= span.first.0 > ticks[0].number;
            prop_assert!(index > 0 || span.first == span.last);
        }
        let kept = all(&history);
        let span = history.span().expect("a tick");
        prop_assert_eq!(span.first.0, kept[0].number);
        prop_assert_eq!(&kept[..], &ticks[ticks.len() - kept.len()..]);
        prop_assert!(is_cut || words.len() < 400, "{} of {}", kept.len(), ticks.len());
    }
}

#[test]
fn outages_are_listed_with_their_ends() {
    let columns = columns(&table(&[""]));
    let history = History {
        block: 40,
        ..History::new(columns.clone(), 1 << 20)
    };
    let mut tick = Tick::new(&columns);
    for status in [2, 2, 0, 0, 1, 2, -3, 1, 1, 1, 2] {
        tick.number += 1;
        tick.time += Nanos(10);
        tick.status = status;
        history.push(&tick);
    }
    let outages = history.outages();
    let expected = [
        (Nanos(10), Some(Nanos(30))),
        (Nanos(60), Some(Nanos(80))),
        (Nanos(110), None),
    ];
    assert_eq!(outages, expected);
}

#[test]
fn an_empty_history_has_nothing() {
    let history = History::new(columns(&table(&[""])), 1 << 20);
    assert_eq!(history.span(), None);
    assert_eq!(history.at(Moment::Time(Nanos(5))), None);
    assert_eq!(history.trend(0, None, (Nanos(0), Nanos(9))), []);
    assert_eq!(history.outages(), []);
    assert_eq!(history.search(3, true, Goal::Outage), None);
}
