//! The filter passes of the loop: when one is due, with what effort, and what is kept of it.

use std::time::Instant;

use super::cost::Cost;
use super::{Batch, Denoiser, FilterJob, Loop, Observer, Rerun, Shown};
use crate::filter::{Filtered, Quality};
use crate::image::Planes;
use crate::image::metrics::Pair;
use crate::stats::Part;

/// Share of the time that reruns of the filter may take under a budget of time.
const RERUN_SHARE: f64 = 0.1;
/// The one before the last batch may take this share by itself, however short the budget: without it
/// nothing is known of the error of an image like the last one.
const LAST_RERUN_SHARE: f64 = 0.08;
/// A rerun must be followed by at least this many times its time for the samples that it directs.
const LEAST_USE_OF_RERUN: f64 = 3.0;

impl Loop<'_> {
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
