//! Conflict graph (Definition 3.5) and greedy maximal independent sets.
