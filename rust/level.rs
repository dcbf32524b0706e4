//! ONE_LEVEL_COARSEN (Figure 2).
