//! Sums over as many of the latest rows as a patch has, updated row by row.
//!
//! They are sums of sums of two and of four rows: always the same additions, wherever the first row lies, so that a weight does
//! not depend on where a tile or an image begins.

use crate::simd::{apply, multiversioned};

/// Sums over the latest rows.
pub struct RowSums {
    latest: Vec<f32>,
    /// Of the latest rows and those before: the sums of two rows that end there, and of four.
    pairs: [Vec<f32>; 3],
    fours: [Vec<f32>; 4],
    sum: Vec<f32>,
}

impl RowSums {
    pub fn new(length: usize) -> Self {
        let row = || vec![0.0; length];
        let (pairs, fours) = (std::array::from_fn(|_| row()), std::array::from_fn(|_| row()));
        Self { latest: row(), pairs, fours, sum: row() }
    }

    /// Returns the sums.
    pub fn sum(&self) -> &[f32] {
        &self.sum
    }

    /// Adds a row, the `k`-th. The sums are complete when a patch of rows has been added, whatever was added before.
    pub fn add<const PATCH: usize>(&mut self, k: usize, row: &[f32]) {
        const { assert!(PATCH == 1 || PATCH == 3, "patches of three or seven rows") };
        let at = |ago: usize, rows: usize| (k + rows - ago) % rows;
        let indices = [at(0, 3), at(1, 3), at(2, 3)];
        let [pair, pair_1, pair_2] = self.pairs.get_disjoint_mut(indices).expect("three different rows");
        let [four, four_3] = self.fours.get_disjoint_mut([at(0, 4), at(3, 4)]).expect("two different rows");
        add_row::<PATCH>(row, &mut self.latest, [pair, pair_1, pair_2], [four, four_3], &mut self.sum);
    }
}

/// Adds a row to the sums of [`RowSums`]: `pairs` of the row, the one before and the one before that; `fours` of the row and of
/// the one three before.
#[apply(multiversioned!)]
fn add_row<const PATCH: usize>(
    row: &[f32],
    latest: &mut [f32],
    pairs: [&mut Vec<f32>; 3],
    fours: [&mut Vec<f32>; 2],
    sum: &mut [f32],
) {
    let n = row.len();
    let ([pair, pair_1, pair_2], [four, four_3]) = (pairs, fours);
    let (latest, sum) = (&mut latest[..n], &mut sum[..n]);
    let (pair, pair_1, pair_2) = (&mut pair[..n], &pair_1[..n], &pair_2[..n]);
    let (four, four_3) = (&mut four[..n], &four_3[..n]);
    for x in 0..n {
        let two = latest[x] + row[x];
        latest[x] = row[x];
        pair[x] = two;
        if PATCH == 3 {
            four[x] = pair_2[x] + two;
            sum[x] = four_3[x] + pair_1[x] + row[x];
        } else {
            sum[x] = pair_1[x] + row[x];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sums of the rows that end at each row.
    fn sums<const PATCH: usize>(values: &[f32]) -> Vec<f32> {
        let mut sums = RowSums::new(1);
        let sum = |(k, &value): (usize, &f32)| {
            sums.add::<PATCH>(k, &[value]);
            sums.sum()[0]
        };
        values.iter().enumerate().map(sum).collect()
    }

    #[test]
    fn sums_are_of_the_latest_rows_and_do_not_depend_on_the_first() {
        let values: Vec<f32> = (0..40).map(|k| 1.0 / (1.0 + (k * 37 % 23) as f32)).collect();
        for (rows, sums) in [(3, sums::<1> as fn(&[f32]) -> Vec<f32>), (7, sums::<3>)] {
            let whole = sums(&values);
            for (k, &found) in whole.iter().enumerate().skip(rows - 1) {
                let expected: f32 = values[k + 1 - rows..=k].iter().sum();
                assert!((found - expected).abs() < 1e-6, "{rows} {k}");
            }
            for start in 1..9 {
                let part = sums(&values[start..]);
                assert_eq!(part[rows - 1..], whole[start + rows - 1..], "{rows} {start}");
            }
        }
    }
}
