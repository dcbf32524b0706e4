//! The parts on their own: `cargo bench --no-default-features` (one thread: `RAYON_NUM_THREADS=1`).
//!
//! Two inputs, made by the formulas of `inputs.py`: a jittered lattice, and a quarter of an annulus whose edges span a
//! ratio of 1e4, both in rows and shuffled.

#![allow(missing_docs, reason = "criterion's macros make functions without any")]

use _core::kdtree::KdTree;
use _core::point::Point;
use _core::progress::Progress;
use _core::quadtree;
use _core::selection::{conflict_graph, greedy};
use _core::spacing::{CoarseSpacing, nearest};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;

const SIDE: usize = 500;
const JITTER: f64 = 0.2;
const RATIO: f64 = 1e4;
const GRADATION: f64 = 0.5;
const BETA: f64 = 2.0;

/// Numbers in [0, 1) that look random and are the same everywhere.
fn scattered(i: usize) -> f64 {
    let x = (i as u64).wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 32)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    ((x ^ (x >> 32)) >> 11) as f64 / (1u64 << 53) as f64
}

fn lattice(columns: usize, rows: usize) -> Vec<Point<2>> {
    let jittered = |i: usize, k: usize| i as f64 + JITTER * (2.0 * scattered(k) - 1.0);
    (0..columns * rows).map(|i| [jittered(i % columns, 2 * i), jittered(i / columns, 2 * i + 1)]).collect()
}

fn graded(n: usize) -> Vec<Point<2>> {
    let turn = std::f64::consts::FRAC_PI_2;
    let rows = (n as f64 * turn / RATIO.ln()).sqrt() as usize;
    let step = turn / rows as f64;
    let on_annulus = |[r, t]: Point<2>| [(r * step).exp() * (t * step).cos(), (r * step).exp() * (t * step).sin()];
    lattice(n / rows, rows).into_iter().map(on_annulus).collect()
}

fn shuffled(mut points: Vec<Point<2>>) -> Vec<Point<2>> {
    for i in (1..points.len()).rev() {
        points.swap(i, (scattered(i) * (i + 1) as f64) as usize);
    }
    points
}

fn parts(criterion: &mut Criterion) {
    let progress = Progress::default();
    let n = SIDE * SIDE;
    let inputs = [
        ("a lattice", lattice(SIDE, SIDE)),
        ("a shuffled lattice", shuffled(lattice(SIDE, SIDE))),
        ("a graded annulus", graded(n)),
    ];
    let mut group = criterion.benchmark_group("a quarter of a million points");
    group.sample_size(20);
    for (name, points) in &inputs {
        group.throughput(Throughput::Elements(points.len() as u64));
        let tree = KdTree::new(points);
        let g = nearest(&tree, &progress).expect("nobody stops it");
        let spacing = CoarseSpacing::new(&tree, &g, None, GRADATION);
        let bench = |what: &str| BenchmarkId::new(what, name);

        group.bench_function(bench("build the tree of"), |b| b.iter(|| KdTree::new(black_box(points))));
        group.bench_function(bench("find all nearest neighbours in"), |b| b.iter(|| nearest(&tree, &progress)));
        for factor in [2.0, 16.0, 512.0] {
            group.bench_function(bench(&format!("coarsen the spacing by {factor} on")), |b| {
                b.iter(|| spacing.at_points(factor, &progress));
            });
            let f = spacing.at_points(factor, &progress).expect("nobody stops it");
            let mut order: Vec<u32> = (0..points.len() as u32).collect();
            order.sort_by(|&a, &b| f[b as usize].total_cmp(&f[a as usize]));
            group.bench_function(bench(&format!("select greedily by {factor} from")), |b| {
                b.iter(|| greedy(&tree, &f, BETA, &order, &[], &progress));
            });
            if factor == 2.0 {
                group.bench_function(bench("build the conflict graph by 2 of"), |b| {
                    b.iter(|| conflict_graph(&tree, &f, BETA, &progress));
                });
            }
        }
        group.bench_function(bench("measure the quadtree of"), |b| {
            b.iter(|| quadtree::spacing(points, points, &progress));
        });
    }
    group.finish();
}

criterion_group!(benches, parts);
criterion_main!(benches);
