//! Computes errors of an image with respect to a reference, on linear light.
//!
//! x is a value of the image, r the corresponding value of the reference, ⟨·⟩ the mean over pixels and
//! channels.
//!
//! | metric | formula |
//! | --- | --- |
//! | [`Pair::mse`] | ⟨(x − r)²⟩ |
//! | [`Pair::relmse`] | ⟨(x − r)² / (r² + 0.01)⟩ (Rousselle, Knaus, Zwicker 2011) |
//! | [`Pair::block_relmse`] | the same, after both images are averaged over blocks of 16×16 pixels |
//! | [`Pair::mean_ratio`] | ⟨x⟩ / ⟨r⟩ |
//!
//! [`super::perceptual`] has the perceptual metrics.

use rayon::prelude::*;

use super::Planes;

/// Constant in relMSE's denominator, which bounds the weight of dark pixels.
pub const RELMSE_EPSILON: f64 = 0.01;

/// Side of the blocks of [`Pair::block_relmse`] in pixels. The noise of a path tracer averages out over
/// 256 pixels; differences of light and materials remain.
pub const BLOCK_SIDE: usize = 16;

/// The reason why two images cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MetricError {
    #[error(
        "the sizes differ: the image is {}x{}, the reference is {}x{}",
        image[0], image[1], reference[0], reference[1]
    )]
    SizesDiffer { image: [usize; 2], reference: [usize; 2] },
    #[error("the image has {image} channels, the reference has {reference}")]
    ChannelsDiffer { image: usize, reference: usize },
    #[error("no pixel is finite in both images")]
    NothingToCompare,
}

/// An image and its reference, of equal size, with at least one pixel that can be compared.
///
/// Every metric excludes pixels that are NaN or infinite in some channel of either image.
#[derive(Clone, Debug)]
pub struct Pair<'a> {
    pub(super) image: &'a Planes,
    pub(super) reference: &'a Planes,
    /// Whether each pixel is finite in both images.
    pub(super) compared: Vec<bool>,
    /// Number of pixels of the image that are not finite.
    pub image_non_finite: usize,
    /// Number of pixels of the reference that are not finite.
    pub reference_non_finite: usize,
}

impl<'a> Pair<'a> {
    /// Pairs an image with its reference.
    ///
    /// # Errors
    /// [`MetricError`] if sizes or numbers of planes differ, or no pixel is finite in both.
    pub fn new(image: &'a Planes, reference: &'a Planes) -> Result<Self, MetricError> {
        let sizes = [image, reference].map(|planes| [planes.width(), planes.height()]);
        if sizes[0] != sizes[1] {
            return Err(MetricError::SizesDiffer { image: sizes[0], reference: sizes[1] });
        }
        if image.count() != reference.count() {
            let (image, reference) = (image.count(), reference.count());
            return Err(MetricError::ChannelsDiffer { image, reference });
        }
        let [image_finite, reference_finite] = [image, reference].map(finite_pixels);
        let compared: Vec<_> = image_finite.iter().zip(&reference_finite).map(|(a, b)| *a && *b).collect();
        if image.count() == 0 || !compared.contains(&true) {
            return Err(MetricError::NothingToCompare);
        }
        let count_non_finite = |finite: &[bool]| finite.iter().filter(|finite| !**finite).count();
        Ok(Self {
            image,
            reference,
            compared,
            image_non_finite: count_non_finite(&image_finite),
            reference_non_finite: count_non_finite(&reference_finite),
        })
    }

    /// Number of pixels excluded because they are not finite in one of the images.
    pub fn excluded(&self) -> usize {
        self.compared.iter().filter(|compared| !**compared).count()
    }

    /// Mean squared error: ⟨(x − r)²⟩.
    pub fn mse(&self) -> f64 {
        self.mean(|x, r| (x - r) * (x - r))
    }

    /// Relative mean squared error: ⟨(x − r)² / (r² + 0.01)⟩.
    pub fn relmse(&self) -> f64 {
        self.mean(relative_squared_error)
    }

    /// Ratio of the means: ⟨x⟩ / ⟨r⟩; 1 if both images are black, infinite if only the reference is.
    pub fn mean_ratio(&self) -> f64 {
        let (image, reference) = (self.mean(|x, _| x), self.mean(|_, r| r));
        if image == reference { 1.0 } else { image / reference }
    }

    /// relMSE of the two images, averaged over blocks of [`BLOCK_SIDE`]² pixels.
    ///
    /// Blocks at the right and lower border are smaller; a block is weighted by its compared pixels.
    pub fn block_relmse(&self) -> f64 {
        let block_rows = self.image.height().div_ceil(BLOCK_SIDE);
        let sums = (0..block_rows).into_par_iter().map(|row| self.block_row_sum(row));
        // A parallel sum would depend on the division of the work among threads.
        sums.collect::<Vec<_>>().iter().sum::<f64>() / self.values()
    }

    /// Sum over one row of blocks of their relative squared error times their compared pixels.
    fn block_row_sum(&self, block_row: usize) -> f64 {
        let (width, height) = (self.image.width(), self.image.height());
        let rows = block_row * BLOCK_SIDE..((block_row + 1) * BLOCK_SIDE).min(height);
        let mut sum = 0.0;
        for plane in 0..self.image.count() {
            for x0 in (0..width).step_by(BLOCK_SIDE) {
                let (mut image, mut reference, mut pixels) = (0.0, 0.0, 0.0);
                for y in rows.clone() {
                    for x in x0..(x0 + BLOCK_SIDE).min(width) {
                        if self.compared[y * width + x] {
                            image += f64::from(self.image.at(plane, x, y));
                            reference += f64::from(self.reference.at(plane, x, y));
                            pixels += 1.0;
                        }
                    }
                }
                if pixels > 0.0 {
                    sum += pixels * relative_squared_error(image / pixels, reference / pixels);
                }
            }
        }
        sum
    }

    /// Mean of a term over the compared pixels and all channels. The result does not depend on the number
    /// of threads.
    pub(super) fn mean(&self, term: impl Fn(f64, f64) -> f64 + Sync) -> f64 {
        let width = self.image.width();
        let row_sum = |y: usize| {
            let compared = &self.compared[y * width..][..width];
            let planes =
                (0..self.image.count()).map(|plane| {
                    let values = self.image.row(plane, y).iter().zip(self.reference.row(plane, y));
                    let terms = values.zip(compared).map(|((&x, &r), &compared)| {
                        if compared { term(f64::from(x), f64::from(r)) } else { 0.0 }
                    });
                    terms.sum::<f64>()
                });
            planes.sum::<f64>()
        };
        let sums: Vec<f64> = (0..self.image.height()).into_par_iter().map(row_sum).collect();
        sums.iter().sum::<f64>() / self.values()
    }

    /// Number of compared values: pixels × channels.
    fn values(&self) -> f64 {
        ((self.compared.len() - self.excluded()) * self.image.count()) as f64
    }
}

fn relative_squared_error(x: f64, r: f64) -> f64 {
    (x - r) * (x - r) / (r * r + RELMSE_EPSILON)
}

/// Whether each pixel is finite in every plane.
fn finite_pixels(planes: &Planes) -> Vec<bool> {
    let mut finite = vec![true; planes.pixels()];
    for plane in 0..planes.count() {
        for (finite, value) in finite.iter_mut().zip(planes.plane(plane)) {
            *finite &= value.is_finite();
        }
    }
    finite
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(width: usize, height: usize, value: f32) -> Planes {
        let mut planes = Planes::new(width, height, 3);
        planes.data_mut().fill(value);
        planes
    }

    #[test]
    fn a_constant_offset_has_the_errors_of_the_formulas() {
        let (image, reference) = (filled(40, 20, 0.5), filled(40, 20, 0.25));
        let pair = Pair::new(&image, &reference).unwrap();
        assert_eq!(pair.mse(), 0.0625);
        assert!((pair.relmse() - 0.0625 / (0.0625 + 0.01)).abs() < 1e-15);
        assert!((pair.block_relmse() - pair.relmse()).abs() < 1e-15);
        assert_eq!(pair.mean_ratio(), 2.0);
        assert_eq!(pair.excluded(), 0);
    }

    #[test]
    fn errors_are_averaged_over_pixels_and_channels() {
        let (mut image, reference) = (filled(2, 1, 1.0), filled(2, 1, 1.0));
        image.plane_mut(1)[0] = 4.0;
        let pair = Pair::new(&image, &reference).unwrap();
        assert_eq!(pair.mse(), 9.0 / 6.0);
        assert!((pair.relmse() - 9.0 / 1.01 / 6.0).abs() < 1e-12);
        assert!((pair.mean_ratio() - 9.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn noise_that_averages_out_in_a_block_is_no_block_error() {
        let (mut image, reference) = (filled(32, 16, 1.0), filled(32, 16, 1.0));
        for (i, value) in image.data_mut().iter_mut().enumerate() {
            *value += if i % 2 == 0 { 0.5 } else { -0.5 };
        }
        let pair = Pair::new(&image, &reference).unwrap();
        assert_eq!(pair.mse(), 0.25);
        assert_eq!(pair.block_relmse(), 0.0);
    }

    #[test]
    fn a_border_block_is_weighted_by_its_pixels() {
        let (mut image, reference) = (filled(17, 1, 0.0), filled(17, 1, 0.0));
        for plane in 0..3 {
            image.plane_mut(plane)[16] = 0.1;
        }
        let pair = Pair::new(&image, &reference).unwrap();
        assert!((pair.block_relmse() - 1.0 / 17.0).abs() < 1e-7);
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_and_left_out() {
        let (mut image, mut reference) = (filled(4, 1, 0.5), filled(4, 1, 0.25));
        image.plane_mut(0)[0] = f32::NAN;
        image.plane_mut(2)[1] = f32::INFINITY;
        reference.plane_mut(1)[1] = f32::NAN;
        let pair = Pair::new(&image, &reference).unwrap();
        assert_eq!((pair.image_non_finite, pair.reference_non_finite, pair.excluded()), (2, 1, 2));
        assert_eq!(pair.mse(), 0.0625);
        assert!((pair.block_relmse() - 0.0625 / 0.0725).abs() < 1e-15);
        assert_eq!(pair.mean_ratio(), 2.0);
    }

    #[test]
    fn images_that_cannot_be_compared_are_errors() {
        let (small, large) = (filled(2, 3, 0.0), filled(3, 2, 0.0));
        let error = Pair::new(&small, &large).unwrap_err();
        assert_eq!(error.to_string(), "the sizes differ: the image is 2x3, the reference is 3x2");
        assert!(matches!(
            Pair::new(&small, &Planes::new(2, 3, 1)),
            Err(MetricError::ChannelsDiffer { image: 3, reference: 1 })
        ));
        let nan = filled(2, 3, f32::NAN);
        assert_eq!(Pair::new(&nan, &small).unwrap_err(), MetricError::NothingToCompare);
        for (width, height) in [(0, 0), (0, 4), (4, 0)] {
            let empty = Planes::new(width, height, 3);
            assert_eq!(Pair::new(&empty, &empty).unwrap_err(), MetricError::NothingToCompare);
        }
    }

    #[test]
    fn black_against_black_has_the_ratio_one() {
        let black = filled(3, 3, 0.0);
        assert_eq!(Pair::new(&black, &black).unwrap().mean_ratio(), 1.0);
    }
}
