//! The newest state of a page, for all its viewers.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use hyper::body::Bytes;
use tickbus_base::time::{Clock, Nanos};
use tokio::sync::{Notify, watch};
use tokio::time::timeout;

use crate::site::{Answer, Differences, Site, State};

/// The shortest time between two looks.
const PERIOD: Duration = Duration::from_micros(16_667);

/// Slow formatting is followed by a pause of this many times its duration, so that large pages leave time for other
/// work.
const REST: u32 = 5;

/// The longest pause.
const LONGEST_REST: Duration = Duration::from_secs(1);

/// The number of events kept for other viewers with the same last state.
const KEPT: usize = 4;

/// The newest state. Slow viewers miss the states in between, and delay nobody.
pub(crate) struct Feed {
    site: Arc<dyn Site>,
    state: watch::Sender<Newest>,
    /// Changes so far, and viewers who may get no earlier state.
    changes: AtomicU64,
    /// There was a change: cut the pause short.
    hurry: Notify,
    /// Looks that were answered so far.
    looks: AtomicU64,
    formatted: Mutex<Formatted>,
    clock: Arc<dyn Clock>,
}

/// The events formatted for the current state, and the time that took.
#[derive(Default)]
struct Formatted {
    number: u64,
    /// By the viewer's last state.
    events: Vec<(Option<u64>, Bytes)>,
    spent: Nanos,
}

/// A viewer.
pub(crate) struct Viewer {
    feed: Arc<Feed>,
    newest: watch::Receiver<Newest>,
    /// The changes before the viewer came: it gets no state from before them.
    changes: u64,
    /// The last state that the viewer got.
    seen: Seen,
}

#[derive(Default)]
enum Seen {
    #[default]
    Nothing,
    Whole(Bytes),
    /// The state with this number.
    State(u64),
}

/// The last state that was looked at.
enum Newest {
    /// There was no look yet.
    Unknown,
    State(Published),
    /// The site has ended.
    Ended,
}

/// A state for all viewers.
#[derive(Clone)]
struct Published {
    content: Content,
    /// The changes before the look at it.
    changes: u64,
}

#[derive(Clone)]
enum Content {
    /// Formatted as an event.
    Whole(Bytes),
    Differences {
        state: Arc<dyn Differences>,
        number: u64,
    },
}

impl Published {
    fn is_new(&self, present: &Self) -> bool {
        let is_other = match (&self.content, &present.content) {
            (Content::Whole(one), Content::Whole(other)) => one != other,
            (
                Content::Differences { number: one, .. },
                Content::Differences { number: other, .. },
            ) => one != other,
            _ => true,
        };
        is_other || self.changes != present.changes
    }
}

const PREFIX: &str = "data: ";
const SUFFIX: &str = "\n\n";

/// A server-sent event.
fn event(json: &str) -> Bytes {
    [PREFIX, json, SUFFIX].concat().into()
}

/// The JSON of an event.
pub(crate) fn json(event: &Bytes) -> Bytes {
    event.slice(PREFIX.len()..event.len() - SUFFIX.len())
}

impl Feed {
    pub(crate) fn new(site: Arc<dyn Site>, clock: Arc<dyn Clock>) -> Self {
        Self {
            site,
            state: watch::Sender::new(Newest::Unknown),
            changes: AtomicU64::new(0),
            hurry: Notify::new(),
            looks: AtomicU64::new(0),
            formatted: Mutex::default(),
            clock,
        }
    }

    /// Adds a viewer.
    pub(crate) fn subscribe(self: &Arc<Self>) -> Viewer {
        let mut newest = self.state.subscribe();
        newest.mark_changed();
        Viewer {
            feed: Arc::clone(self),
            newest,
            changes: self.changes.load(Ordering::Relaxed),
            seen: Seen::Nothing,
        }
    }

    pub(crate) fn has_viewers(&self) -> bool {
        self.state.receiver_count() > 0
    }

    pub(crate) fn is_of(&self, site: &Arc<dyn Site>) -> bool {
        Arc::ptr_eq(&self.site, site)
    }

    /// True after the site gave no answer.
    pub(crate) fn has_ended(&self) -> bool {
        matches!(*self.state.borrow(), Newest::Ended)
    }

    /// Ends the streams of all viewers.
    pub(crate) fn end(&self) {
        self.state.send_replace(Newest::Ended);
    }

    /// The event for a viewer who has seen this state. Most viewers have seen the same one, and share the event.
    fn differences(&self, state: &dyn Differences, seen: Option<u64>) -> (u64, Bytes) {
        let mut formatted = self.formatted();
        if formatted.number == state.number() {
            let kept = formatted.events.iter().find(|(had, _)| *had == seen);
            if let Some((_, event)) = kept {
                return (formatted.number, event.clone());
            }
        }
        let begin = self.clock.now();
        let (number, json) = state.since(seen);
        let event = event(&json);
        formatted.spent += self.clock.now() - begin;
        if formatted.number != number {
            formatted.events.clear();
            formatted.number = number;
        }
        if formatted.events.len() < KEPT {
            formatted.events.push((seen, event.clone()));
        }
        (number, event)
    }

    fn formatted(&self) -> MutexGuard<'_, Formatted> {
        // An event is stored completely or not at all.
        self.formatted
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// There was a change: viewers who come from now on see it.
    pub(crate) fn changed(&self) {
        self.changes.fetch_add(1, Ordering::Relaxed);
        self.hurry.notify_one();
    }

    /// Looks at the site once, and rests.
    pub(crate) async fn look(&self) {
        let changes = self.changes.load(Ordering::Relaxed);
        let asked = self.clock.now();
        let (answer, state) = Answer::new();
        self.site.look(answer);
        let Ok(state) = state.await else {
            return self.end();
        };
        // The time for the site's answer was not this thread's work, and needs no rest.
        let begin = self.clock.now();
        let content = match state {
            State::Whole(make) => Content::Whole(event(&make())),
            State::Differences(state) => Content::Differences {
                number: state.number(),
                state,
            },
        };
        // Includes the formatting for single viewers since the last look.
        let spent = std::mem::take(&mut self.formatted().spent);
        let taken = self.clock.now() - begin + spent;
        let taken = u64::try_from(taken.0).unwrap_or_default();
        self.looks.fetch_add(1, Ordering::Relaxed);
        let state = Published { content, changes };
        self.state.send_if_modified(|present| {
            let is_new = match present {
                Newest::State(present) => state.is_new(present),
                Newest::Unknown | Newest::Ended => true,
            };
            *present = Newest::State(state);
            is_new
        });
        let rest = Duration::from_nanos(taken).saturating_mul(REST);
        let rest = rest.min(LONGEST_REST).saturating_sub(PERIOD);
        // The time for the site's answer is part of the period.
        let passed = (self.clock.now() - asked).to_duration();
        tokio::time::sleep(PERIOD.saturating_sub(passed)).await;
        if !rest.is_zero() {
            // A change during the look is remembered, and is looked at just as soon.
            let _ = timeout(rest, self.hurry.notified()).await;
        }
    }
}

impl Viewer {
    /// Has the next event be of a look that begins from now on: who asks once must not get what was true before.
    pub(crate) fn starting_now(mut self) -> Self {
        self.changes = self.feed.changes.fetch_add(1, Ordering::Relaxed) + 1;
        self
    }

    /// The number of answered looks. While it does not grow, the page may be outdated.
    pub(crate) fn looks(&self) -> u64 {
        self.feed.looks.load(Ordering::Relaxed)
    }

    /// The next event: the newest state, or its differences from the viewer's last one. `None`: the page has ended.
    pub(crate) async fn next(&mut self) -> Option<Bytes> {
        loop {
            self.newest.changed().await.ok()?;
            let content = match &*self.newest.borrow_and_update() {
                Newest::State(state) if state.changes >= self.changes => state.content.clone(),
                Newest::State(_) | Newest::Unknown => continue,
                Newest::Ended => return None,
            };
            match content {
                Content::Whole(event) => {
                    if !matches!(&self.seen, Seen::Whole(seen) if *seen == event) {
                        self.seen = Seen::Whole(event.clone());
                        return Some(event);
                    }
                }
                Content::Differences { state, .. } => {
                    let seen = match self.seen {
                        Seen::State(number) => Some(number),
                        Seen::Nothing | Seen::Whole(_) => None,
                    };
                    if seen != Some(state.number()) {
                        let (number, event) = self.feed.differences(&*state, seen);
                        self.seen = Seen::State(number);
                        return Some(event);
                    }
                }
            }
        }
    }
}
