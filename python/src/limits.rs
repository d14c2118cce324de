//! The limits of a render: its budgets, and the bounds of a pixel's samples.

use prpf::adaptive::NO_CEILING;
use prpf::progressive::{Budget, MIN_SPP};
use pyo3::prelude::*;

use crate::errors::value_error;
use crate::placement::Placement;
use crate::scene::Scene;

/// The limits of a render, as arguments give them.
pub struct Limits {
    /// Samples per pixel, on average.
    pub spp: Option<u32>,
    pub seconds: Option<f64>,
    pub target_error: Option<f64>,
    /// Floor per pixel.
    pub min_spp: Option<u32>,
    /// Ceiling per pixel.
    pub max_spp: Option<u32>,
}

impl Limits {
    /// Returns the budget: without any the scene's samples per pixel, with a map of counts the mean of these.
    ///
    /// # Errors
    /// What `prpf render` refuses: samples per pixel beside a map of counts, or above another number that limits them.
    pub fn budget(&self, placement: &Placement, scene: &Scene) -> PyResult<Budget> {
        let Self { spp, seconds, target_error, min_spp, max_spp } = *self;
        if let Some(total) = placement.total() {
            if let Some(spp) = spp {
                return Err(value_error(format!(
                    "spp: found {spp} with absolute counts, which give the number of samples; accepted is one of them"
                )));
            }
            let (width, height) = scene.size();
            let mean = total.div_ceil((width * height) as u64) as u32;
            return Ok(Budget { spp: Some(mean), seconds, target_error });
        }
        let has_budget = spp.is_some() || seconds.is_some() || target_error.is_some();
        let (name, mean) = if has_budget { ("spp", spp) } else { ("the scene's spp", Some(scene.scene.spp)) };
        for (above, found, name, limit) in
            [("min_spp", min_spp, name, mean), ("spp", spp, "max_spp", max_spp)]
        {
            // A limit of 0 is refused as such
            if let (Some(found), Some(limit @ 1..)) = (found, limit)
                && found > limit
            {
                return Err(value_error(format!(
                    "{above}: found {found}; accepted is a number up to {name}, {limit}"
                )));
            }
        }
        Ok(Budget { spp: mean, seconds, target_error })
    }

    /// Returns floor and ceiling per pixel.
    pub fn bounds(&self) -> [u32; 2] {
        let ceiling = self.max_spp.unwrap_or(NO_CEILING);
        [self.min_spp.unwrap_or(MIN_SPP.min(ceiling)), ceiling]
    }
}
