//! Renders an image by the library's render loop, with an experiment's changes to its interim passes.
//!
//! Takes a [`TestScene`] and a [`Trial`]; gives the filtered image, the store, the times of the loop's stages,
//! the estimate of the image's error, and how that is expected to fall.

use std::time::Instant;

use prpf::adaptive::{PrioritySettings, Sampling};
use prpf::filter::{Denoiser, FilterResult};
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::progressive::{
    Action, Budget, Conditions, ErrorEstimate, FilterPass, Filtered, Forecast, HalfImages, Outcome,
    RenderLoop, Settings, StoppedBy,
};
use prpf::render::Renderer;
use prpf::stats::{Part, Store};

use crate::test_scene::TestScene;

/// The settings of one render.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    pub sampling: Sampling,
    pub denoiser: &'static dyn Denoiser,
    /// Samples per pixel; the most of them if there is a target.
    pub spp: u32,
    /// Estimated relMSE that ends the render.
    pub target_error: Option<f64>,
    pub seed: u64,
    pub priority: PrioritySettings,
    pub interim_passes: InterimPasses,
}

/// How the loop's interim filter passes are run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InterimPasses {
    /// After every batch, as the program does.
    EveryBatch,
    /// After every batch, with the true squared error in place of the variance map.
    Oracle,
    /// After every n-th batch. The allocator uses the previous maps in between.
    EveryNth(usize),
}

/// The result of a trial.
pub struct Rendered {
    pub result: FilterResult,
    pub store: Store,
    /// Seconds spent in rendering, filtering and allocation.
    pub seconds: [f64; 3],
    /// The program's estimate of the filtered image's error.
    pub estimate: Option<ErrorEstimate>,
    pub forecast: Option<Forecast>,
    /// Number of filter passes, the last one among them.
    pub passes: usize,
    pub stopped_by: StoppedBy,
}

impl Rendered {
    /// The mean of the samples.
    pub fn unfiltered(&self) -> Planes {
        self.store.means(Part::Whole, self.store.layout().radiance())
    }
}

impl Trial {
    /// A render with the default priority maps and interim passes.
    pub fn new(sampling: Sampling, denoiser: &'static dyn Denoiser, spp: u32, seed: u64) -> Self {
        let priority = PrioritySettings::default();
        let interim_passes = InterimPasses::EveryBatch;
        Self { sampling, denoiser, spp, target_error: None, seed, priority, interim_passes }
    }

    fn settings(&self) -> Settings {
        Settings {
            budget: Budget { spp: Some(self.spp), target_error: self.target_error, seconds: None },
            sampling: self.sampling,
            denoiser: self.denoiser,
            seed: self.seed,
            priority: self.priority,
            ..Settings::default()
        }
    }

    /// Renders the scene.
    pub fn run(&self, test_scene: &TestScene, accel: &Accel) -> Rendered {
        let renderer = Renderer::new(&test_scene.scene, accel, self.seed);
        let render_loop = RenderLoop::new(&renderer, &self.settings(), Instant::now());
        let outcome = TrialDriver { trial: self, test_scene, passes: 0, latest: None }.run(render_loop);
        let (seconds, forecast, passes) = (outcome.seconds, outcome.forecast(), outcome.passes.len());
        Rendered {
            result: outcome.result,
            store: outcome.store,
            seconds: [seconds.render, seconds.filter, seconds.allocate],
            estimate: outcome.estimate,
            forecast,
            passes,
            stopped_by: outcome.stopped_by,
        }
    }
}

/// Drives the render loop of a trial, with its own interim passes.
struct TrialDriver<'a> {
    trial: &'a Trial,
    test_scene: &'a TestScene,
    /// Number of interim passes that the loop has asked for.
    passes: usize,
    latest: Option<Filtered>,
}

impl TrialDriver<'_> {
    fn run(&mut self, mut render_loop: RenderLoop) -> Outcome {
        let conditions = Conditions::default();
        loop {
            match render_loop.next_action(&conditions) {
                Action::Filter(denoiser) => {
                    let filtered = self.filter(render_loop.interim_pass(denoiser));
                    render_loop.complete_interim(filtered);
                }
                Action::Finish(stopped_by) => {
                    let pass = render_loop.final_pass(&conditions, stopped_by);
                    return render_loop.finish(filter_and_estimate(pass), stopped_by);
                }
                action => render_loop.perform(action, &mut ()),
            }
        }
    }

    /// Runs an interim pass.
    fn filter(&mut self, pass: FilterPass) -> Filtered {
        match self.trial.interim_passes {
            InterimPasses::EveryBatch => pass.run(),
            InterimPasses::Oracle => {
                let mut filtered = pass.run();
                let FilterResult { image, variance, .. } = &mut filtered.result;
                let truth = self.test_scene.reference.image.data();
                let values = variance.data_mut().iter_mut().zip(image.data()).zip(truth);
                values.for_each(|((variance, value), truth)| *variance = (value - truth).powi(2));
                filtered
            }
            InterimPasses::EveryNth(every) => {
                let is_due = self.passes.is_multiple_of(every);
                self.passes += 1;
                match &self.latest {
                    // A pass that is left out takes no time.
                    Some(latest) if !is_due => Filtered { seconds: 0.0, ..latest.clone() },
                    _ => self.latest.insert(pass.run()).clone(),
                }
            }
        }
    }
}

/// Runs a last pass. Its seconds are those of the image, as under a time budget, and its estimate is the best one.
fn filter_and_estimate(pass: FilterPass) -> Filtered {
    let FilterPass { store, denoiser, seed, .. } = pass.clone();
    let mut filtered = FilterPass { has_half_images: false, ..pass }.run();
    let halves = HalfImages::new(denoiser, &store, |half| denoiser.filter(half, seed));
    filtered.estimate = ErrorEstimate::new(&filtered.result, &store, halves.as_ref());
    filtered
}
