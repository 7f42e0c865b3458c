//! The machine's stub: rules that respond to the PLC's commands.

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

use super::condition::{Bookmark, Condition};
use super::test::Rule;
use super::watch::Watch;

/// Rules, and their state from tick to tick.
#[derive(Debug)]
pub(super) struct Stub<'a> {
    rules: Vec<Armed<'a>>,
}

#[derive(Debug)]
struct Armed<'a> {
    rule: &'a Rule,
    /// The edges already used up, per condition of the rule.
    since: Vec<Bookmark>,
    /// True if the condition held in the previous tick.
    held: bool,
    /// When the rule takes effect; `None` once it has, or while its condition does not hold.
    due: Option<Nanos>,
    /// True if the rule has taken effect and its condition still holds.
    done: bool,
}

impl<'a> Stub<'a> {
    pub(super) fn new(rules: &'a [Rule], watches: &[Watch]) -> Self {
        let armed = |rule: &'a Rule| Armed {
            rule,
            since: bookmarks(rule, watches).collect(),
            held: false,
            due: None,
            done: false,
        };
        Self {
            rules: rules.iter().map(armed).collect(),
        }
    }

    /// One tick of `step` that ends at `now`: checks the PLC's commands, and sets the sensors.
    pub(super) fn step(&mut self, now: Nanos, step: Nanos, watches: &[Watch], slots: &mut [Slot]) {
        for armed in &mut self.rules {
            armed.step(now, step, watches, slots);
        }
    }
}

impl Armed<'_> {
    fn step(&mut self, now: Nanos, step: Nanos, watches: &[Watch], slots: &mut [Slot]) {
        let rule = self.rule;
        let mut all = rule.when.iter().zip(&self.since);
        let holds = all.all(|(one, since)| one.holds(&watches[one.signal], slots, *since));
        let edge = rule.when.iter().any(Condition::is_edge);
        if edge {
            // An edge lasts no time, but its effect still takes place.
            self.since.clear();
            self.since.extend(bookmarks(rule, watches));
            if holds {
                self.due = Some(now + rule.after);
            }
        } else {
            if holds && !self.held {
                self.due = Some(now + rule.after);
            }
            if !holds {
                self.due = None;
                if std::mem::take(&mut self.done) {
                    assign(&rule.otherwise, slots);
                }
            }
            self.held = holds;
        }
        if self.due.is_some_and(|due| due <= now) {
            self.due = None;
            self.done = true;
            assign(&rule.set, slots);
        }
        let moves = if edge { self.done } else { holds && self.done };
        if let (Some(ramp), true) = (rule.ramp, moves) {
            let at = slots[ramp.signal].real();
            #[expect(clippy::cast_precision_loss, reason = "a step is short")]
            let far = ramp.per_second * (step.0 as f64 / 1e9);
            let next = if at < ramp.to {
                (at + far).min(ramp.to)
            } else {
                (at - far).max(ramp.to)
            };
            slots[ramp.signal] = Slot::from_real(next);
        }
    }
}

fn bookmarks(rule: &Rule, watches: &[Watch]) -> impl Iterator<Item = Bookmark> {
    rule.when
        .iter()
        .map(|one| Bookmark::of(&watches[one.signal]))
}

fn assign(values: &[(usize, Slot)], slots: &mut [Slot]) {
    for (signal, value) in values {
        slots[*signal] = *value;
    }
}
