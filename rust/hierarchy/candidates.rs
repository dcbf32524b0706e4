//! The candidates of the finest pool, and values at them.

use crate::domain::Domain;
use crate::kdtree::{GRAIN, KdTree};
use crate::level::Candidates;
use crate::point::Point;
use crate::remaining::remaining_from;
use rayon::prelude::*;
use std::borrow::Cow;

/// All nodes as candidates: facet vertices, then interior nodes in the order of the tree's leaves, a spatial one.
pub(super) fn candidates(points: &[Point<2>], domain: &Domain) -> Candidates<'static> {
    let facets = domain.len();
    let mut on_facets = domain.nodes().to_vec();
    on_facets.sort_unstable();
    let mut nodes = vec![0; facets + points.len() - on_facets.len()];
    let (vertices, interior) = nodes.split_at_mut(facets);
    vertices.iter_mut().zip(0..).for_each(|(node, v)| *node = domain.copies(v)[0]);
    interior.par_chunks_mut(GRAIN).enumerate().for_each(|(chunk, nodes)| {
        nodes.iter_mut().zip(remaining_from(&on_facets, chunk * GRAIN)).for_each(|(node, i)| *node = i as u32);
    });
    let tree = KdTree::of(nodes.len(), |k| points[nodes[k] as usize]);
    let (tree, were) = tree.numbered_from(facets as u32);
    let before = |k: usize| k.checked_sub(facets).map_or(k, |k| were[k] as usize);
    let nodes = (0..nodes.len()).into_par_iter().map(|k| nodes[before(k)]).collect();
    Candidates { tree: Cow::Owned(tree), nodes: Cow::Owned(nodes) }
}

/// A given spacing at the candidates, the least of a vertex's copies.
pub(super) fn candidate_spacing(spacing: &[f64], domain: &Domain, nodes: &[u32]) -> Vec<f64> {
    let least = |copies: &[u32]| copies.iter().map(|&i| spacing[i as usize]).fold(f64::INFINITY, f64::min);
    let facets = (0..domain.len() as u32).map(|v| least(domain.copies(v)));
    facets.chain(nodes[domain.len()..].iter().map(|&i| spacing[i as usize])).collect()
}

/// Values of candidates, in leaf order, at all `n` nodes, copies alike.
pub(super) fn spacing_at_nodes(g: &[f64], domain: &Domain, all: &Candidates<'_>, n: usize) -> Vec<f64> {
    let mut at_nodes = vec![0.0; n];
    all.tree.order().iter().zip(g).for_each(|(&k, &value)| at_nodes[all.nodes[k as usize] as usize] = value);
    for v in 0..domain.len() as u32 {
        let [first, others @ ..] = domain.copies(v) else { continue };
        others.iter().for_each(|&node| at_nodes[node as usize] = at_nodes[*first as usize]);
    }
    at_nodes
}
