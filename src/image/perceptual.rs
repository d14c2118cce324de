//! Computes perceptual differences between an image and its reference. They compare sRGB-encoded values
//! clamped to [0, 1], as a display shows them.
//!
//! | metric | formula |
//! | --- | --- |
//! | [`Pair::psnr`] | 10 log₁₀(1 / ⟨(x' − r')²⟩) in dB, x' and r' sRGB-encoded and clamped |
//! | [`Pair::ssim`] | structural similarity (Wang et al. 2004) of 8-bit luma, as `image-compare` computes it |
//! | [`Pair::flip`] | mean of LDR-ꟻLIP (Andersson et al. 2020) at 67 pixels per degree, NVIDIA's code |
//!
//! `image-compare` computes SSIM over disjoint windows of 8×8 pixels and averages them by area:
//! (2 μx μr + C₁)(2 Sxr + C₂) / ((μx² + μr² + C₁)(Sxx + Srr + C₂)), C₁ = (0.01·255)²,
//! C₂ = (0.03·255)². Its S are *sums* of squares over a window where Wang et al. use means, which makes
//! C₂ 64 times weaker: flat, slightly noisy regions score lower than in the original. These values
//! compare images with each other, but not with published numbers.

use image::{DynamicImage, GrayImage, RgbImage};
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageFloat, FlipImageRgb8};

use super::Planes;
use super::metrics::Pair;
use super::tone::{srgb_encode, to_srgb8};

/// A ꟻLIP map: 0 where no difference is visible, 1 where it is largest.
pub struct FlipMap {
    /// Mean over the compared pixels.
    pub mean: f64,
    map: FlipImageFloat,
}

impl FlipMap {
    /// The map itself: 1 plane.
    pub fn values(&self) -> Planes {
        let mut planes = Planes::new(self.map.width() as usize, self.map.height() as usize, 1);
        planes.data_mut().copy_from_slice(&self.map.to_vec());
        planes
    }

    /// The map in the magma colour map, black to pale yellow, as interleaved 8-bit RGB.
    pub fn colours(&self) -> Vec<u8> {
        self.map.apply_color_lut(&nv_flip::magma_lut()).to_vec()
    }
}

impl Pair<'_> {
    /// Peak signal-to-noise ratio in decibels; infinite for equal images.
    pub fn psnr(&self) -> f64 {
        let encoded_mse = self.mean(|x, r| {
            let difference = f64::from(srgb_encode(x as f32)) - f64::from(srgb_encode(r as f32));
            difference * difference
        });
        -10.0 * encoded_mse.log10()
    }

    /// Structural similarity of luma: 1 for equal images, down to -1.
    pub fn ssim(&self) -> f64 {
        let [image, reference] = [self.image, self.reference].map(|planes| self.luma(planes));
        let algorithm = image_compare::Algorithm::MSSIMSimple;
        image_compare::gray_similarity_structure(&algorithm, &image, &reference)
            .expect("the images of a pair have equal sizes, the only requirement")
            .score
    }

    /// The ꟻLIP map, with its mean.
    pub fn flip(&self) -> FlipMap {
        let [image, reference] = [self.image, self.reference].map(|planes| {
            let (width, height) = dimensions(planes);
            FlipImageRgb8::with_data(width, height, &self.srgb8(planes))
        });
        let map = nv_flip::flip(reference, image, DEFAULT_PIXELS_PER_DEGREE);
        let values = map.to_vec();
        let compared = values.iter().zip(&self.compared).filter(|(_, compared)| **compared);
        let sum: f64 = compared.map(|(value, _)| f64::from(*value)).sum();
        FlipMap { mean: sum / (self.compared.len() - self.excluded()) as f64, map }
    }

    /// Encodes an image as 8-bit sRGB. Pixels that are not compared become black in both images, so
    /// that they do not differ.
    fn srgb8(&self, planes: &Planes) -> Vec<u8> {
        let mut bytes = to_srgb8(planes, 0.0);
        for (pixel, compared) in bytes.chunks_exact_mut(3).zip(&self.compared) {
            if !compared {
                pixel.fill(0);
            }
        }
        bytes
    }

    /// Converts an image to 8-bit luma.
    fn luma(&self, planes: &Planes) -> GrayImage {
        let (width, height) = dimensions(planes);
        let rgb =
            RgbImage::from_raw(width, height, self.srgb8(planes)).expect("srgb8 gives three bytes per pixel");
        DynamicImage::ImageRgb8(rgb).into_luma8()
    }
}

fn dimensions(planes: &Planes) -> (u32, u32) {
    (planes.width() as u32, planes.height() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::tone::srgb_decode;

    fn grey(width: usize, height: usize, encoded: impl Fn(usize) -> f32) -> Planes {
        let mut planes = Planes::new(width, height, 3);
        for plane in planes.planes_mut() {
            for (pixel, value) in plane.iter_mut().enumerate() {
                *value = srgb_decode(encoded(pixel));
            }
        }
        planes
    }

    #[test]
    fn equal_images_have_no_visible_difference() {
        for (width, height) in [(1, 1), (1, 9), (20, 13)] {
            let image = grey(width, height, |pixel| (pixel % 7) as f32 / 6.0);
            let pair = Pair::new(&image, &image).unwrap();
            assert_eq!(pair.psnr(), f64::INFINITY);
            assert_eq!(pair.ssim(), 1.0);
            assert_eq!(pair.flip().mean, 0.0);
        }
    }

    #[test]
    fn a_tenth_of_the_encoded_range_is_twenty_decibels() {
        let (image, reference) = (grey(8, 8, |_| 0.6), grey(8, 8, |_| 0.5));
        let pair = Pair::new(&image, &reference).unwrap();
        assert!((pair.psnr() - 20.0).abs() < 1e-4);
    }

    #[test]
    fn values_above_the_display_range_are_no_visible_difference() {
        let (mut image, mut reference) = (Planes::new(16, 16, 3), Planes::new(16, 16, 3));
        image.data_mut().fill(5.0);
        reference.data_mut().fill(50.0);
        let pair = Pair::new(&image, &reference).unwrap();
        assert_eq!((pair.psnr(), pair.ssim(), pair.flip().mean), (f64::INFINITY, 1.0, 0.0));
    }

    #[test]
    fn flat_images_have_the_ssim_of_the_formula() {
        let (image, reference) = (grey(8, 8, |_| 0.6), grey(8, 8, |_| 0.4));
        let pair = Pair::new(&image, &reference).unwrap();
        let (x, r, c1) = (153.0, 102.0, 2.55_f64 * 2.55);
        let expected = (2.0 * x * r + c1) / (x * x + r * r + c1);
        assert!((pair.ssim() - expected).abs() < 1e-12);
    }

    #[test]
    fn black_against_white_is_a_large_flip_and_a_small_step_a_small_one() {
        let flip = |from: f32, to: f32| {
            let (image, reference) = (grey(32, 32, |_| to), grey(32, 32, |_| from));
            Pair::new(&image, &reference).unwrap().flip().mean
        };
        assert!(flip(0.0, 1.0) > 0.9);
        assert!((0.005..0.2).contains(&flip(0.5, 0.55)), "{}", flip(0.5, 0.55));
    }

    #[test]
    fn the_error_image_is_black_where_nothing_differs() {
        let image = grey(4, 2, |_| 0.3);
        let colours = Pair::new(&image, &image).unwrap().flip().colours();
        assert_eq!(colours.len(), 3 * 4 * 2);
        // The first entry of magma.
        assert!(colours.chunks_exact(3).all(|pixel| pixel == [0, 0, 4] || pixel == [0, 0, 3]));
    }

    #[test]
    fn pixels_that_are_not_finite_are_not_compared() {
        let (mut image, reference) = (grey(16, 16, |_| 0.5), grey(16, 16, |_| 0.5));
        image.plane_mut(0)[5] = f32::NAN;
        let pair = Pair::new(&image, &reference).unwrap();
        assert_eq!((pair.psnr(), pair.ssim(), pair.flip().mean), (f64::INFINITY, 1.0, 0.0));
    }
}
