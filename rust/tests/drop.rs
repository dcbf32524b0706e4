//! Levels that drop small features: legal meshes of a simplified domain, down to any size.

use _core::domain::FacetRow;
use _core::hierarchy::{CellRows, Drop, Hierarchy, Input, Level, Method, Options, Stopped, hierarchy};
use _core::level::Rules;
use _core::point::Point;
use _core::progress::Progress;
use std::collections::HashMap;

/// Repeats are of these seeds.
const SEEDS: std::ops::Range<u64> = 0..60;

struct Domain {
    points: Vec<Point<2>>,
    cells: Vec<[u32; 3]>,
    facets: Vec<FacetRow>,
}

impl Domain {
    /// The boundary and the edges between tags, from the cells.
    fn new(points: Vec<Point<2>>, cells: Vec<[u32; 3]>, tags: &[i64]) -> Domain {
        let mut beside: HashMap<[u32; 2], usize> = HashMap::new();
        for (t, cell) in cells.iter().enumerate() {
            (0..3).for_each(|k| assert!(beside.insert([cell[k], cell[(k + 1) % 3]], t).is_none(), "edge used twice"));
        }
        let mut facets = Vec::new();
        for (&[a, b], &t) in &beside {
            match beside.get(&[b, a]) {
                None => facets.push(FacetRow { nodes: [a, b], cell_tags: (tags[t], None), given: Some(tags[t] + 10) }),
                Some(&other) if a < b && tags[t] != tags[other] => {
                    facets.push(FacetRow { nodes: [a, b], cell_tags: (tags[t], Some(tags[other])), given: None });
                }
                Some(_) => {}
            }
        }
        facets.sort_by_key(|facet| (facet.cell_tags.1.is_some(), facet.nodes));
        Domain { points, cells, facets }
    }

    /// The unit square of n by n squares, each cut in two, less the squares that `has` leaves out.
    fn grid(n: u32, has: impl Fn(u32, u32) -> bool, tag: impl Fn(u32, u32) -> i64, jitter: Option<u64>) -> Domain {
        let mut random = Random(jitter.unwrap_or(0));
        let mut index = HashMap::new();
        let (mut points, mut cells, mut tags) = (Vec::new(), Vec::new(), Vec::new());
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|&(i, j)| has(i, j)) {
            let mut at = |i: u32, j: u32| {
                *index.entry((i, j)).or_insert_with(|| {
                    let free = jitter.is_some() && i > 0 && i < n && j > 0 && j < n;
                    let mut off = || if free { 0.4 * (random.unit() - 0.5) } else { 0.0 };
                    points.push([(f64::from(i) + off()) / f64::from(n), (f64::from(j) + off()) / f64::from(n)]);
                    points.len() as u32 - 1
                })
            };
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            cells.extend([[a, b, c], [a, c, d]]);
            tags.extend([tag(i, j); 2]);
        }
        Domain::new(points, cells, &tags)
    }

    /// A square with a horizontal slit from the middle of its left side, `length` squares long.
    fn cracked(n: u32, length: u32) -> Domain {
        let whole = Domain::grid(n, |_, _| true, |_, _| 0, None);
        let (mut points, mut cells) = (whole.points, whole.cells);
        let on_slit = |p: &Point<2>| p[1] == 0.5 && p[0] < f64::from(length) / f64::from(n);
        let mut upper = HashMap::new();
        for node in 0..points.len() as u32 {
            if on_slit(&points[node as usize]) {
                upper.insert(node, points.len() as u32);
                points.push(points[node as usize]);
            }
        }
        for cell in &mut cells {
            if cell.iter().map(|&i| points[i as usize][1]).sum::<f64>() > 1.5 {
                *cell = cell.map(|node| upper.get(&node).copied().unwrap_or(node));
            }
        }
        let tags = vec![0; cells.len()];
        Domain::new(points, cells, &tags)
    }

    fn hierarchy(&self, drop: Drop, levels: Option<usize>, coarsest: usize) -> Hierarchy {
        let keep = drop == Drop::Auto;
        let rules = Rules { beta: 2.0, delta: 0.5, gradation: 0.5, hold: keep };
        let options = Options {
            factor: 2.0,
            levels,
            coarsest,
            nested: true,
            method: Method::Function,
            rules,
            keep,
            drop,
            min_angle: None,
            pool: true,
            cos_feature: 0.5,
        };
        let input =
            Input { points: &self.points, facets: &self.facets, spacing: None, cells: CellRows::Short(&self.cells) };
        let made = hierarchy(&input, options, &Progress::default()).expect("a hierarchy");
        let mut finer: Vec<u32> = (0..self.points.len() as u32).collect();
        for level in &made.0 {
            self.assert_is_legal(level);
            assert!(level.mesh.nodes.iter().all(|node| finer.binary_search(node).is_ok()), "not node-nested");
            finer.clone_from(&level.mesh.nodes);
        }
        made
    }

    fn corners(&self, level: &Level, cell: [u32; 3]) -> [Point<2>; 3] {
        cell.map(|k| self.points[level.mesh.nodes[k as usize] as usize])
    }

    fn area(&self, level: &Level) -> f64 {
        level.mesh.cells.iter().map(|&cell| area(&self.corners(level, cell))).sum()
    }

    fn least_angle(&self, level: &Level) -> f64 {
        level.mesh.cells.iter().map(|&cell| least_angle(&self.corners(level, cell))).fold(f64::INFINITY, f64::min)
    }

    /// Conforming, positive, every node used, the facets listed as they are, areas accounted for.
    fn assert_is_legal(&self, level: &Level) {
        let mesh = &level.mesh;
        assert!(!mesh.cells.is_empty());
        let mut beside: HashMap<[u32; 2], usize> = HashMap::new();
        let mut used = vec![false; mesh.nodes.len()];
        for (t, &cell) in mesh.cells.iter().enumerate() {
            assert!(area(&self.corners(level, cell)) > 0.0);
            for k in 0..3 {
                used[cell[k] as usize] = true;
                assert!(beside.insert([cell[k], cell[(k + 1) % 3]], t).is_none(), "an edge with two cells on one side");
            }
        }
        assert!(used.iter().all(|&used| used), "a node without a cell");
        assert!(level.spacing.len() == mesh.nodes.len() && level.spacing.iter().all(|&f| f > 0.0));
        let boundary = beside.keys().filter(|&&[a, b]| !beside.contains_key(&[b, a])).count();
        assert_eq!(boundary, mesh.n_boundary);
        for (k, &[a, b]) in mesh.facets.iter().enumerate() {
            let [left, right] = mesh.facet_cells[k];
            assert_eq!(beside[&[a, b]], left as usize);
            assert_eq!(beside.get(&[b, a]).copied(), (k >= boundary).then_some(right as usize));
        }
        for (&[a, b], &t) in &beside {
            let differs = beside.get(&[b, a]).is_some_and(|&other| mesh.cell_tags[t] != mesh.cell_tags[other]);
            assert!(
                !differs || mesh.facets.contains(&[a, b]) || mesh.facets.contains(&[b, a]),
                "tags meet at no facet"
            );
        }
        if let Some(dropped) = level.dropped {
            let whole: f64 = self.cells.iter().map(|cell| area(&cell.map(|i| self.points[i as usize]))).sum();
            let change = self.area(level) - whole;
            assert!((dropped.area_gained - dropped.area_lost - change).abs() < 1e-9, "areas are not accounted for");
            assert!(dropped.area_gained >= 0.0 && dropped.area_lost >= 0.0);
        }
    }

    fn has_at(&self, level: &Level, p: Point<2>) -> usize {
        level.mesh.nodes.iter().filter(|&&node| self.points[node as usize] == p).count()
    }
}

fn area([a, b, c]: &[Point<2>; 3]) -> f64 {
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
}

fn least_angle(p: &[Point<2>; 3]) -> f64 {
    let angle = |k: usize| {
        let (u, v) = ([0, 1].map(|x| p[(k + 1) % 3][x] - p[k][x]), [0, 1].map(|x| p[(k + 2) % 3][x] - p[k][x]));
        (u[0] * v[1] - u[1] * v[0]).atan2(u[0] * v[0] + u[1] * v[1]).to_degrees()
    };
    angle(0).min(angle(1)).min(angle(2))
}

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[test]
fn a_plate_with_a_hundred_holes_goes_down_to_the_coarsest() {
    let plate = Domain::grid(41, |i, j| i % 4 != 2 || j % 4 != 2, |_, _| 0, None);
    let (levels, stopped, _) = plate.hierarchy(Drop::Always, None, 50);
    assert_eq!(stopped, Stopped::Coarsest);
    let last = &levels[levels.len() - 1];
    assert!(last.mesh.cells.len() <= 50);
    assert_eq!(last.dropped.map(|dropped| dropped.loops_closed), Some(100));
    assert!(levels.iter().all(|level| plate.least_angle(level) >= 15.0));
    assert!((plate.area(last) - 1.0).abs() < 1e-12, "the closed plate is the square");
}

#[test]
fn a_square_keeps_its_corners_on_every_level() {
    let square = Domain::grid(33, |_, _| true, |_, _| 0, None);
    let (levels, ..) = square.hierarchy(Drop::Always, None, 4);
    assert!(levels.len() >= 4);
    for level in &levels {
        assert!((square.area(level) - 1.0).abs() < 1e-12);
        let dropped = level.dropped.expect("what was dropped");
        assert!(dropped.loops_closed == 0 && dropped.area_lost < 1e-12 && dropped.area_gained < 1e-12);
    }
}

#[test]
fn any_number_of_levels_has_cells() {
    let square = Domain::grid(9, |_, _| true, |_, _| 0, None);
    let (levels, stopped, _) = square.hierarchy(Drop::Always, Some(25), 1);
    assert_eq!((levels.len(), stopped), (25, Stopped::Levels));
    let speck = Domain::grid(1, |_, _| true, |_, _| 0, None);
    assert_eq!(speck.hierarchy(Drop::Always, Some(3), 1).0.len(), 3);
}

#[test]
fn a_slit_stays_doubled_while_it_is_longer_than_the_spacing() {
    let plate = Domain::cracked(32, 16);
    let (levels, ..) = plate.hierarchy(Drop::Always, None, 20);
    assert_eq!(plate.has_at(&levels[0], [0.0, 0.5]), 2, "both sides of the mouth");
    let doubled = |level: &Level| {
        let on_slit = |node: &&u32| plate.points[**node as usize][1] == 0.5 && plate.points[**node as usize][0] < 0.5;
        let mut at: Vec<u64> =
            level.mesh.nodes.iter().filter(on_slit).map(|&node| plate.points[node as usize][0].to_bits()).collect();
        at.sort_unstable();
        at.windows(2).filter(|pair| pair[0] == pair[1]).count()
    };
    assert!(doubled(&levels[0]) >= 4);
    assert!(levels.iter().all(|level| (plate.area(level) - 1.0).abs() < 1e-12), "a slit has no area");
    for level in &levels {
        assert!(plate.has_at(level, [0.5, 0.5]) <= 1, "the tip is one node");
    }
}

#[test]
fn an_interface_stays_a_line_of_facets() {
    let plate = Domain::grid(32, |_, _| true, |i, _| i64::from(i >= 16), None);
    let (levels, ..) = plate.hierarchy(Drop::Always, None, 20);
    for level in &levels {
        let right: f64 = (0..level.mesh.cells.len())
            .filter(|&t| level.mesh.cell_tags[t] == 1)
            .map(|t| area(&plate.corners(level, level.mesh.cells[t])))
            .sum();
        assert!((right - 0.5).abs() < 1e-12, "the right half has area {right}");
        assert!(level.mesh.facet_tags[..level.mesh.n_boundary].iter().all(|tag| matches!(tag, Some(10 | 11))));
    }
}

#[test]
fn a_small_part_vanishes_and_the_last_never_does() {
    let apart = Domain::grid(40, |i, j| i < 30 || (i > 35 && i < 38 && j > 20 && j < 23), |_, _| 0, None);
    let (levels, ..) = apart.hierarchy(Drop::Always, None, 30);
    let last = &levels[levels.len() - 1];
    let is_part = |node: &&u32| apart.points[**node as usize][0] > 0.8;
    assert_eq!(last.mesh.nodes.iter().filter(is_part).count(), 0);
    assert!(last.mesh.cells.len() <= 30 && apart.area(last) > 0.7);
}

#[test]
fn random_domains_give_legal_levels_of_no_slivers() {
    let mut poor = 0;
    let mut count = 0;
    for seed in SEEDS {
        let mut random = Random(seed);
        let n = 8 + (random.unit() * 30.0) as u32;
        let holes = 0.05 + 0.3 * random.unit();
        let block = 1 + (random.unit() * 3.0) as u32;
        let gone: Vec<bool> = (0..n * n).map(|_| random.unit() < holes).collect();
        let materials = random.unit() < 0.3;
        let tag = |i: u32, _| if materials { i64::from(i / 7 % 2) } else { 3 };
        let domain = Domain::grid(n, |i, j| !gone[(i / block * n + j / block) as usize], tag, Some(seed));
        let (levels, stopped, _) = domain.hierarchy(Drop::Always, None, 30);
        assert_eq!(stopped, Stopped::Coarsest, "seed {seed}");
        let fine = &levels[..levels.len().saturating_sub(2)];
        count += fine.len();
        poor += fine.iter().filter(|level| domain.least_angle(level) < 15.0).count();
    }
    assert!(poor * 20 <= count, "{poor} of {count} levels have an angle under 15 degrees");
}

#[test]
fn auto_keeps_first_and_then_drops() {
    let plate = Domain::grid(61, |i, j| i % 6 != 3 || j % 6 != 3, |_, _| 0, None);
    let (levels, stopped, _) = plate.hierarchy(Drop::Auto, None, 50);
    assert_eq!(stopped, Stopped::Coarsest);
    let switch = levels.iter().position(|level| level.dropped.is_some()).expect("a level that drops");
    assert!(switch > 0 && levels[switch..].iter().all(|level| level.dropped.is_some()));
}
