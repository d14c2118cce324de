//! Decides which pixels are similar: the statistics of pixels that all passes measure distances with, and the
//! cluster of a pixel, which is the similar pixels of its window (paper, section 4.1).
//!
//! Takes a store, the colours to measure with, and the similarity thresholds. Two pixels are similar if the
//! means of each feature differ by at most the first pixel's threshold, they hit surfaces about equally
//! often, and the first does not lie beside an emitter that the second has met.

use rayon::prelude::*;

use super::settings::PrpfSettings;
use crate::filter::common::emitter_outlines::outside_emitters;
use crate::filter::common::hole_filling::HoleFilling;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::filter::common::lanes::lanes;
use crate::filter::common::variance_pooling::pool_planes;
use crate::image::Planes;
use crate::simd::{LANES, apply, multiversioned};
use crate::stats::{Block, Feature, Part, Store};

/// Unfiltered statistics of all pixels. Dimensions are the features, then three colours.
#[derive(Debug)]
pub struct FeatureGuide {
    /// Layout indices of the features.
    dims: Vec<usize>,
    /// Sample means.
    pub means: InterleavedPlanes,
    /// Sample variances, pooled with the neighbours'.
    pub variances: InterleavedPlanes,
    /// Variance within the pixel, as it enters the variance over a neighbourhood (Eq. 3).
    pub within: InterleavedPlanes,
    /// Squared similarity thresholds of the features.
    pub thresholds: InterleavedPlanes,
    /// Similarity thresholds of the features, in standard deviations.
    pub z: Vec<f32>,
    /// Sample counts.
    pub counts: InterleavedPlanes,
    /// Their mean.
    pub mean_count: f32,
    /// Fraction of samples that hit a surface, as neighbours compare it: [`Self::NO_PIXEL`] outside the image
    /// and at pixels without samples.
    pub hit: InterleavedPlanes,
    /// The same as the pixel itself compares it: ½ without samples, which is similar to any fraction.
    pub own_hit: InterleavedPlanes,
    /// 1 where a sample met an emitter, 0 elsewhere.
    pub met_emitter: InterleavedPlanes,
    /// The largest [`Self::met_emitter`] of similar pixels: 0 outside all emitters, 1 elsewhere.
    pub takes_emission: InterleavedPlanes,
}

impl FeatureGuide {
    /// Similarity threshold of hit fractions. Surfaces are never similar to the background; pixels with both are
    /// similar to either.
    const HIT_THRESHOLD: f32 = 0.5;

    /// [`Self::hit`] of no pixel: farther than the threshold from every fraction.
    pub const NO_PIXEL: f32 = 4.0;

    /// Fraction of the radiance above which directly visible emission counts. Below it the rounding of both means hides it.
    const LEAST_EMISSION: f32 = 1e-3;

    /// Prepares the statistics of a store. `colours` are the means and sample variances of the colours to measure
    /// with, 3 planes each.
    pub fn new(store: &Store, colours: [Planes; 2], settings: &PrpfSettings) -> Self {
        let (width, height) = (store.width(), store.height());
        let kinds = store.layout().features();
        let dims: Vec<usize> = kinds.iter().map(|&(dim, _)| dim).collect();
        let counts = store.counts(Part::Whole);
        let margin = settings.margin();

        // Pool the sample variances
        let features = [store.means(Part::Whole, dims.clone()), store.variances(Part::Whole, dims.clone())];
        let [mut means, mut within] = [0, 1].map(|i| concatenate(&features[i], &colours[i]));
        HoleFilling::new(width, counts.iter().copied()).fill(&mut means);
        let mut variances = within.clone();
        let mut count_plane = Planes::new(width, height, 1);
        count_plane.data_mut().iter_mut().zip(&counts).for_each(|(out, &n)| *out = n as f32);
        pool_planes(&mut variances, &means, count_plane.data());

        // Eq. 3 uses the biased variance of a pixel's samples. With unequal counts it is not defined, and the
        // pooled variance takes its place.
        let n = counts.first().map_or(0, |&n| n);
        if n >= 2 && counts.iter().all(|&m| m == n) {
            within.data_mut().iter_mut().for_each(|v| *v *= (n - 1) as f32 / n as f32);
        } else {
            within = variances.clone();
        }

        // Compute similarity thresholds and hit fractions
        let thresholds = thresholds(&kinds, &variances, &counts, settings);
        let mut hit = hit_fractions(store);
        let mut own_hit = hit.clone();
        for (i, &count) in counts.iter().enumerate() {
            if count == 0 {
                hit.data_mut()[i] = Self::NO_PIXEL;
                own_hit.data_mut()[i] = 0.5;
            }
        }

        // Find the pixels that keep emission out
        let met = met_emitter(store);
        let plane = |is_one: &dyn Fn(usize) -> bool| {
            let mut plane = Planes::new(width, height, 1);
            plane.data_mut().iter_mut().enumerate().for_each(|(i, out)| *out = f32::from(is_one(i)));
            plane
        };
        let is_outside = outside_emitters(width, &met);
        let (met_emitter, takes_emission) = (plane(&|i| met[i]), plane(&|i| !is_outside[i]));

        Self {
            dims,
            z: kinds.iter().map(|&(_, kind)| limits(kind, settings).0).collect(),
            means: InterleavedPlanes::from_planes(&means, margin, 0.0),
            variances: InterleavedPlanes::from_planes(&variances, margin, 0.0),
            within: InterleavedPlanes::from_planes(&within, margin, 0.0),
            thresholds: InterleavedPlanes::from_planes(&thresholds, 0, 0.0),
            counts: InterleavedPlanes::from_planes(&count_plane, margin, 0.0),
            mean_count: store.samples() as f32 / counts.len().max(1) as f32,
            hit: InterleavedPlanes::from_planes(&hit, margin, Self::NO_PIXEL),
            own_hit: InterleavedPlanes::from_planes(&own_hit, 0, 0.0),
            met_emitter: InterleavedPlanes::from_planes(&met_emitter, margin, 0.0),
            takes_emission: InterleavedPlanes::from_planes(&takes_emission, 0, 0.0),
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

    /// Collects the cluster of a pixel: the similar pixels of its window that have samples, row by row. It includes
    /// the pixel itself if that has samples.
    pub fn cluster(&self, x: usize, y: usize, window: usize, cluster: &mut Vec<(u32, u32)>) {
        collect_similar(self, (x, y), window, cluster);
    }

    /// Whether pixel `j` is similar to pixel `i`, by the thresholds of `i`.
    pub fn is_similar(&self, i: (usize, usize), j: (usize, usize)) -> bool {
        let is_within = |k: usize| {
            let d = self.means.at(k, i.0, i.1) - self.means.at(k, j.0, j.1);
            d * d <= self.thresholds.at(k, i.0, i.1)
        };
        self.meets_alike(i, j) && (0..self.features()).all(is_within)
    }

    /// Whether the samples of pixel `j` hit surfaces about as often as those of pixel `i`, and met no emitter that `i` lies
    /// beside.
    pub fn meets_alike(&self, i: (usize, usize), j: (usize, usize)) -> bool {
        let own = [&self.own_hit, &self.takes_emission].map(|plane| plane.at(0, i.0, i.1));
        let other = [&self.hit, &self.met_emitter].map(|plane| plane.at(0, j.0, j.1));
        meets_alike(own, other)
    }
}

/// Implements [`FeatureGuide::meets_alike`]. `own` are [`FeatureGuide::own_hit`] and [`FeatureGuide::takes_emission`] of a
/// pixel, `other` are [`FeatureGuide::hit`] and [`FeatureGuide::met_emitter`] of another.
#[inline(always)]
pub fn meets_alike(own: [f32; 2], other: [f32; 2]) -> bool {
    ((own[0] - other[0]).abs() <= FeatureGuide::HIT_THRESHOLD) & (other[1] <= own[1])
}

/// Implements [`FeatureGuide::cluster`].
#[apply(multiversioned!)]
fn collect_similar(
    guide: &FeatureGuide,
    (x, y): (usize, usize),
    window: usize,
    cluster: &mut Vec<(u32, u32)>,
) {
    /// Features after which the flags of a block are looked at for the first time: most dissimilar pixels lie
    /// elsewhere in the world, and its position comes first.
    const FIRST_FEATURES: usize = 3;
    let radius = window / 2;
    let (left, right) = (x.saturating_sub(radius), (x + radius).min(guide.width() - 1));
    let (top, bottom) = (y.saturating_sub(radius), (y + radius).min(guide.height() - 1));
    // A pixel that is not similar is written to the place of the next one: a vector more places.
    cluster.resize((right - left + 1) * (bottom - top + 1) + LANES, (0, 0));
    let own_met = [&guide.own_hit, &guide.takes_emission].map(|plane| plane.at(0, x, y));
    let own: Vec<(f32, f32)> =
        (0..guide.features()).map(|k| (guide.means.at(k, x, y), guide.thresholds.at(k, x, y))).collect();
    let (first, rest) = own.split_at(own.len().min(FIRST_FEATURES));
    let mut len = 0;
    for yj in top..=bottom {
        'blocks: for start in (left..=right).step_by(LANES) {
            // Compare a block of pixels with the pixel
            let at = guide.means.margin() + start;
            let [hits, met_emitter] =
                [&guide.hit, &guide.met_emitter].map(|plane| lanes(&plane.row_with_margins(0, yj)[at..]));
            let mut similar = [0; LANES];
            for l in 0..LANES {
                similar[l] = u32::from(meets_alike(own_met, [hits[l], met_emitter[l]]));
            }
            let mut planes = guide.means.row_planes(yj, at);
            for features in [first, rest] {
                for (&(own, threshold), others) in features.iter().zip(&mut planes) {
                    let others = lanes(others);
                    for l in 0..LANES {
                        let d = own - others[l];
                        similar[l] &= u32::from(d * d <= threshold);
                    }
                }
                if similar == [0; LANES] {
                    continue 'blocks;
                }
            }

            // Append those that are similar
            let places = &mut cluster[len..len + LANES];
            if similar == [1; LANES] && start + LANES <= right + 1 {
                let here = |l: usize| ((start + l) as u32, yj as u32);
                places.iter_mut().enumerate().for_each(|(l, place)| *place = here(l));
                len += LANES;
            } else {
                let mut count = 0;
                for (xj, similar) in (start..=right).zip(similar) {
                    places[count] = (xj as u32, yj as u32);
                    count += similar as usize;
                }
                len += count;
            }
        }
    }
    cluster.truncate(len);
}

/// Similarity threshold of a feature: in standard deviations, and the absolute minimum.
fn limits(kind: Feature, settings: &PrpfSettings) -> (f32, f32) {
    match kind {
        Feature::WorldPosition => (settings.z_world, settings.min_threshold_world),
        Feature::Normal | Feature::Albedo => (settings.z, settings.min_threshold),
    }
}

/// Squared similarity thresholds: a plane for each feature. Pixels without samples have infinite ones.
fn thresholds(
    kinds: &[(usize, Feature)],
    variances: &Planes,
    counts: &[u32],
    settings: &PrpfSettings,
) -> Planes {
    let mut thresholds = Planes::new(variances.width(), variances.height(), kinds.len());
    thresholds.planes_mut().zip(kinds).enumerate().par_bridge().for_each(|(k, (out, &(_, kind)))| {
        let (z, minimum) = limits(kind, settings);
        for ((out, &variance), &count) in out.iter_mut().zip(variances.plane(k)).zip(counts) {
            let minimum = if variance <= minimum * minimum { minimum * minimum } else { 0.0 };
            *out = if count == 0 { f32::INFINITY } else { (z * z * variance).max(minimum) };
        }
    });
    thresholds
}

/// Fraction of samples that hit a surface, 1 plane; 1 where the store does not record it.
fn hit_fractions(store: &Store) -> Planes {
    let mut hit = match store.layout().block(Block::Hit) {
        Some(dims) => store.means(Part::Whole, dims),
        None => {
            let mut all = Planes::new(store.width(), store.height(), 1);
            all.data_mut().fill(1.0);
            all
        }
    };
    // Another program may have stored other values, which would be similar to `NO_PIXEL`.
    hit.data_mut().iter_mut().for_each(|fraction| *fraction = fraction.clamp(0.0, 1.0));
    hit
}

/// Whether a sample of a pixel met an emitter, for all pixels.
fn met_emitter(store: &Store) -> Vec<bool> {
    let layout = store.layout();
    let Some(radiance) = layout.block(Block::Radiance) else { return vec![false; store.pixels()] };
    let [colour, radiance] = [layout.colour(), radiance].map(|dims| store.means(Part::Whole, dims));
    let met = |i: usize| {
        (0..3).any(|c| {
            let radiance = radiance.plane(c)[i];
            radiance - colour.plane(c)[i] > FeatureGuide::LEAST_EMISSION * radiance.abs()
        })
    };
    (0..store.pixels()).map(met).collect()
}

/// The planes of both.
fn concatenate(a: &Planes, b: &Planes) -> Planes {
    let mut both = Planes::new(b.width(), b.height(), a.count() + b.count());
    let (first, second) = both.data_mut().split_at_mut(a.data().len());
    first.copy_from_slice(a.data());
    second.copy_from_slice(b.data());
    both
}

#[cfg(test)]
pub(super) mod tests;
