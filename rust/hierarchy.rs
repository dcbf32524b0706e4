//! MULTI_LEVEL_COARSEN (Figure 3): level i is spaced by the C^i-coarsening of the input's spacing, coarsest level first,
//! each finer level keeping the nodes of the coarser one, so that levels are node-nested (Lemma 3.6).
//!
//! Candidates. As printed, every level looks at every node. With `pool`, level i draws its interior nodes from a
//! maximal independent set made with the spacing f_i / C^m (C^m >= 4, so this pool is much finer than the level), which
//! was drawn from the pool of level i - 1 in turn. The first pool is made with f_1 from all nodes, where f_{1+m} / C^m is
//! about that; elsewhere nodes are added under this. It also serves the levels before its own that are at least about twice as
//! coarse as it, and level 1 begins with that first set. Facet vertices are candidates on every level. The work over
//! all levels is then O(n).
//!
//! Depth. The paper takes the number of levels k as given. Without one, k is the first level whose own (not nested) mesh
//! has at most `coarsest` cells, or the last that is smaller than the one before by more than a twentieth.

mod candidates;
mod depth;
mod options;
mod pools;

use crate::domain::Domain;
use crate::drop::{Dropped, Parts};
use crate::error::Error;
use crate::guard::{Guard, Outcome, Scene, better};
use crate::kdtree::KdTree;
use crate::level::{Candidates, Choice, LevelMesh, Place, Triangulated, assemble, lower, select, triangulate};
use crate::point::NONE;
use crate::progress::Progress;
use crate::scatter::scattered;
use crate::selection::Known;
use crate::spacing::{CoarseSpacing, nearest_by_leaves};
use candidates::{candidate_spacing, candidates, spacing_at_nodes};
pub use options::{CellRows, Drop, Input, Method, Options, Stopped};
pub(crate) use pools::Pool;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// A level that keeps more than this share of the cells of the one before ends a hierarchy of open depth.
pub const STALL: f64 = 0.95;

/// How much finer than a level the pool must be that it draws from, where that pool serves several levels.
const LEAST_RATIO: f64 = 1.9;

/// No hierarchy is deeper than this: a factor near 1 could ask for thousands of levels.
pub const MAX_LEVELS: usize = 512;

/// One coarser level.
#[derive(Clone)]
pub struct Level {
    /// Its mesh.
    pub mesh: LevelMesh,
    /// C^i.
    pub factor: f64,
    /// f_i at its nodes.
    pub spacing: Vec<f64>,
    /// Candidates looked at to make it (its pool's share included).
    pub visits: usize,
    /// What was dropped of the domain, where features may be.
    pub dropped: Option<Dropped>,
}

pub(crate) struct Chosen {
    pub(crate) choice: Choice,
    /// f by candidate.
    f: Vec<f64>,
    /// Places of the interior candidates.
    pub(crate) places: Vec<Place>,
}

/// A level before it is written in the input's terms.
struct Drawn {
    choice: Choice,
    f: Vec<f64>,
    level: Triangulated,
}

pub(crate) enum Spacing<'a> {
    Function(CoarseSpacing<'a, 2>),
    /// g, and what the gaps of the domain hold it under, at the candidates of the finest pool.
    Threshold {
        g: Vec<f64>,
        held: Vec<f64>,
    },
}

/// All that stays the same from level to level.
pub(crate) struct Builder<'a> {
    pub(crate) input: &'a Input<'a>,
    pub(crate) options: Options,
    pub(crate) progress: &'a Progress,
    pub(crate) domain: &'a Domain,
    pub(crate) spacing: &'a Spacing<'a>,
    /// The spacing over fewer sites, and the least factor that it is right for.
    thin: Option<(f64, CoarseSpacing<'static, 2>)>,
    /// f_1 at all candidates of the finest pool, and a maximal independent set under it.
    pub(crate) known: Option<Known>,
    /// Levels between a pool and the level that draws from it.
    lag: usize,
    euler: i64,
    pub(crate) pools: Vec<Pool<'a>>,
    /// Candidate of a node in the pool at hand.
    pub(crate) candidate_of: Vec<u32>,
    pub(crate) at_hand: usize,
    /// Facet vertices that no level may keep where features are dropped; empty where all may be.
    pub(crate) is_barred: Vec<bool>,
    /// The facet vertices of levels that drop features, by level.
    pub(crate) facets: Vec<(usize, Vec<bool>)>,
    /// The parts of the input, once a level that drops features has asked for them.
    pub(crate) parts: Option<Arc<Parts>>,
}

/// The coarser levels, finest first, why they end, and g at the nodes of the input.
pub type Hierarchy = (Vec<Level>, Stopped, Vec<f64>);

/// Builds the coarser levels.
///
/// Runtime: O(n log n) for the finest pool's tree and spacing, O(n) for all levels with pools.
pub fn hierarchy(input: &Input<'_>, options: Options, progress: &Progress) -> Result<Hierarchy, Error> {
    progress.enter(0, 1)?;
    let domain = Domain::new(input.points, input.facets, options.cos_feature)?;
    let all = candidates(input.points, &domain);
    let (tree, nodes): (&KdTree<2>, &[u32]) = (&all.tree, &all.nodes);
    progress.enter(1, nodes.len() as u64)?;
    let g = match input.spacing {
        None => nearest_by_leaves(tree, progress)?,
        Some(spacing) => tree.in_leaf_order(&candidate_spacing(spacing, &domain, nodes)),
    };
    let finest = || spacing_at_nodes(&g, &domain, &all, input.points.len());
    if options.method == Method::Mis {
        let (levels, stopped) = crate::skeleton::hierarchy(input.points, input.cells, &domain, options, progress)?;
        return Ok((levels, stopped, finest()));
    }
    let (finest, cap) = rayon::join(finest, || options.keep.then(|| domain.gaps()));
    let base = Base { input, options, progress, domain: &domain, all: &all, g: &g };
    let spacing = base.spacing(cap.as_deref())?;
    let mut builder = base.builder(&spacing);
    let (mut levels, mut stopped) = match options.drop {
        Drop::Never => {
            let (depth, stopped) = match options.levels {
                Some(levels) => (levels, Stopped::Levels),
                None => builder.depth()?,
            };
            let levels = builder.levels(depth, Choice::default())?;
            (levels, stopped)
        }
        Drop::Always => {
            builder.plan_facets(1, options.levels)?;
            let depth = options.levels.map_or_else(|| builder.drop_depth(), Ok)?;
            (builder.drop_levels(1, depth, None)?, Stopped::Levels)
        }
        Drop::Auto => {
            let (last, is_enough) = builder.last_worth_keeping()?;
            let free = base.spacing(None)?;
            let mut plain = base.builder(&free);
            // what the levels that drop features are to keep, so that they have it to draw from
            let facets = if is_enough { Vec::new() } else { plain.plan_facets(last + 1, options.levels)? };
            let seeds = Choice { kept: facets, ..Choice::default() };
            let mut levels = builder.levels(last, seeds)?;
            let finer = levels.last().filter(|_| options.nested);
            if let Some(finer) = finer {
                plain.draw_from(&finer.mesh.nodes);
            }
            let depth = match options.levels {
                Some(levels) => levels,
                None if is_enough => last,
                None => plain.drop_depth()?.max(last + 1),
            };
            let dropped = plain.drop_levels(last + 1, depth, levels.last())?;
            levels.extend(dropped);
            (levels, Stopped::Levels)
        }
    };
    if options.levels.is_none()
        && let Some(first) = levels.iter().position(|level| level.mesh.cells.len() <= options.coarsest)
    {
        levels.truncate(first + 1);
        stopped = Stopped::Coarsest;
    } else if options.levels.is_none() {
        stopped = Stopped::Stalled;
    }
    Ok((levels, stopped, finest))
}

/// What all builders of a hierarchy share.
struct Base<'a> {
    input: &'a Input<'a>,
    options: Options,
    progress: &'a Progress,
    domain: &'a Domain,
    all: &'a Candidates<'a>,
    /// Spacing of the input at all candidates, in leaf order.
    g: &'a [f64],
}

impl<'a> Base<'a> {
    /// The spacing of the levels, held under a cap.
    fn spacing(&self, cap: Option<&[f64]>) -> Result<Spacing<'a>, Error> {
        let (tree, gradation): (&KdTree<2>, f64) = (&self.all.tree, self.options.rules.gradation);
        Ok(match self.options.method {
            Method::Function | Method::Mis => {
                let spacing = CoarseSpacing::of_leaves(tree, self.g, cap, gradation);
                Spacing::Function(if self.input.spacing.is_none() { spacing.of_nearest() } else { spacing })
            }
            Method::Threshold => {
                let free = vec![f64::INFINITY; self.g.len()];
                let held = match cap {
                    Some(_) => CoarseSpacing::of_leaves(tree, &free, cap, gradation).at_points(1.0, self.progress)?,
                    None => free,
                };
                Spacing::Threshold { g: tree.by_index(self.g), held }
            }
        })
    }

    fn builder(&self, spacing: &'a Spacing<'a>) -> Builder<'a> {
        let input = self.input;
        let boundary = input.facets.iter().filter(|facet| facet.cell_tags.1.is_none()).count() as i64;
        let cells = input.cells.len() as i64;
        Builder {
            lag: (4f64.ln() / self.options.factor.ln()).ceil().clamp(1.0, 64.0) as usize,
            euler: input.points.len() as i64 - (3 * cells + boundary) / 2 + cells,
            candidate_of: vec![NONE; input.points.len()],
            at_hand: usize::MAX,
            is_barred: Vec::new(),
            facets: Vec::new(),
            parts: None,
            pools: vec![Pool::finest(self.all.borrowed())],
            input,
            options: self.options,
            progress: self.progress,
            domain: self.domain,
            spacing,
            thin: None,
            known: None,
        }
    }
}

impl Builder<'_> {
    pub(crate) fn factor(&self, i: usize) -> f64 {
        self.options.factor.powi(i as i32)
    }

    /// Number of cells that the triangulation of a choice has, by Euler's formula.
    pub(crate) fn n_cells(&self, choice: &Choice) -> usize {
        let boundary: i64 = choice
            .chords
            .iter()
            .map(|chord| self.domain.chains[chord.chain as usize].edge(chord.from))
            .filter(|edge| !edge.interior)
            .map(|edge| edge.sides.iter().filter(|side| side.is_inside()).count() as i64)
            .sum();
        (2 * (choice.size(self.domain) as i64 - self.euler) - boundary).max(0) as usize
    }

    /// Puts the pool of level i at hand, and returns f_i at its candidates.
    pub(crate) fn at_hand(&mut self, i: usize) -> Result<Vec<f64>, Error> {
        self.progress.enter(2, 1)?;
        let p = self.pool_for(i)?;
        let pool = &self.pools[p];
        self.progress.enter(2, pool.len() as u64)?;
        if self.at_hand != p {
            let places = pool.candidates.nodes.par_iter().enumerate().map(|(k, &node)| (node as usize, k as u32));
            self.candidate_of = scattered(std::mem::take(&mut self.candidate_of), places);
            self.at_hand = p;
        }
        let f = match self.known_at(i) {
            Some(known) => known.f.par_iter().copied().collect(),
            None => match pool.f.iter().find(|(level, _)| *level == i) {
                Some((_, f)) => f.clone(),
                None => self.spacing_in(i, pool)?,
            },
        };
        self.progress.check()?;
        Ok(f)
    }

    /// Selects the nodes of level i.
    pub(crate) fn choose(&mut self, i: usize, seeds: &Choice) -> Result<Chosen, Error> {
        let mut f = self.at_hand(i)?;
        let pool = &self.pools[self.at_hand];
        let candidate_of = |node: u32| self.candidate_of[node as usize];
        let start = (seeds, self.known_at(i));
        let (choice, places) =
            select(self.domain, &pool.candidates, &mut f, start, candidate_of, self.options.rules, self.progress)?;
        Ok(Chosen { choice, f, places })
    }

    /// Candidates looked at to make level i from the pool at hand: the level that first draws from it bears its cost.
    pub(crate) fn visits(&self, i: usize) -> usize {
        let p = self.at_hand;
        self.pools[p].len() + if p > 0 && i == p + self.lag { self.pools[p].visits } else { 0 }
    }

    /// Makes levels 1 to `last`, coarsest first, keeping the nodes of `seeds`; returns the finest first.
    fn levels(&mut self, last: usize, mut seeds: Choice) -> Result<Vec<Level>, Error> {
        let mut levels = Vec::new();
        for i in (1..=last).rev() {
            let (level, choice) = self.level(i, &seeds)?;
            seeds = choice;
            levels.push(level);
        }
        levels.reverse();
        Ok(levels)
    }

    /// Makes level i.
    fn level(&mut self, i: usize, seeds: &Choice) -> Result<(Level, Choice), Error> {
        let none = Choice::default();
        let seeds = if self.options.nested { seeds } else { &none };
        let Drawn { choice, f, level } = self.draw(i, seeds)?;
        let mesh = assemble(self.domain, &choice, &level)?;
        let mut copies = HashMap::new();
        for v in (0..self.domain.len() as u32).filter(|&v| choice.kept[v as usize]) {
            copies.extend(self.domain.copies(v)[1..].iter().map(|&node| (node, v)));
        }
        let candidate = |node: &u32| copies.get(node).copied().unwrap_or_else(|| self.candidate_of[*node as usize]);
        let spacing = mesh.nodes.par_iter().map(|node| f[candidate(node) as usize]).collect();
        let visits = self.visits(i);
        Ok((Level { mesh, factor: self.factor(i), spacing, visits, dropped: None }, choice))
    }

    /// Selects, triangulates and betters level i.
    fn draw(&mut self, i: usize, seeds: &Choice) -> Result<Drawn, Error> {
        let Chosen { mut choice, mut f, places, .. } = self.choose(i, seeds)?;
        self.progress.enter(3, 1)?;
        let triangulated = |choice: &mut Choice| triangulate(self.domain, self.input.points, choice);
        let pool = &self.pools[self.at_hand];
        let facets = self.domain.len() as u32;
        let candidate = |site: u32| match site.checked_sub(facets) {
            Some(node) => self.candidate_of[node as usize],
            None => site,
        };
        let level = if let Some(min_angle) = self.options.min_angle {
            let mut kept = seeds.kept.clone();
            kept.resize(self.domain.len(), false);
            let interior: Vec<u32> = seeds.interior.iter().map(|&node| self.candidate_of[node as usize]).collect();
            let (candidates, surplus) = (&pool.candidates, seeds.surplus);
            let scene = Scene {
                domain: self.domain,
                candidates,
                f: &f,
                places: &places,
                kept: &kept,
                seeds: &interior,
                surplus,
            };
            let rules = self.options.rules;
            let slope = if self.options.method == Method::Threshold { 1.0 } else { rules.gradation };
            let room = (1.0 / self.options.factor).max(0.5);
            let guard = Guard { min_angle, beta: rules.beta, slope, room };
            let triangulated = |choice: &mut Choice| {
                let level = triangulated(choice)?;
                self.progress.enter(4, 1)?;
                Ok(level)
            };
            let (level, Outcome { crowded, surplus }) = better(&scene, guard, &mut choice, triangulated, candidate)?;
            choice.surplus = surplus;
            lower(&pool.candidates, &mut f, &crowded, self.options.rules.gradation);
            choice.held.extend(crowded.iter().map(|&(k, room)| (pool.candidates.nodes[k as usize], room)));
            level
        } else {
            triangulated(&mut choice)?
        };
        Ok(Drawn { choice, f, level })
    }
}
