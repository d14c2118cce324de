//! Parts of an image, filtered with their margins, are the filtered image to the last bit.

use std::collections::VecDeque;
use std::sync::Mutex;

use rand::RngExt;
use rand_pcg::Pcg32;

use super::*;
use crate::filter::{Denoiser, learned, nlm, synthetic};
use crate::stats::{Block, Layout, StatisticsExtent, Store};

/// What filters ask of a whole image: recorded when that is filtered, and told to filters of its parts.
struct Recorded {
    part: Rectangle,
    /// The store's pixels.
    place: Rectangle,
    sums: Mutex<VecDeque<Vec<i64>>>,
    /// Planes whose margins were completed, row by row.
    planes: Mutex<VecDeque<Vec<Vec<f32>>>>,
    is_whole: bool,
}

impl Recorded {
    fn whole(image: Rectangle) -> Self {
        Self { part: image, place: image, sums: Mutex::default(), planes: Mutex::default(), is_whole: true }
    }

    fn part(&self, part: &Rectangle, place: Rectangle) -> Self {
        let copy = |queue: &Mutex<VecDeque<Vec<i64>>>| Mutex::new(queue.lock().unwrap().clone());
        let planes = Mutex::new(self.planes.lock().unwrap().clone());
        Self { part: part.within(&place), place, sums: copy(&self.sums), planes, is_whole: false }
    }
}

impl WholeImage for Recorded {
    fn part(&self) -> Rectangle {
        self.part
    }

    fn sum(&self, numbers: &mut [i64]) {
        let mut sums = self.sums.lock().unwrap();
        if self.is_whole {
            sums.push_back(numbers.to_vec());
        } else {
            numbers.copy_from_slice(&sums.pop_front().unwrap());
        }
    }

    fn max(&self, number: f32) -> f32 {
        let mut bits = [i64::from(number.to_bits())];
        self.sum(&mut bits);
        f32::from_bits(bits[0] as u32)
    }

    fn complete_margin(&self, planes: &mut dyn PlaneRows, side: usize) {
        let mut recorded = self.planes.lock().unwrap();
        let rows = |rectangle: &Rectangle| rectangle.y[0] / side..rectangle.y[1].div_ceil(side);
        let indices = |rectangle: &Rectangle| {
            let rows = rows(rectangle);
            (0..planes.count()).flat_map(move |plane| rows.clone().map(move |y| (plane, y)))
        };
        if self.is_whole {
            recorded
                .push_back(indices(&self.place).map(|(plane, y)| planes.row(plane, y).to_vec()).collect());
            return;
        }
        let whole = recorded.pop_front().unwrap();
        let height = whole.len() / planes.count();
        let columns = self.place.x[0] / side..self.place.x[1].div_ceil(side);
        let (left, right) = (self.part.x[0] / side, self.part.x[1].div_ceil(side));
        let of_part = rows(&self.part);
        for (plane, y) in indices(&self.place.within(&self.place)).collect::<Vec<_>>() {
            let source = &whole[plane * height + y + self.place.y[0] / side][columns.clone()];
            let row = &mut planes.row_mut(plane, y)[..source.len()];
            if of_part.contains(&y) {
                row[..left].copy_from_slice(&source[..left]);
                row[right..].copy_from_slice(&source[right..]);
            } else {
                row.copy_from_slice(source);
            }
        }
    }
}

/// An image with edges, noise in all features, a lamp, fireflies, and a part without any noise.
fn rich_image(width: usize, height: usize) -> Store {
    let layout = Layout::with_blocks(|_| true);
    let sample = |x: usize, y: usize, index: u32, rng: &mut Pcg32| {
        let mut sample = synthetic::wall(&layout, x, y, [0.4; 3], rng);
        if x < width / 4 && y > height / 2 {
            return sample;
        }
        let is_firefly = (x * 31 + y * 17).is_multiple_of(401) && index == 1;
        let light = if is_firefly {
            300.0
        } else {
            rng.random::<f32>() + f32::from((x / 20 + y / 30).is_multiple_of(2))
        };
        let emission = if x.abs_diff(width / 2) < 9 && y < 12 { 4.0 * rng.random::<f32>() } else { 0.0 };
        let tilt = 0.2 * rng.random::<f32>();
        layout.write(&mut sample, Block::Colour, &[light, 0.5 * light, 0.2 * light]);
        layout.write(&mut sample, Block::Emission, &[emission; 3]);
        layout.write(
            &mut sample,
            Block::Radiance,
            &[light + emission, 0.5 * light + emission, 0.2 * light + emission],
        );
        layout.write(&mut sample, Block::Normal1, &[tilt, 0.0, (1.0 - tilt * tilt).sqrt()]);
        layout.write(&mut sample, Block::Albedo, &[0.5 + 0.1 * rng.random::<f32>(); 3]);
        sample
    };
    synthetic::store(width, height, layout.clone(), |x, y| 2 + (x * 7 + y) as u32 % 6, sample)
}

#[test]
fn parts_with_their_margins_give_the_whole() {
    let denoisers: [&dyn Denoiser; 4] = [&nlm::STANDARD, &nlm::DRAFT, &learned::STANDARD, &learned::DRAFT];
    for (width, height) in [(261, 91), (91, 261)] {
        let store = rich_image(width, height);
        let image = Rectangle::whole(width, height);
        for denoiser in denoisers {
            let parts = denoiser.parts().unwrap();
            let recorded = Recorded::whole(image);
            let whole = parts.filter_part(&store, &recorded);
            assert_eq!(whole.image, denoiser.filter(&store, 0).image);
            for [start, end] in [[0, 48], [48, 112], [176, 261]] {
                let across = [16, 80];
                let (x, y) = if width > height { ([start, end], across) } else { (across, [start, end]) };
                let part = Rectangle { x, y };
                let place = part.grown(parts.margin(), &image);
                assert!(place.pixels() < image.pixels());
                let of_part = recorded.part(&part, place);
                let size = place.within(&place);
                let mut cut = Store::for_rectangle(&size, store.layout().clone(), store.capacity(), 0);
                cut.copy_rectangle(&size, &store, &place, StatisticsExtent::All);
                let found = parts.filter_part(&cut, &of_part);
                let values = |planes: &Planes, place: &Rectangle| -> Vec<f32> {
                    let rows = |plane| place.select(planes.plane(plane), planes.width());
                    (0..planes.count()).flat_map(rows).flatten().copied().collect()
                };
                let pairs = [
                    (&found.image, &whole.image),
                    (&found.halves[0], &whole.halves[0]),
                    (&found.halves[1], &whole.halves[1]),
                    (&found.variance, &whole.variance),
                    (&found.residual, &whole.residual),
                    (&found.risk, &whole.risk),
                    (&found.error, &whole.error),
                ];
                for (k, (found, whole)) in pairs.into_iter().enumerate() {
                    let (found, whole) = (values(found, &of_part.part), values(whole, &part));
                    assert!(found == whole, "{} {part:?} plane set {k}", denoiser.name());
                }
            }
        }
    }
}

#[test]
fn the_median_is_that_of_the_sorted_values() {
    let mut rng = <Pcg32 as rand::SeedableRng>::seed_from_u64(3);
    for (width, height, lit) in [(1, 1, 1), (2, 1, 2), (7, 5, 20), (16, 9, 143)] {
        let mut plane = Planes::new(width, height, 1);
        plane.data_mut()[..lit].fill_with(|| (20.0 * rng.random::<f32>() - 10.0).exp());
        let mut sorted = plane.data()[..lit].to_vec();
        sorted.sort_by(f32::total_cmp);
        let expected = 0.5 * sorted[(lit - 1) / 2] + 0.5 * sorted[lit / 2];
        assert_eq!(median_of_positive(&AllPixels::new(width, height), &plane), Some(expected));
    }
    assert_eq!(median_of_positive(&AllPixels::new(2, 2), &Planes::new(2, 2, 1)), None);
}
