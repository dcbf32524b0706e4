//! Transfer between two levels: where the nodes and the cells of one mesh lie in another.
//!
//! `halfedges` is the adjacency of the mesh that is walked in, `place` where a point lies in it, `walk` goes from a located
//! point to a neighbour along a straight line, not around where the finer mesh ends (`walls`),
//! `prolongation` locates all nodes of a finer mesh that way and writes their barycentric weights as
//! compressed rows, `overlap` does the same for cells and areas. `galerkin` multiplies the rows,
//! `filter` leaves weak entries out, `blocks` does so for several unknowns a node, `loose` interpolates by couplings,
//! `slow` tells where a cycle needs more sweeps, `cycle` solves with them, down to the dense factor of `cholesky`.

pub mod blocks;
pub mod cholesky;
pub mod clusters;
pub mod cycle;
pub mod filter;
pub mod galerkin;
pub mod halfedges;
pub mod loose;
pub mod order;
pub mod overlap;
pub mod place;
pub mod prolongation;
pub mod rows;
pub mod slow;
pub mod walk;
pub mod walls;
