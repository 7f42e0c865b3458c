//! The next and the last tick at which conditions begin to hold.

use serde_json::json;
use tickbus_base::time::Nanos;
use tickbus_base::{Mistake, percent_decoded};
use tickbus_driver::Force;
use tickbus_fieldbus::faults::SignalEffect;
use tickbus_image::signal::{SignalTable, Slot};
use tickbus_record::Moment;
use tickbus_reply::{Condition, real};

use super::{Archive, Mark, millis};

/// The word between two conditions.
const AND: &str = " and ";

/// The longest text of conditions, in bytes.
const LONGEST: usize = 4096;

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
            found.map(|(begin, _)| begin..begin + name.len())
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
        found.push(Condition::parse(&text[begin..end], table)?);
        begin = end + AND.len();
    }
    Ok(found)
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
    signal: usize,
    place: usize,
    turns: Vec<(u64, Option<Mark>)>,
    /// The force of the current tick, since when, and the value before it.
    on: Option<(Force, Nanos, Option<Slot>)>,
    next: usize,
}

impl Archive {
    /// The next tick after this one at which the conditions of a percent-encoded text begin to hold, or the last one
    /// before it: all of them hold there, and did not in the tick before. A condition on a value that is stale does not
    /// hold. As JSON: `tick` (null if there is none) and `ms`, `until` (the last tick that was looked at) and `is_cut` (true
    /// if ticks between `from` and the oldest one have left the memory); or `wrong`, with what is wrong with the text.
    pub(crate) fn when(&self, text: &str, is_forward: bool, from: u64) -> String {
        let table = &self.facts.table;
        let text = percent_decoded(text);
        let conditions = match conditions(&String::from_utf8_lossy(&text), table) {
            Ok(conditions) => conditions,
            Err(mistake) => return json!({ "wrong": mistake.to_string() }).to_string(),
        };
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
        let first = self.history.span().map_or(0, |span| span.first.0);
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
        json!({
            "tick": found.map(|(tick, _)| tick), "ms": found.map(|(_, time)| millis(time)),
            "until": until, "is_cut": is_forward && from > 0 && from + 1 < first,
        })
        .to_string()
    }

    /// The forces of a signal.
    fn forces(&self, signal: usize, place: usize) -> Forces {
        let mut turns: Vec<(u64, Option<Mark>)> = Vec::new();
        let mut on: Option<String> = None;
        let marks = self.notes().marks.clone();
        let is_of = |mark: &Mark| mark.force.is_some_and(|force| force.signal == signal);
        for mark in marks.into_iter().filter(is_of) {
            if mark.begins {
                on = Some(mark.text.clone());
                turns.push((mark.tick, Some(mark)));
            } else if on.as_ref() == Some(&mark.text) {
                on = None;
                turns.push((mark.tick, None));
            }
        }
        Forces {
            signal,
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
            forces.on = mark.and_then(|mark| {
                let since = self.time_of(mark).unwrap_or(time);
                let is_open =
                    |force: &Force| matches!(force.effect, SignalEffect::Ramp { from: None, .. });
                let own = mark.force.filter(is_open).and_then(|_| {
                    let begun = self.history.at(Moment::Time(since))?;
                    Some(begun.values[forces.signal])
                });
                Some((mark.force?, since, own))
            });
        }
        let (force, since, own) = forces.on?;
        self.forced(force, own, time - since)
    }
}
