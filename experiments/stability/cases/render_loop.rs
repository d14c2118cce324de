//! Cases on the render loop: allocation, budgets, reproducibility, interruptions, and bias.

use std::time::{Duration, Instant};

use prpf::adaptive::{Sampling, allocate};
use prpf::filter::prpf::PRPF;
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::progressive::{Budget, Checkpoint, Host, Outcome, RenderLoop, Settings, StoppedBy, run};
use prpf::render::Renderer;
use prpf::scene::Scene;
use prpf::stats::{Part, Store};

use super::case::Bound::{AtLeast, AtMost, Between, Exactly};
use super::case::{Case, largest};
use super::chi_squared::MAX_Z;
use super::effort::Effort;
use super::renders::{green, mean, noisy, render, scene};
use super::stores::not_finite;

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = error_in_one_pixel();
    cases.extend(no_error());
    cases.extend(budgets());
    cases.extend(reproducibility(effort));
    cases.push(resumed());
    cases.push(clock_set_back());
    cases.extend(unbiased(effort.select(16, 96)));
    cases
}

/// Settings of a render with a budget of samples per pixel.
pub fn settings(samples: u32, sampling: Sampling, seed: u64) -> Settings {
    Settings {
        budget: Budget { spp: Some(samples), ..Budget::default() },
        sampling,
        seed,
        ..Settings::default()
    }
}

/// Renders a scene by the loop.
pub fn run_loop(scene: &Scene, settings: &Settings) -> Outcome {
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, settings.seed);
    run(RenderLoop::new(&renderer, settings, Instant::now()), &mut ())
}

/// A priority map that is zero but for one pixel.
fn error_in_one_pixel() -> Vec<Case> {
    const SIDE: usize = 32;
    const PIXEL: usize = 17 * SIDE + 5;
    let mut priority = vec![0.0; SIDE * SIDE];
    priority[PIXEL] = 1e6;
    let counts_so_far = vec![4; SIDE * SIDE];
    let total = 8 * (SIDE * SIDE) as u64;
    let counts = allocate(&priority, &counts_so_far, SIDE, total, u32::MAX, 0);
    let spent: u64 = counts.iter().map(|&n| u64::from(n)).sum();
    let others = counts.iter().enumerate().filter(|&(i, &n)| i != PIXEL && n > 0).count();
    vec![
        Case::new(
            "all error in one pixel",
            "ratio of its samples to the mean",
            Between(4.0, 8.25),
            f64::from(counts[PIXEL]) / 8.0,
        ),
        Case::new(
            "the same",
            "fraction of the other pixels that get samples",
            AtLeast(0.3),
            others as f64 / counts_so_far.len() as f64,
        ),
        Case::new("the same", "samples not spent", Exactly(0.0), (total - spent) as f64),
    ]
}

/// A uniform sky without noise.
fn no_error() -> Vec<Case> {
    let sky = scene(
        "Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 24 WorldBegin \
         LightSource \"infinite\" \"rgb L\" [ 0.7 0.7 0.7 ]",
    );
    let outcome = run_loop(&sky, &settings(50, Sampling::Adaptive, 1));
    let counts = outcome.store.counts(Part::Whole);
    let spread = counts.iter().max().zip(counts.iter().min()).map_or(f64::NAN, |(a, b)| f64::from(a - b));
    let off = largest(outcome.result.image.data().iter().map(|&v| f64::from((v - 0.7).abs())));
    vec![
        Case::new("no error anywhere", "range of the pixels' sample counts", AtMost(1.0), spread),
        Case::new("the same", "error of the image", AtMost(1e-6), off),
    ]
}

/// A budget below one batch, and one beyond the reservoir's capacity.
fn budgets() -> Vec<Case> {
    let scene = noisy();
    let short = run_loop(&scene, &settings(1, Sampling::Adaptive, 1));
    let prpf = Settings { denoiser: &PRPF, ..settings(40, Sampling::Adaptive, 1) };
    let long = run_loop(&scene, &prpf);
    let dims = long.store.layout().len();
    let rows = long.store.rows();
    let in_reservoir =
        rows.iter().flat_map(|row| (0..long.store.width()).map(|x| row.reservoir(x).len() / dims));
    vec![
        Case::new("a budget below one batch", "samples per pixel", Exactly(1.0), short.store.spp()),
        Case::new("the same", "values not finite", Exactly(0.0), not_finite(&short.result) as f64),
        Case::new(
            "a budget of 40 with a reservoir of 8",
            "samples per pixel",
            Exactly(40.0),
            long.store.spp(),
        ),
        Case::new(
            "the same",
            "sample vectors in a reservoir",
            Exactly(8.0),
            in_reservoir.max().map_or(f64::NAN, |n| n as f64),
        ),
        Case::new("the same", "values not finite", Exactly(0.0), not_finite(&long.result) as f64),
    ]
}

/// Number of rows that differ in any bit.
fn differing(a: &Store, b: &Store) -> f64 {
    a.rows().iter().zip(b.rows()).filter(|(a, b)| a != b).count() as f64
}

/// Number of values that differ in any bit.
fn changed(a: &Planes, b: &Planes) -> f64 {
    a.data().iter().zip(b.data()).filter(|(a, b)| a.to_bits() != b.to_bits()).count() as f64
}

/// Results do not depend on the number of threads or on the sizes of batches.
fn reproducibility(effort: Effort) -> Vec<Case> {
    // Render with other numbers of threads
    let scene = noisy();
    let settings = Settings { denoiser: &PRPF, ..settings(16, Sampling::Adaptive, 3) };
    let render = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads can be started").install(|| run_loop(&scene, &settings))
    };
    let reference = render(1);
    let threads: &[usize] = effort.select(&[2, 3, 8], &[2, 3, 4, 5, 6, 7, 8]);
    let (mut samples, mut image) = (0.0, 0.0);
    for outcome in threads.iter().map(|&threads| render(threads)) {
        samples += differing(&outcome.store, &reference.store);
        image += changed(&outcome.result.image, &reference.result.image);
    }

    // Render with other batch sizes
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, 3);
    let batches = |sizes: &[u32]| {
        let (width, height) = renderer.resolution();
        let mut store = Store::new(width, height, renderer.layout().clone(), 4, 3);
        for &size in sizes {
            renderer.render_batch(&vec![size; width * height], &mut store);
        }
        store
    };
    let whole = batches(&[24]);
    let split = [&[1; 24][..], &[7, 0, 13, 4], &[23, 1]].map(|sizes| differing(&batches(sizes), &whole));
    vec![
        Case::new(format!("1 thread and {threads:?}"), "rows of samples that differ", Exactly(0.0), samples),
        Case::new("the same", "values of the image that differ", Exactly(0.0), image),
        Case::new("other batch sizes", "rows of samples that differ", Exactly(0.0), split.iter().sum()),
    ]
}

/// A host that records a checkpoint after every step.
struct Recorder(Vec<Checkpoint>);

impl Host for Recorder {
    fn checkpoint_interval(&self) -> Option<f64> {
        Some(0.0)
    }

    fn save(&mut self, _: &Settings, checkpoint: Checkpoint) {
        self.0.push(checkpoint);
    }
}

/// A render resumed from the checkpoint of each step.
fn resumed() -> Case {
    let scene = noisy();
    let settings = settings(19, Sampling::Adaptive, 5);
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let render_loop = || RenderLoop::new(&renderer, &settings, Instant::now());
    let mut recorder = Recorder(Vec::new());
    let whole = run(render_loop(), &mut recorder);
    let steps = recorder.0.len();
    let checkpoints = recorder.0.into_iter();
    let off: f64 = checkpoints
        .map(|checkpoint| {
            let outcome = run(RenderLoop::resume(&renderer, &settings, Instant::now(), checkpoint), &mut ());
            differing(&outcome.store, &whole.store) + changed(&outcome.result.image, &whole.result.image)
        })
        .sum();
    Case::new(format!("resumed at each of {steps} steps"), "rows and values that differ", Exactly(0.0), off)
}

/// A render whose start time lies in the future, as if the clock had been set back, ends by time with an image.
fn clock_set_back() -> Case {
    let scene = noisy();
    let budget = Budget { seconds: Some(0.2), ..Budget::default() };
    let settings = Settings { budget, ..settings(1, Sampling::Adaptive, 1) };
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let start = Instant::now() + Duration::from_millis(200);
    let outcome = run(RenderLoop::new(&renderer, &settings, start), &mut ());
    let wrong = not_finite(&outcome.result) + usize::from(outcome.stopped_by != StoppedBy::Time);
    Case::new(
        "a clock that is behind the start",
        "values not finite, and other ends",
        Exactly(0.0),
        wrong as f64,
    )
}

const TILE: usize = 12;
const COLUMNS: usize = 48 / TILE;

/// Unfiltered mean of each tile.
fn tiles(store: &Store) -> Vec<f64> {
    let pixels = green(store, Part::Whole);
    let tile = |tile: usize| {
        let (x0, y0) = (tile % COLUMNS * TILE, tile / COLUMNS * TILE);
        (0..TILE * TILE).map(|i| pixels[(y0 + i / TILE) * store.width() + x0 + i % TILE]).sum::<f64>()
    };
    (0..COLUMNS * COLUMNS).map(|k| tile(k) / (TILE * TILE) as f64).collect()
}

/// Largest z-score of a tile, between the means of two sets of renders.
fn largest_z(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let tile_mean = |renders: &[Vec<f64>], tile: usize| {
        mean(&renders.iter().map(|tiles| tiles[tile]).collect::<Vec<_>>())
    };
    largest((0..COLUMNS * COLUMNS).map(|tile| {
        let ((a, error_a), (b, error_b)) = (tile_mean(a, tile), tile_mean(b, tile));
        (a - b).abs() / error_a.hypot(error_b)
    }))
}

/// Adaptive sampling adds no bias that these renders can detect, about half a percent of a tile. A pixel's own
/// variance contributes to its priority, so rare bright samples cause some bias: 0.7 % on room-path (docs/scenes.md).
fn unbiased(renders: u64) -> Vec<Case> {
    let scene = noisy();
    let render_tiles = |sampling: Sampling, first: u64| -> Vec<Vec<f64>> {
        (first..first + renders)
            .map(|seed| tiles(&run_loop(&scene, &settings(16, sampling, seed)).store))
            .collect()
    };
    let uniform: Vec<_> = (0..renders).map(|seed| tiles(&render(&scene, 16, seed))).collect();
    let adaptive = render_tiles(Sampling::Adaptive, 1000);
    let planted: Vec<_> =
        (2000..2000 + renders).map(|seed| tiles(&biased_by_own_samples(&scene, seed))).collect();
    vec![
        Case::new(
            format!("tiles of {renders} adaptive and {renders} uniform renders, unfiltered"),
            "largest z-score of a tile",
            AtMost(MAX_Z),
            largest_z(&uniform, &adaptive),
        ),
        Case::new(
            "planted: pixels that stop if their own samples agree",
            "largest z-score of a tile",
            AtLeast(MAX_Z),
            largest_z(&uniform, &planted),
        ),
    ]
}

/// A biased estimator: a pixel gets more samples only if its first ones vary much, and counts both. It never finds
/// rare light that the first samples miss.
fn biased_by_own_samples(scene: &Scene, seed: u64) -> Store {
    const FIRST: u32 = 4;
    const MORE: u32 = 28;
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, seed);
    let mut store = render(scene, FIRST, seed);
    let radiance = store.layout().radiance();
    let (means, variances) =
        (store.means(Part::Whole, radiance.clone()), store.variances(Part::Whole, radiance));
    let varies = |i: usize| variances.plane(1)[i] > 0.1 * means.plane(1)[i].powi(2);
    let counts: Vec<u32> = (0..store.pixels()).map(|i| if varies(i) { MORE } else { 0 }).collect();
    renderer.render_batch(&counts, &mut store);
    store
}
