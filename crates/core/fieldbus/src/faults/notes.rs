//! Notes about the replies of a machine, for the log and the statistics. Their texts are made beforehand, so that the
//! tick only marks a note; another thread logs each once.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

use tickbus_base::statistics::Statistics;
use tickbus_base::toml_text::shown;

/// The notes about all replies.
#[derive(Debug, Default)]
pub(super) struct Notes(OnceLock<Known>);

#[derive(Debug)]
struct Known {
    /// The number of replies.
    replies: usize,
    notes: Vec<Note>,
}

/// One note.
#[derive(Debug)]
pub struct Note {
    /// The signal that the simulation writes in the place of a reply, if the note is about that.
    overruled: Option<String>,
    text: String,
    state: AtomicU8,
}

/// The states of a note that is not 0.
const MARKED: u8 = 1;
const LOGGED: u8 = 2;

impl Note {
    /// A note with this text, which follows the name of the driver.
    pub fn new(text: String) -> Self {
        Self {
            overruled: None,
            text,
            state: AtomicU8::new(0),
        }
    }

    /// The note that the simulation writes `signal` in the place of a reply.
    pub fn overruled(signal: &str) -> Self {
        let text = format!(
            "the simulation writes \"{}\" itself, so its [[reply]] no longer does",
            shown(signal)
        );
        Self {
            overruled: Some(signal.to_owned()),
            ..Self::new(text)
        }
    }

    /// Changes the state; returns true if it was the one before.
    fn advance(&self, before: u8, after: u8) -> bool {
        let changed =
            (self.state).compare_exchange(before, after, Ordering::Relaxed, Ordering::Relaxed);
        changed.is_ok()
    }
}

impl Notes {
    /// Takes the notes that can be marked; only the first call does.
    pub(super) fn prepare(&self, replies: usize, notes: Vec<Note>) {
        self.0.get_or_init(|| Known { replies, notes });
    }

    /// Marks a note. Returns true if it was not marked before.
    pub(super) fn mark(&self, place: usize) -> bool {
        let note = self.0.get().and_then(|known| known.notes.get(place));
        note.is_some_and(|note| note.advance(0, MARKED))
    }

    /// The messages for the log that nobody has taken yet.
    pub(super) fn news(&self, driver: &str) -> Vec<String> {
        let notes = self.0.get().map(|known| &known.notes[..]);
        let news = notes.unwrap_or_default().iter();
        let news = news.filter(|note| note.advance(MARKED, LOGGED));
        news.map(|note| format!("driver \"{driver}\": {}", note.text))
            .collect()
    }

    /// Adds the number of replies, and the signals that the simulation writes itself.
    pub(super) fn write(&self, statistics: &mut Statistics) {
        let Some(known) = self.0.get() else { return };
        let marked = (known.notes.iter()).filter(|note| note.state.load(Ordering::Relaxed) != 0);
        let overruled: Vec<&str> = marked
            .filter_map(|note| note.overruled.as_deref())
            .collect();
        statistics.count("replies", known.replies as u64);
        statistics.text("replies.overruled", &overruled.join(", "));
    }
}
