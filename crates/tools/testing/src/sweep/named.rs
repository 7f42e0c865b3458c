//! Conditions with a name, of which all must hold at the same tick.

use crate::edges::Bookmark;
use crate::test::TextPosition;
use crate::watch::Watch;
use tickbus_image::signal::Slot;
use tickbus_reply::Condition;

/// A condition, or several that must hold at the same tick.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Named {
    pub(crate) name: String,
    /// Never empty.
    pub(crate) all: Vec<Condition>,
    pub(crate) place: TextPosition,
}

/// Named conditions from tick to tick: an edge holds at the tick in which it came.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watcher {
    since: Vec<Bookmark>,
}

impl Watcher {
    /// Watches these conditions.
    pub(crate) fn of(named: &Named) -> Self {
        Self {
            since: vec![Bookmark::default(); named.all.len()],
        }
    }

    /// Watches each of `named`.
    pub(crate) fn all(named: &[Named]) -> Vec<Self> {
        named.iter().map(Self::of).collect()
    }

    /// Returns true if the watched conditions hold at this tick. Call this at every tick.
    pub(crate) fn holds(&mut self, named: &Named, watches: &[Watch], slots: &[Slot]) -> bool {
        let mut pairs = named.all.iter().zip(&self.since);
        let holds = pairs.all(|(one, since)| since.finds(one, &watches[one.signal], slots));
        for (one, since) in named.all.iter().zip(&mut self.since) {
            *since = Bookmark::of(&watches[one.signal]);
        }
        holds
    }
}

/// The place of the first of `named` that holds at this tick, which these `watchers` watch. Call this at every tick.
pub(crate) fn holding(
    watchers: &mut [Watcher],
    named: &[Named],
    watches: &[Watch],
    slots: &[Slot],
) -> Option<usize> {
    let mut found = None;
    for (place, (watcher, named)) in watchers.iter_mut().zip(named).enumerate() {
        if watcher.holds(named, watches, slots) {
            found = found.or(Some(place));
        }
    }
    found
}
