//! Parts of the input, which no level joins.
//!
//! Cells that share an edge are of one part; parts may touch at single nodes or along lines of doubled nodes. A cell of a
//! level is of a part that all three of its corners belong to, and where there is none it is no cell: a gap between two
//! parts stays open however narrow it is. Cells of different parts are no neighbours, even where they share an edge of
//! vertices: each has its own copies there.

use super::Ground;
use super::trim::Trimmed;
use crate::domain::Domain;
use crate::hierarchy::Input;
use crate::level::Choice;
use crate::point::NONE;
use std::collections::HashMap;

/// The parts of a mesh.
pub struct Parts {
    /// A cell of each node.
    pub home: Vec<u32>,
    /// For each node the number of its part, the same for parts that share a place; empty where there is but one part.
    pub group: Vec<u32>,
    /// Part of each cell; empty where there is but one.
    of_cell: Vec<u32>,
    /// Parts of the nodes at which cells meet that share no edge there.
    at_pinch: HashMap<u32, Vec<u32>>,
}

impl Parts {
    /// Runtime: O(m) for m cells, nearly.
    pub fn new(domain: &Domain, input: &Input<'_>) -> Parts {
        let mut home = vec![NONE; input.points.len()];
        for (t, cell) in (0u32..).zip(input.cells.iter()) {
            cell.iter().for_each(|&node| home[node as usize] = t);
        }
        let mut ends = vec![0u8; home.len()];
        for facet in input.facets.iter().filter(|facet| facet.cell_tags.1.is_none()) {
            facet.nodes.iter().for_each(|&i| ends[i as usize] = ends[i as usize].saturating_add(1));
        }
        let is_pinch = |i: u32| ends[i as usize] > 2;
        let mut parent: Vec<u32> = (0..input.cells.len() as u32).collect();
        let mut count = parent.len();
        let mut join = |a: u32, b: u32| {
            let (a, b) = (root(&mut parent, a), root(&mut parent, b));
            if a != b {
                parent[a.max(b) as usize] = a.min(b);
                count -= 1;
            }
        };
        // at any other node the cells are one fan, so that the node joins them; edges between pinches join their two cells
        let mut beside: HashMap<[u32; 2], u32> = HashMap::new();
        for (t, cell) in (0u32..).zip(input.cells.iter()) {
            cell.iter().filter(|&&i| !is_pinch(i)).for_each(|&i| join(t, home[i as usize]));
            for k in 0..3 {
                let [a, b] = [cell[k], cell[(k + 1) % 3]];
                if is_pinch(a) && is_pinch(b) {
                    join(t, *beside.entry([a.min(b), a.max(b)]).or_insert(t));
                }
            }
        }
        let (mut of_cell, mut at_pinch) = (Vec::new(), HashMap::<u32, Vec<u32>>::new());
        if count > 1 {
            of_cell = (0..parent.len() as u32).map(|t| root(&mut parent, t)).collect();
            for (cell, &part) in input.cells.iter().zip(&of_cell) {
                cell.iter().filter(|&&i| is_pinch(i)).for_each(|&i| at_pinch.entry(i).or_default().push(part));
            }
            at_pinch.values_mut().for_each(|parts| {
                parts.sort_unstable();
                parts.dedup();
            });
        }
        let mut parts = Parts { home, group: Vec::new(), of_cell, at_pinch };
        if count > 1 {
            for v in 0..domain.len() as u32 {
                let mut at = domain.copies(v).iter().flat_map(|&node| parts.at(node));
                if let Some(&first) = at.next() {
                    for &part in at {
                        let (a, b) = (root(&mut parent, first), root(&mut parent, part));
                        parent[a.max(b) as usize] = a.min(b);
                    }
                }
            }
            let mut number = HashMap::new();
            let mut group = |&t: &u32| {
                let next = number.len() as u32;
                *number.entry(root(&mut parent, t)).or_insert(next)
            };
            parts.group = parts.home.iter().map(&mut group).collect();
        }
        parts
    }

    /// The part of a node, the first where there are several.
    pub fn first(&self, node: u32) -> u32 {
        self.at(node).first().copied().unwrap_or(0)
    }

    /// By part, whether its outer boundary is a speck.
    pub fn no_larger(&self, domain: &Domain, is_speck: &[bool]) -> Vec<bool> {
        let mut lost = vec![false; self.of_cell.len().max(1)];
        for (c, chain) in (0u32..).zip(&domain.chains).filter(|&(c, _)| is_speck[c as usize]) {
            let node = chain.edges[0].sides.iter().find(|side| side.is_inside()).map(|side| side.tail);
            if domain.is_outer(c) && !domain.is_hole(c) {
                node.into_iter().for_each(|node| lost[self.first(node) as usize] = true);
            }
        }
        lost
    }

    /// Parts of a node; none where there is but one part.
    fn at(&self, node: u32) -> &[u32] {
        let own = || self.of_cell.get(self.home[node as usize] as usize).map_or(&[][..], std::slice::from_ref);
        self.at_pinch.get(&node).map_or_else(own, Vec::as_slice)
    }
}

fn root(parent: &mut [u32], mut t: u32) -> u32 {
    while parent[t as usize] != t {
        let up = parent[t as usize];
        parent[t as usize] = parent[up as usize];
        t = up;
    }
    t
}

impl Ground<'_> {
    /// Whether a cell of the level may have a node.
    pub(super) fn is_of(&self, node: u32, part: u32) -> bool {
        self.parts.of_cell.is_empty() || self.parts.at(node).binary_search(&part).is_ok()
    }

    /// Tells the part of each cell of the level, from the nodes that `is_allowed` admits; cells of none are taken out.
    pub(super) fn part(&self, choice: &Choice, trimmed: &mut Trimmed, is_allowed: impl Fn(u32) -> bool) {
        if self.parts.of_cell.is_empty() {
            return;
        }
        let facets = self.domain.len() as u32;
        let of_site = |&site: &u32| match site.checked_sub(facets) {
            Some(node) => self.parts.at(node).to_vec(),
            None => {
                let copies = self.domain.copies(site).iter().copied().filter(|&node| is_allowed(node));
                let mut parts: Vec<u32> = copies.flat_map(|node| self.parts.at(node)).copied().collect();
                parts.sort_unstable();
                parts.dedup();
                parts
            }
        };
        trimmed.parts_at = trimmed.sites.iter().map(of_site).collect();
        trimmed.part.fill(NONE);
        let mut unsure = Vec::new();
        for t in 0..trimmed.label.len() {
            let common = trimmed.common_parts(t);
            match common[..] {
                [] => trimmed.label[t] = None,
                [part] => trimmed.part[t] = part,
                _ => match self.part_beside(choice, trimmed, t) {
                    Some(part) if common.contains(&part) => trimmed.part[t] = part,
                    _ => unsure.push((t, common)),
                },
            }
        }
        // what several parts could have is of the part next to it
        while !unsure.is_empty() {
            let before = unsure.len();
            unsure.retain(|(t, common)| {
                let next = (0..3).filter(|&k| trimmed.cells[*t].constraints[k] == NONE);
                let mut parts = next.filter_map(|k| trimmed.part.get(trimmed.cells[*t].neighbours[k] as usize));
                let found = parts.find(|part| common.contains(part)).copied();
                found.into_iter().for_each(|part| trimmed.part[*t] = part);
                found.is_none()
            });
            if unsure.len() == before
                && let Some((t, common)) = unsure.pop()
            {
                trimmed.part[t] = common[0];
            }
        }
    }

    /// The part that a chord beside a cell has on its side.
    fn part_beside(&self, choice: &Choice, trimmed: &Trimmed, t: usize) -> Option<u32> {
        let node = trimmed.cells[t].constraints.iter().find_map(|&c| self.copy(choice, c, true))?;
        match self.parts.at(node) {
            [part] => Some(*part),
            _ => None,
        }
    }
}

impl Trimmed {
    /// Parts that all corners of a cell belong to, ascending.
    fn common_parts(&self, t: usize) -> Vec<u32> {
        // a corner may belong to thousands
        let mut lists = self.cells[t].corners.map(|s| &self.parts_at[s as usize]);
        lists.sort_unstable_by_key(|parts| parts.len());
        let [few, more, most] = lists;
        let is_common = |part: &u32| more.binary_search(part).is_ok() && most.binary_search(part).is_ok();
        few.iter().copied().filter(is_common).collect()
    }

    /// Whether a cell could be of a part.
    pub(super) fn fits(&self, t: usize, part: u32) -> bool {
        self.parts_at.is_empty() || self.common_parts(t).contains(&part)
    }

    /// Takes out one of two cells of different parts that share an edge of nodes, the smaller; whether there were any.
    /// `corners` are the nodes of the cells that are `alive`, one for each.
    pub(super) fn part_again(&mut self, alive: &[usize], corners: &[[u32; 3]]) -> bool {
        if self.parts_at.is_empty() {
            return false;
        }
        let mut beside: HashMap<[u32; 2], usize> = HashMap::new();
        let mut lost = Vec::new();
        for (&t, cell) in alive.iter().zip(corners) {
            for k in 0..3 {
                let [a, b] = [cell[k], cell[(k + 1) % 3]];
                let other = *beside.entry([a.min(b), a.max(b)]).or_insert(t);
                if self.part[other] != self.part[t] {
                    lost.push(if self.area_of(other) < self.area_of(t) { other } else { t });
                }
            }
        }
        lost.iter().for_each(|&t| self.label[t] = None);
        !lost.is_empty()
    }
}
