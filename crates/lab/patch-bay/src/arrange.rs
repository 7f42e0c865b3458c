//! Places for the boxes of clients: sources to the left, what they feed to the right, and few crossings.

use std::collections::BTreeSet;

/// The size of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: i32,
    pub(crate) height: i32,
}

/// The upper left corner of a box, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Spot {
    pub(crate) x: i32,
    pub(crate) y: i32,
}

/// The width to which groups of connected boxes are placed beside each other.
const SHEET: i32 = 1340;

/// With more boxes than this the sheet is twice as wide.
const CROWD: usize = 60;

/// A column that is higher is divided.
const HIGHEST: i32 = 1400;

/// The free space beneath a box.
const BELOW: i32 = 36;

/// The free space beside a box for one cable, and for each further one, up to the widest.
const BESIDE: i32 = 60;
const PER_CABLE: i32 = 10;
const WIDEST: i32 = 110;

/// The height of a channel; page.css has the same.
pub(crate) const ROW: i32 = 30;

/// The sweeps that reduce crossings.
const SWEEPS: usize = 6;

/// Places all boxes. `links` are pairs of a source and what it feeds.
pub(crate) fn arrange(sizes: &[Size], links: &[(usize, usize)]) -> Vec<Spot> {
    let mut spots = vec![Spot { x: 0, y: 0 }; sizes.len()];
    let sheet = if sizes.len() > CROWD {
        2 * SHEET
    } else {
        SHEET
    };
    let (mut x, mut y, mut row) = (0, 0, 0);
    for part in parts(sizes.len(), links) {
        let extent = arrange_part(&part, sizes, links, &mut spots);
        if x > 0 && x + extent.width > sheet {
            (x, y, row) = (0, y + row + BELOW, 0);
        }
        for at in part {
            spots[at].x += x;
            spots[at].y += y;
        }
        x += extent.width + BESIDE;
        row = row.max(extent.height);
    }
    spots
}

/// The first box of the part that a box belongs to.
fn root(of: &mut [usize], mut at: usize) -> usize {
    while of[at] != at {
        of[at] = of[of[at]];
        at = of[at];
    }
    at
}

/// The connected parts: those with links in the order of their first boxes, then the single boxes.
fn parts(count: usize, links: &[(usize, usize)]) -> Vec<Vec<usize>> {
    let mut of: Vec<usize> = (0..count).collect();
    for (from, to) in links {
        let (one, other) = (root(&mut of, *from), root(&mut of, *to));
        of[one.max(other)] = one.min(other);
    }
    let mut parts = vec![Vec::new(); count];
    for at in 0..count {
        parts[root(&mut of, at)].push(at);
    }
    let (mut linked, single): (Vec<_>, Vec<_>) = parts
        .into_iter()
        .filter(|part| !part.is_empty())
        .partition(|part| part.len() > 1);
    linked.extend(single);
    linked
}

/// Places one connected part at the origin; returns its size.
fn arrange_part(
    part: &[usize],
    sizes: &[Size],
    links: &[(usize, usize)],
    spots: &mut [Spot],
) -> Size {
    let local = |at: usize| part.binary_search(&at).ok();
    let pairs = links
        .iter()
        .filter_map(|(from, to)| Some((local(*from)?, local(*to)?)));
    let graph = Graph::new(part.len(), pairs.filter(|(from, to)| from != to));
    let columns = graph.columns();
    let heights: Vec<i32> = part.iter().map(|at| sizes[*at].height).collect();
    let columns = divided(columns, &heights);
    let height_of = |column: &[usize]| -> i32 {
        column.iter().map(|at| heights[*at] + BELOW).sum::<i32>() - BELOW
    };
    let tallest = columns.iter().map(|column| height_of(column)).max();
    let tallest = tallest.unwrap_or_default();
    let mut x = 0;
    for (place, column) in columns.iter().enumerate() {
        // Channels beside each other are at the same height.
        let mut y = (tallest - height_of(column)) / 2 / ROW * ROW;
        for at in column {
            spots[part[*at]] = Spot { x, y };
            y += heights[*at] + BELOW;
        }
        let widest = column.iter().map(|at| sizes[part[*at]].width).max();
        x += widest.unwrap_or_default();
        if place + 1 < columns.len() {
            let cables = column
                .iter()
                .map(|at| graph.of[*at].after.len())
                .sum::<usize>();
            x += gap(cables);
        }
    }
    Size {
        width: x,
        height: tallest,
    }
}

/// The space between two columns with this many cables.
fn gap(cables: usize) -> i32 {
    let cables = i32::try_from(cables).unwrap_or(WIDEST);
    cables
        .saturating_mul(PER_CABLE)
        .saturating_add(BESIDE)
        .min(WIDEST)
}

/// Columns that are not too high.
fn divided(columns: Vec<Vec<usize>>, heights: &[i32]) -> Vec<Vec<usize>> {
    let mut all = Vec::new();
    for column in columns {
        let mut height = 0;
        let mut piece = Vec::new();
        for at in column {
            if !piece.is_empty() && height + heights[at] > HIGHEST {
                all.push(std::mem::take(&mut piece));
                height = 0;
            }
            height += heights[at] + BELOW;
            piece.push(at);
        }
        all.push(piece);
    }
    all
}

/// The neighbours of a box, one for each cable.
#[derive(Clone, Default)]
struct Neighbours {
    before: Vec<usize>,
    after: Vec<usize>,
}

struct Graph {
    of: Vec<Neighbours>,
}

impl Graph {
    fn new(count: usize, pairs: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut of = vec![Neighbours::default(); count];
        for (from, to) in pairs {
            of[from].after.push(to);
            of[to].before.push(from);
        }
        Self { of }
    }

    /// The boxes from left to right, and in each column from top to bottom.
    fn columns(&self) -> Vec<Vec<usize>> {
        let order = self.order();
        let mut rank = vec![0; self.of.len()];
        for (place, at) in order.iter().enumerate() {
            rank[*at] = place;
        }
        // Links against the order close a cycle, and do not count.
        let mut column = vec![0; self.of.len()];
        for at in &order {
            for next in self.of[*at]
                .after
                .iter()
                .filter(|next| rank[**next] > rank[*at])
            {
                column[*next] = column[*next].max(column[*at] + 1);
            }
        }
        // A source stands directly in front of what it feeds.
        for at in order.iter().rev() {
            let next = self.of[*at]
                .after
                .iter()
                .filter(|next| rank[**next] > rank[*at]);
            let is_first = !self.of[*at].before.iter().any(|it| rank[*it] < rank[*at]);
            if let Some(least) = next.map(|next| column[*next]).min()
                && is_first
            {
                column[*at] = least - 1;
            }
        }
        let mut columns = vec![Vec::new(); column.iter().max().map_or(0, |most| most + 1)];
        for at in 0..self.of.len() {
            columns[column[at]].push(at);
        }
        columns.retain(|column| !column.is_empty());
        self.untangle(&mut columns);
        columns
    }

    /// An order in which few links lead back: sources first, sinks last, and of a cycle the box with the most outputs.
    fn order(&self) -> Vec<usize> {
        let count = self.of.len();
        let mut left: BTreeSet<usize> = (0..count).collect();
        let mut before: Vec<usize> = self.of.iter().map(|it| it.before.len()).collect();
        let mut after: Vec<usize> = self.of.iter().map(|it| it.after.len()).collect();
        let (mut head, mut tail) = (Vec::new(), Vec::new());
        while !left.is_empty() {
            let source = left.iter().find(|at| before[**at] == 0);
            let sink = left.iter().find(|at| after[**at] == 0);
            let most = left.iter().rev().max_by_key(|at| {
                let signed = |count: usize| i64::try_from(count).unwrap_or_default();
                let surplus = signed(after[**at]) - signed(before[**at]);
                // Of equals, the one that has sources on the left.
                (surplus, self.of[**at].before.len() - before[**at])
            });
            let Some(at) = source.or(sink).or(most).copied() else {
                break;
            };
            if before[at] > 0 && after[at] == 0 {
                tail.push(at);
            } else {
                head.push(at);
            }
            left.remove(&at);
            for next in &self.of[at].after {
                before[*next] -= 1;
            }
            for last in &self.of[at].before {
                after[*last] -= 1;
            }
        }
        head.extend(tail.into_iter().rev());
        head
    }

    /// Sorts each column by the mean heights of the neighbours, to and fro.
    #[allow(clippy::cast_precision_loss, reason = "places in a column are small")]
    fn untangle(&self, columns: &mut [Vec<usize>]) {
        let mut height = vec![0.0; self.of.len()];
        let set = |column: &[usize], height: &mut [f64]| {
            for (place, at) in column.iter().enumerate() {
                height[*at] = place as f64 - column.len() as f64 / 2.0;
            }
        };
        for column in columns.iter() {
            set(column, &mut height);
        }
        for sweep in 0..SWEEPS {
            let is_forth = sweep % 2 == 0;
            let count = columns.len();
            for place in 0..count {
                let column = &mut columns[if is_forth { place } else { count - 1 - place }];
                let wanted = |at: usize| {
                    let all = &self.of[at];
                    let near = if is_forth { &all.before } else { &all.after };
                    if near.is_empty() {
                        return height[at];
                    }
                    near.iter().map(|it| height[*it]).sum::<f64>() / near.len() as f64
                };
                let mut sorted: Vec<(f64, usize)> =
                    column.iter().map(|at| (wanted(*at), *at)).collect();
                sorted.sort_by(|one, other| one.0.total_cmp(&other.0));
                *column = sorted.into_iter().map(|(_, at)| at).collect();
                set(column, &mut height);
            }
        }
    }
}

/// A box that has its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Placed {
    pub(crate) spot: Spot,
    pub(crate) size: Size,
}

impl Placed {
    /// True if the boxes overlap.
    pub(crate) fn covers(&self, other: &Self) -> bool {
        let (one, two) = (self.spot, other.spot);
        one.x < two.x + other.size.width
            && two.x < one.x + self.size.width
            && one.y < two.y + other.size.height
            && two.y < one.y + self.size.height
    }

    /// True if the boxes overlap, or have less than the usual space between them.
    pub(crate) fn is_near(&self, other: &Self) -> bool {
        let (one, two) = (self.spot, other.spot);
        one.x < two.x + other.size.width + BESIDE
            && two.x < one.x + self.size.width + BESIDE
            && one.y < two.y + other.size.height + BELOW
            && two.y < one.y + self.size.height + BELOW
    }
}

/// A free place for one more box: right of its sources, left of what it feeds, near their height.
pub(crate) fn beside(size: Size, sources: &[Placed], sinks: &[Placed], all: &[Placed]) -> Spot {
    let right = sources
        .iter()
        .map(|it| it.spot.x + it.size.width + BESIDE)
        .max();
    let left = sinks.iter().map(|it| it.spot.x - size.width - BESIDE).min();
    let x = right.or(left).unwrap_or_default().max(0);
    let near: Vec<i32> = sources.iter().chain(sinks).map(|it| it.spot.y).collect();
    let count = i64::try_from(near.len()).unwrap_or(1).max(1);
    let sum = near.iter().map(|y| i64::from(*y)).sum::<i64>();
    let y = i32::try_from(sum / count).unwrap_or_default();
    // Beside or beneath a box is free space, if anywhere.
    let xs = all.iter().map(|it| it.spot.x + it.size.width + BESIDE);
    let xs: BTreeSet<i32> = xs
        .filter(|at| at + size.width <= SHEET)
        .chain([0, x])
        .collect();
    let ys = all
        .iter()
        .flat_map(|it| [it.spot.y, it.spot.y + it.size.height + BELOW]);
    let ys: BTreeSet<i32> = ys.chain([0, y]).collect();
    let spots = ys
        .iter()
        .flat_map(|y| xs.iter().map(|x| Spot { x: *x, y: *y }));
    let mut spots: Vec<Spot> = spots.collect();
    let is_linked = !near.is_empty();
    spots.sort_by_key(|spot| {
        // Another column is worse than another height. A box without links takes the first row with space.
        let away = if is_linked {
            3 * (spot.x - x).abs()
        } else {
            spot.x
        };
        let down = (spot.y - y).abs();
        if is_linked {
            away + down
        } else {
            down * 16 + away
        }
    });
    let is_free = |spot: &Spot| {
        !all.iter()
            .any(|it| it.is_near(&Placed { spot: *spot, size }))
    };
    spots
        .into_iter()
        .find(is_free)
        .unwrap_or_else(|| under(all))
}

/// The place below all boxes.
pub(crate) fn under(all: &[Placed]) -> Spot {
    let y = all
        .iter()
        .map(|it| it.spot.y + it.size.height + BELOW)
        .max();
    Spot {
        x: 0,
        y: y.unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: Size = Size {
        width: 232,
        height: 100,
    };

    fn boxes(spots: &[Spot]) -> Vec<Placed> {
        let placed = spots.iter().map(|spot| Placed {
            spot: *spot,
            size: BOX,
        });
        placed.collect()
    }

    fn assert_apart(all: &[Placed]) {
        for (at, one) in all.iter().enumerate() {
            for other in &all[at + 1..] {
                let slack = Placed {
                    spot: Spot {
                        x: one.spot.x + BESIDE / 2,
                        y: one.spot.y + BELOW / 2,
                    },
                    size: Size {
                        width: one.size.width - BESIDE,
                        height: one.size.height - BELOW,
                    },
                };
                assert!(!slack.is_near(other), "{one:?} {other:?}");
            }
        }
    }

    #[test]
    fn sources_are_left_of_what_they_feed_also_in_a_cycle() {
        // Most cables lead from the second box to the first one, one leads back.
        let spots = arrange(&[BOX; 2], &[(0, 1), (1, 0), (1, 0)]);
        assert!(spots[1].x < spots[0].x, "{spots:?}");
        // Switches feed a controller, it feeds another one, and that a tank, which answers the first one.
        let links = [(3, 1), (1, 2), (2, 0), (0, 1)];
        let spots = arrange(&[BOX; 4], &links);
        assert_apart(&boxes(&spots));
        for (from, to) in &links[..3] {
            assert!(spots[*from].x < spots[*to].x, "{from} {to} {spots:?}");
        }
    }

    #[test]
    fn crossings_are_avoided_and_parts_stand_apart() {
        let links = [(0, 7), (1, 6), (2, 5), (3, 4), (8, 9)];
        let spots = arrange(&[BOX; 12], &links);
        assert_apart(&boxes(&spots));
        let four = [(0, 7), (1, 6), (2, 5), (3, 4)];
        for (one, other) in four
            .iter()
            .flat_map(|one| four.iter().map(move |other| (one, other)))
        {
            let sources = spots[one.0].y.cmp(&spots[other.0].y);
            assert_eq!(
                sources,
                spots[one.1].y.cmp(&spots[other.1].y),
                "{one:?} {other:?}"
            );
        }
        // A hundred sources of one client: several columns, all of them left of it.
        let links: Vec<(usize, usize)> = (1..100).map(|from| (from, 0)).collect();
        let spots = arrange(&[BOX; 100], &links);
        assert_apart(&boxes(&spots));
        assert!(spots[1..].iter().all(|spot| spot.x < spots[0].x));
        assert!(spots.iter().all(|spot| spot.y <= HIGHEST));
    }

    #[test]
    fn a_further_box_finds_a_free_place_at_its_side() {
        let all = boxes(&arrange(&[BOX; 6], &[(0, 1), (1, 2), (2, 3)]));
        let place = |sources: &[Placed], sinks: &[Placed]| {
            let spot = beside(BOX, sources, sinks, &all);
            let new = Placed { spot, size: BOX };
            assert!(!all.iter().any(|it| it.is_near(&new)), "{spot:?}");
            spot
        };
        assert!(place(&all[1..2], &[]).x > all[1].spot.x);
        assert!(place(&[], &all[2..3]).x < all[2].spot.x);
        place(&all[..1], &all[3..4]);
        place(&[], &[]);
        assert_eq!(beside(BOX, &[], &[], &[]), Spot { x: 0, y: 0 });
        // Without space at its side it stands elsewhere.
        let mut many: Vec<Placed> = Vec::new();
        for _ in 0..40 {
            let spot = beside(BOX, &[], &[], &many);
            many.push(Placed { spot, size: BOX });
        }
        assert_apart(&many);
        assert!(many.iter().all(|it| it.spot.x < SHEET));
    }
}
