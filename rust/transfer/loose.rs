//! Interpolation by the entries of a matrix, for loose unknowns: those that a coarse mesh does not serve.
//!
//! 1. Some loose unknowns become coarse ones, by index, so that each is strongly coupled to a coarse one.
//! 2. The others take the mean of their neighbours that have values, weighted by the couplings, in some passes (multipass
//!    interpolation, Stueben 1999).
//! 3. Gauss-Seidel sweeps over their rows lead on towards the ideal interpolation, which solves the matrix' own equations
//!    there. Narrow cells, whose couplings repel, need that: along them values are extrapolated, by weights beyond 0 and 1.
//!
//! Small weights are left out as the sweeps go on.

use super::rows::{Block, Rows, RowsRef};
use crate::error::Error;

/// Couplings of this share of the strongest one of an unknown are strong.
const STRONG: f64 = 0.25;

/// Couplings that are passed, at most, before an unknown has its first values.
const PASSES: usize = 4;

/// Gauss-Seidel sweeps, there and back in turn.
const SWEEPS: usize = 8;

/// Weights of less than this share of the greatest are left out: while the sweeps go on, and in the end.
const LEAST: [f64; 2] = [0.01, 0.1];

type Weights = Vec<(i32, f64)>;

/// Interpolation with the loose rows of `p` made anew, and the loose unknowns that are its additional, last columns.
///
/// `coarse` marks the unknowns that the columns of `p` are. Unknowns are interpolated from those of the same component
/// only. Runtime: O(entries of the loose rows and of what they are coupled to).
pub fn extended(
    a: RowsRef<'_>,
    p: RowsRef<'_>,
    coarse: &[bool],
    loose: &[bool],
    component: &[i64],
) -> Result<(Rows, Vec<u32>), Error> {
    let n = a.len();
    if [a.columns, p.len(), coarse.len(), loose.len(), component.len()] != [n; 5] {
        let sizes = format!("{n}, {}, {}, {}, {}", p.len(), coarse.len(), loose.len(), component.len());
        return Err(Error::Argument(format!("the sizes {sizes} of a matrix and what belongs to it differ")));
    }
    let couplings = |i: usize| {
        let (columns, values) = a.row(i);
        let all = columns.iter().zip(values).map(|(&j, &value)| (j as usize, value));
        all.filter(move |&(j, _)| j != i && component[j] == component[i])
    };
    let own: Vec<u32> = coarse_ones(coarse, loose, |i| a.row(i).1.iter().sum(), couplings);
    let mut made: Vec<Weights> = (0..n)
        .map(|i| {
            let (columns, values) = if loose[i] { (&[][..], &[][..]) } else { p.row(i) };
            columns.iter().copied().zip(values.iter().copied()).collect()
        })
        .collect();
    for (k, &i) in own.iter().enumerate() {
        made[i as usize].push(((p.columns + k) as i32, 1.0));
    }
    let rest: Vec<usize> = (0..n).filter(|&i| loose[i] && made[i].is_empty()).collect();
    for _ in 0..PASSES {
        let firsts: Vec<(usize, Weights)> = rest
            .iter()
            .filter(|&&i| made[i].is_empty())
            .map(|&i| {
                let pulls = couplings(i).filter(|&(j, value)| value < 0.0 && !made[j].is_empty());
                let held = a.row(i).1.iter().sum::<f64>().max(0.0);
                let sum = held - pulls.clone().map(|(_, value)| value).sum::<f64>();
                (i, combined(pulls.map(|(j, value)| (&made[j], -value / sum))))
            })
            .collect();
        firsts.into_iter().for_each(|(i, weights)| made[i] = thinned(weights, LEAST[0]));
    }
    for sweep in 0..=SWEEPS {
        let least = LEAST[usize::from(sweep == SWEEPS)];
        for k in 0..rest.len() {
            let i = rest[if sweep % 2 == 0 { k } else { rest.len() - 1 - k }];
            let diagonal = a.entry(i, i);
            if diagonal > 0.0 {
                made[i] = thinned(combined(couplings(i).map(|(j, value)| (&made[j], -value / diagonal))), least);
            }
        }
    }
    let mut block = Block::default();
    for weights in made {
        block.counts.push(weights.len() as u32);
        block.indices.extend(weights.iter().map(|weight| weight.0));
        block.data.extend(weights.iter().map(|weight| weight.1));
    }
    Ok((Rows::stacked(p.columns + own.len(), vec![block])?, own))
}

/// Loose unknowns, by index, that are strongly coupled to no coarse one, nor to what is held.
fn coarse_ones<C: Iterator<Item = (usize, f64)>>(
    coarse: &[bool],
    loose: &[bool],
    row_sum: impl Fn(usize) -> f64,
    couplings: impl Fn(usize) -> C,
) -> Vec<u32> {
    let mut coarse: Vec<bool> = coarse.iter().zip(loose).map(|(&coarse, &loose)| coarse && !loose).collect();
    let mut chosen = Vec::new();
    for i in (0..loose.len()).filter(|&i| loose[i]) {
        let strongest = couplings(i).map(|(_, value)| -value).fold(0.0, f64::max);
        let served = couplings(i).any(|(j, value)| coarse[j] && -value >= STRONG * strongest && value < 0.0);
        if !served && row_sum(i) < STRONG * strongest {
            coarse[i] = true;
            chosen.push(i as u32);
        }
    }
    chosen
}

/// A combination of rows, columns ascending.
fn combined<'a>(rows: impl Iterator<Item = (&'a Weights, f64)>) -> Weights {
    let mut all: Weights = Vec::new();
    for (row, scale) in rows {
        all.extend(row.iter().map(|&(j, weight)| (j, scale * weight)));
    }
    all.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    all.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    all
}

/// Without small weights; what is left sums to the same, unless that would change it much.
fn thinned(mut weights: Weights, least: f64) -> Weights {
    let sum = |weights: &Weights| weights.iter().map(|weight| weight.1).sum::<f64>();
    let most = weights.iter().map(|weight| weight.1.abs()).fold(0.0, f64::max);
    let before = sum(&weights);
    weights.retain(|weight| weight.1.abs() >= least * most && weight.1 != 0.0);
    let scale = before / sum(&weights);
    if (0.5..2.0).contains(&scale) {
        weights.iter_mut().for_each(|weight| weight.1 *= scale);
    }
    weights
}
