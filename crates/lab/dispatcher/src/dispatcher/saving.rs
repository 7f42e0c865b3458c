//! Changes of the patch, which are answered when they are saved.

use crate::patch::Patch;
use crate::refusal::{Code, Refusal};

use super::{Author, Dispatcher, Progress, Promised};

impl Dispatcher {
    /// The patch, if it was changed, and is neither saved nor [being saved](Self::saving).
    pub fn unsaved(&self) -> Option<&Patch> {
        (self.promised.len() > self.saving).then(|| self.board.patch())
    }

    /// Marks the current patch as being saved by another thread. Until [`saved`](Self::saved) the dispatcher keeps
    /// working, and the patch may change again.
    pub fn saving(&mut self) {
        self.saving = self.promised.len();
    }

    /// The patch was saved as it is, or as it was when [`saving`](Self::saving) was called; or saving failed. Answers
    /// the authors of all changes up to then.
    pub fn saved(&mut self, outcome: &Result<(), String>) {
        let outcome = outcome.as_ref().map(drop).map_err(|why| {
            Code::Internal.because(format_args!(
                "the patch could not be saved ({why}); it holds until the dispatcher ends"
            ))
        });
        let count = match std::mem::take(&mut self.saving) {
            0 => self.promised.len(),
            count => count,
        };
        let later = self.promised.split_off(count);
        if outcome.is_ok() && later.is_empty() {
            self.board.set_saved();
        }
        for promised in std::mem::replace(&mut self.promised, later) {
            self.fulfil(promised, outcome.clone());
        }
    }

    pub(super) fn fulfil(
        &mut self,
        Promised { author, sinks }: Promised,
        outcome: Result<(), Refusal>,
    ) {
        self.conclude(author, outcome);
        self.board.begin_line();
        for sink in sinks {
            self.board.refresh(&sink);
        }
    }

    /// Answers the author of a change of the patch.
    pub(super) fn conclude(&mut self, author: Author, outcome: Result<(), Refusal>) {
        match author {
            Author::Client { seat, verb } => {
                match outcome {
                    Ok(()) => self.confirm(seat, verb),
                    Err(refusal) => self.refuse(seat, &refusal),
                }
                self.go_on(seat);
            }
            Author::Operator(reply) => reply.give(outcome),
            Author::Host { host, number } => self.answer(host, number, outcome),
            Author::Nobody => {}
        }
    }

    /// Resumes a client that had to wait for its answer.
    pub(super) fn go_on(&mut self, seat: usize) {
        if let Some(session) = &mut self.sessions[seat]
            && session.progress == Progress::Stuck
        {
            session.progress = Progress::Going;
            if !session.begun.is_empty() {
                self.resumable.push(seat);
            }
            // Touch the seat, so that its bytes are read again even without an answer to write.
            self.board.touch(seat);
        }
    }
}
