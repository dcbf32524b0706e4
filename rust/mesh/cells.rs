//! Rules that each cell keeps or breaks on its own: finite coordinates, indices in range, different nodes, an area; and
//! that each node has a cell. Cells come out counter-clockwise.

use super::Index;
use crate::error::Broken;
use crate::point::{Point, orient};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

const CHUNK: usize = 1 << 14;

/// Coordinates over this are refused: products of two of them must stay finite.
const LARGEST: f64 = 1e150;

/// A mesh whose largest coordinate is under this is refused: products of two differences must not vanish.
const LEAST: f64 = 1e-140;

/// The first place where a rule is broken, and how many there are.
#[derive(Debug, Clone, Copy, Default)]
pub struct Found {
    first: Option<usize>,
    count: usize,
}

impl Found {
    /// Notes one more place.
    pub fn note(&mut self, index: usize) {
        self.first = Some(self.first.map_or(index, |first| first.min(index)));
        self.count += 1;
    }

    /// Both together.
    pub fn merged(mut self, other: Found) -> Found {
        if let Some(index) = other.first {
            self.note(index);
            self.count += other.count - 1;
        }
        self
    }

    /// The error that `tell(first, more)` makes of it, if there is a place.
    pub fn refuse(self, tell: impl FnOnce(usize, usize) -> Broken) -> Result<(), Broken> {
        match self.first {
            Some(first) => Err(tell(first, self.count - 1)),
            None => Ok(()),
        }
    }
}

/// Refuses coordinates that are not finite, or too large or small to compute with.
pub fn refuse_coordinates<const D: usize>(points: &[Point<D>]) -> Result<(), Broken> {
    points
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, points)| {
            let mut found = Found::default();
            for (k, p) in points.iter().enumerate() {
                // NaN compares false
                if !p.iter().all(|x| x.abs() <= LARGEST) {
                    found.note(chunk * CHUNK + k);
                }
            }
            found
        })
        .reduce(Found::default, Found::merged)
        .refuse(|point, more| Broken::Coordinate { point, at: points[point].to_vec(), more })?;
    let sizes = || points.iter().map(|p| p.iter().fold(0.0, |most: f64, x| most.max(x.abs())));
    let is_small = |size: f64| size < LEAST;
    if sizes().all(is_small)
        && let Some((point, size)) = sizes().enumerate().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
        && size > 0.0
    {
        return Err(Broken::Tiny { point, at: points[point].to_vec() });
    }
    Ok(())
}

/// Refuses indices out of range, in rows of any array.
pub fn refuse_range<I: Index, const K: usize>(array: &'static str, rows: &[[I; K]], n: usize) -> Result<(), Broken> {
    let limit = n as i64;
    let found = rows
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, rows)| {
            let mut found = Found::default();
            for (k, row) in rows.iter().enumerate() {
                for (j, index) in row.iter().enumerate() {
                    if index.value() < 0 || index.value() >= limit {
                        found.note((chunk * CHUNK + k) * K + j);
                    }
                }
            }
            found
        })
        .reduce(Found::default, Found::merged);
    found.refuse(|place, more| {
        let (row, column) = (place / K, place % K);
        let value = rows[row][column].value();
        let one_based = rows.iter().flatten().all(|index| (1..=limit).contains(&index.value()));
        Broken::IndexOutOfRange { array, row, column, value, n, one_based, more }
    })
}

/// Refuses nodes that no cell names.
pub fn refuse_orphans<const D: usize>(points: &[Point<D>], used: &[AtomicBool]) -> Result<(), Broken> {
    let mut found = Found::default();
    for (node, used) in used.iter().enumerate() {
        if !used.load(Ordering::Relaxed) {
            found.note(node);
        }
    }
    found.refuse(|node, more| Broken::OrphanNode { node, at: points[node].to_vec(), more })
}

/// Checks points and cells one by one; returns the cells counter-clockwise, and which were not.
pub fn oriented<I: Index>(points: &[Point<2>], cells: &[[I; 3]]) -> Result<(Vec<[u32; 3]>, Vec<u32>), Broken> {
    refuse_coordinates(points)?;
    refuse_range("cells", cells, points.len())?;
    let used: Vec<AtomicBool> = (0..points.len()).map(|_| AtomicBool::new(false)).collect();
    let mut positive = vec![[0u32; 3]; cells.len()];
    let told: Vec<(Vec<u32>, Found, Found)> = positive
        .par_chunks_mut(CHUNK)
        .zip(cells.par_chunks(CHUNK))
        .enumerate()
        .map(|(chunk, (out, cells))| {
            let (mut flip, mut repeated, mut flat) = (Vec::new(), Found::default(), Found::default());
            for (k, cell) in cells.iter().enumerate() {
                let index = chunk * CHUNK + k;
                let nodes = cell.map(|i| i.value() as u32);
                let [a, b, c] = nodes;
                out[k] = nodes;
                for node in nodes {
                    // threads write to the same lines of memory: only once each
                    let used = &used[node as usize];
                    if !used.load(Ordering::Relaxed) {
                        used.store(true, Ordering::Relaxed);
                    }
                }
                if a == b || b == c || c == a {
                    repeated.note(index);
                    continue;
                }
                let turn = orient(&points[a as usize], &points[b as usize], &points[c as usize]);
                if turn == 0.0 {
                    flat.note(index);
                } else if turn < 0.0 {
                    out[k] = [a, c, b];
                    flip.push(index as u32);
                }
            }
            (flip, repeated, flat)
        })
        .collect();
    let rows = |cell: usize| cells[cell].map(|i| i.value() as u32).to_vec();
    let (mut repeated, mut flat) = (Found::default(), Found::default());
    for (_, r, f) in &told {
        (repeated, flat) = (repeated.merged(*r), flat.merged(*f));
    }
    repeated.refuse(|cell, more| Broken::RepeatedNode { cell, nodes: rows(cell), more })?;
    flat.refuse(|cell, more| Broken::ZeroArea { cell, nodes: rows(cell), more })?;
    refuse_orphans(points, &used)?;
    Ok((positive, told.into_iter().flat_map(|(flip, _, _)| flip).collect()))
}
