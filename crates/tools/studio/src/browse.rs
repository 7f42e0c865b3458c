//! The tags of the PLC, for a page that opens folder by folder.
//!
//! One thread has the connection, for all pages, and ends it when nobody asks for a while: PLCs accept few.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde_json::{Value as Json, json};
use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};
use tickbus_base::toml_text::printable;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_fieldbus::examine::Examination;
use tickbus_fieldbus::{Browsing, Listing, Tag, Wanted};
use tickbus_image::signal::Area;

use crate::document::parsed;

/// How long a connection is kept without a question.
const IDLE: Nanos = Nanos::from_secs(60);

/// How long a request waits for the PLC; the page then asks again. Below the patience of a page for an answer.
const PATIENCE: Duration = Duration::from_secs(4);

/// The most answers that nobody has fetched.
const KEPT: usize = 50;

/// How long an answer waits for the page that has asked. It asks again at once: after this time it has gone.
const FRESH: Nanos = Nanos::from_secs(10);

/// A folder for a page: its contents, or why there are none.
type Found = Result<Json, String>;

/// The connection for browsing, and the questions to it.
#[derive(Debug, Default)]
pub(crate) struct Tags {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    run: Option<Present>,
    /// The settings that the present connection, or the last one, was made with.
    settings: String,
    /// The number of connections so far.
    runs: u64,
    wanted: VecDeque<String>,
    current: Option<String>,
    found: BTreeMap<String, Kept>,
    /// The number of times that somebody ended the connection.
    ends: u64,
}

/// An answer that waits for its page.
#[derive(Debug)]
struct Kept {
    at: Nanos,
    found: Found,
}

/// The present connection.
#[derive(Debug)]
struct Present {
    number: u64,
    stop: Stop,
}

impl State {
    fn is_asked(&self, id: &str) -> bool {
        self.current.as_deref() == Some(id) || self.wanted.iter().any(|wanted| wanted == id)
    }

    /// Answers all questions with the reason why there is no connection.
    fn fail(&mut self, why: &str) {
        let all = self.current.take().into_iter().chain(self.wanted.drain(..));
        for id in all.collect::<Vec<_>>() {
            self.keep(id, Err(why.to_owned()));
        }
    }

    fn keep(&mut self, id: String, found: Found) {
        if self.found.len() >= KEPT {
            self.found.clear();
        }
        let at = Monotonic::shared().now();
        self.found.insert(id, Kept { at, found });
    }

    /// Takes the answer about a folder. One that nobody has fetched for long is about another time, or another PLC.
    fn fetch(&mut self, id: &str) -> Option<Found> {
        let kept = self.found.remove(id)?;
        (Monotonic::shared().now() - kept.at < FRESH).then_some(kept.found)
    }

    /// Ends the present connection, and all that is asked of it.
    fn end(&mut self) {
        if let Some(run) = self.run.take() {
            run.stop.stop();
        }
        self.current = None;
        self.wanted.clear();
        self.found.clear();
        self.ends += 1;
    }
}

impl Tags {
    /// The contents of the folder with this id, or why there are none; `None` if the PLC has not answered yet. `settings`
    /// are those of [`settings`], and the connection is made again if they are others.
    pub(crate) fn open(
        self: &Arc<Self>,
        id: &str,
        settings: &str,
        path: &Path,
        kinds: &'static Kinds,
    ) -> Option<Found> {
        let mut state = self.lock();
        let mut rest = PATIENCE;
        if state.settings != settings {
            // What is known is about another PLC, perhaps.
            state.end();
            settings.clone_into(&mut state.settings);
            self.changed.notify_all();
        }
        let ends = state.ends;
        loop {
            if state.ends != ends {
                return Some(Err("browsing was stopped; browse again".to_owned()));
            }
            if let Some(found) = state.fetch(id) {
                return Some(found);
            }
            if !state.is_asked(id) {
                state.wanted.push_back(id.to_owned());
            }
            if let Some(run) = &state.run {
                run.stop.wake();
            } else {
                let config = Config::parse(&path.display().to_string(), settings, kinds);
                let config = match config {
                    Ok(config) => config,
                    Err(mistakes) => {
                        state.wanted.clear();
                        return Some(Err(format!(
                            "the settings of the bus have mistakes; correct them first:\n{mistakes}"
                        )));
                    }
                };
                let stop = Stop::new();
                state.runs += 1;
                state.run = Some(Present {
                    number: state.runs,
                    stop: stop.clone(),
                });
                let run = Run {
                        tags: Arc::clone(self),
                        number: state.runs,
                        stop,
                        why: "the connection ended in an unexpected way; see the log of the studio, and browse again"
                            .to_owned(),
                    };
                let thread = std::thread::Builder::new().name("browse".to_owned());
                drop(state);
                // Without a thread the run is dropped, which says so.
                let _ = thread.spawn(move || run.serve(&config));
                state = self.lock();
            }
            let waited = self.changed.wait_timeout_while(state, rest, |state| {
                !state.found.contains_key(id) && state.run.is_some() && state.ends == ends
            });
            let (after, timeout) = waited.unwrap_or_else(PoisonError::into_inner);
            state = after;
            if timeout.timed_out() {
                return state.fetch(id);
            }
            // Others may have had their answers: this one waits again, but not for ever.
            rest = rest.saturating_sub(Duration::from_millis(200));
        }
    }

    /// Ends the connection.
    pub(crate) fn close(&self) {
        self.lock().end();
        self.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The text of a driver.cfg that has only what a connection needs: tags can be browsed while signals have mistakes.
///
/// # Errors
///
/// The text is no TOML.
pub(crate) fn settings(text: &str) -> Result<String, String> {
    let mut document = parsed(text)?;
    let others = document.iter().map(|(key, _)| key.to_owned());
    let others: Vec<String> = others
        .filter(|key| !["driver", "fieldbus"].contains(&key.as_str()))
        .collect();
    for key in others {
        document.remove(&key);
    }
    let bus = document
        .get_mut("fieldbus")
        .and_then(toml_edit::Item::as_table_like_mut);
    if let Some(bus) = bus {
        for key in [
            "at",
            "nodes",
            "alive",
            "heartbeat",
            "input_bytes",
            "output_bytes",
        ] {
            bus.remove(key);
        }
    }
    // A file without signals is a mistake, and this is what is browsed for.
    Ok(format!(
        "{document}\n[[signal]]\nname = \"Tag\"\naddress = \"%QX0.0\"\n"
    ))
}

/// One connection. When this goes, even by a panic, the next question makes another one.
struct Run {
    tags: Arc<Tags>,
    number: u64,
    stop: Stop,
    /// Why questions without an answer have none.
    why: String,
}

impl Run {
    fn serve(mut self, config: &Config) {
        let clock: Arc<dyn Clock> = Monotonic::shared();
        let setup = config.bus_setup(&clock, None);
        let stop = self.stop.clone();
        let mut examination = Examination::new(setup, Vec::new(), Nanos::ZERO, &stop);
        let mut visitor = Visitor {
            tags: &self.tags,
            stop: &self.stop,
            writes: config.role.areas().0,
            reads: config.role.areas().1,
            last: clock.now(),
            clock: &clock,
        };
        let ended = config.bus.browse(&mut examination, &mut visitor);
        self.why = match ended {
            Ok(()) => String::new(),
            Err(why) => printable(&why),
        };
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let mut state = self.tags.lock();
        if state.run.take_if(|run| run.number == self.number).is_none() {
            // Another connection has taken over the questions.
            return;
        }
        if self.why.is_empty() {
            // What was asked at the last moment gets another connection.
            state.current = None;
        } else {
            state.fail(&self.why);
        }
        drop(state);
        self.tags.changed.notify_all();
    }
}

struct Visitor<'a> {
    tags: &'a Tags,
    stop: &'a Stop,
    writes: Area,
    reads: Area,
    last: Nanos,
    clock: &'a Arc<dyn Clock>,
}

impl Browsing for Visitor<'_> {
    fn wanted(&mut self) -> Wanted {
        let mut state = self.tags.lock();
        // Under the lock: the questions may be another connection's already.
        if self.stop.is_stopped() {
            return Wanted::End;
        }
        if let Some(id) = state.wanted.pop_front() {
            state.current = Some(id.clone());
            return Wanted::Folder(id);
        }
        let end = self.last + IDLE;
        if self.clock.now() >= end {
            return Wanted::End;
        }
        Wanted::Rest(end)
    }

    fn found(&mut self, id: &str, listing: Result<Listing, String>) {
        self.last = self.clock.now();
        let found = match listing {
            Ok(Listing { tags, told }) => {
                let tags = tags.iter().map(|tag| self.json(tag));
                Ok(json!({ "tags": tags.collect::<Json>(), "told": printable(&told) }))
            }
            Err(why) => Err(printable(&why)),
        };
        let mut state = self.tags.lock();
        if self.stop.is_stopped() {
            return;
        }
        state.current = None;
        state.keep(id.to_owned(), found);
        drop(state);
        self.tags.changed.notify_all();
    }
}

impl Visitor<'_> {
    fn json(&self, tag: &Tag) -> Json {
        // What the machine can write is an input of the PLC.
        let area = if tag.is_writable {
            self.writes
        } else {
            self.reads
        };
        let access = match (tag.is_readable, tag.is_writable) {
            (true, true) => "read, write",
            (true, false) => "read",
            (false, true) => "write",
            (false, false) => "",
        };
        let place = tag.signal.as_ref().and_then(|signal| signal.as_ref().ok());
        let why = tag.signal.as_ref().and_then(|signal| signal.as_ref().err());
        json!({
            "name": printable(&tag.name),
            "id": tag.id,
            "opens": tag.opens,
            "type": printable(&tag.type_name),
            "access": access,
            "comment": printable(&tag.comment),
            "at": place.map(|place| &place.at),
            "dataType": place.map(|place| place.data_type.name()),
            "area": &area.to_string()[1..],
            "why": why.map(|why| printable(why)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(age: Nanos) -> Kept {
        Kept {
            at: Monotonic::shared().now() - age,
            found: Ok(json!("the tags of another time")),
        }
    }

    #[test]
    fn an_answer_that_nobody_has_fetched_is_not_shown_later() {
        let mut state = State::default();
        state.found.insert(String::new(), kept(FRESH));
        assert_eq!(state.fetch(""), None);
        state.keep(String::new(), Ok(json!("new")));
        assert_eq!(state.fetch(""), Some(Ok(json!("new"))));
    }

    #[test]
    fn an_answer_is_not_shown_as_that_of_other_settings() {
        let tags = Arc::<Tags>::default();
        let settings = "settings = \"of another PLC\"";
        settings.clone_into(&mut tags.lock().settings);
        tags.lock().found.insert(String::new(), kept(Nanos::ZERO));
        let open = |settings| tags.open("", settings, Path::new("driver.cfg"), &Kinds::LOOPBACK);
        let found = open("[fieldbus]\n");
        let why = found.expect("at once").expect_err("it has mistakes");
        assert!(why.contains("have mistakes"), "{why}");
        // Nor after somebody has ended the connection.
        settings.clone_into(&mut tags.lock().settings);
        tags.lock().found.insert(String::new(), kept(Nanos::ZERO));
        tags.close();
        assert!(open(settings).expect("at once").is_err());
    }
}
