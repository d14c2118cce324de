//! The statistics of a rectangle of pixels: as bytes, as a store of their own, and put into another store.

use rayon::prelude::*;

use super::Store;
use crate::stats::layout::Layout;
use crate::stats::rectangle::Rectangle;
use crate::stats::row::Selection;
use crate::stats::statistics_extent::StatisticsExtent;

impl Store {
    /// Number of bytes of the statistics of a rectangle of this size in a store with this layout and capacity.
    pub fn rectangle_byte_len(
        rectangle: &Rectangle,
        extent: StatisticsExtent,
        layout: &Layout,
        capacity: usize,
    ) -> usize {
        Selection::new(0..rectangle.width(), extent, layout, capacity).byte_len() * rectangle.height()
    }

    /// Converts statistics of a rectangle of pixels to bytes, row by row.
    ///
    /// # Panics
    /// If the rectangle is not within the store.
    pub fn rectangle_to_bytes(&self, rectangle: &Rectangle, extent: StatisticsExtent) -> Vec<u8> {
        let selection = self.select(rectangle, extent);
        let row_bytes = selection.byte_len();
        let mut bytes = vec![0; row_bytes * rectangle.height()];
        let [y0, y1] = rectangle.y;
        let rows = bytes.par_chunks_mut(row_bytes.max(1)).zip(&self.rows()[y0..y1]);
        rows.for_each(|(out, row)| row.put(&selection, out));
        bytes
    }

    /// Replaces statistics of a rectangle of pixels by those of [`Self::rectangle_to_bytes`] of a store with the same layout,
    /// capacity and seed.
    ///
    /// # Panics
    /// If the rectangle is not within the store, or the number of bytes is not [`Self::rectangle_byte_len`].
    pub fn read_rectangle(&mut self, rectangle: &Rectangle, extent: StatisticsExtent, bytes: &[u8]) {
        let selection = self.select(rectangle, extent);
        let row_bytes = selection.byte_len();
        assert_eq!(bytes.len(), row_bytes * rectangle.height(), "the rectangle's bytes");
        let [y0, y1] = rectangle.y;
        let rows = self.rows_mut()[y0..y1].par_iter_mut().zip(bytes.par_chunks(row_bytes.max(1)));
        rows.for_each(|(row, bytes)| row.take(&selection, bytes));
    }

    /// Returns a store of copies of a rectangle of pixels, with reservoirs of this seed.
    ///
    /// # Panics
    /// If the rectangle is not within the store.
    pub fn select_rectangle(&self, rectangle: &Rectangle, seed: u64) -> Self {
        let mut part = Self::for_rectangle(rectangle, self.layout().clone(), self.capacity(), seed);
        part.copy_rectangle(&rectangle.within(rectangle), self, rectangle, StatisticsExtent::All);
        part
    }

    /// Replaces statistics of a rectangle of pixels by those of a rectangle of another store, `place`.
    ///
    /// # Panics
    /// If a rectangle is not within its store, or sizes or layouts differ, or capacities, unless this store keeps no sample vectors.
    pub fn copy_rectangle(
        &mut self,
        rectangle: &Rectangle,
        from: &Self,
        place: &Rectangle,
        extent: StatisticsExtent,
    ) {
        let size = |rectangle: &Rectangle| (rectangle.width(), rectangle.height());
        assert_eq!(size(rectangle), size(place), "the same size");
        assert!(from.layout() == self.layout(), "the same layout");
        assert!([0, from.capacity()].contains(&self.capacity()), "the same sample vectors, or none");
        let selection = Selection::new(place.x[0]..place.x[1], extent, self.layout(), self.capacity());
        let ([y0, y1], x0) = (rectangle.y, rectangle.x[0]);
        let rows = self.rows_mut()[y0..y1].par_iter_mut().zip(&from.rows()[place.y[0]..]);
        rows.for_each(|(to, from)| to.copy_pixels(x0, from, &selection));
    }

    fn select(&self, rectangle: &Rectangle, extent: StatisticsExtent) -> Selection {
        Selection::new(rectangle.x[0]..rectangle.x[1], extent, self.layout(), self.capacity())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Block, Part};

    /// Stores cut into parts take samples in as the whole one does.
    #[test]
    fn parts_put_together_are_the_whole() {
        let (width, height) = (37, 9);
        for (layout, capacity) in [
            (Layout::with_blocks(|block| block == Block::Normal1), 3),
            (Layout::with_blocks(|_| true).restricted_to([Block::Normal1].into_iter().collect()), 0),
        ] {
            let fill = |store: &mut Store, place: &Rectangle, from: usize, to: usize| {
                for (y, x) in
                    (place.y[0]..place.y[1]).flat_map(|y| (place.x[0]..place.x[1]).map(move |x| (y, x)))
                {
                    for k in from..to + (x + y) % 3 {
                        let value = ((x * 7 + y * 13 + k * 5) % 11) as f32;
                        store.push(x - place.x[0], y - place.y[0], &vec![value; layout.len()]);
                    }
                }
            };
            let image = Rectangle::whole(width, height);
            let mut whole = Store::new(width, height, layout.clone(), capacity, 9);
            fill(&mut whole, &image, 0, 4);
            let parts = [[0, 17, 0, 9], [17, 37, 0, 4], [17, 37, 4, 9]]
                .map(|[x0, x1, y0, y1]| Rectangle { x: [x0, x1], y: [y0, y1] });
            // One part starts empty as the whole did, one is copied from it, one takes its bytes
            let mut stores = parts.map(|part| Store::for_rectangle(&part, layout.clone(), capacity, 9));
            let size = |i: usize| parts[i].within(&parts[i]);
            stores[0].copy_rectangle(&size(0), &whole, &parts[0], StatisticsExtent::All);
            fill(&mut stores[1], &parts[1], 0, 4);
            let bytes = whole.rectangle_to_bytes(&parts[2], StatisticsExtent::All);
            stores[2].read_rectangle(&size(2), StatisticsExtent::All, &bytes);
            fill(&mut whole, &image, 4, 9);
            let mut joined = Store::new(width, height, layout.clone(), capacity, 9);
            for (i, (part, store)) in parts.iter().zip(&mut stores).enumerate() {
                fill(store, part, 4, 9);
                joined.copy_rectangle(part, store, &size(i), StatisticsExtent::All);
            }
            assert!(joined.rows() == whole.rows());
        }
    }

    /// Counts and moments of the radiance go through bytes and copies alike, and nothing else does.
    #[test]
    fn an_extent_of_a_rectangle_is_its_counts_and_radiance() {
        let layout = Layout::with_blocks(|_| true).restricted_to([Block::Normal1].into_iter().collect());
        let mut store = Store::new(20, 5, layout.clone(), 0, 9);
        for (y, x) in (0..5).flat_map(|y| (0..20).map(move |x| (y, x))) {
            let value = |dim: usize| (x + 2 * y + dim) as f32;
            store.push(x, y, &(0..layout.len()).map(value).collect::<Vec<_>>());
            store.push(x, y, &(0..layout.len()).map(|dim| 3.0 * value(dim)).collect::<Vec<_>>());
        }
        let place = Rectangle { x: [3, 18], y: [1, 4] };
        let bytes = store.rectangle_to_bytes(&place, StatisticsExtent::Radiance);
        assert_eq!(bytes.len(), place.pixels() * (16 + 3 * 24));
        assert_eq!(bytes.len(), Store::rectangle_byte_len(&place, StatisticsExtent::Radiance, &layout, 0));
        let own = place.within(&place);
        let [mut read, mut copied] = [(); 2].map(|()| Store::for_rectangle(&own, layout.clone(), 0, 9));
        read.read_rectangle(&own, StatisticsExtent::Radiance, &bytes);
        copied.copy_rectangle(&own, &store, &place, StatisticsExtent::Radiance);
        assert!(read.rows() == copied.rows());
        let dims = 0..layout.len();
        let (found, expected) =
            (read.variances(Part::Whole, dims.clone()), store.variances(Part::Whole, dims));
        for dim in 0..layout.len() {
            let expected = place.select(expected.plane(dim), 20).flatten().copied();
            let is_radiance = layout.radiance().contains(&dim);
            let expected: Vec<f32> = expected.map(|v| if is_radiance { v } else { 0.0 }).collect();
            assert_eq!(found.plane(dim), expected, "dimension {dim}");
        }
        assert!(read.counts(Part::Whole).iter().all(|&n| n == 2) && read.samples_taken() == 2 * 45);
    }
}
