//! What is compared, and the other readings of what the papers leave open.

use prpf::filter::rpf::SpikeSettings;
use prpf::filter::{
    self, Filtered, Gain, OutlierSettings, PrpfSettings, Quality, RpfSettings, prpf as pixelwise, rpf,
};
use prpf::image::Planes;
use prpf::stats::Store;

use super::clock::Clock;
use crate::ledger::Values;
use crate::report::median;
use crate::sampling::timed;

/// A way from samples to an image.
#[derive(Clone, Debug)]
pub enum Method {
    Unfiltered,
    /// The published method.
    Prpf(PrpfSettings),
    /// The default quality.
    Standard,
    /// Random parameter filtering.
    Rpf(RpfSettings),
}

impl Method {
    /// Whole sample vectors that it needs of a pixel with `spp` samples.
    pub fn capacity(&self, spp: u32) -> usize {
        match self {
            Method::Unfiltered | Method::Standard => 0,
            Method::Prpf(_) => prpf::progressive::RESERVOIR,
            Method::Rpf(_) => spp as usize,
        }
    }

    /// The image, and the median of the seconds that it took in so many runs, with the shares of its stages
    /// where it has the paper's.
    pub fn run(&self, store: &Store, seed: u64, repeats: usize) -> (Planes, Values) {
        let mut seconds = Vec::new();
        let clock = Clock::default();
        let mut filtered = None;
        let repeats = if matches!(self, Method::Rpf(_)) { 1 } else { repeats.max(1) };
        for _ in 0..repeats {
            let (result, time) = timed(|| self.filter(store, seed, &clock));
            seconds.push(time);
            filtered = Some(result);
        }
        let Filtered { image, interpolation_success, .. } = filtered.expect("at least one run");
        let mut values = Values::from([("seconds".to_owned(), median(seconds))]);
        if let Some(share) = interpolation_success {
            values.insert("interpolated".to_owned(), f64::from(share));
        }
        if matches!(self, Method::Prpf(_) | Method::Rpf(_)) {
            for (name, share) in STAGES.iter().zip(clock.shares()) {
                values.insert((*name).to_owned(), share);
            }
            values.insert("weight seconds".to_owned(), clock.weight_seconds() / repeats as f64);
        }
        (image, values)
    }

    fn filter(&self, store: &Store, seed: u64, clock: &Clock) -> Filtered {
        let observe = |stage| clock.observe(stage);
        match self {
            Method::Unfiltered => filter::unfiltered(store),
            Method::Standard => filter::filter(store, Quality::Standard, seed),
            Method::Prpf(settings) => pixelwise::filter_observed(store, settings, seed, &observe),
            Method::Rpf(settings) => rpf::filter_observed(store, settings, seed, &observe),
        }
    }
}

/// Names of the shares of time.
pub const STAGES: [&str; 3] = ["neighbourhoods", "weights", "filtering"];

/// P-RPF as published.
pub fn published(sigma8_squared: f32) -> PrpfSettings {
    PrpfSettings { gain: Gain::RpfSigma { sigma8_squared }, ..PrpfSettings::paper() }
}

/// Random parameter filtering as published.
pub fn published_rpf(sigma8_squared: f32) -> RpfSettings {
    RpfSettings { sigma8_squared, ..RpfSettings::report() }
}

/// Names of readings that explain claims.
pub const ALL_PIXELS: &str = "P-RPF, statistics of all pixels of a window";
pub const RELEASE: &str = "RPF, the authors' code of 2015";

/// Other readings of both methods: a name, and the method.
pub fn readings(sigma8_squared: f32) -> Vec<(&'static str, Method)> {
    let (few, many) = (0.002, 0.02);
    let other = if sigma8_squared > few { few } else { many };
    let base = published(sigma8_squared);
    let whole_window = base.windows.iter().copied().max().unwrap_or(1);
    let own_variance = Gain::OwnVariance { kappa: 8.0, rho: 1e-3 };
    let prpf = |settings| Method::Prpf(settings);
    let base_rpf = published_rpf(sigma8_squared);
    let spikes = base_rpf.spikes;
    vec![
        ("P-RPF, the other σ₈² (0.002 or 0.02)", prpf(published(other))),
        (
            "P-RPF, Eq. 4 by the variance of the pixel's mean",
            prpf(PrpfSettings { gain: own_variance, ..base.clone() }),
        ),
        (ALL_PIXELS, prpf(PrpfSettings { statistics_side: whole_window, ..base.clone() })),
        (
            "P-RPF, mutual information of at most 512 samples",
            prpf(PrpfSettings { mi_samples: 512, ..base.clone() }),
        ),
        (
            "P-RPF, mutual information of at most 8192 samples",
            prpf(PrpfSettings { mi_samples: 8192, ..base.clone() }),
        ),
        ("P-RPF, outliers left", prpf(PrpfSettings { outliers: OutlierSettings::off(), ..base.clone() })),
        ("P-RPF, positions up to 50 deviations apart", prpf(PrpfSettings { z_world: 50.0, ..base })),
        ("RPF, the other σ₈² (0.002 or 0.02)", Method::Rpf(published_rpf(other))),
        (
            "RPF, the energy of spikes kept",
            Method::Rpf(RpfSettings {
                spikes: SpikeSettings { keep_energy: true, ..spikes },
                ..base_rpf.clone()
            }),
        ),
        (RELEASE, Method::Rpf(RpfSettings::release())),
        (
            "RPF, the code of Lehtinen et al. 2012",
            Method::Rpf(RpfSettings { sigma8_squared, ..RpfSettings::lehtinen() }),
        ),
    ]
}
