//! What a hierarchy is made from, and how.

use super::MAX_LEVELS;
use crate::domain::FacetRow;
use crate::level::Rules;
use crate::point::Point;

/// How levels are spaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// C-coarsening (Definition 3.3).
    Function,
    /// Threshold coarsening (Definition 3.4).
    Threshold,
    /// Independent sets of the edge skeleton: the baseline of Table 2.
    Mis,
}

/// On which levels features of the domain under the spacing are dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drop {
    /// On none.
    Never,
    /// On all.
    Always,
    /// Where keeping them takes less than a quarter of the cells away.
    Auto,
}

/// What a hierarchy is made from.
pub struct Input<'a> {
    /// Nodes.
    pub points: &'a [Point<2>],
    /// Facet edges.
    pub facets: &'a [FacetRow],
    /// Spacing at the nodes; `None` is the nearest-neighbour spacing (Definition 3.2).
    pub spacing: Option<&'a [f64]>,
    /// Cells, counter-clockwise.
    pub cells: CellRows<'a>,
}

/// Cells by their corners, of either width: what crosses the border is not copied, for most hierarchies only count them.
#[derive(Debug, Clone, Copy)]
pub enum CellRows<'a> {
    /// The core's own width.
    Short(&'a [[u32; 3]]),
    /// NumPy's width; every entry is the index of a node.
    Long(&'a [[i64; 3]]),
}

impl CellRows<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            CellRows::Short(rows) => rows.len(),
            CellRows::Long(rows) => rows.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The corners of one.
    pub fn get(&self, t: usize) -> [u32; 3] {
        match self {
            CellRows::Short(rows) => rows[t],
            CellRows::Long(rows) => rows[t].map(|i| i as u32),
        }
    }

    /// The corners of all.
    pub fn iter(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        (0..self.len()).map(|t| self.get(t))
    }
}

/// The options, checked by the caller.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// C > 1.
    pub factor: f64,
    /// Number of coarser levels, or until `coarsest`.
    pub levels: Option<usize>,
    /// The paper's b.
    pub coarsest: usize,
    /// Figure 3 or each level on its own.
    pub nested: bool,
    /// Spacing of the levels.
    pub method: Method,
    /// The parameters of one level.
    pub rules: Rules,
    /// Whether the spacing is held under the gaps of the domain.
    pub keep: bool,
    /// Whether features under the spacing are dropped.
    pub drop: Drop,
    /// Bound of the quality guard in radians.
    pub min_angle: Option<f64>,
    /// Whether coarse levels draw from pools.
    pub pool: bool,
    /// Cosine of the feature angle.
    pub cos_feature: f64,
}

impl Options {
    /// Whether a hierarchy that is built from the fine side has its last level.
    pub fn enough(&self, levels: usize, cells: usize) -> Option<Stopped> {
        match self.levels {
            Some(wanted) => (levels >= wanted).then_some(Stopped::Levels),
            None if levels >= MAX_LEVELS => Some(Stopped::Stalled),
            None => (levels > 0 && cells <= self.coarsest).then_some(Stopped::Coarsest),
        }
    }
}

/// Why a hierarchy ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// The levels asked for are there.
    Levels,
    /// The last level has at most `coarsest` cells.
    Coarsest,
    /// One more level would hardly be smaller.
    Stalled,
}
