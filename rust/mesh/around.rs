//! What an outline covers: around each place, and at one place of each of its loops.
//!
//! Around a place the segments that leave it open what their part covers (counter-clockwise), those that arrive close it:
//!
//! ```text
//!        in    out        seen from a place, counter-clockwise from the right:
//!          \###/          out, in, out, in: what lies between an `out` and the next `in` is covered
//!      in   \#/   out     two of a kind in a row: cells overlap
//!       -----o-----
//!        ### ###
//! ```
//!
//! Where this holds at every place, where segments cross nowhere, and where each connected set of segments begins on the
//! right ground at its lowest place, nothing is covered twice.

use super::outline::{Contact, Outline, coincident, lower};
use crate::error::Broken;
use crate::point::{NONE, Point, turn};
use std::cmp::Ordering;
use std::collections::BTreeSet;

/// A segment, seen from a place on it.
#[derive(Debug, Clone, Copy)]
struct Ray {
    to: Point<2>,
    /// 1 for one that leaves, -1 for one that arrives.
    sign: i32,
    part: u32,
    segment: u32,
    /// Whether the place is an end of it.
    end: bool,
}

/// Adds the pairs of the last of `covering` with those before it.
fn both(covering: &[u32], pairs: &mut BTreeSet<[u32; 2]>) {
    if let Some((&last, before)) = covering.split_last() {
        pairs.extend(before.iter().map(|&part| [part.min(last), part.max(last)]));
    }
}

/// A segment that may lie inside another part.
pub type Suspect = (u32, u32);

/// The rays of every place.
pub struct Around<'o, 'a> {
    outline: &'o Outline<'a>,
    start: Vec<u32>,
    rays: Vec<Ray>,
}

impl<'o, 'a> Around<'o, 'a> {
    /// Collects the rays: ends of segments, and segments that a place lies inside.
    pub fn new(outline: &'o Outline<'a>, contacts: &[Contact]) -> Self {
        let mut ends: Vec<(u32, Ray)> = Vec::with_capacity(2 * outline.segments.len());
        let mut push = |place: u32, segment: u32, end: bool, forward: bool| {
            let [tail, head] = outline.ends(segment);
            let (to, sign) = if forward { (head, 1) } else { (tail, -1) };
            ends.push((place, Ray { to, sign, part: outline.segments[segment as usize].part, segment, end }));
        };
        for (k, s) in outline.segments.iter().enumerate() {
            push(s.tail, k as u32, true, true);
            push(s.head, k as u32, true, false);
        }
        let mut touches: Vec<(u32, u32)> = contacts
            .iter()
            .filter_map(|contact| match *contact {
                Contact::Touch { place, inside, .. } => Some((place, inside)),
                Contact::Cross(..) => None,
            })
            .collect();
        touches.sort_unstable();
        touches.dedup();
        for (place, inside) in touches {
            push(place, inside, false, true);
            push(place, inside, false, false);
        }
        let mut start = vec![0u32; outline.places.len() + 1];
        for (place, _) in &ends {
            start[*place as usize + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut fill = start.clone();
        let blank = Ray { to: [0.0; 2], sign: 0, part: 0, segment: NONE, end: false };
        let mut rays = vec![blank; ends.len()];
        for (place, ray) in ends {
            rays[fill[place as usize] as usize] = ray;
            fill[place as usize] += 1;
        }
        for (k, v) in outline.places.iter().enumerate() {
            // one that arrives closes before another one opens in the same direction
            rays[start[k] as usize..start[k + 1] as usize].sort_unstable_by(|a, b| {
                turn(v, &a.to, &b.to).then(a.sign.cmp(&b.sign)).then(a.segment.cmp(&b.segment))
            });
        }
        Around { outline, start, rays }
    }

    fn at(&self, place: usize) -> &[Ray] {
        &self.rays[self.start[place] as usize..self.start[place + 1] as usize]
    }

    /// Checks that rays of each part alternate around each place; returns segments at places that parts cover twice.
    pub fn alternate(&self, points: &[Point<2>], cells: &[[u32; 3]]) -> Result<Vec<Suspect>, Broken> {
        let mut suspects = Vec::new();
        let mut parts: Vec<(u32, i32)> = Vec::new();
        for place in 0..self.outline.places.len() {
            let rays = self.at(place);
            if rays.len() == 2 {
                continue;
            }
            // what each part covers just before the first ray
            parts.clear();
            for ray in rays {
                match parts.iter_mut().find(|(part, _)| *part == ray.part) {
                    Some((_, last)) if *last == ray.sign => return Err(self.overlap(points, cells, rays, ray)),
                    Some((_, last)) => *last = ray.sign,
                    None => parts.push((ray.part, ray.sign)),
                }
            }
            // rays alternate, so a part whose last ray opens covers the right
            let mut covering: Vec<u32> = parts.iter().filter(|p| p.1 == 1).map(|p| p.0).collect();
            let mut pairs = BTreeSet::new();
            for k in 2..=covering.len() {
                both(&covering[..k], &mut pairs);
            }
            for ray in rays {
                if ray.sign == 1 {
                    covering.push(ray.part);
                    both(&covering, &mut pairs);
                } else {
                    covering.retain(|&part| part != ray.part);
                }
            }
            if !pairs.is_empty() {
                for ray in rays {
                    let of_pair = |&&[p, q]: &&[u32; 2]| p == ray.part || q == ray.part;
                    suspects.extend(pairs.iter().filter(of_pair).map(|&[p, q]| (ray.segment, p + q - ray.part)));
                }
            }
        }
        Ok(suspects)
    }

    /// Checks at the lowest place of each connected set of segments that its part covers nothing twice there; returns
    /// segments at such places that lie inside another part.
    pub fn grounded(&self, cells: &[[u32; 3]]) -> Result<Vec<Suspect>, Broken> {
        let lowest = self.lowest_places();
        let mut suspects = Vec::new();
        if lowest.len() == 1 {
            return Ok(suspects);
        }
        for (place, part) in lowest {
            let rays = self.at(place as usize);
            let Some(first) = rays.iter().find(|ray| ray.part == part) else {
                continue;
            };
            let x = &self.outline.places[place as usize];
            // without parts the next segment below tells it: what lies there is right in its turn
            let below = match self.outline.has_parts {
                true => self.outline.below(x),
                false => vec![(part, i32::from(self.outline.is_floored(x)))],
            };
            for (of, times) in below {
                if of == part && times + i32::from(first.sign == 1) > 1 {
                    let facet = self.outline.boundary[self.outline.segments[first.segment as usize].edge as usize];
                    let cell = facet.cells[0] as usize;
                    let node = facet.nodes[usize::from(first.sign != 1)];
                    let how = format!("node {node} lies inside other cells");
                    let nodes = cells[cell].to_vec();
                    return Err(Broken::OverlappingCells { cell, nodes, other: None, how, more: 0 });
                }
                if of != part && times > 0 && rays.iter().all(|ray| ray.part != of) {
                    suspects.push((first.segment, of));
                }
            }
        }
        Ok(suspects)
    }

    /// The lowest place of each connected set of segments of one part, with that part.
    fn lowest_places(&self) -> Vec<(u32, u32)> {
        let mut sets = Sets::new(self.outline.segments.len());
        let mut ends: Vec<(u32, u32)> = Vec::new();
        for place in 0..self.outline.places.len() {
            ends.clear();
            ends.extend(self.at(place).iter().filter(|ray| ray.end).map(|ray| (ray.part, ray.segment)));
            ends.sort_unstable();
            for pair in ends.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
                sets.join(pair[0].1, pair[1].1);
            }
        }
        let mut lowest = vec![NONE; self.outline.segments.len()];
        for (k, s) in self.outline.segments.iter().enumerate() {
            let of = &mut lowest[sets.find(k as u32) as usize];
            let at = |place: u32| &self.outline.places[place as usize];
            for place in [s.tail, s.head] {
                if *of == NONE || lower(at(place), at(*of)) == Ordering::Less {
                    *of = place;
                }
            }
        }
        let roots = lowest.iter().enumerate().filter(|&(_, &place)| place != NONE);
        roots.map(|(k, &place)| (place, self.outline.segments[k].part)).collect()
    }

    fn overlap(&self, points: &[Point<2>], cells: &[[u32; 3]], rays: &[Ray], ray: &Ray) -> Broken {
        let facet = |ray: &Ray| self.outline.boundary[self.outline.segments[ray.segment as usize].edge as usize];
        let node = |ray: &Ray| facet(ray).nodes[usize::from(ray.sign != 1)];
        let own: Vec<&Ray> = rays.iter().filter(|other| other.part == ray.part && other.end).collect();
        if let Some(other) = own.iter().find(|other| node(other) != node(own[0])) {
            return coincident(points, [node(own[0]), node(other)], "their cells overlap", 0);
        }
        let cell = facet(ray).cells[0] as usize;
        let other = own.iter().map(|other| facet(other).cells[0] as usize).find(|&other| other != cell);
        let how = format!("around node {}", node(ray));
        Broken::OverlappingCells { cell, nodes: cells[cell].to_vec(), other, how, more: 0 }
    }
}

/// Disjoint sets, joined.
pub struct Sets(Vec<u32>);

impl Sets {
    /// Each alone.
    pub fn new(n: usize) -> Self {
        Sets((0..n as u32).collect())
    }

    /// The one that stands for the set.
    pub fn find(&mut self, mut a: u32) -> u32 {
        while self.0[a as usize] != a {
            self.0[a as usize] = self.0[self.0[a as usize] as usize];
            a = self.0[a as usize];
        }
        a
    }

    /// Joins two sets; the smaller one stands for both.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
