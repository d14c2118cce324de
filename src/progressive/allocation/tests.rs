use super::*;
use crate::filter::nlm;
use crate::progressive::filter_pass::FilterPass;
use crate::progressive::record::PassRecord;
use crate::stats::{Block, Layout, Rectangle};
use std::sync::Arc;

const WIDTH: usize = 32;

/// A store with 8 samples in each pixel: noise in the left half; a pixel that rejects all its samples in the right.
fn store() -> Arc<Store> {
    let layout = Layout::with_blocks(|block| matches!(block, Block::Normal1 | Block::Radiance));
    let mut store = Store::new(WIDTH, WIDTH, layout.clone(), 0, 0);
    for i in 0..8 * WIDTH * WIDTH {
        let pixel = i / 8;
        let mut sample = vec![0.0; layout.len()];
        let is_noisy = pixel % WIDTH < WIDTH / 2;
        let noise = if is_noisy { (i.wrapping_mul(2_654_435_761) >> 9 & 7) as f32 } else { 2.0 };
        layout.write(&mut sample, Block::Colour, &[if pixel == WIDTH - 1 { f32::NAN } else { noise }; 3]);
        layout.write(&mut sample, Block::Radiance, &[noise; 3]);
        store.push(pixel % WIDTH, pixel / WIDTH, &sample);
    }
    assert_eq!(store.rejected(), 8);
    Arc::new(store)
}

/// A checkpoint with this store, after an interim pass.
fn checkpoint(store: Arc<Store>) -> Checkpoint {
    let pass = FilterPass::new(store.clone(), &nlm::DRAFT, 0);
    let interim = Some(InterimPass::new(pass.run()));
    Checkpoint { store, interim, ..Checkpoint::new(Store::new(1, 1, Layout::with_blocks(|_| false), 0, 0)) }
}

#[test]
fn pixels_that_reject_all_their_samples_do_not_make_the_others_uniform() {
    let counts = allocate_batch(&checkpoint(store()), None, &Settings::default(), 8 * (WIDTH * WIDTH) as u64);
    let sum = |first: usize| -> u32 {
        let rows = counts.chunks(WIDTH);
        rows.map(|row| row[first..][..WIDTH / 2].iter().sum::<u32>()).sum()
    };
    let [left, right] = [0, WIDTH / 2].map(sum);
    assert!(left > 2 * right, "{left} {right}");
}

#[test]
fn every_batch_selects_other_pixels() {
    let mut checkpoint = checkpoint(store());
    let counts = |checkpoint: &Checkpoint| {
        allocate_batch(checkpoint, None, &Settings::default(), 10 * (WIDTH * WIDTH) as u64)
    };
    let first = counts(&checkpoint);
    assert_eq!(counts(&checkpoint), first, "the same for the same store");
    let sample = vec![0.5; checkpoint.store.layout().len()];
    Arc::make_mut(&mut checkpoint.store).push(0, 0, &sample);
    assert_ne!(counts(&checkpoint), first);
}

#[test]
fn samples_are_placed_uniformly_where_little_is_expected_of_priorities() {
    let mut checkpoint = checkpoint(store());
    let settings = Settings::default();
    let per_pixel = |checkpoint: &Checkpoint| {
        let counts = allocate_batch(checkpoint, None, &settings, 8 * (WIDTH * WIDTH) as u64);
        counts.iter().max().copied()
    };
    let pass = |expected_ratio| PassRecord { expected_ratio: Some(expected_ratio), ..PassRecord::default() };
    checkpoint.passes = vec![PassRecord::default(), pass(0.7), pass(0.9)];
    assert!(per_pixel(&checkpoint) > Some(8), "the first that says so decides");
    checkpoint.passes = vec![pass(0.9)];
    assert_eq!(per_pixel(&checkpoint), Some(8));
    let ratio = expected_ratio(&checkpoint.store, checkpoint.interim.as_ref().unwrap(), &settings);
    assert!((0.3..0.8).contains(&ratio), "half of the image is noisy: {ratio}");
}

/// A region is rendered before other pixels have samples, which get a fraction of the samples until all have some.
#[test]
fn a_region_begins_at_once_and_the_others_go_on() {
    let mut store = Store::new(WIDTH, WIDTH, Layout::with_blocks(|_| false), 0, 0);
    let settings = Settings { sampling: Sampling::Uniform, ..Settings::default() };
    let region = Rectangle { x: [4, 12], y: [8, 16] };
    let is_inside = |i: usize| (4..12).contains(&(i % WIDTH)) && (8..16).contains(&(i / WIDTH));
    let sample = vec![0.5; store.layout().len()];
    let mut batches = 0;
    let image = Rectangle::whole(WIDTH, WIDTH);
    while store.empty_pixels(&image) > 0 {
        let checkpoint = Checkpoint::new(store.clone());
        let counts = allocate_batch(&checkpoint, Some(region), &settings, 8 * (WIDTH * WIDTH) as u64);
        let sum = |inside: bool| -> u32 {
            let side = counts.iter().enumerate().filter(|(i, _)| is_inside(*i) == inside);
            side.map(|(_, n)| n).sum()
        };
        let [inside, outside] = [true, false].map(sum);
        if batches == 0 {
            // Two pixels of each block of 8×8 are a coarse image of the whole.
            assert_eq!(inside + outside, (WIDTH * WIDTH / 16) as u32);
            for block in 0..WIDTH * WIDTH / 64 {
                let (x0, y0) = (block % (WIDTH / 8) * 8, block / (WIDTH / 8) * 8);
                let n: u32 = (0..64).map(|i| counts[(y0 + i / 8) * WIDTH + x0 + i % 8]).sum();
                assert_eq!(n, 4);
            }
        } else {
            assert!(inside >= 4 * 64, "{inside}");
            let most = (inside / 3).next_multiple_of(2);
            assert!(
                outside <= most
                    && (outside + 2 > inside / 3 || store.empty_pixels(&image) <= outside as usize)
            );
            let is_new = |(i, n): (usize, &u32)| *n == 0 || store.next_indices()[i] == 0 && *n == 2;
            assert!(counts.iter().enumerate().filter(|(i, _)| !is_inside(*i)).all(is_new));
        }
        for (i, n) in counts.iter().enumerate() {
            (0..*n).for_each(|_| store.push(i % WIDTH, i / WIDTH, &sample));
        }
        batches += 1;
    }
    assert!((4..20).contains(&batches), "{batches}");
}
