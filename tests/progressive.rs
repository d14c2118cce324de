//! The whole circle on a small scene: budgets and determinism. How far adaptive sampling leaves the unfiltered mean
//! as it is, is one of the hard cases (`stability`).

mod common;

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use common::SCENE;
use prpf::adaptive::Sampling;
use prpf::filter::{Filtered, Quality};
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::progressive::{
    Budget, Denoiser, Ended, Flow, Hurried, Loop, Memory, Observer, Outcome, Progress, Settings, StoppedBy,
};
use prpf::render::Renderer;
use prpf::scene::{Scene, pbrt};
use prpf::stats::{Part, Store};

const SIDE: usize = 48;

fn scene() -> Scene {
    pbrt::read_str(SCENE, Path::new(".")).expect("the test's scene is right")
}

fn settings(spp: u32, sampling: Sampling, seed: u64) -> Settings {
    Settings { budget: Budget { spp: Some(spp), ..Budget::default() }, sampling, seed, ..Settings::default() }
}

fn run(settings: &Settings) -> Outcome {
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    Loop::new(&renderer, settings, Instant::now(), &AtomicBool::new(false), None).run(&mut |_| ())
}

#[test]
fn budgets_of_samples_are_spent_exactly() {
    for sampling in [Sampling::Uniform, Sampling::Adaptive] {
        for spp in [1, 2, 5, 8, 19] {
            let outcome = run(&settings(spp, sampling, 0));
            assert_eq!(outcome.store.samples(), u64::from(spp) * (SIDE * SIDE) as u64, "{sampling:?} {spp}");
            assert_eq!(outcome.stopped_by, StoppedBy::Spp);
            assert!(outcome.filtered.image.data().iter().all(|v| v.is_finite() && *v >= 0.0));
        }
    }
}

/// Leaves after every step, so that the caller may look or save.
struct Restless;

impl Observer for Restless {
    fn stepped(&mut self, _: Progress, _: &Arc<Store>) -> Flow {
        Flow::Leave
    }

    fn step_seconds(&self) -> Option<f64> {
        Some(1e-4)
    }
}

#[test]
fn leaving_a_batch_and_going_on_changes_nothing() {
    let settings = settings(19, Sampling::Adaptive, 3);
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let never = AtomicBool::new(false);
    let whole = run(&settings);
    let kept = RefCell::new(Vec::new());
    let keep = |_: &Settings, memory: Memory| kept.borrow_mut().push(memory);
    let circle = || Loop::new(&renderer, &settings, Instant::now(), &never, None);
    let mut restless = circle().keeping(1e9, &keep);
    let mut left = 0;
    let image = loop {
        match restless.advance(&mut Restless) {
            Ended::Finished(filtered, _) => break filtered.image,
            Ended::Left => left += 1,
        }
        restless.change(&settings);
        restless.favour(None);
        if left == 9 {
            restless.keep_now();
        }
    };
    assert!(left > 20, "{left}");
    assert!(image == whole.filtered.image);
    // Nor does going on in another process from where it was left.
    let memory = kept.into_inner().swap_remove(0);
    assert!(memory.under_way.is_some());
    assert!(circle().resuming(memory).run(&mut |_| ()).filtered.image == whole.filtered.image);
}

#[test]
fn a_smaller_budget_is_spent_exactly_by_who_goes_on_within_a_batch() {
    let large = settings(64, Sampling::Adaptive, 3);
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, large.seed);
    let never = AtomicBool::new(false);
    let kept = RefCell::new(Vec::new());
    let keep = |_: &Settings, memory: Memory| kept.borrow_mut().push(memory);
    let mut circle = Loop::new(&renderer, &large, Instant::now(), &never, None).keeping(1e9, &keep);
    while circle.store().samples() < 9 * (SIDE * SIDE) as u64 {
        assert!(matches!(circle.advance(&mut Restless), Ended::Left));
    }
    circle.keep_now();
    let memory = kept.take().swap_remove(0);
    assert!(memory.under_way.is_some());
    let small = settings(10, Sampling::Adaptive, 3);
    let outcome =
        Loop::new(&renderer, &small, Instant::now(), &never, None).resuming(memory).run(&mut |_| ());
    assert_eq!(outcome.store.samples(), 10 * (SIDE * SIDE) as u64);
}

#[test]
fn settings_that_change_plan_the_rest_of_a_batch_anew() {
    let adaptive = settings(64, Sampling::Adaptive, 3);
    let uniform = settings(16, Sampling::Uniform, 3);
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, adaptive.seed);
    let never = AtomicBool::new(false);
    let mut circle = Loop::new(&renderer, &adaptive, Instant::now(), &never, None);
    while circle.store().samples() < 9 * (SIDE * SIDE) as u64 {
        assert!(matches!(circle.advance(&mut Restless), Ended::Left));
    }
    circle.change(&uniform);
    let Ended::Finished(filtered, stopped_by) = circle.advance(&mut |_| ()) else { panic!("nobody leaves") };
    let outcome = circle.into_outcome(*filtered, stopped_by);
    assert_eq!(outcome.store.samples(), 16 * (SIDE * SIDE) as u64);
    assert_eq!(outcome.settings, uniform);
}

#[test]
fn adaptive_batches_differ_between_pixels_and_keep_the_floor() {
    let outcome = run(&settings(16, Sampling::Adaptive, 0));
    let counts = outcome.store.counts(Part::Whole);
    assert!(counts.iter().all(|&n| n >= 4));
    assert!(counts.iter().max() > counts.iter().min());
}

#[test]
fn one_thread_and_two_make_the_same_image() {
    let image = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let mut settings = settings(16, Sampling::Adaptive, 3);
            settings.quality = Quality::Paper;
            let paper = run(&settings).filtered.image;
            settings.quality = Quality::Standard;
            (paper, run(&settings).filtered.image)
        })
    };
    assert_eq!(image(1), image(2));
}

#[test]
fn a_ceiling_ends_the_render_when_every_pixel_has_reached_it() {
    let mut settings = settings(64, Sampling::Adaptive, 0);
    settings.max_spp = 12;
    let outcome = run(&settings);
    assert!(outcome.store.counts(Part::Whole).iter().all(|&n| n == 12));
}

#[test]
fn the_last_estimate_is_of_an_image_with_three_quarters_of_the_samples() {
    // With fewer samples the last part may be too noisy here to replace the older estimate.
    for spp in [32, 100] {
        let outcome = run(&settings(spp, Sampling::Adaptive, 0));
        let estimate = outcome.estimate.expect("batches after the first");
        let share = estimate.samples as f64 / outcome.store.samples() as f64;
        assert!((0.7..0.8).contains(&share), "{spp}: {share}");
        assert!(estimate.image < 0.2 && estimate.standard_error < 0.1, "{estimate:?}");
    }
}

#[test]
fn a_time_budget_ends_in_an_image() {
    let mut settings = settings(1, Sampling::Adaptive, 0);
    settings.budget = Budget { seconds: Some(1.0), ..Budget::default() };
    let outcome = run(&settings);
    assert_eq!(outcome.stopped_by, StoppedBy::Time);
    assert!(outcome.store.samples() >= (SIDE * SIDE) as u64);
}

#[test]
fn the_forecast_counts_from_the_final_image() {
    let mut outcome = run(&settings(32, Sampling::Adaptive, 0));
    let whole = outcome.forecast().expect("estimates on the way");
    let spent = outcome.seconds.render + outcome.seconds.filter + outcome.seconds.allocate;
    let expected = spent * (2f64.powf(1.0 / whole.power) - 1.0);
    assert!((whole.halving_seconds / expected - 1.0).abs() < 1e-9, "{whole:?} {expected}");
    // Had another run made half of the samples, this one would have taken as long for half as many.
    outcome.own_samples /= 2;
    let half = outcome.forecast().expect("the same estimates");
    assert!((half.halving_seconds / whole.halving_seconds - 2.0).abs() < 1e-9);
    assert_eq!(half.power, whole.power);
    outcome.own_samples = 0;
    assert!(outcome.forecast().is_none(), "nothing says how long a sample takes");
}

#[test]
fn where_the_time_does_not_suffice_the_last_pass_is_a_draft() {
    let started = Instant::now().checked_sub(Duration::from_secs(60)).expect("a clock that began earlier");
    let scene = scene();
    let accel = Accel::build(&scene);
    let of = |denoiser, quality, seconds| {
        let budget = Budget { spp: Some(1), seconds: Some(seconds), target_error: None };
        let settings = Settings { budget, denoiser, quality, ..Settings::default() };
        let renderer = Renderer::new(&scene, &accel, settings.seed);
        Loop::new(&renderer, &settings, started, &AtomicBool::new(false), None).run(&mut |_| ())
    };
    // Nothing is left of the budget but what a filter takes, so there is a sixteenth of the samples and no more.
    let draft = of(Denoiser::Prpf, Quality::Draft, 61.0);
    assert!(draft.store.samples() < (SIDE * SIDE) as u64 && draft.hurried.is_none());
    for (denoiser, quality) in [
        (Denoiser::Prpf, Quality::Standard),
        (Denoiser::Prpf, Quality::Paper),
        (Denoiser::Rpf, Quality::Paper),
    ] {
        let hurried = of(denoiser, quality, 61.0);
        assert_eq!(hurried.hurried, Some(Hurried::Draft), "{denoiser:?} {quality:?}");
        assert_eq!(hurried.filtered.image, draft.filtered.image);
    }
    let unfiltered = of(Denoiser::None, Quality::Standard, 61.0);
    assert!(unfiltered.hurried.is_none(), "there is no filter to save time by");
    assert!(of(Denoiser::Prpf, Quality::Standard, 1e6).hurried.is_none());
}

#[test]
fn images_of_a_pixel_a_row_or_a_column_are_rendered() {
    for (width, height) in [(1, 1), (1, 9), (9, 1), (1, 70), (70, 1)] {
        let mut scene = scene();
        scene.film.width = width;
        scene.film.height = height;
        scene.film.pixel_bounds = [0, width, 0, height];
        let accel = Accel::build(&scene);
        for (denoiser, quality) in [
            (Denoiser::None, Quality::Standard),
            (Denoiser::Prpf, Quality::Draft),
            (Denoiser::Prpf, Quality::Standard),
            (Denoiser::Prpf, Quality::Paper),
            (Denoiser::Rpf, Quality::Paper),
        ] {
            for (sampling, spp) in
                [Sampling::Uniform, Sampling::Adaptive].iter().flat_map(|s| [1, 2, 11].map(|n| (*s, n)))
            {
                let what = format!("{width}x{height} {denoiser:?} {quality:?} {sampling:?} {spp}");
                let settings = Settings { denoiser, quality, ..settings(spp, sampling, 3) };
                let renderer = Renderer::new(&scene, &accel, settings.seed);
                let never = AtomicBool::new(false);
                let outcome = Loop::new(&renderer, &settings, Instant::now(), &never, None).run(&mut |_| ());
                assert_eq!(outcome.stopped_by, StoppedBy::Spp, "{what}");
                assert_eq!(outcome.store.samples(), u64::from(spp) * (width * height) as u64, "{what}");
                let Filtered { image, variance, error, .. } = &outcome.filtered;
                assert_eq!((image.width(), image.height()), (width, height), "{what}");
                for planes in [image, variance, error] {
                    assert!(planes.data().iter().all(|v| v.is_finite() && *v >= 0.0), "{what}");
                }
                let seen = outcome.store.means(Part::Whole, outcome.store.layout().radiance());
                let lit = |planes: &Planes| planes.data().iter().any(|&v| v > 0.0);
                assert!(!lit(&seen) || lit(image), "{what}: black");
            }
        }
    }
}
