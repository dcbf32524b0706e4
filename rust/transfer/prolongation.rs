//! Piecewise-linear interpolation from a mesh to the nodes of a finer one.
//!
//! Nodes that the meshes share are known. From them the search spreads over the edges of the finer mesh, in rounds: a
//! node is located by a walk from the least of its neighbours that were located before. Edges of the finer mesh cross no
//! slit and no wall, nor do the walks, so a node stays on its own side. Rounds and choices depend on indices only,
//! never on threads.
//!
//! Which neighbours may start a walk. Around the tip of a slit, or where parts only touch, one node belongs to several
//! sides, and a direction alone may point to the wrong one. So nodes inside the finer domain come first; those on its
//! boundary only where nothing else is left to go on from; tips, and nodes where only corners of the finer mesh meet
//! (other than shared ones: what ends there is known), last of all.
//!
//! Nodes that lie outside of the coarse mesh are then looked at again from all their neighbours, and take the nearest of
//! the places found.
//!
//! Parts of the finer mesh that share no node with the coarse one (parts that were dropped; levels that are not nested)
//! are searched for from one node each: in all cells, else on all boundary edges.

use super::halfedges::HalfEdges;
use super::place::{INSIDE, Place, anywhere};
use super::rows::Rows;
use super::walk::walk;
use super::walls::Walls;
use crate::error::Error;
use crate::point::{NONE, Point, distance};
use rayon::prelude::*;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// A mesh whose nodes are looked for in a coarser one.
#[derive(Clone, Copy)]
pub struct Finer<'a> {
    /// Nodes.
    pub points: &'a [Point<2>],
    /// Cells, counter-clockwise.
    pub cells: &'a [[u32; 3]],
    /// Edges of one cell, which is on their left.
    pub boundary: &'a [[u32; 2]],
}

/// A finer mesh before its nodes are located: all that needs no coarse one.
pub struct Unplaced<'a> {
    finer: Finer<'a>,
    injection: &'a [u32],
    walls: Walls<'a>,
    status: Vec<u8>,
    from: Vec<AtomicU32>,
}

impl<'a> Unplaced<'a> {
    /// `injection` has the finer node of each coarse node, or `NONE`. Runtime: O(n + b log b).
    pub fn new(finer: Finer<'a>, injection: &'a [u32]) -> Self {
        let n = finer.points.len();
        let mut status = vec![0; n];
        for &[a, b] in finer.boundary {
            status[a as usize] |= if status[a as usize] & STARTS == 0 { STARTS } else { PINCH };
            status[b as usize] |= ON_BOUNDARY;
        }
        let on_boundary = |v: u32| status.get(v as usize).is_some_and(|&status| status & ON_BOUNDARY != 0);
        Self {
            finer,
            injection,
            walls: Walls::new(finer.points, finer.boundary, on_boundary, injection),
            status,
            from: (0..n).map(|_| AtomicU32::new(NOWHERE)).collect(),
        }
    }
}

/// The coarse mesh to walk in and the finer one, made side by side.
pub fn prepared<'a>(
    finer: Finer<'a>,
    coarse_points: &'a [Point<2>],
    coarse_cells: &'a [[u32; 3]],
    injection: &'a [u32],
) -> Result<(HalfEdges<'a>, Unplaced<'a>), Error> {
    let (coarse, finer) =
        rayon::join(|| HalfEdges::new(coarse_points, coarse_cells), || Unplaced::new(finer, injection));
    Ok((coarse?, finer))
}

/// Where the nodes of a finer mesh lie.
pub struct Located<'a> {
    /// By node of the finer mesh.
    pub places: Vec<Place>,
    /// Nodes of parts that share no node with the coarse mesh and do not lie in it either, ascending.
    pub lost: Vec<u32>,
    /// Where the finer mesh ends.
    pub walls: Walls<'a>,
}

/// Nodes that one thread walks to at least.
const GRAIN: usize = 512;

/// Locates the nodes of a finer mesh in a coarser one. Cells of both counter-clockwise. Runtime: O(n + m).
pub fn locate<'a>(finer: Unplaced<'a>, coarse: &'a HalfEdges<'a>) -> Result<Located<'a>, Error> {
    if coarse.cells.is_empty() {
        return Err(Error::Argument("the coarse mesh has no cells".into()));
    }
    let n = finer.status.len();
    if n > i32::MAX as usize {
        return Err(Error::Argument(format!("{n} nodes, expected fewer than 2**31")));
    }
    let mut search = Search::new(finer, coarse)?;
    search.run()?;
    search.reconsider()?;
    let lost = (0..n as u32).filter(|&v| search.status[v as usize] & LOST != 0).collect();
    Ok(Located { places: search.places, lost, walls: search.walls })
}

/// The matrix of the weights, and the distance of each node that lies outside of the coarse mesh.
pub fn weights(
    points: &[Point<2>],
    coarse: &HalfEdges<'_>,
    places: &[Place],
) -> Result<(Rows, Vec<(u32, f64)>), Error> {
    let count = |place: &Place| place.weights.iter().filter(|&&w| w > 0.0).count() as u8;
    let counts: Vec<u8> = places.par_iter().map(count).collect();
    let indptr = Rows::starts(counts.into_iter().map(usize::from))?;
    let entries = indptr[places.len()] as usize;
    let (mut indices, mut data) = (vec![0i32; entries], vec![0.0; entries]);
    let mut chunks = Vec::new();
    let (mut free_indices, mut free_data) = (&mut indices[..], &mut data[..]);
    for rows in places.chunks(CHUNK) {
        let first = chunks.len() * CHUNK;
        let size = (indptr[first + rows.len()] - indptr[first]) as usize;
        let (own_indices, rest) = free_indices.split_at_mut(size);
        free_indices = rest;
        let (own_data, rest) = free_data.split_at_mut(size);
        free_data = rest;
        chunks.push((rows, own_indices, own_data));
    }
    chunks.into_par_iter().for_each(|(rows, indices, data)| {
        let mut at = 0;
        for place in rows {
            let cell = coarse.cells[place.cell as usize];
            // column and corner, sorted without a branch
            let entries = sorted([0, 1, 2].map(|k| u64::from(cell[k]) << 2 | k as u64));
            let (row, first) = (entries.map(|entry| place.weights[(entry & 3) as usize]), at);
            for (entry, weight) in entries.into_iter().zip(row) {
                if at < data.len() {
                    (indices[at], data[at]) = ((entry >> 2) as i32, weight);
                }
                // what has no weight is written over
                at += usize::from(weight > 0.0);
            }
            // as the last one, 1 - sum makes the row sum to 1 exactly, rounded from left to right
            let sum = row[0] + row[1];
            if at == first + 3 && sum < 1.0 {
                data[at - 1] = 1.0 - sum;
            }
        }
    });
    let outside = (0..places.len() as u32).into_par_iter().filter(|&v| places[v as usize].is_outside());
    let outside = outside.map(|v| (v, distance(&points[v as usize], &point_of(coarse, &places[v as usize])))).collect();
    Ok((Rows { columns: coarse.points.len(), indptr, indices, data }, outside))
}

fn sorted([a, b, c]: [u64; 3]) -> [u64; 3] {
    let (a, b) = (a.min(b), a.max(b));
    let (b, c) = (b.min(c), b.max(c));
    [a.min(b), a.max(b), c]
}

/// Rows or places that one thread writes at a time.
const CHUNK: usize = 1 << 14;

/// The point of the coarse mesh that stands for a place.
fn point_of(coarse: &HalfEdges<'_>, place: &Place) -> Point<2> {
    let corners = coarse.cells[place.cell as usize].map(|i| coarse.points[i as usize]);
    [0, 1].map(|d| (0..3).map(|k| place.weights[k] * corners[k][d]).sum())
}

const FOUND: u8 = 1;
const ON_BOUNDARY: u8 = 2;
const LOST: u8 = 4;
const OUTSIDE: u8 = 8;
/// A boundary edge starts there.
const STARTS: u8 = 16;
/// Several do: parts, or two sides of a channel, only touch there.
const PINCH: u8 = 32;
/// Bits of all these.
const STATUS_BITS: u32 = 6;

/// Which neighbours a walk may start from.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Start {
    Interior,
    Boundary,
    Tip,
}

struct Search<'a> {
    points: &'a [Point<2>],
    cells: &'a [[u32; 3]],
    coarse: &'a HalfEdges<'a>,
    walls: Walls<'a>,
    places: Vec<Place>,
    status: Vec<u8>,
    /// Start of the walk to a node, least first: whether it lies outside, then its index.
    from: Vec<AtomicU32>,
    /// Cells from which no walk has started yet and that have a node that is not found, in pieces; `None` before the
    /// first round, which looks at all.
    open: Option<Vec<Vec<u32>>>,
    /// Nodes that are not found, ascending.
    missing: Vec<u32>,
}

/// How often nodes outside are looked at again at most.
const MOST_LOOKS: usize = 8;

const NOWHERE: u32 = u32::MAX;

/// Marks starts that lie outside.
const FROM_OUTSIDE: u32 = 1 << 31;

impl<'a> Search<'a> {
    fn new(unplaced: Unplaced<'a>, coarse: &'a HalfEdges<'a>) -> Result<Self, Error> {
        let Unplaced { finer, injection, walls, mut status, from } = unplaced;
        let Finer { points, cells, .. } = finer;
        let mut home = vec![NONE; points.len()];
        for (c, &v) in injection.iter().enumerate().filter(|&(_, &v)| v != NONE) {
            let (home, status) = match (home.get_mut(v as usize), status.get_mut(v as usize)) {
                (Some(home), Some(status)) => (home, status),
                _ => return Err(Error::Argument(format!("'injection' of node {c} is {v}, out of range"))),
            };
            if let Some(&[_, h]) = coarse.leaving(c as u32).first() {
                *home = h;
                *status = (*status & !PINCH) | FOUND;
                // nothing is less: nobody tells this node where to start
                from[v as usize].store(0, Ordering::Relaxed);
            }
        }
        let mut search =
            Self { points, cells, coarse, walls, places: Vec::new(), status, from, open: None, missing: Vec::new() };
        search.begin(&home)?;
        Ok(search)
    }

    /// The first round: all walks start from shared nodes, given by a half-edge that leaves them in the coarse mesh. So
    /// they read none of the places that they make.
    fn begin(&mut self, home: &[u32]) -> Result<(), Error> {
        self.spread(Start::Interior);
        let failed = OnceLock::new();
        let locate = |v: usize| match (home[v], self.from[v].load(Ordering::Relaxed)) {
            (NONE, NOWHERE) => Place::UNKNOWN,
            (NONE, u) => self.walked(u, &Place::at_start(home[u as usize]), v as u32).unwrap_or_else(|error| {
                failed.get_or_init(|| error);
                Place::UNKNOWN
            }),
            (h, _) => Place::at_start(h),
        };
        // no `Result` for each: a plain array is written in place by all threads
        let places = (0..home.len()).into_par_iter().with_min_len(GRAIN).map(locate).collect::<Vec<_>>();
        let mark = |(status, place): (&mut u8, &Place)| {
            *status |= match place.cell {
                NONE => 0,
                _ if place.is_outside() => FOUND | OUTSIDE,
                _ => FOUND,
            }
        };
        self.status.par_iter_mut().zip(&places).with_min_len(CHUNK).for_each(mark);
        self.places = places;
        let is_missing = |&v: &u32| self.status[v as usize] & FOUND == 0;
        self.missing = (0..home.len() as u32).into_par_iter().with_min_len(CHUNK).filter(is_missing).collect();
        failed.into_inner().map_or(Ok(()), Err)
    }

    /// The place of node `v`, by a walk from its neighbour `u`.
    fn walked(&self, u: u32, place: &Place, v: u32) -> Result<Place, Error> {
        walk(self.coarse, &self.walls, &self.points[u as usize], place, v, &self.points[v as usize])
    }

    fn run(&mut self) -> Result<(), Error> {
        let mut start = Start::Interior;
        while !self.missing.is_empty() {
            self.spread(start);
            let found = self.round()?;
            start = match (found, start) {
                (true, _) => Start::Interior,
                (false, Start::Interior) => Start::Boundary,
                (false, Start::Boundary) => Start::Tip,
                (false, Start::Tip) => {
                    self.seed();
                    Start::Interior
                }
            };
        }
        Ok(())
    }

    fn may_start(&self, u: u32, start: Start) -> bool {
        let status = self.status[u as usize];
        Self::admits(status, start) && !(start == Start::Boundary && self.is_barred(u))
    }

    /// Whether a node may be a start by its status alone.
    fn admits(status: u8, start: Start) -> bool {
        let may_be = match start {
            Start::Interior => status & ON_BOUNDARY == 0,
            Start::Boundary => status & (ON_BOUNDARY | PINCH) != ON_BOUNDARY | PINCH,
            Start::Tip => true,
        };
        may_be && status & FOUND != 0
    }

    /// Whether a node that is found is a tip.
    #[cold]
    fn is_barred(&self, u: u32) -> bool {
        let is_tip = |node: u32| self.coarse.is_tip(node);
        self.status[u as usize] & ON_BOUNDARY != 0 && self.places[u as usize].node(self.coarse).is_some_and(is_tip)
    }

    /// Tells every missing node the least neighbour to start from.
    fn spread(&mut self, start: Start) {
        let before = self.open.take();
        let status = |v: u32| self.status[v as usize];
        // or-ed to an index: looked up, as nobody can foretell which nodes are found
        let marks: [u32; 1 << STATUS_BITS] = std::array::from_fn(|status| match Self::admits(status as u8, start) {
            true if status as u8 & OUTSIDE == 0 => 0,
            true => FROM_OUTSIDE,
            false => NOWHERE,
        });
        let key = |u: u32| {
            let mark = marks[status(u) as usize % marks.len()];
            let is_barred = start == Start::Boundary && mark != NOWHERE && self.is_barred(u);
            if is_barred { NOWHERE } else { u | mark }
        };
        // a cell with a start is done with: all its nodes are found in this round
        let stays_open = |&c: &u32| {
            let cell = self.cells[c as usize];
            let [u, v, w] = cell;
            let least = key(u).min(key(v)).min(key(w));
            if least == NOWHERE {
                return status(u) & status(v) & status(w) & FOUND == 0;
            }
            for v in cell {
                let from = &self.from[v as usize];
                // half of the edges come twice
                if least < from.load(Ordering::Relaxed) {
                    from.fetch_min(least, Ordering::Relaxed);
                }
            }
            false
        };
        let open = match before {
            Some(mut open) => {
                open.par_iter_mut().for_each(|piece| piece.retain(stays_open));
                open
            }
            None => {
                let count = self.cells.len() as u32;
                let pieces = (0..count.div_ceil(CHUNK as u32)).into_par_iter().map(|i| i * CHUNK as u32);
                pieces.map(|first| (first..count.min(first + CHUNK as u32)).filter(stays_open).collect()).collect()
            }
        };
        self.open = Some(open);
    }

    /// Walks to all nodes that know where to start; returns whether there were any.
    fn round(&mut self) -> Result<bool, Error> {
        let from = |v: u32| self.from[v as usize].load(Ordering::Relaxed);
        let (known, missing): (Vec<u32>, Vec<u32>) =
            self.missing.par_iter().with_min_len(GRAIN).partition(|&&v| from(v) != NOWHERE);
        let locate = |&v: &u32| {
            let u = (from(v) & !FROM_OUTSIDE) as usize;
            let place = self.walked(u as u32, &self.places[u], v)?;
            let marks = if place.is_outside() { OUTSIDE | self.status[u] & LOST } else { 0 };
            Ok((place, FOUND | marks))
        };
        let found = known.par_iter().with_min_len(GRAIN).map(locate).collect::<Result<Vec<_>, Error>>()?;
        let chunks = self.places.par_chunks_mut(CHUNK).zip(self.status.par_chunks_mut(CHUNK));
        chunks.enumerate().for_each(|(chunk, (places, status))| {
            let begin = |chunk: usize| known.partition_point(|&v| (v as usize) < chunk * CHUNK);
            let own = begin(chunk)..begin(chunk + 1);
            for (&v, &(place, marks)) in known[own.clone()].iter().zip(&found[own]) {
                let at = v as usize - chunk * CHUNK;
                places[at] = place;
                status[at] |= marks;
            }
        });
        self.missing = missing;
        Ok(!known.is_empty())
    }

    /// Looks at the nodes outside again, from all their neighbours: a line may leave the coarse mesh and come in again,
    /// where cells were taken off its rim, and another one may end nearer.
    fn reconsider(&mut self) -> Result<(), Error> {
        let is_outside = |v: u32| self.status[v as usize] & OUTSIDE != 0;
        let meets = |cell: &[u32; 3]| cell.iter().any(|&v| is_outside(v));
        let near: Vec<&[u32; 3]> = self.cells.par_iter().with_min_len(4096).filter(|cell| meets(cell)).collect();
        let mut edges: Vec<[u32; 2]> = near
            .into_iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, a], [b, c], [c, b], [c, a], [a, c]])
            .filter(|&[v, u]| is_outside(v) && self.may_start(u, Start::Boundary))
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let stars: Vec<&[[u32; 2]]> = edges.chunk_by(|a, b| a[0] == b[0]).collect();
        for _ in 0..MOST_LOOKS {
            let look = |star: &&[[u32; 2]]| {
                let v = star[0][0];
                let x = &self.points[v as usize];
                let away = |place: &Place| match place.beyond {
                    INSIDE => 0.0,
                    _ => distance(x, &point_of(self.coarse, place)),
                };
                let (mut best, mut least) = (self.places[v as usize], away(&self.places[v as usize]));
                for &[_, u] in star.iter() {
                    let place =
                        walk(self.coarse, &self.walls, &self.points[u as usize], &self.places[u as usize], v, x)?;
                    let distance = away(&place);
                    if distance < (1.0 - 1e-9) * least {
                        (best, least) = (place, distance);
                    }
                }
                Ok((v, best))
            };
            let looked = stars.par_iter().with_min_len(GRAIN / 8).map(look).collect::<Result<Vec<_>, Error>>()?;
            let mut changed = false;
            for (v, place) in looked {
                changed |= self.places[v as usize] != place;
                self.places[v as usize] = place;
            }
            if !changed {
                break;
            }
        }
        Ok(())
    }

    /// Finds the first missing node by a search of the whole coarse mesh.
    fn seed(&mut self) {
        let v = self.missing.remove(0) as usize;
        self.places[v] = anywhere(self.coarse, &self.points[v]);
        self.status[v] |= FOUND | if self.places[v].is_outside() { OUTSIDE | LOST } else { 0 };
    }
}
