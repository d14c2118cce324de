//! Mean and variance of each dimension over the cluster of every pixel (paper, Eqs. 1 and 3).
//!
//! Takes the pixels' statistics and the window of a pass. The statistics come from a regular subset of the window's
//! rows and columns.

use rayon::prelude::*;

use super::feature_guide::{FeatureGuide, meets_alike};
use crate::filter::cancellable_pool::stop_if_cancelled;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::filter::common::lanes::lanes;
use crate::simd::{LANES, Lanes, apply, multiversioned};

/// Statistics over the clusters of one pass.
#[derive(Debug)]
pub struct Neighbourhood {
    dims: usize,
    /// Means of all dimensions, then variances.
    planes: InterleavedPlanes,
}

impl Neighbourhood {
    /// Computes the statistics from at most `side` columns and rows of each window.
    pub fn new(guide: &FeatureGuide, window: usize, side: usize) -> Self {
        let dims = guide.means.count();
        let offsets = offsets(window, side);
        let mut planes = InterleavedPlanes::new(guide.width(), guide.height(), 2 * dims, 0, 0.0);
        let row_len = planes.row_len();
        planes.data_mut().par_chunks_mut(row_len).enumerate().for_each_init(Vec::new, |similar, (y, out)| {
            stop_if_cancelled();
            compute_row(guide, &offsets, y, similar, out);
        });
        Self { dims, planes }
    }

    /// Means of dimension `k` in row `y`.
    pub fn means(&self, k: usize, y: usize) -> &[f32] {
        self.planes.row(k, y)
    }

    /// Variances of dimension `k` in row `y`.
    pub fn variances(&self, k: usize, y: usize) -> &[f32] {
        self.planes.row(self.dims + k, y)
    }

    /// Variances of dimension `k` of the [`LANES`] pixels of row `y` from `x` on, a multiple of [`LANES`].
    pub fn variance_lanes(&self, k: usize, x: usize, y: usize) -> &Lanes {
        self.planes.lanes(self.dims + k, y, x)
    }

    pub fn mean(&self, k: usize, x: usize, y: usize) -> f32 {
        self.planes.at(k, x, y)
    }

    pub fn variance(&self, k: usize, x: usize, y: usize) -> f32 {
        self.planes.at(self.dims + k, x, y)
    }
}

/// At most `side` evenly spaced offsets along one axis of a window, including the centre and both ends.
fn offsets(window: usize, side: usize) -> Vec<isize> {
    let radius = (window / 2) as isize;
    let steps = ((side / 2) as isize).min(radius);
    if steps == 0 {
        return vec![0];
    }
    (-steps..=steps).map(|t| (t as f32 * radius as f32 / steps as f32).round() as isize).collect()
}

/// Writes the means and variances of one row. `similar` is scratch memory.
#[apply(multiversioned!)]
fn compute_row(guide: &FeatureGuide, offsets: &[isize], y: usize, similar: &mut Vec<Lanes>, out: &mut [f32]) {
    let dims = guide.means.count();
    let stride = out.len() / (2 * dims);
    let rows: Vec<usize> =
        offsets.iter().filter_map(|&d| y.checked_add_signed(d)).filter(|&yj| yj < guide.height()).collect();
    let mut centre = Vec::with_capacity(guide.features());
    for x in (0..guide.width()).step_by(LANES) {
        centre.clear();
        centre.extend(
            (0..guide.features()).map(|k| (*guide.means.lanes(k, y, x), *guide.thresholds.lanes(k, y, x))),
        );
        let columns = offsets.iter().map(|&d| (guide.means.margin() + x).wrapping_add_signed(d));

        // Find similar pixels; a second loop sums, so that each dimension's sums stay in registers
        similar.clear();
        let mut total = [0.0; LANES];
        let own_hit = *guide.own_hit.lanes(0, y, x);
        let takes_emission = *guide.takes_emission.lanes(0, y, x);
        for &yj in &rows {
            for xj in columns.clone() {
                let [hits, met_emitter] =
                    [&guide.hit, &guide.met_emitter].map(|plane| lanes(&plane.row_with_margins(0, yj)[xj..]));
                let mut flags: Lanes = std::array::from_fn(|l| {
                    let is_alike = meets_alike([own_hit[l], takes_emission[l]], [hits[l], met_emitter[l]]);
                    if is_alike { 1.0 } else { 0.0 }
                });
                for ((own, threshold), others) in centre.iter().zip(guide.means.row_planes(yj, xj)) {
                    clear_dissimilar(&mut flags, own, lanes(others), threshold);
                }
                for l in 0..LANES {
                    total[l] += flags[l];
                }
                similar.push(flags);
            }
        }

        // Compute mean and variance of each dimension
        for k in 0..dims {
            let own = *guide.means.lanes(k, y, x);
            let (mut sum, mut squares) = ([0.0; LANES], [0.0; LANES]);
            let mut flags = similar.iter();
            for &yj in &rows {
                let means = guide.means.row_with_margins(k, yj);
                let within = guide.within.row_with_margins(k, yj);
                for (xj, flags) in columns.clone().zip(&mut flags) {
                    add_pixel(&mut sum, &mut squares, &own, lanes(&means[xj..]), lanes(&within[xj..]), flags);
                }
            }
            for l in 0..LANES {
                let n = total[l].max(1.0);
                let shift = sum[l] / n;
                out[k * stride + x + l] = own[l] + shift;
                out[(dims + k) * stride + x + l] = (squares[l] / n - shift * shift).max(0.0);
            }
        }
    }
}

/// Clears the flags of pixels whose squared difference exceeds the threshold.
#[inline(always)]
fn clear_dissimilar(flags: &mut Lanes, own: &Lanes, others: &Lanes, threshold: &Lanes) {
    for l in 0..LANES {
        let d = own[l] - others[l];
        flags[l] = if d * d <= threshold[l] { flags[l] } else { 0.0 };
    }
}

/// Adds the mean and mean square of flagged pixels, both relative to `own`, which avoids cancellation far from 0.
#[inline(always)]
fn add_pixel(
    sum: &mut Lanes,
    squares: &mut Lanes,
    own: &Lanes,
    means: &Lanes,
    within: &Lanes,
    flags: &Lanes,
) {
    for l in 0..LANES {
        let d = means[l] - own[l];
        sum[l] += flags[l] * d;
        squares[l] += flags[l] * (d * d + within[l]);
    }
}

#[cfg(test)]
mod tests;
