//! The last session that wrote each signal: two controllers on one machine undo each other's outputs.

use std::sync::{Arc, Mutex, PoisonError};

use tickbus_base::time::{Clock, Nanos};

use super::visitor::Visitor;

/// The last writers of all signals.
pub(super) struct Writers {
    /// True if a second writer is refused.
    pub(super) is_single: bool,
    clock: Arc<dyn Clock>,
    max_age: Nanos,
    state: Mutex<State>,
}

struct State {
    /// The sessions that have written.
    sessions: Vec<Visitor>,
    /// The last write of each signal: the session's number, and the time.
    last: Vec<Option<(u32, Nanos)>>,
}

impl Writers {
    /// Writers without any writes to `signals` signals.
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

    /// Forgets sessions that have ended, with the crate's data of them.
    pub(super) fn forget_gone(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.sessions.retain(Visitor::is_there);
    }

    /// With a single writer: the client that wrote one of the signals in another session within `max_age`. The session
    /// `id` may then write none of them, because the values of one Write are seen together or not at all.
    pub(super) fn refuses(
        &self,
        id: u32,
        signals: impl IntoIterator<Item = usize>,
    ) -> Option<String> {
        let now = self.clock.now();
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let mut signals = signals.into_iter().filter(|_| self.is_single);
        signals.find_map(|signal| state.other(id, signal, now - self.max_age))
    }

    /// The session `id` writes a signal. Returns the client that wrote it in another session within `max_age`.
    pub(super) fn write(&self, id: u32, signal: usize) -> Option<String> {
        let now = self.clock.now();
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let other = state.other(id, signal, now - self.max_age);
        state.last[signal] = Some((id, now));
        other
    }
}

impl State {
    /// The client that wrote a signal since a time, in another session than `id`.
    fn other(&self, id: u32, signal: usize, since: Nanos) -> Option<String> {
        let (other, _) = self.last[signal].filter(|(other, at)| *other != id && *at >= since)?;
        let mut sessions = self.sessions.iter();
        let session = sessions.find(|session| session.id == other)?;
        session.is_there().then(|| session.name.clone())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tickbus_base::time::Manual;

    use super::*;

    /// The values of one Write are seen together or not at all, so a single signal of another client refuses all of
    /// them.
    #[test]
    fn a_write_is_refused_while_another_client_has_written_one_of_its_signals() {
        let clock = Manual::new();
        let writers = |is_single| {
            let clock = Arc::clone(&clock) as Arc<dyn Clock>;
            let writers = Writers::new(is_single, 2, (clock, Nanos::from_millis(100)));
            for (id, name) in [(1, "first"), (2, "second")] {
                writers.begin(id, || Visitor {
                    id,
                    name: name.to_owned(),
                    postponed: Box::new(|| Some(Duration::ZERO)),
                });
            }
            assert_eq!(writers.write(1, 0), None);
            writers
        };
        let (single, any) = (writers(true), writers(false));
        assert_eq!(single.refuses(2, [1, 0]).as_deref(), Some("first"));
        assert_eq!(single.refuses(2, [1]), None, "it wrote another signal");
        assert_eq!(single.refuses(1, [1, 0]), None, "it is its own");
        assert_eq!(any.refuses(2, [1, 0]), None);
        assert_eq!(any.write(2, 0).as_deref(), Some("first"));
        clock.advance(Nanos::from_millis(101));
        assert_eq!(single.refuses(2, [1, 0]), None, "it is long ago");
    }
}
