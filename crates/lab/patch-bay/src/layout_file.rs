//! The file in which a layout survives.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Sender, channel};
use std::thread::{self, JoinHandle};

use tickbus_base::toml_text::{Collector, Mistakes, Table, load_text, read_text};
use tickbus_dispatcher::{LONGEST_LABEL, Label, replace_file};

use crate::arrange::Spot;
use crate::place::{FARTHEST, Place, is_box};

pub(crate) const HEADING: &str = "\
# Where the patch bay shows the clients, in pixels. It is rewritten when a box is moved: edit it only while the dispatcher
# does not run.
[boxes]
";

/// The thread that saves the newest layout.
#[derive(Debug)]
pub(crate) struct LayoutFile {
    /// `None` when the thread is to end.
    texts: Option<Sender<String>>,
    thread: Option<JoinHandle<()>>,
}

impl LayoutFile {
    /// Starts the thread. A file that cannot be written is reported once.
    pub(crate) fn start(
        path: PathBuf,
        report: impl Fn(String) + Send + 'static,
    ) -> io::Result<Self> {
        let (texts, to_save) = channel::<String>();
        let thread = thread::Builder::new().name("layout".to_owned());
        let thread = thread.spawn(move || {
            let mut is_reported = false;
            while let Ok(mut text) = to_save.recv() {
                // Only the newest counts.
                while let Ok(newer) = to_save.try_recv() {
                    text = newer;
                }
                match replace_file(&path, &text) {
                    Ok(()) => is_reported = false,
                    Err(error) if !is_reported => {
                        is_reported = true;
                        report(format!(
                            "{} cannot be written ({error}); boxes that are moved now return after a restart",
                            path.display()
                        ));
                    }
                    Err(_) => {}
                }
            }
        })?;
        Ok(Self {
            texts: Some(texts),
            thread: Some(thread),
        })
    }

    pub(crate) fn save(&self, text: String) {
        if let Some(texts) = &self.texts {
            // The thread ends only with this sender.
            let _ = texts.send(text);
        }
    }
}

impl Drop for LayoutFile {
    fn drop(&mut self) {
        drop(self.texts.take());
        if let Some(thread) = self.thread.take() {
            // A panic has been reported already.
            let _ = thread.join();
        }
    }
}

/// Reads a layout; a file that does not exist has none.
pub(crate) fn load(path: &Path) -> Result<BTreeMap<String, Place>, Mistakes> {
    if let Err(error) = fs::metadata(path)
        && error.kind() == io::ErrorKind::NotFound
    {
        return Ok(BTreeMap::new());
    }
    parse(&path.display().to_string(), &load_text(path)?)
}

const RIGHT: &str = "write a [boxes] table with lines such as \"PUMP\" = { x = 40, y = 16 }";

fn parse(file: &str, text: &str) -> Result<BTreeMap<String, Place>, Mistakes> {
    let mut collector = Collector::new(file, text);
    let places = read_text(&mut collector, text, |mut root| {
        let table = root.require("boxes", RIGHT);
        root.finish();
        Some(read(&table?.table("[boxes]", RIGHT)?))
    });
    match collector.finish() {
        Some(mistakes) => Err(mistakes),
        None => Ok(places.unwrap_or_default()),
    }
}

fn read(table: &Table<'_>) -> BTreeMap<String, Place> {
    let mut places = BTreeMap::new();
    for (name, value) in table.all() {
        if !is_box(name) {
            let name = tickbus_base::toml_text::shown(name);
            value.wrong(format!("\"{name}\" is no name of a client"), RIGHT);
            continue;
        }
        let Some(mut entry) = value.table(name, RIGHT) else {
            continue;
        };
        let mut coordinate = |key| {
            let range = 0..=i128::from(FARTHEST);
            let pixels = entry
                .require(key, "write a number of pixels")?
                .whole(range)?;
            i32::try_from(pixels).ok()
        };
        let spot = coordinate("x").zip(coordinate("y"));
        let is_folded = entry.take("folded").and_then(|it| it.boolean());
        let group = entry.take("group").and_then(|it| {
            let right = "write the name of a group, such as \"Hall 1\"";
            Label::of(it.label(LONGEST_LABEL, right)?)
        });
        entry.finish();
        if let Some((x, y)) = spot {
            let place = Place::kept(Spot { x, y }, is_folded.unwrap_or(false), group);
            places.insert(name.to_owned(), place);
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mistakes_are_told_at_their_place() {
        let text = "[boxes]\n\"A B\" = { x = 1, y = 1 }\nC = { x = 1 }\nD = { x = -1, y = 2 }\nE = 7\nF = { x = 1, y = 1, fold = true }\n\
                    G = { x = 1, y = 1, group = \"\" }\n[patch]\n";
        let told = parse("a.toml", text).expect_err("it is wrong").to_string();
        for part in [
            "a.toml:2:9: \"A B\" is no name of a client; ",
            "a.toml:3:5: C has no \"y\"; write a number of pixels",
            "a.toml:4:11: ",
            "a.toml:5:5: ",
            "a.toml:6:21: unknown key \"fold\" in F; did you mean \"folded\"?",
            "a.toml:7:29: \"group\" is empty; ",
            "a.toml:8:2: unknown key \"patch\" in the file; ",
        ] {
            assert!(told.contains(part), "{part} in {told}");
        }
    }
}
