//! The pages of one room.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::{Value as Json, json};

use crate::site::{Answer, Asset, Change, Document, Outcome, Site};

/// The pages that a [`Room`](crate::Room) serves together: they share its address, its token and its tabs.
///
/// Pages join at any time, also while the room serves them, each under a path such as `/board`; at most one page is the
/// first one, at `/`:
///
/// ```ignore
/// let pages = Pages::of("Live page", live.site());
/// let serving = room.serve(pages.clone(), clock)?;
/// let joined = pages.join(Page::new("Board", "/board", site));
/// drop(joined); // The page leaves.
/// ```
///
/// A page need not know its path. For the page at `/board`:
///
/// | request | to the [`Site`] |
/// |---|---|
/// | `GET /board` | the asset `/` |
/// | `GET /board/x` | the asset `/x`, or [`get`](Site::get) of `/x` |
/// | `PUT`, `DELETE /board/x` | [`change`](Site::change) of `/x` |
/// | `GET /board/state`, `/board/events`, `/events?page=/board` | [`look`](Site::look), while somebody asks |
/// | `GET /x` | the asset `/x`, if the first page and the pages before it have none of that path |
///
/// The HTML can therefore name its scripts and styles as `/x.js`, whatever its path is; no two pages have different
/// files of one name. The script asks for `room.base + "/x"`, where `client.js` sets `room.base` to the path of its page.
#[derive(Clone, Default)]
pub struct Pages(Arc<Mutex<Vec<Entry>>>);

/// A page that is to join others.
pub struct Page {
    name: String,
    path: String,
    member: Option<(String, String)>,
    site: Arc<dyn Site>,
}

/// The place of a page in a room; dropping it removes the page.
#[must_use = "the page leaves when this is dropped"]
pub struct Joined {
    pages: Pages,
    site: Arc<dyn Site>,
    path: String,
}

struct Entry {
    /// Empty for the first page.
    path: String,
    name: String,
    group: Option<Group>,
    site: Arc<dyn Site>,
}

/// The page is one of several of a kind.
struct Group {
    /// The path that leads to the first one of them.
    path: String,
    /// The name that tells this one from the others.
    member: String,
}

impl Page {
    /// A page with this name on its tab, at this path, such as `/board`. A path that is taken gets a number: `/board-2`.
    pub fn new(name: &str, path: &str, site: Arc<dyn Site>) -> Self {
        Self {
            name: name.to_owned(),
            path: path.trim_end_matches('/').to_owned(),
            member: None,
            site,
        }
    }

    /// One of several pages of a kind, as with one studio for each driver: with the path `/studio` and the `id` 7 it is at
    /// `/studio/of/7`, and at `/studio` as well if it is the first one. Where there are several, `name` is added on the tab.
    #[must_use]
    pub fn one_of_several(mut self, id: &str, name: &str) -> Self {
        self.member = Some((id.to_owned(), name.to_owned()));
        self
    }
}

impl Pages {
    /// A first page, at `/`.
    pub fn of(name: &str, site: Arc<dyn Site>) -> Self {
        Self::default().with(Page::new(name, "/", site))
    }

    /// These pages, and one that stays.
    #[must_use]
    pub fn with(self, page: Page) -> Self {
        self.add(page);
        self
    }

    /// Adds a page until the returned value is dropped.
    pub fn join(&self, page: Page) -> Joined {
        let site = Arc::clone(&page.site);
        Joined {
            path: self.add(page),
            pages: self.clone(),
            site,
        }
    }

    fn add(&self, page: Page) -> String {
        let Page {
            name,
            path: kind,
            member,
            site,
        } = page;
        let (asked, group) = match member {
            Some((id, member)) => (
                format!("{kind}/of/{id}"),
                Some(Group { path: kind, member }),
            ),
            None => (kind, None),
        };
        let mut entries = self.entries();
        let is_free = |path: &str| entries.iter().all(|entry| entry.path != path);
        let numbered = (2_u32..).map(|number| format!("{asked}-{number}"));
        let path = std::iter::once(asked.clone())
            .chain(numbered)
            .find(|path| is_free(path))
            .unwrap_or(asked);
        entries.push(Entry {
            path: path.clone(),
            name,
            group,
            site,
        });
        path
    }

    fn entries(&self) -> MutexGuard<'_, Vec<Entry>> {
        // A page is there as a whole, or not.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The page for a path, and the path within it: `/` for the page itself.
    pub(crate) fn page_of(&self, path: &str) -> Option<(Arc<dyn Site>, String)> {
        let entries = self.entries();
        let own = entries
            .iter()
            .filter_map(|entry| Some((entry, within(path, &entry.path)?)))
            .max_by_key(|(entry, _)| entry.path.len());
        let kinds = || {
            entries.iter().find_map(|entry| {
                let group = entry.group.as_ref()?;
                let rest = within(path, &group.path)?;
                // The path of another member, which may have left.
                (!rest.starts_with("/of/")).then_some((entry, rest))
            })
        };
        let found = own
            .filter(|(entry, _)| !entry.path.is_empty())
            .or_else(kinds)
            .or(own);
        found.map(|(entry, rest)| (Arc::clone(&entry.site), rest.to_owned()))
    }

    /// The page at exactly this path.
    pub(crate) fn page_at(&self, path: &str) -> Option<Arc<dyn Site>> {
        let (site, rest) = self.page_of(path)?;
        (rest == "/").then_some(site)
    }

    /// The path of the page to open where there is none at `/`.
    pub(crate) fn instead_of_first(&self) -> Option<String> {
        let entries = self.entries();
        let has_first = entries.iter().any(|entry| entry.path.is_empty());
        let other = entries.first().filter(|_| !has_first);
        other.map(|entry| entry.path.clone())
    }

    /// The file for a path: of its page, or of any.
    pub(crate) fn asset(&self, path: &str) -> Option<Asset> {
        let of = |site: &dyn Site, path: &str| {
            let mut assets = site.assets().iter();
            assets.find(|asset| asset.path == path).copied()
        };
        let own = self
            .page_of(path)
            .and_then(|(site, rest)| of(&*site, &rest));
        own.or_else(|| {
            let entries = self.entries();
            let mut sites = entries.iter();
            // The page itself is at its own path only.
            let is_file = path != "/";
            sites.find_map(|entry| of(&*entry.site, path).filter(|_| is_file))
        })
    }

    /// The tabs, as the pages ask for them: their paths and names, and those that need a wide window.
    pub(crate) fn tabs(&self) -> Json {
        let entries = self.entries();
        let mut tabs = Vec::new();
        for entry in &*entries {
            let own = entry.site.tabs();
            let (path, name) = match &entry.group {
                Some(group) if entries.iter().filter(|it| group.is_of(it)).count() == 1 => {
                    (&group.path, entry.name.clone())
                }
                Some(group) => (&entry.path, format!("{}: {}", entry.name, group.member)),
                None => (&entry.path, entry.name.clone()),
            };
            let path = if path.is_empty() { "/" } else { path };
            if own.is_empty() {
                tabs.push(json!({ "path": path, "name": name }));
            }
            for tab in own {
                let path = format!("{path}{}", tab.fragment);
                tabs.push(json!({ "path": path, "name": tab.name, "wide": tab.is_wide }));
            }
        }
        tabs.into()
    }

    /// Reports activity of a viewer with the token to all pages.
    pub(crate) fn heard(&self, viewers: usize) {
        let entries = self.entries();
        let sites: Vec<_> = entries.iter().map(|it| Arc::clone(&it.site)).collect();
        drop(entries);
        for site in sites {
            site.heard(viewers);
        }
    }

    pub(crate) fn is_private(&self, path: &str) -> bool {
        let page = self.page_of(path);
        page.is_some_and(|(site, rest)| site.is_private(&rest))
    }

    /// The largest body of a change of this path, in bytes; `None` if no page has the path.
    pub(crate) fn longest_body(&self, path: &str) -> Option<usize> {
        let (site, rest) = self.page_of(path)?;
        Some(site.longest_body(&rest))
    }

    pub(crate) fn get(&self, path: &str, answer: Answer<Option<Document>>) {
        match self.page_of(path) {
            Some((site, rest)) => site.get(&rest, answer),
            None => answer.give(None),
        }
    }

    /// Carries out a change; without a page for it the requester learns that nobody is there.
    pub(crate) fn change(&self, change: Change, answer: Answer<Outcome>) {
        if let Some((site, path)) = self.page_of(&change.path) {
            site.change(Change { path, ..change }, answer);
        }
    }
}

impl Group {
    fn is_of(&self, entry: &Entry) -> bool {
        let group = entry.group.as_ref();
        group.is_some_and(|group| group.path == self.path)
    }
}

impl Joined {
    /// The path of the page, without a slash at its end; empty for the first page.
    pub fn path(&self) -> &str {
        &self.path
    }
}

impl Drop for Joined {
    fn drop(&mut self) {
        let mut entries = self.pages.entries();
        entries.retain(|entry| !Arc::ptr_eq(&entry.site, &self.site) || entry.path != self.path);
    }
}

/// The rest of a path within the page at `base`.
fn within<'a>(path: &'a str, base: &str) -> Option<&'a str> {
    match path.strip_prefix(base)? {
        "" => Some("/"),
        rest => rest.starts_with('/').then_some(rest),
    }
}

impl fmt::Debug for Pages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Pages").finish_non_exhaustive()
    }
}

impl fmt::Debug for Page {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut page = f.debug_struct("Page");
        page.field("path", &self.path).finish_non_exhaustive()
    }
}

impl fmt::Debug for Joined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut joined = f.debug_struct("Joined");
        joined.field("path", &self.path).finish_non_exhaustive()
    }
}

#[cfg(test)]
#[path = "pages_tests.rs"]
mod tests;
