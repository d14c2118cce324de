//! The views of a render: the image, its maps and its feature buffers, each with its colour scale.

use serde::{Deserialize, Serialize};

use super::colour_scale::{ColourScale, Curve};
use super::comparison::Comparison;
use super::relative_error::relative_error;
use crate::filter::{self, FilterResult};
use crate::image::Planes;
use crate::progressive::Settings;
use crate::stats::{Block, Layout, Part, Store};

/// Smallest budget for which the scale of sample counts is made, in samples per pixel.
const SMALLEST_BUDGET: u32 = 16;
/// Ratio of that scale's upper end to the budget: adaptive sampling gives some pixels that many times more.
const SAMPLES_HEADROOM: u64 = 8;
/// Lower end of the scales of relative errors; noise below it is invisible.
const LOWEST_ERROR: f32 = 1e-5;

/// An image that the page can show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum View {
    Filtered,
    Raw,
    Samples,
    Error,
    Variance,
    Residual,
    Failure,
    Albedo,
    Normal,
    Reference,
    Difference,
    Flip,
}

/// What the planes of views are made of.
#[derive(Clone, Copy)]
pub struct ViewSource<'a> {
    pub store: &'a Store,
    pub shown: Option<&'a FilterResult>,
    pub comparison: Option<&'a Comparison>,
}

impl View {
    pub const ALL: [View; 12] = [
        View::Filtered,
        View::Raw,
        View::Samples,
        View::Error,
        View::Variance,
        View::Residual,
        View::Failure,
        View::Albedo,
        View::Normal,
        View::Reference,
        View::Difference,
        View::Flip,
    ];

    /// The maps of a filter pass.
    pub const PASS_MAPS: [View; 3] = [View::Error, View::Residual, View::Failure];

    /// Returns the view's index in [`Self::ALL`] and in the headers of frames.
    pub fn index(self) -> usize {
        self as usize
    }

    /// Tests whether the view comes from a filter pass; the others come from the store alone.
    pub fn is_filtered(self) -> bool {
        matches!(
            self,
            View::Filtered | View::Error | View::Residual | View::Failure | View::Difference | View::Flip
        )
    }

    /// Tests whether a render with this layout, with or without a reference, has the view.
    pub fn exists(self, layout: &Layout, has_reference: bool) -> bool {
        match self {
            View::Albedo => layout.block(Block::Albedo).is_some(),
            View::Normal => layout.block(Block::Normal1).is_some(),
            View::Reference | View::Difference | View::Flip => has_reference,
            _ => true,
        }
    }

    /// Returns the view's planes (1 or 3); `None` before the first filter pass that makes them.
    pub fn planes(self, source: &ViewSource) -> Option<Planes> {
        let ViewSource { store, shown, comparison } = *source;
        let means = |block| Some(store.means(Part::Whole, store.layout().block(block)?));
        let raw = || store.means(Part::Whole, store.layout().radiance());
        match self {
            View::Filtered => shown.map(|shown| shown.image.clone()),
            View::Raw => Some(raw()),
            View::Samples => Some(store.count_plane()),
            View::Error => shown.map(|shown| relative_error(&shown.error, &shown.image)),
            View::Variance => Some(relative_error(&filter::variance_of_mean(store), &raw())),
            View::Residual => shown.map(|shown| shown.residual.clone()),
            View::Failure => Some(shown?.interpolation.as_ref()?.failure.clone()),
            View::Albedo => means(Block::Albedo),
            View::Normal => means(Block::Normal1),
            View::Reference => comparison.map(|found| found.reference().clone()),
            View::Difference => comparison?.difference().cloned(),
            View::Flip => comparison?.flip().cloned(),
        }
    }

    /// Returns the colour scale of a map; `None` for a view that is a colour image. The scale follows from the settings
    /// and not from the image, so that a colour keeps its meaning while the image converges.
    pub fn scale(self, settings: &Settings) -> Option<ColourScale> {
        let scale = |unit, curve, low, high| Some(ColourScale { unit, curve, low, high, mark: None });
        match self {
            View::Samples => {
                let budget = u64::from(settings.budget.spp.unwrap_or(0).max(SMALLEST_BUDGET));
                // A power of two, which the legend can name.
                let high = (budget * SAMPLES_HEADROOM).next_power_of_two() as f32;
                let mark = settings.budget.spp.map(|spp| spp as f32);
                Some(ColourScale { unit: "samples per pixel", curve: Curve::Log2, low: 1.0, high, mark })
            }
            View::Error => Some(ColourScale {
                unit: "relative squared error (relMSE)",
                curve: Curve::Log10,
                low: LOWEST_ERROR,
                high: 1.0,
                mark: settings.budget.target_error.map(|e| e as f32),
            }),
            View::Variance => scale("relative variance of the mean", Curve::Log10, LOWEST_ERROR, 1.0),
            View::Residual => Some(ColourScale {
                unit: "filter residual ÷ expected noise",
                curve: Curve::Log2,
                low: 1.0 / 16.0,
                high: 16.0,
                // The filter changes the pixel by just what noise explains.
                mark: Some(1.0),
            }),
            View::Failure => scale("fraction of windows where interpolation failed", Curve::Linear, 0.0, 1.0),
            View::Difference => scale("squared difference (relMSE)", Curve::Log10, LOWEST_ERROR, 1.0),
            View::Flip => scale("visible difference (FLIP)", Curve::Linear, 0.0, 1.0),
            View::Filtered | View::Raw | View::Albedo | View::Normal | View::Reference => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progressive::Budget;

    #[test]
    fn indices_are_those_of_the_list() {
        for (i, view) in View::ALL.into_iter().enumerate() {
            assert_eq!(view.index(), i);
        }
    }

    #[test]
    fn the_scale_of_samples_holds_the_largest_budget() {
        let scale = |spp| {
            let budget = Budget { spp: Some(spp), ..Budget::default() };
            View::Samples.scale(&Settings { budget, ..Settings::default() }).unwrap()
        };
        assert_eq!((scale(1 << 10).high, scale(1 << 10).mark), (8192.0, Some(1024.0)));
        assert_eq!(scale(u32::MAX).high, 8.0 * 2f32.powi(32));
    }
}
