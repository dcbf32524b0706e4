//! Compressed sparse rows.

use crate::error::Error;

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
    pub fn stacked(columns: usize, blocks: Vec<Block>) -> Result<Rows, Error> {
        let indptr = Self::starts(blocks.iter().flat_map(|block| block.counts.iter().map(|&count| count as usize)))?;
        let entries = indptr[indptr.len() - 1] as usize;
        let mut indices = Vec::with_capacity(entries);
        let mut data = Vec::with_capacity(entries);
        for mut block in blocks {
            indices.append(&mut block.indices);
            data.append(&mut block.data);
        }
        Ok(Rows { columns, indptr, indices, data })
    }

    /// Without the entries that are marked.
    pub fn without(self, gone: &[bool]) -> Result<Rows, Error> {
        let kept = |i: usize| gone[self.indptr[i] as usize..self.indptr[i + 1] as usize].iter().filter(|gone| !**gone);
        let indptr = Self::starts((0..self.indptr.len() - 1).map(|i| kept(i).count()))?;
        let stays = |at: &usize| !gone[*at];
        let indices = (0..gone.len()).filter(stays).map(|at| self.indices[at]).collect();
        let data = (0..gone.len()).filter(stays).map(|at| self.data[at]).collect();
        Ok(Rows { columns: self.columns, indptr, indices, data })
    }
}

/// Some rows of a matrix in the making.
#[derive(Debug, Default)]
pub struct Block {
    /// Entries of each row.
    pub counts: Vec<u32>,
    /// Columns.
    pub indices: Vec<i32>,
    /// Values.
    pub data: Vec<f64>,
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
        if indptr.first() != Some(&0) || indptr.windows(2).any(|pair| pair[0] > pair[1]) {
            return wrong("its row starts do not ascend from 0");
        }
        if indptr[indptr.len() - 1] as usize != indices.len() || indices.len() != data.len() {
            return wrong("its arrays differ in length");
        }
        if indices.iter().any(|&j| j < 0 || j as usize >= columns) {
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
