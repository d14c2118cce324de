//! The filter passes of the loop: when one is due and with what effort, and how long the last will take.

use std::time::Instant;

use super::rehearsal::make_ready;
use super::{Batch, Denoiser, FilterJob, Loop, Observer, Rerun, Settings, Shown, observer};
use crate::filter::{Filtered, Quality};
use crate::image::Planes;
use crate::image::metrics::Pair;
use crate::stats::{Part, Store};

/// What comes after the last batch takes about this long where it was not rehearsed yet, in seconds per pixel:
/// without a filter, with a draft, with any other. Most of it is new memory.
const UNREHEARSED: [f64; 3] = [1e-6, 1.8e-6, 3e-6];
/// Memory of the same, in bytes per pixel (measured: 720 for `standard` with the snapshot that a rerun leaves).
const PASS_BYTES: [usize; 3] = [0, 350, 700];
/// To find where interpolation fails takes about this share of the time of a draft, of `standard`, and of what
/// takes longer.
const MAPS_SHARE: [f64; 3] = [2.5, 0.9, 0.2];
/// Share of the time that reruns of the filter may take under a budget of time.
const RERUN_SHARE: f64 = 0.1;
/// The one before the last batch may take this share by itself, however short the budget: without it
/// nothing is known of the error of an image like the last one.
const LAST_RERUN_SHARE: f64 = 0.08;
/// A rerun must be followed by at least this many times its time for the samples that it directs.
const LEAST_USE_OF_RERUN: f64 = 3.0;

impl Loop<'_> {
    /// The last filter pass. Where there is no sample for every pixel the image is a coarse one, and `paper` and
    /// RPF would take pixels without samples for black ones.
    fn last_filter(&self) -> (Denoiser, Quality) {
        let sparse = self.store.drawn() < self.store.pixels() as u64;
        match self.settings.denoiser {
            Denoiser::None => (Denoiser::None, self.settings.quality),
            _ if sparse || self.hurried => (Denoiser::Prpf, Quality::Draft),
            denoiser => (denoiser, self.settings.quality),
        }
    }

    /// The time does not suffice for the last pass as asked for: it will be a draft. Whether it would not be one
    /// otherwise.
    pub(super) fn hurry(&mut self) -> bool {
        let Settings { denoiser, quality, .. } = self.settings;
        let draft = denoiser == Denoiser::None || (denoiser, quality) == (Denoiser::Prpf, Quality::Draft);
        let changes = !self.hurried && !draft;
        self.hurried |= changes;
        changes
    }

    /// Predicts what comes after the last batch without a rehearsal.
    pub(super) fn expect_unrehearsed(&mut self) {
        let [unfiltered, draft, other] = UNREHEARSED;
        let per_pixel = match (self.settings.denoiser, self.settings.quality) {
            (Denoiser::None, _) => unfiltered,
            (Denoiser::Prpf, Quality::Draft) => draft,
            _ if self.hurried => draft,
            _ => other,
        };
        self.schedule.expects(per_pixel * self.store.pixels() as f64);
    }

    /// The filter between batches.
    pub(super) fn interim_denoiser(&self) -> Denoiser {
        match self.settings.denoiser {
            Denoiser::Rpf if self.settings.budget.target_error.is_none() => Denoiser::Prpf,
            denoiser => denoiser,
        }
    }

    /// Its effort.
    fn interim_quality(&self) -> Quality {
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
        let ending_seconds = if self.rehearsal.is_missing() {
            f64::INFINITY
        } else {
            self.rehearsal.filter_seconds + self.maps_seconds()
        };
        let interim_seconds = self.interim_seconds.unwrap_or(f64::INFINITY).min(ending_seconds);
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

    /// What it takes a rerun longer to find where interpolation fails as well: as it took last, or as follows from the
    /// rehearsal of the last pass if that is less, since the first time all the memory is new.
    fn maps_seconds(&self) -> f64 {
        let [of_draft, of_standard, of_others] = MAPS_SHARE;
        let share = match self.last_filter() {
            _ if !self.settings.drives_interpolation() => 0.0,
            (Denoiser::Prpf, Quality::Draft) => of_draft,
            (Denoiser::Prpf, Quality::Standard) => of_standard,
            _ => of_others,
        };
        self.maps_seconds.unwrap_or(f64::INFINITY).min(share * self.rehearsal.filter_seconds)
    }

    /// Under a budget of time, measures on some rows what comes after the last batch, now and then.
    pub(super) fn rehearse(&mut self) {
        let elapsed = self.elapsed();
        if self.schedule.seconds_left(elapsed).is_none() {
            return;
        }
        if self.rehearsal.is_missing() {
            self.choose_unrehearsed(elapsed);
        }
        let left = self.schedule.seconds_left(elapsed).unwrap_or(0.0);
        // A rehearsal would have to fill the pixels without samples first, and takes time from them.
        let sparse = self.store.drawn() < self.store.pixels() as u64;
        if sparse || !self.rehearsal.is_due(elapsed, left, self.schedule.closing()) {
            return;
        }
        if self.rehearsal.is_missing() {
            let [unfiltered, draft, other] = PASS_BYTES;
            let per_pixel = match self.last_filter() {
                (Denoiser::None, _) => unfiltered,
                (_, Quality::Draft) => draft,
                _ => other,
            };
            make_ready(per_pixel * self.store.pixels());
        }
        self.rehearse_now(left);
        let left = self.schedule.seconds_left(self.elapsed()).unwrap_or(left);
        if self.rehearsal.is_doubtful(left) {
            self.rehearse_now(left);
        }
        if self.schedule.is_late(self.elapsed()) && self.hurry() {
            self.expect_unrehearsed();
            self.rehearse_now(left);
        }
        self.seconds.filter += self.elapsed() - elapsed;
    }

    /// Before the first rehearsal: whether the last pass can be as asked for, or is hurried.
    fn choose_unrehearsed(&mut self, elapsed: f64) {
        let drawn = self.store.drawn();
        let has_time = if drawn < self.store.pixels() as u64 {
            self.schedule.fills(elapsed, drawn)
        } else {
            // The pixels may have got their samples against expectation.
            self.hurried = false;
            self.expect_unrehearsed();
            let left = self.schedule.seconds_left(elapsed).unwrap_or(0.0);
            self.rehearsal.is_due(elapsed, left, self.schedule.closing())
        };
        if !has_time && self.hurry() {
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
        let of_filter = shown.filter_seconds;
        self.maps_seconds = Some(filter_seconds - of_filter);
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
            self.schedule.corrected(self.rehearsal.corrected_by_pass(of_filter));
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
