//! An image that several processes filter together: the sums that filters need of all of it, and their results as one.

use super::link::Link;
use crate::filter::{FilterResult, PlaneRows, WholeImage};
use crate::image::Planes;
use crate::stats::Rectangle;

/// The image of which this process has a part and a margin.
pub struct SharedImage<'a> {
    pub link: &'a Link,
    /// The part of each process.
    pub parts: &'a [Rectangle],
    /// The same with their margins.
    pub grown: &'a [Rectangle],
}

impl WholeImage for SharedImage<'_> {
    fn part(&self) -> Rectangle {
        let rank = self.link.rank();
        self.parts[rank].within(&self.grown[rank])
    }

    fn sum(&self, numbers: &mut [i64]) {
        self.link.sum(numbers);
    }

    fn max(&self, number: f32) -> f32 {
        self.link.max(number)
    }

    fn complete_margin(&self, planes: &mut dyn PlaneRows, side: usize) {
        let rank = self.link.rank();
        let others = || (0..self.link.size()).filter(|&other| other != rank);
        let shared = |from: usize, to: usize| {
            let pixels = self.parts[from].intersection(&self.grown[to])?.within(&self.grown[rank]);
            let scaled = |[start, end]: [usize; 2]| [start / side, end.div_ceil(side)];
            Some(Rectangle { x: scaled(pixels.x), y: scaled(pixels.y) })
        };
        let message = |to: usize| Some((to, to_bytes(planes, &shared(rank, to)?)));
        let messages: Vec<_> = others().filter_map(message).collect();
        self.link.send_all(&messages, || {
            for (from, part) in others().filter_map(|from| Some((from, shared(from, rank)?))) {
                let bytes = self.link.receive(from, size_of::<f32>() * planes.count() * part.pixels());
                read_bytes(planes, &part, &bytes);
            }
        });
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
    let own: Vec<u8> = planes_of(&mut result).flat_map(|planes| to_bytes(planes, &place)).collect();
    if link.rank() > 0 {
        link.send_all(&[(0, own)], || ());
        return None;
    }

    // Put the parts in their places
    for planes in planes_of(&mut result) {
        *planes = Planes::new(image.width(), image.height(), planes.count());
    }
    let count: usize = planes_of(&mut result).map(|planes| planes.count()).sum();
    let mut own = Some(own);
    for (from, part) in parts.iter().enumerate() {
        let of_plane = size_of::<f32>() * part.pixels();
        let bytes = own.take().unwrap_or_else(|| link.receive(from, count * of_plane));
        let mut rest = &bytes[..];
        for planes in planes_of(&mut result) {
            let (bytes, others) = rest.split_at(planes.count() * of_plane);
            read_bytes(planes, part, bytes);
            rest = others;
        }
    }
    Some(result)
}

/// Returns the values of a rectangle, plane by plane and row by row.
fn to_bytes(planes: &dyn PlaneRows, part: &Rectangle) -> Vec<u8> {
    let rows = (0..planes.count()).flat_map(|plane| (part.y[0]..part.y[1]).map(move |y| (plane, y)));
    let mut bytes = Vec::with_capacity(size_of::<f32>() * planes.count() * part.pixels());
    for (plane, y) in rows {
        bytes.extend_from_slice(bytemuck::cast_slice(&planes.row(plane, y)[part.x[0]..part.x[1]]));
    }
    bytes
}

/// Sets the values of a rectangle to those of [`to_bytes`].
fn read_bytes(planes: &mut dyn PlaneRows, part: &Rectangle, bytes: &[u8]) {
    let rows = (0..planes.count()).flat_map(|plane| (part.y[0]..part.y[1]).map(move |y| (plane, y)));
    for ((plane, y), bytes) in rows.zip(bytes.chunks_exact(size_of::<f32>() * part.width())) {
        bytemuck::cast_slice_mut(&mut planes.row_mut(plane, y)[part.x[0]..part.x[1]]).copy_from_slice(bytes);
    }
}

/// Returns all planes of a result. Filters of parts do not interpolate.
fn planes_of(result: &mut FilterResult) -> impl Iterator<Item = &mut Planes> {
    let FilterResult { image, halves, variance, error, residual, risk, .. } = result;
    let [a, b] = halves;
    [image, a, b, variance, error, residual, risk].into_iter()
}
