//! The drawing load for a browser: elements that refer to each other multiply the elements shown.

use std::collections::HashMap;

use super::tree::{Child, Element};
use super::{Notes, css};

/// The most drawn elements, counting repeated ones each time.
const MOST: u64 = 200_000;

/// The longest chain of references.
const LONGEST: usize = 40;

/// Removes all references from a picture that would overload a browser.
pub(super) fn limit(root: &mut Element, notes: &mut Notes) {
    let is_small = {
        let mut load = Load {
            ids: HashMap::new(),
            known: HashMap::new(),
        };
        load.find(root);
        load.of(root, 0).is_some_and(|load| load <= MOST)
    };
    if is_small {
        return;
    }
    let text = format!(
        "all references within the picture: with what they repeat it would have more than {MOST} elements, or they never end"
    );
    notes.leave_out(root.line, &text);
    cut(root);
}

fn cut(element: &mut Element) {
    element
        .attributes
        .retain(|(name, value)| name != "href" && css::references(value).next().is_none());
    for child in &mut element.children {
        if let Child::Element(child) = child {
            cut(child);
        }
    }
}

struct Load<'t> {
    ids: HashMap<&'t str, &'t Element>,
    /// The load of each named element; `None` while that is counted.
    known: HashMap<&'t str, Option<u64>>,
}

impl<'t> Load<'t> {
    fn find(&mut self, element: &'t Element) {
        if let Some(id) = element.get("id") {
            self.ids.entry(id).or_insert(element);
        }
        for child in element.elements() {
            self.find(child);
        }
    }

    /// The load of an element; `None` if it is endless.
    fn of(&mut self, element: &'t Element, chain: usize) -> Option<u64> {
        let mut all = 1_u64;
        for child in element.elements() {
            all = all.saturating_add(self.of(child, chain)?);
        }
        for (name, value) in &element.attributes {
            let own = (name == "href").then(|| value.strip_prefix('#')).flatten();
            for id in own.into_iter().chain(css::references(value)) {
                all = all.saturating_add(self.named(id, chain)?);
            }
        }
        Some(all)
    }

    fn named(&mut self, id: &'t str, chain: usize) -> Option<u64> {
        let Some(element) = self.ids.get(id).copied() else {
            return Some(0);
        };
        if let Some(known) = self.known.get(id) {
            return *known;
        }
        if chain >= LONGEST {
            return None;
        }
        self.known.insert(id, None);
        let load = self.of(element, chain + 1);
        self.known.insert(id, load);
        load
    }
}
