//! Slivers that can't be peeled off: a node of each is taken out, the one whose star is best without it.
//!
//! The star of a node without the node is a polygon. Of all its triangulations the constrained Delaunay one has the
//! greatest smallest angle, so that angle is found by dynamic programming over the polygon's diagonals, and no
//! triangulation is made for a node that stays. What the whole triangulation makes of it is seen in the next round.

use super::trim::{Trimmed, angles};
use crate::point::{NONE, Point, distance_2, orient};

/// Stars with more corners are not considered.
const MOST_CORNERS: usize = 24;

/// What taking out a site does to its star, the best last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Gain {
    /// No better, but the shortest edge of a sliver is gone.
    Thins,
    /// Better, though not all well.
    Better,
    /// No sliver is left.
    Mends,
}

/// A site that could be taken out.
struct Candidate {
    gain: Gain,
    cost: u32,
    /// Smallest angle of the star without it.
    after: f64,
    site: u32,
    link: Vec<u32>,
}

impl Candidate {
    fn is_better(&self, other: &Candidate) -> bool {
        let order = self.gain.cmp(&other.gain).then(other.cost.cmp(&self.cost));
        order.then(self.after.total_cmp(&other.after)).is_gt()
    }
}

impl Trimmed {
    /// Sites to be taken out so that cells under `limit_deg` vanish, no two of them in one star. Of the corners of a sliver
    /// the one goes whose loss gains most, of equals the one that costs least, of equals the one that leaves the best star.
    pub fn victims(&self, limit_deg: f64, cost: impl Fn(u32) -> u32) -> Vec<u32> {
        let mut bad: Vec<(f64, usize)> =
            self.alive().map(|t| (self.angle[t], t)).filter(|&(angle, _)| angle < limit_deg).collect();
        bad.sort_unstable_by(|a, b| {
            a.0.total_cmp(&b.0).then_with(|| self.cells[a.1].corners.cmp(&self.cells[b.1].corners))
        });
        let mut touched = vec![false; self.sites.len()];
        let mut victims = Vec::new();
        for (_, t) in bad {
            let mut best: Option<Candidate> = None;
            for k in 0..3 {
                let s = self.cells[t].corners[k];
                let Some((star, link)) = self.star(t, k) else { continue };
                if touched[s as usize] || link.iter().any(|&l| touched[l as usize]) {
                    continue;
                }
                let before = star.iter().map(|&t| self.angle[t]).fold(f64::INFINITY, f64::min);
                let after = self.best_angle(&link);
                let gain = if after >= limit_deg {
                    Gain::Mends
                } else if after > before {
                    Gain::Better
                } else if self.is_short(t, k) {
                    Gain::Thins
                } else {
                    continue;
                };
                let candidate = Candidate { gain, cost: cost(s), after, site: s, link };
                if best.as_ref().is_none_or(|best| candidate.is_better(best)) {
                    best = Some(candidate);
                }
            }
            if let Some(Candidate { site: s, link, .. }) = best {
                link.iter().for_each(|&l| touched[l as usize] = true);
                touched[s as usize] = true;
                victims.push(s);
            }
        }
        victims
    }

    /// Whether a corner of a cell is an end of its shortest edge.
    fn is_short(&self, t: usize, k: usize) -> bool {
        let p = self.cells[t].corners.map(|s| self.points[s as usize]);
        let length = |k: usize| distance_2(&p[k % 3], &p[(k + 1) % 3]);
        length(k + 1) > length(k).min(length(k + 2))
    }

    /// Cells around a corner of a cell, in their order, and the polygon of their other corners. `None` where the cells
    /// around the site are in several sectors.
    fn star(&self, t: usize, k: usize) -> Option<(Vec<usize>, Vec<u32>)> {
        let s = self.cells[t].corners[k];
        // a star of as many cells has as many corners at least; nodes of thousands of slivers are asked by each of them
        let star = self.sector_within(t, s, MOST_CORNERS)?;
        let in_all = self.around(t, s).filter(|&t| self.label[t].is_some()).count();
        if in_all != star.len() {
            return None;
        }
        let mut link: Vec<u32> = star.iter().map(|&t| self.cells[t].corners[(self.corner(t, s) + 1) % 3]).collect();
        let (first, last) = (star[0], star[star.len() - 1]);
        let end = self.cells[last].corners[(self.corner(last, s) + 2) % 3];
        if self.across(first, self.corner(first, s)) == NONE {
            link.push(end);
        }
        (link.len() >= 3 && link.len() <= MOST_CORNERS).then_some((star, link))
    }

    /// The smallest angle of the best triangulation of a polygon, 0 where it has none.
    fn best_angle(&self, polygon: &[u32]) -> f64 {
        let n = polygon.len();
        let p: Vec<Point<2>> = polygon.iter().map(|&s| self.points[s as usize]).collect();
        let mut best = vec![vec![f64::INFINITY; n]; n];
        for span in 2..n {
            for i in 0..n - span {
                let j = i + span;
                best[i][j] = (i + 1..j)
                    .map(|k| {
                        let corners = [p[i], p[k], p[j]];
                        let own = if orient(&p[i], &p[k], &p[j]) > 0.0 { least(&corners) } else { 0.0 };
                        own.min(best[i][k]).min(best[k][j])
                    })
                    .fold(0.0, f64::max);
            }
        }
        best[0][n - 1]
    }
}

fn least(corners: &[Point<2>; 3]) -> f64 {
    let [a, b, c] = angles(corners);
    a.min(b).min(c)
}
