//! Every decision as a table of situations: no thread, no clock, no renderer.

use super::*;
use crate::filter::{learned, nlm, oidn, prpf, rpf};
use crate::progressive::budget::Budget;
use crate::progressive::finalisation::CalibrationTimes;
use crate::progressive::settings::Settings;
use crate::progressive::situation::{Conditions, Measurements};
use crate::progressive::speed::Speed;

const PIXELS: u64 = 1000;

fn settings(spp: Option<u32>, seconds: Option<f64>) -> Settings {
    let budget = Budget { spp, seconds, target_error: None };
    Settings { budget, denoiser: &nlm::STANDARD, ..Settings::default() }
}

/// A render at 10 000 samples per second that has 8 samples per pixel and an interim pass behind it.
fn situation<'a>(settings: &'a Settings, measurements: &'a Measurements, mark: Mark) -> Situation<'a> {
    Situation {
        settings,
        sampling: settings.sampling,
        pixels: PIXELS,
        samples: 8 * PIXELS,
        map_end: None,
        empty_pixels: 0,
        mark,
        has_interim: true,
        error: None,
        interim_is_by_final_denoiser: false,
        has_reference: false,
        processes: 1,
        has_region: false,
        speed: Speed { samples: 1e4, seconds: 1.0 },
        measurements,
        elapsed: 1.0,
        conditions: Conditions::default(),
    }
}

/// Adds a calibration that is as expected, in seconds, after which something else has happened.
fn calibrate(measurements: &mut Measurements, seconds: f64, spent: f64) {
    let times = CalibrationTimes { filter: seconds, total: seconds, gathering: 0.0, spent };
    measurements.finalisation.add(times, seconds, f64::INFINITY);
    measurements.finalisation.age();
}

/// Measurements of a finalisation, calibrated twice, and of interim passes, in seconds.
fn measured(finalisation: f64, interim: f64) -> Measurements {
    let mut measurements =
        Measurements { interim_seconds: Some(interim), interim_total: interim, ..Measurements::default() };
    for _ in 0..2 {
        calibrate(&mut measurements, finalisation, 0.01);
    }
    measurements
}

fn interrupted() -> Conditions {
    Conditions { is_interrupted: true, ..Conditions::default() }
}

fn saving(seconds: f64) -> Conditions {
    Conditions { checkpoint_interval: Some(seconds), ..Conditions::default() }
}

#[test]
fn a_render_begins_with_a_pilot_batch() {
    let (settings, measurements) = (settings(Some(64), None), Measurements::default());
    let start =
        Situation { samples: 0, has_interim: false, ..situation(&settings, &measurements, Mark::Plan) };
    assert_eq!(next_action(&start), Action::Allocate(Plan { samples: 8 * PIXELS, is_last: false }));
    // There has to be an image, even of a render that is interrupted before its first sample.
    let begins = next_action(&Situation { conditions: interrupted(), ..start });
    assert!(matches!(begins, Action::Allocate(_)));
}

#[test]
fn a_batch_is_rendered_in_steps_to_its_end() {
    let (settings, measurements) = (settings(Some(64), None), Measurements::default());
    let render = |done, samples, longest_step| {
        let conditions = Conditions { longest_step, ..Conditions::default() };
        let mark = Mark::Render { done, samples };
        next_action(&Situation { conditions, ..situation(&settings, &measurements, mark) })
    };
    for (done, samples, longest_step, expected) in [
        // A step has 4 samples per pixel at most, and takes a second at most.
        (0.0, 8000, None, Action::Render { to: 0.5 }),
        (0.75, 8000, None, Action::Render { to: 1.0 }),
        (0.0, 100_000, None, Action::Render { to: 0.04 }),
        // A viewer wants shorter ones, but not too short ones.
        (0.0, 8000, Some(0.1), Action::Render { to: 0.125 }),
        (0.0, 8000, Some(1e-9), Action::Render { to: 1.0 / 8.0 / 32.0 }),
        (1.0, 8000, None, Action::EndBatch),
    ] {
        assert_eq!(render(done, samples, longest_step), expected, "{done} {samples} {longest_step:?}");
    }
    // The first step is an image.
    let conditions = Conditions { longest_step: Some(1e-9), ..Conditions::default() };
    let now = situation(&settings, &measurements, Mark::Render { done: 0.0, samples: 8000 });
    let first = next_action(&Situation { conditions, samples: 0, ..now });
    assert_eq!(first, Action::Render { to: 1.0 / 8.0 / 16.0 });
}

#[test]
fn an_interrupted_batch_is_finished_if_that_takes_a_second() {
    let (settings, measurements) = (settings(Some(64), None), Measurements::default());
    let at = |done, samples, taken| {
        let now = situation(&settings, &measurements, Mark::Render { done, samples });
        next_action(&Situation { conditions: interrupted(), samples: taken, ..now })
    };
    assert!(matches!(at(0.5, 10_000, 8000), Action::Render { .. }), "half a second is left");
    assert_eq!(at(0.5, 40_000, 8000), Action::Finish(StoppedBy::Interrupt), "two seconds are left");
    assert!(matches!(at(0.0, 40_000, 0), Action::Render { .. }), "there is no image yet");
    let ended = situation(&settings, &measurements, Mark::Filter);
    let ended = Situation { conditions: interrupted(), ..ended };
    assert_eq!(next_action(&ended), Action::Finish(StoppedBy::Interrupt));
}

#[test]
fn spent_budgets_end_the_render_and_name_themselves() {
    let measurements = measured(0.5, 0.01);
    let finish = |settings: &Settings, elapsed| {
        let now = situation(settings, &measurements, Mark::Filter);
        next_action(&Situation { elapsed, ..now })
    };
    assert_eq!(finish(&settings(Some(8), None), 1.0), Action::Finish(StoppedBy::Spp));
    assert_eq!(finish(&settings(None, Some(10.0)), 9.3), Action::Finish(StoppedBy::Time));
}

#[test]
fn the_final_denoisers_image_decides_whether_an_error_is_reached() {
    let measurements = Measurements::default();
    let mut settings = settings(None, None);
    settings.budget.target_error = Some(0.01);
    let next = |mark, error, interim_is_by_final_denoiser| {
        let now = situation(&settings, &measurements, mark);
        next_action(&Situation { error: Some(error), interim_is_by_final_denoiser, ..now })
    };
    assert_eq!(next(Mark::Plan, 0.009, true), Action::Finish(StoppedBy::TargetError));
    assert!(
        matches!(next(Mark::Plan, 0.009, false), Action::Allocate(_)),
        "the stand-in's image is not the last"
    );
    assert!(matches!(next(Mark::Plan, 0.011, true), Action::Allocate(_)));
    // It filters between batches once the error may be near.
    assert_eq!(next(Mark::Filter, 0.03, false), Action::Filter(&nlm::STANDARD));
    assert_eq!(next(Mark::Filter, 0.05, false), Action::Filter(&nlm::DRAFT));
}

#[test]
fn without_a_clock_every_batch_is_followed_by_an_interim_pass() {
    let measurements = Measurements::default();
    for (denoiser, expected) in [
        (&nlm::STANDARD as &'static dyn Denoiser, "nlm draft"),
        (&nlm::DRAFT, "nlm draft"),
        (&prpf::PRPF, "prpf interim"),
        (&rpf::RPF, "nlm draft"),
        (UNFILTERED, "none"),
    ] {
        // After 16 of 64 samples per pixel three batches are left; after 48 of 64, one.
        for spp in [16, 48] {
            let settings = Settings { denoiser, ..settings(Some(64), None) };
            let now = situation(&settings, &measurements, Mark::Filter);
            let action = next_action(&Situation { samples: spp * PIXELS, ..now });
            let Action::Filter(chosen) = action else { panic!("{action:?}") };
            assert_eq!(chosen.name().to_string(), expected, "{denoiser:?} {spp}");
        }
    }
}

#[test]
fn uniform_sampling_makes_images_between_batches_for_those_who_want_them() {
    let measurements = Measurements::default();
    let uniform = Settings { sampling: Sampling::Uniform, ..settings(Some(64), None) };
    let now = situation(&uniform, &measurements, Mark::Filter);
    let filters = |now: &Situation| matches!(next_action(now), Action::Filter(_));
    assert!(!filters(&now));
    assert!(filters(&Situation { has_reference: true, ..now }));
    assert!(filters(&Situation { conditions: Conditions { is_watched: true, ..now.conditions }, ..now }));
    let mut target = uniform.clone();
    target.budget.target_error = Some(1e-3);
    assert!(filters(&situation(&target, &measurements, Mark::Filter)));
}

#[test]
fn an_error_to_be_reached_is_that_of_the_methods_own_image() {
    let measurements = Measurements::default();
    for (denoiser, expected) in [
        (&nlm::STANDARD as &'static dyn Denoiser, "nlm draft"),
        (&prpf::PRPF, "prpf interim"),
        (&rpf::RPF, "rpf"),
        (UNFILTERED, "none"),
    ] {
        let mut settings = Settings { denoiser, ..settings(None, None) };
        settings.budget.target_error = Some(1e-3);
        let action = next_action(&situation(&settings, &measurements, Mark::Filter));
        let Action::Filter(chosen) = action else { panic!("{action:?}") };
        assert_eq!(chosen.name().to_string(), expected);
    }
}

#[test]
fn the_time_of_a_pass_by_the_final_denoiser_is_not_that_of_the_stand_in() {
    let mut settings = settings(None, Some(100.0));
    settings.budget.target_error = Some(0.01);
    // The stand-in's passes take 0.1 seconds, and that of the final denoiser as long as is calibrated.
    let filters = |final_seconds| {
        let measurements = measured(final_seconds, 0.1);
        let now = situation(&settings, &measurements, Mark::Filter);
        let now =
            Situation { error: Some(0.03), has_interim: true, elapsed: 50.0, samples: 8 * PIXELS, ..now };
        matches!(next_action(&now), Action::Filter(chosen) if chosen.name() == nlm::STANDARD.name())
    };
    assert!(filters(1.0));
    assert!(!filters(30.0), "it would leave too little time");
}

#[test]
fn under_a_time_budget_interim_passes_take_a_tenth_of_the_time() {
    let settings = settings(None, Some(100.0));
    let filters = |interim_total, interim, has_interim, elapsed| {
        let measurements = Measurements { interim_total, ..measured(1.0, interim) };
        let now = situation(&settings, &measurements, Mark::Filter);
        let now = Situation { elapsed, has_interim, samples: 8 * PIXELS, ..now };
        matches!(next_action(&now), Action::Filter(_))
    };
    for (interim_total, interim, has_interim, elapsed, expected, why) in [
        (0.0, 0.5, false, 1.0, true, "the first comes whatever its fraction of the time"),
        (0.5, 0.5, true, 1.0, false, "half of the time"),
        (0.5, 0.5, true, 20.0, true, "a twentieth of the time"),
        (9.5, 0.5, true, 96.0, false, "nothing is kept for the one before the last batch"),
        (0.0, 40.0, false, 1.0, true, "what a calibration says counts where it is less"),
    ] {
        assert_eq!(filters(interim_total, interim, has_interim, elapsed), expected, "{why}");
    }
}

#[test]
fn a_regions_small_batches_share_interim_passes() {
    let settings = settings(Some(64), None);
    let action = |interim_total, empty_pixels| {
        let measurements = Measurements { interim_total, ..Measurements::default() };
        let now = situation(&settings, &measurements, Mark::Filter);
        next_action(&Situation { has_region: true, elapsed: 10.0, empty_pixels, ..now })
    };
    assert!(matches!(action(0.5, 0), Action::Filter(_)));
    assert!(matches!(action(1.5, 0), Action::Allocate(_)));
    assert!(matches!(action(0.0, 1), Action::Allocate(_)), "some pixels are empty");
}

#[test]
fn the_finalisation_is_calibrated_when_every_pixel_has_a_sample() {
    let (with_clock, none) = (settings(None, Some(100.0)), Measurements::default());
    let mark = Mark::Render { done: 0.5, samples: 8000 };
    let calibrates = |now: Situation| matches!(next_action(&now), Action::Calibrate(_));
    let now = situation(&with_clock, &none, mark);
    assert!(calibrates(now));
    assert!(!calibrates(Situation { samples: 999, ..now }), "some pixels are empty");
    assert!(!calibrates(Situation { conditions: interrupted(), ..now }));
    assert!(!calibrates(situation(&settings(Some(64), None), &none, mark)), "there is no time budget");
    let rpf = Settings { denoiser: &rpf::RPF, ..with_clock.clone() };
    assert!(!calibrates(situation(&rpf, &none, mark)), "its time grows with the samples");
    let measured = measured(1.0, 0.1);
    assert!(!calibrates(Situation { elapsed: 0.1, ..situation(&with_clock, &measured, mark) }), "too soon");
    assert!(calibrates(Situation { elapsed: 50.0, ..situation(&with_clock, &measured, mark) }));
}

#[test]
fn where_memory_is_fast_less_time_is_kept_for_the_finalisation() {
    let kept = |memory_seconds: Option<f64>| {
        let measurements = Measurements { memory_seconds, ..Measurements::default() };
        situation(&settings(None, Some(100.0)), &measurements, Mark::Filter).schedule().finalisation
    };
    // Beside its own time a pass takes that of 640 bytes a pixel
    let difference = kept(Some(1.5e-9)) - kept(Some(0.5e-9));
    let expected = PIXELS as f64 * 640.0 * 1e-9 / rayon::current_num_threads() as f64;
    assert!((difference / expected - 1.0).abs() < 1e-6, "{difference} {expected}");
    assert_eq!([None, Some(9e-9)].map(kept), [kept(Some(2e-9)); 2]);
    assert_eq!(kept(Some(1e-10)), kept(Some(3e-10)), "a probe of little memory");
}

#[test]
fn a_calibration_that_shows_too_little_time_is_followed_by_one_of_a_faster_denoiser() {
    let settings = Settings { denoiser: &prpf::PRPF, ..settings(None, Some(10.0)) };
    let mark = Mark::Render { done: 0.5, samples: 8000 };
    let after = |seconds: f64, denoiser| {
        let mut measurements = Measurements::default();
        measurements.finalisation.predict_for(denoiser);
        for spent in [0.01, 0.02] {
            let times = CalibrationTimes { filter: seconds, total: seconds, gathering: 0.0, spent };
            measurements.finalisation.age();
            measurements.finalisation.add(times, seconds, f64::INFINITY);
        }
        let now = situation(&settings, &measurements, mark);
        let now = Situation { elapsed: 8.0, ..now };
        let last = now.last_pass();
        (next_action(&now), last.denoiser.name().to_string(), last.least_side)
    };
    let calibrates = |action: Action, name: &str| match action {
        Action::Calibrate(denoiser) => denoiser.name().to_string() == name,
        _ => false,
    };
    assert!(!matches!(after(1.0, &prpf::PRPF).0, Action::Calibrate(_)), "one second of two");
    assert!(calibrates(after(3.0, &prpf::PRPF).0, "prpf interim"));
    // By the same measure there is time for nlm, for squares, or for neither
    assert!(calibrates(after(2.4, &prpf::INTERIM).0, "nlm draft"));
    let (action, name, side) = after(4.5, &prpf::INTERIM);
    assert!(!matches!(action, Action::Calibrate(_)) && name == "nlm draft" && side > 1, "{name} {side}");
    let (action, name, _) = after(9.0, &prpf::INTERIM);
    assert!(!matches!(action, Action::Calibrate(_)) && name == "none", "{action:?} {name}");
}

/// Name and least side of the last pass; on one thread, so that the assumed times are the same on any machine.
fn last_pass(now: &Situation) -> (String, usize) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be had");
    let last = pool.install(|| now.last_pass());
    (last.denoiser.name().to_string(), last.least_side)
}

#[test]
fn before_any_calibration_the_assumed_time_decides_on_the_last_pass() {
    let none = Measurements::default();
    let last = |denoiser, pixels: u64, spp, elapsed| {
        let settings = Settings { denoiser, ..settings(None, Some(100.0)) };
        let now = situation(&settings, &none, Mark::Filter);
        last_pass(&Situation { pixels, samples: spp * pixels, elapsed, ..now })
    };
    // P-RPF takes 18.6 seconds, its interim preset 5.8, nlm standard 5.5, a draft 2.9, squares 3.4, 2.5, 2.3 and 2.1, the mean
    // 1.3, RPF 2640.
    for (denoiser, spp, elapsed, expected, side) in [
        (&prpf::PRPF as &'static dyn Denoiser, 8, 10.0, "prpf", 1),
        (&prpf::PRPF, 8, 80.0, "prpf", 1),
        (&prpf::PRPF, 8, 85.0, "prpf interim", 1),
        (&nlm::STANDARD, 4, 80.0, "nlm standard", 1),
        (&nlm::STANDARD, 4, 95.5, "nlm draft", 1),
        // It needs three samples per pixel
        (&nlm::STANDARD, 2, 93.0, "learned draft", 1),
        (&nlm::STANDARD, 2, 93.3, "learned draft", 2),
        (&nlm::STANDARD, 2, 96.3, "learned draft", 2),
        (&nlm::STANDARD, 2, 97.2, "learned draft", 3),
        (&nlm::STANDARD, 2, 97.6, "learned draft", 4),
        (&nlm::STANDARD, 2, 97.8, "learned draft", 6),
        // None ends in time, but this one within the tolerance
        (&nlm::STANDARD, 2, 98.0, "nlm draft", 1),
        (&nlm::STANDARD, 2, 99.0, "learned draft", 4),
        (UNFILTERED, 4, 99.5, "none", 1),
        (&rpf::RPF, 8, 10.0, "nlm draft", 1),
    ] {
        assert_eq!(
            last(denoiser, 1_000_000, spp, elapsed),
            (expected.into(), side),
            "{denoiser:?} {elapsed}"
        );
    }
    // The draft of OIDN takes 70 seconds, squares of 6×6 pixels 21
    assert_eq!(last(&oidn::DRAFT, 10_000_000, 16, 78.0), ("oidn draft".into(), 6));
    assert_eq!(last(&oidn::DRAFT, 10_000_000, 17, 78.0), ("none".into(), 1), "too many samples for squares");
    // Squares of 6×6 pixels take 21 seconds, the mean 13
    assert_eq!(last(&nlm::STANDARD, 10_000_000, 2, 99.0), ("none".into(), 1));
    // A few pixels take no time, and what takes some has to end in time.
    assert_eq!(last(&rpf::RPF, 10, 8, 1.0), ("rpf".into(), 1));
    assert_eq!(last(&nlm::STANDARD, 10, 8, 100.0), ("nlm standard".into(), 1));
}

#[test]
fn what_never_gets_enough_samples_is_filtered_by_squares() {
    let none = Measurements::default();
    // A sample takes 0.1 milliseconds, encoding 1.3, learned with it 7.6, its draft 5.5, that of nlm 2.9, squares 1.8 to 3.4.
    let check = |denoiser, samples, elapsed, expected: &str, side| {
        let settings = Settings { denoiser, ..settings(None, Some(0.1)) };
        let now = situation(&settings, &none, Mark::Render { done: 0.5, samples: PIXELS });
        let now = Situation { samples, elapsed, ..now };
        assert_eq!(last_pass(&now), (expected.into(), side), "{samples}");
    };
    // Samples after the first ones are taken to be faster by half
    check(&learned::STANDARD, 260, 0.04, "learned standard", 1);
    // With less time for the filter every pixel gets a sample
    check(&learned::STANDARD, 240, 0.04, "learned draft", 1);
    check(&learned::STANDARD, 200, 0.04, "learned draft", 2);
    check(&learned::DRAFT, 200, 0.04, "learned draft", 2);
    // nlm needs three of them
    check(&nlm::DRAFT, 2600, 0.04, "nlm draft", 1);
    check(&nlm::DRAFT, 2400, 0.04, "learned draft", 1);
    check(&nlm::DRAFT, 200, 0.04, "learned draft", 2);
    check(UNFILTERED, 200, 0.04, "none", 1);
    // A resumed render may have more than its budget
    let settings_of_one = Settings { denoiser: &learned::STANDARD, ..settings(Some(1), Some(0.1)) };
    let now = situation(&settings_of_one, &none, Mark::Filter);
    let now = Situation { samples: 1900, elapsed: 0.04, ..now };
    assert_eq!(last_pass(&now), ("learned standard".into(), 1));
    // An interruption leaves no time for more
    let settings = Settings { denoiser: &learned::STANDARD, ..settings(None, Some(0.1)) };
    let now = situation(&settings, &none, Mark::Filter);
    let now = Situation { samples: 600, elapsed: 0.04, conditions: interrupted(), ..now };
    assert_eq!(last_pass(&now), ("learned draft".into(), 2));
}

#[test]
fn a_calibration_that_takes_longer_than_expected_is_repeated_before_the_last_pass() {
    let settings = settings(None, Some(10.0));
    let mark = Mark::Render { done: 0.5, samples: 8000 };
    let mut measurements = Measurements::default();
    measurements.finalisation.predict_for(settings.denoiser);
    calibrate(&mut measurements, 1.0, 0.1);
    let next = |measurements: &Measurements| {
        let now = situation(&settings, measurements, mark);
        next_action(&Situation { samples: 8 * PIXELS, elapsed: 8.5, ..now })
    };
    assert_eq!(next(&measurements), Action::Calibrate(settings.denoiser), "the last one is due");
    let slow = CalibrationTimes { filter: 4.0, total: 4.0, gathering: 0.0, spent: 0.3 };
    measurements.finalisation.add(slow, 1.0, 0.3);
    assert_eq!(next(&measurements), Action::Calibrate(settings.denoiser), "it is doubted");
    measurements.finalisation.add(CalibrationTimes { total: 1.0, spent: 0.1, ..slow }, 1.0, -3.0);
    assert!(matches!(next(&measurements), Action::Render { .. }), "by the shorter one there is time");
}

#[test]
fn a_slower_pass_that_needs_fewer_samples_is_predicted_by_the_calibrated_one() {
    let settings = Settings { denoiser: &nlm::DRAFT, ..settings(None, Some(10.0)) };
    let mut measurements = Measurements::default();
    measurements.finalisation.predict_for(&nlm::DRAFT);
    for total in [0.5, 1.0, 1.5] {
        calibrate(&mut measurements, total, 0.01);
    }
    let now = situation(&settings, &measurements, Mark::Render { done: 0.5, samples: 8000 });
    let now = Situation { samples: 2 * PIXELS, elapsed: 5.0, ..now };
    let slow = Speed { samples: 100.0, seconds: 1.0 };
    assert_eq!(last_pass(&now), ("nlm draft".into(), 1), "three samples per pixel are taken in time");
    let now = Situation { speed: slow, ..now };
    assert_eq!(last_pass(&now), ("learned draft".into(), 1), "they are not");
    // Its time is not taken for less than that of the faster one
    let seconds = |denoiser| now.schedule_of(LastPass::over_pixels(denoiser)).finalisation;
    assert!(seconds(&learned::DRAFT) > 1.5 * seconds(&nlm::DRAFT));
    assert!(!matches!(next_action(&now), Action::Calibrate(_)), "slower ones are not calibrated");
}

#[test]
fn a_sparse_image_is_filtered_by_the_draft() {
    let (settings, none) = (settings(Some(64), None), Measurements::default());
    let now = situation(&settings, &none, Mark::Filter);
    assert_eq!(last_pass(&now), ("nlm standard".into(), 1));
    let sparse = Situation { samples: PIXELS - 1, ..now };
    assert_eq!(last_pass(&sparse), ("nlm draft".into(), 1));
    let prpf = Settings { denoiser: &prpf::PRPF, ..settings.clone() };
    let sparse = Situation { settings: &prpf, ..sparse };
    assert_eq!(last_pass(&sparse), ("prpf interim".into(), 1));
}

#[test]
fn checkpoints_are_saved_when_the_latest_is_old() {
    let none = Measurements::default();
    let saves = |settings: &Settings, measurements: &Measurements, mark, elapsed| {
        let now = situation(settings, measurements, mark);
        matches!(next_action(&Situation { elapsed, conditions: saving(40.0), ..now }), Action::Save)
    };
    let without_clock = settings(Some(64), None);
    for mark in [Mark::Render { done: 0.5, samples: 8000 }, Mark::Filter] {
        assert!(!saves(&without_clock, &none, mark, 39.0));
        assert!(saves(&without_clock, &none, mark, 41.0));
        let saved = Measurements { saved_at: 30.0, ..Measurements::default() };
        assert!(!saves(&without_clock, &saved, mark, 41.0));
        let unchanged = Measurements { is_saved: true, ..Measurements::default() };
        assert!(!saves(&without_clock, &unchanged, mark, 41.0), "nothing has changed since");
        // The end, which saves another, is near.
        let near_end = settings(None, Some(50.0));
        assert!(!saves(&near_end, &measured(0.5, 0.1), mark, 41.0));
    }
    // A pass that takes longer than a checkpoint should be old.
    let slow = Settings { denoiser: &prpf::PRPF, ..without_clock };
    let now = situation(&slow, &none, Mark::Filter);
    let now = Situation { pixels: 1_000_000_000, samples: 48_000_000_000, elapsed: 39.0, ..now };
    assert_eq!(next_action(&Situation { conditions: saving(40.0), ..now }), Action::Save);
    // Not while one is being written
    let writing = Situation { conditions: saving(f64::INFINITY), ..now };
    assert_ne!(next_action(&writing), Action::Save);
}
