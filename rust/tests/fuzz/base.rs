//! Meshes to carve: Delaunay triangulations of clouds that tempt them, lattices with mazes in their tags, bisection
//! meshes, coasts; all with flipped edges now and then.

use super::Plane;
use super::random::Random;
use super::topology::orient;
use _core::triangulation::delaunay;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// A mesh of a few to some three hundred nodes.
pub fn base(random: &mut Random) -> Plane {
    let n = 2f64.powf(random.between(2.5, 8.2)) as usize;
    let mut plane = match random.below(8) {
        0..=2 => cloud(random, n),
        3..=4 => lattice(random, n),
        5 => bisected(random, n),
        _ => coast(random, n),
    };
    if random.chance(0.3) {
        let flips = plane.cells.len() / 3;
        (0..flips).for_each(|_| flip(&mut plane, random));
    }
    plane
}

fn plane_of(points: Vec<[f64; 2]>, cells: Vec<[u32; 3]>) -> Plane {
    let cells: Vec<[u32; 3]> = cells
        .into_iter()
        .filter(|&[a, b, c]| orient(points[a as usize], points[b as usize], points[c as usize]) > 0.0)
        .collect();
    Plane { tags: vec![0; cells.len()], points, cells, given: Vec::new() }
}

/// Delaunay triangulation of a cloud.
fn cloud(random: &mut Random, n: usize) -> Plane {
    let shape = random.below(8);
    let power = random.between(2.0, 20.0);
    let mut points: Vec<[f64; 2]> = (0..n)
        .map(|i| {
            let (x, y) = (random.unit(), random.unit());
            match shape {
                0 | 1 => [x, y],
                2 => [x.powf(power), y.powf(power)],
                3 => [(x * 9.0).floor(), (y * 9.0).floor()],
                4 => {
                    let (ring, turn) = ((x * 4.0).floor() + 1.0, TAU * (y * 24.0).floor() / 24.0);
                    [ring * turn.cos(), ring * turn.sin()]
                }
                5 => [x, y * 1e-4],
                6 => {
                    let radius = 10f64.powf(-10.0 * x);
                    [radius * (TAU * y).cos(), radius * (TAU * y).sin()]
                }
                _ => {
                    let t = i as f64 / n as f64;
                    [t, t * t * if random.chance(0.5) { 1.0 } else { -1.0 }]
                }
            }
        })
        .collect();
    if random.chance(0.2) {
        let near = random.pick(&[1e-10, 1e-7, 1e-3]);
        for _ in 0..n / 4 {
            let p = points[random.below(n)];
            let turn = TAU * random.unit();
            points.push([p[0] + near * turn.cos(), p[1] + near * turn.sin()]);
        }
    }
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    random.shuffle(&mut points);
    let cells = delaunay(&points, &[]).unwrap_or_default();
    plane_of(points, cells)
}

/// A mapped lattice; its tags are a maze, a spiral, a comb, rings, a checkerboard, layers or noise.
fn lattice(random: &mut Random, n: usize) -> Plane {
    let wide = random.range(2, 13);
    let high = (n / (wide + 1)).clamp(1, 15);
    let (diagonal, map, growth) = (random.below(4), random.below(6), random.between(1.1, 6.0));
    let jitter = if random.chance(0.3) { random.between(0.0, 0.3) } else { 0.0 };
    let mut points = Vec::new();
    for j in 0..=high {
        for i in 0..=wide {
            let (x, y) = (i as f64 + jitter * random.between(-1.0, 1.0), j as f64 + jitter * random.between(-1.0, 1.0));
            points.push(match map {
                0..=2 => [x, y],
                3 => [x, growth.powf(y)],
                4 => {
                    let (radius, turn) = (growth.powf(x / 2.0), TAU * y / (high as f64 + 0.5));
                    [radius * turn.cos(), radius * turn.sin()]
                }
                _ => [x + 0.3 * y.sin(), y + 0.3 * x.sin()],
            });
        }
    }
    let mask = mask(random, wide, high);
    let (mut cells, mut tags) = (Vec::new(), Vec::new());
    for j in 0..high {
        for i in 0..wide {
            let [a, b] = [j * (wide + 1) + i, j * (wide + 1) + i + 1].map(|k| k as u32);
            let [d, c] = [a, b].map(|k| k + wide as u32 + 1);
            let other = match diagonal {
                0 => false,
                1 => (i + j) % 2 == 0,
                2 => true,
                _ => random.chance(0.5),
            };
            cells.extend(if other { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] });
            tags.extend([mask[j * wide + i]; 2]);
        }
    }
    let whole: Vec<([u32; 3], i64)> = cells
        .into_iter()
        .zip(tags)
        .filter(|&([a, b, c], _)| orient(points[a as usize], points[b as usize], points[c as usize]) > 0.0)
        .collect();
    let (cells, tags) = whole.into_iter().unzip();
    Plane { points, cells, tags, given: Vec::new() }
}

fn mask(random: &mut Random, wide: usize, high: usize) -> Vec<i64> {
    let shape = random.below(9);
    let mut mask: Vec<i64> = (0..wide * high)
        .map(|k| {
            let (i, j) = (k % wide, k / wide);
            let rim = i.min(j).min(wide - 1 - i).min(high - 1 - j);
            match shape {
                0 => (rim % 2) as i64,
                1 => ((i + j) % 2) as i64,
                2 => i64::from(random.chance(0.4)),
                3 => (i % 2 * usize::from(j > 0)) as i64,
                4 => j as i64,
                5 => (i % 3) as i64,
                6 | 7 => 1,
                _ => 0,
            }
        })
        .collect();
    if shape == 6 {
        spiral(&mut mask, wide, high);
    } else if shape == 7 {
        maze(&mut mask, wide, high, random);
    }
    mask
}

/// Zeros along a spiral one quad wide, ones between its turns.
fn spiral(mask: &mut [i64], wide: usize, high: usize) {
    let (mut x, mut y, mut way) = (0i64, 0i64, 0usize);
    let ways = [[1, 0], [0, 1], [-1, 0], [0, -1]];
    let is_zero = |mask: &[i64], x: i64, y: i64| {
        x < 0 || y < 0 || x >= wide as i64 || y >= high as i64 || mask[y as usize * wide + x as usize] == 0
    };
    mask[0] = 0;
    let mut turned = 0;
    while turned < 2 {
        let [dx, dy] = ways[way];
        let outside = |x: i64, y: i64| x < 0 || y < 0 || x >= wide as i64 || y >= high as i64;
        let beyond = !outside(x + 2 * dx, y + 2 * dy) && is_zero(mask, x + 2 * dx, y + 2 * dy);
        if is_zero(mask, x + dx, y + dy) || beyond {
            way = (way + 1) % 4;
            turned += 1;
        } else {
            (x, y, turned) = (x + dx, y + dy, 0);
            mask[y as usize * wide + x as usize] = 0;
        }
    }
}

/// Zeros along the passages of a random maze, ones for its walls.
fn maze(mask: &mut [i64], wide: usize, high: usize, random: &mut Random) {
    let mut stack = vec![(0usize, 0usize)];
    mask[0] = 0;
    while let Some(&(x, y)) = stack.last() {
        let mut ways = [(2i64, 0i64), (-2, 0), (0, 2), (0, -2)];
        random.shuffle(&mut ways);
        let next = ways.into_iter().find_map(|(dx, dy)| {
            let (u, v) = (x as i64 + dx, y as i64 + dy);
            let inside = u >= 0 && v >= 0 && u < wide as i64 && v < high as i64;
            (inside && mask[v as usize * wide + u as usize] == 1).then_some((u as usize, v as usize))
        });
        match next {
            None => drop(stack.pop()),
            Some((u, v)) => {
                mask[(y + v) / 2 * wide + (x + u) / 2] = 0;
                mask[v * wide + u] = 0;
                stack.push((u, v));
            }
        }
    }
}

/// Newest-vertex bisection towards a point or a line.
fn bisected(random: &mut Random, n: usize) -> Plane {
    let mut mesh = Bisection {
        points: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        // the refinement edge leads from the first corner to the second
        cells: vec![[0, 2, 3], [2, 0, 1]],
        middle: HashMap::new(),
    };
    let focus = [random.unit(), random.unit()];
    let on_line = random.chance(0.5);
    while mesh.points.len() < n {
        let mut best = (0, -1.0);
        for _ in 0..6 {
            let t = random.below(mesh.cells.len());
            let [a, b, _] = mesh.cells[t].map(|i| mesh.points[i as usize]);
            let d = if on_line { (a[1] - focus[1]).abs() } else { (a[0] - focus[0]).hypot(a[1] - focus[1]) };
            let score = (a[0] - b[0]).hypot(a[1] - b[1]) / (d + 1e-3);
            if score > best.1 {
                best = (t, score);
            }
        }
        mesh.bisect(best.0);
    }
    plane_of(mesh.points, mesh.cells)
}

struct Bisection {
    points: Vec<[f64; 2]>,
    cells: Vec<[u32; 3]>,
    middle: HashMap<[u32; 2], u32>,
}

impl Bisection {
    fn bisect(&mut self, t: usize) {
        let [a, b, c] = self.cells[t];
        let across = |mesh: &Bisection| {
            (0..mesh.cells.len()).find(|&s| (0..3).any(|k| mesh.cells[s][k] == b && mesh.cells[s][(k + 1) % 3] == a))
        };
        let mut other = across(self);
        if let Some(s) = other.filter(|&s| self.cells[s][0] != b || self.cells[s][1] != a) {
            self.bisect(s);
            other = across(self);
        }
        let [p, q] = [a, b].map(|i| self.points[i as usize]);
        let middle = self.points.len() as u32;
        self.points.push([(p[0] + q[0]) / 2.0, (p[1] + q[1]) / 2.0]);
        self.cells[t] = [c, a, middle];
        self.cells.push([b, c, middle]);
        if let Some(s) = other {
            let d = self.cells[s][2];
            self.cells[s] = [d, b, middle];
            self.cells.push([a, d, middle]);
        }
    }
}

/// A coast: a loop displaced at ever finer scale, with islands, filled with nodes.
fn coast(random: &mut Random, n: usize) -> Plane {
    let (mut points, mut edges) = (Vec::new(), Vec::new());
    let rough = random.between(0.05, 0.45);
    let (turn, corners) = (random.unit(), random.range(3, 8));
    let mut shore: Vec<[f64; 2]> = (0..corners)
        .map(|k| {
            let angle = TAU * (k as f64 + turn) / corners as f64;
            [angle.cos(), angle.sin()]
        })
        .collect();
    while shore.len() < n / 3 {
        shore = displaced(&shore, rough, random);
    }
    close(&mut points, &mut edges, &shore);
    for _ in 0..random.below(6) {
        let (x, y) = (random.between(-0.6, 0.6), random.between(-0.6, 0.6));
        let (size, sides) = (random.between(0.01, 0.3), random.range(3, 9));
        let island: Vec<[f64; 2]> = (0..sides)
            .map(|k| {
                let (angle, radius) = (TAU * k as f64 / sides as f64, size * random.between(0.2, 1.0));
                [x + radius * angle.cos(), y + radius * angle.sin()]
            })
            .collect();
        close(&mut points, &mut edges, &island);
    }
    let walls = edges.clone();
    for _ in 0..n / 2 {
        points.push([random.between(-1.0, 1.0), random.between(-1.0, 1.0)]);
    }
    let Ok(cells) = delaunay(&points, &edges) else { return Plane::default() };
    let inside = |cell: &[u32; 3]| {
        let p = [0, 1].map(|k| cell.iter().map(|&i| points[i as usize][k]).sum::<f64>() / 3.0);
        walls.iter().fold(false, |odd, wall| {
            let [a, b] = wall.map(|i| points[i as usize]);
            odd ^ ((a[1] > p[1]) != (b[1] > p[1]) && (orient(a, b, p) > 0.0) == (b[1] > a[1]))
        })
    };
    let cells = cells.into_iter().filter(|cell| inside(cell)).collect();
    plane_of(points, cells)
}

fn displaced(shore: &[[f64; 2]], rough: f64, random: &mut Random) -> Vec<[f64; 2]> {
    let mut finer = Vec::new();
    for (k, &[x, y]) in shore.iter().enumerate() {
        let [u, v] = shore[(k + 1) % shore.len()];
        let (along, out) = (random.between(0.3, 0.7), random.between(-rough, rough));
        finer.push([x, y]);
        finer.push([x + along * (u - x) - out * (v - y), y + along * (v - y) + out * (u - x)]);
    }
    finer
}

fn close(points: &mut Vec<[f64; 2]>, edges: &mut Vec<[u32; 2]>, shore: &[[f64; 2]]) {
    let (first, n) = (points.len() as u32, shore.len() as u32);
    points.extend(shore);
    edges.extend((0..n).map(|k| [first + k, first + (k + 1) % n]));
}

/// Flips a random edge where its two cells are a convex quad.
fn flip(plane: &mut Plane, random: &mut Random) {
    if plane.cells.is_empty() {
        return;
    }
    let (t, k) = (random.below(plane.cells.len()), random.below(3));
    let (u, v, w) = (plane.cells[t][k], plane.cells[t][(k + 1) % 3], plane.cells[t][(k + 2) % 3]);
    let Some(s) =
        (0..plane.cells.len()).find(|&s| (0..3).any(|j| plane.cells[s][j] == v && plane.cells[s][(j + 1) % 3] == u))
    else {
        return;
    };
    let Some(x) = plane.cells[s].into_iter().find(|&i| i != u && i != v) else { return };
    let at = |i: u32| plane.points[i as usize];
    if plane.tags[s] == plane.tags[t] && orient(at(x), at(v), at(w)) > 0.0 && orient(at(w), at(u), at(x)) > 0.0 {
        plane.cells[t] = [x, v, w];
        plane.cells[s] = [w, u, x];
    }
}
