//! The comparison as a whole.

use tickbus_base::Mistake;
use tickbus_base::parallel::{cores, in_parallel};
use tickbus_base::time::Nanos;
use tickbus_report::{Signal, SignalKind};

use super::curve::{self, NumberResult};
use super::edges::{self, BoolResult};
use super::side::{Side, View};
use super::steps::{self, Steps};

/// The choices of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The greatest time between the edges of a pair, and the greatest shift of a curve.
    pub window: Nanos,
    /// Added to the times of the simulated recording.
    pub moved: Nanos,
    /// The name of the step signal.
    pub steps: Option<String>,
    /// Signals that are not compared.
    pub ignore: Vec<String>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            window: Nanos::from_millis(500),
            moved: Nanos::ZERO,
            steps: None,
            ignore: Vec::new(),
        }
    }
}

/// The result of a comparison.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Compared {
    /// The signals, in the order of the real recording.
    pub signals: Vec<SignalResult>,
    /// The steps, if there is a step signal.
    pub steps: Option<Steps>,
    /// The likeness, from 0 to 1: the mean of the signals that change, or differ, in either recording.
    pub likeness: f64,
    /// Signals of the real recording that the simulated one does not have.
    pub only_real: Vec<String>,
    /// Signals of the simulated recording that the real one does not have.
    pub only_simulated: Vec<String>,
    /// Further remarks, such as that a recording was thinned.
    pub notes: Vec<String>,
}

/// The result of one signal.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalResult {
    /// The name.
    pub name: String,
    /// The unit; empty without one.
    pub unit: String,
    /// The likeness, from 0 to 1; `None` if the signal has the same value all the time in both recordings.
    pub likeness: Option<f64>,
    /// The details.
    pub outcome: Outcome,
}

/// The details of one signal.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Of a BOOL.
    Bool(BoolResult),
    /// Of a number.
    Number(NumberResult),
}

/// Compares a simulated recording with the real one.
///
/// # Errors
///
/// The recordings have no signals or no time in common, or signals of other types or units.
pub fn compare(real: &Side, simulated: &Side, options: &Options) -> Result<Compared, Vec<Mistake>> {
    compare_on(cores(), real, simulated, options)
}

/// As [`compare`], on at most this many threads.
pub(super) fn compare_on(
    threads: usize,
    real: &Side,
    simulated: &Side,
    options: &Options,
) -> Result<Compared, Vec<Mistake>> {
    let pairs = real.pairs(simulated, &options.ignore)?;
    let (begin, end) = real.run.extent();
    let (other_begin, other_end) = simulated.run.extent();
    let (other_begin, other_end) = (other_begin + options.moved, other_end + options.moved);
    if begin.max(other_begin) >= end.min(other_end) {
        return Err(vec![Mistake::new(
            format!(
                "{} is from {begin} to {end}, and {} from {other_begin} to {other_end}: they have no time in common",
                real.name, simulated.name
            ),
            "move the simulated recording, with --align or --shift",
        )]);
    }
    let signals = in_parallel(threads, &pairs, |(place, twin)| {
        let signal = &real.run.signals()[*place];
        let real = real.view(*place, Nanos::ZERO);
        let simulated = simulated.view(*twin, options.moved);
        one(signal, &real, &simulated, options.window)
    });
    Ok(Compared {
        likeness: mean(&signals),
        steps: step_durations(real, simulated, options),
        signals,
        only_real: real.without(simulated, &options.ignore),
        only_simulated: simulated.without(real, &options.ignore),
        notes: [&*real.notes, &simulated.notes].concat(),
    })
}

#[expect(clippy::cast_precision_loss, reason = "a small count")]
fn mean(signals: &[SignalResult]) -> f64 {
    let counted = signals.iter().filter_map(|signal| signal.likeness);
    let count = counted.clone().count();
    if count == 0 {
        return 1.0;
    }
    counted.sum::<f64>() / count as f64
}

fn step_durations(real: &Side, simulated: &Side, options: &Options) -> Option<Steps> {
    let name = options.steps.as_deref()?;
    let real = real.view(real.run.signal(name)?, Nanos::ZERO);
    let simulated = simulated.view(simulated.run.signal(name)?, options.moved);
    Some(steps::steps(
        name,
        real.curve().changes,
        simulated.curve().changes,
    ))
}

/// Compares one signal; `signal` is the real one.
fn one(signal: &Signal, real: &View<'_>, simulated: &View<'_>, window: Nanos) -> SignalResult {
    let (likeness, outcome) = if signal.kind == SignalKind::Bool {
        let found = of_bool(real, simulated, window);
        let likeness = if found.is_empty() {
            let begin = real.curve().begin.max(simulated.curve().begin);
            let levels = [real, simulated].map(|view| view.curve().value(begin));
            let is_other = (levels[0] - levels[1]).abs() > 0.0;
            is_other.then_some(0.0)
        } else {
            Some(found.likeness())
        };
        (likeness, Outcome::Bool(found))
    } else {
        let found = curve::compared(real.curve(), simulated.curve(), window);
        // The same value again after a gap is no change.
        let counts = found.range > 0.0 || found.greatest > 0.0;
        let likeness = (counts && !found.greatest.is_nan()).then(|| found.likeness(window));
        (likeness, Outcome::Number(found))
    };
    SignalResult {
        name: signal.name.clone(),
        unit: signal.unit.clone(),
        likeness,
        outcome,
    }
}

fn of_bool(real: &View<'_>, simulated: &View<'_>, window: Nanos) -> BoolResult {
    let edges = [real, simulated].map(|view| edges::edges_of(view.curve().changes));
    let mut found = edges::matched(&edges[0], &edges[1], window);
    // An edge at a time that the other recording does not have cannot have a partner there.
    found.missing.retain(|edge| simulated.is_known(edge.at));
    found.extra.retain(|edge| real.is_known(edge.at));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tickbus_report::Run;

    /// A recording of a BOOL with edges at these milliseconds and of a number with these changes, for 100 s.
    fn side(edges: &[i64], numbers: &[(i64, i32)], late: i64) -> Side {
        let mut run = Run::new(1_000_000);
        let lamp = run.add_signal("Lamp", SignalKind::Bool, "");
        let level = run.add_signal("Level", SignalKind::Real, "mm");
        run.change(lamp, Nanos::ZERO, 0.0);
        run.change(level, Nanos::ZERO, -1000.0);
        for (index, at) in edges.iter().enumerate() {
            let value = if index % 2 == 0 { 1.0 } else { 0.0 };
            run.change(lamp, Nanos::from_millis(at + late), value);
        }
        for (at, value) in numbers {
            run.change(level, Nanos::from_millis(at + late), f64::from(*value));
        }
        run.tick(Nanos::ZERO);
        run.tick(Nanos::from_secs(100));
        Side::new("run", run, vec![None; 2])
    }

    /// Ascending times from these steps, after the first second.
    fn times(steps: &[i64]) -> Vec<i64> {
        let mut at = 1000;
        let next = |step: &i64| {
            at += step;
            at
        };
        steps.iter().map(next).collect()
    }

    fn result(real: &Side, simulated: &Side) -> Compared {
        compare(real, simulated, &Options::default()).expect("they fit")
    }

    fn of_bool(compared: &Compared) -> &BoolResult {
        match &compared.signals[0].outcome {
            Outcome::Bool(found) => found,
            Outcome::Number(_) => panic!("the lamp is a BOOL"),
        }
    }

    #[test]
    fn signals_that_never_change_count_only_if_they_differ() {
        let mut real = side(&[], &[], 0);
        let found = result(&real, &side(&[], &[], 0));
        assert_eq!((found.signals[0].likeness, found.likeness), (None, 1.0));
        real.run = {
            let mut run = Run::new(10);
            let lamp = run.add_signal("Lamp", SignalKind::Bool, "");
            run.change(lamp, Nanos::ZERO, 1.0);
            run.tick(Nanos::from_secs(100));
            run
        };
        let found = result(&real, &side(&[], &[], 0));
        assert_eq!(
            (found.signals[0].likeness, found.likeness),
            (Some(0.0), 0.0)
        );
    }

    #[test]
    fn a_number_that_is_the_same_after_a_gap_has_not_changed() {
        let gap = [(2000, f64::NAN), (3000, -1000.0)];
        let mut real = side(&[2000], &[], 0);
        for (at, value) in gap {
            real.run.change(1, Nanos::from_millis(at), value);
        }
        let found = result(&real, &side(&[2000], &[], 0));
        assert_eq!(found.signals[1].likeness, None);
    }

    #[test]
    fn edges_outside_of_the_other_recording_are_not_missing() {
        let real = side(&[2000, 3000, 50_000, 51_000], &[], 0);
        let mut short = side(&[2000, 3000], &[], 0);
        short.run = {
            let mut run = Run::new(10);
            let lamp = run.add_signal("Lamp", SignalKind::Bool, "");
            for (at, value) in [(0, 0.0), (2, 1.0), (3, 0.0), (40, 0.0)] {
                run.change(lamp, Nanos::from_secs(at), value);
            }
            run
        };
        let found = result(&real, &short);
        assert!(of_bool(&found).missing.is_empty());
        assert_eq!(of_bool(&found).pairs.len(), 2);
    }

    proptest! {
        #[test]
        fn a_recording_is_like_itself(
            steps in proptest::collection::vec(1..2000_i64, 0..40),
            numbers in proptest::collection::vec((1..2000_i64, -100..100_i32), 0..40),
        ) {
            let at = times(&numbers.iter().map(|(step, _)| *step).collect::<Vec<_>>());
            let numbers: Vec<(i64, i32)> = at.into_iter().zip(numbers.iter().map(|(_, value)| *value)).collect();
            let real = side(&times(&steps), &numbers, 0);
            let found = result(&real, &side(&times(&steps), &numbers, 0));
            prop_assert!((found.likeness - 1.0).abs() < 1e-12, "{:?}", found);
        }

        #[test]
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        fn a_delay_is_found_as_it_is(steps in proptest::collection::vec(900..2000_i64, 2..40), late in 0..400_i64) {
            let numbers: Vec<(i64, i32)> = times(&steps).into_iter().zip(0..).collect();
            let real = side(&times(&steps), &numbers, 0);
            let found = result(&real, &side(&times(&steps), &numbers, late));
            let delay = Nanos::from_millis(late);
            let lamp = of_bool(&found);
            for rises in [true, false] {
                let found = lamp.differences(rises).expect("there are pairs");
                prop_assert_eq!((found.median, found.spread), (delay, Nanos::ZERO));
            }
            prop_assert!(lamp.missing.is_empty() && lamp.extra.is_empty());
            let Outcome::Number(level) = &found.signals[1].outcome else {
                panic!("the level is a number")
            };
            prop_assert_eq!(level.shift, delay);
            let right = 1.0 - late as f64 / 500.0;
            prop_assert!((found.likeness - right).abs() < 1e-9, "{} {}", found.likeness, right);
        }

        #[test]
        fn jitter_is_within_its_bounds(
            steps in proptest::collection::vec((900..2000_i64, -40..40_i64), 2..40),
        ) {
            let at = times(&steps.iter().map(|(step, _)| *step).collect::<Vec<_>>());
            let jittered: Vec<i64> = at.iter().zip(&steps).map(|(at, (_, jitter))| at + jitter).collect();
            let found = result(&side(&at, &[], 0), &side(&jittered, &[], 0));
            let lamp = of_bool(&found);
            prop_assert_eq!(lamp.pairs.len(), at.len());
            let ways = [true, false].map(|rises| lamp.differences(rises).expect("at least one"));
            let worst = ways.iter().map(|found| found.worst.0.0.abs() / 1_000_000).max();
            prop_assert_eq!(worst, steps.iter().map(|(_, jitter)| jitter.abs()).max());
        }
    }
}
