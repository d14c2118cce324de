//! Applies non-local means and local regression to both halves of the samples, each with the other half as
//! its guide.

use super::local_regression::{self, FEATURES};
use super::non_local_means;
use super::patch_distance::{ColourGuide, DistanceSettings};
use super::settings::NlmSettings;
use crate::filter::common::dual_buffer::{DualBuffer, both_halves};
use crate::filter::common::linear_estimate::LinearEstimate;
use crate::image::Planes;

/// Filters the colour divided by the albedo, with weights from colour and normals, and multiplies the albedo
/// again. Albedo and normals are the filtered ones of both halves.
pub fn filter_colour(
    noisy: &DualBuffer,
    normal: Option<&[Planes; 2]>,
    albedo: Option<&[Planes; 2]>,
    settings: &NlmSettings,
) -> [LinearEstimate; 2] {
    let mut colour = noisy.clone();
    if let Some([a, b]) = albedo {
        colour.divide([b, a]);
    }
    both_halves(|h| {
        let mut half = filter_half(&colour, normal.map(|normal| &normal[1 - h]), h, settings);
        if let Some(albedo) = albedo {
            half.value.data_mut().iter_mut().zip(albedo[1 - h].data()).for_each(|(v, &a)| *v *= a);
        }
        half
    })
}

/// Filters one half of the colour.
fn filter_half(
    colour: &DualBuffer,
    normal: Option<&Planes>,
    half: usize,
    settings: &NlmSettings,
) -> LinearEstimate {
    let guide = 1 - half;
    let features: Vec<&[f32]> = normal.iter().flat_map(|n| [n.plane(0), n.plane(1), n.plane(2)]).collect();
    non_local_means::filter(
        colour.mean[half].width(),
        colour.mean[half].height(),
        channels(&colour.mean[half]),
        ColourGuide {
            value: channels(&colour.mean[guide]),
            variance: channels(&colour.variance[guide]),
            features: &features,
            feature_inverse_bandwidth: 0.5 / settings.normal_sigma.powi(2),
        },
        DistanceSettings {
            radius: settings.radius,
            k: settings.k,
            epsilon: epsilon(&colour.mean[guide], settings),
            symmetric_weights: false,
        },
    )
}

/// Fits a local linear model to three planes. `features` are normals and albedo of both halves.
pub fn fit(
    noisy: &DualBuffer,
    features: [Option<&[Planes; 2]>; 2],
    k: f32,
    settings: &NlmSettings,
) -> [LinearEstimate; 2] {
    let (width, height) = (noisy.mean[0].width(), noisy.mean[0].height());
    // A regressor of zeros has no effect on the fit.
    let zero = vec![0.0; width * height];
    both_halves(|h| {
        let guide = 1 - h;
        let feature = |f: usize| features[f / 3].map_or(zero.as_slice(), |halves| halves[guide].plane(f % 3));
        local_regression::fit(
            width,
            height,
            channels(&noisy.mean[h]),
            ColourGuide {
                value: channels(&noisy.mean[guide]),
                variance: channels(&noisy.variance[guide]),
                features: &[],
                feature_inverse_bandwidth: 0.0,
            },
            std::array::from_fn::<_, FEATURES, _>(feature),
            DistanceSettings {
                radius: settings.fit_radius,
                k,
                epsilon: epsilon(&noisy.mean[guide], settings),
                symmetric_weights: false,
            },
        )
    })
}

/// Filters albedo or normals.
pub fn filter_feature(feature: &DualBuffer, settings: &NlmSettings) -> [Planes; 2] {
    let distance = DistanceSettings {
        radius: settings.feature_radius,
        k: settings.feature_k,
        epsilon: settings.feature_epsilon,
        symmetric_weights: false,
    };
    filter_without_features(feature, distance).map(|half| half.value)
}

/// Filters directly visible emission.
pub fn filter_emission(emission: &DualBuffer, settings: &NlmSettings) -> [LinearEstimate; 2] {
    let brightest = emission.mean[0].data().iter().fold(f32::MIN_POSITIVE, |a, &b| a.max(b));
    let epsilon = (settings.colour_epsilon * brightest * brightest).max(f32::MIN_POSITIVE);
    let distance = DistanceSettings {
        radius: settings.emission_radius,
        k: settings.emission_k,
        epsilon,
        symmetric_weights: true,
    };
    filter_without_features(emission, distance)
}

fn filter_without_features(noisy: &DualBuffer, distance: DistanceSettings) -> [LinearEstimate; 2] {
    let (width, height) = (noisy.mean[0].width(), noisy.mean[0].height());
    both_halves(|h| {
        let guide = ColourGuide {
            value: channels(&noisy.mean[1 - h]),
            variance: channels(&noisy.variance[1 - h]),
            features: &[],
            feature_inverse_bandwidth: 1.0,
        };
        non_local_means::filter(width, height, channels(&noisy.mean[h]), guide, distance)
    })
}

/// Returns ε of the colour distance, in squared units of the colour.
fn epsilon(colour: &Planes, settings: &NlmSettings) -> f32 {
    let values = colour.data();
    let level = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len().max(1) as f64;
    (settings.colour_epsilon * (level * level) as f32).max(f32::MIN_POSITIVE)
}

fn channels(planes: &Planes) -> [&[f32]; 3] {
    [planes.plane(0), planes.plane(1), planes.plane(2)]
}
