//! Experiments: kind, runs and results.

use crate::metrics::{Metrics, Run};

/// E of a run in lock-step, in mm, as computed by an independent program.
pub const LOCK_STEP_ERROR: f64 = 0.346_411_671_372_834_46;

/// The connection between the two sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A common virtual time.
    LockStep,
    /// A modelled OPC link that hands values over at this interval, in milliseconds.
    Model(i64),
    /// A real link on the wall clock, with the same kind of interval.
    WallClock(i64),
}

/// Several runs of one kind.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The experiment's name in the table.
    pub name: String,
    /// The connection between the two sides.
    pub kind: Kind,
    /// The runs.
    pub runs: Vec<Run>,
    /// The measurements of the runs.
    pub metrics: Metrics,
    /// The trace hash of each run in lock-step.
    pub hashes: Vec<String>,
}

impl Experiment {
    /// Creates an experiment from runs that have no trace hash, and measures them.
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

/// Checks the conditions that the experiments must meet together.
///
/// # Errors
///
/// Returns the condition that is not met.
pub fn verdict(experiments: &[Experiment]) -> Result<(), String> {
    let (lock_step, free): (Vec<_>, Vec<_>) =
        experiments.iter().partition(|of| of.kind == Kind::LockStep);
    let mut hashes = lock_step.iter().flat_map(|e| &e.hashes);
    if let Some(first) = hashes.next()
        && let Some(other) = hashes.find(|hash| *hash != first)
    {
        return Err(format!(
            "two runs in lock-step have the trace hashes {first} and {other}"
        ));
    }
    for experiment in lock_step {
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
    for experiment in free {
        if experiment.metrics.error <= LOCK_STEP_ERROR {
            return Err(format!(
                "{}: E is {} mm, no more than in lock-step",
                experiment.name, experiment.metrics.error
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::CORNERS;

    /// Returns a run that is this far off at its end.
    fn off(by: f64) -> Run {
        vec![CORNERS[0], [CORNERS[5][0] + by, CORNERS[5][1]]]
    }

    #[track_caller]
    fn assert_refused(kind: Kind, runs: Vec<Run>, hashes: &[&str], part: &str) {
        let hashes = hashes.iter().map(|&hash| hash.to_owned()).collect();
        let experiment = Experiment {
            hashes,
            ..Experiment::new("x", kind, runs)
        };
        let told = verdict(&[experiment]).expect_err("it is refused");
        assert!(told.contains(part), "{told}");
    }

    #[test]
    fn a_run_that_is_not_as_it_must_be_is_noticed() {
        let right = || off(LOCK_STEP_ERROR);
        assert_eq!(
            verdict(&[Experiment::new("x", Kind::LockStep, vec![right()])]),
            Ok(())
        );
        assert_refused(
            Kind::LockStep,
            vec![right(); 2],
            &["a", "b"],
            "hashes a and b",
        );
        let part = "two runs differ by";
        assert_refused(
            Kind::LockStep,
            vec![right(), off(LOCK_STEP_ERROR + 1e-12)],
            &[],
            part,
        );
        assert_refused(
            Kind::LockStep,
            vec![off(LOCK_STEP_ERROR + 2e-9)],
            &[],
            "and should be 0.346",
        );
        assert_refused(
            Kind::WallClock(50),
            vec![off(0.3)],
            &[],
            "no more than in lock-step",
        );
    }
}
