//! Which neighbours resemble a pixel (its cluster P), and the mean and deviation of each dimension
//! over them (paper, section 4.1, Eqs. 1 to 3).

use multiversion::multiversion;
use rayon::prelude::*;

use super::padded::{LANES, Padded};
use super::prpf::PrpfSettings;
use crate::image::Planes;
use crate::stats::{Block, Feature, Part, Store};

/// What all passes measure distances by: the pixels' original means and deviations. Dimensions are
/// the features, then three colours.
#[derive(Debug)]
pub(super) struct Guide {
    /// Layout indices of the features.
    dims: Vec<usize>,
    /// Pixel means.
    pub means: Padded,
    /// Variances of the samples of a pixel, pooled with its neighbours' so that few samples do.
    pub variances: Padded,
    /// The pixel's own share in the variance over a neighbourhood.
    within: Padded,
    /// Largest squared difference of a feature's means within a cluster.
    pub thresholds: Padded,
    /// How many deviations a feature's means may be apart within a cluster.
    pub tolerances: Vec<f32>,
    /// Samples.
    pub counts: Padded,
    /// Share of samples that hit a surface, as neighbours see it: far off all such shares where
    /// there is no pixel or no sample.
    pub hit: Padded,
    /// The same, as the pixel itself sees it: a pixel without samples resembles all others.
    pub own_hit: Padded,
}

impl Guide {
    /// Pixels on the ground and in the sky never resemble each other; mixed ones resemble both.
    pub const HIT_TOLERANCE: f32 = 0.5;

    /// [`Self::hit`] where there is nothing: further than the tolerance from every share.
    pub const NOTHING: f32 = 4.0;

    /// `colours` are the means and variances of the colours to measure by.
    pub fn new(store: &Store, colours: [Planes; 2], settings: &PrpfSettings) -> Self {
        let (width, height) = (store.width(), store.height());
        let kinds = store.layout().features();
        let dims: Vec<usize> = kinds.iter().map(|&(dim, _)| dim).collect();
        let counts = store.counts(Part::Whole);
        let margin = settings.margin();

        let features = [store.means(Part::Whole, dims.clone()), store.variances(Part::Whole, dims.clone())];
        let [mut means, mut raw] = [0, 1].map(|i| stack(&features[i], &colours[i]));
        let mut variances = raw.clone();
        variances.planes_mut().enumerate().par_bridge().for_each(|(k, out)| {
            pool(out, means.plane(k), raw.plane(k), &counts, width);
        });

        // Eq. 3 wants the samples' own mean square; it can only be had where counts are equal.
        let n = counts.first().map_or(0, |&n| n);
        if n >= 2 && counts.iter().all(|&m| m == n) {
            raw.data_mut().iter_mut().for_each(|v| *v *= (n - 1) as f32 / n as f32);
        } else {
            raw = variances.clone();
        }

        let tolerances = |kind| match kind {
            Feature::WorldPosition => (settings.z_world, settings.tolerance_world),
            Feature::Normal | Feature::Albedo => (settings.z, settings.tolerance),
        };
        let mut thresholds = Planes::new(width, height, dims.len());
        for (k, (out, &(_, kind))) in thresholds.planes_mut().zip(&kinds).enumerate() {
            let (z, least) = tolerances(kind);
            for ((out, &variance), &count) in out.iter_mut().zip(variances.plane(k)).zip(&counts) {
                let least = if variance <= least * least { least * least } else { 0.0 };
                *out = if count == 0 { f32::INFINITY } else { (z * z * variance).max(least) };
            }
        }

        let mut hit = match store.layout().block(Block::Hit) {
            Some(dims) => store.means(Part::Whole, dims),
            None => filled(width, height, 1.0),
        };
        // A share, whatever a store was fed with: what is beyond would resemble what is not there.
        hit.data_mut().iter_mut().for_each(|share| *share = share.clamp(0.0, 1.0));
        let mut own_hit = hit.clone();
        let mut count_plane = Planes::new(width, height, 1);
        for (i, &count) in counts.iter().enumerate() {
            count_plane.data_mut()[i] = count as f32;
            if count == 0 {
                hit.data_mut()[i] = Self::NOTHING;
                own_hit.data_mut()[i] = 0.5;
                // No mean either; 0 is as good as any.
                means.planes_mut().for_each(|plane| plane[i] = 0.0);
            }
        }

        Self {
            dims,
            tolerances: kinds.iter().map(|&(_, kind)| tolerances(kind).0).collect(),
            means: Padded::from_planes(&means, margin, 0.0),
            variances: Padded::from_planes(&variances, margin, 0.0),
            within: Padded::from_planes(&raw, margin, 0.0),
            thresholds: Padded::from_planes(&thresholds, 0, 0.0),
            counts: Padded::from_planes(&count_plane, margin, 0.0),
            hit: Padded::from_planes(&hit, margin, Self::NOTHING),
            own_hit: Padded::from_planes(&own_hit, 0, 0.0),
        }
    }

    pub fn width(&self) -> usize {
        self.means.width()
    }

    pub fn height(&self) -> usize {
        self.means.height()
    }

    /// Number of features.
    pub fn features(&self) -> usize {
        self.dims.len()
    }

    /// Layout indices of the features.
    pub fn feature_dims(&self) -> &[usize] {
        &self.dims
    }

    /// Collects the pixels of a window that resemble the pixel at its centre and have samples, row
    /// by row. The pixel itself is among them if it has samples.
    pub fn cluster(&self, x: usize, y: usize, window: usize, cluster: &mut Vec<(u32, u32)>) {
        let radius = window / 2;
        cluster.clear();
        let (left, right) = (x.saturating_sub(radius), (x + radius).min(self.width() - 1));
        let mut alike = [0; LANES];
        for yj in y.saturating_sub(radius)..=(y + radius).min(self.height() - 1) {
            for start in (left..=right).step_by(LANES) {
                find_alike(self, (x, y), (start, yj), &mut alike);
                for (xj, &alike) in (start..=right).zip(&alike) {
                    if alike != 0 {
                        cluster.push((xj as u32, yj as u32));
                    }
                }
            }
        }
    }

    /// Whether pixel `j` resembles pixel `i`.
    pub fn resembles(&self, i: (usize, usize), j: (usize, usize)) -> bool {
        let tolerated = |k: usize| {
            let d = self.means.at(k, i.0, i.1) - self.means.at(k, j.0, j.1);
            d * d <= self.thresholds.at(k, i.0, i.1)
        };
        let hits = self.own_hit.at(0, i.0, i.1) - self.hit.at(0, j.0, j.1);
        hits.abs() <= Self::HIT_TOLERANCE && (0..self.features()).all(tolerated)
    }
}

/// Flags those of [`LANES`] pixels from `start` on that resemble pixel `i`.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn find_alike(guide: &Guide, i: (usize, usize), start: (usize, usize), alike: &mut [u32; LANES]) {
    let at = guide.means.margin() + start.0;
    let hit = guide.own_hit.at(0, i.0, i.1);
    let hits = &guide.hit.wide(0, start.1)[at..at + LANES];
    for l in 0..LANES {
        alike[l] = u32::from((hit - hits[l]).abs() <= Guide::HIT_TOLERANCE);
    }
    for k in 0..guide.features() {
        let own = guide.means.at(k, i.0, i.1);
        let threshold = guide.thresholds.at(k, i.0, i.1);
        let others = &guide.means.wide(k, start.1)[at..at + LANES];
        for l in 0..LANES {
            let d = own - others[l];
            alike[l] &= u32::from(d * d <= threshold);
        }
    }
}

/// Mean and variance of the samples in each pixel's cluster.
#[derive(Debug)]
pub(super) struct Neighbourhood {
    dims: usize,
    /// Means of all dimensions, then variances.
    planes: Padded,
}

impl Neighbourhood {
    /// `side` columns and rows of the window at most are looked at.
    pub fn new(guide: &Guide, window: usize, side: usize) -> Self {
        let dims = guide.means.count();
        let offsets = offsets(window, side);
        let mut planes = Padded::new(guide.width(), guide.height(), 2 * dims, 0, 0.0);
        let row_len = planes.row_len();
        planes.data_mut().par_chunks_mut(row_len).enumerate().for_each_init(Vec::new, |alike, (y, out)| {
            neighbourhood_row(guide, &offsets, y, alike, out);
        });
        Self { dims, planes }
    }

    pub fn means(&self, k: usize, y: usize) -> &[f32] {
        self.planes.row(k, y)
    }

    pub fn variances(&self, k: usize, y: usize) -> &[f32] {
        self.planes.row(self.dims + k, y)
    }

    pub fn mean(&self, k: usize, x: usize, y: usize) -> f32 {
        self.planes.at(k, x, y)
    }

    pub fn variance(&self, k: usize, x: usize, y: usize) -> f32 {
        self.planes.at(self.dims + k, x, y)
    }
}

/// Offsets along one axis: evenly over the window, the centre and both ends among them.
fn offsets(window: usize, side: usize) -> Vec<isize> {
    let radius = (window / 2) as isize;
    let steps = ((side / 2) as isize).min(radius);
    if steps == 0 {
        return vec![0];
    }
    (-steps..=steps).map(|t| (t as f32 * radius as f32 / steps as f32).round() as isize).collect()
}

/// Writes one row of means, then of variances.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn neighbourhood_row(
    guide: &Guide,
    offsets: &[isize],
    y: usize,
    alike: &mut Vec<[f32; LANES]>,
    out: &mut [f32],
) {
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
        // First who belongs, then the sums, so that each dimension's sums stay in registers.
        alike.clear();
        let mut total = [0.0; LANES];
        let own_hit = *guide.own_hit.lanes(0, y, x);
        for &yj in &rows {
            for xj in columns.clone() {
                let hits = block(&guide.hit.wide(0, yj)[xj..]);
                let mut flags = [1.0; LANES];
                keep_alike(&mut flags, &own_hit, hits, &[Guide::HIT_TOLERANCE.powi(2); LANES]);
                for ((own, threshold), others) in centre.iter().zip(guide.means.from(yj, xj)) {
                    keep_alike(&mut flags, own, block(others), threshold);
                }
                for l in 0..LANES {
                    total[l] += flags[l];
                }
                alike.push(flags);
            }
        }
        for k in 0..dims {
            let own = *guide.means.lanes(k, y, x);
            let (mut sum, mut squares) = ([0.0; LANES], [0.0; LANES]);
            let mut flags = alike.iter();
            for &yj in &rows {
                let (means, within) = (guide.means.wide(k, yj), guide.within.wide(k, yj));
                for (xj, flags) in columns.clone().zip(&mut flags) {
                    add_pixel(&mut sum, &mut squares, &own, block(&means[xj..]), block(&within[xj..]), flags);
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

/// Clears flags where values differ by more than their squared thresholds.
#[inline(always)]
fn keep_alike(flags: &mut Lanes, own: &Lanes, others: &Lanes, threshold: &Lanes) {
    for l in 0..LANES {
        let d = own[l] - others[l];
        flags[l] = if d * d <= threshold[l] { flags[l] } else { 0.0 };
    }
}

/// Adds a flagged pixel's mean and mean square, both from `own`: no cancellation far from 0.
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

type Lanes = [f32; LANES];

#[inline(always)]
fn block(values: &[f32]) -> &Lanes {
    values[..LANES].try_into().expect("the slice has this length")
}

/// Samples that the neighbours' variance counts for beside a pixel's own.
const POOL_WEIGHT: f32 = 2.0;

/// Variance of a pixel's samples from few of them: joined with the mean of the 3×3 neighbours', or
/// where none of those has two samples, with what their means differ by.
fn pool(out: &mut [f32], means: &[f32], variances: &[f32], counts: &[u32], width: usize) {
    let height = means.len() / width.max(1);
    for (i, out) in out.iter_mut().enumerate() {
        let (x, y) = (i % width, i / width);
        let (mut known, mut sum) = (0.0, 0.0);
        let (mut pairs, mut squares) = (0.0, 0.0);
        for yj in y.saturating_sub(1)..=(y + 1).min(height - 1) {
            for xj in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                let j = yj * width + xj;
                if counts[j] >= 2 {
                    known += 1.0;
                    sum += variances[j];
                } else if counts[j] == 1 && j != i {
                    pairs += 1.0;
                    squares += (means[j] - means[i]).powi(2) / 2.0;
                }
            }
        }
        let pool = if known > 0.0 {
            sum / known
        } else if pairs > 0.0 && counts[i] > 0 {
            squares / pairs
        } else {
            0.0
        };
        let own = counts[i].saturating_sub(1) as f32;
        *out = (POOL_WEIGHT * pool + own * variances[i]) / (POOL_WEIGHT + own);
    }
}

/// The planes of both.
fn stack(a: &Planes, b: &Planes) -> Planes {
    let mut both = Planes::new(b.width(), b.height(), a.count() + b.count());
    let (first, second) = both.data_mut().split_at_mut(a.data().len());
    first.copy_from_slice(a.data());
    second.copy_from_slice(b.data());
    both
}

fn filled(width: usize, height: usize, value: f32) -> Planes {
    let mut planes = Planes::new(width, height, 1);
    planes.data_mut().fill(value);
    planes
}

#[cfg(test)]
mod tests;
