//! ONE_LEVEL_COARSEN (Figure 2), on domains with facets.
//!
//! Steps: (1) classes P0 (corners), P1 (other facet vertices), P2 (interior nodes); (2) f is given at all candidates;
//! (3) facet vertices are selected first, P0 kept whole, then P1 greedily; vertices are put back until their chords are a
//! valid coarse domain; (4) the interior candidates keep away from the *coarse* facets by delta * f and stay inside;
//! (5) a maximal independent set of their conflict graph, after all that was kept before; (6) the constrained Delaunay
//! triangulation of what is kept, cells outside flooded away.
//!
//! The order within a class is that of [`rank`] and [`greedy_in_tiles`]. Departures from the figure: distances are taken to the
//! chords rather than to the input's boundary, and chords are repaired; on the unit square both are the same.

mod assemble;

use crate::domain::{Chord, Domain, segment_distance_2};
use crate::error::Error;
use crate::kdtree::{Bounds, KdTree};
use crate::point::{NONE, Point, distance};
use crate::progress::Progress;
use crate::selection::{Known, conflict_graph, greedy, greedy_after, greedy_in_tiles, rank};
use crate::triangulation::{Cell, Constraint, Inside, inside, sort_spatially};
pub use assemble::{LevelMesh, assemble};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::atomic::{AtomicU8, Ordering};

/// The candidates of a level: all facet vertices, then interior nodes.
pub struct Candidates<'a> {
    /// Candidate `k` is facet vertex `k` for `k < domain.len()`.
    pub tree: Cow<'a, KdTree<2>>,
    /// Their nodes (the first copy of a facet vertex).
    pub nodes: Cow<'a, [u32]>,
}

impl Candidates<'_> {
    /// The same, borrowed from these.
    pub fn borrowed(&self) -> Candidates<'_> {
        Candidates { tree: Cow::Borrowed(&self.tree), nodes: Cow::Borrowed(&self.nodes) }
    }

    /// The coordinates of one.
    #[inline(always)]
    pub fn point(&self, k: u32) -> &Point<2> {
        self.tree.point(k)
    }
}

/// The parameters of Figure 2.
#[derive(Debug, Clone, Copy)]
pub struct Rules {
    /// beta > 1 of the conflict graph.
    pub beta: f64,
    /// Interior nodes stay delta * f away from facets.
    pub delta: f64,
    /// Lipschitz constant of f.
    pub gradation: f64,
    /// Whether f is held down where kept facet vertices are crowded.
    pub hold: bool,
}

/// What a level keeps.
#[derive(Debug, Clone, Default)]
pub struct Choice {
    /// By facet vertex.
    pub kept: Vec<bool>,
    /// Interior nodes.
    pub interior: Vec<u32>,
    /// Chords of the kept facet vertices.
    pub chords: Vec<Chord>,
    /// Nodes that hold f down, and what they hold it under, on this level and the coarser ones.
    pub held: Vec<(u32, f64)>,
    /// Nodes that the quality guard added, here and on the coarser levels.
    pub surplus: i64,
}

impl Choice {
    /// Number of nodes, copies counted, and of cells that the triangulation will have.
    pub fn size(&self, domain: &Domain) -> usize {
        let facet: usize = (0..self.kept.len()).filter(|&v| self.kept[v]).map(|v| domain.copies(v as u32).len()).sum();
        facet + self.interior.len()
    }
}

/// Selects a level's nodes among the candidates, keeping `seeds` (the next coarser level's, in the same terms), and beginning
/// with a known independent set of the interior candidates, where there is one. `f` is by candidate, `candidate_of` gives the candidate of a node. Also returns the places of the
/// interior candidates.
///
/// Where kept facet vertices conflict (corners, vertices put back, seeds), and `rules.hold` asks for it, f is held under
/// beta/2 of their distance there, rising with the gradation as everywhere: cells next to a short chord are small too.
pub fn select(
    domain: &Domain,
    candidates: &Candidates<'_>,
    f: &mut [f64],
    (seeds, known): (&Choice, Option<&Known>),
    candidate_of: impl Fn(u32) -> u32 + Sync,
    rules: Rules,
    progress: &Progress,
) -> Result<(Choice, Vec<Place>), Error> {
    let facets = domain.len();
    let seeded: Vec<u32> = seeds.interior.par_iter().map(|&node| candidate_of(node)).collect();
    let obstacles: Vec<Point<2>> = seeded.par_iter().map(|&k| *candidates.point(k)).collect();
    let mut kept: Vec<bool> =
        (0..facets).map(|v| domain.corner[v] || seeds.kept.get(v).copied().unwrap_or(false)).collect();
    let mut held = seeds.held.clone();
    let rooms: Vec<(u32, f64)> = held.iter().map(|&(node, room)| (candidate_of(node), room)).collect();
    lower(candidates, f, &rooms, rules.gradation);
    let mut round = 0;
    let chords = loop {
        let (mut keep, mut order): (Vec<u32>, Vec<u32>) = (0..facets as u32).partition(|&v| kept[v as usize]);
        keep.extend(&seeded);
        rank(&mut order, f);
        for v in greedy(&candidates.tree, f, rules.beta, &order, &keep, progress)? {
            kept[v as usize] = true;
        }
        let chords = domain.repair(&mut kept, &obstacles, rules.hold);
        round += 1;
        if !rules.hold || round == MOST_ROUNDS {
            break chords;
        }
        let crowded = crowded(domain, &kept, f, rules.beta, progress)?;
        if crowded.is_empty() {
            break chords;
        }
        lower(candidates, f, &crowded, rules.gradation);
        held.extend(crowded.iter().map(|&(v, room)| (candidates.nodes[v as usize], room)));
    };

    let seeds = Seeds { nodes: &seeds.interior, candidates: &seeded, known };
    let (interior, places) = select_interior(domain, candidates, f, seeds, &kept, &chords, rules, progress)?;
    Ok((Choice { kept, interior, chords, held, surplus: 0 }, places))
}

/// The interior nodes that a level begins with.
#[derive(Clone, Copy)]
pub(crate) struct Seeds<'a> {
    /// Those that it keeps.
    pub nodes: &'a [u32],
    /// The same as candidates.
    pub candidates: &'a [u32],
    /// An independent set among all interior candidates, maximal for an f that is nowhere smaller.
    pub known: Option<&'a Known>,
}

/// Steps (4) and (5): the seeds' interior nodes and those selected after them and the kept facet vertices, and the places
/// of all interior candidates.
#[allow(clippy::too_many_arguments)]
pub(crate) fn select_interior(
    domain: &Domain,
    candidates: &Candidates<'_>,
    f: &[f64],
    seeds: Seeds<'_>,
    kept: &[bool],
    chords: &[Chord],
    rules: Rules,
    progress: &Progress,
) -> Result<(Vec<u32>, Vec<Place>), Error> {
    let facets = domain.len();
    let places = near_facets(domain, candidates, f, chords, rules.delta);
    let is_inside = |k: u32| k as usize >= facets && places[k as usize - facets] == Place::Inside;
    let mut keep: Vec<u32> = (0..facets as u32).filter(|&v| kept[v as usize]).collect();
    keep.extend(seeds.candidates);
    let chosen = match seeds.known {
        Some(known) => greedy_after(&candidates.tree, f, rules.beta, is_inside, &keep, known, progress)?,
        None => {
            let mut is_seed = vec![false; candidates.nodes.len()];
            seeds.candidates.iter().for_each(|&k| is_seed[k as usize] = true);
            let is_asked = |&k: &u32| is_inside(k) && !is_seed[k as usize];
            let order: Vec<u32> = (facets as u32..is_seed.len() as u32).into_par_iter().filter(is_asked).collect();
            greedy_in_tiles(&candidates.tree, f, rules.beta, &order, &keep, progress)?
        }
    };
    let mut interior = seeds.nodes.to_vec();
    interior.extend(chosen.iter().map(|&k| candidates.nodes[k as usize]));
    Ok((interior, places))
}

/// Rounds of selecting facet vertices, each after f was held down where the last left them crowded.
const MOST_ROUNDS: usize = 4;

/// Kept facet vertices that conflict with another, and beta/2 of the distance to the nearest such.
fn crowded(
    domain: &Domain,
    kept: &[bool],
    f: &[f64],
    beta: f64,
    progress: &Progress,
) -> Result<Vec<(u32, f64)>, Error> {
    let vertices: Vec<u32> = (0..kept.len() as u32).filter(|&v| kept[v as usize]).collect();
    let points: Vec<Point<2>> = vertices.iter().map(|&v| domain.points[v as usize]).collect();
    let spacing: Vec<f64> = vertices.iter().map(|&v| f[v as usize]).collect();
    let mut least = vec![f64::INFINITY; vertices.len()];
    for [i, j] in conflict_graph(&KdTree::new(&points), &spacing, beta, progress)? {
        let room = beta / 2.0 * distance(&points[i as usize], &points[j as usize]);
        for k in [i, j] {
            least[k as usize] = least[k as usize].min(room);
        }
    }
    Ok(vertices.into_iter().zip(least).filter(|&(v, room)| room < f[v as usize]).collect())
}

/// f becomes min(f, room + L |v - x|) over candidates v with their room.
pub fn lower(candidates: &Candidates<'_>, f: &mut [f64], rooms: &[(u32, f64)], gradation: f64) {
    if rooms.is_empty() {
        return;
    }
    let tree: &KdTree<2> = &candidates.tree;
    let most = tree.node_max_of(f);
    for &(v, room) in rooms {
        let p = *candidates.point(v);
        let reached = |node: usize| room + gradation * tree.bounds(node).distance_2(&p).sqrt() < most[node];
        each_in(tree, reached, |k, x| {
            let value = room + gradation * distance(&p, x);
            if value < f[k] {
                f[k] = value;
            }
        });
    }
}

/// Where an interior candidate lies; what comes later outdoes what comes before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Place {
    /// In the coarse domain, delta * f away from its facets.
    Inside = 0,
    /// Nearer than that to a chord.
    Near = 1,
    /// In the region that a chord cuts off or adds.
    CutOff = 2,
}

/// Chords that one thread looks about in one go.
const CHORDS_AT_ONCE: usize = 64;

/// Places of the interior candidates.
pub fn near_facets(
    domain: &Domain,
    candidates: &Candidates<'_>,
    f: &[f64],
    chords: &[Chord],
    delta: f64,
) -> Vec<Place> {
    let facets = domain.len();
    let places: Vec<AtomicU8> = (facets..candidates.nodes.len()).map(|_| AtomicU8::new(Place::Inside as u8)).collect();
    // which chord tells first is no matter
    let place = |k: usize| places[k - facets].load(Ordering::Relaxed);
    let put = |k: usize, place: Place| places[k - facets].fetch_max(place as u8, Ordering::Relaxed);
    let tree: &KdTree<2> = &candidates.tree;
    let most = tree.node_max_of(f);
    chords.par_iter().with_min_len(CHORDS_AT_ONCE).for_each(|chord| {
        let ends = chord.vertices.map(|v| domain.points[v as usize]);
        let [a, b] = &ends;
        let segment = Bounds::of(&ends);
        let reached = |node: usize| {
            let (reach, bounds) = (delta * most[node], tree.bounds(node));
            bounds.gap_2(&segment) < reach * reach && is_within(bounds, &ends, reach)
        };
        each_in(tree, reached, |k, x| {
            let is_near = || segment_distance_2(x, a, b) < (delta * f[k]) * (delta * f[k]);
            if k >= facets && place(k) == Place::Inside as u8 && is_near() {
                put(k, Place::Near);
            }
        });
        if chord.deviation_2 > 0.0 {
            let piece = Bounds::of(domain.piece(chord).map(|v| &domain.points[v as usize]));
            let deviation = chord.deviation_2.sqrt();
            let touched = |node: usize| {
                let bounds = tree.bounds(node);
                bounds.gap_2(&piece) == 0.0 && is_within(bounds, &ends, deviation)
            };
            each_in(tree, touched, |k, x| {
                let is_open = k >= facets && place(k) < Place::CutOff as u8;
                if is_open && domain.holds(chord, x) {
                    put(k, Place::CutOff);
                }
            });
        }
    });
    let named = |place: AtomicU8| match place.into_inner() {
        0 => Place::Inside,
        1 => Place::Near,
        _ => Place::CutOff,
    };
    places.into_par_iter().map(named).collect()
}

/// Whether a box may come as near to the line through two points as `reach`: the box of a long slanted segment tells little.
fn is_within(bounds: &Bounds<2>, [a, b]: &[Point<2>; 2], reach: f64) -> bool {
    /// Room for rounding, relative.
    const SLACK: f64 = 1e-12;
    let length = distance(a, b);
    let [nx, ny] = [(a[1] - b[1]) / length, (b[0] - a[0]) / length];
    let [x, y] = [0, 1].map(|k| 0.5 * ((bounds.lo[k] - a[k]) + (bounds.hi[k] - a[k])));
    let [hx, hy] = [0, 1].map(|k| 0.5 * (bounds.hi[k] - bounds.lo[k]));
    let room = reach + nx.abs() * hx + ny.abs() * hy + SLACK * (x.abs() + y.abs() + hx + hy + reach);
    let off = (x * nx + y * ny).abs();
    // no number where the length vanished in floats
    off <= room || off.is_nan()
}

/// Calls `found` with every candidate in the tree nodes that are `wanted`, and its coordinates.
pub(crate) fn each_in(tree: &KdTree<2>, wanted: impl Fn(usize) -> bool, mut found: impl FnMut(usize, &Point<2>)) {
    tree.search(
        1.0,
        |node| if wanted(node) { 0.0 } else { 2.0 },
        |_, range| {
            let points = &tree.points()[range.clone()];
            tree.order()[range].iter().zip(points).for_each(|(&k, x)| found(k as usize, x));
            1.0
        },
    );
}

/// A triangulated choice. Site `s` is facet vertex `s`, or interior node `s - domain.len()`.
pub struct Triangulated {
    /// Sites.
    pub sites: Vec<u32>,
    /// Their coordinates.
    pub points: Vec<Point<2>>,
    /// Cells inside the domain, as indices into `sites`.
    pub cells: Vec<Cell>,
}

/// Sites of a choice in a spatial order, and their coordinates.
pub(crate) fn sites_of(domain: &Domain, points: &[Point<2>], choice: &Choice) -> (Vec<u32>, Vec<Point<2>>) {
    let facets = domain.len() as u32;
    let mut sites: Vec<u32> = (0..facets).filter(|&v| choice.kept[v as usize]).collect();
    sites.extend(choice.interior.iter().map(|&node| facets + node));
    let place = |s: u32| if s < facets { domain.points[s as usize] } else { points[(s - facets) as usize] };
    sort_spatially(&mut sites, place);
    let site_points = sites.par_iter().map(|&s| place(s)).collect();
    (sites, site_points)
}

/// The chords of a choice as constraints between sites; `sides` tells on which sides of a chord cells lie.
pub(crate) fn constraints_of(
    domain: &Domain,
    choice: &Choice,
    sites: &[u32],
    sides: impl Fn(&Chord) -> [bool; 2],
) -> Vec<Constraint> {
    let mut site_of = vec![NONE; domain.len()];
    for (k, &s) in sites.iter().enumerate().filter(|&(_, &s)| (s as usize) < domain.len()) {
        site_of[s as usize] = k as u32;
    }
    let constraint = |chord: &Chord| {
        let [left, right] = sides(chord);
        let wall = !domain.chains[chord.chain as usize].edge(chord.from).interior;
        Constraint { ends: chord.vertices.map(|v| site_of[v as usize]), left, right, wall }
    };
    choice.chords.iter().map(constraint).collect()
}

/// Triangulates a choice; facet vertices are put back where a chord can't be an edge.
pub fn triangulate(domain: &Domain, points: &[Point<2>], choice: &mut Choice) -> Result<Triangulated, Error> {
    loop {
        let (sites, site_points) = sites_of(domain, points, choice);
        let constraints = constraints_of(domain, choice, &sites, |chord| {
            domain.chains[chord.chain as usize].edge(chord.from).sides.map(|side| side.is_inside())
        });
        match inside(&site_points, &constraints)? {
            Inside::Cells(cells) => return Ok(Triangulated { sites, points: site_points, cells }),
            Inside::Failed(failed) => {
                for c in failed {
                    let chord = &choice.chords[c as usize];
                    if chord.to == chord.from + 1 {
                        return Err(Error::Internal(format!("facet edge {:?} can't be kept", chord.vertices)));
                    }
                    choice.kept[chord.farthest as usize] = true;
                }
                let obstacles: Vec<Point<2>> = choice.interior.iter().map(|&node| points[node as usize]).collect();
                choice.chords = domain.repair(&mut choice.kept, &obstacles, false);
            }
        }
    }
}
