//! A pixel's neighbourhood N: its own samples, and others drawn from a Gaussian around it that
//! resemble them (technical report, sections on preprocessing and clustering).

use multiversion::multiversion;
use rand::Rng;
use rand_pcg::Pcg32;

use super::samples::Samples;
use super::settings::{RpfPass, RpfSettings};
use crate::filter::mutual_information::{LANES, NO_SAMPLE, WORD};
use crate::filter::weights::copy;
use crate::stats::{Block, Feature, Layout};

/// Entries of the table of offsets: a window's rarest then has some tens of them.
const TABLE: usize = 1 << 13;

/// Bits of a random number that decide on an offset along one axis.
const OFFSET_BITS: u32 = 24;
/// Bits that decide on one of a pixel's samples.
const SLOT_BITS: u32 = 16;

/// Where a pass draws its samples from.
pub(super) struct Draws {
    window: usize,
    /// Samples of a neighbourhood, the pixel's own included.
    samples: usize,
    /// Quantiles of the offset along one axis.
    offsets: Vec<i16>,
    /// Place of the first entry of each offset, from the smallest on, and the table's end.
    firsts: Vec<usize>,
    /// Most samples that a pixel has.
    most_own: usize,
    /// Tolerances of features by dimension; infinite for others.
    tolerances: [f32; LANES],
    /// Deviations likewise.
    z: [f32; LANES],
}

impl Draws {
    pub fn new(pass: &RpfPass, settings: &RpfSettings, samples: &Samples, layout: &Layout) -> Self {
        let radius = (pass.window / 2) as i32;
        let deviation = ((pass.window as f32 - settings.window_trim) / 4.0).max(settings.least_deviation);
        let density = |d: i32| (-0.5 * (d as f32 / deviation).powi(2)).exp();
        let total: f32 = (-radius..=radius).map(density).sum();
        let mut below = 0.0;
        let mut firsts = vec![0];
        let mut offsets = Vec::with_capacity(TABLE);
        for d in -radius..=radius {
            below += density(d) / total;
            // At least one each, so that there is one to draw in the narrowest part of an image.
            let end = ((below * TABLE as f32).round() as usize).max(offsets.len() + 1);
            offsets.resize(end, d as i16);
            firsts.push(end);
        }

        let (mut tolerances, mut z) = ([f32::INFINITY; LANES], [0.0; LANES]);
        let second = [Block::Position2, Block::Normal2].map(|block| layout.block(block));
        for (dim, kind) in layout.features() {
            let is_second = second.iter().flatten().any(|block| block.contains(&dim));
            if settings.second_hit_decides || !is_second {
                (tolerances[dim], z[dim]) = match kind {
                    Feature::WorldPosition => (settings.tolerance_world, settings.z_world),
                    Feature::Normal | Feature::Albedo => (settings.tolerance, settings.z),
                };
            }
        }
        Self {
            window: pass.window,
            samples: (pass.share * (pass.window * pass.window) as f32 * samples.mean_count()).round()
                as usize,
            offsets,
            firsts,
            most_own: samples.most(),
            tolerances,
            z,
        }
    }

    /// Samples that a neighbourhood has at most.
    fn most_samples(&self) -> usize {
        self.samples.max(self.most_own)
    }

    /// The table's part with offsets that stay within an axis of `size` pixels at `at`.
    fn within(&self, at: usize, size: usize) -> (usize, usize) {
        let radius = self.window / 2;
        let first = self.firsts[radius - radius.min(at)];
        (first, self.firsts[radius + radius.min(size - 1 - at) + 1] - first)
    }

    /// Offset at which a number of [`OFFSET_BITS`] bits falls.
    #[inline]
    fn offset(&self, (first, len): (usize, usize), bits: u64) -> isize {
        isize::from(self.offsets[first + ((bits * len as u64) >> OFFSET_BITS) as usize])
    }
}

/// A neighbourhood, the pixel's own samples first.
pub(super) struct Neighbourhood {
    /// Sample vectors, the last block filled up with [`NO_SAMPLE`].
    blocks: Vec<[[f32; LANES]; WORD]>,
    /// Numbers of the samples.
    ids: Vec<u32>,
    len: usize,
    /// Means of the pixel's own samples.
    centre: [f32; LANES],
    drawn: Vec<Draw>,
    /// How often each pixel of the window was drawn.
    tally: Vec<u32>,
}

/// A sample of a pixel.
#[derive(Clone, Copy)]
struct Draw {
    pixel: u32,
    slot: u32,
    /// Number of the sample.
    id: u32,
}

impl Neighbourhood {
    /// An empty one, for neighbourhoods of a pass.
    pub fn new(draws: &Draws) -> Self {
        // A rejected sample is written where the next may be: one place more.
        let places = draws.most_samples() + 1;
        Self {
            blocks: vec![[[NO_SAMPLE; LANES]; WORD]; places.div_ceil(WORD)],
            ids: vec![0; places],
            len: 0,
            centre: [0.0; LANES],
            drawn: Vec::with_capacity(draws.samples),
            tally: Vec::new(),
        }
    }

    /// Samples in it.
    pub fn len(&self) -> usize {
        self.len
    }

    pub fn blocks(&self) -> &[[[f32; LANES]; WORD]] {
        &self.blocks[..self.len.div_ceil(WORD)]
    }

    /// The sample vectors.
    pub fn rows(&self) -> &[[f32; LANES]] {
        &self.blocks.as_flattened()[..self.len]
    }

    /// Numbers of the samples.
    pub fn ids(&self) -> &[u32] {
        &self.ids[..self.len]
    }

    /// Means of the pixel's own samples.
    pub fn centre(&self) -> &[f32; LANES] {
        &self.centre
    }

    /// Collects the neighbourhood of a pixel that has samples. What is drawn follows from the seed and the
    /// number of the pass.
    pub fn gather(
        &mut self,
        samples: &Samples,
        draws: &Draws,
        settings: &RpfSettings,
        (x, y): (usize, usize),
        (seed, t): (u64, usize),
    ) {
        self.draw(samples, draws, settings.draws_capped, (x, y), (seed, t));
        let own = samples.of_pixel(x, y);
        let rows = self.blocks.as_flattened_mut();
        for (slot, id) in own.clone().enumerate() {
            copy(samples.sample(y * samples.width() + x, slot), &mut rows[slot]);
            self.ids[slot] = id as u32;
        }
        let (centre, thresholds) = tolerated(&rows[..own.len()], draws);
        self.centre = centre;
        self.len = accept(&self.drawn, samples, own.len(), &centre, &thresholds, rows, &mut self.ids);
        let end = self.len.next_multiple_of(WORD);
        rows[self.len..end].fill([NO_SAMPLE; LANES]);
    }

    /// Draws from the Gaussian around a pixel, inside window and image and not from the pixel itself.
    fn draw(
        &mut self,
        samples: &Samples,
        draws: &Draws,
        capped: bool,
        (x, y): (usize, usize),
        (seed, t): (u64, usize),
    ) {
        self.drawn.clear();
        let (width, height) = (samples.width(), samples.height());
        let wanted = draws.samples.saturating_sub(samples.count(x, y));
        if width * height == 1 {
            return;
        }
        if capped {
            self.tally.clear();
            self.tally.resize((draws.window + 1).pow(2), 0);
        }
        let (columns, rows) = (draws.within(x, width), draws.within(y, height));
        let mut rng = Pcg32::new(seed.rotate_left(32) ^ (y * width + x) as u64, t as u64);
        for _ in 0..wanted {
            let (dx, dy, bits) = loop {
                let bits = rng.next_u64();
                let mask = (1 << OFFSET_BITS) - 1;
                let dx = draws.offset(columns, bits & mask);
                let dy = draws.offset(rows, bits >> OFFSET_BITS & mask);
                if (dx, dy) != (0, 0) {
                    break (dx, dy, bits >> (2 * OFFSET_BITS));
                }
            };
            let (xj, yj) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            let of_pixel = samples.of_pixel(xj, yj);
            let count = of_pixel.len();
            if capped {
                let radius = (draws.window / 2) as isize;
                let place = (dy + radius) as usize * (draws.window + 1) + (dx + radius) as usize;
                self.tally[place] += 1;
                if self.tally[place] as usize > count {
                    continue;
                }
            }
            if count > 0 {
                let slot = (bits * count as u64) >> SLOT_BITS;
                let id = (of_pixel.start as u64 + slot) as u32;
                self.drawn.push(Draw { pixel: (yj * width + xj) as u32, slot: slot as u32, id });
            }
        }
    }

    /// Mean and variance of each dimension.
    pub fn moments(&self) -> ([f32; LANES], [f32; LANES]) {
        moments(self.rows(), &self.centre)
    }
}

/// Means of a pixel's samples, and how far from them a neighbour may be.
fn tolerated(own: &[[f32; LANES]], draws: &Draws) -> ([f32; LANES], [f32; LANES]) {
    let (means, variances) = moments(own, &own[0]);
    // Unbiased; nothing is known from one.
    let unbiased = own.len() as f32 / (own.len().max(2) - 1) as f32;
    let threshold = |dim: usize| {
        let tolerance = draws.tolerances[dim];
        let deviation = (variances[dim] * unbiased).sqrt();
        let spread = draws.z[dim] * deviation;
        if deviation > tolerance { spread } else { spread.max(tolerance) }
    };
    let thresholds =
        std::array::from_fn(
            |dim| {
                if draws.tolerances[dim].is_finite() { threshold(dim) } else { f32::INFINITY }
            },
        );
    (means, thresholds)
}

/// Appends those drawn that are within the thresholds to the first `len` rows. Returns how many rows there
/// are then.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn accept(
    drawn: &[Draw],
    samples: &Samples,
    mut len: usize,
    centre: &[f32; LANES],
    thresholds: &[f32; LANES],
    rows: &mut [[f32; LANES]],
    ids: &mut [u32],
) -> usize {
    for draw in drawn {
        let row = &mut rows[len];
        copy(samples.sample(draw.pixel as usize, draw.slot as usize), row);
        ids[len] = draw.id;
        let mut apart = 0;
        for l in 0..LANES {
            apart += u32::from((row[l] - centre[l]).abs() > thresholds[l]);
        }
        len += usize::from(apart == 0);
    }
    len
}

/// Mean and variance of each dimension, summed from `shift` so that nothing cancels far from 0, and row
/// group by row group so that many do not lose what few add.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn moments(rows: &[[f32; LANES]], shift: &[f32; LANES]) -> ([f32; LANES], [f32; LANES]) {
    let (mut sums, mut squares) = ([0.0; LANES], [0.0; LANES]);
    for group in rows.chunks(WORD) {
        let (mut sum, mut square) = ([0.0; LANES], [0.0; LANES]);
        for row in group {
            for l in 0..LANES {
                let d = row[l] - shift[l];
                sum[l] += d;
                square[l] += d * d;
            }
        }
        for l in 0..LANES {
            sums[l] += sum[l];
            squares[l] += square[l];
        }
    }
    let n = rows.len() as f32;
    let mean = std::array::from_fn(|l| shift[l] + sums[l] / n);
    let variance = std::array::from_fn(|l| (squares[l] / n - (sums[l] / n).powi(2)).max(0.0));
    (mean, variance)
}

#[cfg(test)]
mod tests {
    use super::super::tests::draws;
    use super::*;
    use crate::filter::synthetic::{store, wall};
    use crate::stats::Store;

    /// A wall, its right half turned away.
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

    /// Pixels that the neighbours of a pixel lie in, by their colour.
    fn gathered(
        store: &Store,
        layout: &Layout,
        pass: &RpfPass,
        settings: &RpfSettings,
        at: (usize, usize),
    ) -> Vec<[f32; 2]> {
        let samples = Samples::of(store);
        let draws = Draws::new(pass, settings, &samples, layout);
        let mut neighbourhood = Neighbourhood::new(&draws);
        neighbourhood.gather(&samples, &draws, settings, at, (1, 0));
        let colour = layout.radiance().start;
        neighbourhood.rows().iter().map(|row| [row[colour], row[colour + 1]]).collect()
    }

    #[test]
    fn neighbours_resemble_the_pixel_lie_in_its_window_and_are_as_many_as_wanted() {
        let (layout, store) = corner(40, 4);
        let pass = RpfPass { window: 15, share: 0.5 };
        let settings = RpfSettings::report();
        // Far from the edge all that are drawn: b² n ∕ 2.
        let inside = gathered(&store, &layout, &pass, &settings, (9, 20));
        assert_eq!(inside.len(), 450);
        assert!(inside.iter().all(|[x, y]| (2.0..=16.0).contains(x) && (13.0..=27.0).contains(y)));
        assert_eq!(inside.iter().filter(|&&pixel| pixel == [9.0, 20.0]).count(), 4, "its own and no more");
        // At the edge, the half that faces the same way.
        let beside = gathered(&store, &layout, &pass, &settings, (19, 0));
        assert!((200..300).contains(&beside.len()), "{}", beside.len());
        assert!(beside.iter().all(|&[x, y]| x < 20.0 && y <= 7.0));
    }

    #[test]
    fn draws_have_the_deviation_of_a_quarter_of_the_window_as_far_as_it_reaches() {
        let (layout, store) = corner(80, 4);
        let pass = RpfPass { window: 35, share: 0.5 };
        let offsets: Vec<f32> = gathered(&store, &layout, &pass, &RpfSettings::report(), (20, 40))
            .iter()
            .map(|&[_, y]| y - 40.0)
            .collect();
        let n = offsets.len() as f32;
        let mean = offsets.iter().sum::<f32>() / n;
        let deviation = (offsets.iter().map(|d| d * d).sum::<f32>() / n).sqrt();
        // Of a Gaussian of 35 ∕ 4 cut off at two deviations: 0.88 of it.
        assert!(mean.abs() < 0.6, "{mean}");
        assert!((deviation - 0.88 * 8.75).abs() < 0.4, "{deviation}");
    }

    #[test]
    fn capped_draws_take_from_a_pixel_no_more_than_it_has() {
        let (layout, store) = corner(40, 2);
        let pass = RpfPass { window: 5, share: 4.0 };
        let settings = RpfSettings { draws_capped: true, ..RpfSettings::report() };
        let pixels = gathered(&store, &layout, &pass, &settings, (9, 20));
        assert!(pixels.iter().all(|a| pixels.iter().filter(|&b| a == b).count() <= 2), "{pixels:?}");
        assert!(pixels.len() > 40, "{}", pixels.len());
    }

    #[test]
    fn a_feature_that_varies_within_the_pixel_tolerates_its_deviations_and_a_constant_one_a_little() {
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
        let samples = Samples::of(&store);
        let draws = draws(&samples, &layout);
        let mut rows = [[0.0; LANES]; 2];
        (0..2).for_each(|slot| copy(samples.sample(0, slot), &mut rows[slot]));
        let (centre, thresholds) = tolerated(&rows, &draws);
        let albedo = layout.block(Block::Albedo).unwrap().start;
        assert_eq!(centre[albedo], 0.5);
        // 3 σ, σ² = 2 (½)²; below the tolerance of 0.1 that counts.
        assert!((thresholds[albedo] - 3.0 * 0.5f32.sqrt()).abs() < 1e-5);
        assert_eq!(thresholds[albedo + 1..albedo + 3], [0.1; 2]);
        assert_eq!(thresholds[layout.film().start], f32::INFINITY);
    }
}
