//! The texts that the file had, to go back to and to come back from.

use std::sync::Arc;

/// The oldest texts are forgotten beyond this size, in bytes.
const LIMIT: usize = 64 << 20;

/// A text, and what was done to it next.
#[derive(Clone, Debug)]
struct Past {
    text: Arc<str>,
    done: String,
}

/// The changes that can be undone and done again.
#[derive(Debug, Default)]
pub(crate) struct History {
    past: Vec<Past>,
    future: Vec<Past>,
}

impl History {
    /// `done` has changed this text.
    pub(crate) fn add(&mut self, text: Arc<str>, done: String) {
        self.future.clear();
        self.past.push(Past { text, done });
        while self.past.len() > 1 && self.size() > LIMIT {
            self.past.remove(0);
        }
    }

    fn size(&self) -> usize {
        self.past.iter().map(|past| past.text.len()).sum()
    }

    /// The change that would be undone.
    pub(crate) fn undoes(&self) -> Option<&str> {
        self.past.last().map(|past| past.done.as_str())
    }

    /// The change that would be done again.
    pub(crate) fn redoes(&self) -> Option<&str> {
        self.future.last().map(|past| past.done.as_str())
    }

    /// The text before the last change, which `present` is the result of.
    pub(crate) fn undo(&mut self, present: Arc<str>) -> Option<Arc<str>> {
        let Past { text, done } = self.past.pop()?;
        self.future.push(Past {
            text: present,
            done,
        });
        Some(text)
    }

    /// The text after the change that was undone last.
    pub(crate) fn redo(&mut self, present: Arc<str>) -> Option<Arc<str>> {
        let Past { text, done } = self.future.pop()?;
        self.past.push(Past {
            text: present,
            done,
        });
        Some(text)
    }
}
