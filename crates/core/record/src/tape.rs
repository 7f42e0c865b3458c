//! A recording that is played as time passes: the reader of replays, of tests and of `tickbus play`.

use tickbus_base::time::Nanos;

use crate::{Recording, RecordingError, Tick};

/// A recording that is played as time passes. The first tick is due at once, and every other one at the same distance
/// from it as when it was recorded.
#[derive(Debug)]
pub struct Tape {
    recording: Recording,
    /// The next recorded tick, if there is one.
    next: Tick,
    more: bool,
    /// Why there is no next tick, if the recording is damaged.
    broken: Option<RecordingError>,
    /// The tick that was taken last; before that, the first one.
    present: Tick,
    /// The time at which the first tick was taken, minus the recording's time.
    offset: Option<Nanos>,
}

impl Tape {
    /// Reads the first tick of a recording of which none was read.
    ///
    /// # Errors
    ///
    /// The recording does not begin with a tick. It may have none.
    pub fn start(mut recording: Recording) -> Result<Self, RecordingError> {
        let mut next = Tick::new(recording.columns());
        let more = recording.next(&mut next)?;
        Ok(Self {
            recording,
            present: next.clone(),
            next,
            more,
            broken: None,
            offset: None,
        })
    }

    /// The time when the next recorded tick is due, if there is one.
    pub fn due(&self, now: Nanos) -> Option<Nanos> {
        let offset = self.offset.unwrap_or(now - self.next.time);
        self.more.then(|| self.next.time + offset)
    }

    /// Takes the next recorded tick if it is due at `now`, and reads the one after it; returns true if it did.
    pub fn take(&mut self, now: Nanos) -> bool {
        let Some(due) = self.due(now).filter(|due| *due <= now) else {
            return false;
        };
        self.offset.get_or_insert(due - self.next.time);
        self.present.clone_from(&self.next);
        self.more = self.recording.next(&mut self.next).unwrap_or_else(|error| {
            // The ticks before the damaged one are valid.
            self.broken = Some(error);
            false
        });
        true
    }

    /// The tick that was taken last; before that, the first one.
    pub fn present(&self) -> &Tick {
        &self.present
    }

    /// True if a tick was taken.
    pub fn has_begun(&self) -> bool {
        self.offset.is_some()
    }

    /// True if there is a tick that was not taken yet.
    pub fn has_more(&self) -> bool {
        self.more
    }

    /// Why the recording cannot be read beyond the present tick, if it is damaged.
    pub fn broken(&self) -> Option<&RecordingError> {
        self.broken.as_ref()
    }

    /// The recording.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }
}
