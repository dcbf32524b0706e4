//! Point location and prolongation.
