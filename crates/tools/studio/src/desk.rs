//! The file that is edited: its text, what was done to it, and what others did.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher as _, Hasher as _};
use std::path::Path;
use std::sync::Arc;

use diffy::{DiffOptions, PatchFormatter};
use serde_json::{Value as Json, json};
use tickbus_base::toml_text::{Key, Shape};
use tickbus_driver_cfg::{Kinds, keys};
use tickbus_live_page::{OnDisk, Unwritten};

use crate::check::{Checked, check};
use crate::document::body;
use crate::edit::{Edit, Made, Shapes, adopt, make};
use crate::history::History;
use crate::news::News;
use crate::sheet::Sheet;
use crate::tables::Unmade;
use crate::tags;

/// The text of a file that is not there yet; the first edit writes it.
const NEW: &str = "[driver]\nid   = 1\nname = \"Machine\"\n";

/// A driver.cfg on the desk.
#[derive(Debug)]
pub(crate) struct Desk {
    disk: OnDisk,
    kinds: &'static Kinds,
    /// The text when the studio was opened, with which the page compares.
    first: Arc<str>,
    text: Arc<str>,
    history: History,
    /// The number of changes of all that the page shows.
    version: u64,
    checked: Checked,
    /// Why the file does not have the text.
    unsaved: Option<String>,
    /// The sentence of the page about the last change that nobody here made, or that was more than a cell.
    told: String,
    /// How often the file was missed, one look after the other.
    missed: u8,
    news: News,
}

/// A file that is missed this often is gone: editors replace files in two steps.
const GONE: u8 = 2;

/// The number of the first state, which is another one for each desk: a page that is open while a simulation is started
/// again has the numbers of the desk before, and must not take this file for that one.
fn first_version() -> u64 {
    // Numbers of JavaScript are exact to 53 bits.
    (RandomState::new().build_hasher().finish() >> 16) + 1
}

/// Why a request was refused, with the status of HTTP.
pub(crate) type Refusal = (u16, String);

impl Desk {
    /// Reads the file.
    ///
    /// # Errors
    ///
    /// The file cannot be read.
    pub(crate) fn open(path: &Path, kinds: &'static Kinds) -> Result<Self, String> {
        let disk = OnDisk::open(path)?;
        let first: Arc<str> = disk.text().into();
        let text = if disk.path().exists() {
            Arc::clone(&first)
        } else {
            NEW.into()
        };
        let mut desk = Self {
            disk,
            kinds,
            first,
            text,
            history: History::default(),
            version: first_version(),
            checked: Checked::default(),
            unsaved: None,
            told: String::new(),
            missed: 0,
            news: News::default(),
        };
        desk.check();
        Ok(desk)
    }

    pub(crate) fn path(&self) -> &Path {
        self.disk.path()
    }

    /// The text with all edits.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// The number of the present state.
    pub(crate) fn version(&self) -> u64 {
        self.version
    }

    /// The text, if the file does not have it, and why not.
    pub(crate) fn unsaved(&self) -> Option<(&str, &str)> {
        let why = self.unsaved.as_deref()?;
        Some((&self.text, why))
    }

    /// Why the line cannot start, or else nothing.
    pub(crate) fn mistakes(&self) -> usize {
        self.checked.mistakes.len()
    }

    /// Reads the file again if another program has changed it.
    pub(crate) fn look(&mut self) {
        let was_gone = self.is_gone();
        self.missed = if self.disk.is_missing() {
            self.missed.saturating_add(1).min(GONE)
        } else {
            0
        };
        if self.is_gone() != was_gone {
            self.version += 1;
        }
        if let Some(theirs) = self.disk.look() {
            self.take_theirs(theirs);
        }
    }

    /// True if the file was there, and is not any more.
    fn is_gone(&self) -> bool {
        self.missed >= GONE
    }

    fn take_theirs(&mut self, theirs: String) {
        let what = if self.unsaved.is_some() {
            "another program has changed the file, which is shown now; what was not saved comes back by Undo"
        } else {
            "another program has changed the file, which is shown now"
        };
        what.clone_into(&mut self.told);
        self.unsaved = None;
        let done = "the change by another program".to_owned();
        self.history.add(Arc::clone(&self.text), done);
        self.text = theirs.into();
        self.is_new();
    }

    /// Makes an edit.
    ///
    /// # Errors
    ///
    /// Another program or editor has changed the same place, or the file does not have it.
    pub(crate) fn edit(&mut self, edit: &Edit) -> Result<(), Refusal> {
        self.look();
        if let Edit::Text { was, .. } = edit
            && *was != self.version
        {
            let text = "the file was changed meanwhile; your text is still in the field: compare, and apply it again";
            return Err((409, text.to_owned()));
        }
        let Made { text, done, told } =
            make(&self.text, edit, self).map_err(|unmade| match unmade {
                Unmade::Conflict(text) => (409, text),
                Unmade::Impossible(text) => (400, text),
            })?;
        if told != self.told {
            self.told = told;
            self.version += 1;
        }
        self.change(text.into(), done);
        Ok(())
    }

    /// Puts the keys of a found device's `[fieldbus]` table into that of the file.
    ///
    /// # Errors
    ///
    /// The file is no TOML at the moment.
    pub(crate) fn adopt(&mut self, table: &str) -> Result<(), Refusal> {
        self.look();
        let (text, done) = adopt(&self.text, table).map_err(|unmade| match unmade {
            Unmade::Conflict(text) | Unmade::Impossible(text) => (400, text),
        })?;
        self.told.clear();
        self.change(text.into(), done);
        Ok(())
    }

    /// Adds the signals of a list of tags.
    ///
    /// # Errors
    ///
    /// The list cannot be read, or does not fit the file.
    pub(crate) fn import(&mut self, file: &str, body: &str) -> Result<(), Refusal> {
        self.look();
        let (text, told) = tags::add(&self.text, file, body, self.kinds).map_err(|it| (400, it))?;
        let done = told.lines().next().unwrap_or_default().to_owned();
        self.told = told;
        // What was left out is told, also if nothing was added.
        self.version += 1;
        self.change(text.into(), done);
        Ok(())
    }

    fn change(&mut self, text: Arc<str>, done: String) {
        if text == self.text {
            return;
        }
        self.history.add(Arc::clone(&self.text), done);
        self.text = text;
        self.version += 1;
        // Which checks it: twice would double the wait for a large file.
        self.save();
    }

    /// Goes back to the text before the last change.
    ///
    /// # Errors
    ///
    /// There was none.
    pub(crate) fn undo(&mut self) -> Result<(), Refusal> {
        self.look();
        let text = self.history.undo(Arc::clone(&self.text));
        self.go(text.ok_or((409, "there is nothing to undo".to_owned()))?);
        Ok(())
    }

    /// Makes the change again that was undone last.
    ///
    /// # Errors
    ///
    /// None was undone.
    pub(crate) fn redo(&mut self) -> Result<(), Refusal> {
        self.look();
        let text = self.history.redo(Arc::clone(&self.text));
        self.go(text.ok_or((409, "there is nothing to do again".to_owned()))?);
        Ok(())
    }

    fn go(&mut self, text: Arc<str>) {
        self.told.clear();
        self.text = text;
        self.version += 1;
        // Which checks it: twice would double the wait for a large file.
        self.save();
    }

    /// Writes the text into the file.
    pub(crate) fn save(&mut self) {
        match self.disk.write(&self.text) {
            Ok(()) => {
                self.missed = 0;
                if self.unsaved.take().is_some() {
                    self.version += 1;
                }
            }
            Err(Unwritten::Changed(theirs)) => {
                self.unsaved = Some(String::new());
                self.take_theirs(theirs);
            }
            Err(Unwritten::Refused(why)) => {
                // Pages ask again and again, which tries again: the same reason is no news.
                if self.unsaved.as_ref() != Some(&why) {
                    self.unsaved = Some(why);
                    self.version += 1;
                }
            }
        }
        self.check();
    }

    /// Tries for the last time to write what the file does not have. Returns the text that it still does not have, and
    /// why: another program's change takes its place on the page, where Undo has it, but there is no page any more.
    pub(crate) fn settle(&mut self) -> Option<(Arc<str>, String)> {
        self.unsaved.as_ref()?;
        let text = Arc::clone(&self.text);
        self.save();
        if *self.disk.text() == *text {
            return None;
        }
        let why = self.unsaved.clone();
        let why = why.unwrap_or_else(|| "another program has changed it meanwhile".to_owned());
        Some((text, why))
    }

    fn is_new(&mut self) {
        self.version += 1;
        self.check();
    }

    fn check(&mut self) {
        let is_on_disk = *self.text == *self.disk.text();
        let before = self.checked.has_places;
        self.checked = check(self.disk.path(), &self.text, is_on_disk, self.kinds);
        self.checked.has_places = self.checked.has_places.or(before);
        self.checked.notes.extend(hidden(&self.text));
    }

    /// All that the page shows of the file; of its large parts what has changed since the state with the number `seen`.
    pub(crate) fn news(&mut self, seen: Option<u64>) -> Json {
        let mut state = self.json();
        self.news.since(seen, self.version, &mut state);
        state
    }

    /// All that the page shows of the file.
    pub(crate) fn json(&self) -> Json {
        let path = self.disk.path();
        let sheet = Sheet::of(&self.text);
        let (sheet, broken) = match sheet {
            Ok(sheet) => (Some(sheet), None),
            Err(why) => (None, Some(why)),
        };
        let name = path.file_name().unwrap_or_default();
        let kind = sheet.as_ref().map_or("", Sheet::kind);
        let browses = (self.kinds.keys().iter()).any(|it| it.browses && it.name == kind);
        json!({
            "version": self.version,
            "path": path.display().to_string(),
            "name": name.to_string_lossy(),
            "unsaved": self.unsaved,
            "isGone": self.is_gone(),
            "told": self.told,
            "undo": self.history.undoes(),
            "redo": self.history.redoes(),
            "sheet": sheet,
            "broken": broken,
            "checked": self.checked,
            "browses": browses,
            "diff": diff(&self.first, &self.text),
            "text": &*self.text,
        })
    }
}

impl Shapes for Desk {
    fn keys(&self, table: &str, kind: &str) -> Vec<&'static Key> {
        let kinds = self.kinds.keys();
        let kind = kinds.into_iter().find(|it| it.name == kind);
        match table {
            "fieldbus" => {
                let own = kind.map(|kind| kind.keys).unwrap_or_default();
                keys::FIELDBUS
                    .iter()
                    .chain(own)
                    .copied()
                    .flatten()
                    .collect()
            }
            "station" => {
                let own = kind.map(|kind| kind.station_keys).unwrap_or_default();
                keys::STATION.iter().copied().flatten().chain(own).collect()
            }
            _ => {
                let key = keys::FILE.iter().find(|key| key.name == table);
                let shape = match key.map(|key| key.shape) {
                    Some(Shape::List(each, ..)) => Some(*each),
                    shape => shape,
                };
                match shape {
                    Some(Shape::Table(keys)) => keys.iter().collect(),
                    _ => Vec::new(),
                }
            }
        }
    }
}

/// Says which signals of a text the table does not show.
fn hidden(text: &str) -> Option<String> {
    let body = body(text);
    // Most files need not be read for this.
    let mut lines = body.lines().map(str::trim_start);
    lines.find(|line| line.starts_with("signal"))?;
    let document = toml_edit::Document::parse(body).ok()?;
    let signals = document.get("signal")?;
    (!signals.is_array_of_tables()).then(|| {
        "the table shows no signals, because the file has them in brackets, as signal = [ … ]; write each below a line \
         [[signal]], or edit them in the text"
            .to_owned()
    })
}

/// The lines that differ, each with `+` or `-`, and those around them; empty if there are none.
fn diff(before: &str, now: &str) -> String {
    if before == now {
        return String::new();
    }
    let patch = DiffOptions::new()
        .set_context_len(2)
        .create_patch(before, now);
    let format = PatchFormatter::new()
        .missing_newline_message(false)
        .suppress_blank_empty(false);
    let text = format.fmt_patch(&patch).to_string();
    // Without the lines for the names of the files.
    text.split_inclusive('\n').skip(2).collect()
}
