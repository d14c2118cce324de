//! Constants of cross-filtered non-local means, with two presets.

use crate::filter::common::fireflies::FireflySettings;
use crate::filter::common::{blur, error_maps, variance_correction};

/// Constants of the filter. k is the bandwidth of a patch distance, in standard deviations.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct NlmSettings {
    /// Radius of the disc of neighbours for the colour, in pixels.
    pub radius: usize,
    /// k for the colour.
    pub k: f32,
    /// Radius of the disc of neighbours for the linear fit, in pixels; 0 leaves the fit out.
    pub fit_radius: usize,
    /// k for the fit of the colour.
    pub fit_k: f32,
    /// k for the fit of directly visible emission.
    pub fit_emission_k: f32,
    /// Standard deviation of the blur of the risk by which the weighted mean and the fit are blended, in pixels.
    pub blend_sigma: f32,
    /// Samples per pixel above which every k grows with their fourth root: variances of more samples are more
    /// accurate, and larger bandwidths have measured better.
    pub k_samples: f32,
    /// Maximum factor by which k grows.
    pub k_growth: f32,
    /// k for directly visible emission, which has hard edges.
    pub emission_k: f32,
    /// Radius of the disc of neighbours for directly visible emission, in pixels. Similar pixels of the
    /// narrow rims of emitters out of focus are far apart.
    pub emission_radius: usize,
    /// Standard deviation of the normal term; normals are unit vectors.
    pub normal_sigma: f32,
    /// Radius of the disc of neighbours for albedo and normals, in pixels; 0 leaves them unfiltered.
    pub feature_radius: usize,
    /// k for albedo and normals.
    pub feature_k: f32,
    /// Minimum of the albedo by which colours are divided.
    pub albedo_floor: f32,
    /// ε of the colour distance, in units of the squared mean of the image.
    pub colour_epsilon: f32,
    /// ε of the distance of albedo and normals, in their squared units.
    pub feature_epsilon: f32,
    pub fireflies: FireflySettings,
    /// Standard deviation of the blur with which the excess of fireflies is redistributed, in pixels.
    pub firefly_sigma: f32,
    /// Maximum radiance that a pixel receives from a firefly, relative to the firefly's clamped luminance.
    pub firefly_limit: f32,
}

impl NlmSettings {
    /// For the final image.
    pub const fn standard() -> Self {
        Self {
            radius: 8,
            k: 0.6,
            fit_radius: 5,
            fit_k: 1.2,
            fit_emission_k: 0.6,
            blend_sigma: 3.0,
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
            fireflies: FireflySettings {
                median_factor: 4.0,
                deviation_factor: 4.0,
                clamp_to_median: true,
                half_fraction: 0.8,
                max_neighbours: None,
                redistribution_window: 0,
                redistribution_limit: 0.0,
            },
            firefly_sigma: 14.0,
            firefly_limit: 0.02,
        }
    }

    /// For interim passes: smaller discs and no fit.
    pub const fn draft() -> Self {
        Self { radius: 5, emission_radius: 5, fit_radius: 0, ..Self::standard() }
    }

    /// Returns the distance in pixels from which a pixel's samples can change the result at another one, apart from what the
    /// filter knows of the whole image.
    pub fn margin(&self) -> usize {
        /// Half sides of the patches of the weighted mean and of the fit.
        const PATCHES: (usize, usize) = (3, 1);
        /// Radius of the window of the fireflies' bound, and of the pooled variances.
        const BOUND_AND_POOL: usize = 2 + 1;
        // The noisy values with their variances, and the features, by which the colour is divided
        let noisy = BOUND_AND_POOL + blur::reach(variance_correction::SIGMA);
        let features = noisy + self.feature_radius + PATCHES.0;
        // The estimates and their blend
        let means = (features + self.radius).max(noisy + self.emission_radius) + PATCHES.0;
        let fits = features + self.fit_radius + PATCHES.1;
        let blended =
            if self.fit_radius > 0 { means.max(fits) + blur::reach(self.blend_sigma) } else { means };
        // The excess of fireflies is divided by the albedo where they are, and blurred; so is the error
        let excess = features + blur::reach(self.firefly_sigma);
        blended.max(excess) + blur::reach(error_maps::ERROR_SIGMA)
    }

    /// Returns the settings with every k for this number of samples per pixel.
    pub fn for_samples(&self, spp: f32) -> Self {
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
