//! Filter passes and what comes last, on loops that began some time ago.

use std::path::Path;

use super::cost::Cost;
use super::*;
use crate::adaptive::Sampling;
use crate::filter::Quality;
use crate::geometry::Accel;
use crate::scene::pbrt::read_str;
use crate::stats::Block;

const SCENE: &str = r#"Film "rgb" "integer xresolution" [ 32 ] "integer yresolution" [ 32 ]
    WorldBegin LightSource "infinite" Translate 0 0 4 Shape "sphere""#;
const SLOW: Duration = Duration::from_secs(1);

/// Finds maps, but slowly.
struct SlowMaps;

impl Observer for SlowMaps {
    fn stepped(&mut self, _: Progress, _: &Arc<Store>) -> Flow {
        Flow::GoOn
    }

    fn run_filter(&mut self, job: FilterJob) -> Option<Shown> {
        let shown = job.run();
        let maps_seconds = shown.maps_seconds.map(|seconds| {
            std::thread::sleep(SLOW);
            seconds + SLOW.as_secs_f64()
        });
        Some(Shown { maps_seconds, ..shown })
    }
}

fn with_loop(seconds: f64, started: Instant, test: impl FnOnce(&mut Loop)) {
    with_loop_of(32, seconds, started, test);
}

/// Calls a test with a loop of so many seconds that has two samples in each of `side`² pixels.
fn with_loop_of(side: usize, seconds: f64, started: Instant, test: impl FnOnce(&mut Loop)) {
    let scene = SCENE.replace("[ 32 ]", &format!("[ {side} ]"));
    let scene = read_str(&scene, Path::new("")).expect("the test's scene is right");
    let accel = Accel::build(&scene);
    let settings =
        Settings { budget: Budget { seconds: Some(seconds), ..Budget::default() }, ..Settings::default() };
    let renderer = Renderer::new(&scene, &accel, 0);
    let interrupt = AtomicBool::new(false);
    let mut circle = Loop::new(&renderer, &settings, started, &interrupt, None);
    let counts = vec![2; circle.store.pixels()];
    renderer.render_batch(&counts, Arc::make_mut(&mut circle.store));
    test(&mut circle);
}

#[test]
fn what_reruns_find_for_the_next_batch_is_no_part_of_the_last_pass() {
    with_loop(1e3, Instant::now(), |circle| {
        circle.rehearse();
        let before = circle.rehearsal.filter_seconds;
        assert!(circle.rerun(Quality::Standard, &mut SlowMaps));
        assert_ne!(circle.rehearsal.filter_seconds, before, "a whole pass tells more");
        assert!(circle.rehearsal.filter_seconds < SLOW.as_secs_f64());
        assert!(circle.schedule.closing() < SLOW.as_secs_f64());
        assert!(circle.reruns > SLOW.as_secs_f64());
    });
}

#[test]
fn what_other_settings_took_says_nothing() {
    with_loop(1e3, Instant::now(), |circle| {
        circle.rehearse();
        let uniform = Settings { sampling: Sampling::Uniform, ..circle.settings.clone() };
        let adaptive = circle.settings.clone();
        circle.change(&uniform);
        assert!(circle.rerun(Quality::Draft, &mut SlowMaps));
        assert_eq!(circle.maps_seconds, None, "no maps were made");
        assert!(circle.interim_seconds.is_some());
        circle.change(&adaptive);
        assert_eq!(circle.interim_seconds, None);
    });
}

/// As a state that another process left, where the clock has run on.
#[test]
fn a_last_pass_for_which_there_is_no_time_is_predicted_as_a_draft() {
    let pixels = 32 * 32;
    let [standard, draft] = [Quality::Standard, Quality::Draft]
        .map(|quality| Cost::of((Denoiser::Prpf, quality)).seconds(pixels, false));
    let started = Instant::now().checked_sub(Duration::from_secs(60)).expect("a clock that began earlier");
    with_loop(60.0, started, |circle| {
        assert_eq!(circle.schedule.closing(), standard);
        circle.choose_unrehearsed();
        assert_eq!(circle.hurried, Some(Hurried::Draft));
        assert_eq!(circle.schedule.closing(), draft);
        // More time, as a person may give.
        let budget = Budget { seconds: Some(1e4), ..Budget::default() };
        circle.change(&Settings { budget, ..circle.settings.clone() });
        circle.choose_unrehearsed();
        assert_eq!(circle.hurried, None);
        assert_eq!(circle.schedule.closing(), standard);
    });
}

/// On one thread, so that it takes as long on any machine.
#[test]
fn an_image_for_whose_draft_there_is_no_time_stays_unfiltered() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be had");
    let began = Duration::from_secs(20);
    // A draft takes 0.37 of them.
    for (seconds, expected) in [(20.1, Hurried::Unfiltered), (21.2, Hurried::Draft)] {
        pool.install(|| {
            with_loop_of(320, seconds, Instant::now(), |circle| {
                circle.start = Instant::now().checked_sub(began).expect("a clock that began earlier");
                circle.choose_unrehearsed();
                assert_eq!(circle.hurried, Some(expected), "{seconds}");
                let outcome = circle.end(StoppedBy::Time, &mut |_: Progress| ());
                let Ended::Finished(filtered, _) = outcome else { panic!() };
                let mean = crate::filter::unfiltered(&circle.store).image;
                assert_eq!(filtered.image == mean, expected == Hurried::Unfiltered);
            });
        });
    }
}

/// As where a lamp is seen that is too bright for the statistics.
#[test]
fn pixels_that_reject_all_their_samples_do_not_make_the_others_uniform() {
    with_loop(1e3, Instant::now(), |circle| {
        let layout = circle.store.layout().clone();
        let (width, height) = (circle.store.width(), circle.store.height());
        let mut store = Store::new(width, height, layout.clone(), 0, 0);
        for i in 0..8 * width * height {
            let pixel = i / 8;
            let mut sample = vec![0.0; layout.len()];
            // Noise in the left half, a pixel without a number in the right.
            let noise =
                if pixel % width < width / 2 { (i.wrapping_mul(2_654_435_761) >> 9 & 7) as f32 } else { 2.0 };
            layout.write(&mut sample, Block::Colour, &[if pixel == width - 1 { f32::NAN } else { noise }; 3]);
            layout.write(&mut sample, Block::Radiance, &[noise; 3]);
            store.push(pixel % width, pixel / width, &sample);
        }
        assert_eq!(store.rejected(), 8);
        circle.store = Arc::new(store);
        assert!(circle.rerun(Quality::Draft, &mut |_: Progress| ()));
        let batch = circle.allocate(Plan { samples: 8 * (width * height) as u64, last: false });
        let of_half = |first: usize| -> u32 {
            let rows = batch.allocation.counts.chunks(width);
            rows.map(|row| row[first..][..width / 2].iter().sum::<u32>()).sum()
        };
        let [left, right] = [0, width / 2].map(of_half);
        assert!(left > 2 * right, "{left} {right}");
    });
}

#[test]
fn every_batch_probes_other_pixels() {
    with_loop(1e3, Instant::now(), |circle| {
        let counts = vec![8; circle.store.pixels()];
        circle.renderer.render_batch(&counts, Arc::make_mut(&mut circle.store));
        assert!(circle.rerun(Quality::Draft, &mut |_: Progress| ()));
        let probes = |circle: &mut Loop| {
            let samples = 10 * circle.store.pixels() as u64;
            circle.allocate(Plan { samples, last: false }).allocation.probes
        };
        let first = probes(circle);
        assert!(first.contains(&true) && first.contains(&false));
        assert_eq!(probes(circle), first, "the same of the same state");
        circle.renderer.render_batch(&counts, Arc::make_mut(&mut circle.store));
        assert_ne!(probes(circle), first);
    });
}

#[test]
fn what_rpf_takes_grows_with_the_samples_until_there_is_no_time_for_it() {
    with_loop(10.0, Instant::now(), |circle| {
        circle.settings.denoiser = Denoiser::Rpf;
        circle.choose_unrehearsed();
        let few = circle.schedule.closing();
        assert_eq!(circle.hurried, None);
        let sample = vec![0.0; circle.store.layout().len()];
        let store = Arc::make_mut(&mut circle.store);
        let (width, height) = (store.width(), store.height());
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            store.push(x, y, &sample.repeat(2));
        }
        circle.choose_unrehearsed();
        assert!((circle.schedule.closing() / few - 2.0).abs() < 1e-6);
        circle.start =
            Instant::now().checked_sub(Duration::from_secs(10)).expect("a clock that began earlier");
        circle.choose_unrehearsed();
        assert_eq!(circle.hurried, Some(Hurried::Draft));
    });
}
