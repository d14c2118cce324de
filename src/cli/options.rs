//! Options of `render`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, ValueEnum, value_parser};

use super::debug_sample::DebugSample;
use super::denoiser_options::DenoiserOptions;
use super::parse;
use super::sample_map::SampleMapOptions;
use super::state_options::StateOptions;
use crate::adaptive::{NO_CEILING, PrioritySettings, Sampling};
use crate::filter::DEFAULT;
use crate::progressive::{Budget, MIN_SPP, Settings, default_denoiser};
use crate::scene::Scene;
use crate::scene::integrator::MAX_DEPTH;

/// `prpf render`.
#[derive(Clone, Args)]
#[command(after_help = "\
Examples:
  prpf render scenes/pool/pool.pbrt -o pool.png --spp 16
  prpf render scene.pbrt --time 30s -o out.exr -o out.png --report out.json
  prpf render scene.pbrt --sampling uniform --denoiser none --spp 1024 -o r.exr
  prpf render scene.pbrt --spp 4096 --state s.state --resume   # go on, or start
  prpf render scene.pbrt --spp 64 --sample-map counts.exr  # by a map of ratios

Several budgets may be given: the first one reached ends the render; 0 means off. The clock of --time \
counts everything: loading, building, the last filter pass and writing. Ctrl-C (or SIGTERM, SIGHUP) finishes \
the batch being rendered if that takes no more than a second, else a step of it, writes the image (and the \
--state) and exits 130; Ctrl-C after that quits at once. Built with the feature `mpi` and started by mpirun or srun, several processes \
render one image together (docs/cluster.md).")]
pub(super) struct RenderOptions {
    /// Scene in pbrt's format
    pub scene: PathBuf,
    /// Output, .exr (all layers) or .png; may be given twice [default: the scene's, else SCENE.exr]
    #[arg(short, long, value_name = "FILE")]
    pub outfile: Vec<PathBuf>,
    /// Budget: samples per pixel, on average over the image [default: the scene's, if there is no other budget]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub spp: Option<u32>,
    /// Budget: wall time of the whole command, e.g. 20s, 5m, 1h30m
    #[arg(long, value_name = "DURATION", value_parser = parse::duration, allow_hyphen_values = true)]
    pub time: Option<f64>,
    /// Budget: stop when the image's estimated relMSE falls to this
    #[arg(long, value_name = "E", value_parser = parse::non_negative, allow_negative_numbers = true)]
    pub target_error: Option<f64>,
    /// How samples are spread over the pixels [default: adaptive]
    #[arg(long, value_enum)]
    pub sampling: Option<SamplingOption>,
    #[command(flatten)]
    pub sample_map: SampleMapOptions,
    #[command(flatten)]
    pub denoiser: DenoiserOptions,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub seed: u64,
    /// Worker threads [default: all cores]
    #[arg(long, visible_alias = "nthreads", value_name = "N", value_parser = parse::threads, allow_negative_numbers = true)]
    pub threads: Option<std::num::NonZeroUsize>,
    /// Floor per pixel for adaptive allocation [default: 4, or the ceiling if that is lower]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub min_spp: Option<u32>,
    /// Ceiling per pixel for adaptive allocation
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub max_spp: Option<u32>,
    /// Override the film's resolution
    #[arg(long, value_name = "WxH", value_parser = parse::resolution)]
    pub resolution: Option<[usize; 2]>,
    /// Override the part of the film that is rendered: pixels, half open
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = parse::bounds, allow_hyphen_values = true)]
    pub pixelbounds: Option<[usize; 4]>,
    /// Camera in place of the scene's: a file with directives such as LookAt and Camera, as the live page gives them
    #[arg(long, value_name = "FILE")]
    pub camera: Option<PathBuf>,
    /// Override the integrator's path depth
    #[arg(
        long,
        value_name = "N",
        value_parser = value_parser!(u32).range(..=i64::from(MAX_DEPTH)),
        allow_negative_numbers = true
    )]
    pub max_depth: Option<u32>,
    /// Only these layers of an EXR beside the image, e.g. Albedo,Ns [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub layers: Option<Vec<String>>,
    /// Write every sample vector of this run, in pieces of a numpy archive; the size is printed before it starts
    #[arg(long, value_name = "FILE.npz")]
    pub samples: Option<PathBuf>,
    /// Write a machine-readable report
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Also report the true error after every filter pass
    #[arg(long, value_name = "FILE.exr")]
    pub reference: Option<PathBuf>,
    /// Weights of the maps that place adaptive samples, e.g. interpolation-failure=0,residual=1; also
    /// filtered-variance, raw-variance
    #[arg(long, value_name = "MAP=WEIGHT,...", value_parser = parse::drive, default_value = "")]
    pub drive: PrioritySettings,
    /// Print the events of one path and render nothing: pixel of the rendered image, index of the sample
    #[arg(long, value_name = "X,Y,INDEX", value_parser = parse::sample)]
    pub debug_sample: Option<DebugSample>,
    /// Serve a live page while rendering; with an address, for everyone who has its token [default: this
    /// machine only]
    #[arg(long, visible_alias = "listen", value_name = "ADDR:PORT", num_args = 0..=1, value_parser = parse::address)]
    pub preview: Option<Option<SocketAddr>>,
    /// Also send the image to a running tev viewer as it converges
    #[arg(long, visible_alias = "tev", value_name = "HOST:PORT", value_parser = parse::host)]
    pub display_server: Option<String>,
    #[command(flatten)]
    pub state: StateOptions,
    /// No progress bar, no summary, no warnings
    #[arg(long)]
    pub quiet: bool,
    /// Print every warning of the scene reader and every batch
    #[arg(short, long)]
    pub verbose: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum SamplingOption {
    Uniform,
    Adaptive,
}

impl RenderOptions {
    /// Checks that the options do not contradict each other.
    ///
    /// # Errors
    /// A ceiling per pixel below the floor or below the budget, a floor above the budget, an unknown denoiser, a sample map
    /// beside something else that places samples.
    pub fn check(&self) -> anyhow::Result<()> {
        self.denoiser.choose(DEFAULT)?;
        if self.sample_map.sample_map.is_some() && self.sampling == Some(SamplingOption::Adaptive) {
            anyhow::bail!("--sampling adaptive: found with --sample-map; accepted is one of them");
        }
        if let (Some(spp), true) = (self.spp.filter(|&spp| spp > 0), self.sample_map.is_budget()) {
            anyhow::bail!(
                "--spp {spp}: found with --sample-map-values absolute, which gives the number of samples; accepted is \
                 one of them"
            );
        }
        if let Some(path) = &self.samples
            && !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npz"))
        {
            anyhow::bail!("--samples {}: unknown extension; accepted is .npz", path.display());
        }
        if self.samples.is_some() && (self.preview.is_some() || self.display_server.is_some()) {
            anyhow::bail!("--samples: found with --preview or --display-server; accepted is one of them");
        }
        if let (Some(floor), Some(spp)) = (self.min_spp, self.spp.filter(|&spp| spp > 0))
            && floor > spp
        {
            anyhow::bail!("--min-spp {floor}: found more than --spp {spp}; accepted is at most that");
        }
        if let Some(floor) = self.min_spp.filter(|&floor| floor > NO_CEILING) {
            anyhow::bail!("--min-spp {floor}: accepted is a number up to {NO_CEILING}");
        }
        let Some(max_spp) = self.max_spp.filter(|&n| n > 0) else { return Ok(()) };
        for (name, spp) in [("--min-spp", self.min_spp), ("--spp", self.spp)] {
            if let Some(spp) = spp.filter(|&spp| spp > max_spp) {
                anyhow::bail!("{name} {spp}: found more than --max-spp {max_spp}; accepted is at most that");
            }
        }
        Ok(())
    }

    /// Returns the settings of the render loop.
    ///
    /// # Errors
    /// An unknown denoiser; a floor per pixel above the scene's own budget, or above any ceiling.
    pub fn settings(&self, scene: &Scene, processes: usize) -> anyhow::Result<Settings> {
        let on = |value: Option<f64>| value.filter(|&v| v > 0.0);
        let (seconds, target_error) = (on(self.time), on(self.target_error));
        let spp = match self.spp.filter(|&spp| spp > 0) {
            None if seconds.is_none() && target_error.is_none() && !self.sample_map.is_budget() => {
                Some(scene.spp)
            }
            spp => spp,
        };
        let max_spp = self.max_spp.filter(|&n| n > 0).unwrap_or(NO_CEILING);
        let budget = Budget { spp, seconds, target_error };
        let [x0, x1, y0, y1] = scene.film.pixel_bounds;
        let pixels = (x1 - x0) * (y1 - y0);
        if let (Some(floor), Some(spp)) = (self.min_spp, spp)
            && floor > spp
        {
            anyhow::bail!(
                "--min-spp {floor}: found more than the scene's {spp} samples per pixel; accepted is at most that"
            );
        }
        let settings = Settings {
            budget,
            sampling: match self.sampling {
                Some(SamplingOption::Uniform) => Sampling::Uniform,
                None if self.sample_map.sample_map.is_some() => Sampling::Uniform,
                None | Some(SamplingOption::Adaptive) => Sampling::Adaptive,
            },
            sample_map: None,
            denoiser: self.denoiser.choose(default_denoiser(&budget, pixels, processes))?,
            seed: self.seed,
            min_spp: self.min_spp.unwrap_or(MIN_SPP.min(max_spp)),
            max_spp,
            priority: self.drive,
            reservoir: self.state.reservoir,
            statistics: self.state.statistics.into(),
        };
        settings.validate()?;
        Ok(settings)
    }

    /// Returns the options for another scene: those that name files of this one, or parts of its image, are left out.
    pub fn for_scene(&self, scene: PathBuf) -> Self {
        let state = StateOptions { state: None, resume: false, ..self.state.clone() };
        let sample_map = SampleMapOptions { sample_map: None, ..self.sample_map.clone() };
        Self {
            scene,
            outfile: Vec::new(),
            report: None,
            samples: None,
            reference: None,
            camera: None,
            pixelbounds: None,
            state,
            sample_map,
            ..self.clone()
        }
    }

    /// Applies the overrides to a scene.
    ///
    /// # Errors
    /// Pixel bounds outside the film.
    pub fn apply(&self, scene: &mut Scene) -> anyhow::Result<()> {
        if let Some([width, height]) = self.resolution {
            scene.resize_film(width, height);
        }
        if let Some([x0, x1, y0, y1]) = self.pixelbounds {
            let (width, height) = (scene.film.width, scene.film.height);
            if x0 >= x1 || y0 >= y1 || x1 > width || y1 > height {
                anyhow::bail!(
                    "--pixelbounds {x0},{x1},{y0},{y1}: found bounds that are empty or outside the film; \
                     accepted are 0 <= X0 < X1 <= {width} and 0 <= Y0 < Y1 <= {height}"
                );
            }
            scene.film.pixel_bounds = [x0, x1, y0, y1];
        }
        if let Some(depth) = self.max_depth {
            scene.integrator = scene.integrator.with_max_depth(depth);
        }
        Ok(())
    }
}
