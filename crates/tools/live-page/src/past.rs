//! The requests about the past and about lists of signals, on threads of their own: neither a search through a long history
//! nor a slow disk must delay the present. Saving a day takes seconds, so another thread does that: meanwhile somebody scrubs.

use std::io::{self, Cursor};
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::thread::{self, JoinHandle};

use tickbus_record::{Format, Moment, Recording};
use tickbus_report::{Contents, DEFAULT_BUDGET};
use tickbus_web::{Answer, Change, Document, Outcome, Refused, Verb};

use crate::archive::{Archive, time};
use crate::exhibit::Exhibit;
use crate::lists::{self, Beside};
use crate::model::Shared;
use crate::trends;

/// The paths of the past.
const HISTORY: &str = "/history/";
const TREND: &str = "/trend/";
/// The word for files in a path: `/history/ID/save/FROM/TO.vcd`.
const SAVE: &str = "save";
/// The path of the lists of signals: their file is read and written here, since a disk can be slow.
const LISTS: &str = "/lists/";

/// The largest file that is saved, in bytes.
const LARGEST: usize = 512 << 20;

const JSON: &str = "application/json";

/// A request; `None` ends a thread.
type Wish = Option<Order>;

enum Order {
    Get(String, Answer<Option<Document>>),
    Change(Change, Answer<Outcome>),
}

/// The threads.
#[derive(Debug)]
pub(crate) struct Past {
    _looks: Worker,
    _files: Worker,
}

/// The way to the threads.
#[derive(Clone, Debug)]
pub(crate) struct Door {
    looks: Sender<Wish>,
    files: Sender<Wish>,
}

/// A thread; dropping it ends it after the request that it works on.
#[derive(Debug)]
struct Worker {
    wishes: Sender<Wish>,
    thread: Option<JoinHandle<()>>,
}

impl Past {
    pub(crate) fn open(model: Arc<Shared>) -> io::Result<(Self, Door)> {
        let looks = Worker::start("page past", Arc::clone(&model))?;
        let files = Worker::start("page files", model)?;
        let door = Door {
            looks: looks.wishes.clone(),
            files: files.wishes.clone(),
        };
        let past = Self {
            _looks: looks,
            _files: files,
        };
        Ok((past, door))
    }
}

impl Worker {
    fn start(name: &str, model: Arc<Shared>) -> io::Result<Self> {
        let (wishes, taken) = channel::<Wish>();
        let thread = thread::Builder::new().name(name.to_owned());
        let thread = thread.spawn(move || {
            // Doors may be left after the end, so the end of the queue is no signal.
            while let Ok(Some(order)) = taken.recv() {
                match order {
                    // Who scrubs or has left does not wait for the moments in between.
                    Order::Get(path, answer) if answer.is_wanted() => {
                        answer.give(document(&model, &path));
                    }
                    Order::Get(..) => {}
                    Order::Change(order, answer) => answer.give(change(&model, &order)),
                }
            }
        })?;
        Ok(Self {
            wishes,
            thread: Some(thread),
        })
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // A thread that has ended is not there to be told.
        let _ = self.wishes.send(None);
        if let Some(thread) = self.thread.take() {
            // A panic has been reported already.
            let _ = thread.join();
        }
    }
}

impl Door {
    /// True if a path is one of the past.
    pub(crate) fn leads_to(path: &str) -> bool {
        [HISTORY, TREND, LISTS]
            .iter()
            .any(|begin| path.starts_with(begin))
    }

    pub(crate) fn ask(&self, path: &str, answer: Answer<Option<Document>>) {
        // After the end nobody answers, which the room reports.
        let _ = self
            .to(path)
            .send(Some(Order::Get(path.to_owned(), answer)));
    }

    /// The queue for a path.
    fn to(&self, path: &str) -> &Sender<Wish> {
        let mut parts = path.strip_prefix(HISTORY).unwrap_or_default().split('/');
        if parts.nth(1) == Some(SAVE) {
            &self.files
        } else {
            &self.looks
        }
    }

    pub(crate) fn change(&self, change: Change, answer: Answer<Outcome>) {
        // As above.
        let _ = self.looks.send(Some(Order::Change(change, answer)));
    }
}

/// The document at a path.
fn document(model: &Shared, path: &str) -> Option<Document> {
    if let Some(path) = path.strip_prefix(TREND) {
        let (id, path) = path.split_once('/')?;
        let text = trends::document(&*archive(model, id)?, path)?;
        return Some(Document { kind: JSON, text });
    }
    if let Some(id) = path.strip_prefix(LISTS) {
        let text = lists::document(&*beside(model, id)?);
        return Some(Document { kind: JSON, text });
    }
    let mut parts = path.strip_prefix(HISTORY)?.split('/');
    let id = parts.next()?;
    let archive = archive(model, id)?;
    let parts: Vec<&str> = parts.collect();
    let text = match parts[..] {
        [] => archive.overview(),
        [kind, place] => archive.state(moment(kind, place)?, None)?,
        [kind, place, "since", tick] => {
            archive.state(moment(kind, place)?, Some(tick.parse().ok()?))?
        }
        ["next", what, tick] => archive.jump(what, true, tick.parse().ok()?)?,
        ["last", what, tick] => archive.jump(what, false, tick.parse().ok()?)?,
        [way @ ("next" | "last"), "when", tick, conditions] => {
            archive.when(conditions, way == "next", tick.parse().ok()?)
        }
        [SAVE, from, file] => {
            let id = id.parse().ok()?;
            let title = model.with(|model| model.driver(id).map(|it| it.name().to_owned()))?;
            return save(&archive, &title, from, file);
        }
        _ => return None,
    };
    Some(Document { kind: JSON, text })
}

/// Changes a list: `/lists/ID/list` or `/lists/ID/set`.
fn change(model: &Shared, change: &Change) -> Outcome {
    let path = change.path.strip_prefix(LISTS).unwrap_or_default();
    let found = path.split_once('/');
    let found = found.and_then(|(id, what)| Some((beside(model, id)?, what)));
    match (found, change.verb) {
        (Some((beside, what)), Verb::Put) => lists::change(&beside, what, &change.body),
        (Some(_), Verb::Delete) => Err(Refused {
            status: 405,
            text: "a list is removed by PUT with \"is\": null, and how it was".to_owned(),
        }),
        (None, _) => Err(Refused {
            status: 404,
            text:
                "no driver with this id has a file for lists; PUT /lists/ID/list or /lists/ID/set"
                    .to_owned(),
        }),
    }
}

/// The file of the lists of the exhibit with this id.
fn beside(model: &Shared, id: &str) -> Option<Arc<Beside>> {
    let id = id.parse().ok()?;
    model.with(|model| model.driver(id).and_then(Exhibit::lists))
}

/// The past of the exhibit with this id.
fn archive(model: &Shared, id: &str) -> Option<Arc<Archive>> {
    let id = id.parse().ok()?;
    model.with(|model| model.driver(id).and_then(Exhibit::archive))
}

fn moment(kind: &str, place: &str) -> Option<Moment> {
    match kind {
        "at" => time(place).map(Moment::Time),
        "tick" => place.parse().ok().map(Moment::Tick),
        "after" => place.parse().ok().map(Moment::After),
        _ => None,
    }
}

/// The ticks from a time to that in the name of the file, as a file. A report has this title.
fn save(archive: &Archive, title: &str, from: &str, file: &str) -> Option<Document> {
    let (to, ending) = file.rsplit_once('.')?;
    let span = (time(from)?, time(to)?);
    let of = |format| {
        let bytes = archive.history.file(format, span, LARGEST)?;
        String::from_utf8(bytes).ok()
    };
    let (kind, text) = match ending {
        "vcd" => ("text/plain; charset=utf-8", of(Format::Vcd)?),
        "csv" => ("text/csv; charset=utf-8", of(Format::Csv)?),
        "html" => ("text/html; charset=utf-8", report(title, of(Format::Vcd)?)?),
        _ => return None,
    };
    Some(Document { kind, text })
}

/// The report of a recording.
fn report(title: &str, vcd: String) -> Option<String> {
    let source = "recording of the live page";
    let vcd = Box::new(Cursor::new(vcd.into_bytes()));
    let mut recording = Recording::read(source, Format::Vcd, vcd, None).ok()?;
    let (run, _) = tickbus_report::read(&mut recording, DEFAULT_BUDGET);
    let contents = Contents {
        title,
        source,
        run: &run,
        steps: None,
        faults: &[],
        statistics: None,
        texts: &[],
        tables: &[],
    };
    let mut out = Vec::new();
    tickbus_report::write(&contents, &mut out).ok()?;
    String::from_utf8(out).ok()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use tickbus_record::Tick;

    use super::*;
    use crate::recorded::Recorded;

    /// All ticks of a recording, with the names of its signals.
    fn ticks(recording: &mut Recording) -> (Vec<String>, Vec<Tick>) {
        let columns = recording.columns().clone();
        let mut tick = Tick::new(&columns);
        let mut ticks = Vec::new();
        while recording.next(&mut tick).expect("it is whole") {
            ticks.push(tick.clone());
        }
        (
            columns
                .columns
                .iter()
                .map(tickbus_record::Column::title)
                .collect(),
            ticks,
        )
    }

    #[test]
    fn nobody_who_looks_waits_for_a_file_that_is_saved() {
        let (looks, files) = (channel().0, channel().0);
        let door = Door { looks, files };
        for (path, is_file) in [
            ("/history/1", false),
            ("/history/1/at/5", false),
            ("/history/1/next/when/0/save", false),
            ("/trend/1/save/0", false),
            ("/lists/1", false),
            ("/history/1/save/0/9.vcd", true),
            ("/history/1/save/0/9.html", true),
        ] {
            assert_eq!(
                std::ptr::eq(door.to(path), &raw const door.files),
                is_file,
                "{path}"
            );
        }
    }

    #[test]
    fn files_without_a_driver_and_types_are_saved_and_read_again() {
        const CSV: &str = "bus.tick,bus.time_ns,bus.status,bus.dropped,Lamp,Lamp.edges\n\
                           1,1000000,0,0,1,0\n2,2000000,0,0,0,3\n";
        let icarus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/it/vcd/icarus.vcd");
        let foreign = || Recording::open_any(&icarus, None).expect("VCD");
        let csv = || Recording::read("run.csv", Format::Csv, Box::new(Cursor::new(CSV)), None);
        let csv = || csv().expect("CSV");
        let opens: [(&str, &dyn Fn() -> Recording); 2] = [("run.vcd", &foreign), ("run.csv", &csv)];
        for (name, open) in opens {
            let recorded = Recorded::read(&mut open(), name, None, &[], 1 << 20).expect("ticks");
            let save = |file: &str| {
                let document = save(&recorded.archive, name, "0", file);
                document.unwrap_or_else(|| panic!("{name} as {file}")).text
            };
            let vcd = Box::new(Cursor::new(save("9.vcd").into_bytes()));
            let again = Recording::read("again", Format::Vcd, vcd, None);
            let mut again = again.unwrap_or_else(|error| panic!("{name}: {error}"));
            let text = |ticks: (Vec<String>, Vec<Tick>)| format!("{ticks:?}");
            assert_eq!(text(ticks(&mut again)), text(ticks(&mut open())), "{name}");
            let report = save("9.html");
            assert!(report.contains(&format!("<h1>{name}</h1>")), "{name}");
        }
    }
}
