//! The machine's stub: rules that respond to the PLC's commands.

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;
use tickbus_reply::{Course, Rule};

use super::edges::Bookmark;
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
    course: Course,
}

impl<'a> Stub<'a> {
    pub(super) fn new(rules: &'a [Rule], watches: &[Watch]) -> Self {
        let armed = |rule: &'a Rule| Armed {
            rule,
            since: bookmarks(rule, watches).collect(),
            course: Course::default(),
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
        let holds = all.all(|(one, since)| since.finds(one, &watches[one.signal], slots));
        if rule.is_of_edge() {
            self.since.clear();
            self.since.extend(bookmarks(rule, watches));
        }
        self.course.step(rule, holds, (now, step), slots);
    }
}

fn bookmarks(rule: &Rule, watches: &[Watch]) -> impl Iterator<Item = Bookmark> {
    rule.when
        .iter()
        .map(|one| Bookmark::of(&watches[one.signal]))
}
