//! One run with a fault, compared with the run without it.

use crate::failure::Halt;
use crate::observer::Observer;
use crate::watch::{Watch, seconds};
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_driver::Driver;
use tickbus_image::signal::{Signal, Slot};

use super::Sweep;
use super::disturbance::Disturbance;
use super::judgement::Judgement;
use super::late::Late;
use super::named::{Watcher, holding};
use super::progress::{Change, Progress};

/// The observer of a run with a fault: injects it, and judges.
pub(crate) struct Trial<'a> {
    disturbances: &'a [Disturbance],
    held_back: Vec<Late>,
    /// The tick after which the fault is there.
    at: u64,
    within: u64,
    tolerance: u64,
    step: Nanos,
    signals: &'a [Signal],
    told: Vec<Watcher<'a>>,
    never: Vec<Watcher<'a>>,
    progress: Progress<'a>,
    /// The changes after the moment in the run without a fault; the first `needed` come in time.
    reference: &'a [Change],
    needed: usize,
    /// How many of them have come, and how many ticks later the last one came.
    matched: usize,
    late: u64,
    told_at: Option<u64>,
    differs: Option<String>,
    pub(crate) verdict: Option<Judgement>,
}

impl<'a> Trial<'a> {
    pub(super) fn new(
        sweep: &'a Sweep,
        (disturbances, at): (&'a [Disturbance], u64),
        changes: &'a [Change],
        (signals, step): (&'a [Signal], Nanos),
    ) -> Self {
        let after = changes.partition_point(|change| change.tick <= at);
        let reference = &changes[after..];
        Self {
            disturbances,
            held_back: Vec::new(),
            at,
            within: sweep.within,
            tolerance: sweep.tolerance,
            step,
            signals,
            told: Watcher::all(&sweep.told),
            never: Watcher::all(&sweep.never),
            progress: Progress::of(&sweep.goes_on),
            needed: reference.partition_point(|change| change.tick <= at + sweep.within),
            reference,
            matched: 0,
            late: 0,
            told_at: None,
            differs: None,
            verdict: None,
        }
    }

    /// The time since the fault, as text.
    fn since(&self, ticks: u64) -> String {
        seconds(ticks - self.at, self.step)
    }

    fn time(&self, ticks: u64) -> Nanos {
        self.step.times(i64::try_from(ticks).unwrap_or(i64::MAX))
    }

    /// Compares a change of this run with the next one of the run without a fault.
    fn follow(&mut self, ticks: u64) {
        let Some(expected) = self.reference.get(self.matched) else {
            let mut what = format!("it changes after {}", self.since(ticks));
            what.push_str(", and not any more without the fault");
            self.differs = Some(what);
            return;
        };
        let differs = self
            .progress
            .difference("is", &expected.values, self.signals);
        if let Some((here, there)) = differs {
            let after = self.since(ticks);
            self.differs = Some(format!("{here} after {after}, {there} without the fault"));
            return;
        }
        if ticks + self.tolerance < expected.tick {
            let before = &self.progress.before;
            let what = self.progress.difference("is", before, self.signals);
            let (here, _) = what.unwrap_or_default();
            let [after, usual] = [ticks, expected.tick].map(|ticks| self.since(ticks));
            self.differs = Some(format!(
                "{here} after {after} already, without the fault after {usual}"
            ));
            return;
        }
        self.matched += 1;
        self.late = ticks.saturating_sub(expected.tick);
    }

    fn judge(&mut self) -> Judgement {
        if let Some(told) = self.told_at {
            return Judgement::Told(self.time(told - self.at));
        }
        if let Some(what) = self.differs.take() {
            return Judgement::Different(what);
        }
        if self.matched < self.needed {
            let next = &self.reference[self.matched].values;
            let what = self.progress.difference("stays", next, self.signals);
            let (here, there) = what.unwrap_or_default();
            return Judgement::Still(format!("{here}, {there} without the fault"));
        }
        Judgement::Right(self.time(self.late))
    }
}

impl Observer for Trial<'_> {
    fn is_strict(&self) -> bool {
        false
    }

    fn before(
        &mut self,
        ticks: u64,
        driver: &mut Driver,
        slots: &mut [Slot],
    ) -> Result<(), Mistake> {
        if ticks == self.at {
            for disturbance in self.disturbances {
                if let Disturbance::Fault(fault) = disturbance {
                    driver.inject(fault)?;
                }
            }
        }
        for late in &mut self.held_back {
            late.apply_to(slots);
        }
        Ok(())
    }

    fn after(&mut self, slots: &mut [Slot]) {
        for late in &mut self.held_back {
            late.restore(slots);
        }
    }

    fn look(&mut self, ticks: u64, watches: &[Watch], slots: &[Slot]) -> Result<(), Halt> {
        let told = holding(&mut self.told, watches, slots);
        let broken = holding(&mut self.never, watches, slots);
        let changed = self.progress.look(watches, slots);
        if ticks == self.at {
            let late = self.disturbances.iter().filter_map(|one| match one {
                Disturbance::Late(signal, by) => Some(Late::begin(*signal, *by, slots)),
                Disturbance::Fault(_) => None,
            });
            self.held_back = late.collect();
        }
        if ticks <= self.at {
            return Ok(());
        }
        if let Some(broken) = broken {
            let what = format!("\"{}\" after {}", broken.name, self.since(ticks));
            self.verdict = Some(Judgement::Never(what));
            return Err(Halt::Over);
        }
        let end = self.at + self.within;
        if told.is_some() && ticks <= end {
            self.told_at.get_or_insert(ticks);
        } else if told.is_some() && self.differs.is_none() {
            self.differs = Some(format!(
                "the fault is told, but only after {}",
                self.since(ticks)
            ));
        }
        if changed && self.told_at.is_none() && self.differs.is_none() {
            self.follow(ticks);
        }
        let told = self.told_at.is_some();
        let settled = told || self.differs.is_some() || self.matched >= self.needed;
        if (told && self.never.is_empty())
            || (ticks >= end && settled)
            || ticks >= end + self.within
        {
            self.verdict = Some(self.judge());
            return Err(Halt::Over);
        }
        Ok(())
    }
}
