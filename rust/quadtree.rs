//! Spacing of a balanced quadtree (section 6.2).
