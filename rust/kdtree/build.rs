//! How points come into leaf order.
//!
//! Splitting a large node over and over reads memory that no cache holds. So the points of a large tree are first sorted
//! into *tiles*, by bins of their coordinates. The median of a node lies in one of the bins: what is in bins before or
//! after goes left or right a tile at a time, and only the points of that bin are compared. Once a bin holds a good part
//! of a node, the points of the node are brought together and split one by one. The order is the same either way.

use super::{Bounds, GRAIN, range};
use crate::point::Point;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::ops::Range;

/// Trees of more points are built by tiles.
const TILED: usize = 1 << 19;

/// Up to so many points of tiles are brought together.
const TOGETHER: usize = 1 << 16;

/// Points that one thread sorts into tiles in one go.
const PORTION: usize = 1 << 17;

/// A node is split by tiles while a bin holds less than this part of its points.
const SHARE: usize = 4;

/// Every axis is cut into bins at so many sampled points for each.
const SAMPLED: usize = 64;

/// Scatters their numbers.
const SCATTER: usize = 0x9e37_79b9;

/// Bins of every axis: a few thousand tiles of each portion.
const fn bins<const D: usize>() -> usize {
    if D < 3 { 64 } else { 16 }
}

#[derive(Clone, Copy)]
struct Item<const D: usize> {
    point: Point<D>,
    index: u32,
}

impl<const D: usize> Item<D> {
    /// A number in the order by the coordinate, ties by index, which is compared without a branch.
    #[inline(always)]
    fn key(&self, axis: usize) -> u128 {
        u128::from(in_order(self.point[axis])) << 32 | u128::from(self.index)
    }
}

/// Points in leaf order and their original indices.
pub(super) fn arranged<const D: usize>(
    n: usize,
    point: impl Fn(usize) -> Point<D> + Sync,
    first_leaf: usize,
) -> (Vec<Point<D>>, Vec<u32>) {
    Build { n, first_leaf, tiled: TILED, together: TOGETHER, portion: PORTION }.arranged(point)
}

/// What is to be built, and the sizes by which.
#[derive(Clone, Copy)]
struct Build {
    n: usize,
    first_leaf: usize,
    tiled: usize,
    together: usize,
    portion: usize,
}

impl Build {
    fn arranged<const D: usize>(self, point: impl Fn(usize) -> Point<D> + Sync) -> (Vec<Point<D>>, Vec<u32>) {
        let (mut points, mut order) = (vec![[0.0; D]; self.n], vec![0; self.n]);
        let out = (&mut points[..], &mut order[..]);
        let item = |i: usize| Item { point: point(i), index: i as u32 };
        let Some(cuts) = (self.n > self.tiled).then(|| cuts(self.n, &point)).flatten() else {
            let items = (0..self.n).into_par_iter().with_min_len(GRAIN).map(item);
            self.finish(items.collect(), 1, out);
            return (points, order);
        };
        let firsts: Vec<usize> = (0..self.n).step_by(self.portion).collect();
        let portion = |&first: &usize| Portion::new(first..self.n.min(first + self.portion), item, &cuts);
        let mut portions: Vec<Portion<D>> = firsts.par_iter().map(portion).collect();
        let tiles = portions.iter_mut().flat_map(Portion::tiles).collect();
        self.split(tiles, 1, out);
        (points, order)
    }

    /// Brings the points of a node into leaf order.
    fn split<const D: usize>(
        self,
        tiles: Vec<Tile<'_, D>>,
        node: usize,
        (points, order): (&mut [Point<D>], &mut [u32]),
    ) {
        let axis = tiles.iter().fold(Bounds::EMPTY, |all, tile| all.merged(&tile.bounds)).widest();
        let middle = range(2 * node, self.n).len();
        let is_large = order.len() > self.together;
        let median = is_large.then(|| median_bin(&tiles, axis, middle)).filter(|bin| bin.count * SHARE <= order.len());
        let Some(MedianBin { bin, before, .. }) = median else {
            let mut items = Vec::with_capacity(order.len());
            tiles.iter().for_each(|tile| items.extend_from_slice(tile.items));
            return self.finish(items, node, (points, order));
        };
        let within = || tiles.iter().filter(|tile| tile.bins[axis] == bin);
        let mut keys: Vec<u128> = within().flat_map(|tile| tile.items.iter().map(|item| item.key(axis))).collect();
        let first_right = *keys.select_nth_unstable(middle - before).1;
        let (mut left, mut right) = (Vec::with_capacity(tiles.len()), Vec::with_capacity(tiles.len()));
        for tile in tiles {
            match tile.bins[axis].cmp(&bin) {
                Ordering::Less => left.push(tile),
                Ordering::Greater => right.push(tile),
                Ordering::Equal => {
                    let [one, other] = tile.parted(|item| item.key(axis) < first_right);
                    left.extend(one);
                    right.extend(other);
                }
            }
        }
        let ((left_points, right_points), (left_order, right_order)) =
            (points.split_at_mut(middle), order.split_at_mut(middle));
        rayon::join(
            || self.split(left, 2 * node, (left_points, left_order)),
            || self.split(right, 2 * node + 1, (right_points, right_order)),
        );
    }

    /// Brings items, which are those of a node, into leaf order.
    fn finish<const D: usize>(
        self,
        mut items: Vec<Item<D>>,
        node: usize,
        (points, order): (&mut [Point<D>], &mut [u32]),
    ) {
        arrange(&mut items, node, self.n, self.first_leaf);
        let places = points.par_iter_mut().zip(order).zip(items).with_min_len(GRAIN);
        places.for_each(|((point, index), item)| (*point, *index) = (item.point, item.index));
    }
}

/// The bin of an axis that holds the median of some tiles.
struct MedianBin {
    bin: u8,
    /// How many points are in the bins before, and in this one.
    before: usize,
    count: usize,
}

/// The bin with the point that `middle` others come before.
fn median_bin<const D: usize>(tiles: &[Tile<'_, D>], axis: usize, middle: usize) -> MedianBin {
    let mut counts = vec![0; bins::<D>()];
    tiles.iter().for_each(|tile| counts[tile.bins[axis] as usize] += tile.items.len());
    let (mut bin, mut before) = (0, 0);
    while before + counts[bin] <= middle {
        before += counts[bin];
        bin += 1;
    }
    MedianBin { bin: bin as u8, before, count: counts[bin] }
}

/// Where the bins of every axis begin, but for the first; `None` where the first split would find too much in one.
fn cuts<const D: usize>(n: usize, point: impl Fn(usize) -> Point<D>) -> Option<[Vec<f64>; D]> {
    let bins = bins::<D>();
    let step = (n / (SAMPLED * bins)).max(1);
    // not at equal steps, which may be whole rows of a grid
    let sample: Vec<Point<D>> = (0..n / step).map(|k| point(k * step + k.wrapping_mul(SCATTER) % step)).collect();
    let along: [Vec<f64>; D] = std::array::from_fn(|axis| {
        let mut along: Vec<f64> = sample.iter().map(|p| p[axis]).collect();
        along.sort_unstable_by(f64::total_cmp);
        along
    });
    let cuts = along.each_ref().map(|along| (1..bins).map(|k| along[k * along.len() / bins]).collect::<Vec<f64>>());
    let axis = Bounds::of(&sample).widest();
    let (cuts_along, along) = (&cuts[axis], &along[axis]);
    let median = bin(cuts_along, along[along.len() / 2]);
    let count = along.iter().filter(|&&x| bin(cuts_along, x) == median).count();
    (count * SHARE <= along.len()).then_some(cuts)
}

/// The bin of a coordinate.
#[inline(always)]
fn bin(cuts: &[f64], x: f64) -> usize {
    cuts.partition_point(|&cut| cut <= x)
}

/// Some points, sorted by tiles.
struct Portion<const D: usize> {
    items: Vec<Item<D>>,
    /// How many are in each tile, and their box.
    tiles: Vec<(usize, Bounds<D>)>,
}

impl<const D: usize> Portion<D> {
    fn new(own: Range<usize>, item: impl Fn(usize) -> Item<D>, cuts: &[Vec<f64>; D]) -> Self {
        let bins = bins::<D>();
        let tile = |p: &Point<D>| (0..D).fold(0, |tile, axis| tile * bins + bin(&cuts[axis], p[axis])) as u16;
        let given: Vec<(u16, Item<D>)> = own.map(item).map(|item| (tile(&item.point), item)).collect();
        let mut next = vec![0; bins.pow(D as u32) + 1];
        given.iter().for_each(|(tile, _)| next[*tile as usize + 1] += 1);
        (1..next.len()).for_each(|k| next[k] += next[k - 1]);
        let mut items = vec![Item { point: [0.0; D], index: 0 }; given.len()];
        for (tile, item) in given {
            let place = &mut next[tile as usize];
            items[*place] = item;
            *place += 1;
        }
        let mut start = 0;
        let ends = next[..next.len() - 1].iter();
        let tiles = ends.map(|&end| {
            let own = &items[std::mem::replace(&mut start, end)..end];
            (own.len(), Bounds::of(own.iter().map(|item| &item.point)))
        });
        Portion { tiles: tiles.collect(), items }
    }

    fn tiles(&mut self) -> impl Iterator<Item = Tile<'_, D>> {
        let bins = bins::<D>();
        let mut rest = &mut self.items[..];
        self.tiles.iter().enumerate().filter(|(_, (count, _))| *count > 0).map(move |(tile, &(count, bounds))| {
            let (items, others) = std::mem::take(&mut rest).split_at_mut(count);
            rest = others;
            let bin = |axis: usize| tile / bins.pow((D - 1 - axis) as u32) % bins;
            Tile { items, bins: std::array::from_fn(|axis| bin(axis) as u8), bounds }
        })
    }
}

/// Points of a node that are in the same bin of every axis, or some of these.
struct Tile<'a, const D: usize> {
    items: &'a mut [Item<D>],
    bins: [u8; D],
    bounds: Bounds<D>,
}

impl<'a, const D: usize> Tile<'a, D> {
    /// Its points for which something holds, and the others; `None` where there are none.
    fn parted(self, holds: impl Fn(&Item<D>) -> bool) -> [Option<Tile<'a, D>>; 2] {
        let Tile { items, bins, .. } = self;
        let mut count = 0;
        for k in 0..items.len() {
            let is_one = holds(&items[k]);
            items.swap(count, k);
            count += usize::from(is_one);
        }
        let (ones, others) = items.split_at_mut(count);
        [ones, others].map(|items| {
            let bounds = Bounds::of(items.iter().map(|item| &item.point));
            (!items.is_empty()).then_some(Tile { items, bins, bounds })
        })
    }
}

/// A number in the order of [`f64::total_cmp`].
#[inline(always)]
fn in_order(x: f64) -> u64 {
    let bits = x.to_bits();
    // all bits of negative numbers are turned, the sign only of others
    bits ^ ((bits as i64 >> 63) as u64 | 1 << 63)
}

/// Brings the items of `node` into leaf order.
fn arrange<const D: usize>(items: &mut [Item<D>], node: usize, whole: usize, first_leaf: usize) {
    if node >= first_leaf {
        items.sort_unstable_by_key(|item| (item.point.map(in_order), item.index));
        return;
    }
    let axis = Bounds::of(items.iter().map(|item| &item.point)).widest();
    let middle = range(2 * node, whole).len();
    if middle < items.len() {
        items.select_nth_unstable_by_key(middle, |item| item.key(axis));
    }
    let (left, right) = items.split_at_mut(middle);
    if left.len() + right.len() > GRAIN {
        rayon::join(|| arrange(left, 2 * node, whole, first_leaf), || arrange(right, 2 * node + 1, whole, first_leaf));
    } else {
        arrange(left, 2 * node, whole, first_leaf);
        arrange(right, 2 * node + 1, whole, first_leaf);
    }
}

#[cfg(test)]
mod tests {
    use super::{Build, Item, arrange};
    use crate::point::Point;
    use proptest::prelude::*;

    fn agrees<const D: usize>(points: &[Point<D>], together: usize, portion: usize) -> Result<(), TestCaseError> {
        let n = points.len();
        let mut first_leaf = 1;
        while n.div_ceil(first_leaf) > 3 {
            first_leaf *= 2;
        }
        let mut items: Vec<Item<D>> = (0..n).map(|i| Item { point: points[i], index: i as u32 }).collect();
        arrange(&mut items, 1, n, first_leaf);
        let build = Build { n, first_leaf, tiled: together, together, portion };
        let (in_order, order) = build.arranged(|i| points[i]);
        prop_assert_eq!(order, items.iter().map(|item| item.index).collect::<Vec<_>>());
        prop_assert_eq!(in_order, items.iter().map(|item| item.point).collect::<Vec<_>>());
        Ok(())
    }

    /// Many coordinates twice and more, both zeros among them.
    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            -1.0..1.0f64,
            (-9..9i32).prop_map(f64::from),
            Just(-0.0),
            Just(0.0),
            (-300..300i32).prop_map(|e| 10f64.powi(e))
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn tiles_lead_to_the_same_order_on_a_line(
            points in prop::collection::vec([coordinate()].prop_map(|[x]| [x]), 0..1500), together in 3..300usize, portion in 1..900usize,
        ) {
            agrees(&points, together, portion)?;
        }

        #[test]
        fn tiles_lead_to_the_same_order_in_a_plane(
            points in prop::collection::vec([coordinate(), coordinate()], 0..1500), together in 3..300usize, portion in 1..900usize,
        ) {
            agrees(&points, together, portion)?;
        }

        #[test]
        fn tiles_lead_to_the_same_order_in_space(
            points in prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..1500), together in 3..300usize, portion in 1..900usize,
        ) {
            agrees(&points, together, portion)?;
        }
    }
}
