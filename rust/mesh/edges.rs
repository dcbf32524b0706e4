//! Edges between cells: the boundary, the interior facets, and the rules that edges keep or break.
//!
//! Every side of a cell is put into the bucket of its smaller node and meets its partner there. A side is *up* where it
//! leads to the larger node. Cells are counter-clockwise, so an edge between two cells has one side up and one down:
//!
//! ```text
//!              b
//!            / | \         up:   a -> b, of the cell on the left
//!           /  |  \        down: b -> a, of the cell on the right
//!           \  |  /
//!            \ | /         two sides up: one of the two cells lies on the other, or is inverted
//!              a < b
//! ```

use super::Facet;
use super::cells::{Found, refuse_range};
use crate::error::Broken;
use crate::point::{NONE, Point, distance, orient};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU16, AtomicU64, Ordering};

/// Nodes that are dealt with together; their sides should fit a cache.
const BLOCK: usize = 1 << 13;

/// Cells that one thread sorts at a time.
const CHUNK: usize = 1 << 16;

/// Facets that the user gave.
pub struct Given<'a> {
    rows: &'a [[i64; 2]],
    /// First row of each edge, smaller node first.
    row_of: HashMap<[u32; 2], u32>,
    at_facet: Vec<bool>,
    known: Vec<AtomicBool>,
}

impl<'a> Given<'a> {
    /// Checks the indices. The same edge given twice counts once, by its first row.
    pub fn new(n: usize, rows: &'a [[i64; 2]]) -> Result<Self, Broken> {
        refuse_range("facets", rows, n)?;
        let mut row_of = HashMap::with_capacity(rows.len());
        let mut at_facet = vec![false; n];
        for (k, row) in rows.iter().enumerate() {
            let [a, b] = row.map(|i| i as u32);
            row_of.entry([a.min(b), a.max(b)]).or_insert(k as u32);
            at_facet[a as usize] = true;
            at_facet[b as usize] = true;
        }
        Ok(Given { rows, row_of, at_facet, known: rows.iter().map(|_| AtomicBool::new(false)).collect() })
    }

    fn row(&self, a: u32, b: u32) -> u32 {
        if !self.at_facet[a as usize] || !self.at_facet[b as usize] {
            return NONE;
        }
        let row = self.row_of.get(&[a.min(b), a.max(b)]).copied().unwrap_or(NONE);
        if row != NONE {
            self.known[row as usize].store(true, Ordering::Relaxed);
        }
        row
    }

    fn refuse_unknown(&self) -> Result<(), Broken> {
        let mut found = Found::default();
        for (k, row) in self.rows.iter().enumerate() {
            let [a, b] = row.map(|i| i as u32);
            let first = self.row_of.get(&[a.min(b), a.max(b)]);
            if !first.is_some_and(|&first| self.known[first as usize].load(Ordering::Relaxed)) {
                found.note(k);
            }
        }
        found.refuse(|row, more| Broken::UnknownFacet { row, nodes: self.rows[row].to_vec(), more })
    }
}

/// A side of a cell in the bucket of its smaller node: larger node, direction, cell, in this order of bits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Half(u64);

impl Half {
    fn new(other: u32, down: bool, cell: u32) -> Half {
        Half(u64::from(other) << 32 | u64::from(down) << 31 | u64::from(cell))
    }

    fn other(self) -> u32 {
        (self.0 >> 32) as u32
    }

    fn is_down(self) -> bool {
        self.0 >> 31 & 1 == 1
    }

    fn cell(self) -> u32 {
        self.0 as u32 & (NONE >> 1)
    }
}

fn sides([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// All sides, those of each [`BLOCK`] of nodes together, in the order of the cells.
struct Sides {
    halves: Vec<AtomicU64>,
    /// Smaller node of each, counted from the first of its block.
    node: Vec<AtomicU16>,
    /// Where each block ends.
    end: Vec<usize>,
}

/// Sorts sides into blocks. Every chunk of cells knows where its sides of each block go, so that chunks need not wait for each
/// other and all memory is written in runs, whatever the order of the nodes.
fn gather(n: usize, cells: &[[u32; 3]]) -> Sides {
    let block = |[tail, head]: [u32; 2]| tail.min(head) as usize / BLOCK;
    let blocks = n.div_ceil(BLOCK);
    let mut place: Vec<Vec<usize>> = cells
        .par_chunks(CHUNK)
        .map(|cells| {
            let mut count = vec![0; blocks];
            for side in cells.iter().copied().flat_map(sides) {
                count[block(side)] += 1;
            }
            count
        })
        .collect();
    let mut end = Vec::with_capacity(blocks);
    let mut sum = 0;
    for k in 0..blocks {
        for count in &mut place {
            sum += std::mem::replace(&mut count[k], sum);
        }
        end.push(sum);
    }
    let halves: Vec<AtomicU64> = (0..sum).into_par_iter().map(|_| AtomicU64::new(0)).collect();
    let node: Vec<AtomicU16> = (0..sum).into_par_iter().map(|_| AtomicU16::new(0)).collect();
    cells.par_chunks(CHUNK).zip(&mut place).enumerate().for_each(|(chunk, (cells, place))| {
        for (k, &nodes) in cells.iter().enumerate() {
            for [tail, head] in sides(nodes) {
                let half = Half::new(tail.max(head), tail > head, (chunk * CHUNK + k) as u32);
                let slot = &mut place[block([tail, head])];
                // plain stores: every slot has one writer
                halves[*slot].store(half.0, Ordering::Relaxed);
                node[*slot].store((tail.min(head) as usize % BLOCK) as u16, Ordering::Relaxed);
                *slot += 1;
            }
        }
    });
    Sides { halves, node, end }
}

#[derive(Default)]
struct Block {
    boundary: Vec<Facet<2>>,
    interior: Vec<Facet<2>>,
    /// Smaller and larger node of the first edge with two sides in the same direction, and how many there are.
    wrong: Option<[u32; 2]>,
    count: usize,
}

/// Boundary and interior facets of counter-clockwise cells.
pub fn facets(
    points: &[Point<2>],
    cells: &[[u32; 3]],
    flip: &[u32],
    given: Option<&Given<'_>>,
    tags: Option<&[i64]>,
) -> Result<(Vec<Facet<2>>, Vec<Facet<2>>), Broken> {
    let all = gather(points.len(), cells);
    let blocks: Vec<Block> = (0..all.end.len())
        .into_par_iter()
        .map_init(Vec::new, |sorted, k| {
            let range = if k == 0 { 0 } else { all.end[k - 1] }..all.end[k];
            let node = |slot: usize| all.node[slot].load(Ordering::Relaxed) as usize;
            // sort by node, by counting
            let mut end = vec![0u32; BLOCK];
            for slot in range.clone() {
                end[node(slot)] += 1;
            }
            let mut sum = 0;
            for count in &mut end {
                sum += std::mem::replace(count, sum);
            }
            sorted.clear();
            sorted.resize(range.len(), Half(0));
            for slot in range {
                let at = &mut end[node(slot)];
                sorted[*at as usize] = Half(all.halves[slot].load(Ordering::Relaxed));
                *at += 1;
            }
            let mut block = Block::default();
            let mut from = 0;
            for (j, &to) in end.iter().enumerate() {
                let bucket = &mut sorted[from..to as usize];
                bucket.sort_unstable();
                block.pair((k * BLOCK + j) as u32, bucket, given, tags);
                from = to as usize;
            }
            block
        })
        .collect();
    drop(all);
    let count: usize = blocks.iter().map(|block| block.count).sum();
    if let Some([a, b]) = blocks.iter().find_map(|block| block.wrong) {
        return Err(diagnose(points, cells, flip, [a, b], count - 1));
    }
    if let Some(given) = given {
        given.refuse_unknown()?;
    }
    let (mut boundary, mut interior) = (Vec::new(), Vec::new());
    for block in blocks {
        boundary.extend(block.boundary);
        interior.extend(block.interior);
    }
    Ok((boundary, interior))
}

impl Block {
    /// Joins the sides in the bucket of `node`, sorted: sides of the same edge follow each other, those up first.
    fn pair(&mut self, node: u32, bucket: &[Half], given: Option<&Given<'_>>, tags: Option<&[i64]>) {
        let row = |other: u32| given.map_or(NONE, |given| given.row(node, other));
        let mut k = 0;
        while k < bucket.len() {
            let (one, other) = (bucket[k], bucket[k].other());
            let many = bucket[k..].iter().take_while(|half| half.other() == other).count();
            if many == 1 {
                let nodes = if one.is_down() { [other, node] } else { [node, other] };
                self.boundary.push(Facet { nodes, cells: [one.cell(), NONE], given: row(other) });
            } else if many == 2 && !one.is_down() && bucket[k + 1].is_down() {
                let (up, down) = (one.cell(), bucket[k + 1].cell());
                let given = row(other);
                if given != NONE || tags.is_some_and(|tags| tags[up as usize] != tags[down as usize]) {
                    let facet = if up < down {
                        Facet { nodes: [node, other], cells: [up, down], given }
                    } else {
                        Facet { nodes: [other, node], cells: [down, up], given }
                    };
                    self.interior.push(facet);
                }
            } else {
                self.wrong = self.wrong.or(Some([node, other]));
                self.count += 1;
            }
            k += many;
        }
    }
}

/// Whether the area of a cell is less than rounding its nodes to floats can make.
fn is_flat_but_for_rounding(points: &[Point<2>], cell: [u32; 3]) -> bool {
    let [a, b, c] = cell.map(|node| points[node as usize]);
    let largest = [a, b, c].iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    let longest = distance(&a, &b).max(distance(&b, &c)).max(distance(&c, &a));
    orient(&a, &b, &c) <= 2.0 * f64::EPSILON * largest * longest
}

/// Says what is wrong where an edge has two sides in the same direction: duplicate cells first, then cells without an area
/// but for rounding, then three cells at an edge, then cells on the same side of an edge.
fn diagnose(points: &[Point<2>], cells: &[[u32; 3]], flip: &[u32], [a, b]: [u32; 2], more: usize) -> Broken {
    let sorted = |nodes: [u32; 3]| {
        let mut nodes = nodes;
        nodes.sort_unstable();
        nodes
    };
    let mut order: Vec<u32> = (0..cells.len() as u32).collect();
    order.par_sort_unstable_by_key(|&cell| (sorted(cells[cell as usize]), cell));
    let mut found = Found::default();
    let mut first_of = HashMap::new();
    for pair in order.windows(2) {
        let [one, two] = [pair[0], pair[1]];
        if sorted(cells[one as usize]) == sorted(cells[two as usize]) {
            found.note(two as usize);
            let first = first_of.get(&one).copied().unwrap_or(one);
            first_of.insert(two, first);
        }
    }
    let duplicate = found.refuse(|cell, more| Broken::DuplicateCell {
        cell,
        nodes: cells[cell].to_vec(),
        first: first_of[&(cell as u32)] as usize,
        more,
    });
    if let Err(broken) = duplicate {
        return broken;
    }
    let around = |edge: [u32; 2]| -> Vec<u32> {
        (0..cells.len() as u32).filter(|&c| edge.iter().all(|v| cells[c as usize].contains(v))).collect()
    };
    let beside = around([a, b]);
    let flat = |&&cell: &&u32| is_flat_but_for_rounding(points, cells[cell as usize]);
    if let Some(&cell) = beside.iter().find(flat) {
        return Broken::ZeroArea { cell: cell as usize, nodes: cells[cell as usize].to_vec(), more: 0 };
    }
    if beside.len() > 2 {
        return Broken::CrowdedEdge { nodes: vec![a, b], cells: beside, more };
    }
    // of two cells on the same side, the one that was given the other way round than most is the inverted one
    let odd = |cell: u32| (flip.binary_search(&cell).is_ok()) != (2 * flip.len() > cells.len());
    let [one, two] = [beside[0], beside[1]];
    let [cell, other] = if odd(one) && !odd(two) { [one, two] } else { [two, one] };
    Broken::InvertedCell {
        cell: cell as usize,
        nodes: cells[cell as usize].to_vec(),
        other: other as usize,
        edge: vec![a, b],
        more,
    }
}
