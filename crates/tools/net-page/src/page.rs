//! The page, and the programs that hand it their nets.

use std::collections::BTreeMap;
use std::fmt;
use std::hash::{BuildHasher as _, RandomState};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde_json::json;
use tickbus_base::time::{Clock, Nanos};
use tickbus_web::Site;

use crate::layout::{self, Layout};
use crate::state;

/// The shortest time between two states of a program that are wanted.
const PERIOD: Nanos = Nanos::from_millis(33);

/// A page that was looked at so long ago has no viewers: a room that works hard looks once a second.
const ABANDONED: Nanos = Nanos::from_secs(2);

/// The page of all nets of a process.
#[derive(Clone)]
pub struct NetPage(pub(crate) Arc<Hall>);

/// The nets of one program on the page; dropping it takes them away.
pub struct Nets {
    hall: Arc<Hall>,
    id: u64,
}

/// The answer to a program that asks if a state is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// Nobody looks, or the last state is too young.
    No,
    /// Somebody looks.
    Yes,
    /// The nets have been taken from the page.
    Over,
}

/// The data that the page and its programs share.
pub(crate) struct Hall {
    clock: Arc<dyn Clock>,
    /// Distinguishes this page from that of a process before it at the same address.
    run: String,
    board: Mutex<Board>,
    /// There is a viewer, or nets have gone.
    news: Condvar,
}

#[derive(Default)]
struct Board {
    /// When the page was last looked at.
    looked: Option<Nanos>,
    /// The number of sets so far.
    count: u64,
    sets: BTreeMap<u64, Set>,
}

/// The nets of one program.
struct Set {
    title: String,
    drawn: Option<Drawn>,
    /// The last state, and when it came.
    state: Option<(Arc<str>, Nanos)>,
    /// When the last state came, also one that is not shown any more.
    put: Option<Nanos>,
}

#[derive(Clone)]
struct Drawn {
    layout: Arc<Layout>,
    /// The layout, for the page.
    json: Arc<str>,
}

impl NetPage {
    /// A page without nets.
    pub fn new(clock: Arc<dyn Clock>) -> Self {
        Self(Arc::new(Hall {
            clock,
            run: format!("{:x}", RandomState::new().hash_one(0)),
            board: Mutex::default(),
            news: Condvar::new(),
        }))
    }

    /// The page for the room.
    pub fn site(&self) -> Arc<dyn Site> {
        Arc::new(self.clone())
    }

    /// Adds the nets of a program, under a heading.
    pub fn join(&self, title: &str) -> Nets {
        let mut board = self.0.board();
        board.count += 1;
        let id = board.count;
        let set = Set {
            title: title.to_owned(),
            drawn: None,
            state: None,
            put: None,
        };
        board.sets.insert(id, set);
        Nets {
            hall: Arc::clone(&self.0),
            id,
        }
    }
}

impl Nets {
    /// Hands over the names, conditions and drawings of the nets, once.
    ///
    /// # Errors
    ///
    /// The JSON is broken, too long, or has something that no drawing may have; the nets are drawn already, or have been
    /// taken from the page.
    pub fn draw(&self, json: &str) -> Result<(), String> {
        let layout = layout::read(json)?;
        let text = serde_json::to_string(&layout).map_err(|why| why.to_string())?;
        let mut board = self.hall.board();
        let set = board.sets.get_mut(&self.id).ok_or_else(gone)?;
        if set.drawn.is_some() {
            return Err("the nets are drawn already; open another page for others".to_owned());
        }
        set.drawn = Some(Drawn {
            layout: Arc::new(layout),
            json: text.into(),
        });
        Ok(())
    }

    /// Waits until a state is wanted, at most this long. A state is wanted while somebody looks, and at most 30 times a
    /// second. Returns at once if the nets are taken from the page meanwhile.
    pub fn wanted(&self, patience: Nanos) -> Wanted {
        let clock = &self.hall.clock;
        let end = clock.now() + patience.max(Nanos::ZERO);
        let mut board = self.hall.board();
        loop {
            let now = clock.now();
            let Some(set) = board.sets.get(&self.id) else {
                return Wanted::Over;
            };
            let due = match (board.is_watched(now), set.put) {
                (false, _) => None,
                (true, None) => Some(now),
                (true, Some(put)) => Some(put + PERIOD),
            };
            if due.is_some_and(|due| now >= due) {
                return Wanted::Yes;
            }
            if now >= end {
                return Wanted::No;
            }
            let next = due.map_or(end, |due| due.min(end)) - now;
            board = self.hall.wait(board, next.to_duration());
        }
    }

    /// Hands over the present state of all nets.
    ///
    /// # Errors
    ///
    /// The JSON is broken, too long, or does not fit to the nets that were drawn; the nets are not drawn yet, or have
    /// been taken from the page.
    pub fn put(&self, json: &str) -> Result<(), String> {
        let drawn = {
            let board = self.hall.board();
            let set = board.sets.get(&self.id).ok_or_else(gone)?;
            set.drawn.clone()
        };
        let drawn = drawn.ok_or("the nets are not drawn yet; hand over their drawings first")?;
        let state = state::read(json, &drawn.layout)?;
        let now = self.hall.clock.now();
        let mut board = self.hall.board();
        let set = board.sets.get_mut(&self.id).ok_or_else(gone)?;
        set.state = Some((state.into(), now));
        set.put = Some(now);
        Ok(())
    }

    /// Takes the nets from the page, and ends a wait of another thread.
    pub fn leave(&self) {
        self.hall.board().sets.remove(&self.id);
        self.hall.news.notify_all();
    }
}

impl Drop for Nets {
    fn drop(&mut self) {
        self.leave();
    }
}

fn gone() -> String {
    "the nets have been taken from the page; open them again".to_owned()
}

impl Board {
    fn is_watched(&self, now: Nanos) -> bool {
        self.looked.is_some_and(|looked| now - looked < ABANDONED)
    }
}

impl Hall {
    fn board(&self) -> MutexGuard<'_, Board> {
        // A set is there as a whole, or not.
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, board: MutexGuard<'a, Board>, longest: Duration) -> MutexGuard<'a, Board> {
        let waited = self.news.wait_timeout(board, longest);
        waited.unwrap_or_else(PoisonError::into_inner).0
    }

    /// A viewer looks: returns a function that makes the state of all nets.
    pub(crate) fn look(&self) -> impl FnOnce() -> String + Send + use<> {
        let now = self.clock.now();
        let mut board = self.board();
        if !board.is_watched(now) {
            // These states can be old, and the programs hand over new ones in a moment.
            for set in board.sets.values_mut() {
                set.state = None;
                set.put = None;
            }
            self.news.notify_all();
        }
        board.looked = Some(now);
        let sets = board.sets.iter().map(|(id, set)| {
            let age = set.state.as_ref().map(|(_, put)| now - *put);
            let head = json!({
                "id": id,
                "title": set.title,
                "drawn": set.drawn.is_some(),
                // In whole seconds, because each other age is another state for all viewers.
                "age": age.map_or(0, |age| age.0 / 1_000_000_000),
            });
            (head, set.state.as_ref().map(|(state, _)| Arc::clone(state)))
        });
        let sets: Vec<_> = sets.collect();
        let run = self.run.clone();
        move || {
            let sets = sets.iter().map(|(head, state)| {
                let head = head.to_string();
                let head = head.strip_suffix('}').unwrap_or(&head);
                format!("{head},\"nets\":{}}}", state.as_deref().unwrap_or("null"))
            });
            let sets: Vec<String> = sets.collect();
            format!("{{\"run\":\"{run}\",\"sets\":[{}]}}", sets.join(","))
        }
    }

    /// The layout of a program's nets.
    pub(crate) fn layout(&self, id: u64) -> Option<Arc<str>> {
        let board = self.board();
        let drawn = board.sets.get(&id)?.drawn.as_ref()?;
        Some(Arc::clone(&drawn.json))
    }
}

impl fmt::Debug for NetPage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("NetPage").finish_non_exhaustive()
    }
}

impl fmt::Debug for Nets {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Nets")
            .field("id", &self.id)
            .finish_non_exhaustive()
    }
}
