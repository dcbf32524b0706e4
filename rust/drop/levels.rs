//! The levels that drop features: selected coarse to fine, settled fine to coarse, and where they begin and end.

use super::{Ground, select};
use crate::error::Error;
use crate::hierarchy::{Builder, Level, MAX_LEVELS};
use crate::kdtree::KdTree;
use crate::level::{Candidates, Choice, LevelMesh, Place};
use crate::point::Point;
use std::borrow::Cow;

/// Tries of a spacing a quarter as large where a level has no cell.
const MOST_TRIES: i32 = 40;

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
    /// a third of what an unbounded domain would lose for any other. Also whether they are enough, and the candidates (of
    /// the finest pool) that the last of them may keep: coarser levels are to draw from these, as it keeps their nodes.
    pub(crate) fn last_worth_keeping(&mut self) -> Result<(usize, bool, Option<Vec<u32>>), Error> {
        let share = 1.0 - (1.0 - self.options.factor.powi(-2)) / 3.0;
        let most = self.options.levels.unwrap_or(MAX_LEVELS);
        let mut before = self.input.cells.len();
        let mut inside = None;
        for i in 1..=most {
            let chosen = self.choose(i, &Choice::default())?;
            let now = self.n_cells(&chosen.choice);
            if now as f64 > share * before as f64 {
                return Ok((i - 1, false, inside));
            }
            if self.options.levels.is_none() && now <= self.options.coarsest {
                return Ok((i, true, inside));
            }
            before = now;
            let facets = self.domain.len();
            let is_inside = |k: &usize| *k < facets || chosen.places[*k - facets] == Place::Inside;
            let members = &self.pools[chosen.pool].members;
            inside = Some((0..members.len()).filter(is_inside).map(|k| members[k]).collect());
        }
        Ok((most, true, inside))
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

    fn plan(&mut self, i: usize, seeds: &Choice) -> Result<Plan, Error> {
        let (f, p) = self.at_hand(i)?;
        let candidate_of = |node: u32| self.candidate_of[node as usize];
        let rules = (self.options.rules, self.options.cos_feature);
        let candidates = &self.pools[p].candidates;
        let choice = select(self.domain, candidates, &f, seeds, candidate_of, rules, self.progress)?;
        let mut at_interior: Vec<(u32, f64)> =
            choice.interior.iter().map(|&node| (node, f[candidate_of(node) as usize])).collect();
        at_interior.sort_unstable_by_key(|at| at.0);
        let at_facets = f[..self.domain.len()].to_vec();
        Ok(Plan { choice, at_facets, at_interior, visits: self.visits(i, p) })
    }

    /// Makes levels `first` to `depth`; also returns what the finest of them keeps. With an open depth the levels end at
    /// the first of at most `coarsest` cells.
    pub(crate) fn drop_levels(&mut self, first: usize, depth: usize) -> Result<(Vec<Level>, Choice), Error> {
        let mut plans: Vec<Plan> = Vec::new();
        for i in (first..=depth).rev() {
            let none = Choice::default();
            let seeds = plans.last().filter(|_| self.options.nested).map_or(&none, |plan| &plan.choice);
            let plan = self.plan(i, seeds)?;
            plans.push(plan);
        }
        plans.reverse();
        let ground = Ground::new(self.domain, self.input, self.options.cos_feature);
        let mut allowed: Option<Vec<bool>> = None;
        let mut levels: Vec<Level> = Vec::new();
        for k in 0..plans.len() {
            self.progress.enter(3, 1)?;
            let plan = &mut plans[k];
            let made = ground.settle(&mut plan.choice, &plan.at_facets, allowed.as_deref())?;
            let (mesh, dropped) = match made {
                Some(made) => made,
                None => {
                    let finer = k.checked_sub(1).map(|k| &plans[k]);
                    let (plan, made) = self.denser(&ground, finer, allowed.as_deref())?;
                    plans[k] = plan;
                    made
                }
            };
            let plan = &plans[k];
            let spacing = plan.spacing(&ground, &mesh);
            if self.options.nested {
                let mut is_in = vec![false; self.input.points.len()];
                mesh.nodes.iter().for_each(|&node| is_in[node as usize] = true);
                allowed = Some(is_in);
            }
            let is_last = self.options.levels.is_none() && mesh.cells.len() <= self.options.coarsest;
            let factor = self.factor(first + k);
            levels.push(Level { mesh, factor, spacing, visits: plan.visits, dropped: Some(dropped) });
            if is_last {
                break;
            }
        }
        let finest = plans.into_iter().next().map_or_else(Choice::default, |plan| plan.choice);
        Ok((levels, finest))
    }

    /// A level in place of one that has no cell: from the nodes of the finer level, with a spacing made smaller until there
    /// is a cell.
    fn denser(
        &mut self,
        ground: &Ground<'_>,
        finer: Option<&Plan>,
        allowed: Option<&[bool]>,
    ) -> Result<(Plan, (LevelMesh, super::Dropped)), Error> {
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
            None => (self.spacing_in(0, &self.pools[0])?, self.pools[0].candidates.nodes.to_vec()),
        };
        let points: Vec<Point<2>> = all.iter().map(|&node| self.input.points[node as usize]).collect();
        let tree = Cow::Owned(KdTree::new(&points));
        let candidates = Candidates { tree, points: Cow::Owned(points), nodes: Cow::Owned(all) };
        let rules = (self.options.rules, self.options.cos_feature);
        for attempt in 0..MOST_TRIES {
            let scale = self.options.factor * 0.25f64.powi(attempt);
            let f: Vec<f64> = f.iter().map(|f| f * scale).collect();
            let none = Choice::default();
            let mut choice = select(self.domain, &candidates, &f, &none, |node| node, rules, self.progress)?;
            let Some(made) = ground.settle(&mut choice, &f, allowed)? else { continue };
            let mut at_interior: Vec<(u32, f64)> =
                candidates.nodes[facets..].iter().copied().zip(f[facets..].iter().copied()).collect();
            at_interior.sort_unstable_by_key(|at| at.0);
            let visits = candidates.nodes.len();
            return Ok((Plan { choice, at_facets: f[..facets].to_vec(), at_interior, visits }, made));
        }
        Err(Error::Internal("no level of the domain has a cell".into()))
    }

    /// Lets all levels draw from certain candidates of the finest pool only.
    pub(crate) fn draw_from(&mut self, members: Vec<u32>) {
        let finest = &mut self.pools[0];
        let points: Vec<Point<2>> = members.iter().map(|&k| finest.candidates.points[k as usize]).collect();
        let nodes = members.iter().map(|&k| finest.candidates.nodes[k as usize]).collect();
        let tree = Cow::Owned(KdTree::new(&points));
        finest.candidates = Candidates { tree, points: Cow::Owned(points), nodes: Cow::Owned(nodes) };
        finest.members = members;
        self.pools.truncate(1);
        self.at_hand = usize::MAX;
    }
}
