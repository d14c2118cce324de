//! Parts of an image, filtered with their margins, are the filtered image to the last bit.

use std::collections::VecDeque;
use std::sync::Mutex;

use rand::RngExt;

use super::*;
use crate::filter::{Denoiser, PartFilter, nlm};
use crate::stats::{Block, Rectangle, StatisticsExtent};

/// The sums of a whole image: recorded when that is filtered, and told to filters of its parts.
struct RecordedSums {
    part: Rectangle,
    sums: Mutex<VecDeque<Vec<i64>>>,
    is_whole: bool,
}

impl WholeImage for RecordedSums {
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
    let (width, height) = (260, 90);
    let store = rich_image(width, height);
    let image = Rectangle::of_image(width, height);
    for denoiser in [&nlm::STANDARD, &nlm::DRAFT] {
        let sums = || Mutex::new(VecDeque::new());
        let recorded = RecordedSums { part: image, sums: sums(), is_whole: true };
        let whole = denoiser.filter_part(&store, &recorded);
        assert_eq!(whole.image, denoiser.filter(&store, 0).image);
        let totals = recorded.sums.into_inner().unwrap();
        for x in [[0, 48], [48, 112], [176, 260]] {
            let part = Rectangle { x, y: [16, 80] };
            let place = part.grown(denoiser.margin(), &image);
            assert!(place.width() < width);
            let part_of = |planes: &Planes, place: &Rectangle| -> Vec<f32> {
                let rows = |plane| place.select(planes.plane(plane), planes.width());
                (0..planes.count()).flat_map(rows).flatten().copied().collect()
            };
            let sums = Mutex::new(totals.clone());
            let of_part = RecordedSums { part: part.within(&place), sums, is_whole: false };
            let size = place.within(&place);
            let mut cut = Store::of_part(&size, store.layout().clone(), store.capacity(), 0);
            cut.copy_rectangle(&size, &store, &place, StatisticsExtent::All);
            let found = denoiser.filter_part(&cut, &of_part);
            let pairs = [
                (&found.image, &whole.image),
                (&found.halves[0], &whole.halves[0]),
                (&found.variance, &whole.variance),
                (&found.residual, &whole.residual),
                (&found.risk, &whole.risk),
                (&found.error, &whole.error),
            ];
            for (k, (found, whole)) in pairs.into_iter().enumerate() {
                let (found, whole) = (part_of(found, &of_part.part), part_of(whole, &part));
                assert!(found == whole, "{} {x:?} plane set {k}", denoiser.name());
            }
        }
    }
}
