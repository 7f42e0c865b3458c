//! The newest state, for everyone who looks.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use hyper::body::Bytes;
use tickbus_base::time::Clock;
use tokio::sync::{Notify, watch};

use crate::site::{Answer, Site};

/// The least time between two looks.
const PERIOD: Duration = Duration::from_millis(33);

/// A look that takes long is followed by a pause of this many times its length, so that large pages leave those time who
/// have other work.
const REST: u32 = 20;

/// The newest state. Viewers who are slow miss those between, and keep nobody waiting.
pub(crate) struct Feed {
    state: watch::Sender<Option<Published>>,
    /// Somebody has begun to look.
    wanted: Notify,
    /// Changes so far: what was looked at before the last one is not published.
    changes: AtomicU64,
}

/// A state, as it is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Published {
    event: Bytes,
}

const PREFIX: &str = "data: ";
const SUFFIX: &str = "\n\n";

impl Published {
    fn new(json: &str) -> Self {
        let event = [PREFIX, json, SUFFIX].concat().into();
        Self { event }
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
            state: watch::Sender::new(None),
            wanted: Notify::new(),
            changes: AtomicU64::new(0),
        }
    }

    /// A viewer more.
    pub(crate) fn subscribe(&self) -> watch::Receiver<Option<Published>> {
        let mut viewer = self.state.subscribe();
        viewer.mark_changed();
        self.wanted.notify_one();
        viewer
    }

    /// Something was changed: who looks from now on sees it.
    pub(crate) fn changed(&self) {
        self.changes.fetch_add(1, Ordering::Relaxed);
        self.state.send_replace(None);
    }

    /// Looks while somebody else does, until the site has ended.
    pub(crate) async fn run(&self, site: Arc<dyn Site>, clock: Arc<dyn Clock>) {
        loop {
            while self.state.receiver_count() == 0 {
                // What was true then need not be when the next one comes.
                self.state.send_replace(None);
                self.wanted.notified().await;
            }
            let changes = self.changes.load(Ordering::Relaxed);
            let begin = clock.now();
            let (answer, state) = Answer::new();
            site.look(answer);
            let Ok(state) = state.await else {
                return;
            };
            if changes == self.changes.load(Ordering::Relaxed) {
                let state = Some(Published::new(&state()));
                self.state.send_if_modified(|present| {
                    let is_new = *present != state;
                    *present = state;
                    is_new
                });
            }
            let taken = u64::try_from((clock.now() - begin).0).unwrap_or_default();
            let rest = Duration::from_nanos(taken).saturating_mul(REST);
            tokio::time::sleep(rest.max(PERIOD)).await;
        }
    }
}
