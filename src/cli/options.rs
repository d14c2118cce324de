//! Options of `render`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::state::StateOptions;
use crate::adaptive::{PrioritySettings, Sampling};
use crate::filter::Quality;
use crate::progressive::{Budget, Denoiser, MIN_SPP, NO_CEILING, Settings};
use crate::scene::film::{MAX_PIXELS, MAX_SIDE};
use crate::scene::{Integrator, Scene};

/// `prpf render`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  prpf render scenes/pool/pool.pbrt -o pool.png --spp 16
  prpf render scene.pbrt --time 30s -o out.exr -o out.png --report out.json
  prpf render scene.pbrt --sampling uniform --denoiser none --spp 1024 -o reference.exr
  prpf render scene.pbrt --spp 4096 --state scene.state --resume      go on wherever it was stopped

Several budgets may be given: the first one reached ends the render; 0 means off. The clock of --time
counts everything: loading, building, the last filter pass and writing. Ctrl-C (or SIGTERM) finishes the
batch being rendered if that takes no more than a second, else a step of it, writes the image (and the
--state) and exits 130; a second one quits at once.")]
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
    #[arg(long, value_name = "DURATION", value_parser = parse_duration, allow_hyphen_values = true)]
    pub time: Option<f64>,
    /// Budget: stop when the image's estimated relMSE falls to this
    #[arg(long, value_name = "E", value_parser = parse_positive, allow_negative_numbers = true)]
    pub target_error: Option<f64>,
    /// How a batch is spread over the pixels
    #[arg(long, value_enum, default_value_t = SamplingOption::Adaptive)]
    pub sampling: SamplingOption,
    /// The reconstruction
    #[arg(long, value_enum, default_value_t = DenoiserOption::Prpf)]
    pub denoiser: DenoiserOption,
    /// Filter effort; `paper` is the published method. Of no effect with `--denoiser rpf`
    #[arg(long, value_enum, default_value_t = Quality::Standard)]
    pub quality: Quality,
    /// Everything random follows from it
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub seed: u64,
    /// Worker threads [default: all cores]
    #[arg(long, visible_alias = "nthreads", value_name = "N", value_parser = super::parse_threads, allow_negative_numbers = true)]
    pub threads: Option<std::num::NonZeroUsize>,
    /// Floor per pixel for adaptive allocation [default: 4, or the ceiling if that is lower]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub min_spp: Option<u32>,
    /// Ceiling per pixel for adaptive allocation
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub max_spp: Option<u32>,
    /// Override the film's resolution
    #[arg(long, value_name = "WxH", value_parser = parse_resolution)]
    pub resolution: Option<[usize; 2]>,
    /// Override the part of the film that is rendered: pixels, half open
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = parse_bounds, allow_hyphen_values = true)]
    pub pixelbounds: Option<[usize; 4]>,
    /// Override the integrator's path depth
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub max_depth: Option<u32>,
    /// Write a machine-readable account
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Also report the true error after every batch
    #[arg(long, value_name = "FILE.exr")]
    pub reference: Option<PathBuf>,
    /// Weights of what drives adaptive samples, e.g. interpolation-failure=0,residual=1; also
    /// filtered-variance, raw-variance
    #[arg(long, value_name = "MAP=WEIGHT,...", value_parser = parse_drive, default_value = "")]
    pub drive: PrioritySettings,
    /// Serve a live page while rendering; at an address, for whoever has its token [default: this
    /// machine only]
    #[arg(long, visible_alias = "listen", value_name = "ADDR:PORT", num_args = 0..=1, value_parser = parse_address)]
    pub preview: Option<Option<SocketAddr>>,
    /// Also send the image to a running tev viewer as it converges
    #[arg(long, visible_alias = "tev", value_name = "HOST:PORT", value_parser = parse_host)]
    pub display_server: Option<String>,
    #[command(flatten)]
    pub state: StateOptions,
    /// No progress bar, no summary
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum DenoiserOption {
    /// The mean of the samples
    None,
    /// What --quality says
    Prpf,
    /// Random parameter filtering, its slow predecessor: for comparison
    Rpf,
}

impl From<DenoiserOption> for Denoiser {
    fn from(option: DenoiserOption) -> Self {
        match option {
            DenoiserOption::None => Self::None,
            DenoiserOption::Prpf => Self::Prpf,
            DenoiserOption::Rpf => Self::Rpf,
        }
    }
}

impl RenderOptions {
    /// Whether the options suit each other.
    ///
    /// # Errors
    /// A ceiling per pixel below the floor, or below what the budget asks for on average; a floor above that.
    pub fn check(&self) -> anyhow::Result<()> {
        if let (Some(floor), Some(spp)) = (self.min_spp, self.spp.filter(|&spp| spp > 0))
            && floor > spp
        {
            anyhow::bail!("--min-spp {floor}: found more than --spp {spp}; accepted is at most that");
        }
        let Some(max_spp) = self.max_spp.filter(|&n| n > 0) else { return Ok(()) };
        for (name, spp) in [("--min-spp", self.min_spp), ("--spp", self.spp)] {
            if let Some(spp) = spp.filter(|&spp| spp > max_spp) {
                anyhow::bail!("{name} {spp}: found more than --max-spp {max_spp}; accepted is at most that");
            }
        }
        Ok(())
    }

    /// What the loop follows.
    pub fn settings(&self, scene: &Scene) -> Settings {
        let on = |value: Option<f64>| value.filter(|&v| v > 0.0);
        let (seconds, target_error) = (on(self.time), on(self.target_error));
        let spp = match self.spp.filter(|&spp| spp > 0) {
            None if seconds.is_none() && target_error.is_none() => Some(scene.spp),
            spp => spp,
        };
        let max_spp = self.max_spp.filter(|&n| n > 0).unwrap_or(NO_CEILING);
        Settings {
            budget: Budget { spp, seconds, target_error },
            sampling: match self.sampling {
                SamplingOption::Uniform => Sampling::Uniform,
                SamplingOption::Adaptive => Sampling::Adaptive,
            },
            denoiser: self.denoiser.into(),
            quality: self.quality,
            seed: self.seed,
            min_spp: self.min_spp.unwrap_or(MIN_SPP.min(max_spp)),
            max_spp,
            priority: self.drive,
            reservoir: self.state.reservoir,
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
            scene.integrator = match scene.integrator {
                Integrator::Path { .. } => Integrator::Path { max_depth: depth },
                Integrator::Direct { .. } => Integrator::Direct { max_depth: depth },
            };
        }
        Ok(())
    }
}

/// `90`, `20s`, `5m`, `1h30m`, `1.5m`, `500ms` to seconds.
pub(super) fn parse_duration(text: &str) -> Result<f64, String> {
    let error = || format!("found `{text}`; accepted are durations such as 20s, 5m, 1h30m, 500ms");
    let mut seconds = 0.0;
    let mut rest = text.trim();
    if rest.is_empty() {
        return Err(error());
    }
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let value: f64 = rest[..digits].parse().map_err(|_| error())?;
        rest = &rest[digits..];
        let unit = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let factor = match &rest[..unit] {
            "ms" => 1e-3,
            "s" | "" => 1.0,
            "m" | "min" => 60.0,
            "h" => 3600.0,
            _ => return Err(error()),
        };
        seconds += value * factor;
        rest = &rest[unit..];
    }
    if seconds.is_finite() { Ok(seconds) } else { Err(error()) }
}

fn parse_positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!("found `{text}`; accepted are numbers from 0 (off) up")),
    }
}

fn parse_resolution(text: &str) -> Result<[usize; 2], String> {
    let sides: Option<[u32; 2]> =
        text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    // Whether these fit in memory is checked before they are allocated.
    let fits = |&[w, h]: &[u32; 2]| {
        [w, h].iter().all(|side| (1..=MAX_SIDE).contains(side)) && u64::from(w) * u64::from(h) <= MAX_PIXELS
    };
    sides.filter(fits).map(|sides| sides.map(|side| side as usize)).ok_or_else(|| {
        format!(
            "found `{text}`; accepted is WIDTHxHEIGHT with sides from 1 to {MAX_SIDE} and at most {MAX_PIXELS} \
             pixels, e.g. 640x480"
        )
    })
}

fn parse_bounds(text: &str) -> Result<[usize; 4], String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    numbers
        .and_then(|n| n.try_into().ok())
        .ok_or_else(|| format!("found `{text}`; accepted are four whole numbers X0,X1,Y0,Y1"))
}

fn parse_address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| {
        format!("found `{text}`; accepted is ADDR:PORT, e.g. 0.0.0.0:8080 (the scene goes before --preview)")
    })
}

fn parse_host(text: &str) -> Result<String, String> {
    match text.rsplit_once(':') {
        Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => Ok(text.to_owned()),
        _ => Err(format!("found `{text}`; accepted is HOST:PORT, e.g. localhost:14158")),
    }
}

fn parse_drive(text: &str) -> Result<PrioritySettings, String> {
    let mut settings = PrioritySettings::default();
    for item in text.split(',').filter(|item| !item.is_empty()) {
        let error = || {
            format!(
                "found `{item}`; accepted are filtered-variance, raw-variance, interpolation-failure and residual, \
                 each =WEIGHT from 0 up"
            )
        };
        let (map, weight) = item.split_once('=').ok_or_else(error)?;
        let weight: f32 =
            weight.parse().ok().filter(|w: &f32| *w >= 0.0 && w.is_finite()).ok_or_else(error)?;
        match map {
            "filtered-variance" => settings.filtered_variance = weight,
            "raw-variance" => settings.raw_variance = weight,
            "interpolation-failure" => settings.interpolation_failure = weight,
            "residual" => settings.residual = weight,
            _ => return Err(error()),
        }
    }
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_as_people_write_them() {
        for (text, seconds) in
            [("20s", 20.0), ("5m", 300.0), ("1h30m", 5400.0), ("0.5m", 30.0), ("500ms", 0.5), ("7", 7.0)]
        {
            assert_eq!(parse_duration(text), Ok(seconds), "{text}");
        }
        for text in ["", "s", "5x", "-3s", "1..2s", "ten"] {
            assert!(parse_duration(text).unwrap_err().contains("20s"), "{text}");
        }
    }

    #[test]
    fn resolutions_and_bounds_are_checked() {
        assert_eq!(parse_resolution("640x480"), Ok([640, 480]));
        assert!(
            parse_resolution("640").is_err()
                && parse_resolution("0x5").is_err()
                && parse_resolution("9x99999999").is_err()
        );
        assert_eq!(parse_bounds("0,10,5,20"), Ok([0, 10, 5, 20]));
        assert!(parse_bounds("1,2,3").is_err());
    }

    #[test]
    fn drive_weights_change_what_they_name() {
        let drive = parse_drive("residual=0,filtered-variance=2").unwrap();
        assert_eq!((drive.residual, drive.filtered_variance), (0.0, 2.0));
        assert_eq!(drive.raw_variance, PrioritySettings::default().raw_variance);
        assert!(parse_drive("colour=1").is_err() && parse_drive("residual=-1").is_err());
    }
}
