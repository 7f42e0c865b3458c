//! Fitting: the parameters of a model with which its recording is most like the real one.
//!
//! The cost of a set of values is 1 minus the mean of two likenesses: one with the window of the comparison, and one with a
//! window eight times as wide, which guides the search where the edges are still farther apart than the window.

use std::sync::Mutex;

use tickbus_base::parallel::{cores, in_parallel};

use super::compared::{Compared, Options, compare_on};
use super::search;
use super::side::Side;

/// The wide window, in windows.
const WIDE: i64 = 8;

/// The cost of values with which the model does not run.
const BROKEN: f64 = 2.0;

/// Costs that differ by less are equal.
const NO_DIFFERENCE: f64 = 1e-9;

/// A model whose parameters can be changed, such as an FMU, the rules of a test file, or a machine in another language.
pub trait Model: Sync {
    /// Runs the model from the start with these values, in the order of the parameters.
    ///
    /// # Errors
    ///
    /// Why the model does not run with these values.
    fn simulate(&self, values: &[f64]) -> Result<Side, String>;
}

/// A parameter that is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The name, for people.
    pub name: String,
    /// The unit of the values; empty without one.
    pub unit: String,
    /// The least value.
    pub from: f64,
    /// The greatest value.
    pub to: f64,
    /// The value before the fit.
    pub was: f64,
}

impl Parameter {
    fn value(&self, place: f64) -> f64 {
        self.from + place * (self.to - self.from)
    }

    fn place(&self, value: f64) -> f64 {
        ((value - self.from) / (self.to - self.from)).clamp(0.0, 1.0)
    }
}

/// How long to search, and the seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// About how often the model is run. Judging the parameters afterwards takes some more runs.
    pub runs: usize,
    /// The seed of the search.
    pub seed: u32,
}

/// The result of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// The likeness with the values before.
    pub before: f64,
    /// The comparison with the values that were found.
    pub compared: Compared,
    /// The values, in the order of the parameters. One without influence keeps its value.
    pub values: Vec<f64>,
    /// The parameters without influence, by their places.
    pub flat: Vec<usize>,
    /// How many runs failed, and why one of them did.
    pub failed: (usize, String),
}

struct Fit<'a> {
    model: &'a dyn Model,
    real: &'a Side,
    options: &'a Options,
    wide: Options,
    parameters: &'a [Parameter],
    failed: Mutex<(usize, String)>,
}

impl Fit<'_> {
    fn values(&self, places: &[f64]) -> Vec<f64> {
        let parameters = self.parameters.iter().zip(places);
        parameters
            .map(|(parameter, place)| parameter.value(*place))
            .collect()
    }

    fn compared(&self, values: &[f64]) -> Result<(Compared, f64), String> {
        let simulated = self.model.simulate(values)?;
        let with = |options| {
            compare_on(1, self.real, &simulated, options).map_err(|mistakes| {
                let mistakes = mistakes.iter().map(ToString::to_string);
                mistakes.collect::<Vec<_>>().join("\n")
            })
        };
        let compared = with(self.options)?;
        let wide = with(&self.wide)?.likeness;
        let cost = 1.0 - f64::midpoint(compared.likeness, wide);
        Ok((compared, cost))
    }

    fn cost(&self, places: &[f64]) -> f64 {
        let values = self.values(places);
        match self.compared(&values) {
            Ok((_, cost)) => cost,
            Err(why) => {
                if let Ok(mut failed) = self.failed.lock() {
                    failed.0 += 1;
                    // The least text, whichever core was first.
                    if failed.1.is_empty() || why < failed.1 {
                        failed.1 = why;
                    }
                }
                BROKEN
            }
        }
    }
}

/// Looks for the values with which `model` is most like the `real` recording.
///
/// # Errors
///
/// The model does not run with the values that it has, or its signals do not fit the recording.
pub fn fit(
    model: &dyn Model,
    real: &Side,
    options: &Options,
    parameters: &[Parameter],
    budget: Budget,
) -> Result<Fitted, String> {
    let fit = Fit {
        model,
        real,
        options,
        wide: Options {
            window: options.window.times(WIDE),
            ..options.clone()
        },
        parameters,
        failed: Mutex::default(),
    };
    let was: Vec<f64> = parameters.iter().map(|parameter| parameter.was).collect();
    let (before, _) = fit.compared(&was)?;
    let places = parameters.iter().map(|one| one.place(one.was));
    let start: Vec<f64> = places.collect();
    let cost = |places: &[f64]| fit.cost(places);
    let (least, found) = search::least(&start, (budget.runs, budget.seed), &cost);
    let flat = flat(&found, least, &cost);
    let mut values = fit.values(&found);
    for axis in &flat {
        values[*axis] = parameters[*axis].was;
    }
    let (mut compared, _) = fit.compared(&values)?;
    if compared.likeness < before.likeness {
        // Values outside of the bounds can be better than all within.
        (values, compared) = (was.clone(), before.clone());
    }
    Ok(Fitted {
        before: before.likeness,
        compared,
        values,
        flat,
        failed: fit.failed.into_inner().unwrap_or_default(),
    })
}

/// The axes along which the cost does not change.
fn flat(found: &[f64], least: f64, cost: &(dyn Fn(&[f64]) -> f64 + Sync)) -> Vec<usize> {
    let axes: Vec<usize> = (0..found.len()).collect();
    let is_flat = in_parallel(cores(), &axes, |axis| {
        [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().all(|place| {
            let mut at = found.to_vec();
            at[*axis] = place;
            (cost(&at) - least).abs() < NO_DIFFERENCE
        })
    });
    let flat = axes.into_iter().zip(is_flat);
    flat.filter(|(_, is_flat)| *is_flat)
        .map(|(axis, _)| axis)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Nanos;
    use tickbus_report::{Run, SignalKind};

    /// Each signal has a pulse every 10 s; its delay is that of a function of the values, in seconds.
    struct Delays(Vec<Delay>);

    type Delay = fn(&[f64]) -> f64;

    fn delays<const N: usize>(of: [Delay; N]) -> Delays {
        Delays(of.to_vec())
    }

    impl Model for Delays {
        fn simulate(&self, values: &[f64]) -> Result<Side, String> {
            let mut run = Run::new(1_000_000);
            for (number, delay) in self.0.iter().enumerate() {
                let signal = run.add_signal(&format!("S{number}"), SignalKind::Bool, "");
                run.change(signal, Nanos::ZERO, 0.0);
                #[expect(clippy::cast_possible_truncation, reason = "a few seconds")]
                let late = Nanos((delay(values) * 1e9) as i64);
                for round in 0..10 {
                    let at = Nanos::from_secs(round * 10) + late;
                    run.change(signal, at, 1.0);
                    run.change(signal, at + Nanos::from_secs(1), 0.0);
                }
            }
            run.tick(Nanos::ZERO);
            run.tick(Nanos::from_secs(120));
            Ok(Side::new("model", run, vec![None; self.0.len()]))
        }
    }

    fn parameter(name: &str, was: f64) -> Parameter {
        Parameter {
            name: name.to_owned(),
            unit: "s".to_owned(),
            from: 0.1,
            to: 4.0,
            was,
        }
    }

    fn fitted(model: &Delays, right: &[f64], was: &[f64], runs: usize) -> Fitted {
        let real = model.simulate(right).expect("it runs");
        let parameters: Vec<Parameter> = was
            .iter()
            .enumerate()
            .map(|(index, was)| parameter(&index.to_string(), *was))
            .collect();
        let budget = Budget { runs, seed: 1 };
        let found = fit(model, &real, &Options::default(), &parameters, budget);
        found.expect("it runs")
    }

    #[test]
    fn a_twin_with_four_known_times_is_found_within_a_percent() {
        let model = delays([|v| v[0], |v| v[1], |v| v[1] + v[2], |v| v[3]]);
        let right = [0.8, 2.35, 1.1, 3.3];
        let found = fitted(&model, &right, &[2.0, 1.0, 1.0, 1.0], 800);
        for (value, right) in found.values.iter().zip(right) {
            assert!((value - right).abs() < 0.01 * right, "{found:?}");
        }
        assert!(found.compared.likeness > 0.98 && found.before < 0.5);
        assert!(found.flat.is_empty(), "{found:?}");
    }

    #[test]
    fn a_parameter_without_influence_keeps_its_value_and_is_named() {
        let model = delays([|v| v[0]]);
        let found = fitted(&model, &[1.5, 1.0], &[0.5, 3.0], 200);
        assert_eq!((found.flat.as_slice(), found.values[1]), (&[1][..], 3.0));
        assert!((found.values[0] - 1.5).abs() < 0.015, "{found:?}");
    }

    #[test]
    fn values_with_which_the_model_fails_are_left_out_and_counted() {
        struct Fragile(Delays);
        impl Model for Fragile {
            fn simulate(&self, values: &[f64]) -> Result<Side, String> {
                if values[0] > 2.0 {
                    return Err(format!("broken at {:.0}", values[0]));
                }
                self.0.simulate(values)
            }
        }
        let model = Fragile(delays([|v| v[0]]));
        let real = model.simulate(&[1.5]).expect("it runs");
        let budget = Budget { runs: 200, seed: 1 };
        let parameters = [parameter("x", 0.5)];
        let found = fit(&model, &real, &Options::default(), &parameters, budget);
        let found = found.expect("it runs with 0.5");
        assert!((found.values[0] - 1.5).abs() < 0.015, "{found:?}");
        assert!(
            found.failed.0 > 10 && found.failed.1 == "broken at 2",
            "{found:?}"
        );
    }

    #[test]
    fn a_model_that_does_not_run_says_why() {
        struct Broken;
        impl Model for Broken {
            fn simulate(&self, _: &[f64]) -> Result<Side, String> {
                Err("no fuel".to_owned())
            }
        }
        let real = delays([|v| v[0]]).simulate(&[1.0]).expect("it runs");
        let budget = Budget { runs: 10, seed: 1 };
        let found = fit(
            &Broken,
            &real,
            &Options::default(),
            &[parameter("x", 1.0)],
            budget,
        );
        assert_eq!(found, Err("no fuel".to_owned()));
    }
}
