//! An image that several processes filter together: the sums that filters need of all of it, and their results as one.

use super::link::Link;
use crate::filter::{FilterResult, WholeImage};
use crate::image::Planes;
use crate::stats::Rectangle;

/// The image of which this process has a part and a margin.
pub struct SharedImage<'a> {
    pub link: &'a Link,
    /// The part, within the store that is filtered.
    pub part: Rectangle,
}

impl WholeImage for SharedImage<'_> {
    fn part(&self) -> Rectangle {
        self.part
    }

    fn sum(&self, numbers: &mut [i64]) {
        self.link.sum(numbers);
    }

    fn max(&self, number: f32) -> f32 {
        self.link.max(number)
    }
}

/// Gathers the results of all parts in the first process, which gets that of the whole image. `own` is this process's result
/// and the place of its part within that.
pub fn gather_results(
    link: &Link,
    parts: &[Rectangle],
    image: &Rectangle,
    (mut result, place): (FilterResult, Rectangle),
) -> Option<FilterResult> {
    let mut own = Vec::new();
    for planes in planes_of(&mut result) {
        for plane in 0..planes.count() {
            let rows = place.select(planes.plane(plane), planes.width());
            rows.for_each(|row| own.extend_from_slice(bytemuck::cast_slice(row)));
        }
    }
    if link.rank() > 0 {
        link.send_all(&[(0, own)], || ());
        return None;
    }

    // Put the parts in their places
    for planes in planes_of(&mut result) {
        *planes = Planes::new(image.width(), image.height(), planes.count());
    }
    let count: usize = planes_of(&mut result).map(|planes| planes.count()).sum();
    for (from, part) in parts.iter().enumerate() {
        let bytes = if from == 0 {
            std::mem::take(&mut own)
        } else {
            link.receive(from, size_of::<f32>() * count * part.pixels())
        };
        let mut rows = bytes.chunks_exact(size_of::<f32>() * part.width());
        for plane in planes_of(&mut result).flat_map(Planes::planes_mut) {
            let places = plane.chunks_exact_mut(image.width()).skip(part.y[0]).take(part.height());
            for (to, from) in places.zip(&mut rows) {
                bytemuck::cast_slice_mut(&mut to[part.x[0]..part.x[1]]).copy_from_slice(from);
            }
        }
    }
    Some(result)
}

/// Returns all planes of a result. Filters of parts do not interpolate.
fn planes_of(result: &mut FilterResult) -> impl Iterator<Item = &mut Planes> {
    let FilterResult { image, halves, variance, error, residual, risk, .. } = result;
    let [a, b] = halves;
    [image, a, b, variance, error, residual, risk].into_iter()
}
