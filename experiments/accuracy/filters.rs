//! One store, filtered with different settings: what each costs, and what error it leaves.

use anyhow::Context;
use prpf::filter::{self, Filtered, PrpfSettings, StandardSettings, standard};
use prpf::geometry::Accel;
use prpf::progressive::RESERVOIR;
use prpf::render::Renderer;
use prpf::stats::Store;
use serde::Deserialize;

use crate::bench::Bench;
use crate::ledger::{Key, values};
use crate::report::median;
use crate::sampling;
use crate::trial::Bed;

/// Table `filters` of `accuracy.toml`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    pub spp: u32,
    pub seeds: u64,
    repeats: usize,
    standard: Vec<OfStandard>,
    paper: Vec<OfPaper>,
}

/// What is changed of `standard`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct OfStandard {
    radius: Option<usize>,
    fit_radius: Option<usize>,
    feature_radius: Option<usize>,
}

/// What is changed of `paper`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct OfPaper {
    windows: Option<Vec<usize>>,
    grid_spacing: Option<usize>,
    upsampling: Option<bool>,
    mi_samples: Option<usize>,
    statistics_side: Option<usize>,
    /// Sample vectors kept per pixel.
    reservoir: Option<usize>,
}

/// Which filter a choice is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    Unfiltered,
    Standard,
    Paper,
}

/// The qualities that the program has, by their names.
pub const QUALITIES: [&str; 3] = ["draft", "standard", "paper"];

/// A filter with its settings.
#[derive(Clone, Debug)]
pub struct Choice {
    pub name: String,
    pub family: Family,
    standard: StandardSettings,
    paper: PrpfSettings,
    reservoir: usize,
}

/// A choice's cost and error on one scene.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// Seconds per million pixels.
    pub seconds: f64,
    pub error: f64,
}

impl Settings {
    /// The unfiltered image, the program's qualities, and what is listed.
    pub fn choices(&self) -> Vec<Choice> {
        let choice = |name: &str, family| Choice {
            name: name.to_owned(),
            family,
            standard: StandardSettings::standard(),
            paper: PrpfSettings::paper(),
            reservoir: RESERVOIR,
        };
        let [draft, standard, paper] = QUALITIES;
        let mut choices = vec![
            choice("unfiltered", Family::Unfiltered),
            Choice { standard: StandardSettings::draft(), ..choice(draft, Family::Standard) },
            choice(standard, Family::Standard),
            choice(paper, Family::Paper),
        ];
        choices.extend(self.standard.iter().map(|changes| changes.apply(choice(standard, Family::Standard))));
        choices.extend(self.paper.iter().map(|changes| changes.apply(choice(paper, Family::Paper))));
        choices
    }
}

/// Replaces what is given, and says so in the name.
fn set<T: Clone + std::fmt::Debug>(name: &mut String, what: &str, value: &Option<T>, place: &mut T) {
    if let Some(value) = value {
        *place = value.clone();
        name.push_str(&format!(", {what} {value:?}"));
    }
}

impl OfStandard {
    fn apply(&self, mut choice: Choice) -> Choice {
        let Choice { name, standard, .. } = &mut choice;
        set(name, "radius", &self.radius, &mut standard.radius);
        set(name, "fit", &self.fit_radius, &mut standard.fit_radius);
        set(name, "features", &self.feature_radius, &mut standard.feature_radius);
        choice
    }
}

impl OfPaper {
    fn apply(&self, mut choice: Choice) -> Choice {
        let Choice { name, paper, reservoir, .. } = &mut choice;
        set(name, "windows", &self.windows, &mut paper.windows);
        set(name, "grid spacing", &self.grid_spacing, &mut paper.grid_spacing);
        set(name, "upsampling", &self.upsampling, &mut paper.upsampling);
        set(name, "samples for information", &self.mi_samples, &mut paper.mi_samples);
        set(name, "statistics side", &self.statistics_side, &mut paper.statistics_side);
        set(name, "reservoir", &self.reservoir, reservoir);
        choice
    }
}

impl Choice {
    fn filter(&self, store: &Store, seed: u64) -> Filtered {
        match self.family {
            Family::Unfiltered => filter::unfiltered(store),
            Family::Standard => standard::filter(store, &self.standard),
            Family::Paper => filter::prpf::filter(store, &self.paper, seed),
        }
    }
}

/// Measures every choice on a scene: mean of the error over the seeds, median of the seconds.
pub fn measure(
    bench: &mut Bench,
    bed: &Bed,
    accel: &Accel,
    settings: &Settings,
) -> anyhow::Result<Vec<Cost>> {
    let (width, height) = (bed.reference.image.width(), bed.reference.image.height());
    let megapixels = (width * height) as f64 / 1e6;
    // Stores that differ in their reservoirs hold the same samples.
    let mut rendered: Option<((u64, usize), Store)> = None;
    let choices = settings.choices();
    let mut found = vec![Vec::new(); choices.len()];
    for seed in 0..settings.seeds {
        for (choice, found) in choices.iter().zip(&mut found) {
            let Choice { name, reservoir, .. } = choice;
            bench.doing(format!("{}: filter {name}, seed {seed}", bed.name));
            let changed = format!(
                "filter={name:?} spp={} repeats={} size={width}x{height} reference-spp={}",
                settings.spp, settings.repeats, bed.reference.spp
            );
            let measured = bench.ledger.measure(Key::new(&bed.name, seed, changed), &[], || {
                if rendered.as_ref().is_none_or(|(of, _)| *of != (seed, *reservoir)) {
                    let renderer = Renderer::new(&bed.scene, accel, seed);
                    let mut store = sampling::store(&renderer, *reservoir, seed);
                    sampling::add(&renderer, &mut store, settings.spp);
                    rendered = Some(((seed, *reservoir), store));
                }
                let (_, store) = rendered.as_ref().context("a store was rendered")?;
                let (filtered, first) = sampling::timed(|| choice.filter(store, seed));
                let again = (1..settings.repeats).map(|_| sampling::timed(|| choice.filter(store, seed)).1);
                let seconds = median(std::iter::once(first).chain(again));
                Ok(values([("relmse", bed.error(&filtered.image)), ("seconds", seconds)]))
            })?;
            found.push(measured);
        }
    }
    let cost = |found: &Vec<crate::ledger::Values>| Cost {
        seconds: median(found.iter().map(|values| values["seconds"])) / megapixels,
        error: found.iter().map(|values| values["relmse"]).sum::<f64>() / found.len() as f64,
    };
    Ok(found.iter().map(cost).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_named_after_what_they_change() {
        let settings = Settings {
            spp: 8,
            seeds: 1,
            repeats: 1,
            standard: vec![OfStandard { radius: Some(3), fit_radius: Some(0), ..OfStandard::default() }],
            paper: vec![OfPaper { reservoir: Some(4), ..OfPaper::default() }],
        };
        let choices = settings.choices();
        let names: Vec<&str> = choices.iter().map(|choice| choice.name.as_str()).collect();
        let expected =
            ["unfiltered", "draft", "standard", "paper", "standard, radius 3, fit 0", "paper, reservoir 4"];
        assert_eq!(names, expected);
        assert_eq!((choices[4].standard.radius, choices[4].standard.fit_radius), (3, 0));
        assert_eq!(choices[5].reservoir, 4);
        assert_eq!(choices[3].reservoir, RESERVOIR);
    }
}
