//! Studios beside the live page of drivers that run: one for each driver that is edited.
//!
//! The first one has the paths of a studio that is alone, `/studio/…`; each of them has `/studio/of/ID/…`. Without any,
//! the room is the live page's alone, and has no path of a studio.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::{Value as Json, json};
use tickbus_web::{Answer, Asset, Change, Document, Outcome, Site, State};

use crate::assets::assets;
use crate::running::Running;
use crate::site::Studio;

/// The studios beside one live page.
#[derive(Clone)]
pub struct Studios(Arc<Inner>);

struct Inner {
    live: Arc<dyn Site>,
    desks: Mutex<BTreeMap<i32, Desk>>,
}

#[derive(Clone)]
struct Desk {
    /// The name of the driver.
    name: String,
    site: Arc<dyn Site>,
}

/// The studio of one driver; dropping it ends the studio.
pub struct Seat {
    inner: Arc<Inner>,
    id: i32,
    studio: Option<Studio>,
}

impl Studios {
    /// No studios so far, beside the live page.
    pub fn beside(live: Arc<dyn Site>) -> Self {
        let desks = Mutex::default();
        Self(Arc::new(Inner { live, desks }))
    }

    /// The site that the room serves: the live page, and the studios that there are at the time of a request.
    pub fn site(&self) -> Arc<dyn Site> {
        Arc::new(Beside(Arc::clone(&self.0)))
    }

    /// Opens the studio of a driver.
    ///
    /// # Errors
    ///
    /// The file cannot be read.
    pub fn join(&self, running: Running) -> Result<Seat, String> {
        let (id, name) = (running.id, running.config.name.clone());
        let studio = Studio::of_running(running, Arc::clone(&self.0.live))?;
        let site = studio.site();
        self.0.desks().insert(id, Desk { name, site });
        Ok(Seat {
            inner: Arc::clone(&self.0),
            id,
            studio: Some(studio),
        })
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.inner.desks().remove(&self.id);
        if let Some(unsaved) = self.studio.take().and_then(Studio::close) {
            let why = &unsaved.why;
            match &unsaved.kept {
                Ok(path) => log::error!(
                    "the driver.cfg could not be written: {why}; the edits are in {}",
                    path.display()
                ),
                Err(error) => log::error!(
                    "the driver.cfg could not be written ({why}), and no other file either: {error}"
                ),
            }
        }
    }
}

impl Inner {
    fn desks(&self) -> MutexGuard<'_, BTreeMap<i32, Desk>> {
        // A desk is there as a whole, or not.
        self.desks.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn has_desks(&self) -> bool {
        !self.desks().is_empty()
    }

    /// The site for a path, and the path that it knows.
    fn site_of(&self, path: &str) -> (Arc<dyn Site>, String) {
        let desks = self.desks();
        let rest = path.strip_prefix("/studio/");
        let found = match rest.map(|rest| (rest, rest.strip_prefix("of/"))) {
            Some((_, Some(of))) => of.split_once('/').and_then(|(id, rest)| {
                let desk = desks.get(&id.parse().ok()?)?;
                Some((desk, rest))
            }),
            Some((rest, None)) => desks.values().next().map(|desk| (desk, rest)),
            None => None,
        };
        match found {
            Some((desk, rest)) => (Arc::clone(&desk.site), format!("/studio/{rest}")),
            None => (Arc::clone(&self.live), path.to_owned()),
        }
    }

    /// The pages of the room.
    fn tabs(&self) -> Json {
        let desks = self.desks();
        let is_one = desks.len() == 1;
        let studios = desks.iter().map(|(id, desk)| {
            if is_one {
                json!({ "path": "/studio", "name": "Studio" })
            } else {
                let (path, name) = (format!("/studio?driver={id}"), &desk.name);
                json!({ "path": path, "name": format!("Studio: {name}") })
            }
        });
        let live = json!({ "path": "/", "name": "Live page" });
        std::iter::once(live).chain(studios).collect()
    }
}

struct Beside(Arc<Inner>);

impl Site for Beside {
    fn assets(&self) -> &[Asset] {
        let live = self.0.live.assets();
        if self.0.has_desks() {
            assets(live)
        } else {
            live
        }
    }

    fn look(&self, answer: Answer<State>) {
        self.0.live.look(answer);
    }

    fn get(&self, path: &str, answer: Answer<Option<Document>>) {
        if path == "/tabs" && self.0.has_desks() {
            return answer.give(Some(Document {
                kind: "application/json",
                text: self.0.tabs().to_string(),
            }));
        }
        let (site, path) = self.0.site_of(path);
        site.get(&path, answer);
    }

    fn is_private(&self, path: &str) -> bool {
        path.starts_with("/studio/") && self.0.has_desks()
    }

    fn longest_body(&self, path: &str) -> usize {
        let (site, path) = self.0.site_of(path);
        site.longest_body(&path)
    }

    fn heard(&self, viewers: usize) {
        self.0.live.heard(viewers);
    }

    fn change(&self, change: Change, answer: Answer<Outcome>) {
        let (site, path) = self.0.site_of(&change.path);
        site.change(Change { path, ..change }, answer);
    }
}

impl fmt::Debug for Studios {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Studios").finish_non_exhaustive()
    }
}

impl fmt::Debug for Seat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Seat")
            .field("id", &self.id)
            .finish_non_exhaustive()
    }
}
