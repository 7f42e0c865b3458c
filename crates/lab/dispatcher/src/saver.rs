//! Saves the patch in a thread, since a disk may take its time.

use std::io;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use tickbus_base::time::Stop;

use crate::patch::Patch;
use crate::patch_file::PatchFile;

/// The outcome of saving, with the reason for a failure.
type Saved = Result<(), String>;

/// The thread that saves, one patch at a time.
pub(crate) struct Saver {
    /// `None` when the thread is to end.
    patches: Option<SyncSender<Patch>>,
    outcomes: Receiver<Saved>,
    is_busy: bool,
    thread: Option<JoinHandle<()>>,
}

impl Saver {
    /// Starts the thread. It saves to this file; each outcome wakes the thread that waits with `stop`.
    ///
    /// # Errors
    ///
    /// The system could not start a thread.
    pub(crate) fn start(file: PatchFile, stop: Stop) -> io::Result<Self> {
        let (patches, to_save) = sync_channel::<Patch>(1);
        let (tell, outcomes) = sync_channel(1);
        let thread = thread::Builder::new().name("patch".to_owned());
        let thread = thread.spawn(move || {
            for patch in to_save {
                let saved = file.save(&patch).map_err(|error| error.to_string());
                if tell.send(saved).is_err() {
                    return;
                }
                stop.wake();
            }
        })?;
        Ok(Self {
            patches: Some(patches),
            outcomes,
            is_busy: false,
            thread: Some(thread),
        })
    }

    /// Begins to save, unless the last save is still running; returns whether it did.
    pub(crate) fn save(&mut self, patch: &Patch) -> bool {
        if self.is_busy {
            return false;
        }
        let patches = self.patches.as_ref();
        self.is_busy = patches.is_some_and(|patches| patches.send(patch.clone()).is_ok());
        self.is_busy
    }

    /// The outcome of the last save, once it is known. With `waits`, waits for it.
    pub(crate) fn outcome(&mut self, waits: bool) -> Option<Saved> {
        if !self.is_busy {
            return None;
        }
        let saved = if waits {
            self.outcomes.recv().ok()
        } else {
            self.outcomes.try_recv().ok()
        };
        self.is_busy = saved.is_none();
        saved
    }
}

impl Drop for Saver {
    fn drop(&mut self) {
        drop(self.patches.take());
        if let Some(thread) = self.thread.take() {
            // A panic has been reported already.
            let _ = thread.join();
        }
    }
}
