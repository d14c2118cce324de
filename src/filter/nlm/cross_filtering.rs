//! Applies non-local means and local regression to both halves of the samples, each with the other half as
//! its guide.

use super::local_regression::{self, FEATURES};
use super::non_local_means;
use super::patch_distance::{ColourGuide, DistanceSettings};
use super::settings::NlmSettings;
use crate::filter::common::dual_buffer::{DualBuffer, both_halves};
use crate::filter::common::emitter_outlines::outside_emitters;
use crate::filter::common::linear_estimate::LinearEstimate;
use crate::filter::whole_image::{self, WholeImage};
use crate::image::Planes;

/// Filters the colour divided by the albedo, with weights from colour and normals, and multiplies the albedo
/// again. Albedo and normals are the filtered ones of both halves.
pub fn filter_colour(
    noisy: &DualBuffer,
    normal: Option<&[Planes; 2]>,
    albedo: Option<&[Planes; 2]>,
    settings: &NlmSettings,
    whole: &dyn WholeImage,
) -> [LinearEstimate; 2] {
    let mut colour = noisy.clone();
    if let Some([a, b]) = albedo {
        colour.divide([b, a]);
    }
    filter_divided(&colour.mean, &colour, normal, albedo, settings, whole)
}

/// Filters a layer of the colour, of which it has the means of both halves, as [`filter_colour`] does with the colour.
pub fn filter_layer(
    layer: &[Planes; 2],
    noisy: &DualBuffer,
    normal: Option<&[Planes; 2]>,
    albedo: Option<&[Planes; 2]>,
    settings: &NlmSettings,
    whole: &dyn WholeImage,
) -> [LinearEstimate; 2] {
    let (mut colour, mut layer) = (noisy.clone(), layer.clone());
    if let Some([a, b]) = albedo {
        colour.divide([b, a]);
        for (half, divisor) in layer.iter_mut().zip([b, a]) {
            half.data_mut().iter_mut().zip(divisor.data()).for_each(|(value, &d)| *value /= d);
        }
    }
    filter_divided(&layer, &colour, normal, albedo, settings, whole)
}

/// Filters values that are divided by the albedo, with the weights of the colour that is divided by it, and multiplies by
/// it.
fn filter_divided(
    values: &[Planes; 2],
    colour: &DualBuffer,
    normal: Option<&[Planes; 2]>,
    albedo: Option<&[Planes; 2]>,
    settings: &NlmSettings,
    whole: &dyn WholeImage,
) -> [LinearEstimate; 2] {
    let epsilon = epsilon(colour, settings, whole);
    both_halves(|h| {
        let normal = normal.map(|normal| &normal[1 - h]);
        let mut half = filter_half(&values[h], colour, normal, h, epsilon[1 - h], settings);
        if let Some(albedo) = albedo {
            half.value.data_mut().iter_mut().zip(albedo[1 - h].data()).for_each(|(v, &a)| *v *= a);
        }
        half
    })
}

/// Filters values of one half.
fn filter_half(
    values: &Planes,
    colour: &DualBuffer,
    normal: Option<&Planes>,
    half: usize,
    epsilon: f32,
    settings: &NlmSettings,
) -> LinearEstimate {
    let guide = 1 - half;
    let features: Vec<&[f32]> = normal.iter().flat_map(|n| [n.plane(0), n.plane(1), n.plane(2)]).collect();
    non_local_means::filter(
        values.width(),
        values.height(),
        channels(values),
        ColourGuide {
            value: channels(&colour.mean[guide]),
            variance: channels(&colour.variance[guide]),
            features: &features,
            feature_inverse_bandwidth: 0.5 / settings.normal_sigma.powi(2),
        },
        DistanceSettings { radius: settings.radius, k: settings.k, epsilon, symmetric_weights: false },
    )
}

/// Fits a local linear model to three planes. `features` are normals and albedo of both halves.
pub fn fit(
    noisy: &DualBuffer,
    features: [Option<&[Planes; 2]>; 2],
    k: f32,
    settings: &NlmSettings,
    whole: &dyn WholeImage,
) -> [LinearEstimate; 2] {
    fit_layer(&noisy.mean, noisy, features, k, settings, whole)
}

/// Fits a local linear model to a layer of the colour, of which it has the means of both halves, with the weights of the
/// colour.
pub fn fit_layer(
    layer: &[Planes; 2],
    noisy: &DualBuffer,
    features: [Option<&[Planes; 2]>; 2],
    k: f32,
    settings: &NlmSettings,
    whole: &dyn WholeImage,
) -> [LinearEstimate; 2] {
    let epsilon = epsilon(noisy, settings, whole);
    let (width, height) = (noisy.mean[0].width(), noisy.mean[0].height());
    // A regressor of zeros has no effect on the fit.
    let zero = vec![0.0; width * height];
    both_halves(|h| {
        let guide = 1 - h;
        let feature = |f: usize| features[f / 3].map_or(zero.as_slice(), |halves| halves[guide].plane(f % 3));
        local_regression::fit(
            width,
            height,
            channels(&layer[h]),
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
                epsilon: epsilon[guide],
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
pub fn filter_emission(
    emission: &DualBuffer,
    settings: &NlmSettings,
    whole: &dyn WholeImage,
) -> [LinearEstimate; 2] {
    let brightest = emission.mean[0].data().iter().fold(f32::MIN_POSITIVE, |a, &b| a.max(b));
    // The margin of a part belongs to the image, too
    let brightest = whole.max(brightest);
    let epsilon = (settings.colour_epsilon * brightest * brightest).max(f32::MIN_POSITIVE);
    let distance = DistanceSettings {
        radius: settings.emission_radius,
        k: settings.emission_k,
        epsilon,
        symmetric_weights: true,
    };
    let mut filtered = filter_without_features(emission, distance);
    darken_rims(&mut filtered, emission);
    filtered
}

/// Removes emission from pixels outside all emitters.
fn darken_rims(filtered: &mut [LinearEstimate; 2], emission: &DualBuffer) {
    let (width, pixels) = (emission.mean[0].width(), emission.mean[0].pixels());
    let channels = || emission.mean.iter().flat_map(|mean| (0..3).map(move |c| mean.plane(c)));
    let met_emitter: Vec<bool> = (0..pixels).map(|i| channels().any(|plane| plane[i] > 0.0)).collect();
    let is_outside = outside_emitters(width, &met_emitter);
    for half in filtered {
        for i in (0..pixels).filter(|&i| is_outside[i]) {
            half.value.planes_mut().for_each(|plane| plane[i] = 0.0);
            half.derivative[i] = 1.0;
        }
    }
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

/// Returns ε of the colour distance for each half as the guide, in squared units of the colour.
fn epsilon(colour: &DualBuffer, settings: &NlmSettings, whole: &dyn WholeImage) -> [f32; 2] {
    colour.mean.each_ref().map(|mean| {
        let level = whole_image::mean(whole, mean, |v| v);
        (settings.colour_epsilon * (level * level) as f32).max(f32::MIN_POSITIVE)
    })
}

fn channels(planes: &Planes) -> [&[f32]; 3] {
    [planes.plane(0), planes.plane(1), planes.plane(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 12;

    /// An emission with radiance 1 in the pixels of a mask, and its filtered halves, with a trace of light everywhere.
    fn smeared(is_lit: impl Fn(usize, usize) -> bool) -> (DualBuffer, [LinearEstimate; 2]) {
        let mut emission = Planes::new(SIDE, SIDE, 3);
        for plane in emission.planes_mut() {
            plane.iter_mut().enumerate().for_each(|(i, v)| *v = f32::from(is_lit(i % SIDE, i / SIDE)));
        }
        let filtered = [(); 2].map(|()| {
            let mut value = emission.clone();
            value.data_mut().iter_mut().for_each(|v| *v = 0.9 * *v + 0.1);
            LinearEstimate { value, derivative: vec![0.5; SIDE * SIDE] }
        });
        let noisy =
            DualBuffer { mean: [emission.clone(), emission.clone()], variance: [emission.clone(), emission] };
        (noisy, filtered)
    }

    #[test]
    fn pixels_outside_a_lamp_stay_dark() {
        let is_lit = |x: usize, y: usize| (4..8).contains(&x) && (4..8).contains(&y);
        let (noisy, mut filtered) = smeared(is_lit);
        darken_rims(&mut filtered, &noisy);
        for half in &filtered {
            for (i, derivative) in half.derivative.iter().enumerate() {
                let (x, y) = (i % SIDE, i / SIDE);
                let expected = if is_lit(x, y) { (1.0, 0.5) } else { (0.0, 1.0) };
                assert_eq!((half.value.at(1, x, y), *derivative), expected, "{x} {y}");
            }
        }
    }
}
