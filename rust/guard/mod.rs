//! The quality guard: no angle of a level under a bound, with nodes of the input only.
//!
//! Cells with an angle under the bound are taken worst first. For each, single changes are tried in this order: take away
//! one of its free nodes (not a node of a coarser level, no corner); exchange it for a candidate nearby; the same for the
//! nodes across its edges; insert a candidate near the cell's off-centre (the point on the bisector of its shortest edge
//! that sees it under a comfortable angle, or the circumcentre where that is nearer); put back a facet vertex that a chord
//! nearby spans. The first change that takes the cell away and leaves no new cell under the bound is kept. Where there is
//! none, chains of changes are tried: the most promising ones, each followed by one that mends the worst cell it leaves,
//! and once more. Else the best single change that betters the worst cell it touches is kept; so a level never gets
//! worse, and the guard ends.
//!
//! Cells that are then still under 15 degrees are gone over again, by wider means: chains count that better a cell without
//! lifting it over the bound, candidates come from further away, and may come nearer to other nodes.
//!
//! A candidate is allowed inside the coarse domain, also nearer to its facets than delta * f (angles are measured here,
//! not feared), where its distance to every neighbour leaves it independent on the next finer level. All triangulation
//! is local, Delaunay throughout, ties broken by node. The domain stays valid: a new chord's region holds no kept point,
//! loops keep three vertices, slits both their sides, and all of it is looked over at the end; a level that then needed repair
//! is done again without touching facets.
//!
//! What it guarantees: nestedness, no worse angle, at most `BUDGET` more nodes. What it usually reaches is told in the
//! documentation. Angles between two facets are left aside, unless the guard bent one of them.

mod change;
mod mend;
mod patch;

use crate::domain::{Chord, Domain};
use crate::error::Error;
use crate::level::{Candidates, Choice, Place, Triangulated};
use crate::point::Point;
use patch::Patch;
use rayon::prelude::*;

/// Share of nodes that the guard may add to a level.
pub const BUDGET: f64 = 0.10;

/// What the guard may do.
#[derive(Debug, Clone, Copy)]
pub struct Guard {
    /// The bound in radians.
    pub min_angle: f64,
    /// beta of the conflict graph.
    pub beta: f64,
    /// Lipschitz constant of f.
    pub slope: f64,
    /// Share of the conflict distance that an inserted node must keep: 1/C leaves the next finer level independent.
    pub room: f64,
}

/// The level at hand, as the guard sees it.
pub struct Scene<'a> {
    /// The domain.
    pub domain: &'a Domain,
    /// Candidates of the level.
    pub candidates: &'a Candidates<'a>,
    /// f by candidate.
    pub f: &'a [f64],
    /// Places of the interior candidates.
    pub places: &'a [Place],
    /// Whether a coarser level holds a facet vertex.
    pub kept: &'a [bool],
    /// Interior candidates that coarser levels hold.
    pub seeds: &'a [u32],
    /// Nodes that the guard has added to the next coarser level, and so to this one.
    pub surplus: i64,
}

/// What the guard did to a level beside its cells.
pub struct Outcome {
    /// Candidates that conflict since, and beta/2 of the distance to the nearest such.
    pub crowded: Vec<(u32, f64)>,
    /// Nodes added, the coarser level's surplus included.
    pub surplus: i64,
}

struct Work<'a> {
    scene: &'a Scene<'a>,
    guard: Guard,
    patch: Patch,
    /// Chords as they were, then those made since.
    chords: Vec<Chord>,
    /// How many there were before each of the changes at hand.
    chords_before: Vec<usize>,
    /// How many of them each chain has now.
    sides: Vec<u32>,
    /// Sites of the level as it was.
    sites: Vec<u32>,
    /// Candidate of each site, of those that have come too.
    candidate: Vec<u32>,
    /// Whether a candidate is a site now.
    taken: Vec<bool>,
    /// Whether facets may be touched.
    bends: bool,
    /// Whether a site may go.
    is_free: Vec<bool>,
    /// Candidates that the changes at hand took away.
    gone: Vec<u32>,
    /// Sites before the changes at hand.
    sites_before: usize,
    added: i64,
    /// Nodes that may be added.
    budget: i64,
    /// Changes that may still be tried in chains: they are dear, and on some domains many cells can't be helped.
    tries_left: usize,
    /// Cosine of the bound.
    sharp: f64,
    /// Whether chains count that better a cell without lifting it over the bound.
    is_last: bool,
    /// The changes at hand, and the cells at which they were made.
    steps: Vec<(change::Change, u32)>,
    /// What betters the cell at hand most.
    best: Option<mend::Best>,
}

/// Betters the level that `triangulated` makes of a choice, which follows. `candidate_of` gives the candidate of a site.
///
/// # Errors
/// Those of `triangulated`.
pub fn better(
    scene: &Scene<'_>,
    guard: Guard,
    choice: &mut Choice,
    triangulated: impl Fn(&mut Choice) -> Result<Triangulated, Error>,
    candidate_of: impl Fn(u32) -> u32 + Sync,
) -> Result<(Triangulated, Outcome), Error> {
    let level = triangulated(choice)?;
    let mut chosen = choice.clone();
    let done = Work::new(scene, guard, level, choice, &candidate_of, true).done(&mut chosen);
    let is_touched = chosen.kept != choice.kept;
    if is_touched && !is_valid(scene, &chosen, &done.0) {
        let level = triangulated(choice)?;
        return Ok(Work::new(scene, guard, level, choice, &candidate_of, false).done(choice));
    }
    *choice = chosen;
    Ok(done)
}

/// Whether the chords of a choice need no repair.
fn is_valid(scene: &Scene<'_>, choice: &Choice, level: &Triangulated) -> bool {
    let facets = scene.domain.len();
    let is_interior = |&(&site, _): &(&u32, &Point<2>)| site as usize >= facets;
    let interior: Vec<Point<2>> =
        level.sites.par_iter().zip(&level.points).filter(is_interior).map(|(_, &point)| point).collect();
    let mut kept = choice.kept.clone();
    scene.domain.repair(&mut kept, &interior, false);
    kept == choice.kept
}
