//! Optimal good-aspect-ratio coarsening of unstructured triangle meshes
//! (Miller, Talmor, Teng 1997), carried to real domains.
//!
//! The data goes one way up: points and facets, spacing, coarsened spacing, selection, triangulation, level,
//! hierarchy, transfer. A module knows those listed above it only.

pub mod error;
pub mod point;
pub mod progress;

pub mod lanes;
pub mod remaining;
pub mod scatter;

pub mod kdtree;
pub mod segments;

pub mod mesh;
pub mod triangulation;

pub mod domain;
pub mod quadtree;
pub mod spacing;

pub mod selection;

pub mod level;

pub mod drop;
pub mod guard;
pub mod hierarchy;
pub mod layers;
pub mod line;
pub mod skeleton;
pub mod transfer;

#[cfg(feature = "python")]
mod python;
