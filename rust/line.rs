//! Hierarchies on meshes of the line (d = 1): paths of intervals.
//!
//! Figures 2 and 3 as in the plane, with the triangulation replaced by joining kept nodes that follow each other along
//! a path. P0 are the ends of the paths and the nodes where cell tags change; there is no P1.

use crate::error::Error;
use crate::hierarchy::{MAX_LEVELS, Method, Options, STALL, Stopped};
use crate::kdtree::KdTree;
use crate::point::{NONE, Point, distance};
use crate::progress::Progress;
use crate::selection::{greedy, rank};
use crate::spacing::{CoarseSpacing, nearest, threshold};

/// A coarser level of a line.
pub struct LineLevel {
    /// Nodes of the input mesh, ascending.
    pub nodes: Vec<u32>,
    /// Cells, as indices into `nodes`, left end first.
    pub cells: Vec<[u32; 2]>,
    /// Tags of the cells.
    pub cell_tags: Vec<i64>,
    /// C^i.
    pub factor: f64,
    /// f_i at the nodes.
    pub spacing: Vec<f64>,
}

struct Line<'a> {
    points: &'a [Point<1>],
    tree: KdTree<1>,
    g: Vec<f64>,
    /// Nodes along each path, and the tags of the cells between them.
    paths: Vec<(Vec<u32>, Vec<i64>)>,
    corner: Vec<bool>,
    options: Options,
    progress: &'a Progress,
}

/// Builds the coarser levels, finest first, with the reason for the end and the spacing of the input.
pub fn hierarchy(
    points: &[Point<1>],
    cells: &[[u32; 2]],
    cell_tags: Option<&[i64]>,
    spacing: Option<&[f64]>,
    options: Options,
    progress: &Progress,
) -> Result<(Vec<LineLevel>, Stopped, Vec<f64>), Error> {
    let tree = KdTree::new(points);
    let g = match spacing {
        Some(spacing) => spacing.to_vec(),
        None => nearest(&tree, progress)?,
    };
    let paths = paths(points.len(), cells, cell_tags);
    let mut corner = vec![false; points.len()];
    for (nodes, tags) in &paths {
        corner[nodes[0] as usize] = true;
        corner[nodes[nodes.len() - 1] as usize] = true;
        for k in (1..tags.len()).filter(|&k| tags[k - 1] != tags[k]) {
            corner[nodes[k] as usize] = true;
        }
    }
    let line = Line { points, tree, g, paths, corner, options, progress };
    let (levels, stopped) = if options.method == Method::Mis { line.skeleton()? } else { line.build(cells.len())? };
    Ok((levels, stopped, line.g))
}

/// The paths of intervals, each from its lower end.
fn paths(n: usize, cells: &[[u32; 2]], cell_tags: Option<&[i64]>) -> Vec<(Vec<u32>, Vec<i64>)> {
    let mut next = vec![(NONE, 0); n];
    let mut is_head = vec![false; n];
    for (c, &[a, b]) in cells.iter().enumerate() {
        next[a as usize] = (b, cell_tags.map_or(0, |tags| tags[c]));
        is_head[b as usize] = true;
    }
    let mut paths = Vec::new();
    for start in (0..n as u32).filter(|&i| !is_head[i as usize]) {
        let (mut nodes, mut tags) = (vec![start], Vec::new());
        let mut at = start;
        while next[at as usize].0 != NONE {
            tags.push(next[at as usize].1);
            at = next[at as usize].0;
            nodes.push(at);
        }
        paths.push((nodes, tags));
    }
    paths
}

impl Line<'_> {
    fn spacing(&self, i: usize) -> Result<Vec<f64>, Error> {
        let factor = self.options.factor.powi(i as i32);
        match self.options.method {
            Method::Threshold => Ok(threshold(&self.g, factor)),
            _ => CoarseSpacing::new(&self.tree, &self.g, None, self.options.rules.gradation)
                .at_points(factor, self.progress),
        }
    }

    fn choose(&self, f: &[f64], seeds: &[bool]) -> Result<Vec<bool>, Error> {
        let mut kept: Vec<bool> = self.corner.iter().zip(seeds).map(|(&corner, &seed)| corner || seed).collect();
        let nodes: Vec<u32> = (0..self.points.len() as u32).collect();
        let keep: Vec<u32> = nodes.iter().copied().filter(|&i| kept[i as usize]).collect();
        let mut order = Vec::new();
        for (path, _) in &self.paths {
            let ends = [path[0], path[path.len() - 1]].map(|i| &self.points[i as usize]);
            order.extend(path.iter().copied().filter(|&i| {
                let reach = self.options.rules.delta * f[i as usize];
                !kept[i as usize] && ends.iter().all(|&end| distance(end, &self.points[i as usize]) >= reach)
            }));
        }
        order.sort_unstable();
        rank(&mut order, f);
        for i in greedy(&self.tree, f, self.options.rules.beta, &order, &keep, self.progress)? {
            kept[i as usize] = true;
        }
        Ok(kept)
    }

    fn level(&self, i: usize, kept: &[bool], f: &[f64]) -> LineLevel {
        let nodes: Vec<u32> = (0..kept.len() as u32).filter(|&i| kept[i as usize]).collect();
        let mut index = vec![NONE; kept.len()];
        nodes.iter().enumerate().for_each(|(k, &i)| index[i as usize] = k as u32);
        let (mut cells, mut cell_tags) = (Vec::new(), Vec::new());
        for (path, tags) in &self.paths {
            let mut last = 0;
            for k in (1..path.len()).filter(|&k| kept[path[k] as usize]) {
                cells.push([index[path[last] as usize], index[path[k] as usize]]);
                cell_tags.push(tags[last]);
                last = k;
            }
        }
        let spacing = nodes.iter().map(|&i| f[i as usize]).collect();
        LineLevel { nodes, cells, cell_tags, factor: self.options.factor.powi(i as i32), spacing }
    }

    fn n_cells(&self, kept: &[bool]) -> usize {
        kept.iter().filter(|&&k| k).count() - self.paths.len()
    }

    fn build(&self, n_cells: usize) -> Result<(Vec<LineLevel>, Stopped), Error> {
        let none = vec![false; self.points.len()];
        let (depth, mut stopped) = match self.options.levels {
            Some(levels) => (levels, Stopped::Levels),
            None => {
                let (mut depth, mut before) = (0, n_cells);
                loop {
                    let now = self.n_cells(&self.choose(&self.spacing(depth + 1)?, &none)?);
                    if now as f64 > STALL * before as f64 || depth == MAX_LEVELS {
                        break (depth, Stopped::Stalled);
                    }
                    (depth, before) = (depth + 1, now);
                    if now <= self.options.coarsest {
                        break (depth, Stopped::Coarsest);
                    }
                }
            }
        };
        let mut levels = Vec::new();
        let mut kept = none.clone();
        for i in (1..=depth).rev() {
            let f = self.spacing(i)?;
            kept = self.choose(&f, if self.options.nested { &kept } else { &none })?;
            levels.push(self.level(i, &kept, &f));
        }
        levels.reverse();
        if self.options.levels.is_none()
            && let Some(first) = levels.iter().position(|level| level.cells.len() <= self.options.coarsest)
        {
            levels.truncate(first + 1);
            stopped = Stopped::Coarsest;
        }
        Ok((levels, stopped))
    }

    /// The baseline: every other node along each path, again and again.
    fn skeleton(&self) -> Result<(Vec<LineLevel>, Stopped), Error> {
        let mut kept = vec![true; self.points.len()];
        let mut levels: Vec<LineLevel> = Vec::new();
        loop {
            let before = self.n_cells(&kept);
            if let Some(stopped) = self.options.enough(levels.len(), before) {
                return Ok((levels, stopped));
            }
            let mut fewer = self.corner.clone();
            for (path, _) in &self.paths {
                let held: Vec<u32> = path.iter().copied().filter(|&i| kept[i as usize]).collect();
                for k in 1..held.len().saturating_sub(1) {
                    let around = [held[k - 1], held[k + 1]];
                    fewer[held[k] as usize] |= around.iter().all(|&i| !fewer[i as usize]);
                }
            }
            if self.options.levels.is_none() && self.n_cells(&fewer) as f64 > STALL * before as f64 {
                return Ok((levels, Stopped::Stalled));
            }
            kept = fewer;
            levels.push(self.level(levels.len() + 1, &kept, &self.spacing(levels.len() + 1)?));
        }
    }
}
