//! Renders an image by the library's render loop, with an experiment's changes to its interim passes.
//!
//! Takes a [`TestScene`] and a [`Trial`]; gives the filtered image, the store, the times of the loop's stages
//! and, if asked for, the loop's error estimates with the images that they belong to.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use prpf::adaptive::{PrioritySettings, Sampling};
use prpf::filter::Filtered;
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::progressive::{
    Budget, Denoiser, ErrorEstimate, FilterJob, Flow, Loop, Memory, Observer, Progress, Rerun, Settings,
    Shown,
};
use prpf::render::Renderer;
use prpf::stats::{Part, Store};

use crate::test_scene::TestScene;

/// The settings of one render.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    pub sampling: Sampling,
    pub denoiser: Denoiser,
    /// Samples per pixel.
    pub spp: u32,
    pub seed: u64,
    pub priority: PrioritySettings,
    pub interim_passes: InterimPasses,
    /// Whether to record the loop's error estimates.
    pub records_estimates: bool,
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

/// An error estimate of the loop, with the image that it belongs to.
#[derive(Clone, Debug)]
pub struct EstimatedImage {
    /// Samples per pixel of the image.
    pub spp: f64,
    pub estimate: ErrorEstimate,
    pub image: Planes,
}

/// The result of a trial.
pub struct Rendered {
    pub filtered: Filtered,
    pub store: Store,
    /// Seconds spent in rendering, filtering and allocation.
    pub seconds: [f64; 3],
    pub estimates: Vec<EstimatedImage>,
}

impl Rendered {
    /// The mean of the samples.
    pub fn unfiltered(&self) -> Planes {
        self.store.means(Part::Whole, self.store.layout().radiance())
    }
}

impl Trial {
    /// A render with the default priority maps and interim passes.
    pub fn new(sampling: Sampling, denoiser: Denoiser, spp: u32, seed: u64) -> Self {
        let priority = PrioritySettings::default();
        Self {
            sampling,
            denoiser,
            spp,
            seed,
            priority,
            interim_passes: InterimPasses::EveryBatch,
            records_estimates: false,
        }
    }

    fn settings(&self) -> Settings {
        Settings {
            budget: Budget { spp: Some(self.spp), ..Budget::default() },
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
        let interrupt = AtomicBool::new(false);
        let estimates = Mutex::new(Vec::new());
        let keep = |_: &Settings, memory: Memory| {
            estimates
                .lock()
                .expect("no thread panics while it holds the lock")
                .extend(estimated_image(memory))
        };
        let settings = self.settings();
        let mut render_loop = Loop::new(&renderer, &settings, Instant::now(), &interrupt, None);
        if self.records_estimates {
            render_loop = render_loop.keeping(0.0, &keep);
        }
        let outcome = render_loop.run(&mut TrialObserver { trial: self, test_scene, passes: 0, last: None });
        let seconds = outcome.seconds;
        let mut estimates = estimates.into_inner().expect("no thread panics while it holds the lock");
        estimates.dedup_by_key(|recorded: &mut EstimatedImage| recorded.estimate.samples);
        Rendered {
            filtered: outcome.filtered,
            store: outcome.store,
            seconds: [seconds.render, seconds.filter, seconds.allocate],
            estimates,
        }
    }
}

/// The error estimate of a checkpoint and its image; `None` if the estimate belongs to another image.
fn estimated_image(memory: Memory) -> Option<EstimatedImage> {
    let Memory { store, estimate, rerun, under_way: None, .. } = memory else { return None };
    let (estimate, Rerun { image, made_of, .. }) = (estimate?, rerun?);
    let samples: u64 = made_of.count.iter().flatten().map(|&n| u64::from(n)).sum();
    let spp = samples as f64 / store.pixels() as f64;
    (estimate.samples == samples).then_some(EstimatedImage { spp, estimate, image })
}

/// Runs the interim passes of a trial.
struct TrialObserver<'a> {
    trial: &'a Trial,
    test_scene: &'a TestScene,
    /// Number of interim passes that the loop has asked for.
    passes: usize,
    last: Option<Shown>,
}

impl Observer for TrialObserver<'_> {
    fn stepped(&mut self, _: Progress, _: &Arc<Store>) -> Flow {
        Flow::GoOn
    }

    fn run_filter(&mut self, job: FilterJob) -> Option<Shown> {
        let at_end = job.store.drawn() >= u64::from(self.trial.spp) * job.store.pixels() as u64;
        match self.trial.interim_passes {
            InterimPasses::EveryBatch => Some(job.run()),
            _ if at_end => Some(job.run()),
            InterimPasses::Oracle => {
                let mut shown = job.run();
                let Filtered { image, variance, .. } = &mut shown.filtered;
                let truth = self.test_scene.reference.image.data();
                let values = variance.data_mut().iter_mut().zip(image.data()).zip(truth);
                values.for_each(|((variance, value), truth)| *variance = (value - truth).powi(2));
                Some(shown)
            }
            InterimPasses::EveryNth(every) => {
                if self.last.is_none() || self.passes.is_multiple_of(every) {
                    self.last = Some(job.run());
                }
                self.passes += 1;
                self.last.clone()
            }
        }
    }
}
