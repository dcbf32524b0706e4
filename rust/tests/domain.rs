//! Chains, corners and chords of real domains, and random domains by the thousand.

mod fuzz;

use _core::domain::{Domain, Seen, Sight};
use _core::point::{Point, orient};
use fuzz::Plane;
use fuzz::random::Random;
use fuzz::topology::facet_rows;

/// Draws of the random test: about three in four are legal meshes.
const DRAWS: u64 = 2700;
const FIRST_SEED: u64 = 1;

/// Draws and points of each at which it is asked what lies there.
const SEEN: u64 = 600;
const POINTS: usize = 40;

#[test]
fn levels_of_two_thousand_random_domains_are_valid() {
    let mut legal = 0;
    for seed in FIRST_SEED..FIRST_SEED + DRAWS {
        let Some((plane, options)) = fuzz::draw(seed) else { continue };
        legal += 1;
        assert_eq!(fuzz::failure(&plane, options), None, "seed {seed}: {options:?}");
    }
    assert!(legal >= 2000, "only {legal} legal draws");
}

/// The cell's middle, and whether rounding leaves it inside.
fn middle(plane: &Plane, cell: &[u32; 3]) -> (Point<2>, bool) {
    let [a, b, c] = cell.map(|i| plane.points[i as usize]);
    let middle = [0, 1].map(|k| (a[k] + b[k] + c[k]) / 3.0);
    (middle, [[a, b], [b, c], [c, a]].iter().all(|[p, q]| orient(p, q, &middle) > 0.0))
}

/// Points inside cells, between nodes, beyond nodes, between nodes of a chain, and anywhere in the box of the mesh.
fn points_of(plane: &Plane, domain: &Domain, random: &mut Random) -> Vec<Point<2>> {
    let [low, high] = [f64::min, f64::max]
        .map(|of: fn(f64, f64) -> f64| [0, 1].map(|k| plane.points.iter().map(|p| p[k]).reduce(of).unwrap_or(0.0)));
    let node = |random: &mut Random| plane.points[random.below(plane.points.len())];
    let point = |random: &mut Random| match random.below(5) {
        0 => middle(plane, &plane.cells[random.below(plane.cells.len())]).0,
        1 => {
            let [a, b, c] = [node(random), node(random), node(random)];
            [0, 1].map(|k| (a[k] + b[k] + c[k]) / 3.0)
        }
        2 => {
            let (a, b) = (node(random), node(random));
            [0, 1].map(|k| a[k] + 1.5 * (b[k] - a[k]))
        }
        3 => {
            let chain = &domain.chains[random.below(domain.chains.len())];
            let mut weight = || random.between(0.1, 1.0);
            let weights = [weight(), weight(), weight()];
            let corners = [0; 3].map(|_| domain.points[chain.vertices[random.below(chain.vertices.len())] as usize]);
            [0, 1].map(|k| (0..3).map(|i| weights[i] * corners[i][k]).sum::<f64>() / weights.iter().sum::<f64>())
        }
        _ => [0, 1].map(|k| random.between(low[k], high[k])),
    };
    (0..POINTS).map(|_| point(random)).collect()
}

/// Tag of the cell that has `x` inside, or none outside; no answer on an edge.
fn held(plane: &Plane, x: &Point<2>) -> Option<Option<i64>> {
    let mut found = None;
    for (cell, &tag) in plane.cells.iter().zip(&plane.tags) {
        let [a, b, c] = cell.map(|i| &plane.points[i as usize]);
        let least = orient(a, b, x).min(orient(b, c, x)).min(orient(c, a, x));
        if least == 0.0 {
            return None;
        }
        found = found.or((least > 0.0).then_some(tag));
    }
    Some(found)
}

/// Whether a line of sight crosses an odd number of walls that are not gone; no answer where it meets a vertex of them.
fn is_turned(domain: &Domain, eye: &Point<2>, x: &Point<2>, is_gone: &[bool]) -> Option<bool> {
    let mut is_odd = false;
    for (chain, _) in domain.chains.iter().zip(is_gone).filter(|&(_, &gone)| !gone) {
        for edge in chain.edges.iter().filter(|edge| edge.is_outer()) {
            let [a, b] = edge.vertices.map(|v| &domain.points[v as usize]);
            let turns = [orient(eye, x, a), orient(eye, x, b), orient(a, b, eye), orient(a, b, x)];
            if turns.contains(&0.0) {
                return None;
            }
            is_odd ^= (turns[0] > 0.0) != (turns[1] > 0.0) && (turns[2] > 0.0) != (turns[3] > 0.0);
        }
    }
    Some(is_odd)
}

/// Calls `test` with random legal meshes and their domains: seed, mesh, domain, what sees it, random numbers.
fn each_domain(mut test: impl FnMut(u64, &Plane, &Domain, &Sight<'_>, &mut Random)) {
    for seed in 0..SEEN {
        let Some((plane, options)) = fuzz::draw(seed) else { continue };
        let domain = Domain::new(&plane.points, &facet_rows(&plane), options.cos_feature).expect("a legal mesh");
        test(seed, &plane, &domain, &Sight::new(&domain), &mut Random::new(seed));
    }
}

#[test]
fn what_lies_at_a_point_is_what_the_cell_there_says() {
    let mut count = [0; 2];
    each_domain(|seed, plane, domain, sight, random| {
        let ((eye, _), mut last) = (middle(plane, &plane.cells[0]), Seen::default());
        for x in points_of(plane, domain, random) {
            // with a few near by, which may be known from the one before
            let mut near = |step: f64| [0, 1].map(|k| x[k] + step * random.between(-1.0, 1.0));
            for x in [x, near(1e-3), near(1e-2), near(1e-1)] {
                let Some(expected) = held(plane, &x) else { continue };
                assert_eq!(sight.look(&eye, &x, |_| false, &mut last), expected, "seed {seed} at {x:?}");
                count[usize::from(expected.is_some())] += 1;
            }
        }
    });
    assert!(count.iter().all(|&count| count > 1000), "{count:?}");
}

#[test]
fn behind_closed_holes_lies_what_a_line_of_sight_tells() {
    let mut count = [0; 2];
    each_domain(|seed, plane, domain, sight, random| {
        let is_gone: Vec<bool> =
            (0..domain.chains.len() as u32).map(|c| domain.is_hole(c) && random.chance(0.9)).collect();
        let mut last = Seen::default();
        for x in points_of(plane, domain, random) {
            let (eye, is_inside) = middle(plane, &plane.cells[random.below(plane.cells.len())]);
            let Some(is_turned) = is_turned(domain, &eye, &x, &is_gone).filter(|_| is_inside) else { continue };
            let seen = sight.look(&eye, &x, |c| is_gone[c as usize], &mut last);
            assert_eq!(seen.is_some(), !is_turned, "seed {seed} at {x:?} from {eye:?}");
            count[usize::from(held(plane, &x) == Some(None) && !is_turned)] += 1;
        }
    });
    assert!(count.iter().all(|&count| count > 50), "{count:?}");
}

#[test]
fn an_island_in_a_closed_hole_is_no_part_of_what_is_around_it() {
    // a ring of tag 1 around a hole, and in it an island of tag 2
    let square = |r: f64| [[-r, -r], [r, -r], [r, r], [-r, r]];
    let points: Vec<Point<2>> = [4.0, 2.0, 1.0].into_iter().flat_map(square).collect();
    let ring = (0..4).flat_map(|k| [[k, (k + 1) % 4, 4 + (k + 1) % 4], [k, 4 + (k + 1) % 4, 4 + k]]);
    let cells: Vec<[u32; 3]> = ring.chain([[8, 9, 10], [8, 10, 11]]).collect();
    let tags = (0..10).map(|t| if t < 8 { 1 } else { 2 }).collect();
    let plane = Plane { points, cells, tags, given: Vec::new() };
    let domain = Domain::new(&plane.points, &facet_rows(&plane), 0.5).expect("a legal mesh");
    let sight = Sight::new(&domain);
    let places = [[3.1, 0.3], [1.4, 0.3], [0.4, 0.3], [0.1, 1.4], [0.1, 9.0]];
    let seen = |eye: usize, closed: bool| {
        places.map(|x| sight.look(&places[eye], &x, |c| closed && domain.is_hole(c), &mut Seen::default()))
    };
    for eye in [0, 2] {
        assert_eq!(seen(eye, false), [Some(1), None, Some(2), None, None]);
    }
    assert_eq!(seen(0, true), [Some(1), Some(1), None, Some(1), None]);
    assert_eq!(seen(2, true), [None, None, Some(2), None, None]);
}
