//! Lists filters with changed settings, each with a name that states the changes.

use prpf::filter::prpf::RESERVOIR;
use prpf::filter::{self, Denoiser, FilterResult, NlmSettings, PrpfSettings, learned, nlm};
use prpf::stats::Store;
use serde::Deserialize;

/// Changes to the settings of `nlm`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NlmChanges {
    pub radius: Option<usize>,
    pub fit_radius: Option<usize>,
    pub feature_radius: Option<usize>,
}

/// Changes to the settings of `prpf`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrpfChanges {
    pub windows: Option<Vec<usize>>,
    pub grid_spacing: Option<usize>,
    pub upsampling: Option<bool>,
    pub mi_samples: Option<usize>,
    pub statistics_side: Option<usize>,
    /// Capacity of a pixel's reservoir, in sample vectors.
    pub reservoir: Option<usize>,
}

/// The method of a variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    Unfiltered,
    Learned,
    LearnedDraft,
    Nlm,
    Prpf,
}

/// Names of the filters with the program's own settings.
pub const PRESETS: [&str; 5] = ["learned", "learned, draft", NLM, "nlm, draft", "prpf"];

/// The one that others are compared with.
pub const NLM: &str = "nlm";

/// A filter with its settings.
#[derive(Clone, Debug)]
pub struct FilterVariant {
    pub name: String,
    pub method: Method,
    /// Capacity of a pixel's reservoir, in sample vectors.
    pub reservoir: usize,
    nlm: NlmSettings,
    prpf: PrpfSettings,
}

impl FilterVariant {
    fn new(name: &str, method: Method) -> Self {
        Self {
            name: name.to_owned(),
            method,
            nlm: NlmSettings::standard(),
            prpf: PrpfSettings::paper(),
            reservoir: RESERVOIR,
        }
    }

    /// The unfiltered image, the presets, and the presets with changes.
    pub fn list(nlm_changes: &[NlmChanges], prpf_changes: &[PrpfChanges]) -> Vec<Self> {
        let [learned, learned_draft, nlm, draft, prpf] = PRESETS;
        let mut variants = vec![
            Self::new("unfiltered", Method::Unfiltered),
            Self::new(learned, Method::Learned),
            Self::new(learned_draft, Method::LearnedDraft),
            Self::new(nlm, Method::Nlm),
            Self { nlm: NlmSettings::draft(), ..Self::new(draft, Method::Nlm) },
            Self::new(prpf, Method::Prpf),
        ];
        variants.extend(nlm_changes.iter().map(|changes| changes.apply(Self::new(nlm, Method::Nlm))));
        variants.extend(prpf_changes.iter().map(|changes| changes.apply(Self::new(prpf, Method::Prpf))));
        variants
    }

    /// Filters a store. `seed` selects the samples of random estimates.
    pub fn filter(&self, store: &Store, seed: u64) -> FilterResult {
        match self.method {
            Method::Unfiltered => filter::unfiltered(store),
            Method::Learned => learned::STANDARD.filter(store, seed),
            Method::LearnedDraft => learned::DRAFT.filter(store, seed),
            Method::Nlm => nlm::filter(store, &self.nlm),
            Method::Prpf => filter::prpf::filter(store, &self.prpf, seed),
        }
    }
}

impl NlmChanges {
    fn apply(&self, mut variant: FilterVariant) -> FilterVariant {
        let FilterVariant { name, nlm, .. } = &mut variant;
        set(name, "radius", &self.radius, &mut nlm.radius);
        set(name, "fit", &self.fit_radius, &mut nlm.fit_radius);
        set(name, "features", &self.feature_radius, &mut nlm.feature_radius);
        variant
    }
}

impl PrpfChanges {
    fn apply(&self, mut variant: FilterVariant) -> FilterVariant {
        let FilterVariant { name, prpf, reservoir, .. } = &mut variant;
        set(name, "windows", &self.windows, &mut prpf.windows);
        set(name, "grid spacing", &self.grid_spacing, &mut prpf.grid_spacing);
        set(name, "upsampling", &self.upsampling, &mut prpf.upsampling);
        set(name, "samples of mutual information", &self.mi_samples, &mut prpf.mi_samples);
        set(name, "statistics side", &self.statistics_side, &mut prpf.statistics_side);
        set(name, "reservoir", &self.reservoir, reservoir);
        variant
    }
}

/// Changes a setting if a value is given, and appends the change to the name.
fn set<T: Clone + std::fmt::Debug>(name: &mut String, label: &str, value: &Option<T>, setting: &mut T) {
    if let Some(value) = value {
        *setting = value.clone();
        name.push_str(&format!(", {label} {value:?}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_are_named_after_their_changes() {
        let nlm = NlmChanges { radius: Some(3), fit_radius: Some(0), ..NlmChanges::default() };
        let prpf = PrpfChanges { reservoir: Some(4), ..PrpfChanges::default() };
        let variants = FilterVariant::list(&[nlm], &[prpf]);
        let names: Vec<&str> = variants.iter().map(|variant| variant.name.as_str()).collect();
        assert_eq!((names[0], &names[1..6]), ("unfiltered", PRESETS.as_slice()));
        assert_eq!(names[6..], ["nlm, radius 3, fit 0", "prpf, reservoir 4"]);
        assert_eq!((variants[6].nlm.radius, variants[6].nlm.fit_radius), (3, 0));
        assert_eq!(variants[7].reservoir, 4);
        assert_eq!(variants[5].reservoir, RESERVOIR);
    }
}
