//! Conditions with a name, of which all must hold at the same tick.

use crate::condition::{Bookmark, Condition};
use crate::test::TextPosition;
use crate::watch::Watch;
use tickbus_image::signal::Slot;

/// A condition, or several that must hold at the same tick.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Named {
    pub(crate) name: String,
    /// Never empty.
    pub(crate) all: Vec<Condition>,
    pub(crate) place: TextPosition,
}

/// Named conditions from tick to tick: an edge holds at the tick in which it came.
#[derive(Clone, Debug)]
pub(crate) struct Watcher<'a> {
    pub(crate) named: &'a Named,
    since: Vec<Bookmark>,
}

impl<'a> Watcher<'a> {
    /// Watches each of `named`.
    pub(crate) fn all(named: &'a [Named]) -> Vec<Self> {
        let watcher = |named: &'a Named| Self {
            named,
            since: vec![Bookmark::default(); named.all.len()],
        };
        named.iter().map(watcher).collect()
    }

    /// Returns true if the conditions hold at this tick. Call this at every tick.
    pub(crate) fn holds(&mut self, watches: &[Watch], slots: &[Slot]) -> bool {
        let mut pairs = self.named.all.iter().zip(&self.since);
        let holds = pairs.all(|(one, since)| one.holds(&watches[one.signal], slots, *since));
        for (one, since) in self.named.all.iter().zip(&mut self.since) {
            *since = Bookmark::of(&watches[one.signal]);
        }
        holds
    }
}

/// The first of `watchers` that holds at this tick. Call this at every tick.
pub(crate) fn holding<'a>(
    watchers: &mut [Watcher<'a>],
    watches: &[Watch],
    slots: &[Slot],
) -> Option<&'a Named> {
    let mut found = None;
    for watcher in watchers {
        if watcher.holds(watches, slots) {
            found = found.or(Some(watcher.named));
        }
    }
    found
}
