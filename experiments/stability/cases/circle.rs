//! The loop: where samples go, and that neither machine nor interruption decides anything.

use std::cell::RefCell;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use prpf::adaptive::{Sampling, allocate};
use prpf::filter::Quality;
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::progressive::{Budget, Loop, Memory, Outcome, Settings, StoppedBy};
use prpf::render::Renderer;
use prpf::scene::Scene;
use prpf::stats::{Part, Store};

use super::Bound::{AtLeast, AtMost, Between, Exactly};
use super::pictures::{green, mean, noisy, render, scene};
use super::stores::not_finite;
use super::surfaces::NO_ACCIDENT;
use super::{Case, Effort, largest};

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = one_wrong_pixel();
    cases.extend(nothing_wrong());
    cases.extend(odd_budgets());
    cases.extend(same_samples(effort));
    cases.push(resumed());
    cases.push(clock_set_back());
    cases.extend(unbiased(effort.of(16, 96)));
    cases
}

pub fn settings(samples: u32, sampling: Sampling, seed: u64) -> Settings {
    Settings {
        budget: Budget { spp: Some(samples), ..Budget::default() },
        sampling,
        seed,
        ..Settings::default()
    }
}

/// A whole render.
pub fn circle(scene: &Scene, settings: &Settings) -> Outcome {
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, settings.seed);
    Loop::new(&renderer, settings, Instant::now(), &AtomicBool::new(false), None).run(&mut |_| ())
}

fn one_wrong_pixel() -> Vec<Case> {
    const SIDE: usize = 32;
    const WRONG: usize = 17 * SIDE + 5;
    let mut priority = vec![0.0; SIDE * SIDE];
    priority[WRONG] = 1e6;
    let have = vec![4; SIDE * SIDE];
    let total = 8 * (SIDE * SIDE) as u64;
    let counts = allocate(&priority, &have, SIDE, total, u32::MAX, 0).counts;
    let spent: u64 = counts.iter().map(|&n| u64::from(n)).sum();
    let others = counts.iter().enumerate().filter(|&(i, &n)| i != WRONG && n > 0).count();
    vec![
        Case::new(
            "all error in one pixel",
            "its samples over the mean",
            Between(4.0, 8.25),
            f64::from(counts[WRONG]) / 8.0,
        ),
        Case::new(
            "the same",
            "share of other pixels that get some",
            AtLeast(0.3),
            others as f64 / have.len() as f64,
        ),
        Case::new("the same", "samples not spent", Exactly(0.0), (total - spent) as f64),
    ]
}

/// A sky, the same everywhere, without noise.
fn nothing_wrong() -> Vec<Case> {
    let sky = scene(
        "Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 24 WorldBegin \
         LightSource \"infinite\" \"rgb L\" [ 0.7 0.7 0.7 ]",
    );
    let outcome = circle(&sky, &settings(50, Sampling::Adaptive, 1));
    let counts = outcome.store.counts(Part::Whole);
    let spread = counts.iter().max().zip(counts.iter().min()).map_or(f64::NAN, |(a, b)| f64::from(a - b));
    let off = largest(outcome.filtered.image.data().iter().map(|&v| f64::from((v - 0.7).abs())));
    vec![
        Case::new("no error anywhere", "most less fewest samples of a pixel", AtMost(1.0), spread),
        Case::new("the same", "error of the image", AtMost(1e-6), off),
    ]
}

fn odd_budgets() -> Vec<Case> {
    let scene = noisy();
    let short = circle(&scene, &settings(1, Sampling::Adaptive, 1));
    let pixels = short.store.pixels() as f64;
    let paper = Settings { quality: Quality::Paper, ..settings(40, Sampling::Adaptive, 1) };
    let long = circle(&scene, &paper);
    let dims = long.store.layout().len();
    let rows = long.store.rows();
    let kept = rows.iter().flat_map(|row| (0..long.store.width()).map(|x| row.reservoir(x).len() / dims));
    vec![
        Case::new(
            "a budget below one batch",
            "samples per pixel",
            Exactly(1.0),
            short.store.samples() as f64 / pixels,
        ),
        Case::new("the same", "numbers not finite", Exactly(0.0), not_finite(&short.filtered) as f64),
        Case::new(
            "a budget of 40 where 8 samples are kept",
            "samples per pixel",
            Exactly(40.0),
            long.store.samples() as f64 / pixels,
        ),
        Case::new(
            "the same",
            "samples kept of a pixel",
            Exactly(8.0),
            kept.max().map_or(f64::NAN, |n| n as f64),
        ),
        Case::new("the same", "numbers not finite", Exactly(0.0), not_finite(&long.filtered) as f64),
    ]
}

/// Pixels of rows that are not the same to the last bit.
fn differing(a: &Store, b: &Store) -> f64 {
    a.rows().iter().zip(b.rows()).filter(|(a, b)| a != b).count() as f64
}

fn changed(a: &Planes, b: &Planes) -> f64 {
    a.data().iter().zip(b.data()).filter(|(a, b)| a.to_bits() != b.to_bits()).count() as f64
}

fn same_samples(effort: Effort) -> Vec<Case> {
    let scene = noisy();
    let settings = Settings { quality: Quality::Paper, ..settings(16, Sampling::Adaptive, 3) };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads can be started").install(|| circle(&scene, &settings))
    };
    let reference = on(1);
    let threads: &[usize] = effort.of(&[2, 3, 8], &[2, 3, 4, 5, 6, 7, 8]);
    let (mut samples, mut image) = (0.0, 0.0);
    for outcome in threads.iter().map(|&threads| on(threads)) {
        samples += differing(&outcome.store, &reference.store);
        image += changed(&outcome.filtered.image, &reference.filtered.image);
    }

    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, 3);
    let batches = |sizes: &[u32]| {
        let (width, height) = renderer.resolution();
        let mut store = Store::new(width, height, renderer.layout().clone(), 4, 3);
        sizes.iter().for_each(|&size| renderer.render_batch(&vec![size; width * height], &mut store));
        store
    };
    let whole = batches(&[24]);
    let cut = [&[1; 24][..], &[7, 0, 13, 4], &[23, 1]].map(|sizes| differing(&batches(sizes), &whole));
    vec![
        Case::new(format!("1 thread and {threads:?}"), "rows of samples that differ", Exactly(0.0), samples),
        Case::new("the same", "values of the image that differ", Exactly(0.0), image),
        Case::new("other sizes of batches", "rows of samples that differ", Exactly(0.0), cut.iter().sum()),
    ]
}

/// Stopped at every step and gone on.
fn resumed() -> Case {
    let scene = noisy();
    let settings = settings(19, Sampling::Adaptive, 5);
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let never = AtomicBool::new(false);
    let circle = || Loop::new(&renderer, &settings, Instant::now(), &never, None);
    let kept = RefCell::new(Vec::new());
    let keep = |_: &Settings, memory: Memory| kept.borrow_mut().push(memory);
    let whole = circle().keeping(0.0, &keep).run(&mut |_| ());
    let kept = kept.into_inner();
    let steps = kept.len();
    let off: f64 = kept
        .into_iter()
        .map(|memory| {
            let outcome = circle().resuming(memory).run(&mut |_| ());
            differing(&outcome.store, &whole.store) + changed(&outcome.filtered.image, &whole.filtered.image)
        })
        .sum();
    Case::new(
        format!("stopped and resumed at each of {steps} steps"),
        "rows and values that differ",
        Exactly(0.0),
        off,
    )
}

/// A render whose start lies ahead, as it would if the clock were set back: it ends by time, with an image.
fn clock_set_back() -> Case {
    let scene = noisy();
    let budget = Budget { seconds: Some(0.2), ..Budget::default() };
    let settings = Settings { budget, ..settings(1, Sampling::Adaptive, 1) };
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let start = Instant::now() + Duration::from_millis(200);
    let outcome = Loop::new(&renderer, &settings, start, &AtomicBool::new(false), None).run(&mut |_| ());
    let wrong = not_finite(&outcome.filtered) + usize::from(outcome.stopped_by != StoppedBy::Time);
    Case::new(
        "a clock that is behind the start",
        "numbers not finite, other ends",
        Exactly(0.0),
        wrong as f64,
    )
}

const TILE: usize = 12;
const COLUMNS: usize = 48 / TILE;

/// Unfiltered means of tiles.
fn tiles(store: &Store) -> Vec<f64> {
    let pixels = green(store, Part::Whole);
    let tile = |tile: usize| {
        let (x0, y0) = (tile % COLUMNS * TILE, tile / COLUMNS * TILE);
        (0..TILE * TILE).map(|i| pixels[(y0 + i / TILE) * store.width() + x0 + i % TILE]).sum::<f64>()
    };
    (0..COLUMNS * COLUMNS).map(|k| tile(k) / (TILE * TILE) as f64).collect()
}

/// Largest deviation, over tiles, between the means of two sets of renders.
fn apart(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let of_tile = |renders: &[Vec<f64>], tile: usize| {
        mean(&renders.iter().map(|tiles| tiles[tile]).collect::<Vec<_>>())
    };
    largest((0..COLUMNS * COLUMNS).map(|tile| {
        let ((a, error_a), (b, error_b)) = (of_tile(a, tile), of_tile(b, tile));
        (a - b).abs() / error_a.hypot(error_b)
    }))
}

/// Samples that go where the image is wrong must not make it wrong themselves: by no more than these renders can
/// tell, about half a percent of a tile. A little they do, where bright samples are so rare that they draw further ones
/// after them: 0.7 % of room-path (docs/scenes.md), since a pixel's own variance has a part in its priority.
fn unbiased(renders: u64) -> Vec<Case> {
    let scene = noisy();
    let by = |sampling: Sampling, first: u64| -> Vec<Vec<f64>> {
        (first..first + renders)
            .map(|seed| tiles(&circle(&scene, &settings(16, sampling, seed)).store))
            .collect()
    };
    let uniform: Vec<_> = (0..renders).map(|seed| tiles(&render(&scene, 16, seed))).collect();
    let adaptive = by(Sampling::Adaptive, 1000);
    let reusing: Vec<_> =
        (2000..2000 + renders).map(|seed| tiles(&decided_by_itself(&scene, seed))).collect();
    vec![
        Case::new(
            format!("tiles of {renders} adaptive and {renders} uniform renders, unfiltered"),
            "deviations of a tile",
            AtMost(NO_ACCIDENT),
            apart(&uniform, &adaptive),
        ),
        Case::new(
            "planted: pixels that stop where their own samples agree",
            "deviations of a tile",
            AtLeast(NO_ACCIDENT),
            apart(&uniform, &reusing),
        ),
    ]
}

/// An estimator that reuses its decision: a pixel gets more samples only if its first ones vary much,
/// and these count as well. Rare light that the first samples missed is never found.
fn decided_by_itself(scene: &Scene, seed: u64) -> Store {
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
