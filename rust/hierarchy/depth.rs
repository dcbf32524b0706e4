//! How deep a hierarchy of open depth is.

use super::{Builder, MAX_LEVELS, STALL, Stopped};
use crate::error::Error;
use crate::level::Choice;

impl Builder<'_> {
    /// A depth to begin a search with: pools tell it without a selection on the fine levels.
    pub(crate) fn roughly(&mut self) -> Result<usize, Error> {
        let mut depth = 1;
        if self.options.pool {
            // a pool of interior nodes holds about C^2m nodes for each of its level
            let share = self.factor(2 * self.lag);
            loop {
                let p = self.pool_for(depth)?;
                let facets = self.domain.len();
                let now = self.pools[p].len() - facets;
                let before = self.pools[p.saturating_sub(1)].len() - facets;
                let is_stalled = p > 0 && now as f64 > STALL * before as f64;
                if now as f64 <= share * self.options.coarsest as f64 || is_stalled || depth == MAX_LEVELS {
                    break;
                }
                depth += 1;
            }
        }
        Ok(depth)
    }

    /// The depth of a hierarchy of open depth, and why it ends there.
    pub(super) fn depth(&mut self) -> Result<(usize, Stopped), Error> {
        let coarsest = self.options.coarsest;
        let mut sizes = vec![self.input.cells.len()];
        let mut depth = self.roughly()?;
        let mut size = |builder: &mut Self, i: usize| -> Result<usize, Error> {
            sizes.resize(sizes.len().max(i + 1), usize::MAX);
            if sizes[i] == usize::MAX {
                sizes[i] = {
                    let chosen = builder.choose(i, &Choice::default())?;
                    builder.n_cells(&chosen.choice)
                };
            }
            Ok(sizes[i])
        };
        while depth > 1 {
            let (now, before) = (size(self, depth)?, size(self, depth - 1)?);
            if before > coarsest && (now as f64) <= STALL * before as f64 {
                break;
            }
            depth -= 1;
        }
        loop {
            let now = size(self, depth)?;
            if now <= coarsest {
                return Ok((depth, Stopped::Coarsest));
            }
            if depth == MAX_LEVELS || size(self, depth + 1)? as f64 > STALL * now as f64 {
                // not even the first level may be worth having
                let worth = depth > 1 || now as f64 <= STALL * self.input.cells.len() as f64;
                return Ok((if worth { depth } else { 0 }, Stopped::Stalled));
            }
            depth += 1;
        }
    }
}
