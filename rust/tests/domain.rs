//! Chains, corners and chords of real domains, and random domains by the thousand.

mod fuzz;

/// Draws of the random test: about three in four are legal meshes.
const DRAWS: u64 = 2700;
const FIRST_SEED: u64 = 1;

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
