//! Reports a render to its viewers: frames through the publisher, and its status.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::command::Rectangle;
use super::comparison::Comparison;
use super::generation_record::{CoarseImage, GenerationRecord};
use super::hub::Hub;
use super::publisher::Publisher;
use super::status::{
    CameraStatus, DenoiserInfo, Expectation, HistoryStatus, ListedBookmark, MostSpp, Phase, RenderProgress,
    Status,
};
use super::view::{View, ViewSource};
use crate::filter::{DenoiserName, FilterResult};
use crate::image::Planes;
use crate::memory::held_bytes;
use crate::output::SampleCounts;
use crate::progressive::{
    ErrorEstimate, EstimateSummary, Filtered, Point, Progress, Settings, StoppedBy, forecast,
};
use crate::stats::{Layout, Store};

/// Shortest time between two reports.
const STATUS_INTERVAL: Duration = Duration::from_millis(250);
/// Time over which samples per second are counted, in seconds.
const RATE_WINDOW: f64 = 2.0;

/// The parts of a report that the reporter does not know.
pub struct Subject<'a> {
    pub scene: &'a str,
    pub is_paused: bool,
    pub settings: &'a Settings,
    pub camera: CameraStatus,
    pub denoisers: Vec<DenoiserInfo>,
    pub most_spp_kept: MostSpp,
    pub history: HistoryStatus,
    pub bookmarks: Vec<ListedBookmark>,
    pub region: Option<Rectangle>,
}

/// Most points of the error curve; beyond, every second one is dropped, so that a render of many hours reports no more.
const MOST_POINTS: usize = 256;

/// The status and the frames of a render, as viewers get them.
pub struct Reporter {
    hub: Arc<Hub>,
    publisher: Publisher,
    phase: Phase,
    stopped_by: Option<StoppedBy>,
    /// With a reference.
    comparison: Option<Comparison>,
    /// The record of the current generation.
    record: GenerationRecord,
    /// Since when the render's time goes on beyond that of the latest progress; `None` at a pause or after the end.
    counts_since: Option<Instant>,
    /// Time of the latest report; `None` if the next one is urgent.
    reported: Option<Instant>,
}

impl Reporter {
    pub fn new(hub: Arc<Hub>) -> Self {
        Self {
            publisher: Publisher::new(hub.clone()),
            hub,
            phase: Phase::Rendering,
            stopped_by: None,
            comparison: None,
            record: GenerationRecord::default(),
            counts_since: None,
            reported: None,
        }
    }

    /// Starts a generation, or goes on with one that has a record; returns the record of the one before. Images are compared
    /// with the reference, if there is one.
    pub fn begin(
        &mut self,
        layout: &Layout,
        settings: &Settings,
        record: GenerationRecord,
        reference: Option<Arc<Planes>>,
    ) -> GenerationRecord {
        self.publisher.begin(layout, settings, reference.is_some());
        self.comparison = reference.map(Comparison::new);
        self.compare(record.shown.as_ref());
        self.counts_since = None;
        self.enter(Phase::Rendering);
        self.reported = None;
        if record.progress.is_some() {
            self.publisher.stepped();
            self.publisher.filtered();
        }
        // A coarse image was shown to earlier viewers.
        std::mem::replace(&mut self.record, GenerationRecord { coarse: None, ..record })
    }

    /// Follows other settings.
    pub fn change(&mut self, settings: &Settings) {
        self.publisher.rescale(settings);
        self.reported = None;
    }

    /// Drops the image of another denoiser, and its errors.
    pub fn forget_image(&mut self) {
        self.record.forget_image();
        self.compare(None);
    }

    /// Compares an image with the reference.
    fn compare(&mut self, shown: Option<&FilterResult>) {
        if let Some(comparison) = &mut self.comparison {
            comparison.update(shown);
        }
    }

    /// Takes the record of the current generation, which ends.
    pub fn take_record(&mut self) -> GenerationRecord {
        std::mem::take(&mut self.record)
    }

    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Sets the phase; returns the one before.
    pub fn enter(&mut self, phase: Phase) -> Phase {
        match phase {
            Phase::Rendering => {
                self.stopped_by = None;
                self.counts_since.get_or_insert_with(Instant::now);
            }
            // The time of a pass counts if that of the phase before does.
            Phase::Filtering => {}
            Phase::Paused | Phase::Finished => self.counts_since = None,
        }
        std::mem::replace(&mut self.phase, phase)
    }

    /// Reports that the render has ended.
    pub fn finish(&mut self, stopped_by: StoppedBy) {
        self.enter(Phase::Finished);
        self.stopped_by = Some(stopped_by);
    }

    /// Returns whether the render has ended, also while a filter pass over its samples runs.
    pub fn is_finished(&self) -> bool {
        self.stopped_by.is_some()
    }

    pub fn progress(&self) -> Option<&Progress> {
        self.record.progress.as_ref()
    }

    /// Returns the newest filter result.
    pub fn shown(&self) -> Option<&FilterResult> {
        self.record.shown.as_ref()
    }

    /// Returns the number of samples behind it; 0 without one.
    pub fn shown_samples(&self) -> u64 {
        self.record.shown_samples
    }

    /// Returns whether a viewer is ready for one of the views that `selects` selects.
    pub fn wants(&self, selects: impl Fn(View) -> bool) -> bool {
        View::ALL.into_iter().any(|view| selects(view) && self.hub.wants(view))
    }

    /// Returns the side of the squares that the shown image was filtered in, in pixels.
    pub fn shown_side(&self) -> usize {
        self.record.shown_side
    }

    /// Returns the newest coarse image that stands in for a filtered one.
    pub fn coarse(&self) -> Option<&CoarseImage> {
        self.record.coarse.as_ref()
    }

    /// Returns whether there is a filtered image, if only a coarse one.
    pub fn has_image(&self) -> bool {
        self.record.shown.is_some() || self.record.coarse.is_some()
    }

    /// Returns whether a viewer shows one of the views that `selects` selects, ready for a frame or not.
    pub fn is_selected(&self, selects: impl Fn(View) -> bool) -> bool {
        View::ALL.into_iter().any(|view| selects(view) && self.hub.is_selected(view))
    }

    /// Adds a notice to the user.
    pub fn notice(&mut self, text: String, is_problem: bool) {
        self.hub.notices().add(text, is_problem);
        self.hasten();
    }

    /// Makes the next report urgent.
    pub fn hasten(&mut self) {
        self.reported = None;
    }

    /// Takes the progress after a pass.
    pub fn progressed(&mut self, progress: Progress) {
        self.record.progress = Some(progress);
        self.counts_since = Some(Instant::now());
    }

    /// Takes the progress after a step.
    pub fn stepped(&mut self, progress: Progress) {
        self.enter(Phase::Rendering);
        self.progressed(progress);
        self.record.recent.push_back((progress.elapsed, progress.samples));
        while self.record.recent.len() > 2 && progress.elapsed - self.record.recent[0].0 > RATE_WINDOW {
            self.record.recent.pop_front();
        }
        self.record.first.get_or_insert((progress.elapsed, progress.samples));
        self.publisher.stepped();
    }

    /// Returns whether viewers have got a frame of this render within the last second.
    pub fn has_shown_lately(&self) -> bool {
        self.publisher.has_shown_lately()
    }

    /// Publishes frames after a step, not too often.
    pub fn publish_if_due(&mut self, store: &Store) {
        if self.publisher.is_due() {
            self.publish(store);
        }
    }

    /// Returns how the error is expected to fall from the latest point of the curve.
    fn expectation(&self, target: Option<f64>) -> Option<Expectation> {
        // The rate is that of one denoiser's images: another one's lie on another curve.
        let curve = &self.record.curve;
        let (first, _) = curve.first()?;
        let of_first = curve.iter().filter(|(made_by, _)| made_by == first);
        let (_, latest) = curve.last().filter(|(_, point)| point.error > 0.0)?;
        let rate = forecast(&of_first.map(|(_, point)| *point).collect::<Vec<_>>(), latest)?;
        let now = self.record.seconds_of(self.record.progress?.samples)?;
        let point = |error: f64| {
            let growth = rate.growth_to(latest.error, error);
            let (seconds, unfiltered_error) = (growth * latest.seconds, latest.unfiltered_error / growth);
            Point { seconds, error, unfiltered_error }
        };
        let seconds_until = |point: Point| (point.seconds - now).max(0.0);
        let (halved, target) = (point(latest.error / 2.0), target.map(point));
        Some(Expectation {
            halved,
            halving_seconds: seconds_until(halved),
            target,
            target_seconds: target.map(seconds_until),
        })
    }

    /// Takes the result of a filter pass that took `seconds` seconds; `None` if it was given up.
    pub fn filtered(&mut self, filtered: Option<&Filtered>, seconds: f64, store: &Store) {
        self.add_filter_seconds(seconds);
        if let Some(Filtered { result, side, estimate, .. }) = filtered {
            if !self.is_last_image(result, store) {
                let summary = estimate.as_ref().map(ErrorEstimate::summary);
                let earlier = std::mem::replace(&mut self.record.estimate, summary);
                self.extend_curve(result.made_by, earlier);
            }
            let shown = self.record.shown.as_ref();
            if let Some(problem) = &result.failure
                && shown.is_none_or(|shown| shown.failure != result.failure)
            {
                self.notice(format!("{problem}: the image is not filtered"), true);
            }
            let mut result = result.clone();
            // Not every pass makes the map of interpolation failures: the latest one stays on show.
            let earlier = self.record.shown.take().and_then(|shown| shown.interpolation);
            result.interpolation = result.interpolation.or(earlier);
            self.compare(Some(&result));
            self.record.shown = Some(result);
            self.record.shown_samples = store.samples();
            self.record.shown_side = *side;
            self.publisher.filtered();
            self.publish(store);
        }
    }

    /// Returns whether a pass has made the last image of a finished render again, as for a map. The last pass has estimated the error
    /// from more.
    fn is_last_image(&self, result: &FilterResult, store: &Store) -> bool {
        let is_same = |shown: &FilterResult| shown.made_by == result.made_by;
        self.is_finished()
            && self.record.shown_samples == store.samples()
            && self.record.shown.as_ref().is_some_and(is_same)
    }

    /// Adds the time of a pass to that of all, if the render's time counts it.
    fn add_filter_seconds(&mut self, seconds: f64) {
        if self.counts_since.is_some() {
            self.record.filter_seconds += seconds;
        }
    }

    /// Adds the latest estimate, of an image by this denoiser, to the curve, in place of the `earlier` one of as many samples.
    fn extend_curve(&mut self, made_by: DenoiserName, earlier: Option<EstimateSummary>) {
        let Some(estimate) = self.record.estimate else { return };
        let Some(seconds) = self.record.seconds_of(estimate.samples) else { return };
        // The same image again
        let has_same_samples = earlier.is_some_and(|earlier| earlier.samples == estimate.samples);
        if has_same_samples && self.record.curve.last().is_some_and(|(last, _)| *last == made_by) {
            self.record.curve.pop();
        }
        let EstimateSummary { error, unfiltered: unfiltered_error, .. } = estimate;
        self.record.curve.push((made_by, Point { seconds, error, unfiltered_error }));
        if self.record.curve.len() > MOST_POINTS {
            // The first and the latest point stay.
            let mut index = 0;
            self.record.curve.retain(|_| {
                index += 1;
                index % 2 == 1
            });
        }
    }

    /// Publishes frames for the viewers that are ready.
    pub fn publish(&mut self, store: &Store) {
        let shown = self.record.shown.as_ref();
        if let Some(comparison) = &mut self.comparison
            && self.hub.wants(View::Flip)
        {
            let before = comparison.mean_flip();
            comparison.make_flip(shown);
            if comparison.mean_flip() != before {
                self.reported = None;
            }
        }
        let source = ViewSource { store, shown, comparison: self.comparison.as_ref() };
        self.publisher.publish(&source, self.record.progress.as_ref());
    }

    /// Publishes a coarse image; see [`Publisher::publish_coarse`].
    pub fn publish_coarse(&mut self, image: &Planes, side: usize, size: (usize, usize)) {
        self.publisher.publish_coarse(image, side, size);
    }

    /// Takes a coarse image, in place of a filtered one, of a pass that took `seconds` seconds; `None` if it was given up.
    pub fn filtered_coarsely(&mut self, coarse: Option<CoarseImage>, seconds: f64) {
        self.add_filter_seconds(seconds);
        if let Some(coarse) = coarse {
            self.publisher.publish_coarse_filtered(&coarse, self.record.progress.as_ref());
            self.record.coarse = Some(coarse);
        }
    }

    /// Takes the image of some pixels, of a pass that took `seconds` seconds: `paste` writes it into the filtered image, or into
    /// the coarse one that stands in for it.
    pub fn filtered_part(&mut self, paste: impl FnOnce(&mut Planes), seconds: f64, store: &Store) {
        self.add_filter_seconds(seconds);
        let record = &mut self.record;
        if let Some(shown) = &mut record.shown {
            paste(&mut shown.image);
            if let Some(comparison) = &mut self.comparison {
                comparison.update(Some(shown));
            }
            self.publisher.filtered();
            self.publish(store);
        } else if let Some(coarse) = &mut record.coarse {
            paste(coarse.detailed_mut());
            self.publisher.publish_coarse_filtered(coarse, record.progress.as_ref());
        }
    }

    /// Returns whether it is time for another status, or it is urgent.
    pub fn is_report_due(&self) -> bool {
        // An idle render has nothing new to report.
        let idle = matches!(self.phase, Phase::Finished | Phase::Paused);
        self.reported.is_none_or(|reported| !idle && reported.elapsed() >= STATUS_INTERVAL)
    }

    /// Publishes the status.
    pub fn report(&mut self, subject: &Subject, store: &Store) {
        self.reported = Some(Instant::now());
        let status = Status {
            r#type: "status",
            scene: subject.scene,
            width: store.width(),
            height: store.height(),
            generation: self.publisher.generation(),
            phase: self.phase,
            is_paused: subject.is_paused,
            stopped_by: self.stopped_by,
            settings: subject.settings,
            denoisers: &subject.denoisers,
            most_spp_kept: subject.most_spp_kept,
            history: &subject.history,
            made_by: self.record.shown.as_ref().map(|shown| shown.made_by),
            views: self.publisher.views(),
            statistics: self.statistics(store),
            curve: self.record.curve.iter().map(|(_, point)| *point).collect(),
            forecast: self.expectation(subject.settings.budget.target_error),
            camera: &subject.camera,
            bookmarks: &subject.bookmarks,
            saves: self.hub.saves().list(),
            region: subject.region,
            notices: self.hub.notices().list(),
        };
        // Numbers that JSON cannot hold do not occur: all are finite or absent.
        self.hub.publish_status(serde_json::to_string(&status).unwrap_or_default());
    }

    fn statistics(&self, store: &Store) -> RenderProgress {
        let counts = SampleCounts::new(store);
        let (first, last) = (self.record.recent.front(), self.record.recent.back());
        let rate = first.zip(last).map_or(0.0, |(a, b)| (b.1 - a.1) as f64 / (b.0 - a.0).max(1e-6));
        let seconds = self.record.progress.map_or(0.0, |p| p.elapsed)
            + self.counts_since.map_or(0.0, |since| since.elapsed().as_secs_f64());
        RenderProgress {
            seconds,
            fraction: self.record.progress.map_or(0.0, |p| p.fraction),
            samples: store.samples(),
            mean: counts.mean,
            min: counts.min,
            max: counts.max,
            samples_per_second: if self.phase == Phase::Rendering { rate } else { 0.0 },
            filter_fraction: if seconds > 0.0 {
                (self.record.filter_seconds / seconds).min(1.0)
            } else {
                0.0
            },
            memory_bytes: held_bytes(),
            estimate: self.record.estimate,
            true_error: self.comparison.as_ref().and_then(Comparison::relmse),
            flip: self.comparison.as_ref().and_then(Comparison::mean_flip),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::unfiltered;

    #[test]
    fn a_render_is_finished_until_it_goes_on() {
        let mut reporter = Reporter::new(Arc::new(Hub::default()));
        assert!(!reporter.is_finished());
        reporter.finish(StoppedBy::Interrupt);
        assert_eq!(reporter.enter(Phase::Filtering), Phase::Finished);
        assert!(reporter.is_finished(), "a pass for a viewer does not change that");
        reporter.enter(Phase::Rendering);
        assert!(!reporter.is_finished());
    }

    #[test]
    fn time_counts_while_the_render_goes_on() {
        let store = Store::new(1, 1, Layout::with_blocks(|_| false), 0, 0);
        let mut reporter = Reporter::new(Arc::new(Hub::default()));
        let progress = Progress { fraction: 0.5, elapsed: 8.0, samples: 0, spp: 0.0, estimate: None };
        let seconds = |reporter: &Reporter| reporter.statistics(&store).seconds;
        reporter.stepped(progress);
        reporter.enter(Phase::Filtering);
        std::thread::sleep(Duration::from_millis(5));
        assert!(seconds(&reporter) > 8.004, "a pass takes time");
        reporter.filtered(None, 2.0, &store);
        reporter.progressed(Progress { elapsed: 10.0, ..progress });
        // At a pause neither waiting nor passes for viewers count.
        for phase in [Phase::Paused, Phase::Filtering, Phase::Paused] {
            reporter.enter(phase);
            std::thread::sleep(Duration::from_millis(5));
            reporter.filtered(None, 1.0, &store);
        }
        assert_eq!(seconds(&reporter), 10.0);
        assert_eq!(reporter.statistics(&store).filter_fraction, 0.2);
    }

    /// Returns an unfiltered image of a store, with an estimate of its error.
    fn filtered(store: &Store, error: f64) -> Filtered {
        let (tiles, samples) = (Planes::new(1, 1, 1), store.samples());
        let estimate =
            Some(ErrorEstimate { value: error, deviation: 0.1, unfiltered: error, samples, tiles });
        Filtered { result: unfiltered(store), side: 1, estimate, seconds: 0.0 }
    }

    #[test]
    fn a_pass_for_a_map_leaves_the_error_of_the_last_image() {
        let mut store = Store::new(2, 2, Layout::with_blocks(|_| false), 0, 0);
        let sample = vec![0.5; store.layout().len()];
        (0..4).for_each(|i| store.push(i % 2, i / 2, &sample));
        let mut reporter = Reporter::new(Arc::new(Hub::default()));
        let error = |reporter: &Reporter| reporter.statistics(&store).estimate.map(|found| found.error);
        reporter.filtered(Some(&filtered(&store, 0.1)), 0.0, &store);
        reporter.filtered(Some(&filtered(&store, 0.2)), 0.0, &store);
        assert_eq!(error(&reporter), Some(0.2));
        reporter.finish(StoppedBy::Spp);
        reporter.filtered(Some(&filtered(&store, 0.3)), 0.0, &store);
        assert_eq!(error(&reporter), Some(0.2));
    }
}
