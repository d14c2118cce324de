use super::*;
use crate::image::exr_file::{Metadata, Windows};
use crate::stats::{Block, Part};

const SIDE: usize = 64;

fn planes(value: impl Fn(usize, usize) -> f32) -> Planes {
    let mut planes = Planes::new(SIDE, SIDE, 3);
    planes.planes_mut().enumerate().for_each(|(c, plane)| {
        plane.iter_mut().enumerate().for_each(|(i, v)| *v = value(c, i));
    });
    planes
}

fn frame(colour: Planes) -> Frame {
    Frame {
        path: "frame.exr".into(),
        windows: Windows::whole(colour.width(), colour.height()),
        metadata: Metadata::default(),
        colour,
        negative_values: 0,
        features: Vec::new(),
        variance: None,
        is_variance_of_luminance: false,
        alpha: None,
        spp: None,
        aovs: Vec::new(),
        found: Vec::new(),
    }
}

/// A grey image with noise of this standard deviation.
fn noisy(seed: u64, deviation: f32) -> Planes {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let noise: Vec<f32> =
        (0..SIDE * SIDE).map(|_| 3.0_f32.sqrt() * (2.0 * random.random::<f32>() - 1.0)).collect();
    planes(|_, i| 1.0 + deviation * noise[i])
}

fn mean(values: impl Iterator<Item = f32>) -> f32 {
    values.sum::<f32>() / (SIDE * SIDE) as f32
}

#[test]
fn two_frames_are_the_halves_and_their_difference_is_the_variance() {
    let [a, b] = [1, 2].map(|seed| noisy(seed, 0.2));
    let mut frames = [frame(a.clone()), frame(b.clone())];
    for (frame, shift) in frames.iter_mut().zip([0.0, 0.1]) {
        frame.features =
            vec![(Role::Normal, planes(|c, _| c as f32 - 0.5 + shift)), (Role::Depth, planes(|_, _| 500.0))];
    }
    let FrameStore { store, empty_pixels, .. } = FrameStore::new(&frames, 0).unwrap();
    assert_eq!((store.samples(), empty_pixels), (2 * (SIDE * SIDE) as u64, 0));
    let colour = store.layout().colour();
    assert_eq!(store.means(Part::Half(0), colour.clone()), a);
    assert_eq!(store.means(Part::Half(1), colour.clone()), b);
    let normal = store.means(Part::Whole, store.layout().block(Block::Normal1).unwrap());
    assert!((normal.at(2, 3, 3) - 1.55).abs() < 1e-6);
    let depth = store.means(Part::Whole, store.layout().block(Block::Position1).unwrap());
    assert_eq!(depth.at(2, 3, 3), 1.0, "positions are of order 1");
    let variance = mean(store.variances(Part::Whole, colour).plane(0).iter().copied());
    assert!((variance / 0.04 - 1.0).abs() < 0.1, "{variance}");
}

#[test]
fn variances_of_the_mean_become_those_of_samples() {
    let mut frames = [1, 2].map(|seed| frame(noisy(seed, 0.2)));
    for frame in &mut frames {
        frame.variance = Some(planes(|_, _| 0.04));
        frame.spp = Some(32);
    }
    let store = FrameStore::new(&frames, 0).unwrap().store;
    assert_eq!(store.samples(), 64 * (SIDE * SIDE) as u64);
    let variance = mean(store.variances(Part::Half(0), store.layout().colour()).plane(1).iter().copied());
    assert!((variance / 1.28 - 1.0).abs() < 0.01, "{variance}");
}

#[test]
fn one_frame_is_divided_into_halves_with_independent_errors() {
    let mut one = frame(noisy(7, 0.2));
    one.variance = Some(planes(|_, _| 0.04));
    one.aovs = vec![
        ("a".into(), planes(|c, i| 0.3 * one.colour.plane(c)[i])),
        ("b".into(), planes(|c, i| 0.7 * one.colour.plane(c)[i])),
    ];
    let FrameStore { store, aovs, .. } = FrameStore::new(&[one.clone()], 3).unwrap();
    let [a, b] = [0, 1].map(|h| store.means(Part::Half(h), store.layout().colour()));
    let errors = |half: &Planes| -> Vec<f32> { half.plane(0).iter().map(|v| v - 1.0).collect() };
    let (a, b) = (errors(&a), errors(&b));
    let covariance = mean(a.iter().zip(&b).map(|(a, b)| a * b));
    let variance = mean(a.iter().map(|a| a * a));
    assert!(
        covariance.abs() < 0.05 * variance && (variance / 0.08 - 1.0).abs() < 0.1,
        "{covariance} {variance}"
    );
    let middle =
        a.iter().zip(&b).zip(one.colour.plane(0)).all(|((a, b), c)| (0.5 * (a + b) + 1.0 - c).abs() < 1e-5);
    assert!(middle, "the frame is the mean of its halves");
    for h in [0, 1] {
        let half = store.means(Part::Half(h), store.layout().colour());
        let sums = aovs[0].1[h].data().iter().zip(aovs[1].1[h].data()).map(|(a, b)| a + b);
        assert!(sums.zip(half.data()).all(|(sum, v)| (sum - v).abs() < 1e-5));
    }
}

#[test]
fn pixels_that_are_not_finite_have_no_samples() {
    let mut frames = [1, 2].map(|seed| frame(noisy(seed, 0.2)));
    frames[0].colour.plane_mut(1)[5] = f32::NAN;
    frames.iter_mut().for_each(|frame| frame.colour.plane_mut(2)[9] = f32::INFINITY);
    let FrameStore { store, empty_pixels, .. } = FrameStore::new(&frames, 0).unwrap();
    let counts = store.counts(Part::Whole);
    assert_eq!((counts[4], counts[5], counts[9], empty_pixels), (2, 1, 0, 1));
}

#[test]
fn a_pixel_of_one_frame_that_is_not_finite_has_no_samples() {
    let mut one = frame(noisy(1, 0.2));
    one.colour.plane_mut(0)[5] = f32::NAN;
    one.variance = Some(planes(|_, _| 0.04));
    let FrameStore { store, empty_pixels, .. } = FrameStore::new(&[one], 0).unwrap();
    assert_eq!((store.counts(Part::Whole)[5], empty_pixels), (0, 1));
}

#[test]
fn two_frames_with_a_variance_of_luminance_are_judged_by_their_difference() {
    let mut frames = [1, 2].map(|seed| frame(noisy(seed, 0.2)));
    for frame in &mut frames {
        (frame.variance, frame.is_variance_of_luminance) = (Some(planes(|_, _| 9.0)), true);
    }
    let store = FrameStore::new(&frames, 0).unwrap().store;
    let variance = mean(store.variances(Part::Whole, store.layout().colour()).plane(0).iter().copied());
    assert!((variance / 0.04 - 1.0).abs() < 0.1, "{variance}");
}

#[test]
fn invalid_features_leave_the_colour() {
    let mut frames = [1, 2].map(|seed| frame(noisy(seed, 0.2)));
    for frame in &mut frames {
        let wrong = [f32::NAN, f32::INFINITY, 1e30];
        let feature = || planes(|_, i| wrong.get(i).copied().unwrap_or(0.5));
        frame.features = [Role::Albedo, Role::Normal, Role::Position].map(|role| (role, feature())).into();
    }
    let FrameStore { store, empty_pixels, .. } = FrameStore::new(&frames, 0).unwrap();
    assert_eq!((empty_pixels, store.samples()), (0, 2 * (SIDE * SIDE) as u64));
    let mean = |block| store.means(Part::Whole, store.layout().block(block).unwrap()).plane(0)[..4].to_vec();
    assert_eq!(mean(Block::Albedo), [0.0, 0.0, 0.0, 0.5]);
    assert_eq!(mean(Block::Position1), [0.0, 4.0, 4.0, 1.0], "the background is far away");
}

#[test]
fn black_frames_are_halves() {
    let black = frame(Planes::new(3, 2, 3));
    assert_eq!(FrameStore::new(&[black.clone(), black], 0).unwrap().store.samples(), 12);
}

#[test]
fn frames_that_are_no_halves_are_refused() {
    let error = |frames: &[Frame]| FrameStore::new(frames, 0).unwrap_err().to_string();
    let [a, mut b] = [1, 2].map(|seed| frame(noisy(seed, 0.2)));
    assert!(error(&[a.clone(), a.clone()]).contains("another seed"));
    assert!(error(std::slice::from_ref(&a)).contains("without a variance"));
    assert!(error(&[]).contains("found 0 images"));
    let wrong = [f32::NAN, f32::INFINITY, 1e16]
        .map(|value| [1.0, 2.0].map(|factor| frame(planes(|_, _| factor * value))));
    for wrong in &wrong {
        assert!(error(wrong).contains("found no pixel whose colour and variance are valid"));
    }
    let mut without_variance = a.clone();
    without_variance.variance = Some(planes(|_, _| f32::NAN));
    assert!(error(&[without_variance]).contains("found no pixel"));
    b.aovs = vec![("key".into(), planes(|_, _| 0.5))];
    assert!(error(&[a.clone(), b.clone()]).contains("sum differs from the colour by"));
    b = frame(Planes::new(3, 2, 3));
    assert!(error(&[a, b]).contains("found 3x2 pixels"));
}
