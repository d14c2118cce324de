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
}
