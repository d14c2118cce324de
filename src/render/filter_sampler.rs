//! Filter importance sampling (Ernst, Stamminger and Greiner 2006): samples film positions around a pixel's
//! centre in proportion to the pixel filter, so that the pixel is the unweighted mean of its samples.
//!
//! Of filters with negative lobes (Mitchell, sinc) only the positive part is sampled, because unweighted
//! samples cannot count negatively. The image is a little softer than with the whole filter.

use std::f64::consts::PI;

use glam::Vec2;

use crate::scene::PixelFilter;

/// Samples a pixel filter. All filters are products of one function for each axis.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    x: Quantiles,
    y: Quantiles,
}

impl FilterSampler {
    pub fn new(filter: &PixelFilter) -> Self {
        let steps = match filter {
            PixelFilter::Box { .. } => 1,
            _ => Quantiles::STEPS,
        };
        let along = |axis| Quantiles::new(steps, radius(filter)[axis], |t| profile(filter, axis, t));
        let [x, y] = [0, 1].map(along);
        Self { x, y }
    }

    /// Returns the offset from the pixel's centre, in pixels, for sample values in [0, 1)².
    #[inline]
    pub fn sample(&self, u: Vec2) -> Vec2 {
        Vec2::new(self.x.sample(u.x), self.y.sample(u.y))
    }
}

fn radius(filter: &PixelFilter) -> [f32; 2] {
    match *filter {
        PixelFilter::Box { radius }
        | PixelFilter::Triangle { radius }
        | PixelFilter::Gaussian { radius, .. }
        | PixelFilter::Mitchell { radius, .. }
        | PixelFilter::Sinc { radius, .. } => radius,
    }
}

/// Returns the filter along one axis at `t` pixels from the centre, up to a factor.
fn profile(filter: &PixelFilter, axis: usize, t: f64) -> f64 {
    let radius = f64::from(radius(filter)[axis]);
    match *filter {
        PixelFilter::Box { .. } => 1.0,
        PixelFilter::Triangle { .. } => radius - t.abs(),
        PixelFilter::Gaussian { sigma, .. } => {
            let bell = |t: f64| (-0.5 * (t / f64::from(sigma)).powi(2)).exp();
            bell(t) - bell(radius)
        }
        PixelFilter::Mitchell { b, c, .. } => mitchell(f64::from(b), f64::from(c), 2.0 * t.abs() / radius),
        PixelFilter::Sinc { tau, .. } => sinc(t) * sinc(t / f64::from(tau)),
    }
}

/// Evaluates the Mitchell filter (Mitchell and Netravali 1988, equation 8) for `x` in [0, 2].
fn mitchell(b: f64, c: f64, x: f64) -> f64 {
    if x < 1.0 {
        (12.0 - 9.0 * b - 6.0 * c) * x.powi(3) + (-18.0 + 12.0 * b + 6.0 * c) * x.powi(2) + (6.0 - 2.0 * b)
    } else {
        (-b - 6.0 * c) * x.powi(3)
            + (6.0 * b + 30.0 * c) * x.powi(2)
            + (-12.0 * b - 48.0 * c) * x
            + (8.0 * b + 24.0 * c)
    }
}

fn sinc(x: f64) -> f64 {
    let x = PI * x;
    if x.abs() < 1e-5 { 1.0 } else { x.sin() / x }
}

/// Inverse of a cumulative distribution function, tabulated at equal steps of probability.
#[derive(Clone, Debug)]
struct Quantiles {
    values: Vec<f32>,
}

impl Quantiles {
    /// Steps of equal probability. The density is constant within each.
    const STEPS: usize = 1024;
    /// Cells of the numerical integration.
    const CELLS: usize = 1 << 15;

    /// Tabulates the quantiles of the positive part of `density` over [-radius, radius]. A density that is
    /// too narrow for the cells is sampled at 0.
    fn new(steps: usize, radius: f32, density: impl Fn(f64) -> f64) -> Self {
        // Integrate the density over each cell
        let radius = f64::from(radius);
        let cell = 2.0 * radius / Self::CELLS as f64;
        let edge = |i: usize| i as f64 * cell - radius;
        let masses: Vec<f64> = (0..Self::CELLS).map(|i| density(edge(i) + 0.5 * cell).max(0.0)).collect();
        let total: f64 = masses.iter().sum();
        if total <= 0.0 {
            return Self { values: vec![0.0; steps + 1] };
        }

        // Find the quantile at the end of each step
        let mut values = Vec::with_capacity(steps + 1);
        let (mut i, mut below) = (0, 0.0);
        for step in 0..=steps {
            let target = total * step as f64 / steps as f64;
            while i + 1 < Self::CELLS && (below + masses[i] < target || masses[i] == 0.0) {
                below += masses[i];
                i += 1;
            }
            let within = if masses[i] > 0.0 { ((target - below) / masses[i]).clamp(0.0, 1.0) } else { 0.0 };
            values.push((edge(i) + within * cell) as f32);
        }
        Self { values }
    }

    #[inline]
    fn sample(&self, u: f32) -> f32 {
        let steps = self.values.len() - 1;
        let position = u * steps as f32;
        let step = (position as usize).min(steps - 1);
        let (a, b) = (self.values[step], self.values[step + 1]);
        a + (b - a) * (position - step as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILTERS: [PixelFilter; 5] = [
        PixelFilter::Box { radius: [0.5, 0.5] },
        PixelFilter::Triangle { radius: [2.0, 1.0] },
        PixelFilter::Gaussian { radius: [1.5, 1.5], sigma: 0.5 },
        PixelFilter::Mitchell { radius: [2.0, 2.0], b: 1.0 / 3.0, c: 1.0 / 3.0 },
        PixelFilter::Sinc { radius: [4.0, 4.0], tau: 3.0 },
    ];

    #[test]
    fn samples_follow_the_positive_part_of_each_filter() {
        const BINS: usize = 40;
        let n = 200_000;
        for filter in FILTERS {
            let sampler = FilterSampler::new(&filter);
            let radius = f64::from(radius(&filter)[0]);
            let bin = 2.0 * radius / BINS as f64;
            let mut counts = [0.0; BINS];
            for i in 0..n {
                let x = f64::from(sampler.sample(Vec2::splat((i as f32 + 0.5) / n as f32)).x);
                counts[((x + radius) / bin).clamp(0.0, BINS as f64 - 1.0) as usize] += 1.0 / f64::from(n);
            }
            let fine = 1000;
            let mass = |b: usize| -> f64 {
                let at = |i: usize| -radius + bin * (b as f64 + (i as f64 + 0.5) / f64::from(fine));
                (0..fine as usize).map(|i| profile(&filter, 0, at(i)).max(0.0)).sum()
            };
            let total: f64 = (0..BINS).map(mass).sum();
            for (b, count) in counts.iter().enumerate() {
                let expected = mass(b) / total;
                assert!((count - expected).abs() < 1.0 / Quantiles::STEPS as f64, "{filter:?}, bin {b}");
            }
        }
    }

    #[test]
    fn samples_stay_within_the_radius_and_their_mean_is_the_centre() {
        for filter in FILTERS {
            let sampler = FilterSampler::new(&filter);
            let n = 10_000;
            let mut mean = Vec2::ZERO;
            for i in 0..n {
                let p = sampler.sample(Vec2::splat((i as f32 + 0.5) / n as f32));
                assert!(p.abs().cmple(Vec2::from(radius(&filter))).all());
                mean += p / n as f32;
            }
            assert!(mean.abs().max_element() < 2e-3, "{filter:?} {mean}");
        }
    }

    #[test]
    fn filters_without_width_sample_the_centre() {
        for filter in [
            PixelFilter::Triangle { radius: [0.0, 0.0] },
            PixelFilter::Gaussian { radius: [1.5, 1.5], sigma: 1e-7 },
            PixelFilter::Gaussian { radius: [1.5, 1.5], sigma: 0.0 },
        ] {
            assert_eq!(FilterSampler::new(&filter).sample(Vec2::new(0.3, 0.9)), Vec2::ZERO, "{filter:?}");
        }
    }
}
