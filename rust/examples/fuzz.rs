//! Tries the hierarchy on random domains: `cargo run --release --no-default-features --example fuzz -- SEED COUNT`.
//!
//! Prints each failure as a mesh made small, and how many domains there were. A third argument `-v` prints every draw's size and options; `-n`
//! leaves failures as they were drawn.

#[path = "../tests/fuzz/mod.rs"]
mod fuzz;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, default: u64| arguments.get(k).and_then(|text| text.parse().ok()).unwrap_or(default);
    let (first, count) = (number(0, 1), number(1, 1000));
    let has = |flag: &str| arguments.iter().any(|text| text == flag);
    let (verbose, as_drawn) = (has("-v"), has("-n"));
    std::panic::set_hook(Box::new(|_| {}));
    let at = Arc::new(AtomicU64::new(first));
    watch(at.clone());
    let (mut legal, mut levels) = (0u64, BTreeMap::<String, (u64, u64)>::new());
    let begun = Instant::now();
    for seed in first..first + count {
        at.store(seed, Ordering::Relaxed);
        let Some((plane, options)) = fuzz::draw(seed) else { continue };
        legal += 1;
        let from = Instant::now();
        if verbose {
            println!("{seed}: {} nodes, {} cells, {options:?}", plane.points.len(), plane.cells.len());
        }
        let failure = fuzz::failure(&plane, options);
        if verbose {
            println!("  {:?}", from.elapsed());
        }
        let Some(text) = failure else { continue };
        let rule = fuzz::shrink::rule(&text);
        let entry = levels.entry(rule).or_insert((0, seed));
        entry.0 += 1;
        if entry.0 > 2 {
            continue;
        }
        println!("seed {seed}: {} nodes: {text}", plane.points.len());
        if !as_drawn && !text.starts_with("slow") {
            let (small, options) = fuzz::shrink::shrink(plane, options);
            let text = fuzz::failure(&small, options).unwrap_or_default();
            println!("  small: {text}\n  points: {:?}\n  cells: {:?}", small.points, small.cells);
            println!("  tags: {:?}\n  given: {:?}\n  options: {options:?}", small.tags, small.given);
        }
    }
    println!("{legal} legal domains of {count} draws from seed {first} in {:?}", begun.elapsed());
    levels.iter().for_each(|(rule, (n, seed))| println!("  {n} x {rule} (first: seed {seed})"));
    std::process::exit(i32::from(!levels.is_empty()));
}

/// Ends the run where one domain takes longer than a minute (shrinking included).
fn watch(at: Arc<AtomicU64>) {
    std::thread::spawn(move || {
        let mut last = (0, Instant::now());
        loop {
            std::thread::sleep(Duration::from_millis(200));
            let seed = at.load(Ordering::Relaxed);
            if seed != last.0 {
                last = (seed, Instant::now());
            } else if last.1.elapsed().as_secs() > 60 {
                println!("seed {seed}: hangs");
                std::process::exit(3);
            }
        }
    });
}
