//! The filter of `standard` and `draft`: pixel-based and driven by the store like P-RPF, but not
//! the published method.
//!
//! What differs from the paper, each measured as better on path-traced images: the two halves of
//! the samples guide each other; a patch distance normalised by variance stands in place of Eq. 4's
//! colour term and of the mutual-information weights; features are filtered across the halves
//! first; the albedo is divided out before and multiplied back after.
//!
//! 1. albedo and normals of each half, filtered with weights from the other half
//! 2. colour of each half over the albedo, filtered with weights from the other half's colour
//!    (patch distance) and normals
//! 3. albedo multiplied back; directly visible emission, filtered by itself, added back
//! 4. image, variance, residual and error from the two results

use crate::image::Planes;
use crate::stats::{Block, Store};

use super::assess::Assessment;
use super::halves::{Counts, Halves};
use super::patch::{self, Guide, PatchFiltered, PatchSettings};
use super::{Filtered, OutlierSettings};

/// Every constant of the filter.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct StandardSettings {
    /// Radius of the disc of neighbours for the colour, in pixels.
    pub radius: usize,
    /// Sensitivity of the colour distance (k of the patch distance).
    pub k: f32,
    /// Deviation of the normal term; normals are unit vectors.
    pub normal_sigma: f32,
    /// Radius for albedo and normals, in pixels; 0 leaves them as they are.
    pub feature_radius: usize,
    /// Sensitivity of the features' own distance.
    pub feature_k: f32,
    /// The albedo that is divided out is at least this.
    pub albedo_floor: f32,
    /// Regularises the colour distance, in units of the squared mean of the image.
    pub colour_epsilon: f32,
    /// Regularises the features' distance, in their own squared units.
    pub feature_epsilon: f32,
    /// What is cut off as an outlier is dropped.
    pub outliers: OutlierSettings,
}

impl StandardSettings {
    /// For the final image.
    pub const fn standard() -> Self {
        Self {
            radius: 9,
            k: 0.6,
            normal_sigma: 0.2,
            feature_radius: 5,
            feature_k: 1.0,
            albedo_floor: 0.02,
            colour_epsilon: 1e-6,
            feature_epsilon: 1e-5,
            outliers: OutlierSettings {
                medians: 8.0,
                deviations: 4.0,
                half_share: 0.8,
                spread_window: 0,
                spread_limit: 0.0,
            },
        }
    }

    /// For reruns between batches: smaller discs.
    pub const fn draft() -> Self {
        Self { radius: 5, feature_radius: 2, ..Self::standard() }
    }
}

/// Filters a store.
pub fn filter(store: &Store, settings: &StandardSettings) -> Filtered {
    let layout = store.layout();
    let counts = Counts::of(store);
    let read = |block| layout.block(block).map(|dims| Halves::of(store, dims, &counts));

    let mut colour = Halves::of(store, layout.colour(), &counts);
    colour.clamp_outliers(&counts, &settings.outliers);
    let normal = read(Block::Normal1).map(|normal| filter_feature(&normal, settings));
    let albedo = read(Block::Albedo)
        .map(|albedo| floored(swap(filter_feature(&albedo, settings)), settings.albedo_floor));

    let noisy = colour.clone();
    if let Some(albedo) = &albedo {
        colour.divide(albedo);
    }
    let of_half = |h: usize| filter_half(&colour, normal.as_ref().map(|normal| &normal[1 - h]), h, settings);
    let (a, b) = (of_half(0), of_half(1));
    let (mut filtered, own_weight) = ([a.value, b.value], [a.own_weight, b.own_weight]);
    if let Some(albedo) = &albedo {
        for h in 0..2 {
            filtered[h].data_mut().iter_mut().zip(albedo[h].data()).for_each(|(v, &a)| *v *= a);
        }
    }
    let emission = read(Block::Emission).map(|emission| filter_emission(&emission, settings));
    let assessment = Assessment::of(&noisy, &filtered, emission.as_ref(), &own_weight);
    if let Some(emission) = emission {
        for h in 0..2 {
            filtered[h].data_mut().iter_mut().zip(emission[h].data()).for_each(|(v, &e)| *v += e);
        }
    }
    Filtered {
        image: counts.mean(&filtered),
        halves: filtered,
        interpolation_failure: None,
        interpolation_success: None,
        residual: assessment.residual,
        variance: assessment.variance,
        error: assessment.error,
    }
}

/// Filters one half of the colour with weights from the other.
fn filter_half(
    colour: &Halves,
    normal: Option<&Planes>,
    half: usize,
    settings: &StandardSettings,
) -> PatchFiltered {
    let guide = 1 - half;
    let features: Vec<&[f32]> = normal.iter().flat_map(|n| [n.plane(0), n.plane(1), n.plane(2)]).collect();
    let mean = colour.mean[guide].data();
    let level = mean.iter().map(|&v| f64::from(v)).sum::<f64>() / mean.len().max(1) as f64;
    patch::filter(
        colour.mean[half].width(),
        colour.mean[half].height(),
        three(&colour.mean[half]),
        Guide {
            value: three(&colour.mean[guide]),
            variance: three(&colour.variance[guide]),
            features: &features,
            feature_gain: 0.5 / settings.normal_sigma.powi(2),
        },
        PatchSettings {
            radius: settings.radius,
            k: settings.k,
            epsilon: (settings.colour_epsilon * (level * level) as f32).max(f32::MIN_POSITIVE),
        },
    )
}

/// Filters both halves of three planes, each with weights from the other.
fn filter_feature(feature: &Halves, settings: &StandardSettings) -> [Planes; 2] {
    let distance = PatchSettings {
        radius: settings.feature_radius,
        k: settings.feature_k,
        epsilon: settings.feature_epsilon,
    };
    filter_alone(feature, distance)
}

fn filter_emission(emission: &Halves, settings: &StandardSettings) -> [Planes; 2] {
    let brightest = emission.mean[0].data().iter().fold(f32::MIN_POSITIVE, |a, &b| a.max(b));
    let epsilon = (settings.colour_epsilon * brightest * brightest).max(f32::MIN_POSITIVE);
    filter_alone(emission, PatchSettings { radius: settings.radius, k: settings.k, epsilon })
}

fn filter_alone(halves: &Halves, distance: PatchSettings) -> [Planes; 2] {
    let (width, height) = (halves.mean[0].width(), halves.mean[0].height());
    [0, 1].map(|h| {
        let guide = Guide {
            value: three(&halves.mean[1 - h]),
            variance: three(&halves.variance[1 - h]),
            features: &[],
            feature_gain: 1.0,
        };
        patch::filter(width, height, three(&halves.mean[h]), guide, distance).value
    })
}

fn three(planes: &Planes) -> [&[f32]; 3] {
    [planes.plane(0), planes.plane(1), planes.plane(2)]
}

fn swap([a, b]: [Planes; 2]) -> [Planes; 2] {
    [b, a]
}

fn floored(mut halves: [Planes; 2], floor: f32) -> [Planes; 2] {
    halves.iter_mut().flat_map(Planes::data_mut).for_each(|v| *v = v.max(floor));
    halves
}
