//! What a page consists of.

use std::fmt;

use tokio::sync::oneshot::{Receiver, Sender, channel};

/// A page: its files, its state and what can be changed.
///
/// Calls come from the room's thread, in which all viewers wait: they must not block.
pub trait Site: Send + Sync + 'static {
    /// Its files; the page itself has the path `/`.
    fn assets(&self) -> &[Asset];

    /// Somebody looks: has the present state made, and handed to `answer`. Asked at most 30 times a second, and only while
    /// somebody looks.
    fn look(&self, answer: Answer<State>);

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

/// Makes the state as JSON in one line. It is called in the room's thread, so that the thread that was asked need not do
/// the formatting.
pub type State = Box<dyn FnOnce() -> String + Send>;

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
