//! The parts of a page.

use std::fmt;
use std::sync::Arc;

use tokio::sync::oneshot::{Receiver, Sender, channel};

/// A page: its files, its state and its changes.
///
/// The room's thread makes all calls, and all viewers wait for it: they must not block.
pub trait Site: Send + Sync + 'static {
    /// The files; the page itself has the path `/`. All paths are those within the page: see [`Pages`](crate::Pages).
    fn assets(&self) -> &[Asset];

    /// Makes the current state and passes it to `answer`. Called at most 60 times a second, and only while there are
    /// viewers.
    fn look(&self, answer: Answer<State>);

    /// Makes a document of the site from the current state; `None` if this path has none. Called for every path that
    /// is not in [`assets`](Self::assets).
    fn get(&self, path: &str, answer: Answer<Option<Document>>) {
        let _ = path;
        answer.give(None);
    }

    /// True if only a viewer with the token may read this path. The files and the state are for all.
    fn is_private(&self, path: &str) -> bool {
        let _ = path;
        false
    }

    /// The largest body of a change of this path, in bytes.
    fn longest_body(&self, path: &str) -> usize {
        let _ = path;
        4096
    }

    /// The tabs of this page, if it has several or other ones than that of the name with which it joined its room; asked
    /// for once a second.
    fn tabs(&self) -> Vec<Tab> {
        Vec::new()
    }

    /// A viewer with the token was active: by a request, or by coming or going. There are now `viewers` of them.
    fn heard(&self, viewers: usize) {
        let _ = viewers;
    }

    /// Carries out a change requested by a viewer with the token.
    fn change(&self, change: Change, answer: Answer<Outcome>);
}

/// A file of a page.
#[derive(Clone, Copy, Debug)]
pub struct Asset {
    /// The path, from `/`.
    pub path: &'static str,
    /// The media type.
    pub kind: &'static str,
    /// The content.
    pub text: &'static str,
}

impl Asset {
    /// The page itself, at `/`.
    pub const fn page(text: &'static str) -> Self {
        Self {
            path: "/",
            kind: "text/html; charset=utf-8",
            text,
        }
    }

    /// A script.
    pub const fn script(path: &'static str, text: &'static str) -> Self {
        Self {
            path,
            kind: "text/javascript; charset=utf-8",
            text,
        }
    }

    /// A style sheet.
    pub const fn style(path: &'static str, text: &'static str) -> Self {
        Self {
            path,
            kind: "text/css; charset=utf-8",
            text,
        }
    }
}

/// A tab of a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tab {
    /// The name, such as "Signals".
    pub name: String,
    /// The part of the address behind the path of the page, such as `#signals`; empty for the page itself.
    pub fragment: String,
    /// True if it needs a wide window: a phone does not have it.
    pub is_wide: bool,
}

/// A document made for one request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Document {
    /// The media type.
    pub kind: &'static str,
    /// The content.
    pub text: String,
}

/// The current state. The room's thread turns it into JSON, so that the site's thread need not do the formatting.
pub enum State {
    /// The whole state, in one line, for all viewers.
    Whole(Box<dyn FnOnce() -> String + Send>),
    /// The differences for each viewer.
    Differences(Arc<dyn Differences>),
}

impl State {
    /// A state that is always sent as a whole.
    pub fn whole(make: impl FnOnce() -> String + Send + 'static) -> Self {
        Self::Whole(Box::new(make))
    }
}

impl fmt::Debug for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Whole(_) => "Whole",
            Self::Differences(_) => "Differences",
        })
    }
}

/// A state of which viewers get the changes since their last look.
pub trait Differences: Send + Sync {
    /// The number of the current state. A newer state has a larger one.
    fn number(&self) -> u64;

    /// The number of the current state, and in one line of JSON its differences from the state with the number `seen`;
    /// with `None` the whole state.
    fn since(&self, seen: Option<u64>) -> (u64, String);
}

/// The outcome of a change.
pub type Outcome = Result<(), Refused>;

/// Why a change was refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused {
    /// The status of HTTP, from 400 to 599.
    pub status: u16,
    /// The cause and the remedy.
    pub text: String,
}

/// A requested change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The kind of change.
    pub verb: Verb,
    /// The subject, from `/`.
    pub path: String,
    /// The new value, trimmed.
    pub body: String,
}

/// The kind of change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// `PUT`: make it so.
    Put,
    /// `DELETE`: end it.
    Delete,
}

/// Takes an answer, from any thread. If it is dropped without one, the requester learns that the site is gone.
pub struct Answer<T>(Sender<T>);

impl<T> Answer<T> {
    pub(crate) fn new() -> (Self, Receiver<T>) {
        let (sender, receiver) = channel();
        (Self(sender), receiver)
    }

    /// True while somebody waits for the answer.
    pub fn is_wanted(&self) -> bool {
        !self.0.is_closed()
    }

    /// Answers.
    pub fn give(self, answer: T) {
        // A requester that has gone does not mind.
        let _ = self.0.send(answer);
    }
}

impl<T> fmt::Debug for Answer<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Answer").finish_non_exhaustive()
    }
}
