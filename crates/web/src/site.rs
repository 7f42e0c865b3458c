//! What a page consists of.

use std::fmt;
use std::sync::Arc;

use tokio::sync::oneshot::{Receiver, Sender, channel};

/// A page: its files, its state and what can be changed.
///
/// Calls come from the room's thread, in which all viewers wait: they must not block.
pub trait Site: Send + Sync + 'static {
    /// Its files; the page itself has the path `/`.
    fn assets(&self) -> &[Asset];

    /// Somebody looks: has the present state made, and handed to `answer`. Asked at most 60 times a second, and only while
    /// somebody looks.
    fn look(&self, answer: Answer<State>);

    /// Has a document of the site's own made, of what is there at this moment; `None` if there is none at this path. Asked
    /// for every path that is not in [`assets`](Self::assets).
    fn get(&self, path: &str, answer: Answer<Option<Document>>) {
        let _ = path;
        answer.give(None);
    }

    /// Somebody who has the token was heard of: by a request, or as a viewer who came or went. There are `viewers` of
    /// them now.
    fn heard(&self, viewers: usize) {
        let _ = viewers;
    }

    /// Carries out a change asked for by somebody who has the token.
    fn change(&self, change: Change, answer: Answer<Outcome>);
}

/// A file of a page.
#[derive(Clone, Copy, Debug)]
pub struct Asset {
    /// Its path, from `/`.
    pub path: &'static str,
    /// Its media type.
    pub kind: &'static str,
    /// What is in it.
    pub text: &'static str,
}

/// A document that was made for one request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Document {
    /// Its media type.
    pub kind: &'static str,
    /// What is in it.
    pub text: String,
}

/// The present state. What makes JSON of it is called in the room's thread, so that the thread that was asked need not do
/// the formatting.
pub enum State {
    /// The whole of it, in one line, for everybody.
    Whole(Box<dyn FnOnce() -> String + Send>),
    /// What each viewer lacks.
    Differences(Arc<dyn Differences>),
}

impl State {
    /// A state that is sent as a whole.
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

/// A state of which viewers get what has changed since they looked last.
pub trait Differences: Send + Sync {
    /// The number of the present state. Another state has a larger one.
    fn number(&self) -> u64;

    /// The number of the present state, and in one line of JSON how it differs from the one with the number `seen`; with
    /// `None` all of it.
    fn since(&self, seen: Option<u64>) -> (u64, String);
}

/// What became of a change.
pub type Outcome = Result<(), Refused>;

/// Why a change was refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused {
    /// The status of HTTP, from 400 to 599.
    pub status: u16,
    /// What happened, and what would be right.
    pub text: String,
}

/// A change that is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// What is to be done.
    pub verb: Verb,
    /// With what, from `/`.
    pub path: String,
    /// The new value, without blanks at its ends.
    pub body: String,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// `PUT`: it shall be so.
    Put,
    /// `DELETE`: it shall not be.
    Delete,
}

/// Takes an answer, from any thread. If it is dropped without one, the asker hears that nobody is there any more.
pub struct Answer<T>(Sender<T>);

impl<T> Answer<T> {
    pub(crate) fn new() -> (Self, Receiver<T>) {
        let (sender, receiver) = channel();
        (Self(sender), receiver)
    }

    /// Answers.
    pub fn give(self, answer: T) {
        // If the asker has gone, nobody minds.
        let _ = self.0.send(answer);
    }
}

impl<T> fmt::Debug for Answer<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Answer").finish_non_exhaustive()
    }
}
