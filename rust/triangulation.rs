//! Constrained Delaunay triangulation; the only file that names spade.
