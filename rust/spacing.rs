//! Spacing functions (Definitions 3.2 to 3.4).
