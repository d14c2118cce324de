//! Blends the network's image with a second estimate where the samples contradict it, as on detail unlike its training.
//!
//! The image is F₂ + λ(F₁ − F₂), with the learned F₁ and an estimate F₂ that is never far off. Comparison of the filtered
//! halves with the other halves' noisy values c, which they do not contain, tells the best λ as N/Q with
//! N = Σ ρ D_h (c_{1−h} − F₂_h), Q = Σ ρ D_h², D = F₁ − F₂, ρ = 1/(F² + 0.01 F̄²), where the sums extend over halves,
//! channels and, by a blur, surrounding pixels. This observation of λ has the variance V/Q², V = Σ ρ² D_h² v with the variance
//! v of c, which is at least its usual one over a wider surrounding. The prior of λ is normal with mean 1 and deviation [`DOUBT`].
//!
//! With few samples F₂ has specks: pixels that it leaves as they are, as few are like them. Before all this it is blended with F₁ as far as it
//! takes to come within a factor of 1 + n/4 of its luminance, in a pixel of n samples.

use rayon::prelude::*;

use super::dual_image::DualImage;
use crate::filter::common::TASK_PIXELS;
use crate::filter::common::blur;
use crate::filter::common::fireflies::pixel_luminance;
use crate::filter::common::half_counts::HalfCounts;
use crate::filter::whole_image::{self, WholeImage};

/// Standard deviation of the prior of λ.
const DOUBT: f32 = 0.25;

/// Samples with which the factor between both estimates is at most 2.
const LIMIT_SAMPLES: f32 = 4.0;

/// Standard deviation of the blur, in pixels.
const SIGMA: f32 = 4.0;

/// Standard deviation of the blur of the relative variance, in pixels.
const VARIANCE_SIGMA: f32 = 8.0;

/// Floor of the squared brightness in relative errors, in units of the squared mean of the image.
const RELATIVE_FLOOR: f64 = 0.01;

/// Returns the distance in pixels from which pixels can change λ.
pub fn reach() -> usize {
    blur::reach(SIGMA) + blur::reach(VARIANCE_SIGMA)
}

/// Blends the learned image with a second estimate. `fraction` is that of [`fraction_of_learned`].
pub fn blend(learned: &mut DualImage, second: &DualImage, fraction: &[f32]) {
    for (learned, second) in [(&mut learned.mean, &second.mean), (&mut learned.noise, &second.noise)] {
        for (plane, second) in learned.planes_mut().zip(second.data().chunks(second.pixels().max(1))) {
            let values = plane.par_iter_mut().with_min_len(TASK_PIXELS).zip(second).zip(fraction);
            values.for_each(|((value, second), fraction)| *value = second + fraction * (*value - second));
        }
    }
}

/// Computes the fraction of the learned image in each pixel. `noisy` is the unfiltered image, and `emission` the part of it that is directly
/// visible.
pub fn fraction_of_learned(
    learned: &DualImage,
    second: &DualImage,
    noisy: &DualImage,
    emission: Option<&DualImage>,
    counts: &HalfCounts,
    whole: &dyn WholeImage,
) -> Vec<f32> {
    let within_limits = fraction_within_limits(learned, second, emission, counts);
    let mut limited = learned.clone();
    blend(&mut limited, second, &within_limits);
    let mut fraction = lambda(learned, &limited, noisy, counts, whole);
    let fractions = fraction.iter_mut().zip(&within_limits);
    fractions
        .for_each(|(fraction, within_limits)| *fraction = 1.0 - (1.0 - *fraction) * (1.0 - within_limits));
    fraction
}

/// Returns for each pixel the fraction of the learned image that brings the luminance of the second one within its limits: 0 where it is, and
/// where emission is visible, since a lamp may be small.
fn fraction_within_limits(
    learned: &DualImage,
    second: &DualImage,
    emission: Option<&DualImage>,
    counts: &HalfCounts,
) -> Vec<f32> {
    let [n_a, n_b] = counts.floats();
    let fraction = |i: usize| {
        let ratio = 1.0 + (n_a[i] + n_b[i]) / LIMIT_SAMPLES;
        let [own, other] = [learned, second].map(|image| pixel_luminance(&image.mean, i));
        let limited = other.min(ratio * own).max(own / ratio);
        let fraction = (limited - other) / (own - other);
        let emits = || emission.is_some_and(|emission| pixel_luminance(&emission.mean, i) > 0.0);
        // Equal ones have no fraction
        if fraction > 0.0 && !emits() { fraction.min(1.0) } else { 0.0 }
    };
    (0..learned.mean.pixels()).into_par_iter().with_min_len(TASK_PIXELS).map(fraction).collect()
}

/// Computes λ for each pixel.
fn lambda(
    learned: &DualImage,
    second: &DualImage,
    noisy: &DualImage,
    counts: &HalfCounts,
    whole: &dyn WholeImage,
) -> Vec<f32> {
    let (width, height, pixels) = (noisy.mean.width(), noisy.mean.height(), noisy.mean.pixels());
    let level = whole_image::mean(whole, &learned.mean, f32::abs);
    let floor = ((RELATIVE_FLOOR * level * level) as f32).max(f32::MIN_POSITIVE);

    // A pixel's variance is at least the usual one: few samples that all miss the light agree, and are not certain
    let known = known_fraction(width, counts);
    let usual_variance = usual_variance(learned, noisy, &known, floor);

    // Sum over halves and channels. With the mean m and the noise e of a pixel the halves are m ± e
    let [a, b] = counts.floats();
    let mut sums = [(); 3].map(|()| vec![0.0; pixels]);
    for c in 0..3 {
        let planes = [learned, second, noisy].map(|image| [image.mean.plane(c), image.noise.plane(c)]);
        let [n, q, v] = &mut sums;
        let sums = n.par_iter_mut().zip(q).zip(v).enumerate().with_min_len(TASK_PIXELS);
        sums.for_each(|(i, ((n, q), v))| {
            if a[i] == 0.0 || b[i] == 0.0 {
                return;
            }
            let [[f1, e1], [f2, e2], [mean, noise]] = planes.map(|planes| planes.map(|plane| plane[i]));
            let weight = 1.0 / (f1 * f1 + floor);
            let (d, e) = (f1 - f2, e1 - e2);
            *n += weight * (d * (mean - f2) - e * (noise + e2));
            *q += weight * (d * d + e * e);
            *v += weight * (d * d + e * e) * (weight * noise * noise).max(usual_variance[i]);
        });
    }
    let [n, q, v] = sums.map(|plane| blur::gaussian(width, height, &plane, SIGMA));

    let variance_factor = blur::variance_factor(SIGMA);
    let posterior = |i: usize| {
        // Precision of the observation over that of the prior
        let certainty = DOUBT * DOUBT * q[i] * q[i] / (variance_factor * v[i]).max(f32::MIN_POSITIVE);
        let observed = if q[i] > 0.0 { n[i] / q[i] } else { 1.0 };
        if certainty.is_finite() && observed.is_finite() {
            let fraction = (1.0 + (observed - 1.0) * certainty / (1.0 + certainty)).clamp(0.0, 1.0);
            1.0 - known[i] * known[i] * (1.0 - fraction)
        } else {
            1.0
        }
    };
    (0..pixels).into_par_iter().map(posterior).collect()
}

/// Returns the fraction of the surrounding pixels whose variance is known: those with samples of both halves.
fn known_fraction(width: usize, counts: &HalfCounts) -> Vec<f32> {
    let [a, b] = counts.floats();
    let known: Vec<f32> =
        a.iter().zip(b).map(|(&a, &b)| if a > 0.0 && b > 0.0 { 1.0 } else { 0.0 }).collect();
    blur::gaussian(width, known.len() / width.max(1), &known, VARIANCE_SIGMA)
}

/// Returns the variance of `noisy` over the squared brightness, mean of the channels, and over the surrounding pixels where it is
/// known. Elsewhere the noise is 0.
fn usual_variance(learned: &DualImage, noisy: &DualImage, known: &[f32], floor: f32) -> Vec<f32> {
    let (width, height, pixels) = (noisy.mean.width(), noisy.mean.height(), noisy.mean.pixels());
    let relative = |i: usize| {
        let of_channel =
            |c: usize| noisy.noise.plane(c)[i].powi(2) / (learned.mean.plane(c)[i].powi(2) + floor);
        (0..3).map(of_channel).sum::<f32>() / 3.0
    };
    let plane: Vec<f32> = (0..pixels).into_par_iter().with_min_len(TASK_PIXELS).map(relative).collect();
    let mut variance = blur::gaussian(width, height, &plane, VARIANCE_SIGMA);
    variance.iter_mut().zip(known).for_each(|(variance, known)| *variance /= known.max(f32::MIN_POSITIVE));
    variance
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::filter::whole_image::AllPixels;
    use crate::image::Planes;

    const SIDE: usize = 48;

    #[test]
    fn a_speck_is_brought_near_the_learned_image_unless_many_samples_show_it() {
        let image = |speck: [f32; 3]| {
            let mut planes = Planes::new(SIDE, SIDE, 3);
            planes.data_mut().fill(1.0);
            planes.planes_mut().zip(speck).for_each(|(plane, value)| plane[40] = value);
            DualImage::exact(planes)
        };
        for (speck, samples, expected) in [
            ([5.0; 3], 2, [1.5; 3]),
            ([0.1; 3], 2, [1.0 / 1.5; 3]),
            ([0.0; 3], 2, [1.0 / 1.5; 3]),
            ([5.0; 3], 16, [5.0; 3]),
            ([1.2; 3], 2, [1.2; 3]),
            // A colour is not amplified
            ([0.0, 0.0, 1.0], 2, [0.641, 0.641, 1.0]),
        ] {
            let half = || vec![samples / 2; SIDE * SIDE];
            let counts = HalfCounts::new(SIDE, [half(), half()]);
            let limited = |emission: Option<&DualImage>| {
                let mut limited = image([1.0; 3]);
                let fraction = fraction_within_limits(&limited, &image(speck), emission, &counts);
                blend(&mut limited, &image(speck), &fraction);
                assert_eq!(limited.mean.plane(1)[39], 1.0);
                [0, 1, 2].map(|channel| limited.mean.plane(channel)[40])
            };
            for (found, expected) in limited(None).into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-3, "{speck:?} {samples}: {found} {expected}");
            }
            assert_eq!(limited(Some(&image([1.0; 3]))), speck);
        }
    }

    /// Returns λ in the middle of an image of stripes under noise of a deviation, where the learned image lacks the stripes
    /// and the second one does, too, or has them.
    fn fraction(noise: f32, second_has_stripes: bool) -> f32 {
        let mut rng = Pcg32::seed_from_u64(1);
        let stripe = |i: usize| 1.0 + 0.5 * (i % 2) as f32;
        let image = |of: &mut dyn FnMut(usize) -> f32| {
            let mut planes = Planes::new(SIDE, SIDE, 3);
            (0..planes.data().len()).for_each(|i| planes.data_mut()[i] = of(i));
            planes
        };
        let mut halves = [0, 1]
            .map(|_| image(&mut |i| stripe(i) + noise * (rng.random::<f32>() + rng.random::<f32>() - 1.0)));
        let counts = HalfCounts::new(SIDE, [vec![4; SIDE * SIDE], vec![4; SIDE * SIDE]]);
        counts.fill_missing(&mut halves);
        let noisy = DualImage::new(counts.mean([&halves[0], &halves[1]]), halves, &counts);
        let flat = || DualImage { mean: image(&mut |_| 1.25), noise: image(&mut |_| 0.0) };
        let striped = || DualImage { mean: image(&mut |i| stripe(i)), noise: image(&mut |_| 0.0) };
        let (learned, second) = if second_has_stripes { (flat(), striped()) } else { (striped(), flat()) };
        let whole = AllPixels::new(SIDE, SIDE);
        lambda(&learned, &second, &noisy, &counts, &whole)[SIDE * SIDE / 2 + SIDE / 2]
    }

    #[test]
    fn lost_detail_comes_back_if_the_noise_does_not_hide_it() {
        assert!(fraction(0.1, true) < 0.05, "{}", fraction(0.1, true));
        assert!(fraction(50.0, true) > 0.7, "{}", fraction(50.0, true));
        assert!(fraction(0.1, false) > 0.95, "{}", fraction(0.1, false));
    }

    #[test]
    fn pixels_that_miss_the_light_by_chance_are_not_certain() {
        let image = |of: &dyn Fn(usize, usize) -> f32| {
            let mut planes = Planes::new(SIDE, SIDE, 3);
            (0..planes.data().len()).for_each(|i| planes.data_mut()[i] = of(i % SIDE, i / SIDE % SIDE));
            planes
        };
        // One pixel in five has met the light, but none around the middle, where the second image is dark
        let is_missed = |x: usize, y: usize| x.abs_diff(24) < 2 && y.abs_diff(24) < 2;
        let is_lit = |x: usize, y: usize| !is_missed(x, y) && (7 * x + 3 * y).is_multiple_of(5);
        let noisy = DualImage {
            mean: image(&|x, y| if is_lit(x, y) { 5.0 } else { 0.0 }),
            noise: image(&|x, y| if is_lit(x, y) { 5.0 } else { 0.05 }),
        };
        let clean = |mean| DualImage { mean, noise: image(&|_, _| 0.0) };
        let learned = clean(image(&|_, _| 1.0));
        let second = clean(image(&|x, y| if is_missed(x, y) { 0.0 } else { 1.0 }));
        let counts = HalfCounts::new(SIDE, [vec![2; SIDE * SIDE], vec![2; SIDE * SIDE]]);
        let whole = AllPixels::new(SIDE, SIDE);
        let fraction = lambda(&learned, &second, &noisy, &counts, &whole)[24 * SIDE + 24];
        assert!(fraction > 0.5, "{fraction}");
    }

    #[test]
    fn the_learned_image_stays_where_few_pixels_have_samples_of_both_halves() {
        let constant = |value: f32| {
            let mut mean = Planes::new(SIDE, SIDE, 3);
            mean.data_mut().fill(value);
            DualImage::exact(mean)
        };
        let counts = |period: usize| {
            let second = (0..SIDE * SIDE).map(|i| u32::from(i.is_multiple_of(period))).collect();
            HalfCounts::new(SIDE, [vec![1; SIDE * SIDE], second])
        };
        let [learned, second] = [1.0, 2.0].map(constant);
        let whole = AllPixels::new(SIDE, SIDE);
        let fraction = |period| lambda(&learned, &second, &second, &counts(period), &whole)[SIDE * SIDE / 2];
        assert!(fraction(1) < 0.01 && fraction(25) > 0.99, "{} {}", fraction(1), fraction(25));
    }

    #[test]
    fn without_samples_of_both_halves_the_learned_image_stays() {
        let constant = |value: f32| {
            let mut mean = Planes::new(3, 1, 3);
            mean.data_mut().fill(value);
            DualImage { noise: Planes::new(3, 1, 3), mean }
        };
        let counts = HalfCounts::new(3, [vec![1; 3], vec![0; 3]]);
        let [learned, second] = [1.0, 2.0].map(constant);
        let whole = AllPixels::new(3, 1);
        assert_eq!(lambda(&learned, &second, &second, &counts, &whole), [1.0; 3]);
    }
}
