//! Encodes frames of the views that viewers are ready for, at a rate that their cost allows.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::generation_record::CoarseImage;
use super::hub::Hub;
use super::preview_frame::{FrameInfo, PreviewFrame};
use super::status::ViewInfo;
use super::view::{View, ViewSource};
use crate::image::Planes;
use crate::image::enlargement::smoothed;
use crate::progressive::{Progress, Settings};
use crate::stats::{Layout, Part, Rectangle, Store};

/// Shortest time between two frames.
const SHORTEST_INTERVAL: Duration = Duration::from_millis(100);
/// Longest time between two frames, however expensive they are.
const LONGEST_INTERVAL: Duration = Duration::from_millis(200);
/// Longest time without a frame while movements of the camera keep coming.
const LONGEST_WAIT: Duration = Duration::from_secs(1);
/// Fraction of the time that encoding frames should take.
const TIME_FRACTION: f64 = 0.04;
/// Samples of a pixel whose turn has come: samples come in pairs.
pub const PAIR: f64 = 2.0;
/// First steps of a generation, whose coarse images are all shown.
const EAGER_STEPS: u64 = 4;

/// Returns whether every pixel has samples, a pair of them on average. By a map some never get any.
pub fn is_covered(store: &Store, has_map: bool) -> bool {
    store.samples_taken() as f64 >= PAIR * store.pixels() as f64
        && (has_map || store.empty_pixels(&Rectangle::whole(store.width(), store.height())) == 0)
}

/// Publishes frames of one render; see the module.
pub struct Publisher {
    hub: Arc<Hub>,
    generation: u32,
    views: Vec<ViewInfo>,
    /// Whether a map places the samples.
    has_map: bool,
    /// Number of steps and of filter passes of this generation.
    steps: u64,
    passes: u64,
    /// Step or filter pass that the newest frame of each view shows.
    published: [Option<u64>; View::ALL.len()],
    /// When the latest frames were published, and how long encoding them took.
    latest: Instant,
    cost: Duration,
    /// When the latest frame of this generation was published, a coarse one included.
    shown: Option<Instant>,
}

impl Publisher {
    pub fn new(hub: Arc<Hub>) -> Self {
        Self {
            hub,
            generation: 0,
            views: Vec::new(),
            has_map: false,
            steps: 0,
            passes: 0,
            published: [None; View::ALL.len()],
            latest: Instant::now(),
            cost: Duration::ZERO,
            shown: None,
        }
    }

    /// Starts a generation: all samples before are discarded.
    pub fn begin(&mut self, layout: &Layout, settings: &Settings, has_reference: bool) {
        self.generation = self.hub.next_generation();
        (self.steps, self.passes) = (0, 0);
        self.published = Default::default();
        self.shown = None;
        self.has_map = settings.sample_map.is_some();
        let info = |view: View| ViewInfo { view, scale: view.scale(settings) };
        self.views =
            View::ALL.into_iter().filter(|view| view.exists(layout, has_reference)).map(info).collect();
    }

    /// Updates the colour scales to other settings.
    pub fn rescale(&mut self, settings: &Settings) {
        self.views.iter_mut().for_each(|info| info.scale = info.view.scale(settings));
    }

    /// Returns the number of the current generation.
    pub fn generation(&self) -> u32 {
        self.generation
    }

    /// Returns the views that this render has.
    pub fn views(&self) -> &[ViewInfo] {
        &self.views
    }

    /// Counts a step: there are new samples.
    pub fn stepped(&mut self) {
        self.steps += 1;
    }

    /// Counts a filter pass.
    pub fn filtered(&mut self) {
        self.passes += 1;
    }

    /// Tests whether it is time for another frame.
    pub fn is_due(&self) -> bool {
        let rest = self.cost.div_f64(TIME_FRACTION).clamp(SHORTEST_INTERVAL, LONGEST_INTERVAL);
        self.steps <= EAGER_STEPS || self.latest.elapsed() >= rest
    }

    /// Publishes an unfiltered coarse image: a pixel for every square of `side` pixels, of an image of `size` pixels.
    pub fn publish_coarse(&mut self, image: &Planes, side: usize, size: (usize, usize)) {
        let info = self.coarse_info(side, (1.0 / (side * side) as f32, 0.0));
        self.publish_frame(PreviewFrame::coarse(View::Raw, image, size, info));
    }

    /// Publishes a filtered coarse image and its maps: who selects one later has to wait for the next pass otherwise.
    pub fn publish_coarse_filtered(&mut self, coarse: &CoarseImage, progress: Option<&Progress>) {
        let progress = progress.map_or((0.0, 0.0), |p| (p.spp as f32, p.elapsed as f32));
        let info = || self.coarse_info(coarse.side, progress);
        let squares = |view, planes: &Planes| {
            // The page interpolates between the middles of the squares
            let smooth = smoothed(planes, 1, (planes.width(), planes.height()));
            PreviewFrame::coarse(view, &smooth, coarse.size, info())
        };
        let image = match &coarse.detailed {
            Some(image) => PreviewFrame::new(View::Filtered, image, None, info()),
            None => squares(View::Filtered, &coarse.squares),
        };
        let maps: Vec<_> = coarse.maps.iter().map(|(view, map)| squares(*view, map)).collect();
        for frame in std::iter::once(image).chain(maps) {
            self.publish_frame(frame);
        }
    }

    fn coarse_info(&self, side: usize, (spp, seconds): (f32, f32)) -> FrameInfo {
        let sequence = self.hub.next_sequence();
        FrameInfo { generation: self.generation, sequence, spp, seconds, side: side as u8 }
    }

    /// Returns whether viewers have got a frame of this generation within the last second.
    pub fn has_shown_lately(&self) -> bool {
        self.shown.is_some_and(|shown| shown.elapsed() < LONGEST_WAIT)
    }

    fn publish_frame(&mut self, frame: PreviewFrame) {
        self.shown = Some(Instant::now());
        self.hub.publish(frame);
        // Old frames stay until there is a new one to show.
        self.hub.drop_before(self.generation);
    }

    /// Publishes the views that have changed and that a viewer is ready for.
    pub fn publish(&mut self, source: &ViewSource, progress: Option<&Progress>) {
        // Find the views to publish
        let version = |view: View| match view {
            View::Reference => 0,
            view if view.is_filtered() => self.passes,
            _ => self.steps,
        };
        let wanted: Vec<(View, u64)> = self
            .views
            .iter()
            .map(|info| (info.view, version(info.view)))
            .filter(|&(view, version)| self.hub.wants(view) && self.published[view.index()] != Some(version))
            .collect();
        if wanted.is_empty() || self.steps == 0 {
            return;
        }

        // Encode and publish them
        let started = Instant::now();
        let spp = progress.map_or(0.0, |p| p.spp);
        let counts = (!is_covered(source.store, self.has_map)).then(|| source.store.counts(Part::Whole));
        for (view, version) in wanted {
            let Some(planes) = view.planes(source) else { continue };
            self.published[view.index()] = Some(version);
            let info = FrameInfo {
                generation: self.generation,
                sequence: self.hub.next_sequence(),
                spp: spp as f32,
                seconds: progress.map_or(0.0, |p| p.elapsed) as f32,
                side: 1,
            };
            let counts = counts.as_deref().filter(|_| !matches!(view, View::Samples | View::Reference));
            self.publish_frame(PreviewFrame::new(view, &planes, counts, info));
        }
        self.cost = started.elapsed();
        self.latest = Instant::now();
    }
}
