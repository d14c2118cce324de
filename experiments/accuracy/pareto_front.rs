//! Reports cost and error of the filter variants, and their Pareto front.
//!
//! A variant is on the front if no other is both faster and better.

use super::filter_costs::Cost;
use super::filter_variant::{FilterVariant, Method, NLM, PRESETS};
use super::scene_results::SceneResults;
use super::settings::Settings;
use crate::plot::{Panel, Plot, Series};
use crate::report::{Report, number};
use crate::session::Session;
use crate::statistics::{geometric_mean, pareto_front};

/// Mean costs of the variants over the scenes.
pub struct ParetoFront {
    variants: Vec<FilterVariant>,
    /// Geometric means over the scenes: seconds per million pixels, and ratio of the error to that of `nlm`.
    costs: Vec<Cost>,
    on_front: Vec<bool>,
    /// Samples per pixel of the filtered stores.
    spp: u32,
    /// Runs whose median is a time.
    repeats: usize,
}

impl ParetoFront {
    pub fn new(settings: &Settings, all: &[SceneResults]) -> Self {
        let variants = settings.filters.variants();
        let nlm = variants.iter().position(|variant| variant.name == NLM).unwrap_or(0);
        let over_scenes = |value: &dyn Fn(&SceneResults) -> f64| {
            geometric_mean(&all.iter().map(value).collect::<Vec<_>>()).mean
        };
        let costs: Vec<Cost> = (0..variants.len())
            .map(|i| Cost {
                seconds: over_scenes(&|m| m.filters[i].seconds),
                error: over_scenes(&|m| m.filters[i].error / m.filters[nlm].error),
            })
            .collect();
        let on_front = pareto_front(&costs.iter().map(|c| (c.seconds, c.error)).collect::<Vec<_>>());
        Self { variants, costs, on_front, spp: settings.filters.spp, repeats: settings.filters.repeats }
    }

    fn preset(&self, name: &str) -> (Cost, bool) {
        let i = self.variants.iter().position(|variant| variant.name == name).unwrap_or(0);
        (self.costs[i], self.on_front[i])
    }

    /// The finding, in a sentence.
    pub fn finding(&self) -> String {
        let place = |on_front| if on_front { "on" } else { "off" };
        let (nlm, nlm_is_on_front) = self.preset(NLM);
        let others = PRESETS.into_iter().filter(|&name| name != NLM).map(|name| {
            let (cost, on_front) = self.preset(name);
            let [time, error] = [cost.seconds / nlm.seconds, cost.error].map(|ratio| number(ratio, 2));
            format!("`{name}` {time} of that time for {error} of the error ({} it)", place(on_front))
        });
        format!(
            "Of the filters, at {} samples per pixel, `{NLM}` takes {} s per million pixels and is {} the front of error \
             against time; {}.",
            self.spp,
            number(nlm.seconds, 2),
            place(nlm_is_on_front),
            others.collect::<Vec<_>>().join(", "),
        )
    }

    /// Writes the section.
    pub fn write(&self, session: &Session, report: &mut Report) -> anyhow::Result<()> {
        report.section("The filters' settings");
        report.paragraph(&format!(
            "One store of {} samples per pixel, uniformly sampled, filtered with each setting: seconds per million pixels \
             (with all cores of this machine; each the median of runs: {}) and ratio of relMSE to that of `nlm`, geometric means over the scenes. A \
             setting is on the front if no other is both faster and better. Settings that are not named are those of \
             `nlm` or `prpf`; `fit` is the radius of the linear fit, 0 without one.",
            self.spp, self.repeats,
        ));
        self.plot().write(&session.out.join("filters.svg"))?;
        report.picture(
            "filters.svg",
            "Error against time of the filters' settings, geometric means over the scenes.",
        );
        self.table(report);
        report.paragraph(
            "Two constants are not settings, and so do not vary: the number of bins of mutual information (its histograms \
             are counted by words of bits, for five bins) and the 4×4 nodes that weights are interpolated from.",
        );
        Ok(())
    }

    fn is_preset(&self, i: usize) -> bool {
        PRESETS.contains(&self.variants[i].name.as_str())
    }

    /// Points of the chosen variants, ascending in seconds.
    fn points(&self, chosen: &dyn Fn(usize) -> bool) -> Vec<(f64, f64)> {
        let mut points: Vec<(f64, f64)> = (0..self.variants.len())
            .filter(|&i| self.variants[i].method != Method::Unfiltered && chosen(i))
            .map(|i| (self.costs[i].seconds, self.costs[i].error))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    }

    fn plot(&self) -> Plot<'static> {
        let changed = |method| self.points(&|i| self.variants[i].method == method && !self.is_preset(i));
        let preset = |name: &str| Series::points(name, self.points(&|i| self.variants[i].name == name));
        let [learned, learned_draft, nlm, draft, prpf] = PRESETS.map(preset);
        let panel = |title: &str, series| Panel { title: format!("{title}, {} spp", self.spp), series };
        let nlm_series = vec![
            Series::new("front", self.points(&|i| self.on_front[i])),
            Series::points("settings of nlm", changed(Method::Nlm)),
            draft,
            nlm.clone(),
            learned,
            learned_draft,
        ];
        let prpf_series = vec![Series::points("settings of prpf", changed(Method::Prpf)), nlm, prpf];
        Plot {
            x: "seconds per million pixels",
            y: "ratio of relMSE to that of nlm",
            panels: vec![
                panel("Settings of nlm, and learned", nlm_series),
                panel("Settings of prpf", prpf_series),
            ],
            slope: false,
            columns: 2,
        }
    }

    fn table(&self, report: &mut Report) {
        let mut order: Vec<usize> = (0..self.variants.len()).collect();
        order.sort_by(|&i, &j| self.costs[i].seconds.total_cmp(&self.costs[j].seconds));
        let row = |i: usize| {
            let name = &self.variants[i].name;
            vec![
                if self.is_preset(i) { format!("**{name}**") } else { name.clone() },
                number(self.costs[i].seconds, 2),
                number(self.costs[i].error, 3),
                if self.on_front[i] { "yes".to_owned() } else { String::new() },
            ]
        };
        let rows: Vec<_> = order.into_iter().map(row).collect();
        let head = ["setting", "seconds per million pixels", "ratio of error to that of nlm", "on the front"];
        report.table(&head, &rows);
    }
}
