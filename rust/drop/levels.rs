//! The levels that drop features: selected coarse to fine, settled fine to coarse, and where they begin and end.

use super::facets::first_enough;
use super::select::{Terms, select_facets, select_inside};
use super::{Dropped, Ground, Parts};
use crate::domain::Domain;
use crate::error::Error;
use crate::hierarchy::{Builder, Level, MAX_LEVELS, STALL, Spacing};
use crate::kdtree::KdTree;
use crate::level::{Candidates, Choice, LevelMesh, Seeds};
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

/// Tries of a spacing a quarter as large where a level has no cell.
const MOST_TRIES: i32 = 40;

/// A maximal independent set drawn from a set that is hardly denser has holes: nodes may be nearer by this much there.
const DENSER: f64 = 1.2;

/// Where a level changes the area by this share of it more than the finer one does, a level between is made if that does not.
const STEEP: f64 = 0.05;

/// Spacings that are tried for it, after the level's own: it may do with other nodes.
const BETWEEN: i32 = 3;

/// How many of the finer level's cells it may have at most.
const WORTH_A_LEVEL: f64 = 0.8;

/// A settled level.
type Made = (LevelMesh, Dropped);

/// A selected level that is not settled yet.
#[derive(Clone)]
struct Plan {
    choice: Choice,
    /// f at the facet vertices.
    at_facets: Vec<f64>,
    /// f at the interior nodes of the choice, by node.
    at_interior: Vec<(u32, f64)>,
    visits: usize,
}

impl Plan {
    /// Facet vertices and interior nodes that it keeps and that are allowed.
    fn sites(&self, domain: &Domain, allowed: Option<&[bool]>) -> usize {
        let is_allowed = |node: &u32| allowed.is_none_or(|allowed| allowed[*node as usize]);
        let kept = (0..domain.len() as u32).filter(|&v| self.choice.kept[v as usize]);
        kept.filter(|&v| domain.copies(v).iter().any(is_allowed)).count()
            + self.choice.interior.iter().filter(|node| is_allowed(node)).count()
    }

    /// Without f at the nodes that settling took out.
    fn settled(mut self) -> Plan {
        self.choice.interior.sort_unstable();
        let interior = &self.choice.interior;
        self.at_interior.retain(|at| interior.binary_search(&at.0).is_ok());
        self
    }

    fn spacing(&self, ground: &Ground<'_>, mesh: &LevelMesh) -> Vec<f64> {
        mesh.nodes
            .iter()
            .map(|&node| match ground.vertex_of.get(&node) {
                Some(&v) => self.at_facets[v as usize],
                None => self.at_interior.binary_search_by_key(&node, |at| at.0).map_or(0.0, |k| self.at_interior[k].1),
            })
            .collect()
    }
}

impl Builder<'_> {
    /// The number of levels that keep features and still take a good part of the cells away: a quarter for a factor of 2,
    /// a third of what an unbounded domain would lose for any other. Also whether they are enough.
    pub(crate) fn last_worth_keeping(&mut self) -> Result<(usize, bool), Error> {
        let share = 1.0 - (1.0 - self.options.factor.powi(-2)) / 3.0;
        let most = self.options.levels.unwrap_or(MAX_LEVELS);
        let mut before = self.input.cells.len();
        for i in 1..=most {
            let chosen = self.choose(i, &Choice::default())?;
            let now = self.n_cells(&chosen.choice);
            if now as f64 > share * before as f64 {
                return Ok((i - 1, false));
            }
            if self.options.levels.is_none() && now <= self.options.coarsest {
                return Ok((i, true));
            }
            before = now;
        }
        Ok((most, true))
    }

    /// The first level whose nodes are so few that no triangulation of them has more than `coarsest` cells.
    pub(crate) fn drop_depth(&mut self) -> Result<usize, Error> {
        let roughly = self.roughly()?;
        let is_enough = |i: usize| -> Result<bool, Error> {
            let choice = self.plan(i, &Choice::default())?.choice;
            let sites = choice.kept.iter().filter(|&&kept| kept).count() + choice.interior.len();
            // n points have at most 2 n - 5 triangles; the last level has one at least
            Ok(2 * sites <= self.options.coarsest + 5 || sites <= 3)
        };
        first_enough(1, roughly, is_enough)
    }

    pub(super) fn parts(&mut self) -> Arc<Parts> {
        let (domain, input) = (self.domain, self.input);
        self.parts.get_or_insert_with(|| Arc::new(Parts::new(domain, input))).clone()
    }

    pub(super) fn terms<'b>(&'b self, parts: &'b Parts) -> Terms<'b> {
        let denser = if self.is_barred.is_empty() { 1.0 } else { DENSER };
        Terms {
            rules: self.options.rules,
            denser,
            cos_feature: self.options.cos_feature,
            is_barred: &self.is_barred,
            parts,
        }
    }

    fn plan(&mut self, i: usize, seeds: &Choice) -> Result<Plan, Error> {
        let parts = self.parts();
        let f = self.at_hand(i)?;
        let candidate_of = |node: u32| self.candidate_of[node as usize];
        let candidates = &self.pools[self.at_hand].candidates;
        let seeded: Vec<u32> = seeds.interior.iter().map(|&node| candidate_of(node)).collect();
        let kept = self.facets_at(i);
        let seeds = Seeds { nodes: &seeds.interior, candidates: &seeded, known: self.known_at(i) };
        let terms = self.terms(&parts);
        let choice = select_inside(self.domain, candidates, &f, kept, seeds, terms, self.progress)?;
        let mut at_interior: Vec<(u32, f64)> =
            choice.interior.iter().map(|&node| (node, f[candidate_of(node) as usize])).collect();
        at_interior.sort_unstable_by_key(|at| at.0);
        let at_facets = f[..self.domain.len()].to_vec();
        Ok(Plan { choice, at_facets, at_interior, visits: self.visits(i) })
    }

    /// Makes levels `first` to `depth` after level `finer`, or after the input. With an open depth a level that would hardly
    /// be smaller than the one before is left out, and the levels end at the first of at most `coarsest` cells.
    pub(crate) fn drop_levels(
        &mut self,
        first: usize,
        depth: usize,
        finer: Option<&Level>,
    ) -> Result<Vec<Level>, Error> {
        let mut plans: Vec<Plan> = Vec::new();
        for i in (first..=depth).rev() {
            let none = Choice::default();
            let seeds = plans.last().filter(|_| self.options.nested).map_or(&none, |plan| &plan.choice);
            let plan = self.plan(i, seeds)?;
            plans.push(plan);
        }
        plans.reverse();
        let ground = Ground::new(self.domain, self.input, self.parts(), self.options.cos_feature);
        let nodes_of = |mesh: &LevelMesh| {
            let mut is_in = vec![false; self.input.points.len()];
            mesh.nodes.iter().for_each(|&node| is_in[node as usize] = true);
            is_in
        };
        let mut allowed = finer.filter(|_| self.options.nested).map(|level| nodes_of(&level.mesh));
        let mut before = finer.map_or(self.input.cells.len(), |level| level.mesh.cells.len());
        let is_open = self.options.levels.is_none();
        let mut sites = self.pools[0].len() - self.is_barred.iter().filter(|&&barred| barred).count();
        let mut visits = 0;
        let mut levels: Vec<Level> = Vec::new();
        let mut change = finer.and_then(|level| level.dropped).map_or(0.0, |dropped| dropped.change());
        let (mut k, mut done, mut has_between) = (0, None, false);
        // levels that there were, and what was found in place of one without a cell
        let mut instead: Option<(usize, Option<(Plan, Made)>)> = None;
        while k < plans.len() {
            self.progress.enter(3, 1)?;
            visits += if has_between { 0 } else { plans[k].visits };
            // most of those left out are known before they are made
            let planned = plans[k].sites(self.domain, allowed.as_deref());
            if is_open && k + 1 < plans.len() && planned as f64 > STALL * sites as f64 {
                (k, has_between) = (k + 1, false);
                continue;
            }
            let (i, mut factor) = (first + k, self.factor(first + k));
            let mut plan = plans[k].clone();
            let mut made = ground.settle(&mut plan.choice, &plan.at_facets, allowed.as_deref())?;
            if made.is_none() {
                // after a settled level the same, whichever of the levels without a cell it would replace
                let again = instead.take().filter(|&(finer, _)| finer > 0 && finer == levels.len());
                let (finer, found) = match again {
                    Some(again) => again,
                    None => (levels.len(), self.denser(&ground, i, done.as_ref(), allowed.as_deref())?),
                };
                if let Some((another, mesh)) = found.clone() {
                    (plan, made) = (another, Some(mesh));
                }
                instead = Some((finer, found));
            }
            let Some((mut mesh, mut dropped)) = made else {
                let Some(last) = levels.last().or(finer) else {
                    return Err(Error::Internal("no level of the domain has a cell".into()));
                };
                let again = Level { factor, dropped: last.dropped.or(Some(Dropped::default())), ..last.clone() };
                levels.extend((!is_open).then_some(again));
                (k, has_between) = (k + 1, false);
                continue;
            };
            let most = change + STEEP * ground.area;
            let is_steep = is_open && dropped.change() > most;
            let bounds = (if has_between { 0 } else { BETWEEN }, WORTH_A_LEVEL * before as f64, most);
            has_between = false;
            if is_steep
                && let Some((share, another, steps)) =
                    self.between(&ground, i, (&plans[k].choice, done.as_ref()), allowed.as_deref(), bounds)?
            {
                (plan, (mesh, dropped), has_between) = (another, steps, share < 1.0);
                factor *= share;
            }
            let now = mesh.cells.len();
            let is_last = is_open && now <= self.options.coarsest;
            if is_open && !is_last && now as f64 > STALL * before as f64 {
                k += 1;
                continue;
            }
            let spacing = plan.spacing(&ground, &mesh);
            if self.options.nested {
                allowed = Some(nodes_of(&mesh));
            }
            (before, sites, change) = (now, plan.sites(self.domain, None), dropped.change());
            levels.push(Level { mesh, factor, spacing, visits: std::mem::take(&mut visits), dropped: Some(dropped) });
            done = Some(plan.settled());
            if is_last {
                break;
            }
            k += usize::from(!has_between);
        }
        Ok(levels)
    }

    /// What a level in place of level i, or before it, is made from: the nodes of the finer plan, or all that levels draw from.
    fn source(&self, finer: Option<&Plan>) -> Candidates<'static> {
        let all = match finer {
            Some(plan) => {
                let mut nodes: Vec<u32> = self.pools[0].candidates.nodes[..self.domain.len()].to_vec();
                nodes.extend(plan.at_interior.iter().map(|at| at.0));
                nodes
            }
            None => self.pools[0].candidates.nodes.to_vec(),
        };
        let tree = KdTree::of(all.len(), |k| self.input.points[all[k] as usize]);
        Candidates { tree: Cow::Owned(tree), nodes: Cow::Owned(all) }
    }

    /// A level made from a source, keeping those of `seeds` that are in it.
    fn anew(
        &mut self,
        ground: &Ground<'_>,
        candidates: &Candidates<'_>,
        f: Vec<f64>,
        seeds: &Choice,
        allowed: Option<&[bool]>,
    ) -> Result<Option<(Plan, Made)>, Error> {
        let facets = self.domain.len();
        let parts = self.parts();
        let mut terms = self.terms(&parts);
        let is_barred: Vec<bool>;
        if let Some(allowed) = allowed {
            let is_allowed = |&node: &u32| allowed[node as usize];
            is_barred = (0..facets as u32).map(|v| !self.domain.copies(v).iter().any(is_allowed)).collect();
            terms.is_barred = &is_barred;
        }
        let mut kept = seeds.kept.clone();
        kept.iter_mut().zip(terms.is_barred).for_each(|(kept, barred)| *kept &= !barred);
        let inside: HashMap<u32, u32> = candidates.nodes[facets..].iter().copied().zip(facets as u32..).collect();
        let (seeds, seeded): (Vec<u32>, Vec<u32>) =
            seeds.interior.iter().filter_map(|node| inside.get(node).map(|&k| (*node, k))).unzip();
        let kept = select_facets(self.domain, candidates, &f, &kept, terms, self.progress)?;
        let seeds = Seeds { nodes: &seeds, candidates: &seeded, known: None };
        let mut choice = select_inside(self.domain, candidates, &f, kept, seeds, terms, self.progress)?;
        let Some(made) = ground.settle(&mut choice, &f, allowed)? else { return Ok(None) };
        let mut at_interior: Vec<(u32, f64)> =
            candidates.nodes[facets..].iter().copied().zip(f[facets..].iter().copied()).collect();
        at_interior.sort_unstable_by_key(|at| at.0);
        let visits = candidates.nodes.len();
        Ok(Some((Plan { choice, at_facets: f[..facets].to_vec(), at_interior, visits }, made)))
    }

    /// A level in place of level i, which has no cell: with the finer spacing made smaller until there is a cell.
    fn denser(
        &mut self,
        ground: &Ground<'_>,
        i: usize,
        finer: Option<&Plan>,
        allowed: Option<&[bool]>,
    ) -> Result<Option<(Plan, Made)>, Error> {
        let candidates = self.source(finer);
        let f = match finer {
            Some(plan) => plan.at_facets.iter().copied().chain(plan.at_interior.iter().map(|at| at.1)).collect(),
            None => self.spacing_in(i - 1, &self.pools[0])?,
        };
        for attempt in 0..MOST_TRIES {
            let scale = self.options.factor * 0.25f64.powi(attempt);
            let made =
                self.anew(ground, &candidates, f.iter().map(|f| f * scale).collect(), &Choice::default(), allowed)?;
            if made.is_some() {
                return Ok(made);
            }
        }
        Ok(None)
    }

    /// A level before level i, which changes the area by much, or in place of it: of at most `most_cells`, with the largest
    /// spacing that changes it by at most `most_change`, keeping what there is of the nodes of level i (`seeds`), so that
    /// this may still be made from it. Also the share of the factor of level i that it has.
    fn between(
        &mut self,
        ground: &Ground<'_>,
        i: usize,
        (seeds, finer): (&Choice, Option<&Plan>),
        allowed: Option<&[bool]>,
        (most_tries, most_cells, most_change): (i32, f64, f64),
    ) -> Result<Option<(f64, Plan, Made)>, Error> {
        let Spacing::Function(spacing) = self.spacing else { return Ok(None) };
        let candidates = self.source(finer);
        for attempt in 0..=most_tries {
            let share = self.options.factor.powf(-f64::from(attempt) / f64::from(BETWEEN + 1));
            let f = spacing.at_tree(share * self.factor(i), &candidates.tree, self.progress)?;
            let Some((plan, made)) = self.anew(ground, &candidates, f, seeds, allowed)? else { continue };
            if made.0.cells.len() as f64 > most_cells {
                break;
            }
            if made.1.change() <= most_change {
                return Ok(Some((share, plan, made)));
            }
        }
        Ok(None)
    }

    /// Lets all levels draw from certain nodes only (ascending): those of a finer level, as they are to be nested in it.
    pub(crate) fn draw_from(&mut self, wanted: &[u32]) {
        let facets = self.domain.len();
        let is_wanted = |node: &u32| wanted.binary_search(node).is_ok();
        self.is_barred = (0..facets as u32).map(|v| !self.domain.copies(v).iter().any(is_wanted)).collect();
        let finest = &mut self.pools[0];
        let is_in = |&k: &usize| k < facets || is_wanted(&finest.candidates.nodes[k]);
        let members: Vec<u32> = (0..finest.len()).filter(is_in).map(|k| k as u32).collect();
        *finest = finest.subset(&members, finest.visits);
        self.pools.truncate(1);
        self.known = None;
        self.at_hand = usize::MAX;
    }
}
