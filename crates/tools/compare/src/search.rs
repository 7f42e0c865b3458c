//! The search for the least cost in a cube, without derivatives.
//!
//! Points scattered over the cube first, then Nelder and Mead's simplex from the best of them, and at last a search along the
//! axes with steps that are halved, since a cost of time differences has edges on which a simplex rests. Each search has its
//! own share of the runs, so the result does not depend on the number of cores. A crate of optimisers (argmin) would bring
//! the simplex alone, without bounds.

use tickbus_base::parallel::{cores, in_parallel};

/// The number of simplexes.
const SIMPLEXES: usize = 4;

/// The size of the first simplex, of later ones, and the first step along the axes, in edges of the cube.
const FIRST_SIZE: f64 = 0.2;
const LATER_SIZE: f64 = 0.05;
const FIRST_STEP: f64 = 0.02;

/// A simplex, and a step, below this size is not made smaller.
const SMALLEST: f64 = 1e-4;

/// A point and its cost.
type Point = (f64, Vec<f64>);

/// The cost, and how many runs are left.
struct Runs<'a> {
    left: usize,
    cost: &'a (dyn Fn(&[f64]) -> f64 + Sync),
}

impl Runs<'_> {
    fn at(&mut self, at: Vec<f64>) -> Point {
        self.left = self.left.saturating_sub(1);
        ((self.cost)(&at), at)
    }
}

/// The cheapest point of the unit cube that about `runs` calls of `cost` find, from `start` on; its cost comes first.
pub(super) fn least(
    start: &[f64],
    (runs, seed): (usize, u32),
    cost: &(dyn Fn(&[f64]) -> f64 + Sync),
) -> Point {
    let mut points = scattered(start.len(), (runs / 4).max(2 * start.len()), seed);
    points.push(start.to_vec());
    let mut points = in_parallel(cores(), &points, |at| (cost(at), at.clone()));
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points.truncate(SIMPLEXES);
    let found = in_parallel(cores(), &points, |point| {
        let left = runs / 2 / SIMPLEXES;
        simplexes(point.clone(), Runs { left, cost })
    });
    let best = found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let left = runs / 4;
    along_axes(best.expect("at least the start"), Runs { left, cost })
}

/// Points that are spread evenly: Roberts' sequence, which continues the golden ratio to more axes. The seed moves them.
fn scattered(axes: usize, count: usize, seed: u32) -> Vec<Vec<f64>> {
    // The root of x^(axes + 1) = x + 1.
    let mut ratio = 2.0_f64;
    let one_more = u32::try_from(axes).map_or(f64::INFINITY, f64::from) + 1.0;
    for _ in 0..60 {
        ratio = (1.0 + ratio).powf(one_more.recip());
    }
    let points = (0..count).map(|index| {
        let index = u32::try_from(index).map_or(0.0, f64::from);
        let mut share = 1.0;
        let axis = |_| {
            share /= ratio;
            (share * (index + 1.0) + f64::from(seed) * std::f64::consts::SQRT_2).fract()
        };
        (0..axes).map(axis).collect()
    });
    points.collect()
}

/// Simplexes one after another, each around the best point so far, until the runs are used up or two gain nothing.
fn simplexes(mut best: Point, mut runs: Runs<'_>) -> Point {
    let (mut size, mut vain) = (FIRST_SIZE, 0);
    while runs.left > best.1.len() + 1 && vain < 2 {
        let found = simplex(&best, size, &mut runs);
        vain = if found.0 < best.0 { 0 } else { vain + 1 };
        if found.0 < best.0 {
            best = found;
        }
        // The next one points the other way.
        size = -LATER_SIZE.copysign(size);
    }
    best
}

/// One simplex of Nelder and Mead, kept within the cube.
#[expect(clippy::cast_precision_loss, reason = "a small count")]
fn simplex(around: &Point, size: f64, runs: &mut Runs<'_>) -> Point {
    let axes = around.1.len();
    let mut corners = vec![around.clone()];
    for axis in 0..axes {
        let mut at = around.1.clone();
        let to = at[axis] + size;
        // A corner outside of the cube goes to the other side.
        let is_inside = (0.0..=1.0).contains(&to);
        at[axis] = if is_inside { to } else { at[axis] - size };
        corners.push(runs.at(at));
    }
    while runs.left > 0 {
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        let spread = (0..axes).map(|axis| {
            let places = corners.iter().map(|corner| corner.1[axis]);
            let low = places.clone().fold(f64::INFINITY, f64::min);
            places.fold(f64::NEG_INFINITY, f64::max) - low
        });
        if spread.fold(0.0, f64::max) < SMALLEST {
            break;
        }
        let worst = corners.last().expect("a simplex has corners").clone();
        let centre: Vec<f64> = (0..axes)
            .map(|axis| {
                let sum: f64 = corners[..axes].iter().map(|corner| corner.1[axis]).sum();
                sum / axes as f64
            })
            .collect();
        let along = |factor: f64| -> Vec<f64> {
            let axis = centre.iter().zip(&worst.1);
            axis.map(|(centre, worst)| (centre + factor * (centre - worst)).clamp(0.0, 1.0))
                .collect()
        };
        let mirrored = runs.at(along(1.0));
        let next = if mirrored.0 < corners[0].0 {
            let farther = runs.at(along(2.0));
            Some(if farther.0 < mirrored.0 {
                farther
            } else {
                mirrored
            })
        } else if mirrored.0 < corners[axes - 1].0 {
            Some(mirrored)
        } else {
            let nearer = runs.at(along(if mirrored.0 < worst.0 { 0.5 } else { -0.5 }));
            (nearer.0 < worst.0.min(mirrored.0)).then_some(nearer)
        };
        if let Some(next) = next {
            corners[axes] = next;
        } else {
            let best = corners[0].1.clone();
            for corner in &mut corners[1..] {
                let half = best
                    .iter()
                    .zip(&corner.1)
                    .map(|(a, b)| f64::midpoint(*a, *b));
                *corner = runs.at(half.collect());
            }
        }
    }
    corners.sort_by(|a, b| a.0.total_cmp(&b.0));
    corners.swap_remove(0)
}

/// Steps along each axis in both directions, halved when none gains.
fn along_axes(mut best: Point, mut runs: Runs<'_>) -> Point {
    let mut step = FIRST_STEP;
    while runs.left > 0 && step >= SMALLEST / 4.0 {
        let mut gains = false;
        for axis in 0..best.1.len() {
            for way in [step, -step] {
                let mut at = best.1.clone();
                at[axis] = (at[axis] + way).clamp(0.0, 1.0);
                let found = runs.at(at);
                if found.0 < best.0 {
                    (best, gains) = (found, true);
                    break;
                }
            }
        }
        if !gains {
            step /= 2.0;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apart(found: &Point, right: &[f64]) -> f64 {
        let axes = found.1.iter().zip(right);
        axes.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_bowl_with_edges_is_searched_to_its_bottom() {
        let right = [0.31, 0.72, 0.05, 0.5];
        let cost = |at: &[f64]| -> f64 {
            let apart: Vec<f64> = at.iter().zip(&right).map(|(a, b)| (a - b).abs()).collect();
            apart.iter().sum::<f64>() + 3.0 * apart[0] * apart[1]
        };
        let found = least(&[0.9; 4], (600, 1), &cost);
        assert!(apart(&found, &right) < 0.002, "{found:?}");
    }

    #[test]
    fn a_narrow_valley_is_followed() {
        let cost = |at: &[f64]| {
            let (x, y) = (at[0] * 4.0 - 2.0, at[1] * 4.0 - 2.0);
            100.0 * (y - x * x).powi(2) + (1.0 - x).powi(2)
        };
        let found = least(&[0.1, 0.1], (1000, 1), &cost);
        assert!(apart(&found, &[0.75, 0.75]) < 0.01, "{found:?}");
    }

    #[test]
    fn a_minimum_on_the_border_and_one_axis_are_no_trouble() {
        let found = least(&[0.5], (200, 1), &|at| at[0]);
        assert!(found.1[0] < 0.001, "{found:?}");
        let found = least(&[0.5], (200, 1), &|at| (at[0] - 0.123).abs());
        assert!(apart(&found, &[0.123]) < 0.001, "{found:?}");
    }

    #[test]
    fn the_same_seed_gives_the_same_point() {
        let cost = |at: &[f64]| (at[0] * 37.0).sin() + (at[1] * 23.0).cos();
        let twice = [(), ()].map(|()| least(&[0.5, 0.5], (300, 7), &cost));
        assert_eq!(twice[0], twice[1]);
    }
}
