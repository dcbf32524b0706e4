//! The levels that drop features: selected coarse to fine, settled fine to coarse, and where they begin and end.

use super::{Dropped, Ground, Terms, select};
use crate::domain::Domain;
use crate::error::Error;
use crate::hierarchy::{Builder, Level, MAX_LEVELS, STALL};
use crate::kdtree::KdTree;
use crate::level::{Candidates, Choice, LevelMesh};
use crate::point::Point;
use std::borrow::Cow;

/// Tries of a spacing a quarter as large where a level has no cell.
const MOST_TRIES: i32 = 40;

/// A maximal independent set drawn from a set that is hardly denser has holes: nodes may be nearer by this much there.
const DENSER: f64 = 1.2;

/// A settled level.
type Made = (LevelMesh, Dropped);

/// A selected level that is not settled yet.
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
        let is_enough = |builder: &mut Self, i: usize| -> Result<bool, Error> {
            let choice = builder.plan(i, &Choice::default())?.choice;
            let sites = choice.kept.iter().filter(|&&kept| kept).count() + choice.interior.len();
            // n points have at most 2 n - 5 triangles; the last level has one at least
            Ok(2 * sites <= builder.options.coarsest + 5 || sites <= 3)
        };
        let mut depth = self.roughly()?;
        if is_enough(self, depth)? {
            while depth > 1 && is_enough(self, depth - 1)? {
                depth -= 1;
            }
        } else {
            while depth < MAX_LEVELS && !is_enough(self, depth)? {
                depth += 1;
            }
        }
        Ok(depth)
    }

    fn terms(&self) -> Terms<'_> {
        let mut rules = self.options.rules;
        if !self.is_barred.is_empty() {
            rules.beta *= DENSER;
        }
        Terms { rules, cos_feature: self.options.cos_feature, is_barred: &self.is_barred }
    }

    fn plan(&mut self, i: usize, seeds: &Choice) -> Result<Plan, Error> {
        let (f, p) = self.at_hand(i)?;
        let candidate_of = |node: u32| self.candidate_of[node as usize];
        let candidates = &self.pools[p].candidates;
        let choice = select(self.domain, candidates, &f, seeds, candidate_of, self.terms(), self.progress)?;
        let mut at_interior: Vec<(u32, f64)> =
            choice.interior.iter().map(|&node| (node, f[candidate_of(node) as usize])).collect();
        at_interior.sort_unstable_by_key(|at| at.0);
        let at_facets = f[..self.domain.len()].to_vec();
        Ok(Plan { choice, at_facets, at_interior, visits: self.visits(i, p) })
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
        let ground = Ground::new(self.domain, self.input, self.options.cos_feature);
        let nodes_of = |mesh: &LevelMesh| {
            let mut is_in = vec![false; self.input.points.len()];
            mesh.nodes.iter().for_each(|&node| is_in[node as usize] = true);
            is_in
        };
        let mut allowed = finer.filter(|_| self.options.nested).map(|level| nodes_of(&level.mesh));
        let mut before = finer.map_or(self.input.cells.len(), |level| level.mesh.cells.len());
        let is_open = self.options.levels.is_none();
        let mut sites = self.pools[0].members.len() - self.is_barred.iter().filter(|&&barred| barred).count();
        let mut visits = 0;
        let mut levels: Vec<Level> = Vec::new();
        for k in 0..plans.len() {
            self.progress.enter(3, 1)?;
            visits += plans[k].visits;
            // most of those left out are known before they are made
            let planned = plans[k].sites(self.domain, allowed.as_deref());
            if is_open && k + 1 < plans.len() && planned as f64 > STALL * sites as f64 {
                continue;
            }
            let plan = &mut plans[k];
            let made = ground.settle(&mut plan.choice, &plan.at_facets, allowed.as_deref())?;
            let made = match made {
                Some(made) => Some(made),
                None => {
                    let finer = k.checked_sub(1).map(|k| &plans[k]);
                    self.denser(&ground, first + k, finer, allowed.as_deref())?.map(|(plan, made)| {
                        plans[k] = plan;
                        made
                    })
                }
            };
            let factor = self.factor(first + k);
            let Some((mesh, dropped)) = made else {
                let Some(last) = levels.last().or(finer) else {
                    return Err(Error::Internal("no level of the domain has a cell".into()));
                };
                let again = Level { factor, dropped: last.dropped.or(Some(Dropped::default())), ..last.clone() };
                levels.extend((!is_open).then_some(again));
                continue;
            };
            let plan = &plans[k];
            let now = mesh.cells.len();
            let is_last = is_open && now <= self.options.coarsest;
            if is_open && !is_last && now as f64 > STALL * before as f64 {
                continue;
            }
            let spacing = plan.spacing(&ground, &mesh);
            if self.options.nested {
                allowed = Some(nodes_of(&mesh));
            }
            (before, sites) = (now, plan.sites(self.domain, None));
            levels.push(Level { mesh, factor, spacing, visits: std::mem::take(&mut visits), dropped: Some(dropped) });
            if is_last {
                break;
            }
        }
        Ok(levels)
    }

    /// A level in place of level i, which has no cell: from the nodes of the finer plan, or of all that levels draw from, with
    /// a spacing made smaller until there is a cell.
    fn denser(
        &mut self,
        ground: &Ground<'_>,
        i: usize,
        finer: Option<&Plan>,
        allowed: Option<&[bool]>,
    ) -> Result<Option<(Plan, Made)>, Error> {
        let facets = self.domain.len();
        let (f, all) = match finer {
            Some(plan) => {
                let mut f = plan.at_facets.clone();
                let mut interior: Vec<u32> = plan.choice.interior.clone();
                interior.sort_unstable();
                for node in &interior {
                    f.push(
                        plan.at_interior.binary_search_by_key(node, |at| at.0).map_or(0.0, |k| plan.at_interior[k].1),
                    );
                }
                let mut nodes: Vec<u32> = self.pools[0].candidates.nodes[..facets].to_vec();
                nodes.append(&mut interior);
                (f, nodes)
            }
            None => (self.spacing_in(i - 1, &self.pools[0])?, self.pools[0].candidates.nodes.to_vec()),
        };
        let points: Vec<Point<2>> = all.iter().map(|&node| self.input.points[node as usize]).collect();
        let tree = Cow::Owned(KdTree::new(&points));
        let candidates = Candidates { tree, points: Cow::Owned(points), nodes: Cow::Owned(all) };
        for attempt in 0..MOST_TRIES {
            let scale = self.options.factor * 0.25f64.powi(attempt);
            let f: Vec<f64> = f.iter().map(|f| f * scale).collect();
            let none = Choice::default();
            let mut choice = select(self.domain, &candidates, &f, &none, |node| node, self.terms(), self.progress)?;
            let Some(made) = ground.settle(&mut choice, &f, allowed)? else { continue };
            let mut at_interior: Vec<(u32, f64)> =
                candidates.nodes[facets..].iter().copied().zip(f[facets..].iter().copied()).collect();
            at_interior.sort_unstable_by_key(|at| at.0);
            let visits = candidates.nodes.len();
            return Ok(Some((Plan { choice, at_facets: f[..facets].to_vec(), at_interior, visits }, made)));
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
        let members: Vec<usize> = (0..finest.candidates.nodes.len()).filter(is_in).collect();
        let points: Vec<Point<2>> = members.iter().map(|&k| finest.candidates.points[k]).collect();
        let nodes = members.iter().map(|&k| finest.candidates.nodes[k]).collect();
        let tree = Cow::Owned(KdTree::new(&points));
        finest.candidates = Candidates { tree, points: Cow::Owned(points), nodes: Cow::Owned(nodes) };
        finest.members = members.into_iter().map(|k| k as u32).collect();
        self.pools.truncate(1);
        self.at_hand = usize::MAX;
    }
}
