//! The run without a fault: its progress, and when each moment comes.

use crate::failure::Halt;
use crate::observer::Observer;
use crate::watch::{Watch, real, text_of};
use tickbus_image::signal::{Signal, Slot};

use super::named::{Named, Watcher, holding};
use super::progress::{Change, Progress};
use super::{Moments, Sweep};

/// A moment, and the tick at whose end it comes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Moment {
    pub(crate) name: String,
    pub(crate) tick: u64,
}

/// The observer of the run without a fault.
pub(crate) struct Survey<'a> {
    signals: &'a [Signal],
    /// The moments of each entry of the file, as they came.
    pub(crate) moments: Vec<Vec<Moment>>,
    seekers: Vec<Seeker<'a>>,
    progress: Progress<'a>,
    pub(crate) changes: Vec<Change>,
    told: Vec<Watcher<'a>>,
    never: Vec<Watcher<'a>>,
    /// The first tick from the first moment on at which a condition held that should not, and which one.
    pub(crate) has_told: Option<(u64, &'a Named)>,
    pub(crate) has_broken: Option<(u64, &'a Named)>,
    within: u64,
    /// The ticks of the scenario, once it is over.
    pub(crate) scenario: Option<u64>,
}

/// The values or the condition that one entry of the file waits for.
enum Seeker<'a> {
    Values(usize, Vec<Slot>),
    First(Watcher<'a>),
}

/// A step signal with more values than this is a measurement.
pub(crate) const MOST_VALUES: usize = 200;

impl<'a> Survey<'a> {
    pub(crate) fn new(sweep: &'a Sweep, signals: &'a [Signal]) -> Self {
        let seeker = |moments: &'a Moments| match moments {
            Moments::EachValue(signal, _) => Seeker::Values(*signal, Vec::new()),
            Moments::First(named) => {
                let mut watchers = Watcher::all(std::slice::from_ref(named));
                Seeker::First(watchers.remove(0))
            }
        };
        Self {
            signals,
            moments: vec![Vec::new(); sweep.moments.len()],
            seekers: sweep.moments.iter().map(seeker).collect(),
            progress: Progress::of(&sweep.goes_on),
            changes: Vec::new(),
            told: Watcher::all(&sweep.told),
            never: Watcher::all(&sweep.never),
            has_told: None,
            has_broken: None,
            within: sweep.within,
            scenario: None,
        }
    }

    /// The tick after which nothing is compared any more.
    fn end(&self, scenario: u64) -> u64 {
        let ticks = self.moments.iter().flatten().map(|moment| moment.tick);
        let last = ticks.max().unwrap_or_default();
        scenario.max(last + 2 * self.within)
    }

    fn seek(&mut self, ticks: u64, watches: &[Watch], slots: &[Slot]) {
        for (seeker, found) in self.seekers.iter_mut().zip(&mut self.moments) {
            match seeker {
                Seeker::Values(signal, known) => {
                    let slot = slots[*signal];
                    if known.contains(&slot) || known.len() > MOST_VALUES {
                        continue;
                    }
                    known.push(slot);
                    let signal = &self.signals[*signal];
                    let name = format!("{} {}", signal.name, text_of(real(slot, signal), signal));
                    found.push(Moment { name, tick: ticks });
                }
                Seeker::First(watcher) => {
                    if watcher.holds(watches, slots) && found.is_empty() {
                        let name = watcher.named.name.clone();
                        found.push(Moment { name, tick: ticks });
                    }
                }
            }
        }
    }
}

impl Observer for Survey<'_> {
    fn idle(&mut self, ticks: u64) {
        self.scenario = Some(ticks);
    }

    fn look(&mut self, ticks: u64, watches: &[Watch], slots: &[Slot]) -> Result<(), Halt> {
        if self.progress.look(watches, slots) {
            self.changes.push(Change {
                tick: ticks,
                values: self.progress.values.clone(),
            });
        }
        let is_over = self
            .scenario
            .is_some_and(|scenario| ticks >= self.end(scenario));
        if self.scenario.is_none() {
            self.seek(ticks, watches, slots);
        }
        let told = holding(&mut self.told, watches, slots);
        let broken = holding(&mut self.never, watches, slots);
        if self.moments.iter().any(|found| !found.is_empty()) {
            self.has_told = self.has_told.or(told.map(|named| (ticks, named)));
            self.has_broken = self.has_broken.or(broken.map(|named| (ticks, named)));
        }
        if is_over {
            return Err(Halt::Over);
        }
        Ok(())
    }
}
