//! The last events of a line, for people who look at an outage.

use std::collections::VecDeque;

use tickbus_base::time::Nanos;

use super::{Cause, LinkState, LinkStatus};

/// The most events that are kept.
const MOST: usize = 10;

/// An event of a line: it entered a state, or took other settings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineEvent {
    /// The state that the line entered, with the cause; `None` for other settings.
    pub entered: Option<(LinkState, Cause)>,
    /// The reason in words.
    pub reason: String,
    /// When it happened first.
    pub first: Nanos,
    /// When it happened last.
    pub last: Nanos,
    /// How often it happened: attempts that fail for the same cause one after the other are one event.
    pub times: u32,
}

/// The events, and the next attempt after a failure.
#[derive(Debug, Default)]
pub(super) struct Journal {
    events: VecDeque<LineEvent>,
    next_attempt: Option<Nanos>,
    /// How often the line had come up before it took its present settings.
    runs_before: u64,
}

impl Journal {
    /// Notes that the line has entered a state, or has other settings.
    pub(super) fn note(&mut self, at: Nanos, entered: Option<(LinkState, Cause)>, reason: &str) {
        self.next_attempt = None;
        let event = LineEvent {
            entered,
            reason: reason.to_owned(),
            first: at,
            last: at,
            times: 1,
        };
        if self.is_failed_again(&event) {
            self.events.pop_back();
            if let Some(before) = self.events.back_mut() {
                (before.last, before.times) = (at, before.times.saturating_add(1));
                before.reason = event.reason;
                return;
            }
        }
        if self.events.len() == MOST {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    /// True if the last events are the same failure and a new attempt.
    fn is_failed_again(&self, event: &LineEvent) -> bool {
        let mut last = self.events.iter().rev().map(|event| event.entered);
        matches!(event.entered, Some((LinkState::Failed, _)))
            && matches!(last.next(), Some(Some((LinkState::Opening, _))))
            && last.next() == Some(event.entered)
    }
}

impl LinkStatus {
    /// Enters the state [`Failed`](LinkState::Failed) at `now`; the bus is tried again at `next`.
    pub fn failed(&self, now: Nanos, cause: Cause, reason: &str, next: Nanos) {
        self.enter(now, LinkState::Failed, cause, reason);
        let mut record = self.lock();
        if record.link.state == LinkState::Failed {
            record.journal.next_attempt = Some(next);
        }
    }

    /// Returns when the bus is tried again after a failure; `None` if it does not wait for that.
    pub fn next_attempt(&self) -> Option<Nanos> {
        self.lock().journal.next_attempt
    }

    /// Notes that the line has other settings since `now`.
    pub fn note_other_settings(&self, now: Nanos) {
        let mut record = self.lock();
        record.journal.note(now, None, "other settings");
        record.journal.runs_before = record.entered[LinkState::Running as usize];
    }

    /// Returns true if the line has come up with its present settings.
    pub fn has_run(&self) -> bool {
        let record = self.lock();
        record.entered[LinkState::Running as usize] > record.journal.runs_before
    }

    /// Returns the last events of the line, the oldest first.
    pub fn events(&self) -> Vec<LineEvent> {
        self.lock().journal.events.iter().cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: i64) -> Nanos {
        Nanos::from_millis(millis)
    }

    #[test]
    fn attempts_that_fail_alike_are_one_event_and_the_next_one_is_known() {
        let status = LinkStatus::new("test", at(100));
        status.enter(at(0), LinkState::Running, Cause::Running, "here");
        for attempt in 1..=30 {
            let now = at(attempt * 10);
            status.enter(now, LinkState::Opening, Cause::Waiting, "again");
            assert_eq!(status.next_attempt(), None);
            status.failed(now, Cause::Link, "refused", now + at(5));
            assert_eq!(status.next_attempt(), Some(now + at(5)));
        }
        assert!(status.has_run());
        status.note_other_settings(at(400));
        assert!(!status.has_run(), "another PLC is meant");
        let events = status.events();
        let states: Vec<_> = events.iter().map(|event| event.entered).collect();
        let failed = Some((LinkState::Failed, Cause::Link));
        let opening = Some((LinkState::Opening, Cause::Waiting));
        let running = Some((LinkState::Running, Cause::Running));
        assert_eq!(states, [running, opening, failed, None]);
        let event = &events[2];
        assert_eq!(
            (event.times, event.first, event.last),
            (30, at(10), at(300))
        );
    }

    #[test]
    fn only_the_last_ten_events_are_kept() {
        let status = LinkStatus::new("test", at(100));
        for time in 0..25 {
            status.note_other_settings(at(time));
        }
        let times: Vec<Nanos> = status.events().iter().map(|event| event.first).collect();
        assert_eq!(times, (15..25).map(at).collect::<Vec<_>>());
    }
}
