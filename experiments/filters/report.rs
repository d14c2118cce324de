//! Writes the report of the experiment `filters`.

use std::collections::BTreeSet;

use prpf::adaptive::Sampling;
use prpf::filter::Denoiser;

use super::Sample;
use super::settings::Settings;
use crate::report::{Report, median, number, with_interval};
use crate::session::Session;
use crate::statistics;

/// What others are compared with: the better of the presets of Open Image Denoise, or `nlm` where it is missing.
const REFERENCES: [&str; 2] = ["oidn", "nlm"];

/// Errors, with their headings.
const ERRORS: [(&str, &str); 3] = [
    ("trimmed relmse", "relMSE without the worst 0.1 % of the pixels"),
    ("relmse", "relMSE"),
    ("flip", "ꟻLIP"),
];

/// Where the samples of a ratio come from.
#[derive(Clone, Copy)]
struct Samples {
    name: &'static str,
    /// Those of the denoiser that is compared.
    own: Sampling,
    /// Those of the reference.
    reference: Sampling,
}

const UNIFORM: Samples = Samples { name: "uniform", own: Sampling::Uniform, reference: Sampling::Uniform };
const ADAPTIVE: Samples =
    Samples { name: "adaptive", own: Sampling::Adaptive, reference: Sampling::Adaptive };
const ADAPTIVE_OVER_UNIFORM: Samples =
    Samples { name: "adaptive over uniform", own: Sampling::Adaptive, reference: Sampling::Uniform };

/// A report in the making.
struct Results<'a> {
    settings: &'a Settings,
    /// Names of the denoisers.
    names: Vec<String>,
    samples: &'a [Sample],
    /// Method that others are compared with.
    reference: &'static str,
}

/// Writes the report.
pub fn write(
    session: &Session,
    settings: &Settings,
    denoisers: &[&dyn Denoiser],
    samples: &[Sample],
) -> anyhow::Result<()> {
    // Choose the reference
    let names: Vec<String> = denoisers.iter().map(|denoiser| denoiser.name().to_string()).collect();
    let is_there = |method: &&str| denoisers.iter().any(|denoiser| denoiser.name().method == *method);
    let reference = REFERENCES.into_iter().find(is_there).expect("nlm is always there");
    let results = Results { settings, names, samples, reference };

    // Compare the errors
    let mut report =
        Report::new("Which denoiser makes the best image of the same samples?", &results.finding());
    for (error, heading) in ERRORS {
        report.section(heading);
        report.paragraph(&format!(
            "Over the better preset of `{reference}` in each view, geometric mean and its 95 % interval, then the median and \
             the largest of the views' ratios. {} Samples are the same for all, adaptive ones driven by `nlm`, but in the last rows, \
             where those of `{reference}` are as many uniform ones. Adaptive samples are left out where all are uniform, and views \
             where an error is lost in the reference's noise ({}).",
            results.counted(),
            results.lost(error)
        ));
        let kinds = [UNIFORM, ADAPTIVE, ADAPTIVE_OVER_UNIFORM];
        let rows = results.each(&kinds, |samples, spp| results.ratios_row(samples, spp, error));
        report.table(&results.head(&["samples", "spp"]), &rows);
    }
    let references = results.scenes().into_iter().map(|scene| {
        let sample = samples.iter().find(|sample| sample.scene == scene);
        format!("{scene} {}", number(sample.map_or(f64::NAN, |sample| sample.reference_relmse), 2))
    });
    report.section("References");
    report.paragraph(&format!(
        "Expected relMSE of the references, from their halves. It is not part of any relMSE here, but makes them uncertain: {}.",
        references.collect::<Vec<_>>().join(", ")
    ));

    // Compare view by view
    report.section("View by view");
    report.paragraph(
        "relMSE without the worst 0.1 % of the pixels, uniform samples; ratios as above, of `learned standard` and \
         `nlm standard`.",
    );
    let spps: Vec<String> = settings.spp.iter().map(u32::to_string).collect();
    let head: Vec<&str> = ["view"].into_iter().chain(spps.iter().map(String::as_str)).collect();
    report.table(&head, &results.view_rows());

    // Compare brightness and time
    report.section("Brightness");
    report.paragraph("Mean over views of the image's deviation from the reference's mean, in per cent.");
    let rows = results.each(&[UNIFORM, ADAPTIVE], |samples, spp| results.brightness_row(samples, spp));
    report.table(&results.head(&["samples", "spp"]), &rows);
    report.section("Time");
    report.paragraph(
        "Median seconds of a pass per million pixels. A pass makes the image and its variance; `oidn` takes its variance from the \
         halves, so its pass filters three images.",
    );
    let seconds = results.names.iter().map(|name| number(results.seconds(name), 2)).collect();
    report.table(&results.head(&[]), &[seconds]);
    let seeds = format!("0 to {}", settings.seeds - 1);
    report.write(session, &seeds)
}

/// The geometric means of the known ratios of some groups, but for groups that have none.
fn means_of_groups(groups: &[Vec<&str>], ratio: impl Fn(&str) -> f64) -> Vec<f64> {
    let mean = |views: &Vec<&str>| {
        let ratios: Vec<f64> = views.iter().map(|view| ratio(view)).filter(|ratio| !ratio.is_nan()).collect();
        statistics::geometric_mean(&ratios).mean
    };
    groups.iter().map(mean).filter(|mean| !mean.is_nan()).collect()
}

impl Results<'_> {
    fn finding(&self) -> String {
        let ratio = |samples, name: &str, spp| {
            let ratios = self.by_models(samples, spp, name, "trimmed relmse");
            with_interval(statistics::geometric_mean(&ratios), 2)
        };
        let of = |samples, name: &str| {
            let ratios = self.counts(samples).map(|spp| format!("{} at {spp}", ratio(samples, name, spp)));
            let ratios: Vec<String> = ratios.collect();
            if ratios.is_empty() { "no value".to_owned() } else { ratios.join(", ") }
        };
        format!(
            "With the same uniform samples `learned standard` has this error relative to the better preset of `{}` (relMSE \
             without the worst 0.1 %, geometric mean and its 95 % interval, by samples per pixel): {}. `nlm standard` has {}. With \
             the same adaptive samples `learned standard` has {}; with adaptive samples, over the other with as many uniform ones, \
             {}. {}",
            self.reference,
            of(UNIFORM, "learned standard"),
            of(UNIFORM, "nlm standard"),
            of(ADAPTIVE, "learned standard"),
            of(ADAPTIVE_OVER_UNIFORM, "learned standard"),
            self.counted(),
        )
    }

    /// Sample counts; of adaptive samples those where some differ from uniform ones.
    fn counts(&self, samples: Samples) -> impl Iterator<Item = u32> {
        let all = self.samples;
        let of = move |spp: u32, sampling: Sampling| {
            let chosen = all.iter().filter(move |s| s.spp == spp && s.sampling == sampling);
            chosen.map(|s| (&s.scene, s.seed, s.values["none relmse"].to_bits()))
        };
        let adapts = move |spp: &u32| of(*spp, Sampling::Uniform).ne(of(*spp, Sampling::Adaptive));
        self.settings.spp.iter().copied().filter(move |spp| samples.own == Sampling::Uniform || adapts(spp))
    }

    /// States over what the means are taken.
    fn counted(&self) -> String {
        let (views, models) = (self.scenes().len(), self.models().len());
        format!(
            "Means are over {models} groups of views with {views} views in all; views of the same models count as one."
        )
    }

    /// Names the views and sample counts at which an error of the reference's presets is not known.
    fn lost(&self, error: &str) -> String {
        let is_lost = |scene: &str, spp: u32| {
            let best = |sampling| self.best(scene, sampling, spp, error);
            best(Sampling::Uniform).is_nan() || best(Sampling::Adaptive).is_nan()
        };
        let views = self.scenes();
        let all = views.iter().flat_map(|scene| self.settings.spp.iter().map(move |&spp| (scene, spp)));
        let lost: Vec<String> = all
            .filter(|(scene, spp)| is_lost(scene, *spp))
            .map(|(scene, spp)| format!("{scene} at {spp}"))
            .collect();
        if lost.is_empty() { "none".to_owned() } else { lost.join(", ") }
    }

    /// The views that were measured, by their models.
    fn models(&self) -> Vec<Vec<&str>> {
        let scenes = self.scenes();
        let measured = |views: &'_ Vec<String>| -> Vec<&str> {
            scenes.iter().copied().filter(|scene| views.iter().any(|view| view == scene)).collect()
        };
        self.settings.views.iter().map(measured).filter(|views| !views.is_empty()).collect()
    }

    fn scenes(&self) -> BTreeSet<&str> {
        self.samples.iter().map(|sample| sample.scene.as_str()).collect()
    }

    /// Rows for each kind of samples, which begin with its name and the samples per pixel.
    fn each(&self, kinds: &[Samples], cells: impl Fn(Samples, u32) -> Vec<String>) -> Vec<Vec<String>> {
        let row = |kind: Samples, spp: u32| {
            [kind.name.to_owned(), spp.to_string()].into_iter().chain(cells(kind, spp)).collect()
        };
        let rows = |&kind: &Samples| self.counts(kind).map(move |spp| (kind, spp));
        kinds.iter().flat_map(rows).map(|(kind, spp)| row(kind, spp)).collect()
    }

    fn head<'a>(&'a self, first: &[&'a str]) -> Vec<&'a str> {
        first.iter().copied().chain(self.names.iter().map(String::as_str)).collect()
    }

    /// Mean over seeds of a quantity of a denoiser; NaN if one of them is lost in the reference's noise.
    fn mean(&self, scene: &str, sampling: Sampling, spp: u32, name: &str, quantity: &str) -> f64 {
        let is_meant = |s: &&Sample| s.scene == scene && s.sampling == sampling && s.spp == spp;
        let key = format!("{name} {quantity}");
        let known = |value: f64| if value > f64::MIN_POSITIVE { value } else { f64::NAN };
        let values: Vec<f64> = self.samples.iter().filter(is_meant).map(|s| known(s.values[&key])).collect();
        values.iter().sum::<f64>() / values.len() as f64
    }

    /// Error of the better preset of the reference; NaN if that of one of them is not known.
    fn best(&self, scene: &str, sampling: Sampling, spp: u32, error: &str) -> f64 {
        let presets = self.names.iter().filter(|other| other.split(' ').next() == Some(self.reference));
        presets.map(|preset| self.mean(scene, sampling, spp, preset, error)).fold(
            f64::INFINITY,
            |best: f64, error| if best.is_nan() || error.is_nan() { f64::NAN } else { best.min(error) },
        )
    }

    /// Error of a denoiser over that of the better preset of the reference.
    fn ratio(&self, scene: &str, samples: Samples, spp: u32, name: &str, error: &str) -> f64 {
        self.mean(scene, samples.own, spp, name, error) / self.best(scene, samples.reference, spp, error)
    }

    /// The ratios of a denoiser by models: the geometric means of their views.
    fn by_models(&self, samples: Samples, spp: u32, name: &str, error: &str) -> Vec<f64> {
        means_of_groups(&self.models(), |view| self.ratio(view, samples, spp, name, error))
    }

    fn ratios_row(&self, samples: Samples, spp: u32, error: &str) -> Vec<String> {
        let cell = |name: &String| {
            let mean = statistics::geometric_mean(&self.by_models(samples, spp, name, error));
            let views = self.scenes();
            let ratios = || views.iter().map(|view| self.ratio(view, samples, spp, name, error));
            let [middle, largest] =
                [median(ratios()), ratios().fold(0.0, f64::max)].map(|ratio| number(ratio, 2));
            format!("{}, {middle}, {largest}", with_interval(mean, 2))
        };
        self.names.iter().map(cell).collect()
    }

    fn brightness_row(&self, samples: Samples, spp: u32) -> Vec<String> {
        let cell = |name: &String| {
            let scenes = self.scenes();
            let off = |scene: &&str| (self.mean(scene, samples.own, spp, name, "brightness") - 1.0).abs();
            number(100.0 * scenes.iter().map(off).sum::<f64>() / scenes.len() as f64, 2)
        };
        self.names.iter().map(cell).collect()
    }

    fn view_rows(&self) -> Vec<Vec<String>> {
        let row = |scene: &str| {
            let cell = |&spp: &u32| {
                let ratios = ["learned standard", "nlm standard"]
                    .map(|name| number(self.ratio(scene, UNIFORM, spp, name, "trimmed relmse"), 2));
                ratios.join(" / ")
            };
            std::iter::once(scene.to_owned()).chain(self.settings.spp.iter().map(cell)).collect()
        };
        self.scenes().into_iter().map(row).collect()
    }

    /// Median seconds of a pass.
    fn seconds(&self, name: &str) -> f64 {
        let key = format!("{name} seconds");
        median(self.samples.iter().map(|sample| sample.values[&key] / sample.pixels as f64 * 1e6))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_of_the_same_models_count_as_one() {
        let ratio = |view: &str| if view.ends_with("-dof") { 8.0 } else { 2.0 };
        let means = means_of_groups(&[vec!["ajar", "ajar-dof"], vec!["pool"]], ratio);
        assert!((means[0] - 4.0).abs() < 1e-12 && (means[1] - 2.0).abs() < 1e-12, "{means:?}");
        // What is not known counts nowhere
        let ratio = |view: &str| if view == "ajar" { f64::NAN } else { 8.0 };
        let means = means_of_groups(&[vec!["ajar", "ajar-dof"], vec!["ajar"]], ratio);
        assert!(means.len() == 1 && (means[0] - 8.0).abs() < 1e-12, "{means:?}");
    }
}
