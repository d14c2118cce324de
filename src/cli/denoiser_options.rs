//! The options that choose a denoiser.

use std::path::PathBuf;

use anyhow::{anyhow, bail};
use clap::Args;
use clap::builder::PossibleValue;

use crate::filter::learned::use_weights;
use crate::filter::{DEFAULT, DENOISERS, Denoiser, find, presets};

#[derive(Clone, Args)]
pub(super) struct DenoiserOptions {
    /// The denoiser [default: learned; its draft or nlm where a time budget or memory is short; of `denoise`: the render's, of images learned; of `allocate`: nlm draft]
    #[arg(long, value_name = "NAME", value_parser = methods())]
    denoiser: Option<String>,
    /// Preset of the denoiser, e.g. draft; without --denoiser of the default, if it has this preset [default: its first]
    #[arg(long, value_name = "PRESET")]
    quality: Option<String>,
    /// Weights of --denoiser learned, as training/export.py writes them [default: those of this version]
    #[arg(long, value_name = "FILE")]
    pub(super) weights: Option<PathBuf>,
}

/// Returns the values of `--denoiser`.
fn methods() -> Vec<PossibleValue> {
    let mut methods: Vec<PossibleValue> = Vec::new();
    for denoiser in DENOISERS {
        let name = denoiser.name().method;
        if methods.last().is_none_or(|last| last.get_name() != name) {
            methods.push(PossibleValue::new(name).help(denoiser.summary()));
        }
    }
    methods
}

/// Returns the methods that have presets, for a message.
fn methods_with_presets() -> String {
    let methods = methods();
    let names = methods.iter().map(PossibleValue::get_name).filter(|name| !presets(name).is_empty());
    names.collect::<Vec<_>>().join(", ")
}

/// Returns the method that a preset alone means: the default's, or the first one that has the preset if the default's has not.
fn method_with_preset(preset: &str, default: &dyn Denoiser) -> &'static str {
    let default = default.name().method;
    let mut methods = std::iter::once(default).chain(DENOISERS.map(|denoiser| denoiser.name().method));
    methods.find(|method| presets(method).contains(&preset)).unwrap_or(default)
}

impl DenoiserOptions {
    /// Returns the chosen denoiser; `default` if none is chosen.
    ///
    /// # Errors
    /// A preset that the denoiser does not have; a denoiser that this machine lacks; a wrong file of weights. A spelling of
    /// an earlier version gets the new one.
    pub fn choose(&self, default: &'static dyn Denoiser) -> anyhow::Result<&'static dyn Denoiser> {
        // Weights are those of `learned`
        let default = if self.weights.is_some() { DEFAULT } else { default };
        let denoiser = self.find(default)?;
        if let Some(path) = &self.weights {
            use_weights(path).map_err(|error| anyhow!("--weights {}: {error}", path.display()))?;
            if denoiser.weights().is_none() {
                bail!(
                    "--weights: found with the denoiser {}; accepted with --denoiser learned",
                    denoiser.name()
                );
            }
        }
        match denoiser.missing() {
            Some(reason) => bail!("--denoiser {}: {reason}", denoiser.name().method),
            None => Ok(denoiser),
        }
    }

    fn find(&self, default: &'static dyn Denoiser) -> anyhow::Result<&'static dyn Denoiser> {
        let Some(quality) = self.quality.as_deref() else {
            let chosen = self.denoiser.as_deref().and_then(|method| find(method, None));
            return Ok(chosen.unwrap_or(default));
        };
        let method = self.denoiser.as_deref().unwrap_or_else(|| method_with_preset(quality, default));
        if let Some(found) = find(method, Some(quality)) {
            return Ok(found);
        }
        match presets(method)[..] {
            _ if quality == "paper" => bail!("--quality paper: this is `--denoiser prpf` now"),
            _ if method == "prpf" && presets("nlm").contains(&quality) => bail!(
                "--denoiser prpf --quality {quality}: this is `--denoiser nlm --quality {quality}` now; `--denoiser prpf` \
                 is the published method"
            ),
            [] => bail!(
                "--quality {quality}: found with --denoiser {method}, which has no presets; accepted with {}",
                methods_with_presets()
            ),
            ref presets => bail!("--quality: found `{quality}`; accepted are {}", presets.join(" and ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preset_alone_chooses_its_method() {
        let options = DenoiserOptions { denoiser: None, quality: Some("draft".to_owned()), weights: None };
        for (default, name) in [
            ("none", "learned draft"),
            ("prpf", "learned draft"),
            ("nlm", "nlm draft"),
            ("learned", "learned draft"),
        ] {
            let chosen = options.choose(find(default, None).unwrap()).unwrap();
            assert_eq!(chosen.name().to_string(), name, "default {default}");
        }
    }

    fn choose(denoiser: Option<&str>, quality: Option<&str>) -> Result<String, String> {
        let [denoiser, quality] = [denoiser, quality].map(|text| text.map(str::to_owned));
        let options = DenoiserOptions { denoiser, quality, weights: None };
        options.choose(DEFAULT).map(|found| found.name().to_string()).map_err(|error| error.to_string())
    }

    #[test]
    fn denoisers_and_presets_are_chosen_by_their_names() {
        for (denoiser, quality, name) in [
            (None, None, "learned standard"),
            (None, Some("draft"), "learned draft"),
            (Some("nlm"), None, "nlm standard"),
            (Some("prpf"), None, "prpf"),
            (Some("prpf"), Some("interim"), "prpf interim"),
            (Some("none"), None, "none"),
        ] {
            assert_eq!(choose(denoiser, quality).as_deref(), Ok(name));
        }
        assert!(choose(Some("rpf"), Some("draft")).is_err_and(|error| error.contains("no presets")));
        assert!(choose(None, Some("best")).is_err_and(|error| error.contains("draft")));
    }

    #[test]
    fn earlier_spellings_get_the_new_one() {
        let error = |denoiser, quality| choose(denoiser, Some(quality)).unwrap_err();
        assert!(error(Some("prpf"), "standard").contains("`--denoiser nlm --quality standard` now"));
        assert!(error(Some("prpf"), "paper").contains("`--denoiser prpf` now"));
        assert!(error(None, "paper").contains("`--denoiser prpf` now"));
    }
}
