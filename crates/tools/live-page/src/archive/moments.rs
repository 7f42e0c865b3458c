//! The line at a moment of the past, with its events before that.

use serde_json::{Value, json};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::LinkState;

use super::{Archive, FORCE, Mark, millis};
use crate::events::{self, Event};

impl Archive {
    /// The state of the line at a tick and its time, and its last events; `None` if it is not known.
    pub(super) fn line_at(&self, (tick, time): (u64, Nanos)) -> Option<Value> {
        let faults = self.last_marks(events::MOST, |mark| is_fault(mark) && mark.tick <= tick);
        let mut events = events_of(&faults, time);
        let notes = self.notes();
        let known = notes.lines.partition_point(|line| line.at <= time);
        let line = notes.lines.get(known.checked_sub(1)?)?;
        let before = notes.lines.iter().take(known);
        let has_run = before
            .clone()
            .any(|line| matches!(line.state, LinkState::Running | LinkState::Stale));
        let mut last = None;
        // A reason in other words is no event.
        let entered = before.filter(|line| {
            last.replace((line.state, line.cause)) != Some((line.state, line.cause))
        });
        let entered: Vec<_> = entered.collect();
        let skipped = entered.len().saturating_sub(events::MOST);
        events.extend(entered[skipped..].iter().map(|line| {
            let ago = time - line.at;
            Event::entered(line.state, line.cause, &line.reason, ago)
        }));
        Some(json!({
            "state": line.state.name(), "cause": line.cause, "reason": line.reason,
            "since_ms": millis(time - line.at), "has_run": has_run, "events": events::last(events),
        }))
    }

    /// The faults that have begun and ended lately, as of a time after the last tick.
    pub(crate) fn fault_events(&self, since_tick: Nanos) -> Vec<Event> {
        let span = self.history.span();
        span.map_or_else(Vec::new, |span| {
            let now = span.last.1 + since_tick;
            events_of(&self.last_marks(events::MOST, is_fault), now)
        })
    }
}

/// True for a fault. What is forced, a push-button for example, is no event of the line.
fn is_fault(mark: &Mark) -> bool {
    !mark.name.starts_with(FORCE)
}

/// The faults up to a time as events, the oldest first.
fn events_of(faults: &[Mark], time: Nanos) -> Vec<Event> {
    let timed = faults.iter().filter_map(|mark| {
        let at = mark.at.filter(|at| *at <= time)?;
        Some(Event::fault(mark.begins, &mark.text, time - at))
    });
    timed.collect()
}
