//! The baseline of Table 2: maximal independent sets of the edge skeleton, retriangulated, again and again.
//!
//! Classes as in Figure 2 (corners are kept, then facet vertices, then interior nodes, each by index); coincident nodes
//! are one. The domain is kept valid by putting facet vertices back, nothing else.

use crate::domain::Domain;
use crate::error::Error;
use crate::hierarchy::{CellRows, Level, Options, STALL, Stopped};
use crate::level::{Choice, assemble, triangulate};
use crate::point::Point;
use crate::progress::Progress;
use std::borrow::Cow;

/// Builds the levels, finest first. `cells` are the input's; no spacing is known of these levels.
pub fn hierarchy(
    points: &[Point<2>],
    cells: CellRows<'_>,
    domain: &Domain,
    options: Options,
    progress: &Progress,
) -> Result<(Vec<Level>, Stopped), Error> {
    let mut vertex_of = std::collections::HashMap::new();
    for v in 0..domain.len() as u32 {
        vertex_of.extend(domain.copies(v).iter().map(|&node| (node, v)));
    }
    let first_copy = |node: u32| vertex_of.get(&node).map_or(node, |&v| domain.copies(v)[0]);
    let mut cells: Vec<[u32; 3]> = cells.iter().collect();
    // what is put back must be of the finer level, so its chains are those at hand
    let mut thin = Cow::Borrowed(domain);
    let mut levels: Vec<Level> = Vec::new();
    loop {
        if let Some(stopped) = options.enough(levels.len(), cells.len()) {
            return Ok((levels, stopped));
        }
        progress.enter(2, 1)?;
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(6 * cells.len());
        for cell in &cells {
            let cell = cell.map(first_copy);
            edges.extend((0..3).flat_map(|k| [[cell[k], cell[(k + 1) % 3]], [cell[(k + 1) % 3], cell[k]]]));
        }
        edges.sort_unstable();
        edges.dedup();
        let (facet, mut interior): (Vec<u32>, Vec<u32>) =
            edges.chunk_by(|a, b| a[0] == b[0]).map(|run| run[0][0]).partition(|node| vertex_of.contains_key(node));
        let corners = (0..domain.len()).filter(|&v| domain.corner[v]).map(|v| domain.copies(v as u32)[0]);
        let (mut chosen, mut blocked) = (vec![false; points.len()], vec![false; points.len()]);
        corners.clone().for_each(|node| chosen[node as usize] = true);
        for node in corners.chain(facet).chain(interior.iter().copied()) {
            if blocked[node as usize] && !chosen[node as usize] {
                continue;
            }
            chosen[node as usize] = true;
            let first = edges.partition_point(|edge| edge[0] < node);
            edges[first..].iter().take_while(|edge| edge[0] == node).for_each(|edge| blocked[edge[1] as usize] = true);
        }
        interior.retain(|&node| chosen[node as usize]);
        let mut kept: Vec<bool> = (0..domain.len()).map(|v| chosen[domain.copies(v as u32)[0] as usize]).collect();
        let obstacles: Vec<Point<2>> = interior.iter().map(|&node| points[node as usize]).collect();
        let chords = thin.repair(&mut kept, &obstacles, false);
        progress.enter(3, 1)?;
        let mut choice = Choice { kept, interior, chords, ..Choice::default() };
        let level = triangulate(&thin, points, &mut choice)?;
        let mesh = assemble(&thin, &choice, &level)?;
        if options.levels.is_none() && mesh.cells.len() as f64 > STALL * cells.len() as f64 {
            return Ok((levels, Stopped::Stalled));
        }
        cells = mesh.cells.iter().map(|cell| cell.map(|k| mesh.nodes[k as usize])).collect();
        thin = Cow::Owned(thin.thinned(&choice.kept));
        let visits = edges.len();
        levels.push(Level {
            factor: options.factor.powi(levels.len() as i32 + 1),
            spacing: Vec::new(),
            visits,
            mesh,
            dropped: None,
        });
    }
}
