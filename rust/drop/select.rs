//! Which nodes a level of a simplified domain keeps.
//!
//! Facet vertices come before interior nodes, all under the conflict rule, in this order:
//!
//! 1. Those that stand out at the scale of f, the sharpest first. Those that do so at f/2 too (corners, not the vertices
//!    beside one) may be twice as near to each other: what is lost with the corner of a thin part is much.
//! 2. Those that stand out at f/2 only: what is no corner should not keep out what is one on a finer level.
//! 3. The other vertices of walls, then those of interfaces, as they follow each other along their chains, the longest chain
//!    first, each from its first kept vertex on: kept vertices then lie as densely as conflicts allow, and chords cut
//!    off least.
//! 4. The farthest vertices of wall chords that cut off or add more than [`COSTLY`] of the area, the costliest first, under
//!    the rule for a spacing of [`NEARER`] times f; then again for the chords that this makes, [`PUT_BACK`] times in all.
//!
//! Vertices of parts that share no vertex do not conflict: no cell has nodes of both. A part that is no larger than f has no
//! nodes at all; its interior nodes would otherwise crowd the corners that it has on finer levels.

use super::Parts;
use crate::domain::Domain;
use crate::error::Error;
use crate::kdtree::KdTree;
use crate::level::{Candidates, Choice, Rules, Seeds, select_interior};
use crate::point::Point;
use crate::progress::Progress;
use crate::selection::greedy;
use rayon::prelude::*;

/// A chord that changes the area by a larger share than this is split.
const COSTLY: f64 = 0.01;

/// How near vertices that split a chord may be to each other, and to others.
const NEARER: f64 = 0.5;

/// Rounds of that.
const PUT_BACK: usize = 3;

/// Vertices that one thread looks at in one go.
const AT_ONCE: usize = 64;

/// What selection goes by.
#[derive(Clone, Copy)]
pub struct Terms<'a> {
    /// The parameters of Figure 2.
    pub rules: Rules,
    /// By how much nodes may be nearer inside.
    pub denser: f64,
    /// Cosine of the feature angle.
    pub cos_feature: f64,
    /// Facet vertices that may not be kept; empty where all may be.
    pub is_barred: &'a [bool],
    /// The parts of the input.
    pub parts: &'a Parts,
}

/// Facet vertices, among which some are picked.
struct Picker<'a> {
    candidates: &'a Candidates<'a>,
    beta: f64,
    /// Where there are several groups of parts: facet vertices, each group on a plane of its own.
    apart: Option<KdTree<3>>,
    progress: &'a Progress,
}

impl<'a> Picker<'a> {
    fn new(
        domain: &'a Domain,
        candidates: &'a Candidates<'a>,
        f: &[f64],
        terms: Terms<'_>,
        progress: &'a Progress,
    ) -> Picker<'a> {
        let group = &terms.parts.group;
        let apart = (!group.is_empty()).then(|| {
            let all = 0..domain.len() as u32;
            // planes are farther apart than any two points conflict
            let step = 2.0 * all.clone().map(|k| f[k as usize]).fold(0.0, f64::max);
            let place = |k: u32| {
                let [x, y] = *candidates.point(k);
                [x, y, step * f64::from(group[candidates.nodes[k as usize] as usize])]
            };
            KdTree::new(&all.map(place).collect::<Vec<Point<3>>>())
        });
        Picker { candidates, beta: terms.rules.beta, apart, progress }
    }

    /// Adds those in `order` to `kept` that conflict with none there, for the spacing `room` of candidates; returns whether there were
    /// any.
    fn pick(&self, kept: &mut [bool], room: &[f64], order: &[u32]) -> Result<bool, Error> {
        let keep: Vec<u32> = (0..kept.len() as u32).filter(|&v| kept[v as usize]).collect();
        let picked = match &self.apart {
            None => greedy(&self.candidates.tree, room, self.beta, order, &keep, self.progress)?,
            Some(tree) => greedy(tree, &room[..kept.len()], self.beta, order, &keep, self.progress)?,
        };
        picked.iter().for_each(|&v| kept[v as usize] = true);
        Ok(!picked.is_empty())
    }
}

/// Selects a level's interior nodes beside the facet vertices that it keeps, keeping `seeds`.
pub fn select_inside(
    domain: &Domain,
    candidates: &Candidates<'_>,
    f: &[f64],
    kept: Vec<bool>,
    mut seeds: Seeds<'_>,
    terms: Terms<'_>,
    progress: &Progress,
) -> Result<Choice, Error> {
    let obstacles: Vec<Point<2>> = seeds.candidates.iter().map(|&k| *candidates.point(k)).collect();
    let chords = domain.valid_chords(&kept, f, &obstacles, &[]);
    let mut rules = terms.rules;
    rules.beta *= terms.denser;
    // a known set is maximal for the plain beta only
    seeds.known = seeds.known.filter(|_| terms.denser == 1.0);
    let (mut interior, _) = select_interior(domain, candidates, f, seeds, &kept, &chords, rules, progress)?;
    let lost = terms.parts.no_larger(domain, &domain.specks(&f[..domain.len()]));
    if lost.iter().any(|&lost| lost) {
        interior.retain(|&node| !lost[terms.parts.first(node) as usize]);
    }
    Ok(Choice { kept, interior, chords, ..Choice::default() })
}

/// Selects a level's facet vertices, keeping `seeds` (those of the next coarser level, empty for none).
pub fn select_facets(
    domain: &Domain,
    candidates: &Candidates<'_>,
    f: &[f64],
    seeds: &[bool],
    terms: Terms<'_>,
    progress: &Progress,
) -> Result<Vec<bool>, Error> {
    let facets = domain.len();
    let mut kept = if seeds.is_empty() { vec![false; facets] } else { seeds.to_vec() };
    let is_speck = domain.specks(&f[..facets]);
    let may_stay = |v: u32| {
        let is_barred = terms.is_barred.get(v as usize).is_some_and(|&barred| barred);
        !is_barred && !is_speck[domain.chain_of(v) as usize]
    };
    let (mut corners, mut lesser, mut order) = (Vec::new(), Vec::new(), Vec::new());
    let mut room = f.to_vec();
    let asked: Vec<u32> = (0..facets as u32).filter(|&v| !kept[v as usize] && may_stay(v)).collect();
    let sharpness = |&v: &u32| {
        let at = |scale: f64| domain.stands_out(v, scale * f[v as usize], terms.cos_feature);
        (v, at(1.0), at(0.5))
    };
    let sharp: Vec<(u32, Option<f64>, Option<f64>)> = asked.par_iter().with_min_len(AT_ONCE).map(sharpness).collect();
    for (v, at_f, at_half) in sharp {
        match (at_f, at_half) {
            (Some(sharpness), _) => corners.push((sharpness, v)),
            (None, Some(sharpness)) => lesser.push((sharpness, v)),
            (None, None) => order.push(v),
        }
        if at_f.and(at_half).is_some() {
            room[v as usize] /= 2.0;
        }
    }
    let picker = Picker::new(domain, candidates, f, terms, progress);
    picker.pick(&mut kept, &room, &largest_first(corners))?;
    let is_wall = |&v: &u32| !domain.chains[domain.chain_of(v) as usize].edges[0].interior;
    let mut rest = largest_first(lesser);
    let (walls, inner): (Vec<u32>, Vec<u32>) = along_chains(domain, &order, &kept).into_iter().partition(is_wall);
    rest.extend(walls.into_iter().chain(inner));
    picker.pick(&mut kept, f, &rest)?;
    let nearer: Vec<f64> = f.iter().map(|f| NEARER * f).collect();
    let most = COSTLY * domain.area();
    for _ in 0..PUT_BACK {
        let back = costly(domain, &kept, f, most, may_stay);
        if !picker.pick(&mut kept, &nearer, &back)? {
            break;
        }
    }
    Ok(kept)
}

/// Ties by vertex.
fn largest_first(mut vertices: Vec<(f64, u32)>) -> Vec<u32> {
    vertices.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    vertices.into_iter().map(|(_, v)| v).collect()
}

/// Facet vertices in their order along the chains, the longest chain first (ties by number), each from its first kept
/// vertex on; one on several chains comes with the first of them.
fn along_chains(domain: &Domain, order: &[u32], kept: &[bool]) -> Vec<u32> {
    let mut is_asked = vec![false; domain.len()];
    order.iter().for_each(|&v| is_asked[v as usize] = true);
    let mut chains: Vec<usize> = (0..domain.chains.len()).collect();
    chains.sort_by(|&a, &b| domain.chains[b].length().total_cmp(&domain.chains[a].length()));
    let mut walk = Vec::with_capacity(order.len());
    for c in chains {
        let vertices = &domain.chains[c].vertices;
        let start = vertices.iter().position(|&v| kept[v as usize]).unwrap_or(0);
        let around = vertices[start..].iter().chain(&vertices[..start]);
        walk.extend(around.filter(|&&v| std::mem::take(&mut is_asked[v as usize])));
    }
    walk
}

/// The farthest vertices of wall chords that change the area by more than `most`, the costliest first. Chords that leave their chain by more
/// than f will be given up, and have none.
fn costly(domain: &Domain, kept: &[bool], f: &[f64], most: f64, may_stay: impl Fn(u32) -> bool) -> Vec<u32> {
    let mut costly = Vec::new();
    for chord in domain.chords(kept).iter().filter(|chord| chord.deviation_2 > 0.0 && may_stay(chord.farthest)) {
        let [a, b] = chord.vertices.map(|v| f[v as usize]);
        let reach = a.max(b);
        if chord.deviation_2 <= reach * reach && domain.is_outer(chord.chain) {
            let cost = domain.strips(chord).iter().sum();
            if cost > most {
                costly.push((cost, chord.farthest));
            }
        }
    }
    largest_first(costly)
}
