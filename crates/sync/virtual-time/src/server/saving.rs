//! Runs that are saved after a step.

use std::path::Path;

use super::{Phase, Server};
use crate::barrier::State;
use crate::{Settings, saved_run};

/// The requests to save the run, and the result for the host.
#[derive(Debug)]
pub(super) struct Saving {
    is_asked: bool,
    /// The step after which the run is to be saved, until that is done.
    at: Option<u64>,
    saved: Option<Saved>,
}

/// The step after which a run was saved, and the content of its file; or why it was not saved.
pub(crate) type Saved = Result<(u64, Vec<u8>), String>;

impl Saving {
    pub(super) fn new(settings: &Settings) -> Self {
        Self {
            is_asked: false,
            at: settings.save.as_ref().and_then(|save| save.at),
            saved: None,
        }
    }
}

impl Server<'_> {
    /// The run that was just saved, for the file of [`Settings::save`].
    pub(crate) fn take_saved(&mut self) -> Option<Saved> {
        self.saving.saved.take()
    }

    /// The file for it.
    pub(crate) fn saved_to(&self) -> Option<&Path> {
        self.settings.save.as_ref().map(|save| &*save.file)
    }

    /// Someone wants the run to be saved after the current step.
    pub(super) fn ask_to_save(&mut self) {
        match (&self.settings.save, &self.phase) {
            (Some(_), Phase::Running(..)) => self.saving.is_asked = true,
            (Some(_), _) => {
                let why = "the run has not started, or has ended";
                self.saving.saved = Some(Err(why.to_owned()));
            }
            (None, _) => {
                let why =
                    "the server does not keep what a saved run needs; start it with --save-to FILE";
                self.saving.saved = Some(Err(why.to_owned()));
            }
        }
    }

    /// Saves the run, if it is between two steps and someone wants that.
    pub(super) fn save_if_due(&mut self) {
        let Phase::Running(barrier, _) = &self.phase else {
            return;
        };
        let saving = &mut self.saving;
        let step = barrier.step().sequence;
        let is_due = saving.is_asked || saving.at == Some(step);
        if !is_due || barrier.state() != State::PreRead {
            return;
        }
        saving.is_asked = false;
        saving.at = saving.at.filter(|at| *at != step);
        saving.saved = Some(match &self.rejoining.memory {
            Some(memory) => {
                let clients = 0..barrier.members().clients.len();
                let client = |at| (barrier.declaration(at), barrier.next_update(at));
                let run = (self.settings.step, step, barrier.outcome().hash);
                Ok((step, saved_run::to_bytes(run, clients.map(client), memory)))
            }
            None => Err(format!(
                "after step {step} the run is longer than the server can keep"
            )),
        });
    }

    /// The run has ended: what was not saved is never saved.
    pub(super) fn end_of_saving(&mut self) {
        if let Some(at) = self.saving.at.take() {
            let why = format!("the run ended before the end of step {at}");
            self.saving.saved = Some(Err(why));
        }
    }
}
