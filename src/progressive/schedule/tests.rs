use super::*;

fn schedule(budget: &Budget, pixels: u64) -> Schedule<'_> {
    Schedule {
        budget,
        pixels,
        min_spp: 4,
        max_spp: u32::MAX.into(),
        map_end: None,
        speed: Speed::default(),
        finalisation: 0.0,
        allocation: 0.0,
    }
}

fn seconds(seconds: f64) -> Budget {
    Budget { seconds: Some(seconds), ..Budget::default() }
}

fn batches(spp: u32) -> Vec<u64> {
    let budget = Budget { spp: Some(spp), ..Budget::default() };
    let mut samples = 0;
    let mut sizes = Vec::new();
    while let Ok(plan) = schedule(&budget, 100).next_batch(0.0, samples, None) {
        samples += plan.samples;
        sizes.push(plan.samples / 100);
        assert_eq!(plan.is_last, samples == u64::from(spp) * 100, "{spp}: {sizes:?}");
    }
    sizes
}

#[test]
fn batches_double_the_total_and_the_last_is_a_quarter() {
    assert_eq!(batches(1), [1]);
    assert_eq!(batches(8), [4, 4]);
    assert_eq!(batches(19), [4, 4, 6, 5]);
    assert_eq!(batches(32), [8, 8, 8, 8]);
    assert_eq!(batches(128), [8, 8, 16, 32, 32, 32]);
    assert_eq!(batches(200), [8, 8, 16, 32, 64, 22, 50]);
}

#[test]
fn batches_to_a_target_error_get_no_larger_than_it_needs() {
    let budget = Budget { target_error: Some(0.01), ..Budget::default() };
    let schedule = schedule(&budget, 100);
    let batch = |error| schedule.next_batch(0.0, 800, error).map(|plan| plan.samples);
    assert_eq!(batch(None), Ok(800));
    assert_eq!(batch(Some(0.02)), Ok(800), "1.7 times as many would do");
    // 1.2^(1/0.7) − 1 = 0.30 of 8 samples per pixel, in pairs.
    assert_eq!(batch(Some(0.012)), Ok(400));
    assert_eq!(batch(Some(0.0101)), Ok(200), "at least a quarter");
    assert!(schedule.reaches_target(Some(0.01)) && !schedule.reaches_target(Some(0.011)));
    assert!(!schedule.reaches_target(None));
}

/// Renders by a clock that only the schedule's own steps move; returns when the samples end, and the number of batches.
fn simulate(budget: f64, rate: f64, finalisation: f64) -> (f64, usize) {
    let budget = seconds(budget);
    let mut now = Schedule { finalisation, ..schedule(&budget, 1000) };
    let (mut elapsed, mut samples, mut batches) = (0.1, 0, 0);
    while let Ok(plan) = now.next_batch(elapsed, samples, None) {
        let mut done = 0.0;
        while done < 1.0 {
            let Some(fraction) = now.step(elapsed, samples, plan.samples) else { break };
            let n = (fraction.min(1.0 - done) * plan.samples as f64).ceil();
            done += fraction;
            samples += n as u64;
            elapsed += n / rate;
            now.speed.add(n as u64, n / rate);
        }
        batches += 1;
    }
    (elapsed, batches)
}

#[test]
fn time_is_spent_to_the_last_step_and_not_beyond() {
    for (budget, rate, finalisation) in
        [(3.0, 1e4, 0.5), (10.0, 1e3, 2.0), (10.0, 1e6, 0.1), (60.0, 1e5, 3.0)]
    {
        let (end, batches) = simulate(budget, rate, finalisation);
        let aim = 0.98 * budget - finalisation;
        assert!((end - aim).abs() <= 0.011, "{budget} {rate} {finalisation}: {end}");
        assert!((3..200).contains(&batches), "{batches}");
    }
}

#[test]
fn how_many_samples_there_will_be_and_whether_time_is_short_is_known_early() {
    let (budget, mut speed) = (seconds(4.0), Speed::default());
    speed.add(100_000, 0.1);
    let with = |finalisation| Schedule { speed, finalisation, ..schedule(&budget, 1_000_000) };
    assert_eq!(with(3.0).samples_at_end(0.02, 100_000).round(), 1_000_000.0, "0.9 seconds");
    assert_eq!(with(3.0).samples_at_end(3.0, 100_000), 100_000.0);
    assert!(!with(3.0).is_late(0.1) && with(3.0).is_late(1.1) && !with(1.5).is_late(1.1));
    assert!(!with(3.0).is_late(1.02) && with(3.0).is_late(1.04), "a step may take longer than predicted");
    let is_far_too_late = |finalisation, elapsed| with(finalisation).is_far_too_late(elapsed, elapsed + 0.05);
    assert!(!is_far_too_late(3.0, 1.05) && is_far_too_late(3.0, 1.15));
    assert!(with(0.14).is_late(5.0) && !is_far_too_late(0.14, 5.0), "a tenth of a second is nothing");
    assert!(is_far_too_late(0.16, 5.0));
    let no_budget = Budget::default();
    let without = schedule(&no_budget, 1_000_000);
    assert!(!without.is_late(9.0) && !without.is_far_too_late(9.0, 9.0));
}

#[test]
fn a_budget_that_is_spent_before_the_first_sample_still_gets_a_sixteenth_of_them() {
    let budget = seconds(0.1);
    let mut now = schedule(&budget, 1600);
    let plan = now.next_batch(5.0, 0, None).unwrap();
    assert_eq!(plan.samples, 1600);
    assert_eq!(now.step(5.0, 0, plan.samples), Some(1.0 / 16.0));
    now.speed.add(100, 0.1);
    assert_eq!(now.step(5.1, 100, plan.samples), None);
    assert_eq!(now.next_batch(5.1, 100, None), Err(StoppedBy::Time));
}
