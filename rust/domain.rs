//! Facets, chains, corners, slits of a planar domain.
