//! Random calls: null pointers, wrong sizes, hard numbers, any order. Each has to return, and to have a message if and only
//! if it fails; no failure may be an internal one.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;

/// Runs of random calls, each with objects of its own.
const RUNS: u64 = 400;
const CALLS: usize = 30;

/// A random choice.
fn one_of<T: Copy>(random: &mut Pcg64, choices: &[T]) -> T {
    choices[random.random_range(0..choices.len())]
}

/// A size that is mostly small, at times beyond every limit.
fn size(random: &mut Pcg64) -> usize {
    if random.random_bool(0.9) {
        return random.random_range(0..7);
    }
    one_of(random, &[usize::MAX, usize::MAX / 4 + 1, 1 << 32, 65_536, isize::MAX as usize])
}

/// A value that is hard for floating point, or an ordinary one.
fn value(random: &mut Pcg64) -> f32 {
    const HARD: [f32; 9] =
        [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1.0, 1e15, 1e-45, -0.0, f32::MIN_POSITIVE];
    if random.random_bool(0.1) { one_of(random, &HARD) } else { random.random() }
}

/// An array of values and the number that the call is told: mostly the right one, at times one that is too small or
/// belongs to a null pointer. What lies behind a pointer is never less than what is told.
struct Array<T> {
    values: Vec<T>,
    count: usize,
    is_null: bool,
}

impl<T> Array<T> {
    fn new(random: &mut Pcg64, right: usize, mut value: impl FnMut(&mut Pcg64) -> T) -> Self {
        let right = right.min(20_000);
        let length = if random.random_bool(0.8) { right } else { random.random_range(0..40) };
        let values: Vec<T> = (0..length).map(|_| value(random)).collect();
        let is_null = random.random_bool(0.05);
        let count = if is_null { size(random) } else { length };
        Self { values, count, is_null }
    }

    fn pointer(&self) -> *const T {
        if self.is_null { null() } else { self.values.as_ptr() }
    }

    fn pointer_mut(&mut self) -> *mut T {
        if self.is_null { null_mut() } else { self.values.as_mut_ptr() }
    }
}

/// Names of dimensions: mostly a layout, at times a part of one.
fn names(random: &mut Pcg64) -> Vec<*const c_char> {
    const BLOCKS: [&[&CStr]; 6] = [
        &[c"R", c"G", c"B"],
        &[c"albedo.r", c"albedo.g", c"albedo.b"],
        &[c"N1.x", c"N1.y", c"N1.z"],
        &[c"time"],
        &[c"hit"],
        &[c"film.x", c"film.y"],
    ];
    let mut names = Vec::new();
    for (index, block) in BLOCKS.iter().enumerate() {
        if random.random_bool(if index == 0 { 0.97 } else { 0.3 }) {
            names.extend(block.iter().map(|name| name.as_ptr()));
        }
    }
    if random.random_bool(0.05) && !names.is_empty() {
        let at = random.random_range(0..names.len());
        names[at] = one_of(random, &[null(), c"R".as_ptr(), c"\xc3".as_ptr(), c"".as_ptr()]);
    }
    names
}

/// The objects of a run, null where they could not be created, and the sizes with which calls are mostly right.
struct Objects {
    store: *mut PrpfStore,
    filter: *mut PrpfFilter,
    width: usize,
    height: usize,
    columns: usize,
}

impl Objects {
    fn new(random: &mut Pcg64) -> Self {
        let (width, height) = (size(random), size(random));
        let names = names(random);
        let reservoir = one_of(random, &[0, 0, 1, 8, usize::MAX]);
        let (mut store, mut filter) = (null_mut(), null_mut());
        let name = one_of(
            random,
            &[c"nlm", c"nlm draft", c"none", c"prpf", c"rpf", c"learned", c"oidn", c"", c"nlm paper"],
        );
        // SAFETY: pointers are valid, or null.
        let statuses = unsafe {
            if random.random_bool(0.7) {
                let status = prpf_store_create(
                    width,
                    height,
                    names.as_ptr(),
                    names.len(),
                    reservoir,
                    0,
                    &raw mut store,
                );
                [status, prpf_filter_create(name.as_ptr(), &raw mut filter)]
            } else {
                let (pixels, values) =
                    (width.min(9) * height.min(9), width.min(9) * height.min(9) * names.len());
                let counts: Vec<u32> = (0..pixels).map(|_| one_of(random, &[0, 1, 5, u32::MAX])).collect();
                let counts = if random.random_bool(0.9) { vec![3; pixels] } else { counts };
                let mut buffer = || (0..values).map(|_| value(random)).collect::<Vec<f32>>();
                let (means, variances) = (buffer(), buffer());
                let half = || PrpfHalfMoments {
                    counts: counts.as_ptr(),
                    means: means.as_ptr(),
                    variances: variances.as_ptr(),
                };
                let halves = [
                    half(),
                    PrpfHalfMoments {
                        means: if values % 5 == 4 { null() } else { means.as_ptr() },
                        ..half()
                    },
                ];
                // Buffers of sizes beyond every limit cannot be promised.
                let (width, height) = (width.min(9), height.min(9));
                let status = prpf_store_create_from_moments(
                    width,
                    height,
                    names.as_ptr(),
                    names.len(),
                    halves.as_ptr(),
                    0,
                    &raw mut store,
                );
                [status, prpf_filter_create(name.as_ptr(), &raw mut filter)]
            }
        };
        assert!(!statuses.contains(&PrpfStatus::InternalError), "{}", message());
        Self { store, filter, width, height, columns: names.len() }
    }

    /// Makes a random call.
    fn call(&self, random: &mut Pcg64) -> PrpfStatus {
        let store = if random.random_bool(0.02) { null_mut() } else { self.store };
        let filter = if random.random_bool(0.02) { null_mut() } else { self.filter };
        let (width, height) = (self.width, self.height);
        let pixels = width.saturating_mul(height);
        let (mut a, mut b, mut estimate) = (0, 0, PrpfEstimate { relmse: 0.0, low: 0.0, high: 0.0 });
        // SAFETY: pointers are null or valid, with at least as many values as told.
        unsafe {
            match random.random_range(0..10) {
                0..3 => {
                    let (samples, whole) = (size(random), random.random_bool(0.8));
                    let corner = if whole { [0, 0] } else { [size(random), size(random)] };
                    let right = pixels.saturating_mul(samples).saturating_mul(self.columns);
                    let values = Array::new(random, right, value);
                    let [x, y] = corner;
                    prpf_store_push(store, x, y, width, height, samples, values.pointer(), values.count)
                }
                3 => {
                    let pixels = Array::new(random, 10, |random| random.random_range(0..6));
                    let values = Array::new(random, 5 * self.columns, value);
                    let (count, value_count) = (pixels.count, values.count);
                    prpf_store_push_pixels(store, pixels.pointer(), count, values.pointer(), value_count)
                }
                4 => {
                    let mut counts = Array::new(random, pixels, |_| 0);
                    prpf_store_counts(store, counts.pointer_mut(), counts.count)
                }
                5 => prpf_store_samples(
                    store,
                    &raw mut a,
                    if random.random() { &raw mut b } else { null_mut() },
                ),
                6 => prpf_filter_run(filter, store),
                7 => {
                    let map = random.random_range(0..10);
                    let channels = if map < 5 { 3 } else { 1 };
                    let mut values = Array::new(random, pixels.saturating_mul(channels), |_| 0.0);
                    prpf_filter_read(filter, map, values.pointer_mut(), values.count)
                }
                8 => {
                    let mut priority = Array::new(random, pixels, |_| 0.0);
                    let place = if random.random() { &raw mut estimate } else { null_mut() };
                    prpf_filter_estimate(filter, place);
                    prpf_filter_priority(filter, store, priority.pointer_mut(), priority.count)
                }
                _ => {
                    let is_easy = random.random_bool(0.7);
                    let one = |random: &mut Pcg64| if is_easy { random.random() } else { value(random) };
                    let priority = Array::new(random, pixels, one);
                    let mut counts = Array::new(random, pixels, |_| 0);
                    let samples = one_of(random, &[0, 1, 100, 1_000_000, u64::MAX]);
                    let [min, max] = [(); 2].map(|()| one_of(random, &[0, 1, 8, 1 << 20, u32::MAX]));
                    let (pointer, count) = (counts.pointer_mut(), counts.count);
                    prpf_store_allocate(
                        store,
                        priority.pointer(),
                        priority.count,
                        samples,
                        min,
                        max,
                        pointer,
                        count,
                    )
                }
            }
        }
    }
}

#[test]
fn random_calls_return_with_a_message_if_they_fail() {
    let mut done = 0;
    for run in 0..RUNS {
        let mut random = Pcg64::seed_from_u64(run);
        let objects = Objects::new(&mut random);
        for call in 0..CALLS {
            let status = objects.call(&mut random);
            assert_ne!(status, PrpfStatus::InternalError, "run {run}, call {call}: {}", message());
            assert_eq!(status == PrpfStatus::Ok, message().is_empty(), "run {run}, call {call}");
            done += usize::from(status == PrpfStatus::Ok);
        }
        // SAFETY: they live, or are null.
        unsafe {
            prpf_filter_free(objects.filter);
            prpf_store_free(objects.store);
        }
    }
    // Calls that are all refused would test nothing behind the checks.
    assert!(done > RUNS as usize * CALLS / 10, "{done} calls succeeded");
}
