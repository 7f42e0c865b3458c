//! What was run, how often, and what came out.

use crate::metrics::{Metrics, Run};

/// E of a run in lock-step, in mm, computed by an independent program.
pub const LOCK_STEP_ERROR: f64 = 0.346_411_671_372_834_46;

/// What is between the two sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A common virtual time.
    LockStep,
    /// Nothing, in a model.
    Model,
    /// Nothing, in fact.
    WallClock,
}

/// Several runs of one kind.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Its name in the table.
    pub name: String,
    /// What is between the two sides.
    pub kind: Kind,
    /// The runs.
    pub runs: Vec<Run>,
    /// The figures of the runs.
    pub metrics: Metrics,
    /// The trace hash of each run in lock-step.
    pub hashes: Vec<String>,
}

impl Experiment {
    /// Measures runs that have no trace hash.
    pub fn new(name: impl Into<String>, kind: Kind, runs: Vec<Run>) -> Self {
        Self {
            name: name.into(),
            kind,
            metrics: Metrics::of(&runs),
            runs,
            hashes: Vec::new(),
        }
    }
}

/// What must hold of the experiments together.
///
/// # Errors
///
/// What does not.
pub fn verdict(experiments: &[Experiment]) -> Result<(), String> {
    let of = |kind| experiments.iter().filter(move |e| e.kind == kind);
    let mut hashes = of(Kind::LockStep).flat_map(|e| &e.hashes);
    if let Some(first) = hashes.next()
        && let Some(other) = hashes.find(|hash| *hash != first)
    {
        return Err(format!(
            "two runs in lock-step have the trace hashes {first} and {other}"
        ));
    }
    for experiment in of(Kind::LockStep) {
        let Metrics {
            largest_error,
            difference,
            ..
        } = experiment.metrics;
        if difference != 0.0 {
            return Err(format!(
                "{}: two runs differ by {difference} mm",
                experiment.name
            ));
        }
        if (largest_error - LOCK_STEP_ERROR).abs() > 1e-9 {
            return Err(format!(
                "{}: E is {largest_error} mm, and should be {LOCK_STEP_ERROR} mm",
                experiment.name
            ));
        }
    }
    for experiment in of(Kind::Model).chain(of(Kind::WallClock)) {
        if experiment.metrics.error <= LOCK_STEP_ERROR {
            return Err(format!(
                "{}: E is {} mm, no more than in lock-step",
                experiment.name, experiment.metrics.error
            ));
        }
    }
    Ok(())
}
