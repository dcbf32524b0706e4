//! The rules of a legal mesh, checked; edges and adjacency.
