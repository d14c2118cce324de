//! Makes squared errors relative to an image, as in relMSE.

use crate::image::Planes;
use crate::image::metrics::RELMSE_EPSILON;

/// Returns the mean over channels of squared errors (1 or 3 planes), relative to `image` as in relMSE.
pub fn relative_error(squares: &Planes, image: &Planes) -> Planes {
    let mut map = Planes::new(image.width(), image.height(), 1);
    for channel in 0..3 {
        let squares = squares.plane(channel.min(squares.count() - 1));
        for ((out, square), value) in map.data_mut().iter_mut().zip(squares).zip(image.plane(channel)) {
            *out += relative(*square, *value) / 3.0;
        }
    }
    map
}

/// Returns the squared error of one value relative to it, as in relMSE.
pub fn relative(square: f32, value: f32) -> f32 {
    square / (value * value + RELMSE_EPSILON as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_relative_to_the_image_as_the_target_is() {
        let mut image = Planes::new(1, 1, 3);
        image.data_mut().copy_from_slice(&[0.0, 1.0, 2.0]);
        let mut error = Planes::new(1, 1, 1);
        error.data_mut()[0] = 0.02;
        let expected = (0.02 / 0.01 + 0.02 / 1.01 + 0.02 / 4.01) / 3.0;
        assert!((relative_error(&error, &image).data()[0] - expected).abs() < 1e-6);
    }
}
