//! The page as a site of the room.

use tickbus_web::{Answer, Asset, Change, Document, Outcome, Refused, Site, State};

use crate::assets::ASSETS;
use crate::page::NetPage;

/// The page only shows.
impl Site for NetPage {
    fn assets(&self) -> &[Asset] {
        ASSETS
    }

    fn look(&self, answer: Answer<State>) {
        answer.give(State::whole(self.0.look()));
    }

    fn get(&self, path: &str, answer: Answer<Option<Document>>) {
        let id = path.strip_prefix("/layout/").map(str::parse);
        let layout = id.and_then(Result::ok).and_then(|id| self.0.layout(id));
        answer.give(layout.map(|layout| Document {
            kind: "application/json",
            text: layout.as_ref().to_owned(),
        }));
    }

    fn change(&self, _: Change, answer: Answer<Outcome>) {
        answer.give(Err(Refused {
            status: 404,
            text: "the page of nets only shows; nothing can be changed here".to_owned(),
        }));
    }
}
