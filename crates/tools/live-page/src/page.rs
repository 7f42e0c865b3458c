//! The page as a whole.

use std::fmt;
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::{self, JoinHandle};

use tickbus_base::time::{Clock, system_time};
use tickbus_driver::Watch;
use tickbus_virtual_time::Controls;
use tickbus_web::{Answer, Asset, Change, Document, Outcome, Site, State, Tab};

use crate::assets::ASSETS;
use crate::exhibit::Exhibit;
use crate::keeper::{Inbox, Keeper, Wish};
use crate::lists::LARGEST;
use crate::model::{Has, Shared};
use crate::options::Options;
use crate::past::{Door, Past};
use crate::recorded::{Recorded, ShownRecording};
use crate::run::ShownRun;
use crate::shown::Shown;

/// A page that drivers and runs join; dropping it stops its thread.
pub struct LivePage {
    inbox: Arc<Inbox>,
    model: Arc<Shared>,
    clock: Arc<dyn Clock>,
    thread: Option<JoinHandle<()>>,
    door: Door,
    _past: Past,
}

impl fmt::Debug for LivePage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LivePage").finish_non_exhaustive()
    }
}

/// The place of a driver or a run on the page; dropping it removes that.
#[derive(Debug)]
pub struct Member {
    model: Arc<Shared>,
    id: i32,
}

impl LivePage {
    /// A page without drivers.
    ///
    /// # Errors
    ///
    /// The system could not start a thread.
    pub fn open(clock: Arc<dyn Clock>) -> io::Result<Self> {
        let inbox = Arc::<Inbox>::default();
        let model = Arc::new(Shared::opened(system_time()));
        let (past, door) = Past::open(Arc::clone(&model))?;
        let keeper = Keeper {
            inbox: Arc::clone(&inbox),
            model: Arc::clone(&model),
            heard: clock.now(),
            holders: 0,
            clock: Arc::clone(&clock),
        };
        let thread = thread::Builder::new().name("page".to_owned());
        let thread = thread.spawn(move || keeper.run())?;
        Ok(Self {
            inbox,
            model,
            clock,
            thread: Some(thread),
            door,
            _past: past,
        })
    }

    /// The site that the room serves.
    pub fn site(&self) -> Arc<dyn Site> {
        Arc::new(LiveSite {
            inbox: Arc::clone(&self.inbox),
            door: self.door.clone(),
            has: self.model.with(|model| model.has()),
        })
    }

    /// Shows a driver, or a PLC program, until the returned value is dropped.
    pub fn join(&self, watch: Watch, options: Options) -> Member {
        let now = self.clock.now();
        let id = watch.config().id;
        self.add(id, |id| Box::new(Shown::new(id, watch, options, now)))
    }

    /// Shows a run on virtual time, under this name, until the returned value is dropped.
    pub fn join_run(&self, name: &str, controls: Controls) -> Member {
        let now = self.clock.now();
        self.add(1, |id| Box::new(ShownRun::new(id, name, controls, now)))
    }

    /// Shows a recording, until the returned value is dropped.
    pub fn join_recording(&self, recorded: Recorded) -> Member {
        let now = self.clock.now();
        self.add(1, |id| Box::new(ShownRecording::new(id, recorded, now)))
    }

    fn add(&self, id: i32, make: impl FnOnce(i32) -> Box<dyn Exhibit>) -> Member {
        let id = self.model.with(|model| model.join(id, make));
        // Wake the thread, to look at the new exhibit.
        self.inbox.stop.wake();
        Member {
            model: Arc::clone(&self.model),
            id,
        }
    }
}

impl Drop for LivePage {
    fn drop(&mut self) {
        self.inbox.stop.stop();
        if let Some(thread) = self.thread.take() {
            // A panic has been reported already.
            let _ = thread.join();
        }
    }
}

impl Member {
    /// The number under which the page has the driver: its own `id`, unless another driver has that.
    pub const fn id(&self) -> i32 {
        self.id
    }
}

impl Drop for Member {
    fn drop(&mut self) {
        self.model.with(|model| model.leave(self.id));
    }
}

/// The page, as the room serves it.
struct LiveSite {
    inbox: Arc<Inbox>,
    door: Door,
    has: Arc<Has>,
}

impl Site for LiveSite {
    fn assets(&self) -> &[Asset] {
        ASSETS
    }

    fn look(&self, answer: Answer<State>) {
        self.inbox.put(Wish::Look(answer));
    }

    fn get(&self, path: &str, answer: Answer<Option<Document>>) {
        if Door::leads_to(path) {
            self.door.ask(path, answer);
        } else {
            self.inbox.put(Wish::Get(path.to_owned(), answer));
        }
    }

    fn longest_body(&self, path: &str) -> usize {
        if Door::leads_to(path) {
            LARGEST
        } else if path.starts_with("/force") {
            // As many signals as can be forced, with long names.
            64 << 10
        } else {
            4096
        }
    }

    fn change(&self, change: Change, answer: Answer<Outcome>) {
        if Door::leads_to(&change.path) {
            self.door.change(change, answer);
        } else {
            self.inbox.put(Wish::Change(change, answer));
        }
    }

    fn tabs(&self) -> Vec<Tab> {
        let views = [
            ("Overview", "", true),
            ("Machine", "#machine", self.has.picture.load(Relaxed)),
            ("Signals", "#signals", true),
            ("Line", "#line", true),
            ("Recording", "#recording", self.has.past.load(Relaxed)),
        ];
        let tab = |(name, fragment, _): (&str, &str, bool)| Tab {
            name: name.to_owned(),
            fragment: fragment.to_owned(),
            is_wide: fragment.is_empty(),
        };
        views.into_iter().filter(|view| view.2).map(tab).collect()
    }

    fn heard(&self, viewers: usize) {
        self.inbox.put(Wish::Heard(viewers));
    }
}
