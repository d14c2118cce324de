//! The views of a render: the image, its maps and its feature buffers, each with its colour scale.

use serde::{Deserialize, Serialize};

use super::colour_scale::{ColourScale, Curve};
use crate::filter::{self, FilterResult};
use crate::image::Planes;
use crate::image::metrics::RELMSE_EPSILON;
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
}

impl View {
    pub const ALL: [View; 9] = [
        View::Filtered,
        View::Raw,
        View::Samples,
        View::Error,
        View::Variance,
        View::Residual,
        View::Failure,
        View::Albedo,
        View::Normal,
    ];

    /// Returns the view's index in [`Self::ALL`] and in the headers of frames.
    pub fn index(self) -> usize {
        self as usize
    }

    /// Tests whether the view comes from a filter pass; the others come from the store alone.
    pub fn is_filtered(self) -> bool {
        matches!(self, View::Filtered | View::Error | View::Residual | View::Failure)
    }

    /// Tests whether a render with this layout has the view.
    pub fn exists(self, layout: &Layout) -> bool {
        match self {
            View::Albedo => layout.block(Block::Albedo).is_some(),
            View::Normal => layout.block(Block::Normal1).is_some(),
            _ => true,
        }
    }

    /// Returns the view's planes (1 or 3); `None` before the first filter pass that makes them.
    pub fn planes(self, store: &Store, shown: Option<&FilterResult>) -> Option<Planes> {
        let means = |block| Some(store.means(Part::Whole, store.layout().block(block)?));
        let raw = || store.means(Part::Whole, store.layout().radiance());
        match self {
            View::Filtered => shown.map(|shown| shown.image.clone()),
            View::Raw => Some(raw()),
            View::Samples => Some(store.count_plane()),
            View::Error => shown.map(|shown| relative(&shown.error, &shown.image)),
            View::Variance => Some(relative(&filter::variance_of_mean(store), &raw())),
            View::Residual => shown.map(|shown| shown.residual.clone()),
            View::Failure => Some(shown?.interpolation.as_ref()?.failure.clone()),
            View::Albedo => means(Block::Albedo),
            View::Normal => means(Block::Normal1),
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
            View::Filtered | View::Raw | View::Albedo | View::Normal => None,
        }
    }
}

/// Returns the mean over channels of squared errors (1 or 3 planes), relative to `image` as in relMSE.
fn relative(squares: &Planes, image: &Planes) -> Planes {
    let mut map = Planes::new(image.width(), image.height(), 1);
    for channel in 0..3 {
        let squares = squares.plane(channel.min(squares.count() - 1));
        for ((out, square), value) in map.data_mut().iter_mut().zip(squares).zip(image.plane(channel)) {
            *out += square / (value * value + RELMSE_EPSILON as f32) / 3.0;
        }
    }
    map
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

    #[test]
    fn errors_are_relative_to_the_image_as_the_target_is() {
        let mut image = Planes::new(1, 1, 3);
        image.data_mut().copy_from_slice(&[0.0, 1.0, 2.0]);
        let mut error = Planes::new(1, 1, 1);
        error.data_mut()[0] = 0.02;
        let expected = (0.02 / 0.01 + 0.02 / 1.01 + 0.02 / 4.01) / 3.0;
        assert!((relative(&error, &image).data()[0] - expected).abs() < 1e-6);
    }
}
