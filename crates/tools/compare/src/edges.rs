//! The edges of a BOOL in two recordings, matched in their order.
//!
//! A pair is an edge of each recording, of the same direction, at most the window W apart. A matching is a set of pairs
//! that do not cross. Of all matchings it is the one with the least cost, where a pair costs the time between its edges,
//! and an edge without a partner W / 2. A pair at a distance d therefore saves W − d, and the best matching is the
//! heaviest chain of pairs that rises in both recordings. It is found exactly, in O(n log n) for n possible pairs.

use tickbus_base::time::Nanos;
use tickbus_report::Change;

/// With more possible pairs the window is halved: memory stays below 100 MB.
const MOST_PAIRS: usize = 4_000_000;

/// A change of a BOOL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Simulation time, on the clock of the real recording.
    pub at: Nanos,
    /// True from off to on.
    pub rises: bool,
}

/// How the edges of a BOOL differ.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoolResult {
    /// Pairs of a real edge and its simulated partner, in the order of time.
    pub pairs: Vec<(Edge, Edge)>,
    /// Real edges that have no partner.
    pub missing: Vec<Edge>,
    /// Simulated edges that have no partner.
    pub extra: Vec<Edge>,
    /// The window, narrower than requested for a signal with very many edges.
    pub window: Nanos,
}

/// The time differences of the pairs of one direction; positive where the simulated edge is later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Differences {
    /// How many pairs there are.
    pub pairs: usize,
    /// The median.
    pub median: Nanos,
    /// The middle 80 % are within a span of this length.
    pub spread: Nanos,
    /// The greatest difference, whatever its sign, and its first time in the real recording.
    pub worst: (Nanos, Nanos),
}

impl BoolResult {
    /// The differences of the rising or of the falling edges; `None` without a pair.
    pub fn differences(&self, rises: bool) -> Option<Differences> {
        let pairs = self.pairs.iter().filter(|(real, _)| real.rises == rises);
        let mut all: Vec<(Nanos, Nanos)> = pairs.map(|(a, b)| (b.at - a.at, a.at)).collect();
        // Of several the first.
        let worst = all.iter().rev().max_by_key(|(apart, _)| apart.0.abs());
        let worst = *worst?;
        all.sort_unstable();
        let tenth = (all.len() + 4) / 10;
        Some(Differences {
            pairs: all.len(),
            median: all[all.len() / 2].0,
            spread: all[all.len() - 1 - tenth].0 - all[tenth].0,
            worst,
        })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.pairs.is_empty() && self.missing.is_empty() && self.extra.is_empty()
    }

    /// (Σ over pairs of 2 (1 − |d| / W)) / (edges of both): 1 if all edges have a partner at the same time.
    #[expect(clippy::cast_precision_loss, reason = "a figure for people")]
    pub(super) fn likeness(&self) -> f64 {
        let count = 2 * self.pairs.len() + self.missing.len() + self.extra.len();
        let window = self.window.0.max(1) as f64;
        let good = self.pairs.iter();
        let good = good.map(|(a, b)| 2.0 * (1.0 - (b.at - a.at).0.abs() as f64 / window));
        // The sum of no numbers would be -0.
        good.fold(0.0, |sum, one| sum + one) / count as f64
    }
}

/// The edges of a signal with these changes. The first value is no edge, and so is the first after an unknown one.
pub(super) fn edges_of(changes: &[Change]) -> Vec<Edge> {
    let pairs = changes.windows(2).map(|pair| (pair[0].value, pair[1]));
    let edges = pairs.filter_map(|(before, Change { at, value })| {
        let rises = value != 0.0;
        let is_known = !before.is_nan() && !value.is_nan();
        (is_known && (before != 0.0) != rises).then_some(Edge { at, rises })
    });
    edges.collect()
}

/// A possible pair, as the end of the best chain that leads to it.
struct Node {
    real: u32,
    simulated: u32,
    before: u32,
    /// Nanoseconds that the chain saves, and its pairs: of two chains that save the same the one with more pairs, so that
    /// a pair as far apart as permitted is better than two edges without a partner.
    total: (i64, u32),
}

/// No node.
const NONE: u32 = u32::MAX;

/// The best node whose simulated edge comes before a place: a Fenwick tree of maxima.
struct Best(Vec<u32>);

impl Best {
    /// The best node among the first `count` simulated edges.
    fn below(&self, mut count: usize, nodes: &[Node]) -> u32 {
        let mut best = NONE;
        while count > 0 {
            best = better(best, self.0[count], nodes);
            count &= count - 1;
        }
        best
    }

    fn raise(&mut self, simulated: usize, node: u32, nodes: &[Node]) {
        let mut place = simulated + 1;
        while place < self.0.len() {
            self.0[place] = better(self.0[place], node, nodes);
            place += place & place.wrapping_neg();
        }
    }
}

/// The node that saves more; of two equals the first.
fn better(first: u32, second: u32, nodes: &[Node]) -> u32 {
    let total = |node: u32| nodes.get(node as usize).map_or((0, 0), |node| node.total);
    if total(second) > total(first) {
        second
    } else {
        first
    }
}

/// Matches the edges of two recordings.
#[expect(
    clippy::cast_possible_truncation,
    reason = "there are at most MOST_PAIRS nodes, and an edge has an index below 2^32"
)]
pub(super) fn matched(real: &[Edge], simulated: &[Edge], window: Nanos) -> BoolResult {
    let mut window = window;
    while window.0 > 1 && possible(real, simulated, window) > MOST_PAIRS {
        window = Nanos(window.0 / 2);
    }
    let mut nodes: Vec<Node> = Vec::new();
    let mut best = Best(vec![NONE; simulated.len() + 1]);
    let mut low = 0;
    for (index, edge) in real.iter().enumerate() {
        low += simulated[low..].partition_point(|other| other.at < edge.at - window);
        let first = nodes.len();
        for (other_index, other) in simulated.iter().enumerate().skip(low) {
            let apart = (other.at - edge.at).0.abs();
            if other.at > edge.at + window {
                break;
            }
            if other.rises != edge.rises {
                continue;
            }
            let before = best.below(other_index, &nodes);
            let saved = nodes.get(before as usize);
            let (saved, pairs) = saved.map_or((0, 0), |node| node.total);
            nodes.push(Node {
                real: index as u32,
                simulated: other_index as u32,
                before,
                total: (saved + window.0 - apart, pairs + 1),
            });
        }
        // Only now, since a real edge has one partner.
        for (node, pair) in nodes.iter().enumerate().skip(first) {
            best.raise(pair.simulated as usize, node as u32, &nodes);
        }
    }
    let mut chain = Vec::new();
    let mut node = best.below(simulated.len(), &nodes);
    while let Some(pair) = nodes.get(node as usize) {
        chain.push((pair.real as usize, pair.simulated as usize));
        node = pair.before;
    }
    chain.reverse();
    BoolResult {
        missing: without(real, chain.iter().map(|pair| pair.0)),
        extra: without(simulated, chain.iter().map(|pair| pair.1)),
        pairs: chain
            .iter()
            .map(|(a, b)| (real[*a], simulated[*b]))
            .collect(),
        window,
    }
}

/// The edges except those with these indexes.
fn without(all: &[Edge], taken: impl Iterator<Item = usize>) -> Vec<Edge> {
    let mut is_free = vec![true; all.len()];
    for index in taken {
        is_free[index] = false;
    }
    let free = all.iter().zip(is_free).filter(|(_, free)| *free);
    free.map(|(edge, _)| *edge).collect()
}

/// How many pairs are at most this far apart, whatever their direction.
fn possible(real: &[Edge], simulated: &[Edge], window: Nanos) -> usize {
    let (mut low, mut high) = (0, 0);
    let mut count = 0;
    for edge in real {
        while simulated.get(low).is_some_and(|o| o.at < edge.at - window) {
            low += 1;
        }
        while simulated
            .get(high)
            .is_some_and(|o| o.at <= edge.at + window)
        {
            high += 1;
        }
        count += high - low;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WINDOW: Nanos = Nanos::from_millis(500);

    /// Edges at these milliseconds, beginning with a rising one.
    fn edges(millis: &[i64]) -> Vec<Edge> {
        let edge = |(index, at): (usize, &i64)| Edge {
            at: Nanos::from_millis(*at),
            rises: index % 2 == 0,
        };
        millis.iter().enumerate().map(edge).collect()
    }

    fn times(edges: &[Edge]) -> Vec<i64> {
        edges.iter().map(|edge| edge.at.0 / 1_000_000).collect()
    }

    fn pairs(matched: &BoolResult) -> Vec<(i64, i64)> {
        let pair = |(a, b): &(Edge, Edge)| (a.at.0 / 1_000_000, b.at.0 / 1_000_000);
        matched.pairs.iter().map(pair).collect()
    }

    /// The cost of the best matching, by trying all: the textbook's alignment with gap costs.
    fn least_cost(real: &[Edge], simulated: &[Edge], window: i64) -> i64 {
        let mut cost = vec![vec![0; simulated.len() + 1]; real.len() + 1];
        for a in 0..=real.len() {
            for b in 0..=simulated.len() {
                let mut least = if a + b == 0 { 0 } else { i64::MAX };
                if a > 0 {
                    least = least.min(cost[a - 1][b] + window);
                }
                if b > 0 {
                    least = least.min(cost[a][b - 1] + window);
                }
                if a > 0 && b > 0 && real[a - 1].rises == simulated[b - 1].rises {
                    let apart = (real[a - 1].at - simulated[b - 1].at).0.abs();
                    if apart <= window {
                        least = least.min(cost[a - 1][b - 1] + 2 * apart);
                    }
                }
                cost[a][b] = least;
            }
        }
        cost[real.len()][simulated.len()]
    }

    /// The doubled cost of a matching.
    fn cost(matched: &BoolResult, window: i64) -> i64 {
        let alone = matched.missing.len() + matched.extra.len();
        let apart = |(a, b): &(Edge, Edge)| 2 * (a.at - b.at).0.abs();
        let apart: i64 = matched.pairs.iter().map(apart).sum();
        apart + window * i64::try_from(alone).expect("few")
    }

    #[test]
    fn an_extra_pulse_is_named_and_moves_no_other_pair() {
        let real = edges(&[1000, 2000, 5000, 6000]);
        let simulated = edges(&[1010, 2010, 3000, 3050, 5010, 6010]);
        let found = matched(&real, &simulated, WINDOW);
        assert_eq!(
            pairs(&found),
            [(1000, 1010), (2000, 2010), (5000, 5010), (6000, 6010)]
        );
        assert_eq!(times(&found.extra), [3000, 3050]);
        assert!(found.missing.is_empty());
    }

    #[test]
    fn a_missing_pulse_is_named_and_edges_beyond_the_window_do_not_pair() {
        let real = edges(&[1000, 1100, 2000, 4000]);
        let simulated = edges(&[2020, 4501]);
        let found = matched(&real, &simulated, WINDOW);
        assert_eq!(pairs(&found), [(2000, 2020)]);
        assert_eq!(times(&found.missing), [1000, 1100, 4000]);
        assert_eq!(times(&found.extra), [4501]);
        let found = matched(&real, &edges(&[2020, 4500]), WINDOW);
        assert_eq!(pairs(&found), [(2000, 2020), (4000, 4500)]);
    }

    #[test]
    fn too_many_edges_narrow_the_window() {
        let many: Vec<i64> = (0..20_000).collect();
        let found = matched(&edges(&many), &edges(&many), WINDOW);
        assert!(found.window < WINDOW);
        assert_eq!(found.pairs.len(), many.len());
        assert!(found.pairs.iter().all(|(a, b)| a == b));
    }

    fn some_edges() -> impl Strategy<Value = Vec<Edge>> {
        proptest::collection::vec((1..200_i64, any::<bool>()), 0..25).prop_map(|steps| {
            let mut at = 0;
            let edge = |(step, rises)| {
                at += step;
                Edge {
                    at: Nanos(at),
                    rises,
                }
            };
            steps.into_iter().map(edge).collect()
        })
    }

    proptest! {
        #[test]
        fn no_matching_is_cheaper(real in some_edges(), simulated in some_edges(), window in 1..400_i64) {
            let found = matched(&real, &simulated, Nanos(window));
            prop_assert_eq!(cost(&found, window), least_cost(&real, &simulated, window));
            let rises = |(a, b): &(Edge, Edge)| a.rises == b.rises && (a.at - b.at).0.abs() <= window;
            prop_assert!(found.pairs.iter().all(rises));
            prop_assert!(found.pairs.is_sorted_by(|a, b| a.0.at < b.0.at && a.1.at < b.1.at));
            prop_assert_eq!(found.pairs.len() + found.missing.len(), real.len());
            prop_assert_eq!(found.pairs.len() + found.extra.len(), simulated.len());
        }

        #[test]
        fn a_moved_copy_matches_whole(steps in proptest::collection::vec(300..5000_i64, 1..40), moved in -140..140_i64) {
            let mut at = 0;
            let real: Vec<i64> = steps.iter().map(|step| { at += step; at }).collect();
            let moved_all: Vec<i64> = real.iter().map(|at| at + moved).collect();
            let found = matched(&edges(&real), &edges(&moved_all), WINDOW);
            prop_assert_eq!(found.pairs.len(), real.len());
            prop_assert!(pairs(&found).iter().all(|(a, b)| b - a == moved));
        }
    }
}
