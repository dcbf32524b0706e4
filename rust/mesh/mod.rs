//! The rules of a legal mesh, checked, and what the check finds out: orientation, facets and their cells.
//!
//! Steps: every cell alone ([`cells`]); edges between cells ([`edges`]); the plane ([`outline`]). The last one rests on
//! this: all cells are turned counter-clockwise, so the number of cells that cover a place is the winding number of the
//! boundary around it, and the cells overlap nowhere if and only if that number is nowhere more than 1. So only the boundary
//! edges, usually O(sqrt n) of them, need a geometric search. All predicates are exact; there are no tolerances but one, for
//! sliding interfaces between parts that are nowhere joined ([`sliding`]).
//!
//! A mesh of the line is checked by [`line`].

pub mod around;
pub mod cells;
pub mod edges;
pub mod line;
pub mod outline;
pub mod quality;
pub mod sliding;

use crate::error::Broken;
use crate::point::{NONE, Point};

/// An index as users give it, 32 or 64 bits wide.
pub trait Index: Copy + Send + Sync {
    /// Its value.
    fn value(self) -> i64;
}

impl Index for i32 {
    fn value(self) -> i64 {
        i64::from(self)
    }
}

impl Index for i64 {
    fn value(self) -> i64 {
        self
    }
}

/// A facet of a mesh of dimension `D`: an edge, on a line a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Facet<const D: usize> {
    /// Its nodes, directed with the first of `cells` on the left.
    pub nodes: [u32; D],
    /// Left and right cell; [`NONE`] where there is none on the right.
    pub cells: [u32; 2],
    /// Row of the user's facets, or [`NONE`].
    pub given: u32,
}

/// What the check of a mesh finds out about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topology<const D: usize> {
    /// Cells that were given clockwise, ascending.
    pub flip: Vec<u32>,
    /// Facets: first those of the boundary, then those between two cells (of different tags, or given).
    pub facets: Vec<Facet<D>>,
    /// How many of them are of the boundary.
    pub n_boundary: usize,
    /// For each node a layer, where parts overlap shallowly.
    pub layer: Option<Vec<u32>>,
}

/// Checks a mesh of triangles in the plane.
///
/// Runtime: O(n + m + b log b) for n points, m cells and b boundary edges that are not pathologically long.
pub fn check<I: Index>(
    points: &[Point<2>],
    cells: &[[I; 3]],
    facets: Option<&[[i64; 2]]>,
    cell_tags: Option<&[i64]>,
) -> Result<Topology<2>, Broken> {
    refuse_sizes(points.len(), cells.len())?;
    let (cells, flip) = cells::oriented(points, cells)?;
    let given = facets.map(|facets| edges::Given::new(points.len(), facets)).transpose()?;
    let (boundary, interior) = edges::facets(points, &cells, &flip, given.as_ref(), cell_tags)?;
    let layer = sliding::layers(points, &cells, &boundary)?;
    let n_boundary = boundary.len();
    let mut facets = boundary;
    facets.extend(interior);
    Ok(Topology { flip, facets, n_boundary, layer })
}

fn refuse_sizes(n: usize, m: usize) -> Result<(), Broken> {
    for (array, rows) in [("points", n), ("cells", m)] {
        if rows >= (NONE >> 1) as usize {
            return Err(Broken::TooMany { array, rows });
        }
    }
    if m == 0 { Err(Broken::Empty) } else { Ok(()) }
}
