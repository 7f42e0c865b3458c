//! Which session wrote each signal last: two controllers on one machine undo each other's outputs.

use std::sync::{Arc, Mutex, PoisonError};

use tickbus_base::time::{Clock, Nanos};

use super::visitor::Visitor;

/// The last writers of all signals.
pub(super) struct Writers {
    /// Whether a second writer is refused.
    pub(super) is_single: bool,
    clock: Arc<dyn Clock>,
    max_age: Nanos,
    state: Mutex<State>,
}

struct State {
    /// The sessions that have written.
    sessions: Vec<Visitor>,
    /// The last write of each signal: the session's number, and when.
    last: Vec<Option<(u32, Nanos)>>,
}

impl Writers {
    /// No writes yet to so many `signals`.
    pub(super) fn new(
        is_single: bool,
        signals: usize,
        (clock, max_age): (Arc<dyn Clock>, Nanos),
    ) -> Self {
        Self {
            is_single,
            clock,
            max_age,
            state: Mutex::new(State {
                sessions: Vec::new(),
                last: vec![None; signals],
            }),
        }
    }

    /// The session `id`, which is this `visitor`, begins to write.
    pub(super) fn begin(&self, id: u32, visitor: impl FnOnce() -> Visitor) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let sessions = &mut state.sessions;
        if sessions.iter().all(|session| session.id != id) {
            sessions.retain(Visitor::is_there);
            sessions.push(visitor());
        }
    }

    /// Forgets sessions that are over, with all that the crate has of them.
    pub(super) fn forget_gone(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.sessions.retain(Visitor::is_there);
    }

    /// The session `id` writes a signal. Returns the client that wrote it in another session within `max_age`; a write that
    /// is refused for that reason does not count.
    pub(super) fn write(&self, id: u32, signal: usize) -> Option<String> {
        let now = self.clock.now();
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let State { sessions, last } = &mut *state;
        let recent = last[signal].filter(|(other, at)| *other != id && now - *at <= self.max_age);
        let other = recent.and_then(|(other, _)| {
            let mut sessions = sessions.iter();
            let session = sessions.find(|session| session.id == other)?;
            session.is_there().then(|| session.name.clone())
        });
        if other.is_none() || !self.is_single {
            last[signal] = Some((id, now));
        }
        other
    }
}
