//! The patch bay: the board of a dispatcher as a web page.
//!
//! docs/dispatcher.md describes it, for users and for programs.

mod arrange;
mod assets;
mod json;
mod layout;
mod layout_file;
mod model;
mod place;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::thread;

use tickbus_base::toml_text::Mistakes;
use tickbus_dispatcher::{Door, Number, Order, Pin, Reply};
use tickbus_web::{Answer, Asset, Change, Outcome, Refused, Site, State, Verb};

use crate::assets::ASSETS;
use crate::layout::Layout;
use crate::layout_file::LayoutFile;
use crate::model::Shared;

/// The longest description of a layout: that of thousands of boxes.
const LONGEST_LAYOUT: usize = 4 << 20;

/// The page of the dispatcher behind a door.
#[derive(Clone, Debug)]
pub struct PatchBay {
    door: Door,
    model: Arc<Shared>,
}

/// Why a kept layout cannot be used.
#[derive(Debug)]
pub enum LayoutRefused {
    /// The file is wrong.
    Mistakes(Mistakes),
    /// The system could not start a thread.
    System(io::Error),
}

impl PatchBay {
    /// The page of this dispatcher, with a layout that ends with the page.
    pub fn new(door: Door) -> Self {
        let model = Arc::new(Shared::new(Layout::default()));
        Self { door, model }
    }

    /// The page of this dispatcher, with the layout of a file. `report` gets a sentence when the file cannot be written.
    ///
    /// # Errors
    ///
    /// The file has mistakes, or there is no thread to write it.
    pub fn with_layout(
        door: Door,
        file: &Path,
        report: impl Fn(String) + Send + 'static,
    ) -> Result<Self, LayoutRefused> {
        let places = layout_file::load(file).map_err(LayoutRefused::Mistakes)?;
        let file = LayoutFile::start(file.to_owned(), report).map_err(LayoutRefused::System)?;
        let model = Arc::new(Shared::new(Layout::new(places, file)));
        Ok(Self { door, model })
    }

    /// The file of the layout beside that of the patch: `patch.layout.toml` beside `patch.toml`.
    pub fn layout_beside(patch: &Path) -> PathBuf {
        if patch.extension().is_some_and(|it| it == "toml") {
            return patch.with_extension("layout.toml");
        }
        // `hall.1` and `hall.2` have a layout each.
        let mut path = patch.as_os_str().to_owned();
        path.push(".layout.toml");
        path.into()
    }

    /// Changes the layout of the present board. Nobody may look at it, so that the dispatcher is asked for it first. Its
    /// thread must not wait for a model that is being formatted: a thread of the change does.
    fn request_layout(&self, change: Change, answer: Answer<Outcome>) {
        let (sender, taken) = channel();
        let model = Arc::clone(&self.model);
        self.door.send(move |dispatcher, now| {
            model.leave(dispatcher.snapshot(), now);
            // The thread ends only with this answer.
            let _ = sender.send(());
        });
        let model = Arc::clone(&self.model);
        let thread = thread::Builder::new().name("layout-change".to_owned());
        let started = thread.spawn(move || {
            // Without the dispatcher the answer is dropped, which tells that it has ended.
            if taken.recv().is_ok() {
                answer.give(change_layout(&model, &change));
            }
        });
        // The answer is dropped without a thread, too.
        drop(started);
    }
}

fn change_layout(model: &Shared, change: &Change) -> Outcome {
    let refuse = |status, text: String| Err(Refused { status, text });
    model.with(|model| {
        model.layout.pin();
        let number = model.number + 1;
        match (change.verb, &*change.path) {
            (Verb::Put, "/layout") => {
                if let Err(text) = model.layout.change(&change.body, number) {
                    return refuse(400, text);
                }
            }
            (Verb::Put, "/layout/arranged") => {
                let (boxes, links) = model.boxes();
                model.layout.arrange(&boxes, &links, number);
            }
            _ => {
                let text = "change a layout with PUT /layout and PUT /layout/arranged";
                return refuse(404, text.to_owned());
            }
        }
        model.number = number;
        Ok(())
    })
}

impl Site for PatchBay {
    fn assets(&self) -> &[Asset] {
        ASSETS
    }

    fn look(&self, answer: Answer<State>) {
        let model = Arc::clone(&self.model);
        self.door.send(move |dispatcher, now| {
            model.leave(dispatcher.snapshot(), now);
            answer.give(State::Differences(model));
        });
    }

    fn longest_body(&self, path: &str) -> usize {
        if path == "/layout" {
            LONGEST_LAYOUT
        } else {
            4096
        }
    }

    fn change(&self, change: Change, answer: Answer<Outcome>) {
        if change.path.starts_with("/layout") {
            return self.request_layout(change, answer);
        }
        // Boxes must not move under the pointer of somebody who works with them.
        self.model.with(|model| model.layout.pin());
        match order(&change) {
            Ok(order) => {
                let reply = Reply::new(move |outcome| {
                    answer.give(outcome.map_err(|refusal| Refused {
                        status: refusal.code.number(),
                        text: refusal.text,
                    }));
                });
                self.door.operate(order, reply);
            }
            Err(refused) => answer.give(Err(refused)),
        }
    }
}

/// The order in a change.
fn order(change: &Change) -> Result<Order, Refused> {
    let path = &*change.path;
    let wrong = |status, text: &str| Refused {
        status,
        text: text.to_owned(),
    };
    let parts = path.strip_prefix('/').and_then(|it| it.split_once('/'));
    let Some((what @ ("patch" | "force"), pin)) = parts else {
        let text =
            "there is nothing to change here; change /patch/NAME:I1, /force/NAME:I1 or /layout";
        return Err(wrong(404, text));
    };
    let pin = Pin::parse(pin).ok_or_else(|| {
        wrong(
            400,
            "the path does not end in a channel of a client; write it such as /patch/LOGO:I1",
        )
    })?;
    Ok(match (what, change.verb) {
        ("patch", Verb::Put) => {
            let other = Pin::parse(&change.body).ok_or_else(|| {
                let text = format!(
                    "{} is not a channel of a client; send one such as PUMP:Q1",
                    short(&change.body)
                );
                wrong(400, &text)
            })?;
            Order::Connect(pin, other)
        }
        ("patch", Verb::Delete) => Order::Disconnect(pin),
        (_, Verb::Put) => {
            let number = Number::parse(change.body.as_bytes()).ok_or_else(|| {
                let text = format!(
                    "{} is not a number; write one such as 24 or -3.5, of at most 23 characters",
                    short(&change.body)
                );
                wrong(400, &text)
            })?;
            Order::Force(pin, number)
        }
        (_, Verb::Delete) => Order::Release(pin),
    })
}

/// The beginning of a body, to be quoted in an answer.
fn short(body: &str) -> &str {
    match body.char_indices().nth(40) {
        _ if body.is_empty() => "an empty body",
        Some((end, _)) => &body[..end],
        None => body,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(verb: Verb, path: &str, body: &str) -> Result<Order, u16> {
        let change = Change {
            verb,
            path: path.to_owned(),
            body: body.to_owned(),
        };
        order(&change).map_err(|refused| refused.status)
    }

    #[test]
    fn each_patch_has_a_layout_file() {
        for (patch, layout) in [
            ("a/patch.toml", "a/patch.layout.toml"),
            ("hall.1", "hall.1.layout.toml"),
            ("hall.2", "hall.2.layout.toml"),
            ("hall", "hall.layout.toml"),
        ] {
            assert_eq!(PatchBay::layout_beside(Path::new(patch)), Path::new(layout));
        }
    }

    #[test]
    fn a_change_is_an_order_or_a_mistake() {
        let pin = |text| Pin::parse(text).expect("a pin");
        let number = Number::parse(b"-3.5").expect("a number");
        let (sink, source) = (pin("LOGO:AI1"), pin("PUMP:AQ0"));
        assert_eq!(
            read(Verb::Put, "/patch/LOGO:AI1", "PUMP:AQ0"),
            Ok(Order::Connect(sink.clone(), source))
        );
        assert_eq!(
            read(Verb::Delete, "/patch/LOGO:AI1", ""),
            Ok(Order::Disconnect(sink.clone()))
        );
        assert_eq!(
            read(Verb::Put, "/force/LOGO:AI1", "-3.50"),
            Ok(Order::Force(sink.clone(), number))
        );
        assert_eq!(
            read(Verb::Delete, "/force/LOGO:AI1", ""),
            Ok(Order::Release(sink))
        );
        for (verb, path, body, status) in [
            (Verb::Put, "/", "", 404),
            (Verb::Put, "/state", "", 404),
            (Verb::Put, "/wire/LOGO:I1", "1", 404),
            (Verb::Put, "/patch/LOGO", "PUMP:Q1", 400),
            (Verb::Put, "/patch/LOGO:X1", "PUMP:Q1", 400),
            (Verb::Put, "/patch/LO%47O:I1", "PUMP:Q1", 400),
            (Verb::Put, "/patch/LOGO:I1", "PUMP", 400),
            (Verb::Put, "/force/LOGO:I1", "on", 400),
            (Verb::Put, "/force/LOGO:I1", "1e", 400),
            (Verb::Delete, "/force/LOGO:I1/x", "", 400),
        ] {
            assert_eq!(read(verb, path, body), Err(status), "{path} {body}");
        }
    }
}
