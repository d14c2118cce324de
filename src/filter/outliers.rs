//! Pixels far brighter than all around them because of one sample of rare light ("fireflies"):
//! found by comparison with the median, clamped before filtering; what is cut off is spread over
//! the pixels that resemble them.
//!
//! Stands in for RPF's spike step (Sen and Darabi 2012, section 5), which works on the samples of
//! a pixel after each pass; after the first pass of the pixel-based method there are none.

use rayon::prelude::*;

use super::blur;
use crate::image::Planes;

/// Outliers whose shares are held in memory together.
const AT_ONCE: usize = 256;

/// When a pixel is an outlier, and what happens to the energy above its bound.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct OutlierSettings {
    /// The bound on luminance is this many times the median of 5×5 pixels …
    pub medians: f32,
    /// … and this many deviations (1.48 median absolute deviations) more.
    pub deviations: f32,
    /// An outlier is brought to the median, not to the bound: nothing of it is left to be blurred
    /// into a spot.
    pub to_median: bool,
    /// One half of the samples holds more than this share of an outlier's energy; light that both
    /// halves saw is no accident.
    pub half_share: f32,
    /// Side of the window, in pixels, over which energy is spread; 0 drops it.
    pub spread_window: usize,
    /// A pixel takes from one outlier at most this share of its own luminance; more would be a
    /// halo, and is dropped.
    pub spread_limit: f32,
}

impl Default for OutlierSettings {
    fn default() -> Self {
        Self {
            medians: 8.0,
            deviations: 4.0,
            to_median: false,
            half_share: 0.8,
            spread_window: 17,
            spread_limit: 0.02,
        }
    }
}

impl OutlierSettings {
    /// Takes nothing for an outlier.
    pub fn off() -> Self {
        Self { medians: f32::INFINITY, spread_window: 0, ..Self::default() }
    }
}

/// Colours without outliers.
#[derive(Clone, Debug)]
pub struct Clamped {
    /// Mean colour of all samples: 3 planes.
    pub whole: Planes,
    /// Mean colour of each half of the samples.
    pub halves: [Planes; 2],
    /// The outliers.
    pub outliers: Vec<Outlier>,
}

/// One outlier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Index of the pixel in a plane.
    pub pixel: usize,
    /// What was cut off the whole's mean.
    pub excess: [f32; 3],
    /// Luminance that is left over luminance that was: in (0, 1).
    pub scale: f32,
}

/// Clamps outliers. `whole` and `halves` are means of 3 planes, `counts` the halves' numbers of
/// samples.
pub fn clamp(
    whole: &Planes,
    halves: [&Planes; 2],
    counts: [&[u32]; 2],
    settings: &OutlierSettings,
) -> Clamped {
    let (width, height) = (whole.width(), whole.height());
    let luminances: Vec<f32> = (0..whole.pixels()).map(|i| luminance(whole, i)).collect();
    let bounds: Vec<Option<f32>> = (0..whole.pixels())
        .into_par_iter()
        .map(|i| {
            let bound = bound(&luminances, (i % width, i / width), (width, height), settings)?;
            let [a, b] = [0, 1].map(|h| luminance(halves[h], i) * counts[h][i] as f32);
            (a.max(b) > settings.half_share * (a + b)).then_some(bound)
        })
        .collect();

    let mut clamped =
        Clamped { whole: whole.clone(), halves: halves.map(Planes::clone), outliers: Vec::new() };
    for (pixel, bound) in bounds.iter().enumerate() {
        let Some(bound) = *bound else { continue };
        for half in &mut clamped.halves {
            let scale = (bound / luminance(half, pixel).max(bound)).min(1.0);
            half.planes_mut().for_each(|plane| plane[pixel] *= scale);
        }
        let [a, b] = counts.map(|counts| counts[pixel] as f32);
        let mut excess = [0.0; 3];
        for (k, excess) in excess.iter_mut().enumerate() {
            let [of_a, of_b] = [0, 1].map(|h| clamped.halves[h].plane(k)[pixel]);
            let value = &mut clamped.whole.plane_mut(k)[pixel];
            let left = (a * of_a + b * of_b) / (a + b);
            *excess = *value - left;
            *value = left;
        }
        let scale = luminance(&clamped.whole, pixel) / luminances[pixel];
        clamped.outliers.push(Outlier { pixel, excess, scale });
    }
    clamped
}

/// Adds each outlier's excess to the pixels of the window around it that resemble it, with weights
/// that fall off as a Gaussian of a quarter window. All of `images` get the same, within
/// the limit that the first one sets.
pub fn spread(
    outliers: &[Outlier],
    images: &mut [&mut Planes],
    settings: &OutlierSettings,
    resembles: impl Fn((usize, usize), (usize, usize)) -> bool + Sync,
) {
    let [image, ..] = images else { return };
    if settings.spread_window == 0 {
        return;
    }
    let (width, height) = (image.width(), image.height());
    let limits: Vec<f32> = (0..image.pixels()).map(|i| settings.spread_limit * luminance(image, i)).collect();
    let radius = settings.spread_window / 2;
    let factor = -8.0 / (settings.spread_window * settings.spread_window) as f32;
    let falloff: Vec<f32> = (0..=radius).map(|d| (factor * (d * d) as f32).exp()).collect();
    let shares = |outlier: &Outlier| {
        let (x, y) = (outlier.pixel % width, outlier.pixel / width);
        let mut shares = Vec::new();
        let mut total = 0.0;
        for yj in y.saturating_sub(radius)..=(y + radius).min(height - 1) {
            for xj in x.saturating_sub(radius)..=(x + radius).min(width - 1) {
                if (xj, yj) == (x, y) || resembles((x, y), (xj, yj)) {
                    let weight = falloff[xj.abs_diff(x)] * falloff[yj.abs_diff(y)];
                    total += weight;
                    shares.push((yj * width + xj, weight));
                }
            }
        }
        let excess = luminance_of(outlier.excess);
        for (pixel, share) in &mut shares {
            *share = (*share / total).min(limits[*pixel] / excess);
        }
        shares
    };
    for some in outliers.chunks(AT_ONCE) {
        let all: Vec<_> = some.par_iter().map(shares).collect();
        for (outlier, shares) in some.iter().zip(all) {
            for image in images.iter_mut() {
                for (plane, excess) in image.planes_mut().zip(outlier.excess) {
                    shares.iter().for_each(|&(pixel, share)| plane[pixel] += share * excess);
                }
            }
        }
    }
}

/// What a pixel's luminance is brought to, if it is more than it may be. A pixel most of whose neighbours are black
/// has no bound: there all light is rare, and cutting it off would leave nothing.
fn bound(
    luminances: &[f32],
    (x, y): (usize, usize),
    (width, height): (usize, usize),
    settings: &OutlierSettings,
) -> Option<f32> {
    const RADIUS: usize = 2;
    let own = luminances[y * width + x];
    let mut around = [0.0; (2 * RADIUS + 1).pow(2)];
    let mut n = 0;
    for yj in y.saturating_sub(RADIUS)..=(y + RADIUS).min(height - 1) {
        for xj in x.saturating_sub(RADIUS)..=(x + RADIUS).min(width - 1) {
            around[n] = luminances[yj * width + xj];
            n += 1;
        }
    }
    let around = &mut around[..n];
    // More than half of the window must lie below this for the median to; most pixels end here.
    let low = own / settings.medians;
    if 2 * around.iter().filter(|&&l| l < low).count() <= n {
        return None;
    }
    let median = median(around);
    if median <= 0.0 {
        return None;
    }
    around.iter_mut().for_each(|l| *l = (*l - median).abs());
    let deviation = 1.48 * self::median(around);
    let bound = settings.medians * median + settings.deviations * deviation;
    (own > bound).then_some(if settings.to_median { median } else { bound })
}

/// Energy that was cut off, blurred over the surroundings of each outlier: 3 planes to be added to
/// what is lit like them. `divisor` is what the images are divided by (1 for radiance itself). Unlike
/// [`spread`] it costs the same for any number of outliers. `limit` is the share of the light at an
/// outlier that a pixel may get from it; what is more is dropped. `None` if there is nothing to add.
pub fn blurred(clamped: &Clamped, divisor: Option<&Planes>, sigma: f32, limit: f32) -> Option<Planes> {
    if clamped.outliers.is_empty() {
        return None;
    }
    let (width, height) = (clamped.whole.width(), clamped.whole.height());
    let mut excess = Planes::new(width, height, 3);
    for outlier in &clamped.outliers {
        // At its peak the blur hands a pixel this share of the outlier.
        let peak = 0.5 * std::f32::consts::FRAC_1_PI / (sigma * sigma);
        let most = limit * luminance(&clamped.whole, outlier.pixel) / peak;
        let kept = (most / luminance_of(outlier.excess)).min(1.0);
        for (channel, (plane, value)) in excess.planes_mut().zip(outlier.excess).enumerate() {
            let divisor = divisor.map_or(1.0, |divisor| divisor.plane(channel)[outlier.pixel]);
            plane[outlier.pixel] = kept * value / divisor;
        }
    }
    for plane in excess.planes_mut() {
        let blurred = blur::gaussian(width, height, plane, sigma);
        plane.copy_from_slice(&blurred);
    }
    Some(excess)
}

fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

fn luminance(planes: &Planes, i: usize) -> f32 {
    luminance_of([0, 1, 2].map(|k| planes.plane(k)[i]))
}

/// Rec. 709.
fn luminance_of([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of 0.5 in which samples of pixel 40 differ as given by half.
    fn field(halves: [f32; 2]) -> (Planes, [Planes; 2]) {
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

    fn clamped(halves: [f32; 2]) -> Clamped {
        let (whole, [a, b]) = field(halves);
        clamp(&whole, [&a, &b], [&[4; 81], &[4; 81]], &OutlierSettings::default())
    }

    #[test]
    fn a_spike_that_one_half_saw_is_clamped_and_its_energy_is_kept_aside() {
        let clamped = clamped([1e6, 0.5]);
        let [outlier] = clamped.outliers[..] else { panic!("one outlier, not {:?}", clamped.outliers) };
        assert_eq!(outlier.pixel, 40);
        let left = clamped.whole.plane(1)[40];
        assert!(left <= 8.0 * 0.5, "{left}");
        assert!((left + outlier.excess[1] - 500_000.25).abs() < 0.1);
        assert_eq!(clamped.whole.plane(1)[39], 0.5);
    }

    #[test]
    fn a_highlight_that_both_halves_saw_stays() {
        assert!(clamped([90.0, 110.0]).outliers.is_empty());
    }

    #[test]
    fn light_in_a_black_surround_stays() {
        let mut whole = Planes::new(9, 9, 3);
        whole.planes_mut().for_each(|plane| plane[40] = 1.0);
        let black = Planes::new(9, 9, 3);
        let counts = [4; 81];
        let clamped = clamp(&whole, [&whole, &black], [&counts, &counts], &OutlierSettings::default());
        assert!(clamped.outliers.is_empty());
    }

    #[test]
    fn spreading_keeps_the_energy_where_no_pixel_reaches_its_limit() {
        let outlier = Outlier { pixel: 40, excess: [0.3, 0.2, 0.1], scale: 0.5 };
        let (mut image, _) = field([0.5, 0.5]);
        let before: f32 = image.plane(0).iter().sum();
        spread(&[outlier], &mut [&mut image], &OutlierSettings::default(), |_, _| true);
        let after: f32 = image.plane(0).iter().sum();
        assert!((after - before - 0.3).abs() < 1e-4, "{before} {after}");
        assert!(image.plane(0)[40] > image.plane(0)[0]);
    }

    #[test]
    fn spreading_changes_no_pixel_beyond_the_limit_and_none_that_differs() {
        let outlier = Outlier { pixel: 40, excess: [1e8; 3], scale: 0.5 };
        let (mut image, _) = field([0.5, 0.5]);
        spread(&[outlier], &mut [&mut image], &OutlierSettings::default(), |_, (x, _)| x < 5);
        assert!(image.data().iter().all(|&v| v < 0.5 * 1.021), "{:?}", image.plane(0));
        assert!(image.plane(0).chunks(9).all(|row| row[5..].iter().all(|&v| v == 0.5)));
    }

    /// Middle of a window's values, and of their distances from it.
    fn robust(mut values: Vec<f32>) -> [f32; 2] {
        let middle = |values: &mut Vec<f32>| {
            values.sort_by(f32::total_cmp);
            values[values.len() / 2]
        };
        let median = middle(&mut values);
        values.iter_mut().for_each(|v| *v = (*v - median).abs());
        [median, middle(&mut values)]
    }

    #[test]
    fn the_bound_is_that_of_the_median_and_the_deviation_of_the_window_inside_and_at_borders() {
        let (width, height) = (9, 7);
        let level = |x: usize, y: usize| 0.5 + 0.01 * ((x * 7 + y * 3) % 11) as f32;
        for (x, y) in [(4, 3), (0, 0), (8, 6), (1, 5), (8, 2)] {
            for (settings, to_median) in [
                (OutlierSettings::default(), false),
                (OutlierSettings { to_median: true, ..OutlierSettings::default() }, true),
            ] {
                let mut grey: Vec<f32> = (0..63).map(|i| level(i % width, i / width)).collect();
                grey[y * width + x] = 1000.0;
                let window = (0..63)
                    .filter(|i| (i % width).abs_diff(x) <= 2 && (i / width).abs_diff(y) <= 2)
                    .map(|i| grey[i]);
                let [median, deviation] = robust(window.collect());
                let most = 8.0 * median + 4.0 * 1.48 * deviation;
                let found = bound(&grey, (x, y), (width, height), &settings).expect("an outlier");
                let expected = if to_median { median } else { most };
                assert!((found - expected).abs() < 1e-5, "{x},{y}: {found} for {expected}");
                // The value itself counts in the window, on the same side of the middle as before.
                grey[y * width + x] = most * 1.001;
                assert!(bound(&grey, (x, y), (width, height), &settings).is_some());
                grey[y * width + x] = most * 0.999;
                assert_eq!(bound(&grey, (x, y), (width, height), &settings), None);
            }
        }
        assert_eq!(bound(&[1.0, 0.0, 0.0, 0.0], (0, 0), (2, 2), &OutlierSettings::default()), None);
    }

    #[test]
    fn what_is_left_is_the_halves_mean_by_counts_and_the_rest_is_the_excess() {
        let (whole, [a, b]) = field([1e3, 2.0]);
        let mean = (6.0 * 1e3 + 2.0 * 2.0) / 8.0;
        let mut whole = whole;
        whole.planes_mut().for_each(|plane| plane[40] = mean);
        let clamped = clamp(&whole, [&a, &b], [&[6; 81], &[2; 81]], &OutlierSettings::default());
        let [outlier] = clamped.outliers[..] else { panic!("one outlier") };
        // The median is 0.5 and nothing deviates: the bound is 4, above the second half.
        assert_eq!([0, 1].map(|h| clamped.halves[h].plane(1)[40]), [4.0, 2.0]);
        assert_eq!(clamped.whole.plane(2)[40], 3.5);
        assert_eq!(outlier.excess, [mean - 3.5; 3]);
        assert!((outlier.scale - 3.5 / mean).abs() < 1e-8);
    }

    #[test]
    fn light_is_an_accident_if_one_half_holds_more_than_the_share_that_is_set() {
        for (a, b, expected) in [(82.0, 18.0, 1), (78.0, 22.0, 0), (18.0, 82.0, 1), (22.0, 78.0, 0)] {
            assert_eq!(clamped([a, b]).outliers.len(), expected, "{a} {b}");
        }
        let (whole, [a, b]) = field([1e6, 0.5]);
        let none = clamp(&whole, [&a, &b], [&[4; 81], &[4; 81]], &OutlierSettings::off());
        assert!(none.outliers.is_empty() && none.whole == whole);
    }

    #[test]
    fn shares_fall_off_as_a_gaussian_of_a_quarter_window_over_what_resembles() {
        let settings = OutlierSettings { spread_window: 5, spread_limit: 0.1, ..OutlierSettings::default() };
        let outliers = [11, 40].map(|pixel| Outlier { pixel, excess: [0.3, 0.2, 0.1], scale: 0.5 });
        let resembles = |_: (usize, usize), (x, y): (usize, usize)| (x + 2 * y) % 3 != 0;
        let (mut image, [mut other, _]) = field([0.5, 0.7]);
        let before = [image.clone(), other.clone()];
        spread(&outliers, &mut [&mut image, &mut other], &settings, resembles);
        let mut expected = [0.0; 81];
        for outlier in &outliers {
            let (x, y) = ((outlier.pixel % 9) as f32, (outlier.pixel / 9) as f32);
            let weights: Vec<f32> = (0..81)
                .map(|i| {
                    let (dx, dy) = ((i % 9) as f32 - x, (i / 9) as f32 - y);
                    let inside = dx.abs() <= 2.0 && dy.abs() <= 2.0;
                    let taken = inside && (i == outlier.pixel || resembles((0, 0), (i % 9, i / 9)));
                    if taken { (-(dx * dx + dy * dy) / (2.0 * 1.25 * 1.25)).exp() } else { 0.0 }
                })
                .collect();
            let total: f32 = weights.iter().sum();
            for i in 0..81 {
                let limit = 0.1 * luminance(&before[0], i) / luminance_of(outlier.excess);
                expected[i] += (weights[i] / total).min(limit);
            }
        }
        for (after, before) in [&image, &other].into_iter().zip(&before) {
            for (c, excess) in [0.3, 0.2, 0.1].into_iter().enumerate() {
                for (i, expected) in expected.iter().enumerate() {
                    let change = after.plane(c)[i] - before.plane(c)[i];
                    assert!((change - expected * excess).abs() < 1e-6, "{c} {i}: {change}");
                }
            }
        }
    }

    #[test]
    fn blurred_energy_is_a_gaussian_around_each_outlier_up_to_the_limit() {
        let (sigma, side) = (2.0, 41);
        let at = 20 * side + 20;
        let mut whole = Planes::new(side, side, 3);
        whole.data_mut().fill(0.5);
        let mut divisor = whole.clone();
        divisor.plane_mut(1).fill(0.25);
        for (excess, limit) in [([3.0, 2.0, 1.0], 1.0), ([3e3, 2e3, 1e3], 0.02)] {
            let outliers = vec![Outlier { pixel: at, excess, scale: 0.5 }];
            let halves = [whole.clone(), whole.clone()];
            let clamped = Clamped { whole: whole.clone(), halves, outliers };
            let light = blurred(&clamped, Some(&divisor), sigma, limit).expect("an outlier");
            let mut impulse = vec![0.0; side * side];
            impulse[at] = 1.0;
            let peak = 1.0 / (2.0 * std::f32::consts::PI * sigma * sigma);
            let kept = (limit * 0.5 / (peak * luminance_of(excess))).min(1.0);
            for (i, share) in blur::gaussian(side, side, &impulse, sigma).into_iter().enumerate() {
                for (c, by) in [0.5, 0.25, 0.5].into_iter().enumerate() {
                    let expected = share * kept * excess[c] / by;
                    let error = (light.plane(c)[i] - expected).abs();
                    assert!(error <= 1e-4 * expected, "{c} {i}: {} for {expected}", light.plane(c)[i]);
                }
            }
            let plain = blurred(&clamped, None, sigma, limit).expect("an outlier");
            assert!((plain.plane(1)[at] - 0.25 * light.plane(1)[at]).abs() <= 1e-5 * light.plane(1)[at]);
        }
        let none = Clamped { halves: [whole.clone(), whole.clone()], whole, outliers: Vec::new() };
        assert!(blurred(&none, None, sigma, 1.0).is_none());
    }
}
