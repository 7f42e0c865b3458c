//! The page's own thread: it requests copies of the ticks, answers requests, and releases forces that nobody keeps.

use std::sync::{Arc, Mutex, PoisonError};

use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_web::{Answer, Change, Document, Outcome, Refused, State};

use crate::exhibit::Exhibit;
use crate::metrics;
use crate::model::{Model, Shared};
use crate::order::{Order, order};

/// How often it looks while there is no viewer: for faults and states of the line.
const IDLE: Nanos = Nanos::from_millis(500);

/// The shortest time between two copies of a tick: 60 in a second.
const PERIOD: Nanos = Nanos(16_666_667);

/// How long it waits for a tick after requesting a copy.
const PATIENCE: Nanos = Nanos::from_millis(20);

/// How long the answer to a single request waits for slow ticks: the answer has to show current values, and not those
/// of half a second ago.
const LATE: Nanos = Nanos::from_millis(500);

/// How often it checks for a copy.
const LOOK: Nanos = Nanos::from_micros(500);

/// The path of the machines' pictures.
const PICTURE: &str = "/picture/";

const JSON: &str = "application/json";
const SVG: &str = "image/svg+xml";
const METRICS: &str = "text/plain; version=0.0.4; charset=utf-8";

/// A request of the room.
pub(crate) enum Wish {
    Look(Answer<State>),
    Get(String, Answer<Option<Document>>),
    Change(Change, Answer<Outcome>),
    /// A viewer with the token was active; carries the number of viewers who have it.
    Heard(usize),
}

/// The queue of requests.
#[derive(Default)]
pub(crate) struct Inbox {
    wishes: Mutex<Vec<Wish>>,
    pub(crate) stop: Stop,
}

impl Inbox {
    pub(crate) fn put(&self, wish: Wish) {
        self.lock().push(wish);
        self.stop.wake();
    }

    fn take(&self) -> Vec<Wish> {
        std::mem::take(&mut *self.lock())
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Wish>> {
        // Every single change leaves the list consistent.
        self.wishes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The data of the thread.
pub(crate) struct Keeper {
    pub(crate) inbox: Arc<Inbox>,
    pub(crate) model: Arc<Shared>,
    pub(crate) clock: Arc<dyn Clock>,
    /// When a viewer with the token was last active, and the number of viewers who have it.
    pub(crate) heard: Nanos,
    pub(crate) holders: usize,
}

impl Keeper {
    /// Runs until the page is stopped.
    pub(crate) fn run(mut self) {
        let stop = self.inbox.stop.clone();
        let mut due = self.clock.now();
        let mut looked = due - PERIOD;
        // Requests that wait for a tick, with the times when they came.
        let mut waiting: Vec<(Nanos, Wish)> = Vec::new();
        while !stop.is_stopped() {
            self.clock.wait_until(due, &stop);
            let wishes = self.inbox.take();
            let now = self.clock.now();
            for wish in &wishes {
                if let Wish::Heard(holders) = wish {
                    (self.heard, self.holders) = (now, *holders);
                }
            }
            self.let_go(now);
            let (changes, looks): (Vec<_>, Vec<_>) = wishes
                .into_iter()
                .partition(|wish| matches!(wish, Wish::Change(..) | Wish::Heard(_)));
            for wish in changes {
                self.grant(wish);
            }
            if !looks.is_empty() || now >= due {
                // However many requests come, a tick makes no more copies.
                self.clock.wait_until(looked + PERIOD, &Stop::new());
                looked = self.clock.now();
                self.look(!looks.is_empty() || !waiting.is_empty());
                due = self.clock.now() + IDLE;
            }
            let asked = looks.into_iter().map(|wish| (now, wish));
            for (since, wish) in std::mem::take(&mut waiting).into_iter().chain(asked) {
                let is_of_values =
                    matches!(&wish, Wish::Get(path, _) if !path.starts_with(PICTURE));
                if is_of_values && self.is_to_wait(since) {
                    waiting.push((since, wish));
                    due = self.clock.now();
                } else {
                    self.grant(wish);
                }
            }
        }
    }

    /// True if a tick is probably under way with newer values than those of this time.
    fn is_to_wait(&self, since: Nanos) -> bool {
        let now = self.clock.now();
        let is_late = |driver: &dyn Exhibit| {
            let sheet = driver.sheet();
            // A driver that has not ticked for this long may not tick at all.
            !sheet.is_known_at(since) && !sheet.is_missing_since(now - LATE)
        };
        now - since < LATE && self.model.with(|model| model.drivers().any(is_late))
    }

    /// Requests copies of the ticks, and takes them over.
    fn look(&self, with_line: bool) {
        let begin = self.clock.now();
        self.model.with(|model| {
            for driver in model.drivers_mut() {
                // A late copy has arrived and may be outdated; wait for the next.
                take(&mut **driver);
                let is_slow = driver.sheet().is_missing();
                driver.ask(begin);
                driver.sheet_mut().ask(begin, is_slow);
            }
        });
        // No tick wakes this, since that would take a system call.
        let nap = Stop::new();
        let end = begin + PATIENCE;
        loop {
            let is_complete = self.model.with(|model| {
                let mut is_complete = true;
                for driver in model.drivers_mut() {
                    take(&mut **driver);
                    is_complete &= driver.sheet().is_complete(begin);
                }
                is_complete
            });
            let now = self.clock.now();
            if is_complete || now >= end || self.inbox.stop.is_stopped() {
                break;
            }
            self.clock.wait_until((now + LOOK).min(end), &nap);
        }
        self.model.with(|model| {
            for driver in model.drivers_mut() {
                driver.look_at_forced();
            }
            model.update(self.clock.now(), with_line);
        });
    }

    /// Releases forces when nobody keeps them.
    fn let_go(&self, now: Nanos) {
        if self.holders > 0 {
            return;
        }
        let released = self.model.with(|model| {
            let drivers = model.drivers_mut().filter_map(|driver| {
                let grace = driver.grace()?;
                if now - self.heard <= grace {
                    return None;
                }
                let name = driver.name().to_owned();
                driver.release_all().is_ok().then_some((name, grace))
            });
            drivers.collect::<Vec<_>>()
        });
        for (name, grace) in released {
            log::info!(
                "driver \"{name}\": its forced signals are released, since nobody with the token has looked for {grace}"
            );
        }
    }

    fn grant(&self, wish: Wish) {
        match wish {
            Wish::Look(answer) => answer.give(State::Differences(Arc::clone(&self.model) as _)),
            Wish::Get(path, answer) => {
                answer.give(self.model.with(|model| document(model, &path)));
            }
            Wish::Change(change, answer) => {
                let done = order(&change).and_then(|order| self.obey(&order));
                answer.give(done);
            }
            Wish::Heard(_) => {}
        }
    }

    fn obey(&self, order: &Order) -> Result<(), Refused> {
        self.model.with(|model| {
            // A server that has sent something since the last look is not silent.
            for driver in model.drivers_mut() {
                take(&mut **driver);
            }
            let done = model.obey(order);
            // Show forced values at once, not only after the next tick.
            model.update(self.clock.now(), false);
            done
        })
    }
}

/// Takes over the requested copy, if it has come.
fn take(driver: &mut dyn Exhibit) {
    if driver.take() {
        driver.sheet_mut().has_come();
    }
}

/// The document at a path.
fn document(model: &Model, path: &str) -> Option<Document> {
    let (kind, text) = match path {
        "/signals" => (JSON, model.signals()),
        "/line" => (JSON, model.line()),
        "/metrics" => (METRICS, metrics::text(model)),
        _ => of_driver(model, path)?,
    };
    Some(Document { kind, text })
}

fn of_driver(model: &Model, path: &str) -> Option<(&'static str, String)> {
    let (id, ending) = path.strip_prefix(PICTURE)?.split_once('.')?;
    let picture = model.driver(id.parse().ok()?)?.picture()?;
    match ending {
        "svg" => Some((SVG, picture.svg.clone())),
        "json" => {
            let (left_out, mistakes) = (&picture.left_out, &picture.mistakes);
            let json = serde_json::json!({ "left_out": left_out, "mistakes": mistakes });
            Some((JSON, json.to_string()))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::Sheet;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;
    use tickbus_base::statistics::Statistics;
    use tickbus_base::time::Monotonic;
    use tickbus_fieldbus::LinkState;
    use tickbus_image::signal::Signal;

    /// A driver that ticks only when allowed, and only after the first look.
    #[derive(Debug)]
    struct Fake {
        sheet: Sheet,
        statistics: Statistics,
        is_let: Arc<std::sync::atomic::AtomicBool>,
        /// The number of looks since the request.
        looks: usize,
        is_asked: bool,
        taken: Arc<AtomicUsize>,
    }

    impl Exhibit for Fake {
        fn id(&self) -> i32 {
            1
        }

        fn name(&self) -> &'static str {
            "fake"
        }

        fn signals(&self) -> &[Signal] {
            &[]
        }

        fn sheet(&self) -> &Sheet {
            &self.sheet
        }

        fn sheet_mut(&mut self) -> &mut Sheet {
            &mut self.sheet
        }

        fn ask(&mut self, _now: Nanos) {
            (self.is_asked, self.looks) = (true, 0);
        }

        fn take(&mut self) -> bool {
            self.looks += 1;
            let has_come = self.is_asked && self.looks > 1 && self.is_let.load(Ordering::Relaxed);
            if has_come {
                self.is_asked = false;
                self.taken.fetch_add(1, Ordering::Relaxed);
            }
            has_come
        }

        fn update(&mut self, _now: Nanos, _number: u64, _with_line: bool) -> bool {
            false
        }

        fn json(&self) -> String {
            String::new()
        }

        fn state(&self) -> LinkState {
            LinkState::Running
        }

        fn statistics(&self) -> &Statistics {
            &self.statistics
        }

        fn force(&mut self, _values: &[(String, String)]) -> Result<(), Refused> {
            Ok(())
        }

        fn release(&mut self, _signals: &[String]) -> Result<(), Refused> {
            Ok(())
        }
    }

    #[test]
    fn a_driver_that_was_late_once_is_waited_for_again() {
        let clock: Arc<dyn Clock> = Monotonic::shared();
        let (is_let, taken) = (Arc::default(), Arc::<AtomicUsize>::default());
        let fake = Fake {
            sheet: Sheet::new(&[]),
            statistics: Statistics::default(),
            is_let: Arc::clone(&is_let),
            looks: 0,
            is_asked: false,
            taken: Arc::clone(&taken),
        };
        let keeper = Keeper {
            inbox: Arc::default(),
            model: Arc::new(Shared::opened(Duration::ZERO)),
            heard: clock.now(),
            holders: 0,
            clock,
        };
        keeper.model.with(|model| model.join(1, |_| Box::new(fake)));
        keeper.look(true);
        assert_eq!(taken.load(Ordering::Relaxed), 0, "it does not tick");
        is_let.store(true, Ordering::Relaxed);
        keeper.look(true);
        let words = "the copy that came late, and one of now";
        assert_eq!(taken.load(Ordering::Relaxed), 2, "{words}");
    }
}
