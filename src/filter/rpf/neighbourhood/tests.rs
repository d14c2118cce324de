//! Candidates, clustering and thresholds.

use super::super::settings::RpfPass;
use super::*;
use crate::filter::synthetic::{store, wall};
use crate::stats::Store;

/// A wall whose right half faces another direction. Red and green are the coordinates of the pixel.
fn corner(side: usize, count: u32) -> (Layout, Store) {
    let layout = Layout::with_blocks(|block| matches!(block, Block::Normal1 | Block::Lens));
    let store = store(
        side,
        side,
        layout.clone(),
        |_, _| count,
        |x, y, _, rng| {
            let mut sample = wall(&layout, x, y, [x as f32, y as f32, 0.0], rng);
            if x >= side / 2 {
                layout.write(&mut sample, Block::Normal1, &[1.0, 0.0, 0.0]);
            }
            sample
        },
    );
    (layout, store)
}

/// Returns the pixels of the samples in a neighbourhood.
fn gathered(
    store: &Store,
    layout: &Layout,
    pass: &RpfPass,
    settings: &RpfSettings,
    at: (usize, usize),
) -> Vec<[f32; 2]> {
    let samples = Samples::from_store(store);
    let sampler = CandidateSampler::new(pass, settings, &samples);
    let clustering = Clustering::new(settings, layout);
    let mut neighbourhood = Neighbourhood::new(&sampler, &samples);
    neighbourhood.gather(&samples, &sampler, &clustering, at, (1, 0));
    let colour = layout.radiance().start;
    neighbourhood.rows().iter().map(|row| [row[colour], row[colour + 1]]).collect()
}

#[test]
fn neighbours_are_similar_inside_the_window_and_as_many_as_wanted() {
    let (layout, store) = corner(40, 4);
    let pass = RpfPass { window: 15, fraction: 0.5 };
    let settings = RpfSettings::report();
    // Far from the edge all candidates are similar: b² n ∕ 2.
    let inside = gathered(&store, &layout, &pass, &settings, (9, 20));
    assert_eq!(inside.len(), 450);
    assert!(inside.iter().all(|[x, y]| (2.0..=16.0).contains(x) && (13.0..=27.0).contains(y)));
    assert_eq!(
        inside.iter().filter(|&&pixel| pixel == [9.0, 20.0]).count(),
        4,
        "the samples of the pixel itself"
    );
    // At the edge, the half with the same normal is.
    let beside = gathered(&store, &layout, &pass, &settings, (19, 0));
    assert!((200..300).contains(&beside.len()), "{}", beside.len());
    assert!(beside.iter().all(|&[x, y]| x < 20.0 && y <= 7.0));
}

#[test]
fn candidates_have_the_standard_deviation_of_a_quarter_window_cut_off_at_its_border() {
    let (layout, store) = corner(80, 4);
    let pass = RpfPass { window: 35, fraction: 0.5 };
    let offsets: Vec<f32> = gathered(&store, &layout, &pass, &RpfSettings::report(), (20, 40))
        .iter()
        .map(|&[_, y]| y - 40.0)
        .collect();
    let n = offsets.len() as f32;
    let mean = offsets.iter().sum::<f32>() / n;
    let deviation = (offsets.iter().map(|d| d * d).sum::<f32>() / n).sqrt();
    // A Gaussian cut off at two standard deviations has 0.88 of its standard deviation.
    assert!(mean.abs() < 0.6, "{mean}");
    assert!((deviation - 0.88 * 8.75).abs() < 0.4, "{deviation}");
}

#[test]
fn capped_candidates_select_a_pixel_at_most_as_often_as_it_has_samples() {
    let (layout, store) = corner(40, 2);
    let pass = RpfPass { window: 5, fraction: 4.0 };
    let settings = RpfSettings { cap_candidates: true, ..RpfSettings::report() };
    let pixels = gathered(&store, &layout, &pass, &settings, (9, 20));
    assert!(pixels.iter().all(|a| pixels.iter().filter(|&b| a == b).count() <= 2), "{pixels:?}");
    assert!(pixels.len() > 40, "{}", pixels.len());
}

#[test]
fn thresholds_are_standard_deviations_with_an_absolute_minimum() {
    let layout = Layout::with_blocks(|block| block == Block::Albedo);
    let store = store(
        1,
        1,
        layout.clone(),
        |_, _| 2,
        |_, _, index, rng| {
            let mut sample = wall(&layout, 0, 0, [0.0; 3], rng);
            layout.write(&mut sample, Block::Albedo, &[index as f32, 0.5, 0.5 + 0.01 * index as f32]);
            sample
        },
    );
    let samples = Samples::from_store(&store);
    let clustering = Clustering::new(&RpfSettings::report(), &layout);
    let mut rows = [[0.0; MAX_VARIABLES]; 2];
    (0..2).for_each(|slot| copy(samples.sample(0, slot), &mut rows[slot]));
    let (centre, thresholds) = clustering.thresholds(&rows);
    let albedo = layout.block(Block::Albedo).unwrap().start;
    assert_eq!(centre[albedo], 0.5);
    // 3σ with σ² = 2 (½)²; the minimum is 0.1.
    assert!((thresholds[albedo] - 3.0 * 0.5f32.sqrt()).abs() < 1e-5);
    assert_eq!(thresholds[albedo + 1..albedo + 3], [0.1; 2]);
    assert_eq!(thresholds[layout.film().start], f32::INFINITY);
}
