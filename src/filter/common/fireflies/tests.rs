//! Detection and clamping.

use super::*;

/// A grey image of 0.5 and its halves, where pixel 40 has the given values in the halves.
pub fn grey_except(halves: [f32; 2]) -> (Planes, [Planes; 2]) {
    let mut images = [0.5, 0.5, 0.5].map(|value| {
        let mut planes = Planes::new(9, 9, 3);
        planes.data_mut().fill(value);
        planes
    });
    let values = [0.5 * (halves[0] + halves[1]), halves[0], halves[1]];
    for (image, value) in images.iter_mut().zip(values) {
        image.planes_mut().for_each(|plane| plane[40] = value);
    }
    let [whole, a, b] = images;
    (whole, [a, b])
}

fn clamped(halves: [f32; 2]) -> FireflyClamp {
    let (whole, [a, b]) = grey_except(halves);
    clamp(&whole, [&a, &b], [&[4; 81], &[4; 81]], &FireflySettings::default())
}

#[test]
fn a_firefly_in_one_half_is_clamped_and_its_excess_is_returned() {
    let clamped = clamped([1e6, 0.5]);
    let [firefly] = clamped.fireflies[..] else { panic!("one firefly, not {:?}", clamped.fireflies) };
    assert_eq!(firefly.pixel, 40);
    let left = clamped.whole.plane(1)[40];
    assert!(left <= 8.0 * 0.5, "{left}");
    assert!((left + firefly.excess[1] - 500_000.25).abs() < 0.1);
    assert_eq!(clamped.whole.plane(1)[39], 0.5);
}

#[test]
fn a_highlight_in_both_halves_is_not_clamped() {
    assert!(clamped([90.0, 110.0]).fireflies.is_empty());
}

/// Rows of 40 pixels of 0.5, where those of `at` have 100 in one half: the number of those that are clamped.
fn clamped_with_neighbours(at: &[usize], max_neighbours: Option<usize>) -> usize {
    let (width, height) = (40, 9);
    let mut bright = Planes::new(width, height, 3);
    bright.data_mut().fill(0.5);
    let plain = bright.clone();
    bright.planes_mut().for_each(|plane| at.iter().for_each(|&pixel| plane[pixel] = 100.0));
    let counts = vec![1; width * height];
    let settings = FireflySettings { max_neighbours, ..FireflySettings::default() };
    clamp(&bright, [&bright, &plain], [&counts, &counts], &settings).fireflies.len()
}

#[test]
fn fireflies_among_many_are_left_as_they_are() {
    let row = |x: usize| 4 * 40 + x;
    let [near, far] = [[row(4), row(8), row(12)], [row(4), row(13), row(22)]];
    assert_eq!(clamped_with_neighbours(&near, None), 3);
    // The middle one has both within 8 pixels, the outer ones have one
    assert_eq!(clamped_with_neighbours(&near, Some(1)), 0);
    assert_eq!(clamped_with_neighbours(&near, Some(2)), 3);
    assert_eq!(clamped_with_neighbours(&far, Some(0)), 3);
    assert_eq!(clamped_with_neighbours(&[row(4), row(12), row(20)], Some(1)), 2);
}

#[test]
fn light_in_a_black_surround_is_not_clamped() {
    let mut whole = Planes::new(9, 9, 3);
    whole.planes_mut().for_each(|plane| plane[40] = 1.0);
    let black = Planes::new(9, 9, 3);
    let counts = [4; 81];
    let clamped = clamp(&whole, [&whole, &black], [&counts, &counts], &FireflySettings::default());
    assert!(clamped.fireflies.is_empty());
}

/// Median, and median absolute deviation.
fn median_and_deviation(mut values: Vec<f32>) -> [f32; 2] {
    let middle = |values: &mut Vec<f32>| {
        values.sort_by(f32::total_cmp);
        values[values.len() / 2]
    };
    let median = middle(&mut values);
    values.iter_mut().for_each(|v| *v = (*v - median).abs());
    [median, middle(&mut values)]
}

#[test]
fn the_bound_follows_from_median_and_deviation_inside_and_at_borders() {
    let (width, height) = (9, 7);
    let level = |x: usize, y: usize| 0.5 + 0.01 * ((x * 7 + y * 3) % 11) as f32;
    for (x, y) in [(4, 3), (0, 0), (8, 6), (1, 5), (8, 2)] {
        for (settings, clamp_to_median) in [
            (FireflySettings::default(), false),
            (FireflySettings { clamp_to_median: true, ..FireflySettings::default() }, true),
        ] {
            let mut grey: Vec<f32> = (0..63).map(|i| level(i % width, i / width)).collect();
            grey[y * width + x] = 1000.0;
            let window = (0..63)
                .filter(|i| (i % width).abs_diff(x) <= 2 && (i / width).abs_diff(y) <= 2)
                .map(|i| grey[i]);
            let [median, deviation] = median_and_deviation(window.collect());
            let most = 8.0 * median + 4.0 * 1.48 * deviation;
            let found = bound(&grey, |_| true, (x, y), (width, height), &settings).expect("a firefly");
            let expected = if clamp_to_median { median } else { most };
            assert!((found - expected).abs() < 1e-5, "{x},{y}: {found} for {expected}");
            // The window's median does not change: the value stays on the same side of it.
            grey[y * width + x] = most * 1.001;
            assert!(bound(&grey, |_| true, (x, y), (width, height), &settings).is_some());
            grey[y * width + x] = most * 0.999;
            assert_eq!(bound(&grey, |_| true, (x, y), (width, height), &settings), None);
        }
    }
    assert_eq!(bound(&[1.0, 0.0, 0.0, 0.0], |_| true, (0, 0), (2, 2), &FireflySettings::default()), None);
}

#[test]
fn the_clamped_mean_is_that_of_the_halves_weighted_by_counts() {
    let (whole, [a, b]) = grey_except([1e3, 2.0]);
    let mean = (6.0 * 1e3 + 2.0 * 2.0) / 8.0;
    let mut whole = whole;
    whole.planes_mut().for_each(|plane| plane[40] = mean);
    let clamped = clamp(&whole, [&a, &b], [&[6; 81], &[2; 81]], &FireflySettings::default());
    let [firefly] = clamped.fireflies[..] else { panic!("one firefly") };
    // The median is 0.5 and the deviation 0: the bound is 4, which the second half does not exceed.
    assert_eq!([0, 1].map(|h| clamped.halves[h].plane(1)[40]), [4.0, 2.0]);
    assert_eq!(clamped.whole.plane(2)[40], 3.5);
    assert_eq!(firefly.excess, [mean - 3.5; 3]);
    assert!((firefly.scale - 3.5 / mean).abs() < 1e-8);
}

#[test]
fn only_light_mostly_in_one_half_is_clamped() {
    for (a, b, expected) in [(82.0, 18.0, 1), (78.0, 22.0, 0), (18.0, 82.0, 1), (22.0, 78.0, 0)] {
        assert_eq!(clamped([a, b]).fireflies.len(), expected, "{a} {b}");
    }
    let (whole, [a, b]) = grey_except([1e6, 0.5]);
    let none = clamp(&whole, [&a, &b], [&[4; 81], &[4; 81]], &FireflySettings::off());
    assert!(none.fireflies.is_empty() && none.whole == whole);
}

#[test]
fn bright_pixels_exceed_most_of_their_window_in_images_of_any_size() {
    let sizes = (1..=6).flat_map(|width| (1..=6).map(move |height| (width, height)));
    for (width, height) in sizes.chain([(37, 9)]) {
        let luminances: Vec<f32> = (0..width * height).map(|i| (i * 37 % 23) as f32).collect();
        for y in 0..height {
            let found = exceed_most(&luminances, width, y, 2.0);
            for (x, found) in found.into_iter().enumerate() {
                let is_near =
                    |i: &usize| (i % width).abs_diff(x) <= RADIUS && (i / width).abs_diff(y) <= RADIUS;
                let window: Vec<usize> = (0..width * height).filter(is_near).collect();
                let own = luminances[y * width + x];
                let darker = window.iter().filter(|&&i| luminances[i] < own / 2.0).count();
                assert_eq!(found, 2 * darker > window.len(), "{width}×{height}: {x} {y}");
            }
        }
    }
}

#[test]
fn pixels_without_samples_do_not_count_as_black() {
    // A chequerboard of samples, some of them dark: the median of all pixels of the window is that of the dark ones
    let (width, height) = (9, 9);
    let mut image = Planes::new(width, height, 3);
    let counts: Vec<u32> = (0..81).map(|i| u32::from(i % 2 == 0)).collect();
    for (i, _) in counts.iter().enumerate().filter(|(_, n)| **n > 0) {
        let value = match i {
            40 => 1.5,
            20 | 22 | 38 => 0.1,
            _ => 1.0,
        };
        image.planes_mut().for_each(|plane| plane[i] = value);
    }
    let black = Planes::new(width, height, 3);
    let none = vec![0; 81];
    let found = clamp(&image, [&image, &black], [&counts, &none], &FireflySettings::default());
    assert!(found.fireflies.is_empty(), "{:?}", found.fireflies);
    image.planes_mut().for_each(|plane| plane[40] = 100.0);
    let found = clamp(&image, [&image, &black], [&counts, &none], &FireflySettings::default());
    assert_eq!(found.whole.plane(1)[40], 8.0, "8 times the median of the samples");
}
