//! The joint bilateral filter of one pass (paper, Eq. 4), pixel by pixel.
//!
//! Differences of normalised values are differences of values over the neighbourhood's deviation,
//! so that normalisation is a factor in each dimension's gain and nothing normalised is stored.

use multiversion::multiversion;
use multiversion::target::match_target;
use rayon::prelude::*;

use super::neighbourhood::{Guide, Neighbourhood};
use super::padded::{LANES, Padded};
use super::prpf::Gain;

/// Channels that are averaged: the image, and the difference of its halves.
pub(super) const CHANNELS: usize = 6;

/// Rows of the window that are worked on at once, so that what belongs to the pixel itself is read
/// once for all. Rows, not columns: of overlapping reads the compiler would make shuffles.
const ROWS: usize = 4;

/// Rows that one task filters.
const TASK_ROWS: usize = 8;

/// Blocks of pixels whose windows are filtered row after row while their planes stay in the cache.
const TASK_BLOCKS: usize = 8;

/// Exponents above it give a weight of 0: e⁻⁴⁰ beside the pixel's own weight is below `f32`'s
/// precision, and smaller weights would bring slow denormal numbers.
const EXPONENT_CUT: f32 = 40.0;

/// Features and colours at most.
const MOST_DIMENSIONS: usize = 18;

/// Most that a neighbour's sample count may count above or below the pixel's own.
const COUNT_RATIO: f32 = 4.0;

/// Below this share of |mean| (or of 1) a deviation is rounding noise, and the dimension constant.
pub(super) const CONSTANT: f32 = 1e-6;

/// Filters all channels once with the same weights. `weights` are planes as
/// [`Evidence::evaluate`](super::weights::Evidence::evaluate) writes them.
pub(super) fn filter(
    values: &Padded,
    guide: &Guide,
    neighbourhood: &Neighbourhood,
    weights: &Padded,
    window: usize,
    gain: Gain,
) -> Padded {
    let gains = gains(guide, neighbourhood, weights, gain);
    let spatial = Spatial::new(window, gain);
    let mut filtered = values.clone();
    let rows = values.row_len() * TASK_ROWS;
    if rows > 0 {
        filtered.data_mut().par_chunks_mut(rows).enumerate().for_each(|(task, out)| {
            filter_rows(values, guide, &gains, &spatial, task * TASK_ROWS, out);
        });
    }
    filtered
}

/// Factors of the squared differences in the exponent: features, then colours.
fn gains(guide: &Guide, hood: &Neighbourhood, weights: &Padded, gain: Gain) -> Padded {
    let features = guide.features();
    let dims = features + 3;
    let mut gains = Padded::new(guide.width(), guide.height(), dims, 0, 0.0);
    let (stride, row_len) = (gains.stride(), gains.row_len());
    gains.data_mut().par_chunks_mut(row_len.max(1)).enumerate().for_each(|(y, row)| {
        let counts = guide.counts.row(0, y);
        let colour_randomness = weights.row(dims, y);
        for (k, out) in row.chunks_mut(stride).enumerate() {
            let weight = weights.row(k, y);
            let variances = hood.variances(k, y);
            let means = hood.means(k, y);
            let own = guide.variances.row(k, y);
            for x in 0..counts.len() {
                if variances[x] <= (CONSTANT * means[x].abs().max(1.0)).powi(2) {
                    continue;
                }
                let factor = match gain {
                    Gain::RpfSigma { sigma8_squared } => {
                        rpf_factor(colour_randomness[x], sigma8_squared) / variances[x]
                    }
                    Gain::OwnVariance { kappa, rho } => 1.0 / (2.0 * kappa * (own[x] + rho * variances[x])),
                };
                out[x] = weight[x] * counts[x] * factor;
            }
        }
    });
    gains
}

/// One over 2σ_c² for one sample (Sen and Darabi 2012): σ_c² = 8 σ₈² ∕ (n (1 − W_c^r)²).
pub(super) fn rpf_factor(colour_randomness: f32, sigma8_squared: f32) -> f32 {
    (1.0 - colour_randomness).powi(2) / (16.0 * sigma8_squared)
}

/// The Gaussian of the film distance, as exponents by offset along one axis.
struct Spatial {
    radius: usize,
    /// From -radius to radius.
    exponents: Vec<f32>,
}

impl Spatial {
    fn new(window: usize, gain: Gain) -> Self {
        let half = window / 2;
        let (deviation, radius) = match gain {
            Gain::RpfSigma { .. } => (window as f32 / 4.0, half),
            // Beyond √12 deviations (exponent 6) a neighbour counts less than 1/400.
            Gain::OwnVariance { .. } => {
                let deviation = window as f32 / 12.0;
                (deviation, half.min((12f32.sqrt() * deviation) as usize))
            }
        };
        let exponent = |i: usize| {
            let d = i as f32 - radius as f32;
            d * d / (2.0 * deviation * deviation)
        };
        Self { radius, exponents: (0..=2 * radius).map(exponent).collect() }
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn filter_rows(
    values: &Padded,
    guide: &Guide,
    gains: &Padded,
    spatial: &Spatial,
    first: usize,
    out: &mut [f32],
) {
    match_target! {
        "x86_64+fma" => filter_tiles::<true>(values, guide, gains, spatial, first, out),
        "aarch64" => filter_tiles::<true>(values, guide, gains, spatial, first, out),
        _ => filter_tiles::<false>(values, guide, gains, spatial, first, out),
    }
}

#[inline(always)]
fn filter_tiles<const FMA: bool>(
    values: &Padded,
    guide: &Guide,
    gains: &Padded,
    spatial: &Spatial,
    first: usize,
    out: &mut [f32],
) {
    let tile = TASK_BLOCKS * LANES;
    for start in (0..values.width()).step_by(tile) {
        for (row, out) in out.chunks_mut(values.row_len()).enumerate() {
            for x in (start..values.width().min(start + tile)).step_by(LANES) {
                let block = filter_block::<FMA>(values, guide, gains, spatial, x, first + row);
                let lanes = LANES.min(values.width() - x);
                for (channel, block) in block.iter().enumerate() {
                    let at = channel * values.stride() + values.margin() + x;
                    out[at..at + lanes].copy_from_slice(&block[..lanes]);
                }
            }
        }
    }
}

type Lanes = [f32; LANES];

/// What a block of pixels brings to all its pairs.
struct Centre {
    hit: Lanes,
    /// Limits of a neighbour's count.
    at_least: Lanes,
    at_most: Lanes,
    values: [Lanes; CHANNELS],
}

/// Sums over a block's neighbours.
struct Sums {
    weights: Lanes,
    /// Of differences from the pixel itself: what is constant stays so exactly.
    values: [Lanes; CHANNELS],
}

/// Filters [`LANES`] pixels of one row.
#[inline(always)]
fn filter_block<const FMA: bool>(
    values: &Padded,
    guide: &Guide,
    gains: &Padded,
    spatial: &Spatial,
    x: usize,
    y: usize,
) -> [Lanes; CHANNELS] {
    let counts = guide.counts.lanes(0, y, x);
    let centre = Centre {
        hit: *guide.own_hit.lanes(0, y, x),
        at_least: counts.map(|n| n / COUNT_RATIO),
        // A pixel without samples takes its neighbours as they are.
        at_most: counts.map(|n| if n > 0.0 { n * COUNT_RATIO } else { f32::INFINITY }),
        values: std::array::from_fn(|c| *values.lanes(c, y, x)),
    };
    let mut sums = Sums { weights: [0.0; LANES], values: [[0.0; LANES]; CHANNELS] };

    // Value, gain and threshold of each dimension, side by side.
    let mut dims = [[[f32::INFINITY; LANES]; 3]; MOST_DIMENSIONS];
    for (k, own) in dims[..guide.means.count()].iter_mut().enumerate() {
        (own[0], own[1]) = (*guide.means.lanes(k, y, x), *gains.lanes(k, y, x));
        if k < guide.features() {
            own[2] = *guide.thresholds.lanes(k, y, x);
        }
    }
    let (features, colours) = dims[..guide.means.count()].split_at(guide.features());

    let radius = spatial.radius;
    let (first, last) = (y.saturating_sub(radius), (y + radius).min(values.height() - 1));
    for top in (first..=last).step_by(ROWS) {
        // Past the window's last row there is none with a weight.
        let rows: [usize; ROWS] = std::array::from_fn(|r| (top + r).min(last));
        let vertical: [f32; ROWS] = std::array::from_fn(|r| {
            if top + r <= last { spatial.exponents[top + r + radius - y] } else { f32::INFINITY }
        });
        for (column, horizontal) in spatial.exponents.iter().enumerate() {
            let at = values.margin() + x + column - radius;
            // Four variables: in an array the compiler would keep them in memory.
            let [mut e0, mut e1, mut e2, mut e3] = vertical.map(|vertical| [vertical + horizontal; LANES]);
            let [r0, r1, r2, r3] = rows.map(|row| guide.means.from(row, at));
            let mut others = r0.zip(r1).zip(r2).zip(r3);
            for ([own, gain, threshold], (((r0, r1), r2), r3)) in features.iter().zip(&mut others) {
                add_distance::<FMA, true>(&mut e0, own, lanes(r0), gain, threshold);
                add_distance::<FMA, true>(&mut e1, own, lanes(r1), gain, threshold);
                add_distance::<FMA, true>(&mut e2, own, lanes(r2), gain, threshold);
                add_distance::<FMA, true>(&mut e3, own, lanes(r3), gain, threshold);
            }
            for ([own, gain, threshold], (((r0, r1), r2), r3)) in colours.iter().zip(&mut others) {
                add_distance::<FMA, false>(&mut e0, own, lanes(r0), gain, threshold);
                add_distance::<FMA, false>(&mut e1, own, lanes(r1), gain, threshold);
                add_distance::<FMA, false>(&mut e2, own, lanes(r2), gain, threshold);
                add_distance::<FMA, false>(&mut e3, own, lanes(r3), gain, threshold);
            }
            for (e, row) in [e0, e1, e2, e3].iter().zip(rows) {
                add_neighbours::<FMA>(&mut sums, &centre, e, guide, values, row, at);
            }
        }
    }

    for (values, centre) in sums.values.iter_mut().zip(&centre.values) {
        for l in 0..LANES {
            let shift = if sums.weights[l] > 0.0 { values[l] / sums.weights[l] } else { 0.0 };
            values[l] = centre[l] + shift;
        }
    }
    sums.values
}

/// One term of the exponents; infinite where the dimension says that pixels do not resemble.
#[inline(always)]
fn add_distance<const FMA: bool, const TEST: bool>(
    exponents: &mut Lanes,
    own: &Lanes,
    others: &Lanes,
    gain: &Lanes,
    threshold: &Lanes,
) {
    for l in 0..LANES {
        let d = own[l] - others[l];
        let d2 = d * d;
        let sum = add_product::<FMA>(gain[l], d2, exponents[l]);
        exponents[l] = if TEST && d2 > threshold[l] { f32::INFINITY } else { sum };
    }
}

/// Adds one neighbour of each pixel of a block.
#[inline(always)]
fn add_neighbours<const FMA: bool>(
    sums: &mut Sums,
    centre: &Centre,
    exponents: &Lanes,
    guide: &Guide,
    values: &Padded,
    y: usize,
    at: usize,
) {
    let hits = lanes(&guide.hit.wide(0, y)[at..]);
    let counts = lanes(&guide.counts.wide(0, y)[at..]);
    let mut weights = [0.0; LANES];
    for l in 0..LANES {
        let count = counts[l].max(centre.at_least[l]).min(centre.at_most[l]);
        let weight = count * exp_minus::<FMA>(exponents[l]);
        let resembles = (centre.hit[l] - hits[l]).abs() <= Guide::HIT_TOLERANCE;
        weights[l] = if resembles & (exponents[l] <= EXPONENT_CUT) { weight } else { 0.0 };
        sums.weights[l] += weights[l];
    }
    // Whole blocks are read before any is written: what is read might be what is written, for all
    // the compiler knows.
    let mut others = values.from(y, at);
    for c in 0..CHANNELS {
        let (others, old) = (*lanes(others.next().expect("all channels are there")), sums.values[c]);
        sums.values[c] =
            std::array::from_fn(|l| add_product::<FMA>(weights[l], others[l] - centre.values[c][l], old[l]));
    }
}

#[inline(always)]
fn lanes(values: &[f32]) -> &Lanes {
    values[..LANES].try_into().expect("the slice has this length")
}

#[inline(always)]
pub(super) fn add_product<const FMA: bool>(a: f32, b: f32, sum: f32) -> f32 {
    if FMA { a.mul_add(b, sum) } else { a * b + sum }
}

/// e⁻ᵉ for 0 ≤ e ≤ [`EXPONENT_CUT`], relative error below 10⁻⁵ and exact at 0: 2ᶠ by its Taylor
/// polynomial on [-½, ½], the integer part added to the exponent's bits. Without a conversion to
/// integers, which would keep the compiler from using vectors.
#[inline(always)]
fn exp_minus<const FMA: bool>(e: f32) -> f32 {
    // Adding it leaves the nearest integer in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    const LN_2: f32 = std::f32::consts::LN_2;
    let x = e * -std::f32::consts::LOG2_E;
    let rounded = x + ROUND;
    let f = x - (rounded - ROUND);
    let p = add_product::<FMA>(f, LN_2.powi(5) / 120.0, LN_2.powi(4) / 24.0);
    let p = add_product::<FMA>(p, f, LN_2.powi(3) / 6.0);
    let p = add_product::<FMA>(p, f, LN_2 * LN_2 / 2.0);
    let p = add_product::<FMA>(p, f, LN_2);
    let p = add_product::<FMA>(p, f, 1.0);
    f32::from_bits(p.to_bits().wrapping_add(rounded.to_bits() << 23))
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::super::colours::Colours;
    use super::super::prpf::PrpfSettings;
    use super::super::synthetic::{store, wall};
    use super::*;
    use crate::stats::{Block, Layout};

    /// The definition, in double precision.
    fn by_definition(
        values: &Padded,
        guide: &Guide,
        gains: &Padded,
        deviation: f64,
        radius: usize,
        (x, y): (usize, usize),
    ) -> [f64; CHANNELS] {
        let (mut sums, mut total) = ([0.0; CHANNELS], 0.0);
        for yj in y.saturating_sub(radius)..=(y + radius).min(guide.height() - 1) {
            for xj in x.saturating_sub(radius)..=(x + radius).min(guide.width() - 1) {
                if !guide.resembles((x, y), (xj, yj)) {
                    continue;
                }
                let squared = x.abs_diff(xj).pow(2) + y.abs_diff(yj).pow(2);
                let mut exponent = squared as f64 / (2.0 * deviation * deviation);
                for k in 0..guide.features() + 3 {
                    let d = f64::from(guide.means.at(k, x, y)) - f64::from(guide.means.at(k, xj, yj));
                    exponent += f64::from(gains.at(k, x, y)) * d * d;
                }
                let n = f64::from(guide.counts.at(0, x, y));
                let count = f64::from(guide.counts.at(0, xj, yj)).clamp(n / 4.0, n * 4.0);
                let weight = count * (-exponent).exp();
                total += weight;
                for (c, sum) in sums.iter_mut().enumerate() {
                    *sum += weight * f64::from(values.at(c, xj, yj));
                }
            }
        }
        sums.map(|sum| sum / total)
    }

    #[test]
    fn vectors_agree_with_the_definition_at_every_pixel() {
        let layout = Layout::with_blocks(|b| matches!(b, Block::Position1 | Block::Albedo | Block::Hit));
        let count = |x: usize, y: usize| 2 + (x * y) as u32 % 30;
        let store = store(37, 22, layout.clone(), count, |x, y, _, rng| {
            let mut sample = wall(&layout, x, y, [rng.random(), rng.random(), 1.0], rng);
            let albedo = [0.5, 0.5 + 0.2 * rng.random::<f32>(), (x / 9) as f32];
            layout.write(&mut sample, Block::Albedo, &albedo);
            layout.write(&mut sample, Block::Hit, &[f32::from(y > 4)]);
            sample
        });
        let settings = PrpfSettings::paper();
        let colours = Colours::new(&store, &settings.outliers);
        let guide = Guide::new(&store, colours.guide(), &settings);
        let values = colours.values(settings.margin());
        for (gain, window, deviation, radius) in [
            (Gain::RpfSigma { sigma8_squared: 0.02 }, 17, 17.0 / 4.0, 8),
            (Gain::RpfSigma { sigma8_squared: 0.02 }, 55, 55.0 / 4.0, 27),
            (Gain::OwnVariance { kappa: 8.0, rho: 1e-3 }, 35, 35.0 / 12.0, 10),
        ] {
            let neighbourhood = Neighbourhood::new(&guide, window, 9);
            // α, β and W_c^r.
            let weights = Padded::new(37, 22, guide.features() + 4, 0, 0.3);
            let gains = gains(&guide, &neighbourhood, &weights, gain);
            let filtered = filter(&values, &guide, &neighbourhood, &weights, window, gain);
            for (x, y) in (0..22).flat_map(|y| (0..37).map(move |x| (x, y))) {
                let expected = by_definition(&values, &guide, &gains, deviation, radius, (x, y));
                for (c, expected) in expected.into_iter().enumerate() {
                    let found = f64::from(filtered.at(c, x, y));
                    assert!((found - expected).abs() < 2e-5, "({x}, {y}) {c}: {found} for {expected}");
                }
            }
        }
    }

    #[test]
    fn the_exponential_is_one_at_zero_and_close_elsewhere() {
        assert_eq!(exp_minus::<false>(0.0), 1.0);
        assert_eq!(exp_minus::<true>(0.0), 1.0);
        for i in 0..=4000 {
            let e = i as f32 * 0.01;
            let expected = (-f64::from(e)).exp();
            for found in [exp_minus::<false>(e), exp_minus::<true>(e)] {
                assert!((f64::from(found) / expected - 1.0).abs() < 1e-5, "{e}: {found} for {expected}");
            }
        }
    }

    #[test]
    fn gains_are_weights_times_counts_over_the_variance_of_either_reading() {
        let layout = Layout::with_blocks(|b| matches!(b, Block::Albedo));
        let count = |x: usize, _: usize| 2 + x as u32;
        let store = store(9, 5, layout.clone(), count, |x, y, _, rng| {
            let mut sample = wall(&layout, x, y, [rng.random(), 0.1 * rng.random::<f32>(), 1.0], rng);
            layout.write(&mut sample, Block::Albedo, &[0.5, rng.random(), x as f32]);
            sample
        });
        let settings = PrpfSettings::paper();
        let guide = Guide::new(&store, Colours::new(&store, &settings.outliers).guide(), &settings);
        let hood = Neighbourhood::new(&guide, 7, 9);
        let dims = guide.features() + 3;
        let mut weights = Padded::new(9, 5, dims + 1, 0, 0.0);
        for (k, x, y) in (0..=dims).flat_map(|k| (0..45).map(move |i| (k, i % 9, i / 9))) {
            weights.set(k, x, y, 0.05 * (1 + k + x) as f32);
        }
        for gain in [Gain::RpfSigma { sigma8_squared: 0.003 }, Gain::OwnVariance { kappa: 3.0, rho: 0.2 }] {
            let found = gains(&guide, &hood, &weights, gain);
            let mut constant = 0;
            for (k, x, y) in (0..dims).flat_map(|k| (0..45).map(move |i| (k, i % 9, i / 9))) {
                let variance = hood.variance(k, x, y);
                // A deviation of less than 10⁻⁶ beside the mean, or beside 1, is none.
                let is_constant = variance.sqrt() <= 1e-6 * hood.mean(k, x, y).abs().max(1.0);
                let measure = match gain {
                    // 8 σ₈² ∕ (1 − W)² of the neighbourhood's, twice.
                    Gain::RpfSigma { .. } => {
                        2.0 * variance * 8.0 * 0.003 / (1.0 - weights.at(dims, x, y)).powi(2)
                    }
                    Gain::OwnVariance { .. } => 2.0 * 3.0 * (guide.variances.at(k, x, y) + 0.2 * variance),
                };
                let expected = if is_constant { 0.0 } else { weights.at(k, x, y) * (2 + x) as f32 / measure };
                let error = (found.at(k, x, y) - expected).abs();
                assert!(
                    error <= 1e-4 * expected,
                    "{gain:?} {k} {x} {y}: {} for {expected}",
                    found.at(k, x, y)
                );
                constant += usize::from(is_constant);
            }
            assert!(constant > 45 && constant < 45 * (dims - 2), "{constant} tell little");
        }
    }
}
