//! The facet vertices of all levels that drop features, known before any interior node.

use super::select::select_facets;
use crate::error::Error;
use crate::hierarchy::{Builder, MAX_LEVELS};

/// Facet vertices are thinned until a coarsest level has this many cells for each.
const FEW: usize = 16;

/// The first level from `first` on that is coarse enough, searched for from a guess on: levels get coarser.
pub fn first_enough(
    first: usize,
    guess: usize,
    mut is_enough: impl FnMut(usize) -> Result<bool, Error>,
) -> Result<usize, Error> {
    let mut level = guess;
    if is_enough(level)? {
        while level > first && is_enough(level - 1)? {
            level -= 1;
        }
    } else {
        while level < MAX_LEVELS && !is_enough(level)? {
            level += 1;
        }
    }
    Ok(level)
}

impl Builder<'_> {
    /// Selects the facet vertices of levels `first` to `last` (until hardly any are left where that is open), coarsest level
    /// first and all before any interior node: a level then has what the coarser ones need, also where it is drawn from
    /// few nodes. Returns those of level `first`.
    pub(crate) fn plan_facets(&mut self, first: usize, last: Option<usize>) -> Result<Vec<bool>, Error> {
        let facets = self.domain.len();
        let pool = self.pools[0].subset(&(0..facets as u32).collect::<Vec<_>>(), 0);
        let parts = self.parts();
        let select = |i: usize, seeds: &[bool]| -> Result<Vec<bool>, Error> {
            let f = self.spacing_in(i, &pool)?;
            select_facets(self.domain, &pool.candidates, &f, seeds, self.terms(&parts), self.progress)
        };
        let few = (self.options.coarsest / FEW).max(3);
        let last = match last {
            Some(last) => last,
            None => {
                let is_about = |&i: &usize| facets as f64 <= few as f64 * self.factor(i);
                let guess = (first..MAX_LEVELS).find(is_about).unwrap_or(MAX_LEVELS);
                first_enough(first, guess, |i| Ok(select(i, &[])?.into_iter().filter(|&kept| kept).count() <= few))?
            }
        };
        let (mut kept, mut levels) = (Vec::new(), Vec::new());
        for i in (first..=last).rev() {
            kept = select(i, if self.options.nested { &kept } else { &[] })?;
            levels.push((i, kept.clone()));
        }
        levels.reverse();
        self.facets = levels;
        Ok(kept)
    }

    /// The facet vertices of a level that drops features.
    pub(super) fn facets_at(&self, i: usize) -> Vec<bool> {
        let k = self.facets.partition_point(|at| at.0 < i);
        self.facets.get(k).or(self.facets.last()).map_or_else(Vec::new, |at| at.1.clone())
    }
}
