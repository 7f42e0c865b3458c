//! Measures runs: the distance from the path, and the distance from each other.

use crate::path::{CORNERS, Point, distance, distance_from};

/// The positions of the tool in one run, one for each millisecond of simulation time.
pub type Run = Vec<Point>;

/// Only every tenth position is compared for the distance between two paths, since each is compared with the whole
/// other path. At 300 mm/s these positions are 3 mm apart, and the others lie nearly on the straight line between them.
const EVERY: usize = 10;

/// The measurements of several runs of one experiment, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metrics {
    /// E: the largest distance of a position from the commanded path, as the mean over the runs.
    pub error: f64,
    /// The largest E of a run.
    pub largest_error: f64,
    /// D: the largest distance of two runs at equal simulation time, over all pairs of runs.
    pub difference: f64,
    /// G: the largest distance of a position of one run from the path of another, at whatever time, over all pairs.
    pub deviation: f64,
}

impl Metrics {
    /// Measures runs.
    ///
    /// # Panics
    ///
    /// When there is no run.
    pub fn of(runs: &[Run]) -> Self {
        assert!(!runs.is_empty(), "metrics need a run");
        let errors: Vec<f64> = runs.iter().map(|run| error(run)).collect();
        #[expect(clippy::cast_precision_loss, reason = "a few runs")]
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let over_pairs = |measure: fn(&Run, &Run) -> f64| {
            let pairs = runs.iter().enumerate();
            let pairs = pairs.flat_map(|(at, a)| runs[..at].iter().map(move |b| (a, b)));
            largest(pairs.map(|(a, b)| measure(a, b)))
        };
        Self {
            error: mean,
            largest_error: largest(errors.into_iter()),
            difference: over_pairs(difference),
            deviation: over_pairs(deviation),
        }
    }
}

/// Returns E of one run: its largest distance from the commanded path, in mm.
pub fn error(run: &[Point]) -> f64 {
    largest(run.iter().map(|&point| distance_from(&CORNERS, point)))
}

fn difference(a: &Run, b: &Run) -> f64 {
    largest(a.iter().zip(b).map(|(&a, &b)| distance(a, b)))
}

fn deviation(a: &Run, b: &Run) -> f64 {
    let [a, b] = [a, b].map(|run| thinned(run));
    let of = |points: &[Point], line: &[Point]| {
        largest(points.iter().map(|&point| distance_from(line, point)))
    };
    of(&a, &b).max(of(&b, &a))
}

/// Returns every [`EVERY`]th position, and the last.
pub(crate) fn thinned(run: &[Point]) -> Vec<Point> {
    let mut points: Vec<Point> = run.iter().step_by(EVERY).copied().collect();
    points.extend(run.last());
    points
}

fn largest(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_path_at_another_time_differs_but_does_not_deviate() {
        let up: Run = (0..=200).map(|z| [0.0, f64::from(z)]).collect();
        let mut late = up.clone();
        late.splice(0..0, std::iter::repeat_n([0.0, 0.0], 30));
        let beside: Run = up.iter().map(|&[x, z]| [x - 4.0, z]).collect();
        let metrics = Metrics::of(&[up.clone(), late]);
        assert!(metrics.error < 1e-12);
        assert_eq!([metrics.difference, metrics.deviation], [30.0, 0.0]);
        let metrics = Metrics::of(&[up.clone(), beside, up]);
        assert!((metrics.error - 4.0 / 3.0).abs() < 1e-12);
        for figure in [metrics.largest_error, metrics.difference, metrics.deviation] {
            assert!((figure - 4.0).abs() < 1e-12);
        }
    }
}
