//! Clusters: a few unknowns that are coupled so strongly that relaxing them one by one gets nowhere.
//!
//! In needles, two or three unknowns are all but one for the matrix: a_ij² nears a_ii a_jj. Across flat cells, as in boundary
//! layers, unknowns are coupled along lines: a_ij² nears a_ii a_jj / 4. Pieces of such lines are clusters, too. All are
//! relaxed together, by the inverse of their own block.

use super::cholesky::Cholesky;
use super::rows::{Rows, RowsRef};
use rayon::prelude::*;

/// Two unknowns may be in a cluster if a_ij² is over this share of a_ii a_jj. It is at most 1/16 within, and 1/8 along the
/// boundary, where triangles are right and isosceles; on a lattice of rectangles, those of ratio 3 have it.
const STRONG: f64 = 0.2;

/// A cluster has a share over this, or is a piece of a line: it has `LINE` unknowns.
const STRONGEST: f64 = 0.3;

/// Unknowns of a piece of a line at least. Irregular meshes have single pairs with a share over `STRONG` all over.
const LINE: usize = 4;

/// Unknowns of a cluster at most.
const MOST: usize = 16;

/// Rows that one thread takes at a time.
const PART: usize = 8192;

/// The clusters of a symmetric matrix with a diagonal, and their factored blocks; the strongest couplings are taken first.
pub fn clusters(a: RowsRef<'_>, diagonal: &[f64]) -> Vec<(Vec<u32>, Cholesky)> {
    let rows = (0..a.len()).into_par_iter().with_min_len(PART);
    let mut pairs: Vec<(f64, u32, u32)> = rows
        .flat_map_iter(|i| {
            let (columns, values) = a.row(i);
            let later = columns.iter().zip(values).filter(move |(j, _)| **j as usize > i);
            let shares = later.map(move |(&j, v)| (v * v / (diagonal[i] * diagonal[j as usize]), i as u32, j as u32));
            shares.filter(|pair| pair.0 > STRONG)
        })
        .collect();
    pairs.sort_by(|p, q| q.0.total_cmp(&p.0).then((p.1, p.2).cmp(&(q.1, q.2))));
    let mut of = std::collections::BTreeMap::new();
    let (mut sets, mut strongest): (Vec<Vec<u32>>, Vec<f64>) = (Vec::new(), Vec::new());
    for (share, i, j) in pairs {
        let mut set_of = |i: u32| {
            *of.entry(i).or_insert_with(|| {
                sets.push(vec![i]);
                strongest.push(0.0);
                sets.len() - 1
            })
        };
        let (one, other) = (set_of(i), set_of(j));
        if one != other && sets[one].len() + sets[other].len() <= MOST {
            let moved = std::mem::take(&mut sets[other]);
            moved.iter().for_each(|&k| _ = of.insert(k, one));
            sets[one].extend(moved);
            strongest[one] = share.max(strongest[one]).max(strongest[other]);
        }
    }
    let sets = sets
        .into_iter()
        .zip(strongest)
        .filter(|(set, share)| set.len() >= LINE || (set.len() > 1 && *share > STRONGEST));
    let factored = sets.filter_map(|(mut set, _)| {
        set.sort_unstable();
        let block = block(a, &set);
        // a block that is not positive definite is left to the sweeps
        Cholesky::new(block.view()).ok().map(|factor| (set, factor))
    });
    factored.collect()
}

fn block(a: RowsRef<'_>, set: &[u32]) -> Rows {
    let n = set.len();
    let data = set.iter().flat_map(|&i| set.iter().map(move |&j| a.entry(i as usize, j as usize))).collect();
    let (indptr, indices) = ((0..=n).map(|i| (i * n) as i32).collect(), (0..n * n).map(|k| (k % n) as i32).collect());
    Rows { columns: n, indptr, indices, data }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strongly_coupled_unknowns_are_clusters() {
        // 0 and 1 and 2 in a row, 3 alone; 4 and 5 would make a block that is not positive definite
        let mut dense = [[0.0; 6]; 6];
        (0..6).for_each(|i| dense[i][i] = 1.0);
        for (i, j, v) in [(0, 1, -0.7), (1, 2, 0.6), (2, 3, -0.4), (4, 5, -1.1)] {
            (dense[i][j], dense[j][i]) = (v, v);
        }
        let a = Rows {
            columns: 6,
            indptr: (0..=6).map(|i| i * 6).collect(),
            indices: (0..36).map(|k| k % 6).collect(),
            data: dense.concat(),
        };
        let found: Vec<Vec<u32>> = clusters(a.view(), &[1.0; 6]).into_iter().map(|cluster| cluster.0).collect();
        assert_eq!(found, [[0, 1, 2]]);
    }

    #[test]
    fn pieces_of_lines_are_clusters_and_single_pairs_are_not() {
        // a line of 4, and a pair that is coupled as strongly
        let n = 6;
        let mut dense = vec![0.0; n * n];
        (0..n).for_each(|i| dense[i * n + i] = 1.0);
        for (i, j) in [(0, 1), (1, 2), (2, 3), (4, 5)] {
            (dense[i * n + j], dense[j * n + i]) = (-0.48, -0.48);
        }
        let indptr = (0..=n).map(|i| (i * n) as i32).collect();
        let a = Rows { columns: n, indptr, indices: (0..n * n).map(|k| (k % n) as i32).collect(), data: dense };
        let found: Vec<Vec<u32>> = clusters(a.view(), &[1.0; 6]).into_iter().map(|cluster| cluster.0).collect();
        assert_eq!(found, [[0, 1, 2, 3]]);
    }

    #[test]
    fn clusters_are_bounded() {
        let n = 40;
        let mut a = Rows { columns: n, indptr: vec![0], indices: Vec::new(), data: Vec::new() };
        for i in 0..n {
            for j in 0..n {
                a.indices.push(j as i32);
                a.data.push(if i == j { 1.0 } else { 0.6 });
            }
            a.indptr.push(a.indices.len() as i32);
        }
        let sizes: Vec<usize> = clusters(a.view(), &vec![1.0; n]).iter().map(|cluster| cluster.0.len()).collect();
        assert!(sizes.iter().all(|size| (2..=MOST).contains(size)) && sizes.contains(&MOST));
    }
}
