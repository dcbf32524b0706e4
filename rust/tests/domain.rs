//! Chains, corners and chords of real domains, and random domains by the thousand.

mod fuzz;

/// Draws of the random test: about half are legal meshes with levels of the whole domain.
const DRAWS: u64 = 4000;
const FIRST_SEED: u64 = 1;

#[test]
fn levels_of_two_thousand_random_domains_are_valid() {
    let mut legal = 0;
    for seed in FIRST_SEED..FIRST_SEED + DRAWS {
        let Some((plane, options)) = fuzz::draw(seed) else { continue };
        if options.drop != _core::hierarchy::Drop::Never {
            continue;
        }
        legal += 1;
        assert_eq!(fuzz::failure(&plane, options), None, "seed {seed}: {options:?}");
    }
    assert!(legal >= 2000, "only {legal} legal draws");
}
