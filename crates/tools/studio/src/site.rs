//! The studio as a site, which joins the live page's room at `/studio`.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::json;
use tickbus_base::time::{Monotonic, Stop};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_live_page::LivePage;
use tickbus_web::{
    Answer, Asset, Change, Document, Outcome, Page, Pages, Refused, Site, State, Verb,
};

use crate::assets::ASSETS;
use crate::browse::{Tags, settings};
use crate::desk::{Desk, Refusal};
use crate::edit::Edit;
use crate::explore::{Explored, Question, look_along, search};
use crate::file::keep;
use crate::line::{Line, Machine};
use crate::running::{Asked, Running};

/// The largest body of an edit: the whole text of a file, or a list of tags in base64.
const BODY: usize = 96 << 20;

/// Why the studio neither starts nor stops a line, nor examines it.
const OWNED: &str =
    "the simulation owns this line; let it take the changes, or stop the simulation";

/// The settings of a studio.
pub struct Settings {
    /// The driver.cfg; it need not exist yet.
    pub path: PathBuf,
    /// The kinds of bus that it can name.
    pub kinds: &'static Kinds,
    /// The machine that runs where there is no simulator.
    pub machine: Machine,
}

impl fmt::Debug for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Settings").finish_non_exhaustive()
    }
}

/// A file that is edited, and its line.
#[derive(Debug)]
pub struct Studio(Arc<Shared>);

/// Whose the line is.
enum Owner {
    /// The studio's, which starts and stops it.
    Studio {
        machine: Machine,
        page: Box<LivePage>,
    },
    /// That of a simulation, which runs already.
    Simulation(Running),
}

struct Shared {
    kinds: &'static Kinds,
    owner: Owner,
    tags: Arc<Tags>,
    state: Mutex<Room>,
}

impl fmt::Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shared").finish_non_exhaustive()
    }
}

struct Room {
    desk: Desk,
    line: Option<Line>,
    /// The number of starts and stops.
    turns: u64,
    /// Why the line does not run although somebody asked for it.
    refused: String,
    /// The version of the file that `refused` is about.
    refused_at: u64,
    /// The version of the file with which the line was started.
    started: u64,
    /// The settings of a simulation's line when it was looked at last.
    present: Option<Arc<Config>>,
    /// The versions at which a simulation's line was compared with the file, and the result.
    asked: Option<((u64, u64), Asked)>,
    explored: Explored,
}

/// Edits that could not be written into their file.
#[derive(Debug)]
pub struct Unsaved {
    /// Why not.
    pub why: String,
    /// The text of the file with the edits.
    pub text: String,
    /// The file in the system's temporary folder that has the text now.
    pub kept: io::Result<PathBuf>,
}

impl Studio {
    /// Reads the file, and waits for viewers.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or the system has no thread.
    pub fn open(settings: Settings) -> Result<Self, String> {
        let page = LivePage::open(Monotonic::shared()).map_err(|error| error.to_string())?;
        let owner = Owner::Studio {
            machine: settings.machine,
            page: Box::new(page),
        };
        Self::of(&settings.path, settings.kinds, owner)
    }

    /// Reads the file of a driver that runs, which the live page shows.
    ///
    /// # Errors
    ///
    /// The file cannot be read.
    pub(crate) fn of_running(running: Running) -> Result<Self, String> {
        let (path, kinds) = (running.path(), running.kinds);
        Self::of(&path, kinds, Owner::Simulation(running))
    }

    fn of(path: &Path, kinds: &'static Kinds, owner: Owner) -> Result<Self, String> {
        let room = Room {
            desk: Desk::open(path, kinds)?,
            line: None,
            turns: 0,
            refused: String::new(),
            refused_at: 0,
            started: 0,
            present: None,
            asked: None,
            explored: Explored::default(),
        };
        Ok(Self(Arc::new(Shared {
            kinds,
            owner,
            tags: Arc::default(),
            state: Mutex::new(room),
        })))
    }

    /// The pages that the room serves: the studio, and the live page of its line.
    pub fn pages(&self) -> Pages {
        let live = match &self.0.owner {
            Owner::Studio { page, .. } => Pages::of("Live page", page.site()),
            Owner::Simulation(_) => Pages::default(),
        };
        live.with(self.page())
    }

    /// The page of the studio alone.
    pub(crate) fn page(&self) -> Page {
        let site = StudioSite(Arc::clone(&self.0));
        Page::new("Studio", "/studio", Arc::new(site))
    }

    /// The state that the page shows, or its number alone if `seen` is that.
    #[cfg(test)]
    pub(crate) fn state(&self, seen: &str) -> String {
        self.0.state(seen)
    }

    /// Makes a change as the page requests it.
    #[cfg(test)]
    pub(crate) fn change(&self, change: &Change) -> Result<(), Refusal> {
        self.0.change(change)
    }

    /// Starts the line, as the page does.
    ///
    /// # Errors
    ///
    /// Why it does not start.
    pub fn start(&self) -> Result<(), String> {
        self.0.start().map_err(|(_, why)| why)
    }

    /// The path of the file, as it is after links.
    pub fn path(&self) -> PathBuf {
        self.0.room().desk.path().to_owned()
    }

    /// Stops the line. Returns what could not be written into the file; it is then kept in another one.
    pub fn close(self) -> Option<Unsaved> {
        self.0.tags.close();
        let mut room = self.0.room();
        room.line = None;
        let (text, why) = room.desk.settle()?;
        Some(Unsaved {
            why,
            kept: keep(&text),
            text: text.to_string(),
        })
    }
}

impl Shared {
    fn room(&self) -> MutexGuard<'_, Room> {
        // An edit that panicked has changed nothing, or the whole text.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives the line of a simulation the settings of the file.
    fn take(&self) -> Result<(), Refusal> {
        let Owner::Simulation(running) = &self.owner else {
            let why = "the line here is the studio's own; start it again";
            return Err((409, why.to_owned()));
        };
        let mut room = self.room();
        room.desk.look();
        room.refused_at = room.desk.version();
        room.turns += 1;
        room.refused.clear();
        let taken = match room.desk.unsaved() {
            Some((_, why)) => Err(format!(
                "the file could not be written ({why}), and the line takes only what the file has"
            )),
            None => running.take(),
        };
        room.refused = taken.as_ref().err().cloned().unwrap_or_default();
        taken.map_err(|why| (409, why))
    }

    fn start(&self) -> Result<(), Refusal> {
        let Owner::Studio { machine, page } = &self.owner else {
            return Err((409, OWNED.to_owned()));
        };
        let mut room = self.room();
        if room.explored.is_examining() {
            let text = "the line is examined at the moment, and is closed for that; wait, or stop the examination, and \
                        start again";
            return Err((409, text.to_owned()));
        }
        room.desk.look();
        room.refused_at = room.desk.version();
        // The port of the line that runs must be free for the new one.
        room.line = None;
        room.turns += 1;
        room.refused.clear();
        if let Some((_, why)) = room.desk.unsaved() {
            let text =
                format!("the file could not be written ({why}); the line starts from the file");
            room.refused.clone_from(&text);
            return Err((409, text));
        }
        let mistakes = room.desk.mistakes();
        if mistakes > 0 {
            let text = format!("the file has mistakes ({mistakes}); they are marked");
            room.refused.clone_from(&text);
            return Err((409, text));
        }
        match Line::open(room.desk.path(), self.kinds, machine, page) {
            Ok(line) => {
                room.line = Some(line);
                room.started = room.desk.version();
                Ok(())
            }
            Err(why) => {
                room.refused.clone_from(&why);
                Err((409, why))
            }
        }
    }

    /// Answers a question; it is under way as long as `asking` exists.
    fn answer(&self, question: &Question, asking: Asking) {
        match question {
            Question::Line => self.examine(asking),
            Question::Network(targets) => {
                let found = search(targets, self.kinds, &asking.stop);
                self.room().explored.found(found);
            }
        }
    }

    /// Goes along the line; a line that runs is stopped for that, and started again.
    fn examine(&self, asking: Asking) {
        let (path, line) = {
            let mut room = self.room();
            room.turns += 1;
            (room.desk.path().to_owned(), room.line.take())
        };
        let was_open = line.is_some();
        // Closed while others can look.
        drop(line);
        let steps = match Config::load(&path, self.kinds) {
            Ok(config) => look_along(&config, &asking.stop),
            // The page shows the mistakes.
            Err(_) => Vec::new(),
        };
        self.room().explored.examined(steps);
        drop(asking);
        if was_open {
            // Why not is on the page.
            let _ = self.start();
        }
    }

    fn stop(&self) {
        let mut room = self.room();
        room.line = None;
        room.turns += 1;
        room.refused.clear();
    }

    /// The state, or its number alone for a page that has it.
    fn state(&self, seen: &str) -> String {
        let mut room = self.room();
        room.desk.look();
        if room.desk.unsaved().is_some() {
            room.desk.save();
        }
        if room.refused_at != room.desk.version() {
            // Such as mistakes that are corrected now.
            room.refused.clear();
        }
        if let Owner::Simulation(running) = &self.owner {
            let present = running.present();
            let before = room.present.replace(Arc::clone(&present));
            if before.is_some_and(|before| !Arc::ptr_eq(&before, &present)) {
                // The simulation's program can give its line other settings, too.
                room.turns += 1;
            }
        }
        let version = format!("{}.{}", room.desk.version(), room.turns);
        if seen == version {
            return json!({ "state": version }).to_string();
        }
        let before = seen
            .split_once('.')
            .and_then(|(version, _)| version.parse().ok());
        let mut state = room.desk.news(before);
        state["state"] = json!(version);
        state["explored"] = room.explored.json();
        state["line"] = match &self.owner {
            Owner::Studio { .. } => json!({
                "runs": room.line.is_some(),
                "refused": room.refused,
                "isOld": room.line.is_some() && room.started != room.desk.version(),
            }),
            Owner::Simulation(running) => {
                let now = (room.desk.version(), room.turns);
                let known = room.asked.take().filter(|(at, _)| *at == now);
                let (_, asked) = room
                    .asked
                    .insert(known.unwrap_or_else(|| (now, running.asked())));
                let asked = asked.clone();
                running.json(&asked, &room.refused)
            }
        };
        state.to_string()
    }

    /// The contents of a folder of the PLC's tags.
    fn tags(&self, id: &str) -> String {
        let (path, settings) = {
            let mut room = self.room();
            room.desk.look();
            (room.desk.path().to_owned(), settings(room.desk.text()))
        };
        let found = match settings {
            Ok(settings) => self.tags.open(id, &settings, &path, self.kinds),
            Err(why) => Some(Err(why)),
        };
        match found {
            Some(Ok(listing)) => listing.to_string(),
            Some(Err(why)) => json!({ "error": why }).to_string(),
            None => json!({ "waits": true }).to_string(),
        }
    }

    fn change(&self, change: &Change) -> Result<(), Refusal> {
        let none = || (404, format!("{} cannot be changed", change.path));
        let path = change.path.strip_prefix('/').ok_or_else(none)?;
        if change.verb != Verb::Put {
            return Err((405, "use PUT".to_owned()));
        }
        if let Some(name) = path.strip_prefix("import/") {
            let name = decoded(name);
            return self.room().desk.import(&name, &change.body);
        }
        match (path, change.body.as_str()) {
            ("edit", body) => {
                let edit: Edit = serde_json::from_str(body)
                    .map_err(|error| (400, format!("this is no edit: {error}")))?;
                self.room().desk.edit(&edit)
            }
            ("undo", _) => self.room().desk.undo(),
            ("redo", _) => self.room().desk.redo(),
            ("use", index) => {
                let mut room = self.room();
                let index = index.parse().ok();
                let table = index.and_then(|index| room.explored.table(index));
                let table = table.map(str::to_owned);
                let gone = || (409, "this device is not in the list any more".to_owned());
                room.desk.adopt(&table.ok_or_else(gone)?)
            }
            ("cancel", _) => {
                self.room().explored.cancel();
                Ok(())
            }
            ("tags", "close") => {
                self.tags.close();
                Ok(())
            }
            ("line", "start") => self.start(),
            ("line", "take") => self.take(),
            ("line", "stop") => match self.owner {
                Owner::Simulation(_) => Err((409, OWNED.to_owned())),
                Owner::Studio { .. } => {
                    self.stop();
                    Ok(())
                }
            },
            ("line", _) => Err((400, "write start, stop or take".to_owned())),
            _ => Err(none()),
        }
    }
}

/// A question under way. When this goes, even by a panic, the next one can be asked.
struct Asking {
    shared: Arc<Shared>,
    stop: Stop,
}

impl Asking {
    fn begin(shared: &Arc<Shared>, question: Question) -> Result<Self, Refusal> {
        let stop = Stop::new();
        let mut room = shared.room();
        let begun = room.explored.begin(question, stop.clone());
        begun.map_err(|why| (409, why))?;
        room.turns += 1;
        drop(room);
        Ok(Self {
            shared: Arc::clone(shared),
            stop,
        })
    }
}

impl Drop for Asking {
    fn drop(&mut self) {
        let mut room = self.shared.room();
        room.explored.end();
        room.turns += 1;
    }
}

/// A part of a path without its percent signs.
fn decoded(text: &str) -> String {
    String::from_utf8_lossy(&tickbus_base::percent_decoded(text)).into_owned()
}

struct StudioSite(Arc<Shared>);

impl StudioSite {
    /// Begins to answer a question.
    fn ask(&self, question: Question) -> Result<(), Refusal> {
        if question == Question::Line && matches!(self.0.owner, Owner::Simulation(_)) {
            return Err((409, OWNED.to_owned()));
        }
        let asking = Asking::begin(&self.0, question.clone())?;
        let shared = Arc::clone(&self.0);
        let thread = std::thread::Builder::new().name("studio".to_owned());
        let begun = thread.spawn(move || shared.answer(&question, asking));
        begun.map(drop).map_err(|error| {
            let text = format!("the system starts no thread ({error}); end other programs");
            (503, text)
        })
    }

    /// Answers on a thread of its own: a file on a slow disk, or a line that closes, must not stop other viewers.
    fn apart<T: Send + 'static>(
        &self,
        answer: Answer<T>,
        make: impl FnOnce(&Shared) -> T + Send + 'static,
    ) {
        let shared = Arc::clone(&self.0);
        let thread = std::thread::Builder::new().name("studio".to_owned());
        // Without a thread the requester learns that nobody answers.
        let _ = thread.spawn(move || answer.give(make(&shared)));
    }
}

impl Site for StudioSite {
    fn assets(&self) -> &[Asset] {
        ASSETS
    }

    fn is_private(&self, _: &str) -> bool {
        true
    }

    fn longest_body(&self, _: &str) -> usize {
        BODY
    }

    /// Gives no answer: the page asks for the state of its file, and listens to the live page.
    fn look(&self, _: Answer<State>) {}

    fn get(&self, path: &str, answer: Answer<Option<Document>>) {
        let json = |text| {
            Some(Document {
                kind: "application/json",
                text,
            })
        };
        if let Some(seen) = path.strip_prefix("/state/") {
            let seen = seen.to_owned();
            self.apart(answer, move |shared| json(shared.state(&seen)));
        } else if let Some(id) = path.strip_prefix("/tags/") {
            let id = decoded(id);
            self.apart(answer, move |shared| json(shared.tags(&id)));
        } else if path == "/schema" {
            self.apart(answer, move |shared| {
                json(tickbus_schema::schema(shared.kinds).to_string())
            });
        } else {
            answer.give(None);
        }
    }

    fn change(&self, change: Change, answer: Answer<Outcome>) {
        if let Some(asked) = Question::asked(&change.path, &change.body) {
            let begun = asked.map_err(|why| (400, why));
            let begun = begun.and_then(|question| self.ask(question));
            answer.give(begun.map_err(|(status, text)| Refused { status, text }));
            return;
        }
        self.apart(answer, move |shared| {
            let done = shared.change(&change);
            done.map_err(|(status, text)| Refused { status, text })
        });
    }
}

#[cfg(test)]
#[path = "site_tests.rs"]
mod tests;
