//! The whole circle on a small scene: budgets and determinism. That adaptive sampling does not bias the
//! unfiltered mean is one of the hard cases (`stability`).

mod common;

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use common::SCENE;
use prpf::adaptive::Sampling;
use prpf::filter::Quality;
use prpf::geometry::Accel;
use prpf::progressive::{Budget, Denoiser, Loop, Outcome, Settings, StoppedBy};
use prpf::render::Renderer;
use prpf::scene::{Scene, pbrt};
use prpf::stats::Part;

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
    // The budget was spent before the start, so there is a sixteenth of the samples and no more.
    let draft = of(Denoiser::Prpf, Quality::Draft, 1.0);
    assert!(draft.store.samples() < (SIDE * SIDE) as u64 && !draft.hurried);
    for (denoiser, quality) in [
        (Denoiser::Prpf, Quality::Standard),
        (Denoiser::Prpf, Quality::Paper),
        (Denoiser::Rpf, Quality::Paper),
    ] {
        let hurried = of(denoiser, quality, 1.0);
        assert!(hurried.hurried, "{denoiser:?} {quality:?}");
        assert_eq!(hurried.filtered.image, draft.filtered.image);
    }
    assert!(!of(Denoiser::None, Quality::Standard, 1.0).hurried, "there is no filter to save time by");
    assert!(!of(Denoiser::Prpf, Quality::Standard, 1e6).hurried);
}
