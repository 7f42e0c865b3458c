//! The newest state, for everyone who looks.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use hyper::body::Bytes;
use tickbus_base::time::Clock;
use tokio::sync::{Notify, watch};
use tokio::time::timeout;

use crate::site::{Answer, Site};

/// The shortest time between two looks.
const PERIOD: Duration = Duration::from_millis(33);

/// Formatting that takes long is followed by a pause of this many times its length, so that large pages leave time for
/// other work.
const REST: u32 = 20;

/// The longest pause.
const LONGEST_REST: Duration = Duration::from_secs(1);

/// The newest state. Viewers who are slow miss those between, and keep nobody waiting.
pub(crate) struct Feed {
    state: watch::Sender<Newest>,
    /// Somebody has begun to look.
    wanted: Notify,
    /// Changes so far.
    changes: AtomicU64,
    /// There was a change: the pause is cut short.
    hurry: Notify,
    /// Looks that were answered so far.
    looks: AtomicU64,
}

/// Somebody who looks.
pub(crate) struct Viewer {
    newest: watch::Receiver<Newest>,
    /// The changes before it came: it gets no state that was looked at before them.
    changes: u64,
}

impl Viewer {
    /// The next state. It may be equal to the one before. `None`: there is nothing to be seen any more.
    pub(crate) async fn next(&mut self) -> Option<Published> {
        loop {
            self.newest.changed().await.ok()?;
            match &*self.newest.borrow_and_update() {
                Newest::State(state) if state.changes >= self.changes => {
                    return Some(state.clone());
                }
                Newest::State(_) | Newest::Unknown => {}
                Newest::Ended => return None,
            }
        }
    }
}

/// What was seen last.
#[derive(Debug)]
enum Newest {
    /// Nobody looks.
    Unknown,
    State(Published),
    /// There is nothing to be seen any more.
    Ended,
}

/// A state, as it is sent.
#[derive(Clone, Debug)]
pub(crate) struct Published {
    event: Bytes,
    /// The changes before it was looked at.
    changes: u64,
}

const PREFIX: &str = "data: ";
const SUFFIX: &str = "\n\n";

impl Published {
    fn new(json: &str, changes: u64) -> Self {
        let event = [PREFIX, json, SUFFIX].concat().into();
        Self { event, changes }
    }

    /// As a server-sent event.
    pub(crate) fn event(&self) -> Bytes {
        self.event.clone()
    }

    /// As JSON.
    pub(crate) fn json(&self) -> Bytes {
        let end = self.event.len() - SUFFIX.len();
        self.event.slice(PREFIX.len()..end)
    }
}

impl Feed {
    pub(crate) fn new() -> Self {
        Self {
            state: watch::Sender::new(Newest::Unknown),
            wanted: Notify::new(),
            changes: AtomicU64::new(0),
            hurry: Notify::new(),
            looks: AtomicU64::new(0),
        }
    }

    /// A viewer more.
    pub(crate) fn subscribe(&self) -> Viewer {
        let mut newest = self.state.subscribe();
        newest.mark_changed();
        self.wanted.notify_one();
        let changes = self.changes.load(Ordering::Relaxed);
        Viewer { newest, changes }
    }

    /// Something was changed: viewers who come from now on see it.
    pub(crate) fn changed(&self) {
        self.changes.fetch_add(1, Ordering::Relaxed);
        self.hurry.notify_one();
    }

    /// The number of looks that were answered. While it stands still, what is shown may be old.
    pub(crate) fn looks(&self) -> u64 {
        self.looks.load(Ordering::Relaxed)
    }

    /// Looks while somebody else does, until the site has ended.
    pub(crate) async fn run(&self, site: Arc<dyn Site>, clock: Arc<dyn Clock>) {
        loop {
            while self.state.receiver_count() == 0 {
                // What was true then need not be when the next one comes.
                self.state.send_replace(Newest::Unknown);
                self.wanted.notified().await;
            }
            let changes = self.changes.load(Ordering::Relaxed);
            let (answer, state) = Answer::new();
            site.look(answer);
            let Ok(state) = state.await else {
                self.state.send_replace(Newest::Ended);
                return;
            };
            // How long the site took to answer was not this thread's work, and asks for no rest.
            let begin = clock.now();
            let state = Published::new(&state(), changes);
            let taken = u64::try_from((clock.now() - begin).0).unwrap_or_default();
            self.looks.fetch_add(1, Ordering::Relaxed);
            self.state.send_if_modified(|present| {
                let is_new = match present {
                    Newest::State(present) => {
                        present.event != state.event || present.changes != state.changes
                    }
                    Newest::Unknown | Newest::Ended => true,
                };
                *present = Newest::State(state);
                is_new
            });
            let rest = Duration::from_nanos(taken).saturating_mul(REST);
            let rest = rest.min(LONGEST_REST).saturating_sub(PERIOD);
            tokio::time::sleep(PERIOD).await;
            // A change during the look is remembered, and is looked at as soon.
            let _ = timeout(rest, self.hurry.notified()).await;
        }
    }
}
