//! A sweep whose machine and scenario are code in another language.
//!
//! That code opens the driver and lets it tick; a [`Session`] sees each tick and injects the fault. What a fault is, when
//! it comes, and how a run is judged is the same as in a test file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Mistakes, read_text};
use tickbus_driver::Driver;
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{Signal, Slot};
use tickbus_report::{Sweeps, link, write_sweeps_file};

use super::failure::Halt;
use super::model_faults::ModelFaults;
use super::observer::Observer;
use super::sections::Reader;
use super::sweep::{
    Accepted, Cell, CellMark, Judgement, Plan, Scenario, Survey, Sweep, Tally, Trial, matrix,
    swept, swept_run, verdict_hash,
};
use super::sweeping::{Refused, planned};
use super::watch::Watch;

/// The runs of a sweep, one after the other.
pub struct Session {
    name: String,
    sweep: Arc<Sweep>,
    config: Arc<Config>,
    step: Nanos,
    plan: Option<Arc<Plan>>,
    accepted: Accepted,
    run: Option<Run>,
    /// The verdicts so far, by the index of the cell; or why a run could not be judged.
    verdicts: Vec<Option<Verdict>>,
}

type Verdict = Result<Judgement, String>;

/// The run that takes place now.
struct Run {
    observed: Observed,
    ticks: u64,
    watches: Vec<Watch>,
    is_over: bool,
    /// Why the run could not be judged.
    wrong: Option<String>,
}

enum Observed {
    WithoutFault(Survey),
    Fault(usize, Trial),
}

/// A run that is over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SessionRun {
    /// True if the verdict is right, or accepted.
    pub passes: bool,
    /// The verdict in one word; `wrong` if the run could not be judged.
    pub word: &'static str,
    /// The verdict as a sentence, or why there is none; if it does not pass and another one was accepted, with that one.
    pub what: String,
}

impl Observed {
    fn observer(&mut self) -> &mut dyn Observer {
        match self {
            Self::WithoutFault(survey) => survey,
            Self::Fault(_, trial) => trial,
        }
    }
}

impl Run {
    /// Judges the present values, unless the run is over: its verdict stands, whatever a scenario does then.
    fn look(&mut self, slots: &[Slot]) {
        if self.is_over {
            return;
        }
        let observer = self.observed.observer();
        if let Err(halt) = observer.look(self.ticks, &self.watches, slots) {
            self.is_over = true;
            if let Halt::Failed(failure) = halt {
                self.wrong = Some(failure.what);
            }
        }
    }
}

impl Session {
    /// Reads the keys of a sweep but for `scenario`, about the signals of this driver and the faults that its model has
    /// declared; the driver ticks every `step`. Paths are seen from `folder`. Messages and the file of accepted verdicts
    /// call the sweep `name`, which is a file name; `accept` is the command that accepts all verdicts.
    ///
    /// # Errors
    ///
    /// With every mistake in the keys.
    pub fn read(
        (name, keys): (&str, &str),
        accept: &'static str,
        folder: &Path,
        driver: &Driver,
        step: Nanos,
    ) -> Result<Self, Mistakes> {
        let config = Arc::clone(driver.config());
        let mut collector = Collector::new(name, keys);
        let accepted = format!("accepted/{name}.toml");
        let read = read_text(&mut collector, keys, |table| {
            let reader = Reader {
                table: &config.table,
                role: config.role,
                step,
                folder,
                config: &config,
                model: ModelFaults::Declared(driver.board()),
                counted: None,
            };
            let source = Scenario::Elsewhere {
                accepted: &accepted,
                accept,
            };
            reader.sweep(table, source)
        });
        if let Some(mistakes) = collector.finish() {
            return Err(mistakes);
        }
        let sweep = read.expect("what is not read has a mistake");
        Ok(Self {
            name: name.to_owned(),
            sweep: Arc::new(sweep),
            config,
            step,
            plan: None,
            accepted: Accepted::default(),
            run: None,
            verdicts: Vec::new(),
        })
    }

    /// Begins a run: that of the cell with this index, or without one that without a fault. The driver has just been
    /// opened, and the slots have their initial values.
    ///
    /// # Errors
    ///
    /// There is no such cell, or no plan yet.
    pub fn begin(&mut self, cell: Option<usize>, slots: &[Slot]) -> Result<(), String> {
        let signals = &self.config.table.signals;
        let observed = match cell {
            None => Observed::WithoutFault(Survey::new(&self.sweep, &self.config)),
            Some(index) => {
                let plan = self.plan.as_ref();
                let plan = plan.ok_or("the run without a fault comes first")?;
                let cell = plan.cells.get(index).ok_or("the sweep has no such run")?;
                Observed::Fault(index, Trial::new(plan, cell, &self.config, self.step))
            }
        };
        let watch = |(signal, slot): (&Signal, &Slot)| Watch::new(*slot, signal);
        let mut run = Run {
            observed,
            ticks: 0,
            watches: signals.iter().zip(slots).map(watch).collect(),
            is_over: false,
            wrong: None,
        };
        run.look(slots);
        self.run = Some(run);
        Ok(())
    }

    /// Injects the fault if its moment has come. Call this right before each exchange, when the machine has set its
    /// sensors.
    ///
    /// # Errors
    ///
    /// The driver refuses the fault.
    pub fn before(&mut self, driver: &mut Driver, slots: &mut [Slot]) -> Result<(), Mistake> {
        match &mut self.run {
            Some(run) => run.observed.observer().before(run.ticks, driver, slots),
            None => Ok(()),
        }
    }

    /// Looks at the values of an exchange, right after it. Returns true if the run is over.
    pub fn after(&mut self, slots: &mut [Slot]) -> bool {
        let Some(run) = &mut self.run else {
            return true;
        };
        run.observed.observer().after(slots);
        run.ticks += 1;
        let signals = self.config.table.signals.iter();
        for (watch, (slot, signal)) in run.watches.iter_mut().zip(slots.iter().zip(signals)) {
            watch.look(*slot, signal, run.ticks);
        }
        run.look(slots);
        self.conclude()
    }

    /// Ends the scenario; the run ticks on until it is over. Returns true if it is over now.
    pub fn idle(&mut self, slots: &[Slot]) -> bool {
        if let Some(run) = &mut self.run {
            run.observed.observer().idle(run.ticks);
            run.look(slots);
        }
        self.conclude()
    }

    /// Keeps the verdict of a run that is over. Returns true if it is.
    fn conclude(&mut self) -> bool {
        let Some(run) = &mut self.run else {
            return true;
        };
        if run.is_over
            && let Observed::Fault(index, trial) = &mut run.observed
            && let Some(verdict) = run.wrong.take().map(Err).or(trial.verdict.take().map(Ok))
        {
            self.verdicts[*index] = Some(verdict);
        }
        run.is_over
    }

    /// Lists the runs with a fault, after the run without one; reads the accepted verdicts, which may be wrong if they
    /// are about to be rewritten.
    ///
    /// # Errors
    ///
    /// A moment never came, a condition held that only a fault may cause, or the accepted verdicts are wrong.
    pub fn plan(&mut self, rewriting: bool) -> Result<Arc<Plan>, Refused> {
        if let Some(plan) = &self.plan {
            return Ok(Arc::clone(plan));
        }
        let Some(Run {
            observed: Observed::WithoutFault(survey),
            ticks,
            is_over: true,
            ..
        }) = self.run.take()
        else {
            let what = "the run without a fault is not over, so nothing was judged";
            let list = Mistakes::of_file(&self.name, what, "let it end first");
            return Err(Refused::Mistakes(list));
        };
        let plan = planned(&self.name, &self.sweep, survey, (self.step, ticks))?;
        self.accepted = Accepted::load(&self.name, &plan, rewriting).map_err(Refused::Mistakes)?;
        self.verdicts = vec![None; plan.cells.len()];
        let plan = Arc::new(plan);
        self.plan = Some(Arc::clone(&plan));
        Ok(plan)
    }

    /// The cells that were judged, each with its verdict and whether it passes.
    fn judged(&self) -> impl Iterator<Item = (&Plan, &Cell, Result<&Judgement, &str>, bool)> {
        let plan = self.plan.as_deref().into_iter();
        let cells = plan.flat_map(|plan| plan.cells.iter().map(move |cell| (plan, cell)));
        cells.filter_map(|(plan, cell)| {
            let verdict = self.verdicts[cell.index].as_ref()?;
            let verdict = verdict.as_ref().map_err(String::as_str);
            let passes = verdict.is_ok_and(|found| self.accepted.passes(plan, cell, found));
            Some((plan, cell, verdict, passes))
        })
    }

    /// A run with a fault; `None` if it is not over.
    pub fn result(&self, cell: usize) -> Option<SessionRun> {
        let (plan, verdict) = (self.plan.as_ref()?, self.verdicts.get(cell)?.as_ref()?);
        let cell = &plan.cells[cell];
        let verdict = match verdict {
            Ok(verdict) => verdict,
            Err(why) => {
                return Some(SessionRun {
                    passes: false,
                    word: "wrong",
                    what: format!("this run cannot be judged: {why}"),
                });
            }
        };
        let passes = self.accepted.passes(plan, cell, verdict);
        let accepted = self.accepted.verdict(plan, cell);
        let what = match accepted {
            Some(word) if !passes => format!("{verdict}\naccepted: {word}"),
            _ => verdict.to_string(),
        };
        Some(SessionRun {
            passes,
            word: verdict.word(),
            what,
        })
    }

    /// The matrix of the runs so far, with the counts and the hash below it.
    pub fn summary(&self) -> String {
        let Some(plan) = &self.plan else {
            return String::new();
        };
        let mut marks = vec![None; plan.cells.len()];
        let mut tally = Tally::default();
        for (plan, cell, verdict, passes) in self.judged() {
            tally.add((plan, &self.accepted), cell, (verdict.ok(), passes));
            marks[cell.index] = Some(CellMark::of(verdict.ok(), passes));
        }
        format!(
            "{}\n{tally} hash={}\n",
            matrix(plan, &marks, false),
            self.hash()
        )
    }

    /// The hash over the verdicts so far.
    fn hash(&self) -> String {
        let pairs = self.judged();
        let pairs =
            pairs.filter_map(|(_, cell, verdict, _)| Some((cell.name.as_str(), verdict.ok()?)));
        format!("{:016x}", verdict_hash(pairs))
    }

    /// Writes the page of the runs so far to `page`. `again` is the command that repeats a run, with `{}` in the place of
    /// its name; `report` returns the report about the recording of the run with this index.
    ///
    /// # Errors
    ///
    /// Nothing was judged, or the page cannot be written.
    pub fn page(
        &self,
        page: &Path,
        again: &str,
        report: impl Fn(usize) -> Option<PathBuf>,
    ) -> Result<(), String> {
        let plan = self.plan.as_ref();
        let plan = plan.ok_or("nothing was judged, so there is no page")?;
        let mut runs = vec![None; plan.cells.len()];
        for (_, cell, verdict, passes) in self.judged() {
            let report = report(cell.index).and_then(|report| link(page, &report));
            runs[cell.index] = Some(swept_run(cell, verdict, passes, report));
        }
        let sweeps = Sweeps {
            title: format!("Sweep of {}", self.name),
            hash: self.hash(),
            files: vec![swept((&self.name, again), (plan, &self.accepted), runs)],
        };
        let written = page.parent().map_or(Ok(()), std::fs::create_dir_all);
        written
            .and_then(|()| write_sweeps_file(&sweeps, page))
            .map(drop)
            .map_err(|error| {
                let page = page.display();
                format!(
                    "{page}: the page cannot be written: {error}; check the folder and the disk"
                )
            })
    }

    /// Writes all verdicts as accepted. Returns the file.
    ///
    /// # Errors
    ///
    /// A run was not made or not judged, or the file cannot be written.
    pub fn accept(&mut self) -> Result<PathBuf, String> {
        let plan = self.plan.as_ref();
        let plan = plan.ok_or("nothing was judged, so nothing was accepted")?;
        let verdicts: Vec<Judgement> = self.verdicts.iter().flatten().flatten().cloned().collect();
        let missing = plan.cells.len() - verdicts.len();
        if missing > 0 {
            return Err(format!(
                "{missing} of {} runs were not made or could not be judged, so nothing was accepted; make all of them",
                plan.cells.len()
            ));
        }
        let file = plan.accepted_file();
        let text = self.accepted.rewritten(&self.name, plan, &verdicts);
        let written = file.parent().map_or(Ok(()), std::fs::create_dir_all);
        written
            .and_then(|()| std::fs::write(file, text))
            .map_err(|error| {
                let file = file.display();
                format!(
                    "{file}: the accepted verdicts cannot be written: {error}; check the folder"
                )
            })?;
        self.accepted =
            Accepted::load(&self.name, plan, true).map_err(|wrong| wrong.to_string())?;
        Ok(file.to_owned())
    }
}
