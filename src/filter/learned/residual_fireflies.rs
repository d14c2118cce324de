//! Dims the fireflies that the kernels left: pixels of the filtered image that are far brighter than those around them.
//!
//! A pixel gets at most twice the luminance of the third brightest around it, and at most twice that relative to its albedo, whichever is
//! more. What its samples confirm stays, and so do pixels in whose window emission is directly visible: a lamp may be small. The rule is our
//! own.

use rayon::prelude::*;

use super::input_statistics::InputStatistics;
use super::mixture::divisor;
use crate::filter::common::TASK_PIXELS;
use crate::filter::common::fireflies::pixel_luminance;
use crate::image::{Planes, luminance};

/// Radius of the window around a pixel, in pixels.
pub const REACH: usize = 2;

/// Rank of the pixel of the window that a pixel is compared with.
const RANK: usize = 3;

/// Greatest luminance relative to that pixel's.
const MAX_RATIO: f32 = 2.0;

/// Standard errors below the mean of a pixel's samples that its luminance may keep in any case.
const CONFIDENCE: f32 = 2.0;

/// Returns the factors that dim the fireflies of a filtered image, row by row. They are 1 elsewhere.
pub fn factors(image: &Planes, statistics: &InputStatistics) -> Vec<f32> {
    let of_pixels = |value: &(dyn Fn(usize) -> f32 + Sync)| -> Vec<f32> {
        (0..image.pixels()).into_par_iter().with_min_len(TASK_PIXELS).map(value).collect()
    };
    let luminances = of_pixels(&|i| pixel_luminance(image, i));
    let size = (image.width(), image.height());
    of_pixels(&|i| {
        // Return early at nearly all pixels
        let own = luminances[i];
        let brighter = window(i, size).filter(|&j| MAX_RATIO * luminances[j] >= own);
        if brighter.take(RANK).count() == RANK || !own.is_finite() {
            return 1.0;
        }
        match bound(i, size, &luminances, statistics) {
            Some(bound) if bound < own => bound / own,
            _ => 1.0,
        }
    })
}

/// Returns the largest luminance of pixel `i`; `None` if it has no bound. Black surroundings give none, since all light there is rare.
fn bound(i: usize, size: (usize, usize), luminances: &[f32], statistics: &InputStatistics) -> Option<f32> {
    let shows_emission = |j: usize| pixel_luminance(&statistics.emission, j) > 0.0;
    if shows_emission(i) || window(i, size).any(shows_emission) {
        return None;
    }
    let albedo = |j: usize| luminance([0, 1, 2].map(|c| divisor(statistics.albedo.mean.plane(c)[j])));
    let by_window = MAX_RATIO * ranked(window(i, size).map(|j| luminances[j]));
    let by_albedo = MAX_RATIO * albedo(i) * ranked(window(i, size).map(|j| luminances[j] / albedo(j)));
    let count = statistics.count[i];
    // One sample confirms nothing
    let confirmed = if count > 1.0 {
        pixel_luminance(&statistics.colour, i) - CONFIDENCE * statistics.deviation[i] / count.sqrt()
    } else {
        0.0
    };
    (by_window > 0.0).then(|| by_window.max(by_albedo).max(confirmed))
}

/// Returns the number of rank [`RANK`], counted from the largest; 0 if there are fewer numbers.
fn ranked(numbers: impl Iterator<Item = f32>) -> f32 {
    let mut largest = [0.0_f32; RANK];
    for mut number in numbers {
        for kept in &mut largest {
            (*kept, number) = (kept.max(number), kept.min(number));
        }
    }
    largest[RANK - 1]
}

/// Returns the other pixels of the window around pixel `i`, mirrored at the border of the image, so that a line that meets it goes on.
fn window(i: usize, (width, height): (usize, usize)) -> impl Iterator<Item = usize> {
    let mirrored = |at: usize, offset: isize, size: usize| {
        let last = size as isize - 1;
        let at = (at as isize + offset).abs();
        (if at > last { 2 * last - at } else { at }).max(0) as usize
    };
    let (x, y) = (i % width, i / width);
    let offsets = -(REACH as isize)..=REACH as isize;
    offsets
        .clone()
        .flat_map(move |dy| offsets.clone().map(move |dx| (dx, dy)))
        .map(move |(dx, dy)| mirrored(y, dy, height) * width + mirrored(x, dx, width))
        .filter(move |&j| j != i)
}

#[cfg(test)]
mod tests {
    use super::super::input_statistics::FeatureMoments;
    use super::*;

    const SIZE: (usize, usize) = (9, 7);

    /// Statistics of samples whose mean is an image.
    fn statistics(image: &Planes, deviation: f32, count: f32) -> InputStatistics {
        let constant = |value: f32, count: usize| {
            let mut planes = Planes::new(image.width(), image.height(), count);
            planes.data_mut().fill(value);
            planes
        };
        let plane = |value: f32| vec![value; image.pixels()];
        let feature = || FeatureMoments { mean: constant(0.5, 3), deviation: plane(0.0) };
        InputStatistics {
            scale: 1.0,
            colour: image.clone(),
            deviation: plane(deviation),
            difference: plane(0.0),
            emission: constant(0.0, 3),
            albedo: feature(),
            normal: feature(),
            second_normal: constant(0.0, 3),
            position_deviation: plane(0.0),
            hit: constant(1.0, 1),
            count: plane(count),
        }
    }

    /// An image of 1 with pixels of another value.
    fn image((width, height): (usize, usize), pixels: &[(usize, usize)], value: f32) -> Planes {
        let mut image = Planes::new(width, height, 3);
        image.data_mut().fill(1.0);
        set(&mut image, pixels, value);
        image
    }

    fn set(image: &mut Planes, pixels: &[(usize, usize)], value: f32) {
        let width = image.width();
        for plane in image.planes_mut() {
            pixels.iter().for_each(|&(x, y)| plane[y * width + x] = value);
        }
    }

    /// The factors of pixels ten times as bright as the others, if their samples have a deviation; those of the others are 1.
    fn factors_of(bright: &[(usize, usize)], deviation: f32, count: f32) -> Vec<f32> {
        let image = image(SIZE, bright, 10.0);
        let mut found = factors(&image, &statistics(&image, deviation, count));
        let of_bright =
            bright.iter().map(|(x, y)| std::mem::replace(&mut found[y * SIZE.0 + x], 1.0)).collect();
        assert!(found.iter().all(|&factor| factor == 1.0));
        of_bright
    }

    #[test]
    fn up_to_three_bright_pixels_are_dimmed_in_the_middle_and_at_the_border() {
        for at in [(4, 3), (0, 3), (1, 1), (8, 6), (0, 0)] {
            assert_eq!(factors_of(&[at], 20.0, 4.0), [0.2], "{at:?}");
        }
        assert_eq!(factors_of(&[(4, 3), (5, 3), (4, 4)], 20.0, 4.0), [0.2; 3]);
    }

    #[test]
    fn groups_and_lines_to_the_border_stay() {
        assert_eq!(factors_of(&[(4, 3), (5, 3), (4, 4), (5, 4)], 20.0, 4.0), [1.0; 4]);
        let line = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|x| (x, 3));
        assert_eq!(factors_of(&line, 20.0, 1.0), [1.0; 9]);
    }

    #[test]
    fn what_samples_confirm_stays() {
        assert_eq!(factors_of(&[(4, 3)], 0.0, 4.0), [1.0]);
        assert_eq!(factors_of(&[(4, 3)], 4.0, 4.0), [0.6], "the mean less two standard errors");
        assert_eq!(factors_of(&[(4, 3)], 40.0, 1e6), [0.992]);
        assert_eq!(factors_of(&[(4, 3)], 0.0, 1.0), [0.2], "one sample confirms nothing");
    }

    #[test]
    fn lamps_and_what_the_albedo_explains_stay() {
        let image = image(SIZE, &[(4, 3)], 10.0);
        let unconfirmed = || statistics(&image, 20.0, 1.0);
        let all_stay = |statistics| factors(&image, &statistics).iter().all(|&factor| factor == 1.0);
        assert!(!all_stay(unconfirmed()));
        // A lamp beside the pixel
        let mut lit = unconfirmed();
        set(&mut lit.emission, &[(5, 3)], 0.1);
        assert!(all_stay(lit));
        // A white speck on a black floor
        let mut textured = unconfirmed();
        set(&mut textured.albedo.mean, &[(4, 3)], 5.0);
        assert!(all_stay(textured));
    }

    #[test]
    fn tiny_dark_and_unbounded_images_stay() {
        for size in [(0, 0), (1, 1), (2, 1), (1, 3), (2, 2)] {
            let image = image(size, &[], 1.0);
            assert!(
                factors(&image, &statistics(&image, 1.0, 1.0)).iter().all(|&factor| factor == 1.0),
                "{size:?}"
            );
        }
        let black = image(SIZE, &[], 0.0);
        for (background, value) in [(0.0, 1.0), (1.0, f32::INFINITY), (1.0, f32::NAN)] {
            let mut image = black.clone();
            image.data_mut().fill(background);
            set(&mut image, &[(4, 3)], value);
            assert!(factors(&image, &statistics(&image, 2.0, 1.0)).iter().all(|&factor| factor == 1.0));
        }
    }

    #[test]
    fn the_unit_of_radiance_does_not_matter() {
        for scale in [1e-6, 1e6] {
            let mut image = image(SIZE, &[(4, 3)], 10.0);
            image.data_mut().iter_mut().for_each(|v| *v *= scale);
            let found = factors(&image, &statistics(&image, 4.0 * scale, 4.0));
            assert!((found[3 * SIZE.0 + 4] - 0.6).abs() < 1e-5);
        }
    }
}
