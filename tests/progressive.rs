//! The whole circle on a small scene: budgets and determinism. How far adaptive sampling leaves the unfiltered mean
//! as it is, is one of the hard cases (`stability`).

mod common;
mod recorder;

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use common::SCENE;
use prpf::adaptive::{MapValues, PrioritySettings, SampleMap, Sampling};
use prpf::filter::{
    Cost, DENOISERS, Denoiser, DenoiserName, FilterResult, Reads, UNFILTERED, learned, nlm,
    prpf as pixelwise, rpf,
};
use prpf::geometry::Accel;
use prpf::progressive::{
    Action, Budget, Checkpoint, Conditions, FilterPass, Filtered, Host, Outcome, Position, RenderLoop,
    Settings, StoppedBy, run,
};
use prpf::render::Renderer;
use prpf::scene::{Scene, pbrt};
use prpf::stats::{Part, Store};
use recorder::Recorder;

const SIDE: usize = 48;

fn scene() -> Scene {
    pbrt::read_str(SCENE, Path::new(".")).expect("the test's scene is right")
}

/// Settings by which adaptive sampling is adaptive, however little is expected of it.
fn settings(spp: u32, sampling: Sampling, seed: u64) -> Settings {
    let priority = PrioritySettings { max_ratio: f32::MAX, ..PrioritySettings::default() };
    Settings {
        budget: Budget { spp: Some(spp), ..Budget::default() },
        sampling,
        priority,
        seed,
        ..Settings::default()
    }
}

fn render(settings: &Settings) -> Outcome {
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    run(RenderLoop::new(&renderer, settings, Instant::now()), &mut ())
}

#[test]
fn budgets_of_samples_are_spent_exactly() {
    for sampling in [Sampling::Uniform, Sampling::Adaptive] {
        for spp in [1, 2, 5, 8, 19] {
            let outcome = render(&settings(spp, sampling, 0));
            assert_eq!(outcome.store.samples(), u64::from(spp) * (SIDE * SIDE) as u64, "{sampling:?} {spp}");
            assert_eq!(outcome.stopped_by, StoppedBy::Spp);
            assert!(outcome.result.image.data().iter().all(|v| v.is_finite() && *v >= 0.0));
        }
    }
}

#[test]
fn images_of_the_halves_are_made_where_no_clock_and_nobody_waits() {
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, 0);
    let (spp, target, time, interrupt) =
        (StoppedBy::Spp, StoppedBy::TargetError, StoppedBy::Time, StoppedBy::Interrupt);
    for (seconds, target_error, stopped_by, of_interim, of_last) in [
        (None, None, spp, false, true),
        (None, None, interrupt, false, false),
        (None, Some(1e-3), target, true, true),
        (None, Some(1e-3), interrupt, true, false),
        (Some(9.0), None, time, false, false),
        (Some(9.0), None, spp, false, false),
        (Some(9.0), Some(1e-3), target, false, false),
    ] {
        let settings =
            Settings { budget: Budget { spp: Some(8), seconds, target_error }, ..Settings::default() };
        let mut render_loop = RenderLoop::new(&renderer, &settings, Instant::now());
        let interim = render_loop.interim_pass(settings.interim_denoiser());
        let last = render_loop.final_pass(&Conditions::default(), stopped_by);
        let found = (interim.has_half_images, last.has_half_images);
        assert_eq!(found, (of_interim, of_last), "{seconds:?} {target_error:?} {stopped_by}");
    }
}

/// A host that gives all samples of a batch to the first row.
struct FirstRow;

impl Host for FirstRow {
    fn choose_counts(&mut self, store: &Arc<Store>, planned: Vec<u32>) -> Vec<u32> {
        let sum: u32 = planned.iter().sum();
        let mut counts = vec![0; store.pixels()];
        counts[..SIDE].fill(sum / SIDE as u32);
        counts[0] += sum % SIDE as u32;
        counts
    }
}

#[test]
fn a_host_chooses_the_counts_of_every_batch() {
    let (scene, settings) = (scene(), settings(6, Sampling::Adaptive, 0));
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let outcome = run(RenderLoop::new(&renderer, &settings, Instant::now()), &mut FirstRow);
    let counts = outcome.store.counts(Part::Whole);
    assert_eq!(outcome.store.samples(), 6 * (SIDE * SIDE) as u64);
    assert!(
        counts[..SIDE].iter().all(|&n| n >= 6 * SIDE as u32 - 6) && counts[SIDE..].iter().all(|&n| n == 0)
    );
}

/// Steps that are as short as possible.
const SHORT_STEPS: Conditions = Conditions {
    is_interrupted: false,
    is_watched: false,
    longest_step: Some(1e-4),
    checkpoint_interval: None,
};

/// Performs one action in short steps; returns the last image at the end.
fn perform_next(render_loop: &mut RenderLoop) -> Option<(Filtered, StoppedBy)> {
    match render_loop.next_action(&SHORT_STEPS) {
        Action::Filter(denoiser) => {
            let filtered = render_loop.interim_pass(denoiser).run();
            render_loop.complete_interim(filtered);
        }
        Action::Finish(stopped_by) => {
            return Some((render_loop.final_pass(&SHORT_STEPS, stopped_by).run(), stopped_by));
        }
        action => render_loop.perform(action, &mut ()),
    }
    None
}

/// Returns the current checkpoint, which is within a batch.
fn checkpoint_within_batch(render_loop: &mut RenderLoop) -> Checkpoint {
    let mut recorder = Recorder::at_every_step();
    render_loop.save(&mut recorder);
    let [checkpoint] = recorder.checkpoints.try_into().expect("one checkpoint");
    assert!(matches!(checkpoint.position, Position::Render(_)));
    checkpoint
}

#[test]
fn short_steps_and_checkpoints_between_them_change_nothing() {
    let settings = settings(19, Sampling::Adaptive, 3);
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let whole = render(&settings);
    let new_loop = || RenderLoop::new(&renderer, &settings, Instant::now());
    let mut render_loop = new_loop();
    let (mut actions, mut checkpoint) = (0, None);
    let image = loop {
        if let Some((filtered, _)) = perform_next(&mut render_loop) {
            break filtered.result.image;
        }
        actions += 1;
        render_loop.change(&settings);
        render_loop.set_region(None);
        if actions == 9 {
            checkpoint = Some(checkpoint_within_batch(&mut render_loop));
        }
    };
    assert!(actions > 20, "{actions}");
    assert!(image == whole.result.image);
    // Nor does going on in another process.
    let checkpoint = checkpoint.expect("a checkpoint");
    assert!(
        run(RenderLoop::resume(&renderer, &settings, Instant::now(), checkpoint), &mut ()).result.image
            == whole.result.image
    );
}

#[test]
fn a_smaller_budget_is_spent_exactly_by_a_render_that_resumes_within_a_batch() {
    let large = settings(64, Sampling::Adaptive, 3);
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, large.seed);
    let mut render_loop = RenderLoop::new(&renderer, &large, Instant::now());
    while render_loop.store().samples() < 9 * (SIDE * SIDE) as u64 {
        assert!(perform_next(&mut render_loop).is_none());
    }
    let checkpoint = checkpoint_within_batch(&mut render_loop);
    let small = settings(10, Sampling::Adaptive, 3);
    let outcome = run(RenderLoop::resume(&renderer, &small, Instant::now(), checkpoint), &mut ());
    assert_eq!(outcome.store.samples(), 10 * (SIDE * SIDE) as u64);
}

/// Settings of a map of counts, `count` for the pixel of an index, about 20 on average.
fn settings_of_map(count: impl Fn(usize) -> usize) -> Settings {
    let counts = (0..SIDE * SIDE).map(|i| count(i) as f32).collect();
    let map = SampleMap::new(counts, MapValues::Absolute).expect("a map");
    Settings { sample_map: Some(map), ..settings(20, Sampling::Uniform, 3) }
}

#[test]
fn a_render_that_resumes_within_a_batch_ends_with_the_counts_of_the_map_that_it_is_given() {
    let counts = |i: usize| i % 40;
    let other_counts = |i: usize| 39 - i % 40;
    let (settings, other) = (settings_of_map(counts), settings_of_map(other_counts));
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let mut render_loop = RenderLoop::new(&renderer, &settings, Instant::now());
    while render_loop.store().samples() < 9 * (SIDE * SIDE) as u64 {
        assert!(perform_next(&mut render_loop).is_none());
    }
    let checkpoint = checkpoint_within_batch(&mut render_loop);
    let resume = |settings: &Settings| {
        run(RenderLoop::resume(&renderer, settings, Instant::now(), checkpoint.clone()), &mut ())
    };

    // The same map: as if the render had gone on
    let whole = render(&settings);
    let same = resume(&settings);
    assert!(same.store.next_indices().iter().enumerate().all(|(i, &n)| n as usize == counts(i)));
    assert!(same.store.rows() == whole.store.rows() && same.result.image == whole.result.image);

    // Another one, which samples that are taken may exceed
    let taken = checkpoint.store.next_indices();
    let expected: Vec<u32> = (0..).zip(&taken).map(|(i, &n)| n.max(other_counts(i) as u32)).collect();
    assert_eq!(resume(&other).store.next_indices(), expected);
}

#[test]
fn settings_that_change_plan_the_rest_of_a_batch_anew() {
    let adaptive = settings(64, Sampling::Adaptive, 3);
    let uniform = settings(16, Sampling::Uniform, 3);
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, adaptive.seed);
    let mut render_loop = RenderLoop::new(&renderer, &adaptive, Instant::now());
    while render_loop.store().samples() < 9 * (SIDE * SIDE) as u64 {
        assert!(perform_next(&mut render_loop).is_none());
    }
    render_loop.change(&uniform);
    let outcome = run(render_loop, &mut ());
    assert_eq!(outcome.store.samples(), 16 * (SIDE * SIDE) as u64);
    assert_eq!(outcome.settings, uniform);
}

#[test]
fn adaptive_batches_differ_between_pixels_and_keep_the_floor() {
    let outcome = render(&settings(16, Sampling::Adaptive, 0));
    let counts = outcome.store.counts(Part::Whole);
    assert!(counts.iter().all(|&n| n >= 4));
    assert!(counts.iter().max() > counts.iter().min());
}

#[test]
fn where_little_is_expected_of_adaptive_sampling_counts_are_equal() {
    let mut settings = settings(16, Sampling::Adaptive, 0);
    settings.priority.max_ratio = 0.0;
    let outcome = render(&settings);
    assert!(outcome.store.counts(Part::Whole).iter().all(|&n| n == 16));
}

#[test]
fn one_thread_and_two_make_the_same_image() {
    let image = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let mut settings = settings(16, Sampling::Adaptive, 3);
            settings.denoiser = &pixelwise::PRPF;
            let prpf = render(&settings).result.image;
            settings.denoiser = &nlm::STANDARD;
            (prpf, render(&settings).result.image)
        })
    };
    assert_eq!(image(1), image(2));
}

#[test]
fn a_ceiling_ends_the_render_when_every_pixel_has_reached_it() {
    let mut settings = settings(64, Sampling::Adaptive, 0);
    settings.max_spp = 12;
    let outcome = render(&settings);
    assert!(outcome.store.counts(Part::Whole).iter().all(|&n| n == 12));
}

#[test]
fn the_estimate_is_of_the_final_image() {
    for spp in [8, 32, 100] {
        let settings = Settings { denoiser: &nlm::STANDARD, ..settings(spp, Sampling::Adaptive, 0) };
        let outcome = render(&settings);
        let estimate = outcome.estimate.expect("both halves have samples");
        assert_eq!(estimate.samples, outcome.store.samples());
        assert_eq!(outcome.passes.last().unwrap().estimated_error, Some(estimate.value));
        assert!(estimate.value < 0.2 && estimate.deviation < 0.5, "{estimate:?}");
    }
}

#[test]
fn a_target_error_has_a_progress_by_the_errors_own_rate() {
    let budget = Budget { target_error: Some(2e-3), ..Budget::default() };
    let settings = Settings { budget, ..settings(1, Sampling::Uniform, 0) };
    let scene = scene();
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, 0);
    let mut render_loop = RenderLoop::new(&renderer, &settings, Instant::now());
    let mut fractions = Vec::new();
    let stopped_by = loop {
        if let Some((_, stopped_by)) = perform_next(&mut render_loop) {
            break stopped_by;
        }
        fractions.push(render_loop.progress().fraction);
    };
    assert_eq!(stopped_by, StoppedBy::TargetError);
    assert!(fractions.iter().any(|fraction| (0.05..0.95).contains(fraction)), "{fractions:?}");
    assert_eq!(fractions.last(), Some(&1.0), "{fractions:?}");
}

/// A denoiser that fails in every pass.
struct Failing;

impl Denoiser for Failing {
    fn name(&self) -> DenoiserName {
        nlm::STANDARD.name()
    }

    fn summary(&self) -> &'static str {
        "fails"
    }

    fn reads(&self) -> Reads {
        UNFILTERED.reads()
    }

    fn cost(&self) -> Cost {
        UNFILTERED.cost()
    }

    fn stand_in(&self) -> &'static dyn Denoiser {
        &Failing
    }

    fn filter(&self, store: &Store, seed: u64) -> FilterResult {
        FilterResult { failure: Some("broken".to_owned()), ..UNFILTERED.filter(store, seed) }
    }
}

#[test]
fn a_target_error_is_reached_without_filter_if_the_denoiser_fails() {
    let budget = Budget { target_error: Some(0.5), spp: Some(256), ..Budget::default() };
    let outcome = render(&Settings { budget, denoiser: &Failing, ..Settings::default() });
    assert_eq!(outcome.stopped_by, StoppedBy::TargetError);
    assert_eq!(outcome.result.failure.as_deref(), Some("broken"));
}

#[test]
fn a_time_budget_ends_in_an_image() {
    let mut settings = settings(1, Sampling::Adaptive, 0);
    settings.budget = Budget { seconds: Some(1.0), ..Budget::default() };
    let outcome = render(&settings);
    assert_eq!(outcome.stopped_by, StoppedBy::Time);
    assert!(outcome.store.samples() >= (SIDE * SIDE) as u64);
}

#[test]
fn the_forecast_counts_from_the_final_image() {
    let mut outcome = render(&settings(32, Sampling::Adaptive, 0));
    let whole = outcome.forecast().expect("estimates on the way");
    let spent = outcome.seconds.render + outcome.seconds.allocate;
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
fn where_time_is_short_the_last_pass_is_a_draft() {
    let started = Instant::now().checked_sub(Duration::from_secs(60)).expect("a clock that began earlier");
    let scene = scene();
    let accel = Accel::build(&scene);
    let render = |denoiser, seconds| {
        let budget = Budget { spp: Some(1), seconds: Some(seconds), target_error: None };
        let settings = Settings { budget, denoiser, ..Settings::default() };
        let renderer = Renderer::new(&scene, &accel, settings.seed);
        run(RenderLoop::new(&renderer, &settings, started), &mut ())
    };
    // Nothing is left of the budget but what a filter takes, so there is a sixteenth of the samples and no more.
    let draft = render(&learned::DRAFT, 61.0);
    assert!(draft.store.samples() < (SIDE * SIDE) as u64 && !draft.is_fallback());
    let (learned, nlm): (&'static dyn Denoiser, &'static dyn Denoiser) = (&learned::DRAFT, &nlm::DRAFT);
    let denoisers: [(&'static dyn Denoiser, _); 3] =
        [(&nlm::STANDARD, learned), (&pixelwise::PRPF, nlm), (&rpf::RPF, nlm)];
    for (denoiser, draft) in denoisers {
        let outcome = render(denoiser, 61.0);
        assert_eq!(outcome.result.made_by, draft.name(), "{denoiser:?}");
        assert!(outcome.is_fallback());
        let pass = FilterPass::new(Arc::new(outcome.store), draft, outcome.settings.seed);
        assert_eq!(outcome.result.image, pass.run().result.image, "{denoiser:?}");
    }
    assert!(!render(UNFILTERED, 61.0).is_fallback(), "there is nothing faster");
    assert!(!render(&nlm::STANDARD, 1e6).is_fallback());
}

#[test]
fn images_of_a_pixel_a_row_or_a_column_are_rendered() {
    for (width, height) in [(1, 1), (1, 9), (9, 1), (1, 70), (70, 1)] {
        let mut scene = scene();
        scene.film.width = width;
        scene.film.height = height;
        scene.film.pixel_bounds = [0, width, 0, height];
        let accel = Accel::build(&scene);
        for denoiser in DENOISERS {
            for (sampling, spp) in
                [Sampling::Uniform, Sampling::Adaptive].iter().flat_map(|s| [1, 2, 11].map(|n| (*s, n)))
            {
                let what = format!("{width}x{height} {denoiser:?} {sampling:?} {spp}");
                let settings = Settings { denoiser, ..settings(spp, sampling, 3) };
                let renderer = Renderer::new(&scene, &accel, settings.seed);
                let outcome = run(RenderLoop::new(&renderer, &settings, Instant::now()), &mut ());
                assert_eq!(outcome.stopped_by, StoppedBy::Spp, "{what}");
                assert_eq!(outcome.store.samples(), u64::from(spp) * (width * height) as u64, "{what}");
                let FilterResult { image, variance, error, .. } = &outcome.result;
                assert_eq!((image.width(), image.height()), (width, height), "{what}");
                for planes in [image, variance, error] {
                    assert!(planes.data().iter().all(|v| v.is_finite() && *v >= 0.0), "{what}");
                }
                let seen = outcome.store.means(Part::Whole, outcome.store.layout().radiance());
                let lit = |planes: &prpf::image::Planes| planes.data().iter().any(|&v| v > 0.0);
                assert!(!lit(&seen) || lit(image), "{what}: black");
            }
        }
    }
}
