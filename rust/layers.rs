//! Hierarchies of meshes whose parts overlap.
//!
//! The two sides of a sliding interface need not match node by node; their polygons then overlap by slivers, and no one
//! triangulation can hold both. Such parts lie in different *layers*; each layer is coarsened as a mesh of its own, and
//! every level joins the layers' levels.

use crate::domain::FacetRow;
use crate::drop::Dropped;
use crate::error::Error;
use crate::hierarchy::{CellRows, Drop, Hierarchy, Input, Level, Options, STALL, Stopped, hierarchy};
use crate::level::LevelMesh;
use crate::point::{NONE, Point};
use crate::progress::Progress;

/// A layer as a mesh of its own, and its nodes in the whole mesh.
struct Layer {
    nodes: Vec<u32>,
    points: Vec<Point<2>>,
    cells: Vec<[u32; 3]>,
    facets: Vec<FacetRow>,
    spacing: Option<Vec<f64>>,
}

/// Builds the coarser levels of a mesh in layers; `layer` tells the layer of each node.
pub fn hierarchy_in_layers(
    input: &Input<'_>,
    layer: &[u8],
    options: Options,
    progress: &Progress,
) -> Result<Hierarchy, Error> {
    let layers = split(input, layer);
    let depth = match options.levels {
        Some(levels) => levels,
        None => {
            // together the layers' last levels should be small enough; where some are left out, their factors still tell
            let options = Options { coarsest: (options.coarsest / layers.len().max(1)).max(1), ..options };
            let mut deepest = 0;
            for one in &layers {
                let (levels, ..) = hierarchy(&one.input(), options, progress)?;
                let last = levels.last().map_or(1.0, |level| level.factor);
                deepest = deepest.max((last.ln() / options.factor.ln()).round() as usize);
            }
            deepest
        }
    };
    let options_of_layers = Options { levels: Some(depth), ..options };
    let mut made = Vec::new();
    let mut g = vec![0.0; input.points.len()];
    for one in &layers {
        let (levels, _, spacing) = hierarchy(&one.input(), options_of_layers, progress)?;
        one.nodes.iter().zip(spacing).for_each(|(&node, value)| g[node as usize] = value);
        made.push(levels.into_iter());
    }
    let mut levels: Vec<Level> = Vec::new();
    let mut before = input.cells.len();
    for _ in 0..depth {
        let parts: Vec<(&Layer, Level)> = layers
            .iter()
            .zip(&mut made)
            .filter_map(|(layer, levels)| levels.next().map(|level| (layer, level)))
            .collect();
        let level = join(parts);
        let now = level.mesh.cells.len();
        if options.levels.is_none() && now as f64 > STALL * before as f64 {
            if options.drop == Drop::Never {
                return Ok((levels, Stopped::Stalled, g));
            }
            continue;
        }
        levels.push(level);
        before = now;
        if options.levels.is_none() && now <= options.coarsest {
            return Ok((levels, Stopped::Coarsest, g));
        }
    }
    Ok((levels, if options.levels.is_some() { Stopped::Levels } else { Stopped::Stalled }, g))
}

impl Layer {
    fn input(&self) -> Input<'_> {
        Input {
            points: &self.points,
            facets: &self.facets,
            spacing: self.spacing.as_deref(),
            cells: CellRows::Short(&self.cells),
        }
    }
}

fn split(input: &Input<'_>, layer: &[u8]) -> Vec<Layer> {
    let count = layer.iter().max().map_or(0, |&most| usize::from(most) + 1);
    let mut index = vec![NONE; layer.len()];
    let mut layers = Vec::new();
    for l in 0..count {
        let nodes: Vec<u32> = (0..layer.len() as u32).filter(|&i| usize::from(layer[i as usize]) == l).collect();
        nodes.iter().enumerate().for_each(|(k, &i)| index[i as usize] = k as u32);
        let is_here = |node: u32| usize::from(layer[node as usize]) == l;
        let cells = input.cells.iter().filter(|cell| is_here(cell[0]));
        let facets = input.facets.iter().filter(|facet| is_here(facet.nodes[0]));
        layers.push(Layer {
            points: nodes.iter().map(|&i| input.points[i as usize]).collect(),
            cells: cells.map(|cell| cell.map(|i| index[i as usize])).collect(),
            facets: facets.map(|facet| FacetRow { nodes: facet.nodes.map(|i| index[i as usize]), ..*facet }).collect(),
            spacing: input.spacing.map(|spacing| nodes.iter().map(|&i| spacing[i as usize]).collect()),
            nodes,
        });
    }
    layers.retain(|layer| !layer.cells.is_empty());
    layers
}

/// One level from the layers' levels.
fn join(parts: Vec<(&Layer, Level)>) -> Level {
    let mut nodes: Vec<(u32, f64)> = Vec::new();
    for (layer, level) in &parts {
        let whole = level.mesh.nodes.iter().map(|&i| layer.nodes[i as usize]);
        // the baseline knows no spacing of its levels
        let spacing = level.spacing.iter().copied().chain(std::iter::repeat(f64::NAN));
        nodes.extend(whole.zip(spacing));
    }
    nodes.sort_unstable_by_key(|&(node, _)| node);
    let index = |layer: &Layer, mesh: &LevelMesh, k: u32| {
        let node = layer.nodes[mesh.nodes[k as usize] as usize];
        nodes.binary_search_by_key(&node, |&(node, _)| node).map_or(NONE, |i| i as u32)
    };
    let mut mesh = LevelMesh::default();
    let mut visits = 0;
    let mut factor = 1.0;
    let mut offset = 0;
    let mut rows = Vec::new();
    for (layer, level) in &parts {
        let part = &level.mesh;
        mesh.cells.extend(part.cells.iter().map(|cell| cell.map(|k| index(layer, part, k))));
        mesh.cell_tags.extend(&part.cell_tags);
        for k in 0..part.facets.len() {
            let cells = part.facet_cells[k].map(|c| if c == NONE { NONE } else { c + offset });
            rows.push((k >= part.n_boundary, part.facets[k].map(|i| index(layer, part, i)), cells, part.facet_tags[k]));
        }
        mesh.n_boundary += part.n_boundary;
        offset += part.cells.len() as u32;
        visits += level.visits;
        factor = level.factor;
    }
    rows.sort_by_key(|row| row.0);
    for (_, ends, cells, tag) in rows {
        mesh.facets.push(ends);
        mesh.facet_cells.push(cells);
        mesh.facet_tags.push(tag);
    }
    mesh.nodes = nodes.iter().map(|&(node, _)| node).collect();
    let spacing = nodes.into_iter().map(|(_, spacing)| spacing).filter(|spacing| !spacing.is_nan()).collect();
    let dropped = parts.iter().filter_map(|(_, level)| level.dropped).reduce(|a, b| Dropped {
        loops_closed: a.loops_closed + b.loops_closed,
        area_gained: a.area_gained + b.area_gained,
        area_lost: a.area_lost + b.area_lost,
    });
    Level { mesh, factor, spacing, visits, dropped }
}
