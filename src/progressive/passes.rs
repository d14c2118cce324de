//! The filter passes of the loop: when one is due and with what effort, and how long the last will take.

use std::time::Instant;

use super::cost::{Cost, Pass};
use super::rehearsal::make_ready;
use super::{Batch, Denoiser, FilterJob, Hurried, Loop, Observer, Rerun, Settings, Shown, observer};
use crate::filter::{Filtered, Quality};
use crate::image::Planes;
use crate::image::metrics::Pair;
use crate::stats::{Part, Store};

/// Share of the time that reruns of the filter may take under a budget of time.
const RERUN_SHARE: f64 = 0.1;
/// The one before the last batch may take this share by itself, however short the budget: without it
/// nothing is known of the error of an image like the last one.
const LAST_RERUN_SHARE: f64 = 0.08;
/// A rerun must be followed by at least this many times its time for the samples that it directs.
const LEAST_USE_OF_RERUN: f64 = 3.0;

impl Loop<'_> {
    /// The last filter pass.
    fn last_filter(&self) -> Pass {
        let Settings { denoiser, quality, .. } = self.settings;
        self.hurried.map_or_else(|| observer::fitting(&self.store, denoiser, quality), pass_in_a_hurry)
    }

    /// The time does not suffice for the last pass: it will be this one, if that is quicker. Whether it is.
    pub(super) fn hurry(&mut self, to: Hurried) -> bool {
        let asked = match (self.settings.denoiser, self.settings.quality) {
            (Denoiser::None, _) => Some(Hurried::Unfiltered),
            (Denoiser::Prpf, Quality::Draft) => Some(Hurried::Draft),
            _ => None,
        };
        let changes = asked.max(self.hurried) < Some(to);
        if changes {
            self.hurried = Some(to);
        }
        changes
    }

    /// Predicts what comes after the last batch without a rehearsal. By then every pixel should have a sample.
    pub(super) fn expect_unrehearsed(&mut self) {
        let Settings { denoiser, quality, .. } = self.settings;
        let pass = self.hurried.map_or((denoiser, quality), pass_in_a_hurry);
        self.schedule.expects(Cost::of(pass).seconds(self.store.pixels(), self.keep.is_some()));
    }

    /// The filter between batches.
    pub(super) fn interim_denoiser(&self) -> Denoiser {
        match self.settings.denoiser {
            Denoiser::Rpf if self.settings.budget.target_error.is_none() => Denoiser::Prpf,
            denoiser => denoiser,
        }
    }

    /// Its effort.
    pub(super) fn interim_quality(&self) -> Quality {
        match self.settings.quality {
            // The draft's error is not the paper's, and it is the paper's that has to reach the target.
            Quality::Paper if self.settings.budget.target_error.is_some() => Quality::Paper,
            _ => Quality::Draft,
        }
    }

    /// Whether the filter runs again before the next batch, and with what effort. Before the last
    /// batch it is that of the end, so that the error which the batch measures is that of such an image.
    pub(super) fn rerun_due(&self, last: bool) -> Option<Quality> {
        let again = self.rerun.is_some();
        let interim = self.interim_quality();
        let ending = match self.settings.denoiser {
            Denoiser::Rpf => interim,
            _ => self.last_filter().1,
        };
        if self.favoured.is_some() && again && self.reruns > RERUN_SHARE * self.elapsed() {
            // A region's batches are small.
            return None;
        }
        let Some(left) = self.schedule.seconds_left(self.elapsed()) else {
            // The clock has no say, so that the image is the same on any machine.
            return Some(if last { ending } else { interim });
        };
        let budget = self.settings.budget.seconds.unwrap_or(0.0);
        let [interim_seconds, ending_seconds] = self.rerun_seconds();
        let of_use = |seconds: f64| LEAST_USE_OF_RERUN * seconds <= left;
        if !again {
            // There has to be something to decide; then the first comes whatever its share.
            let decides = self.store.drawn() >= u64::from(self.settings.min_spp) * self.store.pixels() as u64;
            return (decides && of_use(interim_seconds)).then_some(interim);
        }
        if last {
            let fits = |seconds: f64| of_use(seconds) && seconds <= LAST_RERUN_SHARE * budget;
            let choices = [(ending, ending_seconds), (interim, interim_seconds)];
            return choices.into_iter().find_map(|(quality, seconds)| fits(seconds).then_some(quality));
        }
        // What the one before the last batch will take is kept for it.
        let spent = self.reruns + interim_seconds;
        let fits = spent <= RERUN_SHARE * self.elapsed() && spent + ending_seconds <= RERUN_SHARE * budget;
        (fits && of_use(interim_seconds)).then_some(interim)
    }

    /// What a rerun takes, supposed.
    pub(super) fn pass_seconds(&self, quality: Quality) -> f64 {
        Cost::of((self.interim_denoiser(), quality)).seconds(self.store.pixels(), false)
    }

    /// What reruns of interim and of final quality would take: as they took last, or as follows from the rehearsal of
    /// the last pass if that is less, since the first time all the memory is new.
    fn rerun_seconds(&self) -> [f64; 2] {
        if self.rehearsal.is_missing() {
            return [self.interim_seconds.unwrap_or(f64::INFINITY), f64::INFINITY];
        }
        let last = self.last_filter();
        let (cost, filter) = (Cost::of(last), self.rehearsal.filter_seconds);
        let expected_maps = if self.settings.drives_interpolation() { cost.maps * filter } else { 0.0 };
        let maps = self.maps_seconds.unwrap_or(f64::INFINITY).min(expected_maps);
        let interim = (self.interim_denoiser(), self.interim_quality());
        let share = if interim == last { 1.0 } else { cost.draft };
        let expected = share * filter + maps;
        [self.interim_seconds.unwrap_or(f64::INFINITY).min(expected), filter + maps]
    }

    /// Under a budget of time, measures on some rows what comes after the last batch, now and then.
    pub(super) fn rehearse(&mut self) {
        let elapsed = self.elapsed();
        self.choose_unrehearsed();
        let Some(left) = self.schedule.seconds_left(elapsed) else { return };
        // A rehearsal would have to fill the pixels without samples first, and takes time from them.
        let sparse = self.store.drawn() < self.store.pixels() as u64;
        if sparse || !self.rehearsal.is_due(elapsed, left, self.schedule.closing()) {
            return;
        }
        if self.rehearsal.is_missing() {
            make_ready(Cost::of(self.last_filter()).bytes * self.store.pixels());
        }
        self.rehearse_now(left);
        let left = self.schedule.seconds_left(self.elapsed()).unwrap_or(left);
        if self.rehearsal.is_doubtful(left) {
            self.rehearse_now(left);
        }
        if self.schedule.is_late(self.elapsed()) && self.hurry(Hurried::Draft) {
            self.expect_unrehearsed();
            self.rehearse_now(left);
        }
        if self.schedule.is_far_too_late(self.elapsed()) && self.hurry(Hurried::Unfiltered) {
            self.expect_unrehearsed();
            self.rehearse_now(left);
        }
        self.seconds.filter += self.elapsed() - elapsed;
    }

    /// Before the first rehearsal: whether there is time for the last pass as asked for, for a draft, or for none.
    pub(super) fn choose_unrehearsed(&mut self) {
        let elapsed = self.elapsed();
        if !self.rehearsal.is_missing() || self.schedule.seconds_left(elapsed).is_none() {
            return;
        }
        let drawn = self.store.drawn();
        let has_time = if drawn < self.store.pixels() as u64 {
            self.schedule.fills(elapsed, drawn)
        } else {
            // The pixels may have got their samples against expectation.
            self.hurried = None;
            self.expect_unrehearsed();
            let left = self.schedule.seconds_left(elapsed).unwrap_or(0.0);
            self.rehearsal.is_due(elapsed, left, self.schedule.closing())
        };
        if !has_time && self.hurry(Hurried::Draft) {
            self.expect_unrehearsed();
        }
        if self.schedule.is_far_too_late(elapsed) && self.hurry(Hurried::Unfiltered) {
            self.expect_unrehearsed();
        }
    }

    fn rehearse_now(&mut self, left: f64) {
        let ((denoiser, quality), seed) = (self.last_filter(), self.settings.seed);
        let filter = |store: &Store| observer::filtered(store, denoiser, quality, seed);
        self.rehearsal.run(&self.store, left, filter, self.closing);
        self.schedule.rehearsed(self.rehearsal.closing_seconds);
    }

    /// Filters between batches; false if the observer gave it up.
    pub(super) fn rerun(&mut self, quality: Quality, observer: &mut dyn Observer) -> bool {
        let interpolation = self.settings.drives_interpolation();
        let filtered = self.filter(self.interim_denoiser(), quality, interpolation, observer);
        let Some((shown, filter_seconds)) = filtered else {
            return false;
        };
        self.report(&shown.filtered, filter_seconds, shown.success);
        observer.filtered(&shown);
        self.maps_seconds = shown.maps_seconds;
        let started = Instant::now();
        self.rerun = Some(Rerun::new(shown, &self.store));
        let snapshot_seconds = started.elapsed().as_secs_f64();
        self.seconds.filter += snapshot_seconds;
        let seconds = filter_seconds + snapshot_seconds;
        self.reruns += seconds;
        if quality == self.interim_quality() {
            self.interim_seconds = Some(seconds);
        }
        let is_as_the_last = (self.interim_denoiser(), quality) == self.last_filter();
        if is_as_the_last && !self.rehearsal.is_missing() {
            // What the whole takes is better known now than by some of its rows.
            self.schedule.corrected(
                self.rehearsal.corrected_by_pass(filter_seconds - self.maps_seconds.unwrap_or(0.0)),
            );
        }
        true
    }

    /// The image at the end; `None` if the observer gave the pass up.
    pub(super) fn last_pass(&mut self, observer: &mut dyn Observer) -> Option<Filtered> {
        let (denoiser, quality) = self.last_filter();
        let (mut shown, seconds) = self.filter(denoiser, quality, false, observer)?;
        if let Some(last) = &self.rerun {
            let filtered = &mut shown.filtered;
            filtered.interpolation_failure =
                filtered.interpolation_failure.take().or_else(|| last.failure.clone());
            filtered.interpolation_success = filtered.interpolation_success.or(last.success);
        }
        self.report(&shown.filtered, seconds, shown.filtered.interpolation_success);
        observer.filtered(&shown);
        Some(shown.filtered)
    }

    /// What a filter pass makes of the store, and its seconds; `None` if the observer gave it up.
    fn filter(
        &mut self,
        denoiser: Denoiser,
        quality: Quality,
        interpolation: bool,
        observer: &mut dyn Observer,
    ) -> Option<(Shown, f64)> {
        let started = Instant::now();
        let seed = self.settings.seed;
        let job = FilterJob { store: self.store.clone(), denoiser, quality, seed, interpolation };
        let shown = observer.run_filter(job);
        let seconds = started.elapsed().as_secs_f64();
        self.seconds.filter += seconds;
        Some((shown?, seconds))
    }

    fn report(&mut self, filtered: &Filtered, filter_seconds: f64, interpolation_success: Option<f32>) {
        let noisy = self.reference.map(|_| self.store.means(Part::Whole, self.store.layout().radiance()));
        let against = |image: Option<&Planes>, metric: fn(&Pair) -> f64| {
            image
                .zip(self.reference)
                .and_then(|(image, reference)| Some(metric(&Pair::new(image, reference).ok()?)))
        };
        let batch = Batch {
            index: self.batches.len(),
            seconds: self.start.elapsed().as_secs_f64(),
            samples_total: self.store.samples(),
            filter_seconds,
            interpolation_success,
            estimated_error: self.estimate.as_ref().map(|e| e.image),
            estimated_error_samples: self.estimate.as_ref().map(|e| e.samples),
            mse: against(Some(&filtered.image), |pair| pair.mse()),
            relmse: against(Some(&filtered.image), |pair| pair.relmse()),
            noisy_mse: against(noisy.as_ref(), |pair| pair.mse()),
            noisy_relmse: against(noisy.as_ref(), |pair| pair.relmse()),
        };
        self.batches.push(batch);
    }
}

fn pass_in_a_hurry(hurried: Hurried) -> Pass {
    match hurried {
        Hurried::Draft => (Denoiser::Prpf, Quality::Draft),
        Hurried::Unfiltered => (Denoiser::None, Quality::Draft),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    use std::time::Duration;

    use super::*;
    use crate::adaptive::Sampling;
    use crate::geometry::Accel;
    use crate::progressive::{Budget, Ended, Flow, Progress, StoppedBy};
    use crate::render::Renderer;
    use crate::scene::pbrt::read_str;

    const SCENE: &str = r#"Film "rgb" "integer xresolution" [ 32 ] "integer yresolution" [ 32 ]
        WorldBegin LightSource "infinite" Translate 0 0 4 Shape "sphere""#;
    const SLOW: Duration = Duration::from_millis(300);

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
        let settings = Settings {
            budget: Budget { seconds: Some(seconds), ..Budget::default() },
            ..Settings::default()
        };
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
        let started =
            Instant::now().checked_sub(Duration::from_secs(60)).expect("a clock that began earlier");
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
            let started = Instant::now().checked_sub(began).expect("a clock that began earlier");
            pool.install(|| {
                with_loop_of(320, seconds, started, |circle| {
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
}
