//! Numbers that remain where a few are taken out.

/// What remains of 0, 1, 2 and so on without some (ascending, none twice), from the `first`-th (from 0) on.
pub fn remaining_from(gone: &[u32], first: usize) -> impl Iterator<Item = usize> + '_ {
    // those before a remaining number that are gone: as many as have at most so many remaining before them
    let is_before = move |j: usize, k: usize| j < gone.len() && gone[j] as usize - j <= k;
    let (mut passed, mut end) = (0, gone.len());
    while passed < end {
        let middle = passed.midpoint(end);
        if is_before(middle, first) {
            passed = middle + 1;
        } else {
            end = middle;
        }
    }
    (first..).map(move |k| {
        while is_before(passed, k) {
            passed += 1;
        }
        k + passed
    })
}

#[cfg(test)]
mod tests {
    use super::remaining_from;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn remaining_numbers_are_those_not_gone(gone: BTreeSet<u8>, first in 0..300usize) {
            let gone: Vec<u32> = gone.into_iter().map(u32::from).collect();
            let all = (0..).filter(|i| !gone.contains(&(*i as u32))).skip(first);
            prop_assert!(remaining_from(&gone, first).take(40).eq(all.take(40)));
        }
    }
}
