//! Planning a sweep by the run without a fault, and making its runs.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Mistakes, PlacedMistake};
use tickbus_driver::DriverError;

use super::plant::Plant;
use super::suite::Suite;
use super::sweep::{
    Cell, Judgement, MOST_VALUES, Moment, Moments, Named, Plan, Survey, Sweep, Trial,
};
use super::test::TextPosition;
use super::watch::{moment, seconds};

/// The result of one run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Judged {
    /// The verdict; without one, why the run could not be judged.
    pub judgement: Result<Judgement, String>,
    /// Ticks that have passed.
    pub ticks: u64,
}

/// Why nothing was judged.
#[derive(Debug)]
pub enum Refused {
    /// The scenario, the sweep or its accepted verdicts are wrong.
    Mistakes(Mistakes),
    /// The PLC program and the driver.cfg do not fit, or a recording cannot be read.
    Driver(DriverError),
}

impl Refused {
    /// The number of mistakes.
    pub fn count(&self) -> usize {
        match self {
            Self::Mistakes(mistakes) => mistakes.len(),
            Self::Driver(_) => 1,
        }
    }
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mistakes(mistakes) => mistakes.fmt(f),
            Self::Driver(error) => error.fmt(f),
        }
    }
}

impl Suite {
    /// Runs the scenario of the file's sweep without a fault, and lists the runs with one.
    ///
    /// # Errors
    ///
    /// The scenario fails without a fault, or it says what the sweep takes for the sign of one, or a moment never comes.
    pub fn plan(&self, sweep: &Arc<Sweep>) -> Result<Plan, Refused> {
        let bench = &self.bench;
        let mut survey = Survey::new(sweep, &bench.config);
        let begin = (&sweep.initial[..], sweep.place);
        let ran = self
            .play(begin, None, Some(&mut survey), |stand| {
                sweep.scenario.iter().try_for_each(|step| stand.run(step))?;
                stand.idle(sweep.place)
            })
            .map_err(Refused::Driver)?;
        if let Some(failure) = ran.failure {
            let what = format!(
                "the scenario fails without a fault, so nothing was judged: {}",
                failure.what
            );
            let right = "let the scenario pass as a [[test]] first";
            let found = vec![(failure.place, what, right.to_owned())];
            return Err(refused(&self.file, found));
        }
        planned(&self.file, sweep, survey, (bench.step, ran.ticks))
    }

    /// Makes one run of the plan; with a path, records the run to that file.
    ///
    /// # Errors
    ///
    /// The PLC program cannot be started again, or the recording cannot be written.
    pub fn judge(
        &self,
        plan: &Arc<Plan>,
        cell: &Cell,
        record: Option<&Path>,
    ) -> Result<Judged, DriverError> {
        let (sweep, bench) = (&plan.sweep, &self.bench);
        let mut trial = Trial::new(plan, cell, &bench.config, bench.step);
        let begin = (&sweep.initial[..], sweep.place);
        let ran = self.play(begin, record, Some(&mut trial), |stand| {
            sweep.scenario.iter().try_for_each(|step| stand.run(step))?;
            stand.idle(sweep.place)
        })?;
        let judgement = match (ran.failure, trial.verdict) {
            (Some(failure), _) => Err(failure.what),
            (None, Some(verdict)) => Ok(verdict),
            (None, None) => Err("the run ended too early".to_owned()),
        };
        Ok(Judged {
            judgement,
            ticks: ran.ticks,
        })
    }

    /// True if several runs may take place at once: an FMU in this process may be written for one.
    pub fn is_parallel(&self) -> bool {
        self.bench.fmu.as_ref().is_none_or(Plant::is_isolated)
    }
}

/// The list of runs, after the run without a fault, which took this many ticks.
pub(super) fn planned(
    file: &str,
    sweep: &Arc<Sweep>,
    survey: Survey,
    (step, ticks): (Nanos, u64),
) -> Result<Plan, Refused> {
    let found = mistakes(sweep, &survey, step);
    if !found.is_empty() {
        return Err(refused(file, found));
    }
    let moments: Vec<Moment> = survey.moments.into_iter().flatten().collect();
    Ok(Plan::new(sweep, moments, survey.changes, ticks))
}

fn refused(file: &str, found: Vec<(TextPosition, String, String)>) -> Refused {
    let mut list: Vec<PlacedMistake> = found
        .into_iter()
        .map(|(place, what, right)| PlacedMistake {
            place: Some(place),
            mistake: Mistake::new(what, right),
        })
        .collect();
    list.sort_by_key(|found| found.place);
    Refused::Mistakes(Mistakes::of_list(file, list))
}

/// The mistakes in the sweep that the run without a fault shows.
fn mistakes(sweep: &Sweep, survey: &Survey, step: Nanos) -> Vec<(TextPosition, String, String)> {
    let scenario = seconds(survey.scenario.unwrap_or_default(), step);
    let mut found = Vec::new();
    for (moments, came) in sweep.moments.iter().zip(&survey.moments) {
        match moments {
            Moments::First(named) if came.is_empty() => found.push((
                named.place,
                format!(
                    "the moment \"{}\" never comes in the scenario, which lasts {scenario} without a fault",
                    named.name
                ),
                "let the scenario go that far, or remove the moment".to_owned(),
            )),
            Moments::EachValue(_, place) if came.len() > MOST_VALUES => found.push((
                *place,
                format!("this signal takes more than {MOST_VALUES} values in the scenario"),
                "use the signal that numbers the steps, or write conditions".to_owned(),
            )),
            _ => {}
        }
    }
    let names = survey.moments.iter().flatten().map(|moment| &moment.name);
    let names: Vec<&String> = names.collect();
    let twice = |(place, name): &(usize, &&String)| names[..*place].contains(*name);
    if let Some((_, name)) = names.iter().enumerate().find(twice) {
        found.push((
            sweep.place,
            format!("two of the moments are called \"{name}\""),
            "remove one, or give them names: { \"before\" = \"…\" }".to_owned(),
        ));
    }
    let mut held = |tick, named: &Named, what: &str, right: &str| {
        let at = moment(tick, step);
        let what = format!("{at}: \"{}\" holds without a fault, {what}", named.name);
        found.push((named.place, what, right.to_owned()));
    };
    if let Some((tick, place)) = survey.has_told {
        let right = "write what the program does only after a fault";
        held(tick, &sweep.told[place], "so it tells nothing", right);
    }
    if let Some((tick, place)) = survey.has_broken {
        let (what, right) = ("although it never may", "write what only a fault can cause");
        held(tick, &sweep.never[place], what, right);
    }
    found
}
