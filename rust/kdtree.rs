//! Static k-d tree with a least and a greatest weight in every node.
