//! Dims dots: pixels that are far brighter than those around them, which rare samples cause and a filter leaves over.
//!
//! A pixel gets at most [`MAX_RATIO`] times the luminance of the third brightest of those around it, unless its samples confirm that it
//! is brighter, or it shows a lamp, which may be small.

use rayon::prelude::*;

use super::input_statistics::InputStatistics;
use crate::filter::common::fireflies::pixel_luminance;
use crate::filter::common::padded_planes::{Margin, PaddedPlanes};
use crate::image::Planes;

/// Distance along both axes, in pixels, of those around a pixel.
pub const REACH: usize = 2;

/// Greatest luminance relative to that of the third brightest pixel around.
const MAX_RATIO: f32 = 2.0;

/// Standard errors by which the mean of the samples exceeds the bound where it confirms a pixel.
const CONFIDENCE: f32 = 2.0;

/// Returns the factors that dim the dots of a filtered image. They are 1 elsewhere.
pub fn factors(image: &Planes, statistics: &InputStatistics) -> Vec<f32> {
    let (width, height) = (image.width(), image.height());
    let luminances: Vec<f32> =
        (0..image.pixels()).into_par_iter().with_min_len(1024).map(|i| pixel_luminance(image, i)).collect();
    // Nothing beyond the border is brighter than a pixel
    let padded = PaddedPlanes::new(width, height, &[&luminances], REACH, Margin::Value(0.0));

    let mut factors = vec![1.0; image.pixels()];
    factors.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, factors)| {
        for (x, (factor, third)) in
            factors.iter_mut().zip(third_brightest_around(&padded, y, width)).enumerate()
        {
            let (pixel, bound) = (y * width + x, MAX_RATIO * third);
            let is_dot = luminances[pixel] > bound && bound > 0.0;
            if is_dot && !is_lamp(statistics, pixel) && !is_confirmed(statistics, pixel, bound) {
                *factor = bound / luminances[pixel];
            }
        }
    });
    factors
}

/// Returns the third largest luminance around each pixel of a row.
fn third_brightest_around(luminances: &PaddedPlanes, y: usize, width: usize) -> Vec<f32> {
    let [mut first, mut second, mut third] = [(); 3].map(|()| vec![0.0_f32; width]);
    let reach = REACH as isize;
    let offsets = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
    for (dx, dy) in offsets.filter(|&offset| offset != (0, 0)) {
        let row = luminances.span(0, dx, y as isize + dy, width);
        for (((first, second), third), &value) in first.iter_mut().zip(&mut second).zip(&mut third).zip(row) {
            *third = third.max(second.min(value));
            *second = second.max(first.min(value));
            *first = first.max(value);
        }
    }
    third
}

/// Whether a pixel shows directly visible emission.
fn is_lamp(statistics: &InputStatistics, pixel: usize) -> bool {
    pixel_luminance(&statistics.emission, pixel) > 0.0
}

/// Whether a pixel's samples tell that it is brighter than a bound. One sample does not.
fn is_confirmed(statistics: &InputStatistics, pixel: usize, bound: f32) -> bool {
    let count = statistics.count[pixel];
    let standard_error = statistics.deviation[pixel] / count.sqrt();
    let mean = pixel_luminance(&statistics.colour, pixel);
    count > 1.0 && mean - bound > CONFIDENCE * standard_error
}

#[cfg(test)]
mod tests {
    use super::super::input_statistics::FeatureMoments;
    use super::*;

    /// Statistics of pixels with this mean and deviation of the samples, of which they have four.
    fn statistics(colour: &Planes, deviation: f32, emission: f32) -> InputStatistics {
        let (width, height) = (colour.width(), colour.height());
        let constant = |value: f32, count: usize| {
            let mut planes = Planes::new(width, height, count);
            planes.data_mut().fill(value);
            planes
        };
        let plane = |value: f32| vec![value; colour.pixels()];
        let feature = || FeatureMoments { mean: constant(0.5, 3), deviation: plane(0.0) };
        InputStatistics {
            scale: 1.0,
            colour: colour.clone(),
            deviation: plane(deviation),
            difference: plane(0.0),
            emission: constant(emission, 3),
            albedo: feature(),
            normal: feature(),
            second_normal: constant(0.0, 3),
            position_deviation: plane(0.0),
            hit: constant(1.0, 1),
            count: plane(4.0),
        }
    }

    /// A grey image with brighter pixels.
    fn image((width, height): (usize, usize), bright: &[(usize, usize)], value: f32) -> Planes {
        let mut image = Planes::new(width, height, 3);
        image.data_mut().fill(1.0);
        for &(x, y) in bright {
            for plane in image.planes_mut() {
                plane[y * width + x] = value;
            }
        }
        image
    }

    /// The factors of the bright pixels, and the least of the others.
    fn dimmed(bright: &[(usize, usize)], deviation: f32, emission: f32) -> (Vec<f32>, f32) {
        let image = image((9, 7), bright, 10.0);
        let mut factors = factors(&image, &statistics(&image, deviation, emission));
        let of_bright = bright.iter().map(|(x, y)| std::mem::replace(&mut factors[y * 9 + x], 1.0)).collect();
        (of_bright, factors.into_iter().fold(1.0, f32::min))
    }

    #[test]
    fn a_dot_is_dimmed_in_the_middle_and_at_the_border() {
        for at in [(4, 3), (0, 3), (8, 6), (0, 0)] {
            let (of_dot, of_others) = dimmed(&[at], 20.0, 0.0);
            assert!((of_dot[0] - 0.2).abs() < 1e-6, "{at:?}: {of_dot:?}");
            assert_eq!(of_others, 1.0);
        }
        // So are three, of which each has two others
        assert!(dimmed(&[(4, 3), (5, 3), (4, 4)], 20.0, 0.0).0.iter().all(|&factor| factor < 0.21));
    }

    #[test]
    fn highlights_and_lamps_stay() {
        let four = [(4, 3), (5, 3), (4, 4), (5, 4)];
        for (bright, deviation, emission) in
            [(&four[..], 20.0, 0.0), (&four[..1], 2.0, 0.0), (&four[..1], 20.0, 0.1)]
        {
            assert_eq!(dimmed(bright, deviation, emission), (vec![1.0; bright.len()], 1.0));
        }
    }

    #[test]
    fn tiny_and_dark_images_stay() {
        for size in [(0, 0), (1, 1), (2, 1), (1, 3), (2, 2)] {
            let image = image(size, &[], 1.0);
            assert!(
                factors(&image, &statistics(&image, 1.0, 0.0)).iter().all(|&factor| factor == 1.0),
                "{size:?}"
            );
        }
        let mut image = image((9, 7), &[], 1.0);
        image.data_mut().fill(0.0);
        image.plane_mut(1)[31] = 1.0;
        assert!(factors(&image, &statistics(&image, 2.0, 0.0)).iter().all(|&factor| factor == 1.0));
    }
}
