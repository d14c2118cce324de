//! An estimate of an image that is linear in the noisy values of one half of the samples, with the derivative that
//! Stein's unbiased risk estimate needs.

use crate::image::Planes;

/// A filtered image of one half of the samples.
pub struct LinearEstimate {
    /// 3 planes.
    pub value: Planes,
    /// Filter derivative at the pixel, ∂F ∕ ∂c: the weight of a pixel's own value in its result, in (0, 1].
    pub derivative: Vec<f32>,
}

impl LinearEstimate {
    /// Returns the values themselves, whose derivative is 1.
    pub fn unfiltered(width: usize, height: usize, values: [&[f32]; 3]) -> Self {
        let mut value = Planes::new(width, height, 3);
        value.planes_mut().zip(values).for_each(|(plane, values)| plane.copy_from_slice(values));
        Self { value, derivative: vec![1.0; width * height] }
    }

    /// Restores the values of [`Self::unfiltered`] where a filter changes nothing.
    pub fn restore(&mut self, values: [&[f32]; 3], is_changed: &[bool]) {
        for i in (0..self.derivative.len()).filter(|&i| !is_changed[i]) {
            (0..3).for_each(|channel| self.value.plane_mut(channel)[i] = values[channel][i]);
            self.derivative[i] = 1.0;
        }
    }
}
