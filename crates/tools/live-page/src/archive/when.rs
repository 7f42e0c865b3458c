//! The next and the last tick at which conditions begin to hold.

use serde_json::json;
use tickbus_base::time::Nanos;
use tickbus_base::{Mistake, percent_decoded};
use tickbus_driver::Force;
use tickbus_image::signal::{SignalTable, Slot};
use tickbus_reply::{Condition, real};

use super::{Archive, Mark, millis};

/// The word between two conditions.
const AND: &str = " and ";

/// The longest text of conditions, in bytes.
const LONGEST: usize = 4096;

/// The characters that can follow a name.
const ENDS: [char; 5] = [' ', '<', '>', '=', '!'];

/// A condition whose number is in the form that `Condition::parse` expects: people also write `2,5`, and the page writes
/// `−1`.
fn plain(condition: &str) -> String {
    let (head, number) =
        condition.split_at(condition.rfind(['<', '>', '=']).unwrap_or(condition.len()));
    let mut plain = head.to_owned();
    let mut rest = number.chars().peekable();
    while let Some(c) = rest.next() {
        let is_within = plain.ends_with(|before: char| before.is_ascii_digit())
            && rest.peek().is_some_and(char::is_ascii_digit);
        plain.push(match c {
            '−' => '-',
            ',' if is_within => '.',
            c => c,
        });
    }
    plain
}

/// The conditions of a text, all of which must hold.
fn conditions(text: &str, table: &SignalTable) -> Result<Vec<Condition>, Mistake> {
    if text.trim().is_empty() {
        let name = table.signals.first().map_or("Start", |signal| &signal.name);
        return Err(Mistake::new(
            "no condition is written",
            format!("write one such as \"{name} changes\""),
        ));
    }
    if text.len() > LONGEST {
        return Err(Mistake::new(
            format!("the conditions have {} bytes", text.len()),
            format!("write at most {LONGEST}"),
        ));
    }
    // A name may contain the word.
    let names = table.signals.iter().map(|signal| &*signal.name);
    let names: Vec<&str> = names.filter(|name| name.contains(AND)).collect();
    let is_in_name = |at: &usize| {
        let mut places = names.iter().flat_map(|name| {
            let found = text.match_indices(name);
            let found = found.map(|(begin, _)| begin..begin + name.len());
            // Another name may begin like it.
            found
                .filter(|place| text[place.end..].is_empty() || text[place.end..].starts_with(ENDS))
        });
        places.any(|place| place.contains(at))
    };
    let cuts = text.match_indices(AND).map(|(at, _)| at);
    let mut found = Vec::new();
    let mut begin = 0;
    for end in cuts
        .filter(|at| !is_in_name(at))
        .chain(std::iter::once(text.len()))
    {
        let own = &text[begin..end];
        // A name may contain a comma.
        let condition = Condition::parse(own, table);
        found.push(condition.or_else(|_| Condition::parse(&plain(own), table))?);
        begin = end + AND.len();
    }
    Ok(found)
}

/// The answer to a search.
pub(super) struct Found {
    /// The number and the time of the tick.
    pub(super) at: Option<(u64, Nanos)>,
    /// The last tick that was looked at.
    until: u64,
}

/// The conditions of a search, with the values of the tick before.
struct Search<'a> {
    table: &'a SignalTable,
    /// Each condition with the place of its signal among the values.
    conditions: Vec<(Condition, usize)>,
    /// The values, by the places of the signals.
    before: Vec<Option<Slot>>,
    slots: Vec<Slot>,
    has_edge: bool,
    /// True if the conditions held in the tick before; `None` before the first tick.
    held: Option<bool>,
}

impl Search<'_> {
    /// Takes the values of a tick; returns true if the conditions begin to hold there.
    fn begins(&mut self, values: &[Option<Slot>]) -> bool {
        let mut holds = true;
        for (condition, place) in &self.conditions {
            let signal = &self.table.signals[condition.signal];
            let known = |slot: Option<Slot>| {
                let slot = slot?;
                let value = real(slot, signal);
                (!value.is_nan()).then_some((slot, value))
            };
            let now = known(values[*place]);
            holds &= now.is_some_and(|now| {
                if condition.is_edge() {
                    return known(self.before[*place])
                        .is_some_and(|before| condition.holds_between(before, now));
                }
                self.slots[condition.signal] = now.0;
                condition.holds_for(now.1, &self.slots)
            });
        }
        self.before.copy_from_slice(values);
        let held = self.held.replace(holds);
        // Each edge is a beginning, also one in the tick after another.
        holds && held.is_some_and(|held| self.has_edge || !held)
    }
}

/// The forces of one signal, each from its tick on; `None` where the signal is free again.
struct Forces {
    place: usize,
    turns: Vec<(u64, Option<Mark>)>,
    /// The force of the current tick, and since when.
    on: Option<(Force, Nanos)>,
    next: usize,
}

impl Archive {
    /// The next tick after this one at which the conditions of a percent-encoded text begin to hold, or the last one
    /// before it: all of them hold there, and did not in the tick before. An edge begins in each tick that has one, also in
    /// the tick after another. A condition does not hold while its value is stale. Returns JSON: `tick` (null if there is
    /// none) and `ms`, `until` (the last tick that was looked at) and `is_cut` (true if ticks between `from` and the oldest
    /// one have left the memory); or `wrong`, with what is wrong with the text.
    pub(crate) fn when(&self, text: &str, is_forward: bool, from: u64) -> String {
        let table = &self.facts.table;
        let text = percent_decoded(text);
        let conditions = match conditions(&String::from_utf8_lossy(&text), table) {
            Ok(conditions) => conditions,
            Err(mistake) => return json!({ "wrong": mistake.to_string() }).to_string(),
        };
        let found = self.search(conditions, is_forward, from);
        let first = self.history.span().map_or(0, |span| span.first.0);
        json!({
            "tick": found.at.map(|(tick, _)| tick), "ms": found.at.map(|(_, time)| millis(time)),
            "until": found.until, "is_cut": is_forward && from > 0 && from + 1 < first,
        })
        .to_string()
    }

    /// The next tick after this one at which conditions begin to hold, or the last one before it.
    pub(super) fn search(&self, conditions: Vec<Condition>, is_forward: bool, from: u64) -> Found {
        let table = &self.facts.table;
        let mut signals: Vec<usize> = conditions.iter().map(|it| it.signal).collect();
        signals.sort_unstable();
        signals.dedup();
        let has_edge = conditions.iter().any(Condition::is_edge);
        let placed = conditions.into_iter().filter_map(|condition| {
            let place = signals.binary_search(&condition.signal).ok()?;
            Some((condition, place))
        });
        let mut search = Search {
            table,
            conditions: placed.collect(),
            before: vec![None; signals.len()],
            slots: vec![Slot::default(); table.signals.len()],
            has_edge,
            held: None,
        };
        let wanted: Vec<_> = signals.iter().map(|it| self.column(*it)).collect();
        let mut forces: Vec<Forces> = signals
            .iter()
            .enumerate()
            .filter(|(_, signal)| self.has_forces(**signal))
            .map(|(place, signal)| self.forces(*signal, place))
            .collect();
        // A force that is not known yet may be on in the newest ticks. Only after a restart the last tick is before `from`.
        let known = self.notes().known.unwrap_or(u64::MAX);
        let until = self.last().min(known.max(from));
        let begin = if is_forward { from } else { 0 };
        let mut found = None;
        let mut values = Vec::new();
        self.history
            .follow(&wanted, (begin, !forces.is_empty()), |tick, own| {
                if tick.0 > until || !is_forward && tick.0 >= from {
                    return false;
                }
                values.clear();
                values.extend_from_slice(own);
                for force in &mut forces {
                    if let Some(value) = self.forced_at(force, tick) {
                        values[force.place] = Some(value);
                    }
                }
                if search.begins(&values) {
                    found = Some(tick);
                }
                found.is_none() || !is_forward
            });
        Found { at: found, until }
    }

    /// The forces of a signal.
    fn forces(&self, signal: usize, place: usize) -> Forces {
        let mut turns: Vec<(u64, Option<Mark>)> = Vec::new();
        let mut on: Option<String> = None;
        let is_of = |mark: &Mark| mark.force.is_some_and(|force| force.signal == signal);
        for mark in self.last_marks(usize::MAX, is_of) {
            if mark.begins {
                on = Some(mark.text.clone());
                turns.push((mark.tick, Some(mark)));
            } else if on.as_ref() == Some(&mark.text) {
                on = None;
                turns.push((mark.tick, None));
            }
        }
        Forces {
            place,
            turns,
            on: None,
            next: 0,
        }
    }

    /// The value that a force gives its signal in a tick; `None` if there is no force. Asked for each tick in its order.
    fn forced_at(&self, forces: &mut Forces, (tick, time): (u64, Nanos)) -> Option<Slot> {
        let rest = &forces.turns[forces.next..];
        let due = rest.iter().take_while(|(begin, _)| *begin <= tick).count();
        if due > 0 {
            forces.next += due;
            let mark = forces.turns[forces.next - 1].1.as_ref();
            forces.on = mark.and_then(|mark| Some((mark.force?, mark.since())));
        }
        let (force, since) = forces.on?;
        self.forced(force, time - since)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tickbus_fieldbus::faults::{FaultStatus, Phase};
    use tickbus_image::signal::{Area, DataType, Signal};
    use tickbus_record::{Column, Columns, History, Tick};

    use super::*;
    use crate::archive::Facts;
    use crate::forcing::Way;
    use tickbus_driver::FailSafeValues;

    /// The values of a tick: of "Run", "Start and stop", "Level" and "Phase". The last one is read, and can be stale.
    type Values = [f64; 4];

    /// An archive of a tick a millisecond, the first with the number `first`, and stale in these ticks.
    fn archive(first: u64, ticks: &[Values], stale: &[u64], limit: usize) -> Archive {
        let signal = |name: &str, area, data_type| Signal::new(name, area, 0, data_type);
        let signals = vec![
            signal("Run", Area::Output, DataType::Bool),
            signal("Start and stop", Area::Output, DataType::Bool),
            signal("Level", Area::Output, DataType::Real),
            signal("Phase", Area::Input, DataType::Int),
        ];
        let column =
            |signal: &Signal| Column::plain(signal.name.clone(), signal.data_type, String::new());
        let columns = Columns {
            driver: "x".to_owned(),
            role: "device".to_owned(),
            stations: Vec::new(),
            columns: signals.iter().map(column).collect(),
        };
        let history = History::new(columns.clone(), limit);
        for (number, values) in (first..).zip(ticks) {
            let mut tick = Tick {
                number,
                time: Nanos::from_millis(number.cast_signed()),
                status: if stale.contains(&number) { 2 } else { 0 },
                ..Tick::new(&columns)
            };
            tick.values = values.map(Slot::from_real).to_vec();
            history.push(&tick);
        }
        let facts = Facts {
            table: SignalTable {
                signals,
                ..SignalTable::default()
            },
            reads: Some(Area::Input),
            fail_safe: FailSafeValues::None,
            is_sampled: false,
            has_bits: false,
        };
        Archive::new(Arc::new(history), facts)
    }

    fn answer(archive: &Archive, text: &str, is_forward: bool, from: u64) -> serde_json::Value {
        serde_json::from_str(&archive.when(text, is_forward, from)).expect("right")
    }

    /// All ticks at which the conditions begin to hold, which are the same in both directions.
    fn found(archive: &Archive, text: &str) -> Vec<u64> {
        let all = |is_forward, mut from| {
            let mut ticks = Vec::new();
            loop {
                let answer = answer(archive, text, is_forward, from);
                assert_eq!(answer.get("wrong"), None, "{text}");
                let Some(tick) = answer["tick"].as_u64() else {
                    return ticks;
                };
                #[expect(clippy::cast_precision_loss, reason = "small numbers")]
                let ms = tick as f64;
                assert_eq!(answer["ms"], ms, "{text}");
                assert_ne!(tick, from, "{text}");
                ticks.push(tick);
                from = tick;
            }
        };
        let next = all(true, 0);
        let mut last = all(false, u64::MAX);
        last.reverse();
        assert_eq!(next, last, "{text}");
        next
    }

    const TICKS: [Values; 10] = [
        [1.0, 0.0, 0.0, 3.0],
        [0.0, 0.0, 1.5, 3.0],
        [1.0, 0.0, 2.5, 3.0],
        [0.0, 1.0, 2.5, 4.0],
        [1.0, 1.0, f64::NAN, 3.0],
        [1.0, 1.0, 2.5, 3.0],
        [1.0, 0.0, 2.5, 3.0],
        [0.0, 0.0, 3.5, 3.0],
        [0.0, 1.0, 4.5, 0.0],
        [1.0, 1.0, 4.4, 5.0],
    ];

    #[test]
    fn every_condition_begins_where_it_holds_and_did_not_before() {
        let archive = archive(1, &TICKS, &[], 1 << 20);
        for (text, ticks) in [
            // A condition that holds in the first tick may have begun before it.
            ("Run", &[3, 5, 10][..]),
            ("not Run", &[2, 4, 8]),
            ("Run == 1", &[3, 5, 10]),
            ("Run rises", &[3, 5, 10]),
            ("Run falls", &[2, 4, 8]),
            ("Run changes", &[2, 3, 4, 5, 8, 10]),
            ("Phase == 3", &[5]),
            ("Phase != 3", &[4, 9]),
            ("Phase rises", &[10]),
            ("Phase falls", &[9]),
            ("Phase changes", &[4, 5, 9, 10]),
            // Unknown values neither hold nor are edges; what holds behind them begins there.
            ("Level > 2", &[3, 6]),
            ("Level <= 2", &[]),
            ("Level changes", &[2, 3, 8, 9, 10]),
            ("Level == 4.4 ± 0.2", &[9]),
            ("Level == 4.4 +- 0.05", &[10]),
            ("Start and stop rises", &[4, 9]),
            // In the same tick.
            ("Run and Phase == 3", &[3, 5]),
            ("Run and Start and stop", &[5, 10]),
            ("not Start and stop and Level > 2", &[3, 7]),
            ("Start and stop falls and Run rises", &[]),
            ("Run falls and Start and stop rises", &[4]),
            ("Run%20and%20Level%20%3C%205", &[3, 6, 10]),
            // As people and the page write numbers.
            ("Level > 2,5", &[8]),
            ("Level > −1 and Level == 4,4 ± 0,2", &[9]),
            ("Run == TRUE", &[3, 5, 10]),
            ("Run == False", &[2, 4, 8]),
        ] {
            assert_eq!(found(&archive, text), ticks, "{text}");
        }
    }

    #[test]
    fn a_name_ends_where_the_word_ends() {
        let signal = |name| Signal::new(name, Area::Output, 0, DataType::Bool);
        let names = ["Run", "hold", "holding", "Run and hold", "Mix 1,5"];
        let table = SignalTable {
            signals: names.iter().copied().map(signal).collect(),
            ..SignalTable::default()
        };
        for (text, wanted) in [
            ("Run and holding", &[0, 2][..]),
            ("Run and hold", &[3]),
            ("Run and hold==1 and hold", &[3, 1]),
            ("Run and hold rises and Run and holding", &[3, 0, 2]),
            ("Mix 1,5 == 1 and Mix 1,5 falls", &[4, 4]),
        ] {
            let found = conditions(text, &table).unwrap_or_else(|why| panic!("{text}: {why}"));
            let found: Vec<usize> = found.iter().map(|it| it.signal).collect();
            assert_eq!(found, wanted, "{text}");
        }
    }

    #[test]
    fn what_is_no_condition_is_told() {
        let archive = archive(1, &TICKS, &[], 1 << 20);
        for (text, told) in [
            (
                " ",
                "no condition is written; write one such as \"Run changes\"",
            ),
            (
                "Rnu rises",
                "there is no signal \"Rnu\"; did you mean \"Run\"?",
            ),
            (
                "Run and Levle > 3",
                "there is no signal \"Levle\"; did you mean \"Level\"?",
            ),
            (
                "Level",
                "\"Level\" is no BOOL, and cannot be true by itself; compare it, such as \"Level > 0\"",
            ),
            (
                "Run > 3",
                "\"Run > 3\" never changes; \"Run\" (BOOL) goes from 0 to 1",
            ),
            (
                "Run and ",
                "no signal is named; signals are Run, Start and stop, Level, Phase",
            ),
        ] {
            assert_eq!(answer(&archive, text, true, 0)["wrong"], told, "{text}");
        }
        let long = answer(&archive, &"Run and ".repeat(600), true, 0);
        assert_eq!(
            long["wrong"],
            "the conditions have 4800 bytes; write at most 4096"
        );
    }

    #[test]
    fn a_stale_value_holds_nothing_and_has_no_edge() {
        let archive = archive(1, &TICKS, &[2, 3, 10], 1 << 20);
        assert_eq!(found(&archive, "Phase >= 3"), [4]);
        assert_eq!(found(&archive, "Phase changes"), [5, 9]);
        // This end writes it.
        assert_eq!(found(&archive, "Run"), [3, 5, 10]);
        assert_eq!(found(&archive, "Run and Phase != 4"), [5]);
    }

    #[test]
    fn what_has_left_the_memory_is_told_and_no_edge() {
        let ticks: Vec<Values> = (0..20_000)
            .map(|tick| [f64::from(tick % 2), 0.0, f64::from(tick), 0.0])
            .collect();
        let archive = archive(5, &ticks, &[], 8 << 10);
        let first = archive.history.span().expect("ticks").first.0;
        assert!(first > 1_000, "{first}");
        let near = |from| {
            let answer = answer(&archive, "Run changes", true, from);
            (answer["tick"].as_u64(), answer["is_cut"] == true)
        };
        assert_eq!(near(7), (Some(first + 1), true));
        assert_eq!(near(0), (Some(first + 1), false));
        assert_eq!(near(first - 1), (Some(first + 1), false));
        assert_eq!(near(first), (Some(first + 1), false));
        // After a restart the ticks end before the one that was looked at.
        let last = archive.last();
        let late = answer(&archive, "Run changes", true, last + 7);
        assert_eq!(
            (late["tick"].as_u64(), late["until"].as_u64()),
            (None, Some(last))
        );
    }

    #[test]
    fn forced_values_count_in_their_ticks_once_they_are_known() {
        let archive = archive(1, &[[0.0; 4]; 40], &[], 1 << 20);
        let status = |id, name: &str, phase, tick| FaultStatus {
            id,
            name: format!("forced: {name}"),
            kind: "stuck",
            what: format!("\"{name}\" is forced"),
            phase,
            begun: 1,
            since: Nanos::ZERO,
            tick,
        };
        archive.note_faults(&[], 0, 9);
        archive.note_force(1, Way::Hold.force(0, Slot::from_real(1.0), None));
        let next = |text: &str, from| {
            let answer = answer(&archive, text, true, from);
            (answer["tick"].as_u64(), answer["until"].as_u64())
        };
        // The forces of later ticks are not known yet.
        assert_eq!(next("Run", 0), (None, Some(9)));
        assert_eq!(next("Run", 12), (None, Some(12)));
        archive.note_faults(&[status(1, "Run", Phase::Active, 12)], 0, 20);
        assert_eq!(next("Run", 9), (Some(12), Some(20)));
        assert_eq!(next("Run rises", 9), (Some(12), Some(20)));
        assert_eq!(next("Run", 12), (None, Some(20)));
        let up = Way::Ramp(Nanos::from_millis(10));
        archive.note_force(2, up.force(2, Slot::from_real(100.0), None));
        let both = [
            status(1, "Run", Phase::Over, 15),
            status(2, "Level", Phase::Active, 20),
        ];
        archive.note_faults(&both, 0, 40);
        assert_eq!(found(&archive, "not Run"), [15]);
        assert_eq!(found(&archive, "Run changes"), [12, 15]);
        // A ramp goes on in each tick, and is seen from its middle on.
        assert_eq!(found(&archive, "Level > 33"), [24]);
        assert_eq!(next("Level > 33", 22), (Some(24), Some(40)));
        assert_eq!(
            found(&archive, "Level changes"),
            (21..=30).collect::<Vec<_>>()
        );
    }
}
