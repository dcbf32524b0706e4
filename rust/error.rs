//! What can go wrong: the rules of a legal mesh, a variant for each with array, index and value, and the rest.

use std::fmt;

/// Why a call could not be answered.
#[derive(Debug, Clone, PartialEq)]
pub enum Error {
    /// The mesh breaks a rule of a legal mesh.
    Mesh(Broken),
    /// An argument is out of its range; the text names it, its value and its range.
    Argument(String),
    /// The caller asked to stop.
    Stopped,
    /// A promise of this package did not hold: a defect of ours, never the user's.
    Internal(String),
}

impl fmt::Display for Error {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Mesh(broken) => broken.fmt(out),
            Error::Argument(text) => out.write_str(text),
            Error::Stopped => out.write_str("stopped"),
            Error::Internal(text) => write!(out, "internal error, please report it: {text}"),
        }
    }
}

impl std::error::Error for Error {}

/// A rule of a legal mesh that is broken: where first, with which value, and how many `more` times.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // the fields are what the messages below say of them
pub enum Broken {
    /// There are no cells.
    Empty,
    /// More rows than 32-bit indices can count.
    TooMany { array: &'static str, rows: usize },
    /// A coordinate is NaN, infinite, or so large that products of coordinates overflow.
    Coordinate { point: usize, at: Vec<f64>, more: usize },
    /// All coordinates are so small that products of them vanish; the point has the largest.
    Tiny { point: usize, at: Vec<f64> },
    /// An index under 0 or over n - 1.
    IndexOutOfRange {
        array: &'static str,
        row: usize,
        column: usize,
        value: i64,
        n: usize,
        one_based: bool,
        more: usize,
    },
    /// A cell names a node twice.
    RepeatedNode { cell: usize, nodes: Vec<u32>, more: usize },
    /// The nodes of a cell lie on one line.
    ZeroArea { cell: usize, nodes: Vec<u32>, more: usize },
    /// Two cells have the same nodes.
    DuplicateCell { cell: usize, nodes: Vec<u32>, first: usize, more: usize },
    /// Three cells or more meet at an edge (on a line: at a node).
    CrowdedEdge { nodes: Vec<u32>, cells: Vec<u32>, more: usize },
    /// A node that no cell names.
    OrphanNode { node: usize, at: Vec<f64>, more: usize },
    /// Nodes share coordinates, but are no two sides of a slit.
    CoincidentNodes { nodes: [u32; 2], at: Vec<f64>, why: &'static str, more: usize },
    /// Two cells lie on the same side of the edge they share.
    InvertedCell { cell: usize, nodes: Vec<u32>, other: usize, edge: Vec<u32>, more: usize },
    /// Two cells overlap; `how` says where this was seen.
    OverlappingCells { cell: usize, nodes: Vec<u32>, other: Option<usize>, how: String, more: usize },
    /// A node lies inside an edge of the boundary of its own part.
    HangingNode { node: u32, at: Vec<f64>, edge: [u32; 2], cell: usize, more: usize },
    /// A given facet is no edge of the mesh.
    UnknownFacet { row: usize, nodes: Vec<i64>, more: usize },
}

impl Broken {
    /// Rule, array, first index, how many more.
    pub fn place(&self) -> (&'static str, &'static str, Option<usize>, usize) {
        match self {
            Broken::Empty => ("no cells", "cells", None, 0),
            Broken::TooMany { array, .. } => ("too many rows", array, None, 0),
            Broken::Coordinate { point, more, .. } => ("non-finite coordinate", "points", Some(*point), *more),
            Broken::Tiny { point, .. } => ("coordinates too small", "points", Some(*point), 0),
            Broken::IndexOutOfRange { array, row, more, .. } => ("index out of range", array, Some(*row), *more),
            Broken::RepeatedNode { cell, more, .. } => ("repeated node", "cells", Some(*cell), *more),
            Broken::ZeroArea { cell, more, .. } => ("zero area", "cells", Some(*cell), *more),
            Broken::DuplicateCell { cell, more, .. } => ("duplicate cell", "cells", Some(*cell), *more),
            Broken::CrowdedEdge { cells, more, .. } => {
                ("edge with three cells", "cells", cells.last().map(|&c| c as usize), *more)
            }
            Broken::OrphanNode { node, more, .. } => ("node in no cell", "points", Some(*node), *more),
            Broken::CoincidentNodes { nodes, more, .. } => {
                ("coincident nodes", "points", Some(nodes[1] as usize), *more)
            }
            Broken::InvertedCell { cell, more, .. } => ("overlapping or inverted cells", "cells", Some(*cell), *more),
            Broken::OverlappingCells { cell, more, .. } => {
                ("overlapping or inverted cells", "cells", Some(*cell), *more)
            }
            Broken::HangingNode { node, more, .. } => ("hanging node", "points", Some(*node as usize), *more),
            Broken::UnknownFacet { row, more, .. } => ("unknown facet", "facets", Some(*row), *more),
        }
    }
}

impl fmt::Display for Broken {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rule, _, _, more) = self.place();
        write!(out, "{rule}: ")?;
        let mend = match self {
            Broken::Empty => {
                out.write_str("'cells' has no rows, expected at least one")?;
                ""
            }
            Broken::TooMany { array, rows } => {
                write!(out, "'{array}' has {rows} rows, expected fewer than 2**31")?;
                ""
            }
            Broken::Coordinate { point, at, .. } => {
                write!(out, "'points' row {point} is {at:?}, expected finite numbers under 1e150")?;
                ""
            }
            Broken::Tiny { point, at } => {
                write!(
                    out,
                    "'points' row {point} is {at:?}, the largest of all, expected one over 1e-140; scale the mesh"
                )?;
                ""
            }
            Broken::IndexOutOfRange { array, row, column, value, n, one_based, .. } => {
                write!(out, "'{array}[{row}, {column}]' is {value}, expected 0 to {}", *n as i64 - 1)?;
                if *one_based {
                    out.write_str("; node 0 is never used: counted from 1? then pass cells - 1")?;
                }
                ""
            }
            Broken::RepeatedNode { cell, nodes, .. } => {
                write!(out, "'cells' row {cell} is {nodes:?}, expected different nodes")?;
                "drops such cells"
            }
            Broken::ZeroArea { cell, nodes, .. } => {
                let line = if nodes.len() == 2 { "at one place" } else { "on one line" };
                write!(out, "'cells' row {cell} is {nodes:?}, nodes {line}")?;
                "drops such cells"
            }
            Broken::DuplicateCell { cell, nodes, first, .. } => {
                write!(out, "'cells' row {cell} is {nodes:?}, the nodes of row {first}")?;
                "drops such cells"
            }
            Broken::CrowdedEdge { nodes, cells, .. } => {
                let what = if nodes.len() == 1 { "node" } else { "edge" };
                write!(out, "'cells' rows {cells:?} share {what} {nodes:?}, expected at most two")?;
                ""
            }
            Broken::OrphanNode { node, at, .. } => {
                write!(out, "'points' row {node} at {at:?} is in no row of 'cells'")?;
                "drops such nodes"
            }
            Broken::CoincidentNodes { nodes: [a, b], at, why, .. } => {
                write!(out, "'points' rows {a} and {b} are both {at:?} but no two sides of a slit: {why}")?;
                "merges such nodes"
            }
            Broken::InvertedCell { cell, nodes, other, edge, .. } => {
                write!(out, "'cells' row {cell} is {nodes:?}, on the same side of edge {edge:?} as row {other}")?;
                ""
            }
            Broken::OverlappingCells { cell, nodes, other, how, .. } => {
                write!(out, "'cells' row {cell} is {nodes:?}")?;
                match other {
                    Some(other) => write!(out, ", which overlaps row {other}: {how}")?,
                    None => write!(out, ", which overlaps others: {how}")?,
                }
                ""
            }
            Broken::HangingNode { node, at, edge, cell, .. } => {
                write!(
                    out,
                    "'points' row {node} at {at:?} lies inside edge {edge:?} of 'cells' row {cell}, expected a node of it"
                )?;
                ""
            }
            Broken::UnknownFacet { row, nodes, .. } => {
                let what = if nodes.len() == 1 { "node" } else { "edge" };
                write!(out, "'facets' row {row} is {nodes:?}, no {what} of any cell")?;
                ""
            }
        };
        if more > 0 {
            write!(out, " ({more} more)")?;
        }
        if !mend.is_empty() {
            write!(out, "; Mesh.repaired {mend}")?;
        }
        Ok(())
    }
}
