//! The filter of `standard` and `draft`: pixel-based and driven by the store like P-RPF, but not
//! the published method.
//!
//! What differs from the paper, each measured as better on path-traced images: the two halves of
//! the samples guide each other; a patch distance normalised by variance stands in place of Eq. 4's
//! colour term and of the mutual-information weights; features are filtered across the halves
//! first; the albedo is divided out before and multiplied back after; a linear fit is a second
//! estimate, and the two are mixed by their estimated risk.
//!
//! 0. outliers are brought to the median around them; their energy is given back, blurred, after 4
//! 1. albedo and normals of each half, filtered with weights from the other half
//! 2. colour of each half over the albedo, filtered with weights from the other half's colour
//!    (patch distance) and normals
//! 3. albedo multiplied back; directly visible emission filtered by itself
//! 4. (`standard` only) each mixed with a linear fit of itself, by estimated risk
//! 5. image, variance, residual and error from the two results

use rayon::prelude::*;

use crate::image::Planes;
use crate::stats::{Block, Store};

use super::assessment::Assessment;
use super::distance::{DistanceSettings, Guide};
use super::halves::{Counts, Estimate, Halves, of_halves};
use super::regression::{self, FEATURES};
use super::stack::{self, Brightness};
use super::{Filtered, OutlierSettings, outliers, patch};

/// Every constant of the filter.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct StandardSettings {
    /// Radius of the disc of neighbours for the colour, in pixels.
    pub radius: usize,
    /// Sensitivity of the colour distance (k of the patch distance).
    pub k: f32,
    /// Radius of the disc of neighbours for the linear fit, in pixels; 0 leaves the fit out.
    pub fit_radius: usize,
    /// Sensitivity of the fit's colour distance …
    pub fit_k: f32,
    /// … and of its distance for directly visible emission.
    pub fit_emission_k: f32,
    /// Blur, in pixels, of the risk that decides between the weighted mean and the fit.
    pub mix_sigma: f32,
    /// Samples per pixel from which on every k grows, as their fourth root: with more samples the variances
    /// are better known, and less caution measures better.
    pub k_samples: f32,
    /// The most that k grows by.
    pub k_growth: f32,
    /// As `k`, of directly visible emission, whose edges are hard.
    pub emission_k: f32,
    /// Radius of the disc of neighbours for directly visible emission, in pixels: emitters out of focus have
    /// narrow rims, which find others like them only farther off.
    pub emission_radius: usize,
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
    /// What counts as an outlier.
    pub outliers: OutlierSettings,
    /// Blur, in pixels, with which their energy is given back.
    pub outlier_sigma: f32,
    /// Share of the light around one of them that a pixel may get from it.
    pub outlier_limit: f32,
}

impl StandardSettings {
    /// For the final image.
    pub const fn standard() -> Self {
        Self {
            radius: 8,
            k: 0.6,
            fit_radius: 5,
            fit_k: 1.2,
            fit_emission_k: 0.6,
            mix_sigma: 3.0,
            k_samples: 32.0,
            k_growth: 1.5,
            emission_k: 0.4,
            emission_radius: 16,
            normal_sigma: 0.12,
            feature_radius: 1,
            feature_k: 1.4,
            albedo_floor: 0.02,
            colour_epsilon: 1e-6,
            feature_epsilon: 1e-5,
            outliers: OutlierSettings {
                medians: 4.0,
                deviations: 4.0,
                to_median: true,
                half_share: 0.8,
                spread_window: 0,
                spread_limit: 0.0,
            },
            outlier_sigma: 14.0,
            outlier_limit: 0.02,
        }
    }

    /// For reruns between batches: smaller discs and no fit.
    pub const fn draft() -> Self {
        Self { radius: 5, emission_radius: 5, fit_radius: 0, ..Self::standard() }
    }

    /// Every k as it is at so many samples per pixel.
    fn grown(&self, spp: f32) -> Self {
        let growth = (spp / self.k_samples).powf(0.25).clamp(1.0, self.k_growth);
        Self {
            k: self.k * growth,
            emission_k: self.emission_k * growth,
            fit_k: self.fit_k * growth,
            fit_emission_k: self.fit_emission_k * growth,
            ..*self
        }
    }
}

/// Filters a store.
pub fn filter(store: &Store, settings: &StandardSettings) -> Filtered {
    let settings = &settings.grown(store.samples() as f32 / store.pixels().max(1) as f32);
    let layout = store.layout();
    let counts = Counts::of(store);
    let read = |block| layout.block(block).map(|dims| Halves::of(store, dims, &counts));

    let (noisy, clamped) = Halves::without_outliers(store, layout.colour(), &counts, &settings.outliers);
    let normal = read(Block::Normal1).map(|normal| filter_feature(&normal, settings));
    let albedo = read(Block::Albedo)
        .map(|albedo| within_reason(filter_feature(&albedo, settings), settings.albedo_floor));
    let noisy_emission = read(Block::Emission);

    let mut colour = filter_colour(&noisy, normal.as_ref(), albedo.as_ref(), settings);
    let mut emission = noisy_emission.as_ref().map(|emission| filter_emission(emission, settings));
    if settings.fit_radius > 0 {
        let mut image = counts.mean([&colour[0].value, &colour[1].value]);
        if let Some([a, b]) = &emission {
            add(&mut image, &counts.mean([&a.value, &b.value]));
        }
        let parts = colour.iter().chain(emission.iter().flatten()).map(|half| &half.value);
        let brightness = Brightness::of(&image, parts);
        let features = [normal.as_ref(), albedo.as_ref()];
        let fitted = fit(&noisy, features, settings.fit_k, settings);
        colour = stack::mix(&noisy, &brightness, colour, &fitted, settings.mix_sigma);
        emission = emission.zip(noisy_emission).map(|(emission, noisy)| {
            let fitted = fit(&noisy, [None; 2], settings.fit_emission_k, settings);
            stack::mix(&noisy, &brightness, emission, &fitted, settings.mix_sigma)
        });
    }
    let of_guide = albedo.as_ref().map(|[a, b]| [b, a]);
    let divisor = of_guide.map(|[divisor, _]| divisor);
    if let Some(light) = outliers::blurred(&clamped, divisor, settings.outlier_sigma, settings.outlier_limit)
    {
        // Where there is no surface there is no light to give back.
        let lit: Vec<bool> =
            (0..store.pixels()).into_par_iter().map(|i| is_surface(normal.as_ref(), i)).collect();
        for (h, half) in colour.iter_mut().enumerate() {
            for (channel, plane) in half.value.planes_mut().enumerate() {
                let albedo = of_guide.map(|albedo| albedo[h].plane(channel));
                let light = light.plane(channel);
                for i in (0..plane.len()).filter(|&i| lit[i]) {
                    plane[i] += light[i] * albedo.map_or(1.0, |albedo| albedo[i]);
                }
            }
        }
    }
    let [a, b] = colour;
    let mut halves = [a.value, b.value];
    let emission = emission.map(|[a, b]| [a.value, b.value]);
    let assessment = Assessment::of(&noisy, &halves, emission.as_ref(), [&a.own_weight, &b.own_weight]);
    for (half, emission) in halves.iter_mut().zip(emission.iter().flatten()) {
        add(half, emission);
    }
    Filtered {
        image: counts.mean([&halves[0], &halves[1]]),
        halves,
        interpolation_failure: None,
        interpolation_success: None,
        residual: assessment.residual,
        variance: assessment.variance,
        error: assessment.error,
    }
}

/// Filters the colour over the albedo, each half with weights from the other.
fn filter_colour(
    noisy: &Halves,
    normal: Option<&[Planes; 2]>,
    albedo: Option<&[Planes; 2]>,
    settings: &StandardSettings,
) -> [Estimate; 2] {
    let mut colour = noisy.clone();
    if let Some([a, b]) = albedo {
        colour.divide([b, a]);
    }
    of_halves(|h| {
        let mut half = filter_half(&colour, normal.map(|normal| &normal[1 - h]), h, settings);
        if let Some(albedo) = albedo {
            half.value.data_mut().iter_mut().zip(albedo[1 - h].data()).for_each(|(v, &a)| *v *= a);
        }
        half
    })
}

/// Filters one half of the colour with weights from the other.
fn filter_half(
    colour: &Halves,
    normal: Option<&Planes>,
    half: usize,
    settings: &StandardSettings,
) -> Estimate {
    let guide = 1 - half;
    let features: Vec<&[f32]> = normal.iter().flat_map(|n| [n.plane(0), n.plane(1), n.plane(2)]).collect();
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
        DistanceSettings {
            radius: settings.radius,
            k: settings.k,
            epsilon: epsilon(&colour.mean[guide], settings),
            cautious: false,
        },
    )
}

/// Fits both halves of three planes, each with weights and regressors from the other.
fn fit(
    noisy: &Halves,
    features: [Option<&[Planes; 2]>; 2],
    k: f32,
    settings: &StandardSettings,
) -> [Estimate; 2] {
    let (width, height) = (noisy.mean[0].width(), noisy.mean[0].height());
    // A regressor that is zero everywhere gets no part in the fit.
    let nothing = vec![0.0; width * height];
    of_halves(|h| {
        let guide = 1 - h;
        let feature =
            |f: usize| features[f / 3].map_or(nothing.as_slice(), |halves| halves[guide].plane(f % 3));
        regression::fit(
            width,
            height,
            three(&noisy.mean[h]),
            regression::Guide {
                value: three(&noisy.mean[guide]),
                variance: three(&noisy.variance[guide]),
                features: std::array::from_fn::<_, FEATURES, _>(feature),
            },
            DistanceSettings {
                radius: settings.fit_radius,
                k,
                epsilon: epsilon(&noisy.mean[guide], settings),
                cautious: false,
            },
        )
    })
}

/// Filters both halves of three planes, each with weights from the other.
fn filter_feature(feature: &Halves, settings: &StandardSettings) -> [Planes; 2] {
    let distance = DistanceSettings {
        radius: settings.feature_radius,
        k: settings.feature_k,
        epsilon: settings.feature_epsilon,
        cautious: false,
    };
    filter_alone(feature, distance).map(|half| half.value)
}

fn filter_emission(emission: &Halves, settings: &StandardSettings) -> [Estimate; 2] {
    let brightest = emission.mean[0].data().iter().fold(f32::MIN_POSITIVE, |a, &b| a.max(b));
    let epsilon = (settings.colour_epsilon * brightest * brightest).max(f32::MIN_POSITIVE);
    filter_alone(
        emission,
        DistanceSettings {
            radius: settings.emission_radius,
            k: settings.emission_k,
            epsilon,
            cautious: true,
        },
    )
}

fn filter_alone(halves: &Halves, distance: DistanceSettings) -> [Estimate; 2] {
    let (width, height) = (halves.mean[0].width(), halves.mean[0].height());
    of_halves(|h| {
        let guide = Guide {
            value: three(&halves.mean[1 - h]),
            variance: three(&halves.variance[1 - h]),
            features: &[],
            feature_gain: 1.0,
        };
        patch::filter(width, height, three(&halves.mean[h]), guide, distance)
    })
}

/// Whether samples of a pixel hit anything, by its normals; without normals all is taken for surface.
fn is_surface(normal: Option<&[Planes; 2]>, i: usize) -> bool {
    /// Least squared length of a mean normal; a filtered miss may have a trace of its neighbours'.
    const LEAST: f32 = 1e-4;
    normal.is_none_or(|halves| {
        halves.iter().any(|half| (0..3).map(|c| half.plane(c)[i].powi(2)).sum::<f32>() > LEAST)
    })
}

/// What regularises a distance between colours, in their squared units.
fn epsilon(colour: &Planes, settings: &StandardSettings) -> f32 {
    let values = colour.data();
    let level = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len().max(1) as f64;
    (settings.colour_epsilon * (level * level) as f32).max(f32::MIN_POSITIVE)
}

fn three(planes: &Planes) -> [&[f32]; 3] {
    [planes.plane(0), planes.plane(1), planes.plane(2)]
}

fn add(sum: &mut Planes, term: &Planes) {
    sum.data_mut().iter_mut().zip(term.data()).for_each(|(sum, &v)| *sum += v);
}

/// Albedos in a range by which can be divided, and multiplied again. No surface comes near its upper end; with it
/// squares of the brightest colours are still numbers.
fn within_reason(mut halves: [Planes; 2], floor: f32) -> [Planes; 2] {
    const LARGEST: f32 = 64.0;
    halves.iter_mut().flat_map(Planes::data_mut).for_each(|v| *v = v.clamp(floor, LARGEST));
    halves
}

#[cfg(test)]
mod tests;
