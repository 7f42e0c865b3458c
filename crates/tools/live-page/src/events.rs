//! The last events of a line: what the driver noted, and the faults of this page's notes.

use serde::Serialize;
use tickbus_base::time::Nanos;
use tickbus_driver::Watch;
use tickbus_fieldbus::{Cause, LinkState};

/// The most events that are shown.
pub(crate) const MOST: usize = 10;

/// An event, for viewers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Event {
    /// The state that the line entered; `settings`, `fault` or `fault-end` for others.
    pub(crate) kind: &'static str,
    /// The cause of the state; empty for others.
    pub(crate) cause: &'static str,
    pub(crate) text: String,
    /// How long ago it happened last.
    pub(crate) ago_ms: i64,
    /// How long ago it happened first.
    pub(crate) first_ms: i64,
    pub(crate) times: u32,
}

impl Event {
    /// An event that happened once, `ago`.
    pub(crate) fn once(kind: &'static str, cause: &'static str, text: &str, ago: Nanos) -> Self {
        let ago_ms = whole_millis(ago);
        Self {
            kind,
            cause,
            text: text.to_owned(),
            ago_ms,
            first_ms: ago_ms,
            times: 1,
        }
    }

    /// The line has entered a state, `ago`.
    pub(crate) fn entered(state: LinkState, cause: &'static str, text: &str, ago: Nanos) -> Self {
        Self::once(state.name(), cause, text, ago)
    }

    /// A fault has begun or ended, `ago`.
    pub(crate) fn fault(begins: bool, text: &str, ago: Nanos) -> Self {
        let kind = if begins { "fault" } else { "fault-end" };
        Self::once(kind, "", text, ago)
    }
}

/// In milliseconds; the future is now.
pub(crate) fn whole_millis(span: Nanos) -> i64 {
    span.0.max(0) / 1_000_000
}

/// The last of these events, the oldest first.
pub(crate) fn last(mut events: Vec<Event>) -> Vec<Event> {
    events.sort_by_key(|event| -event.ago_ms);
    let first = events.len().saturating_sub(MOST);
    events.drain(..first);
    events
}

/// The events that the driver noted about its line, as of `now` on the clock of the line.
pub(crate) fn of_line(watch: &Watch, now: Nanos) -> Vec<Event> {
    let events = watch.events().into_iter().map(|event| {
        let entered = event.entered;
        let kind = entered.map_or("settings", |(state, _)| state.name());
        Event {
            kind,
            cause: entered.map_or("", |(_, cause): (_, Cause)| cause.name()),
            text: event.reason,
            ago_ms: whole_millis(now - event.last),
            first_ms: whole_millis(now - event.first),
            times: event.times,
        }
    });
    events.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_ten_events_are_in_the_order_of_their_times() {
        let events = (0..14).map(|ago| Event::fault(true, "leak", Nanos::from_millis(ago)));
        let shown = last(events.collect());
        let times: Vec<i64> = shown.iter().map(|event| event.ago_ms).collect();
        assert_eq!(times, [9, 8, 7, 6, 5, 4, 3, 2, 1, 0]);
    }
}
