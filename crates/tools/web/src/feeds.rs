//! The pages that somebody looks at.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::time::Clock;

use crate::feed::{Feed, Viewer};
use crate::pages::Pages;

/// One feed for each page that has viewers; a page without any is not asked for its state.
pub(crate) struct Feeds {
    pages: Pages,
    clock: Arc<dyn Clock>,
    by_path: Mutex<BTreeMap<String, Arc<Feed>>>,
}

impl Feeds {
    pub(crate) fn new(pages: Pages, clock: Arc<dyn Clock>) -> Arc<Self> {
        Arc::new(Self {
            pages,
            clock,
            by_path: Mutex::default(),
        })
    }

    fn by_path(&self) -> MutexGuard<'_, BTreeMap<String, Arc<Feed>>> {
        // A feed is there as a whole, or not.
        self.by_path.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The tabs of the room, as JSON.
    pub(crate) fn tabs(&self) -> String {
        self.pages.tabs().to_string()
    }

    /// Adds a viewer of the page at this path; `None` if there is no such page. Called on the room's runtime.
    pub(crate) fn subscribe(self: &Arc<Self>, path: &str) -> Option<Viewer> {
        let site = self.pages.page_at(path)?;
        let mut feeds = self.by_path();
        // A page that left, and another one that joined at its path, are not the same.
        if let Some(feed) = feeds
            .get(path)
            .filter(|feed| feed.is_of(&site) && !feed.has_ended())
        {
            return Some(feed.subscribe());
        }
        let feed = Arc::new(Feed::new(site, Arc::clone(&self.clock)));
        let viewer = feed.subscribe();
        feeds.insert(path.to_owned(), Arc::clone(&feed));
        tokio::spawn(Arc::clone(self).run(path.to_owned(), feed));
        Some(viewer)
    }

    /// There was a change: viewers who come from now on see it, whatever page it shows on.
    pub(crate) fn changed(&self) {
        for feed in self.by_path().values() {
            feed.changed();
        }
    }

    /// Looks at a page until it leaves or nobody looks at it any more.
    async fn run(self: Arc<Self>, path: String, feed: Arc<Feed>) {
        loop {
            let site = self.pages.page_at(&path);
            let is_there = site.is_some_and(|site| feed.is_of(&site));
            {
                let mut feeds = self.by_path();
                if !is_there || feed.has_ended() || !feed.has_viewers() {
                    feed.end();
                    if feeds.get(&path).is_some_and(|it| Arc::ptr_eq(it, &feed)) {
                        feeds.remove(&path);
                    }
                    return;
                }
            }
            feed.look().await;
        }
    }
}
