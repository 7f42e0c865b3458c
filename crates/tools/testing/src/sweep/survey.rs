//! The run without a fault: its progress, and when each moment comes.

use std::sync::Arc;

use crate::failure::Halt;
use crate::observer::Observer;
use crate::watch::{Watch, real, text_of};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Slot;

use super::named::{Watcher, holding};
use super::progress::{Change, Progress};
use super::{Moments, Sweep};

/// A moment, and the tick at whose end it comes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Moment {
    pub(crate) name: String,
    pub(crate) tick: u64,
}

/// The observer of the run without a fault.
pub(crate) struct Survey {
    sweep: Arc<Sweep>,
    config: Arc<Config>,
    /// The moments of each entry of the file, as they came.
    pub(crate) moments: Vec<Vec<Moment>>,
    seekers: Vec<Seeker>,
    progress: Progress,
    pub(crate) changes: Vec<Change>,
    told: Vec<Watcher>,
    never: Vec<Watcher>,
    /// The first tick from the first moment on at which a condition held that should not, and the place of that condition.
    pub(crate) has_told: Option<(u64, usize)>,
    pub(crate) has_broken: Option<(u64, usize)>,
    /// The ticks of the scenario, once it is over.
    pub(crate) scenario: Option<u64>,
}

/// The state of one entry of the file: the values that its signal has taken, or its condition.
#[derive(Default)]
struct Seeker {
    known: Vec<Slot>,
    watcher: Watcher,
}

/// A step signal with more values than this is a measurement.
pub(crate) const MOST_VALUES: usize = 200;

impl Survey {
    pub(crate) fn new(sweep: &Arc<Sweep>, config: &Arc<Config>) -> Self {
        let seeker = |moments: &Moments| match moments {
            Moments::EachValue(..) => Seeker::default(),
            Moments::First(named) => Seeker {
                watcher: Watcher::of(named),
                ..Seeker::default()
            },
        };
        Self {
            moments: vec![Vec::new(); sweep.moments.len()],
            seekers: sweep.moments.iter().map(seeker).collect(),
            progress: Progress::default(),
            changes: Vec::new(),
            told: Watcher::all(&sweep.told),
            never: Watcher::all(&sweep.never),
            has_told: None,
            has_broken: None,
            scenario: None,
            sweep: Arc::clone(sweep),
            config: Arc::clone(config),
        }
    }

    /// The tick after which nothing is compared any more.
    fn end(&self, scenario: u64) -> u64 {
        let ticks = self.moments.iter().flatten().map(|moment| moment.tick);
        let last = ticks.max().unwrap_or_default();
        scenario.max(last + 2 * self.sweep.within)
    }

    fn seek(&mut self, ticks: u64, watches: &[Watch], slots: &[Slot]) {
        let entries = self.seekers.iter_mut().zip(&self.sweep.moments);
        for ((seeker, moments), found) in entries.zip(&mut self.moments) {
            match moments {
                Moments::EachValue(signal, _) => {
                    let (slot, known) = (slots[*signal], &mut seeker.known);
                    if known.contains(&slot) || known.len() > MOST_VALUES {
                        continue;
                    }
                    known.push(slot);
                    let signal = &self.config.table.signals[*signal];
                    let name = format!("{} {}", signal.name, text_of(real(slot, signal), signal));
                    found.push(Moment { name, tick: ticks });
                }
                Moments::First(named) => {
                    if seeker.watcher.holds(named, watches, slots) && found.is_empty() {
                        let name = named.name.clone();
                        found.push(Moment { name, tick: ticks });
                    }
                }
            }
        }
    }
}

impl Observer for Survey {
    fn idle(&mut self, ticks: u64) {
        self.scenario = Some(ticks);
    }

    fn look(&mut self, ticks: u64, watches: &[Watch], slots: &[Slot]) -> Result<(), Halt> {
        if self.progress.look(&self.sweep.goes_on, watches, slots) {
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
        let told = holding(&mut self.told, &self.sweep.told, watches, slots);
        let broken = holding(&mut self.never, &self.sweep.never, watches, slots);
        if self.moments.iter().any(|found| !found.is_empty()) {
            self.has_told = self.has_told.or(told.map(|place| (ticks, place)));
            self.has_broken = self.has_broken.or(broken.map(|place| (ticks, place)));
        }
        if is_over {
            return Err(Halt::Over);
        }
        Ok(())
    }
}
