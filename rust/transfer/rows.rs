//! Compressed sparse rows.

use crate::error::Error;
use rayon::prelude::*;

/// Rows that one thread copies at a time.
const CHUNK: usize = 4096;

/// A matrix by rows, columns ascending in each, indices as SciPy takes them without a copy.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    /// Number of columns.
    pub columns: usize,
    /// Where each row starts, and the end of the last.
    pub indptr: Vec<i32>,
    /// Column of each entry.
    pub indices: Vec<i32>,
    /// Value of each entry.
    pub data: Vec<f64>,
}

/// The same, borrowed; `columns` bounds the indices.
#[derive(Debug, Clone, Copy)]
pub struct RowsRef<'a> {
    /// Number of columns.
    pub columns: usize,
    /// Where each row starts, and the end of the last.
    pub indptr: &'a [i32],
    /// Column of each entry.
    pub indices: &'a [i32],
    /// Value of each entry.
    pub data: &'a [f64],
}

impl Rows {
    /// Borrows it.
    pub fn view(&self) -> RowsRef<'_> {
        RowsRef { columns: self.columns, indptr: &self.indptr, indices: &self.indices, data: &self.data }
    }

    /// The sums of counts, as starts of rows.
    pub fn starts(counts: impl Iterator<Item = usize>) -> Result<Vec<i32>, Error> {
        let mut sum = 0i32;
        let mut indptr = vec![0];
        for count in counts {
            let more = i32::try_from(count).ok().and_then(|count| sum.checked_add(count));
            sum = more.ok_or_else(|| Error::Argument("the matrix has 2**31 or more entries".into()))?;
            indptr.push(sum);
        }
        Ok(indptr)
    }

    /// One matrix of blocks of rows, each given by its counts, columns and values.
    pub fn stacked(columns: usize, mut blocks: Vec<Block>) -> Result<Rows, Error> {
        let indptr = Self::starts(blocks.iter().flat_map(|block| block.counts.iter().map(|&count| count as usize)))?;
        if blocks.len() == 1 {
            let Block { indices, data, .. } = blocks.remove(0);
            return Ok(Rows { columns, indptr, indices, data });
        }
        let entries = indptr[indptr.len() - 1] as usize;
        let (mut indices, mut data) = (vec![0; entries], vec![0.0; entries]);
        let sizes: Vec<usize> = blocks.iter().map(|block| block.indices.len()).collect();
        let places = parts(&mut indices, &sizes).into_par_iter().zip(parts(&mut data, &sizes));
        places.zip(blocks).for_each(|((indices, data), block)| {
            indices.copy_from_slice(&block.indices);
            data.copy_from_slice(&block.data);
        });
        Ok(Rows { columns, indptr, indices, data })
    }

    /// Without the entries that are marked.
    pub fn without(self, gone: &[bool]) -> Result<Rows, Error> {
        let row = |i: usize| self.indptr[i] as usize..self.indptr[i + 1] as usize;
        let rows = (0..self.indptr.len() - 1).into_par_iter().with_min_len(CHUNK);
        let counts: Vec<usize> = rows.map(|i| gone[row(i)].iter().filter(|gone| !**gone).count()).collect();
        let indptr = Self::starts(counts.iter().copied())?;
        let entries = indptr[indptr.len() - 1] as usize;
        let (mut indices, mut data) = (vec![0; entries], vec![0.0; entries]);
        let sizes: Vec<usize> = counts.chunks(CHUNK).map(|counts| counts.iter().sum()).collect();
        let places = parts(&mut indices, &sizes).into_par_iter().zip(parts(&mut data, &sizes));
        places.enumerate().for_each(|(chunk, (indices, data))| {
            let rows = chunk * CHUNK..((chunk + 1) * CHUNK).min(counts.len());
            let kept = (row(rows.start).start..row(rows.end - 1).end).filter(|&at| !gone[at]);
            for (at, (index, value)) in kept.zip(indices.iter_mut().zip(data)) {
                (*index, *value) = (self.indices[at], self.data[at]);
            }
        });
        Ok(Rows { columns: self.columns, indptr, indices, data })
    }
}

/// A slice in parts of given sizes.
pub fn parts<'a, T>(mut rest: &'a mut [T], sizes: &[usize]) -> Vec<&'a mut [T]> {
    let cut = |&size: &usize| {
        let (part, more) = std::mem::take(&mut rest).split_at_mut(size);
        rest = more;
        part
    };
    sizes.iter().map(cut).collect()
}

/// Some rows of a matrix in the making.
#[derive(Debug, Default, Clone)]
pub struct Block {
    /// Entries of each row.
    pub counts: Vec<u32>,
    /// Columns.
    pub indices: Vec<i32>,
    /// Values.
    pub data: Vec<f64>,
}

impl Block {
    /// Takes all rows out; the memory stays.
    pub fn clear(&mut self) {
        self.counts.clear();
        self.indices.clear();
        self.data.clear();
    }
}

impl<'a> RowsRef<'a> {
    /// Checks what the multiplication relies on.
    pub fn checked(
        name: &str,
        columns: usize,
        indptr: &'a [i32],
        indices: &'a [i32],
        data: &'a [f64],
    ) -> Result<Self, Error> {
        let wrong = |what: &str| Err(Error::Argument(format!("'{name}' is no matrix by rows: {what}")));
        if indptr.first() != Some(&0) || indptr.windows(2).fold(false, |wrong, pair| wrong | (pair[0] > pair[1])) {
            return wrong("its row starts do not ascend from 0");
        }
        if indptr[indptr.len() - 1] as usize != indices.len() || indices.len() != data.len() {
            return wrong("its arrays differ in length");
        }
        // negative ones are the greatest here; without a branch, for long arrays
        if indices.iter().fold(0, |most, &j| most.max(j as u32)) as usize >= columns && !indices.is_empty() {
            return wrong("a column is out of range");
        }
        Ok(Self { columns, indptr, indices, data })
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.indptr.len() - 1
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Columns and values of row `i`.
    #[inline(always)]
    pub fn row(&self, i: usize) -> (&'a [i32], &'a [f64]) {
        let range = self.indptr[i] as usize..self.indptr[i + 1] as usize;
        (&self.indices[range.clone()], &self.data[range])
    }

    /// The entry in row `i` and column `j`, 0 where there is none; columns may be in any order.
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        let (columns, values) = self.row(i);
        columns.iter().position(|&k| k as usize == j).map_or(0.0, |k| values[k])
    }

    /// The transpose. Runtime: O(entries), one thread.
    pub fn transposed(&self) -> Rows {
        let mut indptr = vec![0i32; self.columns + 1];
        for &j in self.indices {
            indptr[j as usize + 1] += 1;
        }
        for j in 0..self.columns {
            indptr[j + 1] += indptr[j];
        }
        let mut place = indptr.clone();
        let mut indices = vec![0; self.indices.len()];
        let mut data = vec![0.0; self.data.len()];
        for i in 0..self.len() {
            let (columns, values) = self.row(i);
            for (&j, &value) in columns.iter().zip(values) {
                let at = &mut place[j as usize];
                indices[*at as usize] = i as i32;
                data[*at as usize] = value;
                *at += 1;
            }
        }
        Rows { columns: self.len(), indptr, indices, data }
    }
}
