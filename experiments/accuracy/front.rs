//! The filters' settings by cost and error, and which of them nothing beats.

use super::filters::{Choice, Cost, Family, QUALITIES};
use super::{Measured, Settings};
use crate::bench::Bench;
use crate::plot::{Panel, Plot, Series};
use crate::report::{Report, number};
use crate::statistics::{geometric_mean, pareto_front};

/// What choices of a filter cost on average over the scenes.
pub struct Front {
    choices: Vec<Choice>,
    /// Geometric means over the scenes: seconds per million pixels, and error over `standard`'s.
    costs: Vec<Cost>,
    front: Vec<bool>,
    /// Samples per pixel of what was filtered.
    spp: u32,
}

impl Front {
    pub fn new(settings: &Settings, all: &[Measured]) -> Self {
        let choices = settings.filters.choices();
        let standard = choices.iter().position(|c| c.name == QUALITIES[1]).unwrap_or(0);
        let over_scenes =
            |of: &dyn Fn(&Measured) -> f64| geometric_mean(&all.iter().map(of).collect::<Vec<_>>()).mean;
        let costs: Vec<Cost> = (0..choices.len())
            .map(|i| Cost {
                seconds: over_scenes(&|m| m.filters[i].seconds),
                error: over_scenes(&|m| m.filters[i].error / m.filters[standard].error),
            })
            .collect();
        let front = pareto_front(&costs.iter().map(|c| (c.seconds, c.error)).collect::<Vec<_>>());
        Self { choices, costs, front, spp: settings.filters.spp }
    }

    fn of(&self, name: &str) -> (Cost, bool) {
        let i = self.choices.iter().position(|choice| choice.name == name).unwrap_or(0);
        (self.costs[i], self.front[i])
    }

    pub fn finding(&self) -> String {
        let ([draft, standard, paper], on_front): ([Cost; 3], Vec<bool>) = {
            let found = QUALITIES.map(|name| self.of(name));
            (found.map(|(cost, _)| cost), found.iter().map(|(_, front)| *front).collect())
        };
        let place = |on: bool| if on { "on" } else { "off" };
        format!(
            "Of the filters, at {} samples per pixel, `standard` takes {} s per million pixels and is {} the front of error \
             against time; `draft` takes {} of that time for {} of its error ({} the front), `paper` {} of the time for {} of \
             the error ({} the front).",
            self.spp,
            number(standard.seconds, 2),
            place(on_front[1]),
            number(draft.seconds / standard.seconds, 2),
            number(draft.error, 3),
            place(on_front[0]),
            number(paper.seconds / standard.seconds, 2),
            number(paper.error, 3),
            place(on_front[2]),
        )
    }

    pub fn write(&self, bench: &Bench, report: &mut Report) -> anyhow::Result<()> {
        report.section("The filters' settings");
        report.paragraph(&format!(
            "One store of {} samples per pixel, uniform, filtered with each setting: seconds per million pixels (this \
             machine's cores together) and relMSE over that of `standard`, geometric means over the scenes. \
             A setting is on the front if no other is both faster and better. What is not named is as in `{}` or `{}`; \
             `fit` is the radius of the linear fit, 0 without one.",
            self.spp,
            QUALITIES[1],
            QUALITIES[2],
        ));
        let points = |chosen: &dyn Fn(usize) -> bool| {
            let mut points: Vec<(f64, f64)> = (0..self.choices.len())
                .filter(|&i| self.choices[i].family != Family::Unfiltered && chosen(i))
                .map(|i| (self.costs[i].seconds, self.costs[i].error))
                .collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            points
        };
        let named = |i: usize| QUALITIES.contains(&self.choices[i].name.as_str());
        let of = |family: Family| points(&|i| self.choices[i].family == family && !named(i));
        let quality = |name: &str| Series::points(name, points(&|i| self.choices[i].name == name));
        let [draft, standard, paper] = QUALITIES.map(quality);
        let panel = |title: &str, series| Panel { title: format!("{title}, {} spp", self.spp), series };
        let panels = vec![
            panel(
                "Settings of standard",
                vec![
                    Series::new("front", points(&|i| self.front[i])),
                    Series::points("of standard", of(Family::Standard)),
                    draft,
                    standard.clone(),
                ],
            ),
            panel("Settings of paper", vec![Series::points("of paper", of(Family::Paper)), standard, paper]),
        ];
        Plot {
            x: "seconds per million pixels",
            y: "relMSE over that of standard",
            panels,
            slope: false,
            columns: 2,
        }
        .write(&bench.out.join("filters.svg"))?;
        report.picture(
            "filters.svg",
            "Error against time of the filters' settings, geometric means over the scenes.",
        );
        let mut order: Vec<usize> = (0..self.choices.len()).collect();
        order.sort_by(|&i, &j| self.costs[i].seconds.total_cmp(&self.costs[j].seconds));
        let row = |i: usize| {
            let name = &self.choices[i].name;
            vec![
                if named(i) { format!("**{name}**") } else { name.clone() },
                number(self.costs[i].seconds, 2),
                number(self.costs[i].error, 3),
                if self.front[i] { "yes".to_owned() } else { String::new() },
            ]
        };
        let rows: Vec<_> = order.into_iter().map(row).collect();
        report.table(
            &["setting", "seconds per million pixels", "error over standard's", "on the front"],
            &rows,
        );
        report.paragraph(
            "Not settings, and so not varied: the number of bins of mutual information (its histograms are counted by \
             words of bits, for five bins) and the 4×4 nodes that weights are interpolated from.",
        );
        Ok(())
    }
}
