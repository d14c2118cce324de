//! Renders by the library's own loop, as an experiment needs them: with its own driving maps or fewer
//! reruns of the filter, and with what the loop says of its error on the way.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use prpf::adaptive::{PrioritySettings, Sampling};
use prpf::filter::Filtered;
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::image::metrics::Pair;
use prpf::progressive::{
    Budget, Denoiser, ErrorEstimate, FilterJob, Flow, Loop, Memory, Observer, Progress, Rerun, Settings,
    Shown,
};
use prpf::render::Renderer;
use prpf::scene::Scene;
use prpf::stats::{Part, Store};
use serde::Deserialize;

use crate::bench::Bench;
use crate::reference::{self, Reference};
use crate::scenes::{SceneFile, View};

/// How large films are, and how good their references: a part of an experiment's settings.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Size {
    /// Pixels of a film, about.
    pixels: f64,
    /// Samples per pixel of a reference.
    reference_spp: u32,
    /// The same of scenes that need more.
    harder: BTreeMap<String, u32>,
}

/// A scene at the size that an experiment looks at it, with its reference.
pub struct Bed {
    pub name: String,
    pub scene: Scene,
    pub reference: Reference,
}

impl Bed {
    /// The scene with its film scaled to the settings' size.
    ///
    /// # Errors
    /// What is wrong with the file, or the cache of references.
    pub fn new(bench: &Bench, file: &SceneFile, size: &Size) -> anyhow::Result<Self> {
        bench.doing(format!("{}: reading", file.name));
        let mut scene = file.load(View::default())?;
        let (width, height) = (scene.film.width as f64, scene.film.height as f64);
        let scale = (size.pixels / (width * height)).sqrt().min(1.0);
        scene.resize_film((width * scale).round() as usize, (height * scale).round() as usize);
        let spp = size.harder.get(&file.name).copied().unwrap_or(size.reference_spp);
        let reference =
            reference::reference(&scene, &file.name, spp, &bench.cache, |what| bench.doing(what))?;
        Ok(Self { name: file.name.clone(), scene, reference })
    }

    /// relMSE of an image against the truth: against the reference, less what the reference itself is off.
    pub fn error(&self, image: &Planes) -> f64 {
        let pair = Pair::new(image, &self.reference.image).expect("a render of the reference's size");
        (pair.relmse() - self.reference.relmse).max(f64::MIN_POSITIVE)
    }
}

/// One way to get an image.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    pub sampling: Sampling,
    pub denoiser: Denoiser,
    /// Samples per pixel.
    pub spp: u32,
    pub seed: u64,
    pub priority: PrioritySettings,
    pub steering: Steering,
    /// Whether to keep what the loop says of its error.
    pub checked: bool,
}

/// What an experiment changes about the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steering {
    None,
    /// The true error stands in the place of all maps.
    Oracle,
    /// Only each so-many-th rerun of the filter between batches takes place; maps are kept until then.
    Seldom(usize),
}

/// What the loop said of the error of an image, and what was true.
#[derive(Clone, Debug)]
pub struct Check {
    /// Samples per pixel of the image.
    pub spp: f64,
    pub estimate: ErrorEstimate,
    /// The image.
    pub image: Planes,
}

/// What came of a trial.
pub struct Rendered {
    pub filtered: Filtered,
    pub store: Store,
    /// Seconds of the loop: rendering, filtering, allocating.
    pub seconds: [f64; 3],
    pub checks: Vec<Check>,
}

impl Rendered {
    /// The mean of the samples.
    pub fn unfiltered(&self) -> Planes {
        self.store.means(Part::Whole, self.store.layout().radiance())
    }
}

impl Trial {
    pub fn new(sampling: Sampling, denoiser: Denoiser, spp: u32, seed: u64) -> Self {
        let priority = PrioritySettings::default();
        Self { sampling, denoiser, spp, seed, priority, steering: Steering::None, checked: false }
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

    /// Renders it.
    pub fn run(&self, bed: &Bed, accel: &Accel) -> Rendered {
        let renderer = Renderer::new(&bed.scene, accel, self.seed);
        let interrupt = AtomicBool::new(false);
        let checks = Mutex::new(Vec::new());
        let keep = |_: &Settings, memory: Memory| {
            checks.lock().expect("nothing panics with it").extend(check(memory))
        };
        let settings = self.settings();
        let mut circle = Loop::new(&renderer, &settings, Instant::now(), &interrupt, None);
        if self.checked {
            circle = circle.keeping(0.0, &keep);
        }
        let outcome = circle.run(&mut Steered { trial: self, bed, count: 0, last: None });
        let seconds = outcome.seconds;
        let mut checks = checks.into_inner().expect("nothing panics with it");
        checks.dedup_by_key(|check: &mut Check| check.estimate.samples);
        Rendered {
            filtered: outcome.filtered,
            store: outcome.store,
            seconds: [seconds.render, seconds.filter, seconds.allocate],
            checks,
        }
    }
}

/// The estimate in a memory, if it is of the image that is in it.
fn check(memory: Memory) -> Option<Check> {
    let Memory { store, estimate, rerun, under_way: None, .. } = memory else { return None };
    let (estimate, Rerun { image, made_of, .. }) = (estimate?, rerun?);
    let samples: u64 = made_of.count.iter().flatten().map(|&n| u64::from(n)).sum();
    let spp = samples as f64 / store.pixels() as f64;
    (estimate.samples == samples).then_some(Check { spp, estimate, image })
}

struct Steered<'a> {
    trial: &'a Trial,
    bed: &'a Bed,
    /// Reruns so far.
    count: usize,
    last: Option<Shown>,
}

impl Observer for Steered<'_> {
    fn stepped(&mut self, _: Progress, _: &Arc<Store>) -> Flow {
        Flow::GoOn
    }

    fn run_filter(&mut self, job: FilterJob) -> Option<Shown> {
        let at_end = job.store.drawn() >= u64::from(self.trial.spp) * job.store.pixels() as u64;
        match self.trial.steering {
            Steering::None => Some(job.run()),
            _ if at_end => Some(job.run()),
            Steering::Oracle => {
                let mut shown = job.run();
                let Filtered { image, variance, .. } = &mut shown.filtered;
                let truth = self.bed.reference.image.data();
                let values = variance.data_mut().iter_mut().zip(image.data()).zip(truth);
                values.for_each(|((variance, value), truth)| *variance = (value - truth).powi(2));
                Some(shown)
            }
            Steering::Seldom(every) => {
                if self.last.is_none() || self.count.is_multiple_of(every) {
                    self.last = Some(job.run());
                }
                self.count += 1;
                self.last.clone()
            }
        }
    }
}
