//! One run with a fault, compared with the run without it.

use std::sync::Arc;

use crate::failure::{Failure, Halt};
use crate::observer::Observer;
use crate::watch::{Watch, moment, seconds};
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_driver::Driver;
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{Signal, Slot};

use super::disturbance::Disturbance;
use super::judgement::Judgement;
use super::late::Late;
use super::named::{Watcher, holding};
use super::plan::{Cell, Plan};
use super::progress::{Change, Mark, Progress};

/// The observer of a run with a fault: injects it, and judges.
pub(crate) struct Trial {
    plan: Arc<Plan>,
    row: usize,
    held_back: Vec<Late>,
    /// The tick after which the fault is there.
    at: u64,
    step: Nanos,
    config: Arc<Config>,
    told: Vec<Watcher>,
    never: Vec<Watcher>,
    progress: Progress,
    /// How many changes have come before the moment.
    before: usize,
    /// Which changes of the run without a fault come after the moment; the first `needed` of them come in time.
    after: usize,
    needed: usize,
    /// How many of them have come, and how many ticks later the last one came.
    matched: usize,
    late: u64,
    told_at: Option<u64>,
    differs: Option<String>,
    pub(crate) verdict: Option<Judgement>,
}

impl Trial {
    /// The observer of a run of the plan, with steps of this length.
    pub(crate) fn new(plan: &Arc<Plan>, cell: &Cell, config: &Arc<Config>, step: Nanos) -> Self {
        let (sweep, at) = (&plan.sweep, plan.moments[cell.moment].tick);
        let by = |tick| plan.changes.partition_point(|change| change.tick <= tick);
        let after = by(at);
        Self {
            row: cell.row,
            held_back: Vec::new(),
            at,
            step,
            config: Arc::clone(config),
            told: Watcher::all(&sweep.told),
            never: Watcher::all(&sweep.never),
            progress: Progress::default(),
            before: 0,
            after,
            needed: by(at + sweep.within) - after,
            matched: 0,
            late: 0,
            told_at: None,
            differs: None,
            verdict: None,
            plan: Arc::clone(plan),
        }
    }

    fn disturbances(&self) -> &[Disturbance] {
        &self.plan.sweep.rows[self.row].disturbances
    }

    /// The change of the run without a fault that comes next; `None` after the last one.
    fn expected(&self) -> Option<&Change> {
        self.plan.changes.get(self.after + self.matched)
    }

    /// The first mark whose value is not that of `other`, in words.
    fn difference(&self, verb: &str, other: &[Slot]) -> Option<(String, String)> {
        let words: (&[Mark], &[Signal]) = (&self.plan.sweep.goes_on, &self.config.table.signals);
        self.progress.difference(verb, other, words)
    }

    /// The time since the fault, as text.
    fn since(&self, ticks: u64) -> String {
        seconds(ticks - self.at, self.step)
    }

    fn time(&self, ticks: u64) -> Nanos {
        self.step.times(i64::try_from(ticks).unwrap_or(i64::MAX))
    }

    /// Fails if this run is another one than that without a fault although its fault has not come yet.
    fn check_beginning(&mut self, ticks: u64, changed: bool) -> Result<(), Halt> {
        let next = self.plan.changes.get(self.before);
        let is_same = match next.filter(|change| change.tick == ticks) {
            Some(change) => changed && change.values == self.progress.values,
            None => !changed,
        };
        if is_same {
            self.before += usize::from(changed);
            return Ok(());
        }
        let what = format!(
            "{}: this run differs from the one without a fault before its fault has come; begin each run with a new \
             machine, and use neither chance nor the time of day",
            moment(ticks, self.step)
        );
        Err(Halt::Failed(Failure {
            place: self.plan.sweep.place,
            what,
            more: Vec::new(),
            hint: None,
        }))
    }

    /// Compares a change of this run with the next one of the run without a fault.
    fn follow(&mut self, ticks: u64) {
        let after = self.since(ticks);
        let Some(expected) = self.expected() else {
            self.differs = Some(format!(
                "it changes after {after}, and not any more without the fault"
            ));
            return;
        };
        let usual = expected.tick;
        if let Some((here, there)) = self.difference("is", &expected.values) {
            self.differs = Some(format!("{here} after {after}, {there} without the fault"));
            return;
        }
        if ticks + self.plan.sweep.tolerance < usual {
            let what = self.difference("is", &self.progress.before);
            let (here, _) = what.unwrap_or_default();
            let usual = self.since(usual);
            self.differs = Some(format!(
                "{here} after {after} already, without the fault after {usual}"
            ));
            return;
        }
        self.matched += 1;
        self.late = ticks.saturating_sub(usual);
    }

    fn judge(&mut self) -> Judgement {
        if let Some(told) = self.told_at {
            return Judgement::Told(self.time(told - self.at));
        }
        if let Some(what) = self.differs.take() {
            return Judgement::Different(what);
        }
        if self.matched < self.needed {
            let next = self.expected();
            let what = next.and_then(|next| self.difference("stays", &next.values));
            let (here, there) = what.unwrap_or_default();
            return Judgement::Still(format!("{here}, {there} without the fault"));
        }
        Judgement::Right(self.time(self.late))
    }
}

impl Observer for Trial {
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
            for disturbance in self.disturbances() {
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
        let sweep = &self.plan.sweep;
        let told = holding(&mut self.told, &sweep.told, watches, slots);
        let broken = holding(&mut self.never, &sweep.never, watches, slots);
        let changed = self.progress.look(&sweep.goes_on, watches, slots);
        if ticks == self.at {
            let late = self.disturbances().iter().filter_map(|one| match one {
                Disturbance::Late(signal, by) => Some(Late::begin(*signal, *by, slots)),
                Disturbance::Fault(_) => None,
            });
            self.held_back = late.collect();
        }
        if ticks <= self.at {
            return self.check_beginning(ticks, changed);
        }
        if let Some(broken) = broken {
            let name = &self.plan.sweep.never[broken].name;
            let what = format!("\"{name}\" after {}", self.since(ticks));
            self.verdict = Some(Judgement::Never(what));
            return Err(Halt::Over);
        }
        let within = self.plan.sweep.within;
        let end = self.at + within;
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
        if (told && self.never.is_empty()) || (ticks >= end && settled) || ticks >= end + within {
            self.verdict = Some(self.judge());
            return Err(Halt::Over);
        }
        Ok(())
    }
}
