//! The stream of events of one browser.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use futures_util::stream::{BoxStream, Stream, StreamExt as _, iter, select_all, unfold};
use hyper::body::{Bytes, Frame};
use tickbus_base::percent_decoded;
use tokio::time::{Interval, interval, sleep};

use crate::feed::Viewer;
use crate::feeds::Feeds;

/// A viewer gets a message of each page at least this often while the page's site answers; a page without messages knows
/// that its contents are outdated.
const BEAT: Duration = Duration::from_secs(1);

/// The most pages that one stream is asked for.
const MOST: usize = 32;

/// A frame of an answer's body.
pub(crate) type Sent = Result<Frame<Bytes>, Infallible>;

/// The paths of the pages in the query of a request, `page=/&page=%2Fboard`. An empty name is no page: the browser shows none
/// at the moment, but is there.
pub(crate) fn asked(query: &str) -> Result<Vec<String>, String> {
    let mut pages = Vec::new();
    for part in query.split('&') {
        let Some(page) = part.strip_prefix("page=") else {
            return Err(format!(
                "{part:?} names no page; write /events?page=/board, or /events alone"
            ));
        };
        let page = String::from_utf8_lossy(&percent_decoded(page)).into_owned();
        // A line of a stream must not end within a path.
        if page.chars().any(char::is_control) {
            return Err("a path has no control characters".to_owned());
        }
        if !page.is_empty() && !pages.contains(&page) {
            pages.push(page);
        }
    }
    if pages.len() > MOST {
        return Err(format!("a stream has at most {MOST} pages"));
    }
    Ok(pages)
}

/// The newest state of one page, whenever it has changed and the viewer has taken the last one. Ends with the page.
pub(crate) fn of_page(viewer: Viewer) -> impl Stream<Item = Sent> + use<> {
    let beat = Bytes::from_static(b"event: beat\ndata:\n\n");
    let events = Events::new(viewer);
    unfold((events, beat), |(mut events, beat)| async move {
        let event = events.next().await?.unwrap_or_else(|| beat.clone());
        Some((Ok(Frame::data(event)), (events, beat)))
    })
}

/// The newest states of several pages, each marked with the path of its page, and the tabs of the room. A page that is not there, or leaves, is waited for.
pub(crate) fn of_pages(feeds: &Arc<Feeds>, pages: Vec<String>) -> impl Stream<Item = Sent> + use<> {
    let pages = pages.into_iter().map(|path| marked(feeds, path));
    let all: Vec<_> = std::iter::once(tabs(feeds)).chain(pages).collect();
    select_all(all).flat_map(|parts| iter(parts.map(|part| Ok(Frame::data(part)))))
}

/// The events of a page, in two parts: its mark, and the event, which all viewers share.
fn marked(feeds: &Arc<Feeds>, path: String) -> BoxStream<'static, [Bytes; 2]> {
    let mark = Bytes::from(format!("event: {path}\n"));
    let beat = Bytes::from(format!("data: {path}\n\n"));
    let feeds = Arc::clone(feeds);
    unfold(None::<Events>, move |mut events| {
        let (feeds, path, mark, beat) =
            (Arc::clone(&feeds), path.clone(), mark.clone(), beat.clone());
        async move {
            loop {
                let Some(present) = &mut events else {
                    events = feeds.subscribe(&path).map(Events::new);
                    if events.is_none() {
                        sleep(BEAT).await;
                    }
                    continue;
                };
                match present.next().await {
                    Some(Some(event)) => return Some(([mark, event], events)),
                    Some(None) => {
                        return Some(([Bytes::from_static(b"event: beat\n"), beat], events));
                    }
                    None => {
                        events = None;
                        sleep(BEAT).await;
                    }
                }
            }
        }
    })
    .boxed()
}

/// The tabs of the room, at first and whenever they have changed; otherwise a beat of the room itself, so that the browser
/// knows that it is connected.
fn tabs(feeds: &Arc<Feeds>) -> BoxStream<'static, [Bytes; 2]> {
    let feeds = Arc::clone(feeds);
    unfold(None::<String>, move |told| {
        let feeds = Arc::clone(&feeds);
        async move {
            if told.is_some() {
                sleep(BEAT).await;
            }
            let tabs = feeds.tabs();
            let event = if told.as_ref() == Some(&tabs) {
                [
                    Bytes::from_static(b"event: beat\n"),
                    Bytes::from_static(b"data: \n\n"),
                ]
            } else {
                let data = format!("data: {tabs}\n\n");
                [Bytes::from_static(b"event: tabs\n"), data.into()]
            };
            Some((event, Some(tabs)))
        }
    })
    .boxed()
}

/// The events of one page for one viewer.
struct Events {
    viewer: Viewer,
    /// The number of answered looks at the last event.
    looks: u64,
    /// When the viewer gets an event even for the same state.
    beat: Interval,
}

impl Events {
    fn new(viewer: Viewer) -> Self {
        let mut beat = interval(BEAT);
        beat.reset();
        Self {
            viewer,
            looks: 0,
            beat,
        }
    }

    /// The next event, or no event if the state is the same, and the site still answers. `None`: the page has ended.
    async fn next(&mut self) -> Option<Option<Bytes>> {
        let event = loop {
            tokio::select! {
                biased;
                event = self.viewer.next() => break Some(event?),
                // This thread lives, but does the site? If it has answered no look since, the viewer has to know.
                _ = self.beat.tick() => {
                    if self.viewer.looks() != self.looks {
                        break None;
                    }
                }
            }
        };
        self.looks = self.viewer.looks();
        self.beat.reset();
        Some(event)
    }
}
