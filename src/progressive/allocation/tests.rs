use super::*;
use crate::filter::nlm;
use crate::progressive::filter_pass::{FailureMap, FilterPass};
use crate::stats::{Block, Layout};
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

fn interim(store: &Arc<Store>) -> InterimPass {
    let failure_map = FailureMap::Carry(None);
    let pass = FilterPass { store: store.clone(), denoiser: &nlm::DRAFT, seed: 0, failure_map };
    InterimPass::new(pass.run())
}

#[test]
fn pixels_that_reject_all_their_samples_do_not_make_the_others_uniform() {
    let store = store();
    let (interim, settings) = (interim(&store), Settings::default());
    let counts = allocate(&store, Some(&interim), None, &settings, 8 * (WIDTH * WIDTH) as u64);
    let sum = |first: usize| -> u32 {
        let rows = counts.chunks(WIDTH);
        rows.map(|row| row[first..][..WIDTH / 2].iter().sum::<u32>()).sum()
    };
    let [left, right] = [0, WIDTH / 2].map(sum);
    assert!(left > 2 * right, "{left} {right}");
}

#[test]
fn every_batch_selects_other_pixels() {
    let mut store = store();
    let (interim, settings) = (interim(&store), Settings::default());
    let counts =
        |store: &Store| allocate(store, Some(&interim), None, &settings, 10 * (WIDTH * WIDTH) as u64);
    let first = counts(&store);
    assert_eq!(counts(&store), first, "the same for the same store");
    let sample = vec![0.5; store.layout().len()];
    Arc::make_mut(&mut store).push(0, 0, &sample);
    assert_ne!(counts(&store), first);
}
