//! The whole circle on a small scene: budgets, determinism, and that adaptive sampling does not
//! bias the unfiltered mean.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use prpf::adaptive::{PrioritySettings, Sampling};
use prpf::filter::Quality;
use prpf::geometry::Accel;
use prpf::progressive::{Budget, Denoiser, Loop, Outcome, Settings, StoppedBy};
use prpf::render::Renderer;
use prpf::scene::{Scene, pbrt};
use prpf::stats::Part;
use statrs::distribution::{ContinuousCDF, Normal};

const SIDE: usize = 48;

/// A box with a lens, a lamp that is seen, and a glossy and a rough ball: noise of several kinds.
const SCENE: &str = r#"
LookAt 0 1 -3.4  0 0.9 0  0 1 0
Camera "perspective" "float fov" 45 "float lensradius" 0.05 "float focaldistance" 3.2
Sampler "zsobol" "integer pixelsamples" 16
Integrator "path" "integer maxdepth" 4
Film "rgb" "integer xresolution" 48 "integer yresolution" 48
WorldBegin
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 8 7 6 ]
  Translate 0 1.9 0
  Rotate 90 1 0 0
  Shape "disk" "float radius" 0.4
AttributeEnd
Material "diffuse" "rgb reflectance" [ 0.7 0.6 0.5 ]
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -2 0 -4  2 0 -4  2 0 2  -2 0 2 ]
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point3 P" [ -2 0 2  2 0 2  2 3 2  -2 3 2 ]
Material "conductor" "float roughness" 0.1
AttributeBegin Translate -0.5 0.5 0 Shape "sphere" "float radius" 0.5 AttributeEnd
Material "diffuse" "rgb reflectance" [ 0.2 0.3 0.8 ]
AttributeBegin Translate 0.6 0.4 -0.6 Shape "sphere" "float radius" 0.4 AttributeEnd
"#;

fn scene() -> Scene {
    pbrt::read_str(SCENE, Path::new(".")).expect("the test's scene is right")
}

fn settings(spp: u32, sampling: Sampling, seed: u64) -> Settings {
    Settings {
        budget: Budget { spp: Some(spp), ..Budget::default() },
        sampling,
        denoiser: Denoiser::Prpf,
        quality: Quality::Standard,
        seed,
        min_spp: 4,
        max_spp: 1 << 20,
        priority: PrioritySettings::default(),
        reservoir: 0,
    }
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

/// Tiles of unfiltered means over independent renders: adaptive sampling with its loop's decisions
/// against uniform sampling.
#[test]
fn adaptive_sampling_does_not_bias_the_unfiltered_mean() {
    const TILE: usize = 12;
    const RENDERS: u64 = 24;
    const COLUMNS: usize = SIDE / TILE;
    let tiles = |sampling: Sampling, seeds: std::ops::Range<u64>| -> Vec<Vec<f64>> {
        let mut values = vec![Vec::new(); COLUMNS * COLUMNS];
        for seed in seeds {
            let outcome = run(&settings(16, sampling, seed));
            let mean = outcome.store.means(Part::Whole, outcome.store.layout().radiance());
            for (tile, values) in values.iter_mut().enumerate() {
                let (x0, y0) = (tile % COLUMNS * TILE, tile / COLUMNS * TILE);
                let pixels = (0..TILE * TILE).map(|i| f64::from(mean.at(1, x0 + i % TILE, y0 + i / TILE)));
                values.push(pixels.sum::<f64>() / (TILE * TILE) as f64);
            }
        }
        values
    };
    let moments = |values: &[f64]| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
    };
    let uniform = tiles(Sampling::Uniform, 0..RENDERS);
    let adaptive = tiles(Sampling::Adaptive, 1000..1000 + RENDERS);
    // Significance 1 % over all tiles (Bonferroni), two-sided.
    let limit = Normal::standard().inverse_cdf(1.0 - 0.005 / (COLUMNS * COLUMNS) as f64);
    for (tile, (u, a)) in uniform.iter().zip(&adaptive).enumerate() {
        let ((u, var_u), (a, var_a)) = (moments(u), moments(a));
        let z = (a - u) / (var_u + var_a).sqrt();
        // Few renders make the deviations themselves uncertain: a t-distribution with some 40 degrees
        // of freedom has tails about a fifth longer here.
        assert!(z.abs() < 1.2 * limit, "tile {tile}: z = {z}, {a} against {u}");
    }
}
