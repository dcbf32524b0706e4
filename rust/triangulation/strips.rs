//! A large triangulation in strips, all at once, joined along their borders.
//!
//! A cell of a strip whose circumcircle lies between the sides of the strip is a cell of the whole: no point of another
//! strip is inside. What is left over is one region along the borders, which the points around it triangulate, the edges of
//! the cells that stay being constraints: no point beyond them is in the circle of a cell there, for the circles of the
//! cells that stay are empty.
//!
//! Whatever goes wrong (a constraint across a border that crosses cells that stay, points on a line) only means that the
//! whole is triangulated in one piece. Strips depend on the points alone, never on the number of threads.

use super::cdt::triangulated;
use super::{Cell, counted};
use crate::error::Error;
use crate::kdtree::Bounds;
use crate::point::{NONE, Point};
use rayon::prelude::*;

/// A strip has at least so many columns of points, where these are evenly spread.
pub(super) const COLUMNS: usize = 100;

/// No more strips than these.
const MOST_STRIPS: usize = 16;

/// Every so many of the points are sorted to find where strips end.
const SAMPLED: usize = 64;

/// Relative room for the rounding of a circumcircle.
const ROOM: f64 = 1.0 + 1e-6;

/// Cells of a sharper angle than about this have no circumcircle to rely on.
const LEAST_SINE: f64 = 1e-6;

/// [`triangulated`] in strips of so many columns; `None` where that is not worth it, or not possible.
pub(super) fn in_strips(points: &[Point<2>], ends: &[[u32; 2]], columns: usize) -> Result<Option<Vec<Cell>>, Error> {
    let Some(strips) = Strips::new(points, columns) else { return Ok(None) };
    let count = strips.cuts.len() + 1;
    let room = points.len() / count + points.len() / 8;
    let mut members: Vec<Vec<u32>> = (0..count).map(|_| Vec::with_capacity(room)).collect();
    // strip of each point and its number there
    let mut places = Vec::with_capacity(points.len());
    for (i, p) in points.iter().enumerate() {
        let strip = strips.of(p);
        places.push((strip as u32, members[strip].len() as u32));
        members[strip].push(i as u32);
    }
    let mut own = vec![Vec::new(); count];
    for (c, ends) in ends.iter().enumerate() {
        let [a, b] = ends.map(|i| places[i as usize].0);
        if a == b {
            own[a as usize].push(c as u32);
        }
    }
    let part = |(strip, (members, own)): (usize, (Vec<u32>, Vec<u32>))| {
        let points: Vec<Point<2>> = members.iter().map(|&i| points[i as usize]).collect();
        let ends: Vec<[u32; 2]> = own.iter().map(|&c| ends[c as usize].map(|i| places[i as usize].1)).collect();
        let (cells, failed) = triangulated(&points, &ends, |k| members[k])?;
        let stays = |cell: [u32; 3]| strips.holds(strip, cell.map(|k| points[k as usize]));
        Ok(failed.is_empty().then(|| Part::new(&members, &own, &cells, stays)))
    };
    let all: Vec<_> = members.into_iter().zip(own).enumerate().collect();
    let parts: Option<Vec<Part>> = all.into_par_iter().map(part).collect::<Result<_, Error>>()?;
    let Some(parts) = parts else { return Ok(None) };
    let Some(cells) = joined(points, ends, &parts)? else { return Ok(None) };
    Ok(is_whole(&cells, points.len(), ends.len()).then_some(cells))
}

/// Where strips end, along the longer side of all.
struct Strips {
    axis: usize,
    cuts: Vec<f64>,
}

impl Strips {
    fn new(points: &[Point<2>], columns: usize) -> Option<Self> {
        let count = (points.len().isqrt() / columns).min(MOST_STRIPS);
        if count < 2 {
            return None;
        }
        let axis = Bounds::of(points).widest();
        let mut sample: Vec<f64> = points.iter().step_by(SAMPLED).map(|p| p[axis]).collect();
        sample.sort_unstable_by(f64::total_cmp);
        let cuts = (1..count).map(|k| sample[k * sample.len() / count]).collect();
        Some(Strips { axis, cuts })
    }

    fn of(&self, p: &Point<2>) -> usize {
        self.cuts.partition_point(|&cut| cut <= p[self.axis])
    }

    /// Whether the circumcircle of a cell, its inside and outline, lies inside a strip.
    fn holds(&self, strip: usize, [a, b, c]: [Point<2>; 3]) -> bool {
        let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1]]);
        let [uu, vv] = [u, v].map(|e| e[0] * e[0] + e[1] * e[1]);
        let turn = u[0] * v[1] - u[1] * v[0];
        // relative to the first corner
        let centre = [(v[1] * uu - u[1] * vv) / (2.0 * turn), (u[0] * vv - v[0] * uu) / (2.0 * turn)];
        let radius = (centre[0] * centre[0] + centre[1] * centre[1]).sqrt() * ROOM;
        let middle = a[self.axis] + centre[self.axis];
        let is_over = strip == 0 || middle - radius > self.cuts[strip - 1];
        let is_under = strip == self.cuts.len() || middle + radius < self.cuts[strip];
        turn > LEAST_SINE * uu.max(vv) && is_over && is_under
    }
}

/// What stays of one strip.
struct Part {
    /// Its cells that stay; neighbours are counted among them.
    cells: Vec<Cell>,
    /// Their edges to the region that is left over: cell and side.
    rim: Vec<(u32, usize)>,
    /// Points around that region.
    border: Vec<u32>,
}

impl Part {
    /// From the cells of points and constraints with these names.
    fn new(points: &[u32], constraints: &[u32], all: &[Cell], stays: impl Fn([u32; 3]) -> bool + Sync) -> Self {
        let (staying, number) = counted(all.len(), |t| stays(all[t].corners));
        let numbered = |t: u32| if t == NONE { NONE } else { number[t as usize] };
        let (mut is_corner, mut on_border) = (vec![false; points.len()], vec![false; points.len()]);
        for (Cell { corners, neighbours, .. }, &own) in all.iter().zip(&number) {
            for k in 0..3 {
                is_corner[corners[k] as usize] = true;
                if own == NONE || neighbours[k] == NONE {
                    on_border[corners[k] as usize] = true;
                    on_border[corners[(k + 1) % 3] as usize] = true;
                }
            }
        }
        let is_around = |&k: &usize| on_border[k] || !is_corner[k];
        let border = (0..points.len()).filter(is_around).map(|k| points[k]).collect();
        let renamed = |code: u32| if code == NONE { NONE } else { 2 * constraints[code as usize / 2] + code % 2 };
        let (mut cells, mut rim) = (Vec::with_capacity(staying.len()), Vec::new());
        for t in staying.into_iter().map(|t| t as usize) {
            let neighbours = all[t].neighbours.map(numbered);
            rim.extend((0..3).filter(|&k| neighbours[k] == NONE).map(|k| (cells.len() as u32, k)));
            let corners = all[t].corners.map(|k| points[k as usize]);
            cells.push(Cell { corners, neighbours, constraints: all[t].constraints.map(renamed) });
        }
        Part { cells, rim, border }
    }
}

/// The cells that stay, and those of the region left over.
fn joined(points: &[Point<2>], ends: &[[u32; 2]], parts: &[Part]) -> Result<Option<Vec<Cell>>, Error> {
    let mut firsts = vec![0];
    parts.iter().for_each(|part| firsts.push(firsts[firsts.len() - 1] + part.cells.len() as u32));
    // edges between cells that stay and the region: cell, side, ends
    let mut rim = Vec::new();
    for (part, &first) in parts.iter().zip(&firsts) {
        for &(t, k) in &part.rim {
            let corners = part.cells[t as usize].corners;
            rim.push(((first + t) as usize, k, [corners[k], corners[(k + 1) % 3]]));
        }
    }
    let mut border: Vec<u32> = parts.iter().flat_map(|part| &part.border).copied().collect();
    border.sort_unstable();
    let mut place = vec![NONE; points.len()];
    border.iter().zip(0..).for_each(|(&i, k)| place[i as usize] = k);
    let local = |ends: [u32; 2]| ends.map(|i| place[i as usize]);
    let real: Vec<u32> = (0..ends.len() as u32).filter(|&c| !local(ends[c as usize]).contains(&NONE)).collect();
    // the rim last: it takes the place of a constraint on the same edge
    let all: Vec<[u32; 2]> =
        real.iter().map(|&c| local(ends[c as usize])).chain(rim.iter().map(|edge| local(edge.2))).collect();
    let border_points: Vec<Point<2>> = border.iter().map(|&i| points[i as usize]).collect();
    let (region, mut out) = rayon::join(
        || triangulated(&border_points, &all, |k| border[k]),
        || concatenated(parts, &firsts, firsts[parts.len()] as usize + 3 * border.len()),
    );
    let (region, failed) = region?;
    if !failed.is_empty() {
        return Ok(None);
    }
    let Some(numbers) = beyond_rim(&region, real.len(), firsts[parts.len()]) else { return Ok(None) };
    for (t, &own) in numbers.iter().enumerate().filter(|&(_, &own)| own != NONE) {
        let mut beyond = region[t].neighbours.map(|next| if next == NONE { NONE } else { numbers[next as usize] });
        let mut constraints = region[t].constraints;
        for k in 0..3 {
            let Some(c) = (constraints[k] != NONE).then_some(constraints[k] as usize / 2) else { continue };
            constraints[k] = match c.checked_sub(real.len()) {
                None => 2 * real[c] + constraints[k] % 2,
                Some(edge) => {
                    let (cell, side, _) = rim[edge];
                    beyond[k] = cell as u32;
                    out[cell].neighbours[side] = own;
                    match out[cell].constraints[side] {
                        NONE => NONE,
                        code => code ^ 1,
                    }
                }
            };
        }
        out.push(Cell { corners: region[t].corners.map(|k| border[k as usize]), neighbours: beyond, constraints });
    }
    Ok(Some(out))
}

/// Numbers, from `first`, of the cells on the right of the constraints from `rim` on, flooded up to these; `None` where
/// there are none or the flood comes to their left.
fn beyond_rim(region: &[Cell], rim: usize, first: u32) -> Option<Vec<u32>> {
    let on_rim = |code: u32| code != NONE && code as usize / 2 >= rim;
    let mut is_in = vec![false; region.len()];
    let right = |codes: &[u32; 3]| codes.iter().any(|&code| on_rim(code) && code % 2 == 1);
    let mut stack: Vec<usize> = (0..is_in.len()).filter(|&t| right(&region[t].constraints)).collect();
    stack.iter().for_each(|&t| is_in[t] = true);
    while let Some(t) = stack.pop() {
        for (&next, &code) in region[t].neighbours.iter().zip(&region[t].constraints) {
            if on_rim(code) && code % 2 == 0 {
                return None;
            }
            if next != NONE && !on_rim(code) && !is_in[next as usize] {
                is_in[next as usize] = true;
                stack.push(next as usize);
            }
        }
    }
    let mut next = first;
    let number = |is_in: bool| {
        let own = if is_in { next } else { NONE };
        next += u32::from(is_in);
        own
    };
    let numbers: Vec<u32> = is_in.into_iter().map(number).collect();
    (next > first).then_some(numbers)
}

/// The cells of all parts, counted on, with room for more.
fn concatenated(parts: &[Part], firsts: &[u32], room: usize) -> Vec<Cell> {
    let mut all = Vec::with_capacity(room);
    for (part, &first) in parts.iter().zip(firsts) {
        let next = |t: u32| if t == NONE { NONE } else { first + t };
        all.par_extend(part.cells.par_iter().map(|cell| Cell { neighbours: cell.neighbours.map(next), ..*cell }));
    }
    all
}

/// Whether cells triangulate the hull of all points, by Euler's formula, and have all constraints.
fn is_whole(cells: &[Cell], points: usize, constraints: usize) -> bool {
    let (mut on_hull, mut is_there) = (0, vec![false; constraints]);
    let is_edge =
        |&&Cell { neighbours, constraints, .. }: &&Cell| neighbours.contains(&NONE) || constraints != [NONE; 3];
    for cell in cells.par_iter().filter(is_edge).collect::<Vec<_>>() {
        on_hull += cell.neighbours.iter().filter(|&&next| next == NONE).count();
        cell.constraints.iter().filter(|&&code| code != NONE).for_each(|&code| is_there[code as usize / 2] = true);
    }
    cells.len() + on_hull + 2 == 2 * points && is_there.iter().all(|&is_there| is_there)
}
