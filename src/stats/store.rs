//! The pixel-statistics store.

use rayon::prelude::*;

use super::moments::{Moments, update};
use super::{Group, Layout, reservoir};
use crate::image::Planes;

/// Which samples of a pixel are meant. The halves are the samples of even and of odd index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Whole,
    /// 0 or 1.
    Half(usize),
}

/// Statistics of every pixel of an image, current after every sample.
///
/// Kept as rows so that a renderer can fill rows in parallel; within a row as planes, one for each
/// dimension.
#[derive(Clone, Debug)]
pub struct Store {
    width: usize,
    layout: Layout,
    capacity: usize,
    rows: Vec<Row>,
}

/// One row of the store. Sample vectors are pushed into it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    width: usize,
    /// Pixels from one dimension to the next: a whole and odd number of cache lines, so that the
    /// dimensions of one pixel do not compete for the same cache sets.
    stride: usize,
    dims: usize,
    /// Dimensions whose values must be non-negative.
    radiance: Vec<usize>,
    capacity: usize,
    /// Indices drawn per pixel, rejected ones included: the address of the pixel's next sample.
    drawn: Vec<u32>,
    rejected: Vec<u32>,
    halves: [HalfRow; 2],
    /// `[pixel][slot][dimension]`.
    reservoir: Vec<f32>,
    keys: Vec<u64>,
}

/// Moments of one half of the samples, `[dimension][pixel]`.
#[derive(Clone, Debug, PartialEq)]
struct HalfRow {
    count: Vec<u32>,
    mean: Vec<f64>,
    m2: Vec<f64>,
}

impl Store {
    /// An empty store. `capacity` is how many whole sample vectors the reservoir keeps per pixel;
    /// `seed` decides which.
    pub fn new(width: usize, height: usize, layout: Layout, capacity: usize, seed: u64) -> Self {
        let rows = (0..height).into_par_iter().map(|y| Row::new(width, y, &layout, capacity, seed)).collect();
        Self { width, layout, capacity, rows }
    }

    /// Bytes that a store needs per pixel.
    pub fn bytes_per_pixel(layout: &Layout, capacity: usize) -> usize {
        let moments = 2 * (size_of::<u32>() + layout.len() * 2 * size_of::<f64>());
        let bookkeeping = 2 * size_of::<u32>() + size_of::<u64>();
        moments + bookkeeping + capacity * layout.len() * size_of::<f32>()
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.rows.len()
    }

    pub fn pixels(&self) -> usize {
        self.width * self.height()
    }

    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Sample vectors kept per pixel at most.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The rows, to be filled in parallel.
    pub fn rows_mut(&mut self) -> &mut [Row] {
        &mut self.rows
    }

    /// Takes in samples of one pixel, see [`Row::push`].
    pub fn push(&mut self, x: usize, y: usize, samples: &[f32]) {
        self.rows[y].push(x, samples);
    }

    /// Adds another store's samples. The streams must be independent (other seeds) or disjoint.
    ///
    /// # Panics
    /// If sizes, layouts or capacities differ.
    pub fn merge(&mut self, other: &Self) {
        assert!(
            self.width == other.width
                && self.rows.len() == other.rows.len()
                && self.layout == other.layout
                && self.capacity == other.capacity,
            "only stores of the same shape can be merged"
        );
        self.rows.par_iter_mut().zip(&other.rows).for_each(|(a, b)| a.merge(b));
    }

    /// Accepted samples per pixel.
    pub fn counts(&self, part: Part) -> Vec<u32> {
        self.rows.iter().flat_map(|row| (0..self.width).map(move |x| row.count(x, part))).collect()
    }

    /// Accepted samples of the whole image.
    pub fn samples(&self) -> u64 {
        self.rows.iter().flat_map(|row| &row.halves).flat_map(|half| &half.count).map(|&n| u64::from(n)).sum()
    }

    /// Samples rejected because a value was not finite or a radiance negative.
    pub fn rejected(&self) -> u64 {
        self.rows.iter().flat_map(|row| &row.rejected).map(|&n| u64::from(n)).sum()
    }

    /// Means of some dimensions, a plane for each; 0 where there is no sample.
    pub fn means(&self, part: Part, dims: impl IntoIterator<Item = usize>) -> Planes {
        self.extract(part, dims, |m| m.mean)
    }

    /// Unbiased variances *of the samples* (divide by the count for that of the mean), a plane for
    /// each of the dimensions; 0 where there are fewer than two samples.
    pub fn variances(&self, part: Part, dims: impl IntoIterator<Item = usize>) -> Planes {
        self.extract(part, dims, Moments::variance)
    }

    /// What a filter that works on halves reads of some dimensions, in one go: the means of both
    /// halves, and the unbiased variance of the samples of the whole.
    pub fn halves(&self, dims: std::ops::Range<usize>) -> ([Planes; 2], Planes) {
        let planes = || Planes::new(self.width, self.height(), dims.len());
        let (mut a, mut b, mut variance) = (planes(), planes(), planes());
        let width = self.width.max(1);
        let each = a.planes_mut().zip(b.planes_mut()).zip(variance.planes_mut()).zip(dims.clone());
        for (((a, b), variance), dim) in each {
            let rows =
                a.par_chunks_mut(width).zip(b.par_chunks_mut(width)).zip(variance.par_chunks_mut(width));
            rows.zip(&self.rows).for_each(|(((a, b), variance), row)| row.read_halves(dim, a, b, variance));
        }
        ([a, b], variance)
    }

    fn extract(
        &self,
        part: Part,
        dims: impl IntoIterator<Item = usize>,
        value: impl Fn(Moments) -> f64 + Sync,
    ) -> Planes {
        let dims: Vec<usize> = dims.into_iter().collect();
        let mut planes = Planes::new(self.width, self.height(), dims.len());
        let width = self.width.max(1);
        planes.planes_mut().zip(&dims).for_each(|(plane, &dim)| {
            plane.par_chunks_mut(width).zip(&self.rows).for_each(|(out, row)| {
                for (x, out) in out.iter_mut().enumerate() {
                    *out = value(row.moments(x, dim, part)) as f32;
                }
            });
        });
        planes
    }
}

impl Row {
    fn new(width: usize, y: usize, layout: &Layout, capacity: usize, seed: u64) -> Self {
        let dims = layout.len();
        let stride = (width.div_ceil(8) | 1) * 8;
        let half = || HalfRow {
            count: vec![0; width],
            mean: vec![0.0; stride * dims],
            m2: vec![0.0; stride * dims],
        };
        Self {
            width,
            stride,
            dims,
            radiance: layout
                .dimensions()
                .iter()
                .enumerate()
                .filter_map(|(i, d)| (d.group == Group::Colour).then_some(i))
                .chain(layout.radiance())
                .collect(),
            capacity,
            drawn: vec![0; width],
            rejected: vec![0; width],
            halves: [half(), half()],
            reservoir: vec![0.0; width * capacity * dims],
            keys: (0..width).map(|x| reservoir::key(seed, x, y)).collect(),
        }
    }

    /// Index of the pixel's next sample.
    pub fn next_index(&self, x: usize) -> u32 {
        self.drawn[x]
    }

    /// Takes in the pixel's next samples, in the order of their indices: `samples` holds whole
    /// sample vectors one after the other. A sample with a value that is not finite, or with
    /// negative radiance, is counted as rejected and touches no statistic; its index is used up.
    pub fn push(&mut self, x: usize, samples: &[f32]) {
        for sample in samples.chunks_exact(self.dims) {
            let index = self.drawn[x];
            self.drawn[x] = index.saturating_add(1);
            if !sample.iter().all(|v| v.is_finite()) || self.radiance.iter().any(|&d| sample[d] < 0.0) {
                self.rejected[x] += 1;
                continue;
            }
            self.keep(x, sample);
            let half = &mut self.halves[index as usize & 1];
            half.count[x] += 1;
            let weight = 1.0 / f64::from(half.count[x]);
            let means = half.mean[x..].iter_mut().step_by(self.stride);
            let m2s = half.m2[x..].iter_mut().step_by(self.stride);
            for ((mean, m2), &value) in means.zip(m2s).zip(sample) {
                update(mean, m2, f64::from(value), weight);
            }
        }
    }

    /// Accepted samples.
    pub fn count(&self, x: usize, part: Part) -> u32 {
        match part {
            Part::Half(h) => self.halves[h].count[x],
            Part::Whole => self.halves[0].count[x] + self.halves[1].count[x],
        }
    }

    /// Samples rejected.
    pub fn rejected(&self, x: usize) -> u32 {
        self.rejected[x]
    }

    /// Moments of one dimension.
    #[inline]
    pub fn moments(&self, x: usize, dim: usize, part: Part) -> Moments {
        let half = |h: usize| {
            let half = &self.halves[h];
            let i = dim * self.stride + x;
            Moments { count: half.count[x], mean: half.mean[i], m2: half.m2[i] }
        };
        match part {
            Part::Half(h) => half(h),
            Part::Whole => half(0).merge(half(1)),
        }
    }

    /// Means of the halves and variance of the whole of one dimension, in a loop over pixels that
    /// has no branches.
    fn read_halves(&self, dim: usize, mean_a: &mut [f32], mean_b: &mut [f32], variance: &mut [f32]) {
        let width = self.width;
        let [a, b] = &self.halves;
        let span = dim * self.stride..dim * self.stride + width;
        let (n_a, n_b) = (&a.count[..width], &b.count[..width]);
        let (m_a, m_b) = (&a.mean[span.clone()], &b.mean[span.clone()]);
        let (s_a, s_b) = (&a.m2[span.clone()], &b.m2[span]);
        let (mean_a, mean_b, variance) = (&mut mean_a[..width], &mut mean_b[..width], &mut variance[..width]);
        for x in 0..width {
            let (n, k) = (f64::from(n_a[x]), f64::from(n_b[x]));
            let d = m_a[x] - m_b[x];
            let m2 = s_a[x] + s_b[x] + d * d * (n * k) / (n + k).max(1.0);
            mean_a[x] = m_a[x] as f32;
            mean_b[x] = m_b[x] as f32;
            variance[x] = (m2 / (n + k - 1.0).max(1.0)) as f32;
        }
    }

    /// Whole sample vectors kept of a pixel, one after the other: a uniform choice of those seen.
    pub fn reservoir(&self, x: usize) -> &[f32] {
        let kept = (self.count(x, Part::Whole) as usize).min(self.capacity);
        &self.reservoir[x * self.capacity * self.dims..][..kept * self.dims]
    }

    fn keep(&mut self, x: usize, sample: &[f32]) {
        let seen = self.count(x, Part::Whole);
        if let Some(slot) = reservoir::slot(self.keys[x], seen, self.capacity) {
            let start = (x * self.capacity + slot) * self.dims;
            self.reservoir[start..][..self.dims].copy_from_slice(sample);
        }
    }

    fn merge(&mut self, other: &Self) {
        for x in 0..self.width {
            self.merge_reservoir(x, other);
            self.drawn[x] = self.drawn[x].saturating_add(other.drawn[x]);
            self.rejected[x] = self.rejected[x].saturating_add(other.rejected[x]);
        }
        for (h, half) in self.halves.iter_mut().enumerate() {
            let other = &other.halves[h];
            for (dim, x) in (0..self.dims).flat_map(|dim| (0..self.width).map(move |x| (dim, x))) {
                let i = dim * self.stride + x;
                let a = Moments { count: half.count[x], mean: half.mean[i], m2: half.m2[i] };
                let b = Moments { count: other.count[x], mean: other.mean[i], m2: other.m2[i] };
                let m = a.merge(b);
                (half.mean[i], half.m2[i]) = (m.mean, m.m2);
            }
            half.count.iter_mut().zip(&other.count).for_each(|(a, b)| *a += b);
        }
    }

    /// Fills the reservoir from both, each kept sample standing for an equal share of its stream.
    fn merge_reservoir(&mut self, x: usize, other: &Self) {
        let (mut left_a, mut left_b) =
            (u64::from(self.count(x, Part::Whole)), u64::from(other.count(x, Part::Whole)));
        let (a, b) = (self.reservoir(x).to_vec(), other.reservoir(x));
        let (mut a, mut b) = (a.chunks_exact(self.dims), b.chunks_exact(self.dims));
        let mut merged = Vec::with_capacity(self.capacity * self.dims);
        for slot in 0..self.capacity as u64 {
            let total = left_a + left_b;
            if total == 0 {
                break;
            }
            // Draw without replacement from the union of the streams.
            let from_a = reservoir::hash(self.keys[x] ^ other.keys[x].rotate_left(1) ^ slot) % total < left_a;
            let drawn = if from_a { a.next() } else { b.next() };
            let left = if from_a { &mut left_a } else { &mut left_b };
            *left -= 1;
            merged.extend_from_slice(drawn.expect("a stream keeps all it has, up to the capacity"));
        }
        self.reservoir[x * self.capacity * self.dims..][..merged.len()].copy_from_slice(&merged);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Block;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};

    const WIDTH: usize = 5;
    const HEIGHT: usize = 3;

    fn layout() -> Layout {
        Layout::with_blocks(|b| matches!(b, Block::Position1 | Block::Radiance | Block::Lens))
    }

    fn sample(layout: &Layout, value: impl FnMut(usize) -> f32) -> Vec<f32> {
        (0..layout.len()).map(value).collect()
    }

    fn random_store(seed: u64, per_pixel: u32) -> (Store, Vec<Vec<f32>>) {
        let layout = layout();
        let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
        let mut store = Store::new(WIDTH, HEIGHT, layout.clone(), 4, seed);
        let mut seen = vec![Vec::new(); WIDTH * HEIGHT];
        for (i, seen) in seen.iter_mut().enumerate() {
            for _ in 0..per_pixel {
                let s = sample(&layout, |_| rng.random());
                store.push(i % WIDTH, i / WIDTH, &s);
                seen.extend(s);
            }
        }
        (store, seen)
    }

    fn two_pass(values: &[f64]) -> (f64, f64) {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let m2: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        (mean, if values.len() < 2 { 0.0 } else { m2 / (values.len() - 1) as f64 })
    }

    #[test]
    fn one_sample_has_its_value_and_no_variance() {
        let (store, seen) = random_store(1, 1);
        let m = store.rows()[0].moments(2, 4, Part::Whole);
        assert_eq!((m.count, m.mean as f32, m.variance()), (1, seen[2][4], 0.0));
    }

    #[test]
    fn two_equal_samples_have_no_variance() {
        let layout = layout();
        let mut store = Store::new(1, 1, layout.clone(), 2, 0);
        let s = sample(&layout, |d| 0.1 + d as f32);
        store.push(0, 0, &[s.clone(), s].concat());
        assert!(store.variances(Part::Whole, 0..layout.len()).data().iter().all(|&v| v == 0.0));
    }

    #[test]
    fn ten_million_samples_agree_with_an_exact_two_pass_sum() {
        let layout = Layout::with_blocks(|_| false);
        let mut store = Store::new(1, 1, layout.clone(), 0, 0);
        let mut rng = rand_pcg::Pcg64::seed_from_u64(3);
        let mut values = Vec::with_capacity(10_000_000);
        let mut block = Vec::new();
        for _ in 0..1000 {
            block.clear();
            for _ in 0..10_000 {
                let v = 0.5 + rng.random::<f32>();
                values.push(f64::from(v));
                block.extend([0.0, 0.0, v, v, v]);
            }
            store.push(0, 0, &block);
        }
        let (mean, variance) = two_pass(&values);
        let m = store.rows()[0].moments(0, 2, Part::Whole);
        assert_eq!(m.count, 10_000_000);
        assert!((m.mean / mean - 1.0).abs() < 1e-10, "{} {mean}", m.mean);
        assert!((m.variance() / variance - 1.0).abs() < 1e-9, "{} {variance}", m.variance());
    }

    #[test]
    fn a_deviation_of_one_is_seen_beside_a_mean_of_a_million() {
        let layout = Layout::with_blocks(|_| false);
        for (mean, tolerance) in [(1e6, 0.01), (1e8, f64::INFINITY)] {
            let mut store = Store::new(1, 1, layout.clone(), 0, 0);
            let mut rng = rand_pcg::Pcg64::seed_from_u64(5);
            for _ in 0..100_000 {
                // Uniform with deviation one.
                let v = mean + (12f32.sqrt() * (rng.random::<f32>() - 0.5));
                store.push(0, 0, &[0.0, 0.0, v, v, v]);
            }
            let sigma = store.rows()[0].moments(0, 2, Part::Whole).variance().sqrt();
            assert!(sigma.is_finite() && (sigma - 1.0).abs() < tolerance, "{mean}: {sigma}");
        }
    }

    #[test]
    fn bad_samples_are_counted_and_touch_no_statistic() {
        let layout = layout();
        let good = sample(&layout, |_| 0.5);
        let mut store = Store::new(1, 1, layout.clone(), 4, 0);
        store.push(0, 0, &good);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e-3] {
            for dim in layout.colour().chain(layout.radiance()) {
                let mut s = good.clone();
                s[dim] = bad;
                store.push(0, 0, &s);
            }
        }
        assert_eq!((store.samples(), store.rejected()), (1, 24));
        assert_eq!(store.rows()[0].next_index(0), 25, "a rejected sample uses up its index");
        assert!(store.means(Part::Whole, 0..layout.len()).data().iter().all(|&v| v == 0.5));
        assert_eq!(store.rows()[0].reservoir(0), good);
    }

    #[test]
    fn negative_positions_are_no_reason_to_reject() {
        let layout = layout();
        let mut store = Store::new(1, 1, layout.clone(), 0, 0);
        store.push(
            0,
            0,
            &sample(&layout, |d| {
                if layout.colour().contains(&d) || layout.radiance().contains(&d) { 1.0 } else { -1.0 }
            }),
        );
        assert_eq!(store.rejected(), 0);
    }

    #[test]
    fn merging_with_an_empty_store_changes_nothing() {
        let (store, _) = random_store(7, 9);
        let empty = Store::new(WIDTH, HEIGHT, layout(), 4, 8);
        let mut merged = store.clone();
        merged.merge(&empty);
        let all = 0..layout().len();
        for part in [Part::Whole, Part::Half(0), Part::Half(1)] {
            assert_eq!(merged.means(part, all.clone()), store.means(part, all.clone()));
            assert_eq!(merged.variances(part, all.clone()), store.variances(part, all.clone()));
            assert_eq!(merged.counts(part), store.counts(part));
        }
    }

    #[test]
    fn reading_halves_at_once_equals_reading_them_one_by_one() {
        for per_pixel in [0, 1, 2, 7] {
            let (store, _) = random_store(11, per_pixel);
            let ([a, b], variance) = store.halves(2..5);
            assert_eq!(a, store.means(Part::Half(0), 2..5));
            assert_eq!(b, store.means(Part::Half(1), 2..5));
            let expected = store.variances(Part::Whole, 2..5);
            assert!(variance.data().iter().zip(expected.data()).all(|(v, e)| (v - e).abs() <= 1e-6 * e));
        }
    }

    #[test]
    fn the_bytes_that_are_promised_are_the_bytes_that_are_held() {
        let (width, layout) = (512, layout());
        let store = Store::new(width, 1, layout.clone(), 4, 0);
        let row = &store.rows()[0];
        let held =
            row.halves.iter().map(|h| h.count.len() * 4 + (h.mean.len() + h.m2.len()) * 8).sum::<usize>()
                + (row.drawn.len() + row.rejected.len()) * 4
                + row.keys.len() * 8
                + row.reservoir.len() * 4;
        let promised = Store::bytes_per_pixel(&layout, 4) * width;
        // Rows are padded to an odd number of cache lines.
        assert!(held >= promised && (held as f64) < 1.03 * promised as f64, "{held} {promised}");
    }

    #[test]
    fn the_reservoir_keeps_a_uniform_choice() {
        let layout = Layout::with_blocks(|_| false);
        let (pixels, n, capacity) = (4000, 40, 4);
        let mut store = Store::new(pixels, 1, layout, capacity, 9);
        let mut kept = vec![0u32; n];
        for x in 0..pixels {
            for k in 0..n {
                store.push(x, 0, &[k as f32, 0.0, 0.0, 0.0, 0.0]);
            }
            store.rows()[0].reservoir(x).chunks(5).for_each(|s| kept[s[0] as usize] += 1);
        }
        let expected = (pixels * capacity) as f64 / n as f64;
        let chi2: f64 = kept.iter().map(|&k| (f64::from(k) - expected).powi(2) / expected).sum();
        // 39 degrees of freedom: 1 in 10⁴ exceed 81.
        assert!(chi2 < 81.0, "{chi2}");
    }

    proptest! {
        #[test]
        fn any_split_of_a_stream_merges_to_the_one_stream(
            values in prop::collection::vec(0.0f32..1e3, 2..60),
            cut in 0usize..60,
        ) {
            let layout = Layout::with_blocks(|_| false);
            // Halves go by index: an even cut keeps every sample in its half.
            let cut = cut.min(values.len()) & !1;
            let store_of = |values: &[f32]| {
                let mut store = Store::new(1, 1, layout.clone(), 4, 0);
                values.iter().for_each(|&v| store.push(0, 0, &[v, v, v, v, v]));
                store
            };
            let whole = store_of(&values);
            let (a, b) = (store_of(&values[..cut]), store_of(&values[cut..]));
            for (first, second) in [(&a, &b), (&b, &a)] {
                let mut merged = first.clone();
                merged.merge(second);
                for part in [Part::Whole, Part::Half(0), Part::Half(1)] {
                    let (m, w) = (merged.rows()[0].moments(0, 2, part), whole.rows()[0].moments(0, 2, part));
                    prop_assert_eq!(m.count, w.count);
                    prop_assert!((m.mean - w.mean).abs() <= 1e-9 * w.mean.abs().max(1.0));
                    prop_assert!((m.m2 - w.m2).abs() <= 1e-9 * w.m2.abs().max(1.0));
                }
            }
        }

        #[test]
        fn moments_equal_a_two_pass_recomputation(
            values in prop::collection::vec(0.0f32..1e6, 1..200),
            batch in 1usize..50,
        ) {
            let layout = Layout::with_blocks(|_| false);
            let mut store = Store::new(1, 1, layout, 0, 0);
            let vectors: Vec<f32> = values.iter().flat_map(|&v| [v; 5]).collect();
            vectors.chunks(5 * batch).for_each(|samples| store.push(0, 0, samples));
            let (mean, variance) = two_pass(&values.iter().map(|&v| f64::from(v)).collect::<Vec<_>>());
            let m = store.rows()[0].moments(0, 3, Part::Whole);
            prop_assert!((m.mean - mean).abs() <= 1e-9 * mean.max(1.0));
            prop_assert!((m.variance() - variance).abs() <= 1e-9 * variance.max(1.0));
        }
    }
}
